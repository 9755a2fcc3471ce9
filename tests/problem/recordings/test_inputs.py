"""What drives a motion beside its measurements: the key ``inputs`` of [[recording]]."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from symphys.errors import ProblemError
from symphys.prediction.residuals import residuals_of
from symphys.problem import Problem, json_schema, problem_of_tables
from symphys.problem.recordings.summary import recording_lines

NAN = float("nan")
TABLE = {"time": [0.0, 0.1, 0.2], "q": [0.0, 1.0, 2.0], "u": [10.0, 20.0, 40.0], "f": [[1.0, 0.0, 0.0]] * 3}
FORCES = {**TABLE, "f": [[1.0, 0, 0], [NAN, 0, 0], [3.0, 0, 0]]}
DELAY = {"name": "late", "sets": "knee.command.delay"}


def tables(*recordings: dict[str, Any], **others: Any) -> dict[str, Any]:
    """An arm on a servo, with these [[recording]] tables; names, times and an angle are added."""
    measured = [{"value": "knee.angle", "columns": "q", "noise": 0.01}]
    named = [{"name": f"run{k}", "measured": measured, "table": TABLE, **each} for k, each in enumerate(recordings)]
    shape = {"box": {"size": [0.05, 0.05, 0.4]}}
    servo = {"servo": {"gain": 10.0, "torque": 5.0, "velocity": 4.0}}
    return {
        "simulation": {"duration": 0.2, "dt": 0.01},
        "body": [{"name": "arm", "shape": shape, "mass": 0.5, "position": [0, 0, 0.8]}],
        "joint": [
            {
                "name": "knee",
                "hinge": {"axis": [0, 1, 0]},
                "between": ["world", "arm"],
                "point": [0, 0, 1],
                "motor": servo,
            }
        ],
        "variable": [{"name": "gain", "sets": "knee.gain"}],
        "recording": named,
        **others,
    }


def loaded(*recordings: dict[str, Any], **others: Any) -> Problem:
    """That problem."""
    return problem_of_tables(tables(*recordings, **others))


def message(*recordings: dict[str, Any], **others: Any) -> str:
    """Why that problem is refused."""
    with pytest.raises(ProblemError) as found:
        loaded(*recordings, **others)
    return str(found.value)


def test_columns_alone_are_held_between_samples() -> None:
    (found,) = loaded({"inputs": {"knee.command": "u"}}).recordings
    each = found.inputs["knee.command"]
    assert (each.interpolation, each.delay, each.missing) == ("constant", 0.0, 0)
    assert each.time.tolist() == [0, 0.1, 0.2] and each.values.tolist() == [[10], [20], [40]]


def test_a_table_says_units_lines_and_a_delay() -> None:
    given = {"columns": "u", "unit": "deg", "interpolation": "linear", "delay": 0.02}
    (found,) = loaded({"inputs": {"knee": {"command": given}}, "until": 0.1}).recordings
    each = found.inputs["knee.command"]
    assert (each.interpolation, each.delay) == ("linear", 0.02)
    np.testing.assert_allclose(each.values, np.deg2rad([[10], [20]]), rtol=1e-15)


def test_forces_are_turned_into_the_world_and_rows_without_them_left_out() -> None:
    frame = {"orientation": {"yaw_deg": 90.0}}
    problem = loaded({"inputs": {"arm.force": {"columns": "f", "unit": "kN"}}, "frame": frame, "table": FORCES})
    (found,) = problem.recordings
    each = found.inputs["arm.force"]
    np.testing.assert_allclose(each.values, [[0, 1000, 0], [0, 3000, 0]], atol=1e-9)
    assert each.time.tolist() == [0, 0.2] and each.missing == 1
    assert "  driven by arm.force, held between samples, 1 of 3 rows without it" in recording_lines(problem)


def test_a_variable_sets_the_delay_for_all_tables() -> None:
    """Its guess is what the tables state, its scale that of delays, its unit the second."""
    given = {"inputs": {"knee.command": {"columns": "u", "delay": 0.02}}}
    problem = loaded(given, given, variable=[DELAY])
    (late,) = problem.variables
    assert (late.kind, late.guess.tolist(), late.scale.tolist()) == ("recording", [0.02], [0.01])
    assert residuals_of(problem, 1).shared.units == ("s",)


def test_clocks_are_in_seconds_and_scales_without_a_unit() -> None:
    variables = [{"name": "clock", "sets": "run0.offset"}, {"name": "scale", "sets": "run0.scale"}]
    assert residuals_of(loaded({}, variable=variables), 1).shared.units == ("s", "")


@pytest.mark.slow
def test_a_recording_without_commands_stands_beside_one_with_them() -> None:
    """There the command is 0, as in a simulation that nothing drives."""
    driven = {"inputs": {"knee.command": "u"}, "table": {**TABLE, "u": [0.1, 0.2, 0.4]}}
    problem = loaded(driven, {}, variable=[DELAY])
    residuals = residuals_of(problem, 1)
    first, second = residuals.jacobian(residuals.shared.guess + 0.03, np.zeros((2, 0)), np.arange(2))
    assert np.abs(first[1]).max() > 0 and not second[1].any()


def test_what_the_schema_says() -> None:
    properties = next(d for name, d in json_schema()["$defs"].items() if name == "RecordingTable")["properties"]
    choices = properties["inputs"]["additionalProperties"]["oneOf"]
    assert choices[0]["anyOf"][0] == {"type": "string"} and choices[1]["$ref"].endswith("InputTable")


@pytest.mark.parametrize(
    ("inputs", "expected"),
    [
        ("u", ".inputs: must be a table, not"),
        ({"knee.comand": "u"}, '.inputs.knee.comand: a recording cannot drive "knee.comand"'),
        ({"knee.comand": "u"}, 'did you mean "knee.command"'),
        ({"knee.angle": "u"}, "but forces and torques on bodies and commands of motors"),
        ({"knee.command": "w"}, 'table has no column "w"; valid: time, q, u, f'),
        ({"knee.command": "f"}, '"f" have 3 numbers in each row; knee.command has one number'),
        ({"arm.force": "u"}, '"u" have 1 numbers in each row; arm.force has 3 numbers'),
        ({"knee.command": 3}, "must be a text or a list of texts"),
        ({"knee": {"command": {"unit": "deg"}}}, ".inputs.knee.command.columns: this key is required"),
        ({"knee.command": {}}, ".inputs.knee.command.columns: this key is required"),
        ({"knee.command": {"columns": "u", "unit": "mm"}}, '.unit: knee.command is in rad; valid: "rad", "deg"'),
        ({"knee.command": {"columns": "u", "unit": "deg", "factor": 2}}, ".factor: stands instead of unit"),
        (
            {"knee.command": {"columns": "u", "interpolation": "cubic"}},
            ".interpolation: must be 'constant' or 'linear'",
        ),
        ({"knee.command": {"columns": "u", "interpolate": "linear"}}, 'unknown key; did you mean "interpolation"'),
        ({"knee.command": {"columns": "u", "delay": "1 ms"}}, ".delay: must be a number"),
    ],
)
def test_bad_tables(inputs: Any, expected: str) -> None:
    text = message({"inputs": inputs})
    assert expected in text and text.startswith('problem.toml: recording "run0"'), text


def test_without_any_number() -> None:
    table = {**TABLE, "u": [NAN] * 3}
    text = message({"inputs": {"knee.command": "u"}, "table": table})
    assert "table, row 0 (from 0): no row from this one on has the numbers of knee.command" in text


def test_nobody_else_sets_what_a_recording_drives() -> None:
    command = {"name": "u", "sets": "knee.command", "knots": 4}
    text = message({"inputs": {"knee.command": "u"}}, variable=[command])
    assert 'variable "u".sets: recording run0 drives knee.command by its inputs; leave one of the two out' in text


def test_a_motor_has_one_delay() -> None:
    text = message({"inputs": {"knee.command": "u"}}, {"inputs": {"knee.command": {"columns": "u", "delay": 0.02}}})
    assert "delay: is 0 s in recording run0; all recordings that drive knee.command state the same delay" in text


def test_a_delay_needs_a_recorded_input() -> None:
    text = message({}, variable=[DELAY])
    assert 'there is no quantity "knee.command.delay"' in text and "by its inputs" in text


CELLS = st.sampled_from(["", "nan", "0", "1", "-1", "1e300", "x", " 2", "inf", "é"])
INPUT = st.one_of(
    st.sampled_from(["u", "w", "time", "", 3, [], ["u"], ["u", "u"], [["u"]], True, NAN]),
    st.fixed_dictionaries(
        {},
        optional={
            "columns": st.sampled_from(["u", ["u"], ["u", "time", "q"], [], 1, "w"]),
            "unit": st.sampled_from(["deg", "N", "mm", "stone", 1]),
            "factor": st.sampled_from([0.0, -1.0, 1e300, NAN, "2"]),
            "offset": st.sampled_from([1e300, -1.0, "x"]),
            "delay": st.sampled_from([0.01, -0.01, 1e300, NAN, "0"]),
            "interpolation": st.sampled_from(["constant", "linear", "cubic", 1]),
            "colour": st.just("red"),
        },
    ),
)
NAMES = st.sampled_from(["knee.command", "arm.force", "arm.torque", "knee", "arm", "knee.angle", "", "knee.command[0]"])


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    inputs=st.one_of(st.sampled_from(["u", 3, [], ["u"]]), st.dictionaries(NAMES, INPUT, max_size=2)),
    rows=st.lists(st.tuples(CELLS, CELLS), min_size=2, max_size=4),
)
def test_any_inputs_are_a_problem_or_a_message(inputs: Any, rows: list[tuple[str, str]], tmp_path: Path) -> None:
    """Never a traceback; what is taken has numbers at increasing times, from which steps get finite inputs."""
    lines = [f"{k / 20},{a},{b}" for k, (a, b) in enumerate(rows)]
    (tmp_path / "a.csv").write_text("\n".join(["time,q,u", *lines]), encoding="utf-8")
    recording = {"inputs": inputs, "files": str(tmp_path / "a.csv"), "table": None}
    try:
        given_tables = tables(recording)
        del given_tables["recording"][0]["table"]
        problem = problem_of_tables(given_tables)
    except ProblemError as error:
        assert "recording" in str(error)
        return
    for each in problem.recordings[0].inputs.values():
        assert len(each.time) == len(each.values) > 0 and np.all(np.diff(each.time) > 0)
        assert np.isfinite(each.values).all() and np.isfinite(each.delay)
