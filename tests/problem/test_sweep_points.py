"""Points of sweeps as problems: the same as by settings, validated, read again where they are used."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from symphys.errors import ProblemError
from symphys.problem import Problem, load_problem
from symphys.problem.reader import ProblemReader
from symphys.problem.sweeps.points import LazyProblem, combined, swept
from symphys.problem.sweeps.reading import read_axes, read_samples
from symphys.problem.sweeps.sweep import Sweep, SweepError

Load = Callable[..., Problem]
Names = Callable[[ProblemError, str, str], None]

TABLE = """
[sweep]
"ball.mass" = [1, 2]
ground.friction = { from = 0.1, to = 0.9, count = 3 }
"""


def asked(problem: Problem, *texts: str, samples: str | None = None, own: Sweep | None = None) -> Sweep:
    axes, _ = read_axes(texts)
    return combined(own, problem, axes, None if samples is None else read_samples(samples))


def points(problem: Problem, *texts: str, samples: str | None = None) -> list[Problem]:
    return list(swept(problem, asked(problem, *texts, samples=samples)))


def facts(problem: Problem) -> dict[str, object]:
    """All numbers of a problem, in texts that can be compared."""
    names = ("parameters", "initial", "simulation", "variables", "targets", "costs", "constraints", "solver_tables")
    return {name: repr(getattr(problem, name)) for name in (*names, "name", "text", "identity", "goal", "file")}


def test_a_point_is_the_problem_under_its_settings(load: Load, tmp_path: Path) -> None:
    """Also what is derived from several settings, and whatever was read before it."""
    base = load(settings={"simulation.dt": 0.02})
    texts = ("ball.mass=1:3:3", "marble.density=500,1000", "ball.position.2=1:2:2", "throw.guess.0=0,3")
    found = points(base, *texts)
    assert len(found) == 24
    for point in found[::5]:
        alone = load_problem(tmp_path / "example.toml", point.settings)
        assert facts(point) == facts(alone)
        assert point.settings == alone.settings


def test_a_fault_of_a_point_is_that_of_the_problem_and_names_the_point(load: Load, names: Names) -> None:
    """What overlaps at the start is found by a function that an earlier point has built."""
    base = load()
    with pytest.raises(ProblemError) as alone:
        load(settings={"ball.position.2": 0.3})
    with pytest.raises(ProblemError) as caught:
        points(base, "ball.position.2=2,1.5,1,0.3", "ball.mass=1,2")
    message = alone.value.issues[0].message
    assert "sinks into ground by 0.2 m" in message
    names(caught.value, alone.value.issues[0].where, f"{message} .at the point ball.position.2=0.3, ball.mass=1 of")


@pytest.mark.parametrize(
    ("text", "pattern"),
    [
        ("ball.mas=1,2", '"mass"'),
        ("bal.mass=1,2", '"ball"'),
        ("ball.mass=0,1", "greater than 0"),
        ("simulation.dt=0.01,0.03", "no whole number of steps"),
        ("title=1:2:2", "must be a name"),
    ],
)
def test_points_that_cannot_be(load: Load, text: str, pattern: str) -> None:
    with pytest.raises(ProblemError, match=pattern):
        points(load(), text)


def test_nothing_is_evaluated_of_the_points_after_a_fault(load: Load) -> None:
    """Points are made one by one, so that ten thousand take no memory."""
    found = swept(base := load(), asked(base, "ball.mass=1,0,2"))
    assert next(found).parameters["ball.mass"] == 1
    with pytest.raises(ProblemError):
        next(found)


def test_a_file_sweeps_what_the_command_line_does(load: Load, valid: str) -> None:
    with_table, plain = load(text=valid + TABLE), load()
    assert with_table.text == plain.text and with_table.identity == plain.identity
    assert with_table.sweep == asked(plain, "ball.mass=1,2", "ground.friction=0.1:0.9:3")
    assert plain.sweep is None
    assert facts(with_table) == facts(plain)
    assert with_table.set("ball.mass", 3).sweep == with_table.sweep
    assert "sweep" not in with_table.to_toml()


def test_the_command_line_replaces_and_adds(load: Load, valid: str) -> None:
    base = load(text=valid + TABLE)
    changed = asked(base, "body.0.mass=7", "simulation.sweeps=5,6", own=base.sweep)
    assert [axis.key for axis in changed.axes] == ["body.0.mass", "ground.friction", "simulation.sweeps"]
    assert len(changed) == 6
    assert len(asked(base, samples="lhs:2", own=base.sweep)) == 2


def test_one_value_and_several_of_a_key_is_an_error(load: Load, valid: str) -> None:
    base = load(text=valid + TABLE, settings={"body.ball.mass": 3})
    with pytest.raises(SweepError, match=r"body.ball.mass .*\[sweep\].*--sweep ball.mass=VALUE"):
        asked(base, own=base.sweep)
    with pytest.raises(SweepError, match=r"body.ball.mass"):
        asked(base, "body.0.mass=1,2")
    with pytest.raises(SweepError, match=r"throw.guess.0 and throw.guess"):
        asked(base, "throw.guess.0=1,2", "throw.guess=1,2")


@pytest.mark.parametrize("key", ["sweep", "sweep.count"])
def test_a_setting_is_no_sweep(load: Load, valid: str, key: str) -> None:
    with pytest.raises(ProblemError, match="--sweep"):
        load(text=valid + TABLE, settings={key: 2})


def test_a_sweep_is_of_the_problem_and_not_of_what_it_includes(write_both: Callable[..., Path], names: Names) -> None:
    path = write_both(robot=('title = "Two links"', 'title = "Two links"\n[sweep]\n"torso.mass" = [1, 2]\n'))
    with pytest.raises(ProblemError) as caught:
        load_problem(path)
    assert "move it to" in str(caught.value) and "sweep" in str(caught.value)


def test_keys_of_included_files_are_swept(write_both: Callable[..., Path]) -> None:
    path = write_both()
    base = load_problem(path)
    found = points(base, "shin.mass=1,2", "include.0.yaw_deg=0,90")
    assert [float(point.parameters["shin.mass"][0]) for point in found] == [1, 1, 2, 2]
    assert facts(found[3]) == facts(load_problem(path, found[3].settings))
    np.testing.assert_allclose(found[0].initial["shin.position"], [0.5, 0, 1])
    np.testing.assert_allclose(found[3].initial["shin.position"], [0, 0.5, 1], atol=1e-12)


def test_a_lazy_problem_is_read_once_for_all_that_is_asked_of_it(load: Load, monkeypatch: pytest.MonkeyPatch) -> None:
    first, last = points(load(), "ball.mass=1,2")
    reads: list[Mapping[str, object]] = []
    read = ProblemReader.read

    def counted(self: ProblemReader, settings: Mapping[str, object]) -> object:
        reads.append(settings)
        return read(self, settings)

    monkeypatch.setattr(ProblemReader, "read", counted)
    for problem in (first, last):
        assert problem.name == "example" and problem.identity and problem.settings and problem.simulation.dt == 0.01
        assert problem.solver_tables == {"gradient": {"iterations": 10}} and problem.scenarios is None
    assert reads == []
    assert first.parameters["ball.mass"] == 1 and len(first.variables) == 2 and first.world().bodies
    assert reads == [{"ball.mass": 1}]


def test_a_lazy_problem_travels_light_and_is_copied_whole(load: Load) -> None:
    base = load()
    (point,) = points(base, "ball.mass=3")
    assert isinstance(point, LazyProblem)
    assert point.variables  # read, and yet not sent along
    sent = pickle.dumps(point)
    assert len(sent) < len(base.text) + 3000
    assert facts(pickle.loads(sent)) == facts(point)
    copy = replace(point, name="other")
    assert type(copy) is Problem and copy.parameters["ball.mass"] == 3 and copy.name == "other"
    assert point.set("ball.mass", 4).parameters["ball.mass"] == 4


def test_a_renamed_problem_keeps_its_name(load: Load) -> None:
    (point,) = points(replace(load(), name="example-2"), "ball.mass=3")
    assert point.name == "example-2" and point.whole.name == "example-2"  # type: ignore[attr-defined]
