"""The JSON Schema names every table and key, and knows no null."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import pytest

from symphys.model.shapes import SHAPES
from symphys.problem import json_schema
from symphys.problem.schema import Document


@dataclass(frozen=True)
class Options:
    iterations: int = 100
    clip: float | None = None


def definition(schema: dict[str, Any], reference: dict[str, Any]) -> dict[str, Any]:
    name = reference["$ref"].removeprefix("#/$defs/")
    found = schema["$defs"][name]
    assert isinstance(found, dict)
    return found


def test_every_table_and_key_is_there() -> None:
    schema = json_schema()
    assert set(schema["properties"]) == set(Document.model_fields)
    assert schema["required"] == ["simulation"]
    assert schema["anyOf"] == [{"required": ["body"]}, {"required": ["include"]}]
    assert schema["additionalProperties"] is False
    body = definition(schema, schema["properties"]["body"]["items"])
    assert {"name", "shape", "mass", "friction", "collides_with"} <= set(body["properties"])
    assert body["required"] == ["name"]
    assert body["properties"]["density"]["exclusiveMinimum"] == 0
    assert body["properties"]["position"]["minItems"] == 3


def test_shapes_are_there() -> None:
    schema = json_schema()
    shape = definition(schema, definition(schema, schema["properties"]["body"]["items"])["properties"]["shape"])
    assert set(shape["properties"]) == {*SHAPES, "spheres", "parts"}
    points = definition(schema, shape["properties"]["convex"])["properties"]["points"]
    assert (points["minItems"], points["maxItems"], points["items"]["minItems"]) == (4, 2000, 3)
    size = definition(schema, shape["properties"]["box"])["properties"]["size"]
    assert (size["minItems"], size["maxItems"], size["items"]["exclusiveMinimum"]) == (3, 3, 0)
    block = definition(schema, schema["properties"]["block"]["items"])
    assert block["required"] == ["name", "shape"]
    terrain = definition(schema, schema["properties"]["terrain"]["items"])
    assert {"height", "heights", "spacing", "origin", "group", "friction"} <= set(terrain["properties"])
    assert terrain["properties"]["heights"]["items"]["items"] == {"type": "number"}


def test_joints_are_there() -> None:
    schema = json_schema()
    joint = definition(schema, schema["properties"]["joint"]["items"])
    assert joint["required"] == ["name", "between"]
    assert {"ball", "hinge", "slider", "universal", "fixed", "point", "anchors", "motor", "spring"} <= set(
        joint["properties"]
    )
    assert all("description" in key for key in joint["properties"].values())
    motor = definition(schema, joint["properties"]["motor"])
    servo = definition(schema, motor["properties"]["servo"])
    assert servo["required"] == ["gain", "torque", "velocity"]
    assert servo["properties"]["torque"]["exclusiveMinimum"] == 0


def test_ground_may_be_left_out_but_is_no_null() -> None:
    text = json.dumps(json_schema(), allow_nan=False)
    assert '"null"' not in text
    assert "null" not in text


def test_references_lead_somewhere() -> None:
    schema = json_schema({"gradient": Options})
    text = json.dumps(schema)
    names = {part.split('"')[0] for part in text.split("#/$defs/")[1:]}
    assert names == set(schema["$defs"])


def test_solver_options() -> None:
    schema = json_schema({"gradient": Options})
    solver = schema["properties"]["solver"]
    assert solver["additionalProperties"] is False
    options = definition(schema, solver["properties"]["gradient"])
    assert options["properties"]["iterations"] == {"default": 100, "title": "Iterations", "type": "integer"}
    assert options["properties"]["clip"]["type"] == "number"
    assert options["additionalProperties"] is False


def test_without_solvers_any_option_passes() -> None:
    assert "properties" not in json_schema()["properties"]["solver"]


@pytest.mark.slow
def test_a_problem_may_include_its_bodies() -> None:
    schema = json_schema()
    include = definition(schema, schema["properties"]["include"]["items"])
    assert set(include["properties"]) == {"file", "position", "yaw_deg", "prefix", "keyframe", "self_collision", "base"}
    assert include["required"] == ["file"]
    assert all("description" in key for key in include["properties"].values())
    joint = definition(schema, schema["properties"]["joint"]["items"])
    assert {"start", "start_deg"} <= set(joint["properties"])
