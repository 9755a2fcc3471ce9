"""The JSON Schema of problem files, with which editors complete and check them."""

from __future__ import annotations

from collections.abc import Mapping
from math import isinf
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
    result: dict[str, Any] = plain({"$schema": DIALECT, **document, "$defs": shared})
    result["title"] = "symphys problem"
    return result


def plain(node: Any) -> Any:
    """The schema without null, which TOML does not have, and without infinite defaults, which JSON cannot write."""
    if isinstance(node, list):
        return [plain(item) for item in node]
    if not isinstance(node, dict):
        return node
    kept = {key: plain(value) for key, value in node.items() if value is not None and not infinite(value)}
    choices = kept.get("anyOf")
    if not isinstance(choices, list) or {"type": "null"} not in choices:
        return kept
    remaining = [choice for choice in choices if choice != {"type": "null"}]
    del kept["anyOf"]
    return {**remaining[0], **kept} if len(remaining) == 1 else {"anyOf": remaining, **kept}


def infinite(value: Any) -> bool:
    """Whether a value is an infinite number."""
    return isinstance(value, float) and isinf(value)
