"""Sizes that a machine has no memory for are refused before anything of that size is made."""

from __future__ import annotations

import tracemalloc
from pathlib import Path
from typing import Any

import pytest

from symphys.errors import ProblemError
from symphys.problem import limits, load_problem

BALL = """[simulation]
duration = 1.0
dt = 0.01
[[body]]
name = "b"
shape = { sphere = { radius = 0.1 } }
mass = 1
"""
NET = """[[sensor]]
name = "s"
reads = "b.position"
[[controller]]
name = "c"
drives = "b.force"
senses = ["s"]
net = { hidden = [WIDTH, WIDTH] }
"""
WEIGHTS = '[[variable]]\nname = "w"\nsets = "c.weights"\n'
PUSH = '[[variable]]\nname = "push"\nsets = "b.force"\nknots = 100\n'
GIB = 2**30


def load(folder: Path, text: str, **settings: Any) -> Any:
    """The problem of a file with this text."""
    file = folder / "big.toml"
    file.write_text(text)
    return load_problem(file, {key.replace("__", "."): value for key, value in settings.items()})


def refused(folder: Path, text: str, **settings: Any) -> str:
    """What is said."""
    with pytest.raises(ProblemError) as caught:
        load(folder, text, **settings)
    return str(caught.value)


def test_a_net_of_400_million_weights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In no time, and in no memory: tracemalloc sees what numpy and Python take."""
    monkeypatch.setattr(limits, "available", lambda: 64.0 * GIB)
    tracemalloc.start()
    said = refused(tmp_path, BALL + NET.replace("WIDTH", "20000") + WEIGHTS)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert 'big.toml: controller "c".net.hidden: a net of 400160003 weights takes about 127 GiB' in said
    assert "64 GiB can be used here; take smaller layers" in said
    assert peak < 5e7


def test_one_that_is_not_varied_takes_less(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The numbers of a variable take more than weights that stay as they are."""
    text = BALL + NET.replace("WIDTH", "300")
    size = 300 * 300 + 6 * 300 + 603
    monkeypatch.setattr(limits, "available", lambda: limits.BYTES_OF_WEIGHT * size + 1e6)
    assert load(tmp_path, text).controllers[0].numbers["weights"].size == size
    assert "c" in refused(tmp_path, text + WEIGHTS)


@pytest.mark.slow
def test_steps_and_knots(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Which key is to be changed is the one that brings it over what there is."""
    states = 20
    monkeypatch.setattr(limits, "available", lambda: limits.steps_need(states, 100) + 300 * limits.BYTES_OF_NUMBER)
    assert load(tmp_path, BALL + PUSH).variables[0].knots == 100
    assert 'variable "more".knots: the steps, and all knots up to these, take' in refused(
        tmp_path, BALL + PUSH + PUSH.replace("push", "more").replace("force", "torque")
    )
    monkeypatch.setattr(limits, "available", lambda: limits.steps_need(states, 100) - 1)
    said = refused(tmp_path, BALL + PUSH)
    assert "simulation.dt: 100 steps of 20 states take about" in said and "a larger dt or a shorter duration" in said
    assert load(tmp_path, BALL + PUSH.replace("100", "50"), simulation__dt=0.02).simulation.steps == 50


@pytest.mark.slow
def test_the_estimate_of_what_a_variable_takes_is_of_the_right_order(tmp_path: Path) -> None:
    """Against what numpy and Python take while a file is read; casadi's share is not seen by it."""
    text = BALL + NET.replace("WIDTH", "400") + WEIGHTS
    load(tmp_path, text)
    tracemalloc.start()
    weights = load(tmp_path, text).controllers[0].numbers["weights"].size
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert 0.3 < peak / (weights * (limits.BYTES_OF_WEIGHT + limits.BYTES_OF_NUMBER)) < 2


def test_what_a_group_of_processes_may_use_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No limit where the file says "max", or is not there."""
    monkeypatch.setattr(limits, "CGROUP_LIMITS", ())
    whole = limits.available()
    assert whole > 1e8
    for text, expected in (("1000000\n", 1e6), ("max\n", whole), (f"{2**62}\n", whole)):
        (tmp_path / "memory.max").write_text(text)
        monkeypatch.setattr(limits, "CGROUP_LIMITS", (tmp_path / "memory.max", tmp_path / "none"))
        assert limits.available() == expected
