"""The reference page names every key of the schema, with its type, unit, default and meaning."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest

from symphys.problem import json_schema, reference_page
from symphys.problem.schema.reference import row, sentence, type_of
from symphys.solvers import SOLVERS

OPTIONS = {name: each.Options for name, each in SOLVERS.items()}


@dataclass(frozen=True)
class Options:
    """Options of nothing.

    Attributes:
        rate: steps per second [1/s],
            or inf.
        kind: "a" or "b".
    """

    rate: float = float("inf")
    kind: str = "a"


@pytest.fixture(scope="module")
def schema() -> dict[str, Any]:
    return json_schema(OPTIONS)


def test_every_table_and_key_is_described(schema: dict[str, Any]) -> None:
    """A key that holds tables may leave it to them."""
    definitions = schema["$defs"]
    silent = [name for name, table in definitions.items() if not table.get("description")]
    for name, table in {"": schema, **definitions}.items():
        for key, value in table.get("properties", {}).items():
            if not value.get("description") and "$ref" not in value and "$ref" not in value.get("items", {}):
                silent.append(f"{name}.{key}")
    assert silent == []


def test_every_table_and_key_is_on_the_page(schema: dict[str, Any]) -> None:
    page = reference_page(OPTIONS)
    for name, key in schema["properties"].items():
        if name not in ("title", "description", "solvers", "solver", "fall"):
            assert f"`[[{name}]]`" in page if key.get("type") == "array" else f"`[{name}]`" in page
    cells = {word for line in page.splitlines() if line.startswith("| `") for word in line.split("|")[1].split(", ")}
    keys = {key for table in schema["$defs"].values() for key in table.get("properties", {})}
    assert {f"`{key}`" for key in keys} - {cell.strip() for cell in cells} == set()


def test_a_row_says_type_unit_default_and_meaning() -> None:
    page = reference_page(OPTIONS)
    meaning = "Mass of the whole body; needed unless density is given; 0: a frame between two joints."
    assert f"| `mass` | number >= 0 [kg] |  | {meaning} |" in page
    assert "| `dt` | number > 0 [s] | needed | Time step. |" in page
    assert "| `position` | `[x, y, z]` [m] | `[0, 0, 0]` | Position of the centre of mass. |" in page
    assert '| `at` | `"end"`, `"always"`, number >= 0 or `"end of flight"` [s] | `"end"` |' in page
    assert "| `clip` | number | `inf` | Largest norm of the scaled gradient; a longer one is shortened to it. |" in page


def test_a_default_in_words_goes_to_its_column_and_the_rest_stays() -> None:
    key = {"type": "number", "description": "where it is [m]; default 0. What hangs on it, too"}
    assert row("start", key, {}, "") == "| `start` | number [m] | 0 | Where it is. What hangs on it, too. |"
    two = {"type": "number", "description": "how far [rad], or [m]"}
    assert row("far", two, {}, "needed") == "| `far` | number | needed | How far [rad], or [m]. |"


def test_types_are_short() -> None:
    assert type_of({"type": "integer", "minimum": 1, "maximum": 10000}, {}) == "integer, 1 to 10,000"
    assert type_of({"type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 1}, {}) == "number > 0 and < 1"
    texts = {"type": "array", "items": {"type": "string"}}
    assert type_of({"anyOf": [{"type": "string"}, texts]}, {}) == "text or list of texts"
    assert type_of({"type": "array", "items": {"$ref": "#/$defs/A"}}, {"A": "[[a.b]]"}) == "list of [tables](#ab)"
    assert type_of({"$ref": "#/$defs/Bare"}, {}) == "`{ }`"


def test_tables_within_texts_are_code() -> None:
    assert sentence("a box: { size = [0.2, 1] }, in [[pair]]") == "A box: `{ size = [0.2, 1] }`, in `[[pair]]`."
    assert sentence("{ radius = 0.5 }") == "For instance `{ radius = 0.5 }`."
    assert sentence("z of all: [{ r = 1 }, ...]") == "z of all: `[{ r = 1 }, ...]`."


def test_options_are_described_by_their_docstring() -> None:
    keys = json_schema({"none": Options})["$defs"]["Options"]["properties"]
    assert keys["rate"]["description"] == "steps per second [1/s], or inf."
    page = reference_page({"none": Options})
    assert "| `rate` | number [1/s] | `inf` | Steps per second, or inf. |" in page


def test_a_renamed_option_says_so(schema: dict[str, Any]) -> None:
    keys = schema["$defs"]["StochasticOptions"]["properties"]
    assert keys["forget"] == {
        **keys["adjoint_discount"],
        "description": "old name of adjoint_discount",
        "deprecated": True,
    }
