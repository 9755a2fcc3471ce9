"""Sweeps: values of keys, the points that they make, and their two ways of being written."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import qmc

from symphys.errors import ProblemError
from symphys.problem.sweeps.reading import read_axes, read_axis, read_samples, read_sweep, without_sweep
from symphys.problem.sweeps.sweep import Interval, Levels, Samples, Sweep, SweepError

Names = Callable[[ProblemError, str, str], None]


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("a.b=0.2:2:10", (0.2, 0.4, 0.6, 0.8, 1, 1.2, 1.4, 1.6, 1.8, 2)),
        ("a.b=2:-1:4", (2, 1, 0, -1)),
        ("a.b=0:1:4", (0, 0.33333, 0.66667, 1)),
        ("a.b=100:101:4", (100, 100.33333, 100.66667, 101)),
        ("a.b=0.01:10:4:log", (0.01, 0.1, 1, 10)),
        ("a.b=1:2:3:log", (1, 1.414214, 2)),
        ("a.b = 0.2, 0.5,1", (0.2, 0.5, 1)),
        ("a.b=slow,'1,5',true", ("slow", "1,5", True)),
        ("a.b=[1, 0],[2,0],{c = 1, d = 2}", ([1, 0], [2, 0], {"c": 1, "d": 2})),
        ("a.b=2", (2,)),
    ],
)
def test_values_that_are_typed(text: str, values: tuple[object, ...]) -> None:
    """Rounded to some six digits of the distance between the ends, which stay as they are."""
    axis = read_axis(text)
    assert axis == Levels("a.b", values)
    assert [type(each) for each in axis.values] == [type(each) for each in values]


def test_whole_numbers_have_no_point() -> None:
    """So that the folder is that of ``--set a.b=1``."""
    axis = read_axis("a.b=0.5:1.5:3")
    assert isinstance(axis, Levels)
    assert [repr(value) for value in axis.values] == ["0.5", "1", "1.5"]


@pytest.mark.parametrize(
    ("text", "axis"), [("a=1:3", Interval("a", (1, 3))), ("a=1:3:log", Interval("a", (1, 3), "log"))]
)
def test_a_range_without_a_count(text: str, axis: Interval) -> None:
    assert read_axis(text) == axis


@pytest.mark.parametrize(
    ("text", "pattern"),
    [
        ("ball.mass", "write KEY=FROM:TO:COUNT"),
        ("=1,2", "write KEY=FROM:TO:COUNT"),
        ("a=1:2:x", "'x'"),
        ("a=1:2:3:4", "cannot be '1:2:3:4'"),
        ("a=1:b", "cannot be '1:b'"),
        ("a=1:2:1", "count of 2 to 10,000"),
        ("a=1:2:100000", "count of 2 to 10,000"),
        ("a=1:1:3", "both ends at 1"),
        ("a=0:1:3:log", "ends above 0"),
        ("a=1e999:2:3", "finite ends"),
        ("a=1,,2", "empty value"),
        ("a=1,1.0", "1.0 twice"),
    ],
)
def test_values_that_cannot_be(text: str, pattern: str) -> None:
    with pytest.raises(SweepError, match=pattern) as caught:
        read_axes([text])
    assert str(caught.value).startswith(f"--sweep {text!r}: ")


def test_none_and_a_key_twice() -> None:
    assert read_axes(["none", "a=1"]) == ((Levels("a", (1,)),), True)
    with pytest.raises(SweepError, match=r"a .*twice"):
        read_axes(["a=1", "a=2"])


def test_1_and_true_are_two_values() -> None:
    assert Levels("a", (1, True)).values == (1, True)


@pytest.mark.parametrize(
    ("text", "samples"),
    [
        ("lhs:10", Samples("latin hypercube", 10)),
        ("latin hypercube:10:2", Samples("latin hypercube", 10, 2)),
        ("sobol:64:1", Samples("sobol", 64, 1)),
        ("grid", Samples()),
    ],
)
def test_samples_that_are_typed(text: str, samples: Samples) -> None:
    assert read_samples(text) == samples


@pytest.mark.parametrize(
    ("text", "pattern"),
    [
        ("sobl:64", '"sobol"'),
        ("sobol:100", "power of two, such as 64 or 128"),
        ("lhs", "count of 1 to 1,000,000"),
        ("lhs:-1", "write KIND:COUNT"),
        ("lhs:1:2:3", "write KIND:COUNT"),
        ("grid:10", "a count belongs to samples"),
    ],
)
def test_samples_that_cannot_be(text: str, pattern: str) -> None:
    with pytest.raises(SweepError, match=pattern) as caught:
        read_samples(text)
    assert str(caught.value).startswith(f"--samples {text!r}: ")


def test_the_last_key_of_a_grid_changes_fastest() -> None:
    sweep = Sweep((Levels("a", (1, 2)), Levels("b", ("x", "y", "z"))))
    points = [tuple(point.items()) for point in sweep.points()]
    assert points == [(("a", a), ("b", b)) for a in (1, 2) for b in "xyz"]
    assert len(sweep) == 6


def test_each_stratum_of_a_latin_hypercube_has_one_point() -> None:
    sweep = Sweep((Interval("a", (2, 4)), Interval("b", (0.1, 10), "log")), Samples("latin hypercube", 20, 3))
    points = list(sweep.points())
    strata = {
        "a": [math.floor((point["a"] - 2) / 2 * 20) for point in points],  # type: ignore[operator]
        "b": [math.floor(math.log(point["b"] / 0.1, 100) * 20) for point in points],  # type: ignore[operator]
    }
    assert sorted(strata["a"]) == sorted(strata["b"]) == list(range(20))
    assert points == list(sweep.points())
    assert points != list(Sweep(sweep.axes, Samples("latin hypercube", 20, 4)).points())


def test_sobol_points_are_those_of_scipy() -> None:
    sweep = Sweep((Interval("a", (0, 1)), Interval("b", (-3, 1))), Samples("sobol", 16, 5))
    known = qmc.Sobol(2, scramble=True, seed=5).random(16)
    found = np.array([list(point.values()) for point in sweep.points()], float)
    np.testing.assert_allclose(found, known * [1, 4] - [0, 3], atol=5.1e-6)
    for point in sweep.points():
        assert all(len(repr(value)) <= len("-2.123456") for value in point.values())


def test_samples_of_lists_share_them_evenly() -> None:
    sweep = Sweep((Levels("a", (8, 16, 32, 64)), Interval("b", (0, 1))), Samples("latin hypercube", 40))
    values = [point["a"] for point in sweep.points()]
    assert [values.count(value) for value in (8, 16, 32, 64)] == [10, 10, 10, 10]


@pytest.mark.parametrize(
    ("sweep", "pattern"),
    [
        (Sweep((Interval("a", (1, 2)),)), "a needs a count in a grid: --sweep a=1:2:10"),
        (Sweep((), Samples("sobol", 4)), "nothing to sample"),
        (Sweep((Levels("a", (1, 2)),), Samples("sobol", 4)), "they have 2 points; take the grid"),
        (Sweep(tuple(Levels(key, tuple(range(100))) for key in "abcd")), "100 x 100 x 100 x 100 points is too large"),
    ],
)
def test_sweeps_that_cannot_be(sweep: Sweep, pattern: str) -> None:
    with pytest.raises(SweepError, match=pattern):
        list(sweep.points())


TABLE = """
samples = "sobol"
count = 8
seed = 2
"ball.mass" = { from = 0.2, to = 2 }
ground.friction = [0.2, 1]
solver.cma.sigma = { from = 0.1, to = 10, count = 3, spacing = "log" }
"""


def test_a_table_says_what_the_command_line_says() -> None:
    axes, _ = read_axes(["ball.mass=0.2:2", "ground.friction=0.2,1", "solver.cma.sigma=0.1:10:3:log"])
    assert read_sweep(tomllib.loads(TABLE), "f") == Sweep(axes, read_samples("sobol:8:2"))


@pytest.mark.parametrize(
    ("table", "where", "pattern"),
    [
        ('"a.b" = 1', "sweep.a.b", "must be a list of values, or a table .* not 1"),
        ('"a.b" = []', "sweep.a.b", "at least one value"),
        ('"a.b" = { from = 1 }', "sweep.a.b.to", "required"),
        ('"a.b" = { from = 1, to = 2, cout = 3 }', "sweep.a.b.cout", '"count"'),
        ('"a.b" = { form = 1, to = 2 }', "sweep.a.b.form", '"from"'),
        ('"a.b" = { from = 1, to = 2, count = 1 }', "sweep.a.b.count", "at least 2"),
        ('"a.b" = { from = 0, to = 2, count = 3, spacing = "log" }', "sweep.a.b", "ends above 0"),
        ('samples = "sobol"\ncount = 5\n"a.b" = [1, 2]', "sweep.count", "power of two"),
        ('samples = "halton"\n"a.b" = [1, 2]', "sweep.samples", "must be 'grid'"),
        ('count = 5\n"a.b" = [1, 2]', "sweep.count", "belongs to samples"),
        ("seed = 1", "sweep", "no key to sweep"),
    ],
)
def test_tables_that_cannot_be(names: Names, table: str, where: str, pattern: str) -> None:
    with pytest.raises(ProblemError) as caught:
        read_sweep(tomllib.loads(table), "my.toml")
    names(caught.value, where, pattern)


HEAD, TAIL = 'title = "t"\n\n[a]\nb = 1\n', "# of c\n[c]\nd = [\n  [1, 2],\n]\n"


@pytest.mark.parametrize(
    ("text", "without"),
    [
        (HEAD + "\n[sweep]\nx.y = [1]\n", HEAD),
        (HEAD + "\n# why\n[sweep]   # so\n# here\nx.y = [\n  [1, 2],\n]\n", HEAD),
        (HEAD + "\n[sweep]\nx.y = [1]\n\n" + TAIL, HEAD + "\n" + TAIL),
        (HEAD + '\n[sweep."x.y"]\nfrom = 1\nto = 2\n\n' + TAIL, HEAD + "\n" + TAIL),
        ("[sweep]\nx.y = [1]\n" + TAIL, TAIL),
        (HEAD + "\n[sweeping]\ne = 1\n\n[sweep]\nx = [1]\n", HEAD + "\n[sweeping]\ne = 1\n"),
    ],
)
def test_a_text_without_its_sweep(text: str, without: str) -> None:
    """The same text as if it had never had one, so that what was solved counts as done."""
    data = tomllib.loads(text)
    del data["sweep"]
    assert without_sweep(Path("my.toml"), text, data) == without


@pytest.mark.parametrize(
    "text", ["sweep = { x = [1] }\na = 1\n", '[a]\nb = """\n[sweep]\nx = 1\n"""\n[sweep]\nx = [1]\n']
)
def test_a_sweep_that_is_no_part_of_the_text_by_itself(text: str) -> None:
    data = tomllib.loads(text)
    del data["sweep"]
    assert tomllib.loads(without_sweep(Path("my.toml"), text, data)) == data


@pytest.mark.parametrize("spacing", ["linear", "log"])
def test_ten_thousand_values_are_told_apart(spacing: str) -> None:
    axis = read_axis(f"a=1:1.5:10000:{spacing}")
    assert isinstance(axis, Levels)
    assert all(low < high for low, high in pairwise(axis.values))  # type: ignore[operator]
