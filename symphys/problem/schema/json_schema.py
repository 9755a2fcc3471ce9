"""The JSON Schema of problem files, with which editors complete and check them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from symphys.problem.reading.solver_options import options_model
from symphys.problem.schema import Document

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def json_schema(solvers: Mapping[str, type[Any]] | None = None) -> dict[str, Any]:
    """The schema of a whole file.

    Args:
        solvers: solver names to the dataclasses of their options, to be checked too; other names become errors.
    """
    models = {name: options_model(cls) for name, cls in (solvers or {}).items()}
    known: list[type[BaseModel]] = [Document, *models.values()]
    references, definitions = models_json_schema([(model, "validation") for model in known])
    shared: dict[str, Any] = definitions["$defs"]
    document = shared.pop("Document")
    if models:
        document["properties"]["solver"] = {
            "type": "object",
            "description": "options by solver",
            "properties": {name: references[model, "validation"] for name, model in models.items()},
            "additionalProperties": False,
        }
    result: dict[str, Any] = without_null({"$schema": DIALECT, **document, "$defs": shared})
    result["title"] = "symphys problem"
    return result


def without_null(node: Any) -> Any:
    """The schema without null, which TOML does not have."""
    if isinstance(node, list):
        return [without_null(item) for item in node]
    if not isinstance(node, dict):
        return node
    kept = {key: without_null(value) for key, value in node.items() if value is not None}
    choices = kept.get("anyOf")
    if not isinstance(choices, list) or {"type": "null"} not in choices:
        return kept
    remaining = [choice for choice in choices if choice != {"type": "null"}]
    del kept["anyOf"]
    return {**remaining[0], **kept} if len(remaining) == 1 else {"anyOf": remaining, **kept}
