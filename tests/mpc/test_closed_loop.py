"""The closed loop: a swing-up that is held by a plant that differs, states by name, lateness, what is recorded."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from worlds.swung import pendulum

from symphys.dynamics.observation import reading_function
from symphys.errors import SymphysError
from symphys.mpc import ClosedLoop, Controller, Plant, close_loop, record_of, write_closed_loop
from symphys.mpc.plant import plant_problem
from symphys.report import write_closed_loop_page
from symphys.results.closed_loop import read_closed_loop

OFF = {"latency": 0.0, "masses": 1.1, "dt": 0.01}


@cache
def controller() -> Controller:
    return Controller(pendulum(plant=OFF), threads=1)


@cache
def heavy() -> Plant:
    return Plant(controller().problem)


@cache
def swing() -> ClosedLoop:
    """With a plant that is 10 % heavier and has a third of the model's step."""
    return close_loop(controller(), heavy())


def changed(duration: float = 0.4, **plant: Any) -> Controller:
    """The same controller, tried in another way."""
    made = copy(controller())
    made.horizon = replace(made.horizon, duration=duration, plant=replace(made.horizon.plant, **plant))
    return made


@pytest.mark.slow
def test_it_swings_up_and_holds() -> None:
    record = record_of(swing())
    assert record.done and record.held > 1.0
    assert np.abs(swing().u).max() <= 8.0
    assert 8.0 < 1.1 * 9.81, "the motor alone could lift it"


@pytest.mark.slow
def test_left_alone_it_does_not() -> None:
    """The targets are of the closed loop: a plant on which nothing acts hangs."""
    plant = heavy()
    x = plant.start
    for k in range(100):
        x = plant.step(x, np.zeros(1), k * plant.dt)
    read = reading_function(plant.rollout.world)
    assert [float(part) for part in read(x, [])[:2]] == pytest.approx([0.0, 0.0], abs=1e-9)


@pytest.mark.slow
def test_the_plant_has_the_masses_and_the_step_that_are_asked_for() -> None:
    plant = heavy()
    assert (plant.substeps, plant.dt) == (2, pytest.approx(0.01))
    made, light = plant_problem(controller().problem, 0.01), controller().problem
    assert made.parameters["bob.mass"][0] == pytest.approx(1.1 * light.parameters["bob.mass"][0])
    assert np.array(made.world().bodies[0].inertia, float) == pytest.approx(
        1.1 * np.array(light.world().bodies[0].inertia, float)
    )


def test_other_values_of_the_plant_are_set() -> None:
    problem = pendulum(plant={**OFF, "masses": 1.0, "set": {"bob": {"mass": 3.0}}})
    assert plant_problem(problem, 0.01).parameters["bob.mass"][0] == 3.0


@pytest.mark.slow
def test_a_state_by_name_is_the_state() -> None:
    """What is put in by name is what joints read, and equal states get equal commands."""
    made = controller()
    x = swing().x[60]
    read = reading_function(made.planner.rollout.world)
    angle, rate = (float(part) for part in read(x, [])[:2])
    whole = made.reader({"pivot.angle": angle, "pivot.rate": rate}, x)
    assert whole == pytest.approx(x, abs=1e-9)
    made.reset()
    by_name = made({"pivot.angle": angle, "pivot.rate": rate}, 0.0)
    again = [float(part) for part in read(made.plan.x[0], [])[:2]] if made.plan else []
    assert again == pytest.approx([angle, rate], abs=1e-9)
    assert by_name.shape == (1,) and made.inputs == ("pivot.command",)


@pytest.mark.parametrize(
    ("state", "said"),
    [
        ({"pivot.angle": 0.0}, "lacks pivot.rate"),
        ({"pivot.angle": 0.0, "pivot.rate": np.nan}, "not finite"),
        ({"pivot.angel": 0.0, "pivot.rate": 0.0}, "did you mean"),
        (np.zeros(3), "numbers, not the shape"),
    ],
)
def test_states_that_do_not_fit_are_refused(state: Any, said: str) -> None:
    made = controller()
    made.reset()
    with pytest.raises(SymphysError, match=said):
        made(state, 0.0)


def test_time_does_not_go_back() -> None:
    made = controller()
    made.reset()
    made(made.start, 1.0)
    with pytest.raises(SymphysError, match="last plan"):
        made(made.start, 0.5)


@pytest.mark.slow
def test_feedback_answers_by_the_gains() -> None:
    """A disturbed state changes the command by gain times how far it is, within the bounds."""
    made, upright = controller(), swing().x[-1]
    made.reset()
    made(upright, 0.0)
    plan = made.plan
    assert plan is not None
    off = np.zeros(made.planner.tangent.size)
    off[made.planner.tangent.names.index("pivot.rate[0]")] = 1e-3
    x = made.planner.tangent.retract(plan.x[:1], off[None], made.planner.p)[0]
    answer = made.command(0.0, x) - made.command(0.0)
    assert answer == pytest.approx(plan.back[0] @ off, rel=1e-6)
    assert answer[0] != 0


@pytest.mark.slow
def test_a_solver_that_is_late_misses_ticks() -> None:
    """Latency of two and a half ticks: every third tick is asked for, none is in time, and the plan before acts."""
    loop = close_loop(changed(1.5, latency=0.05), heavy())
    assert (loop.ticks, loop.in_time) == (75, 0)
    assert loop.asked == pytest.approx(0.06 * np.arange(25))
    prompt = close_loop(changed(1.5), heavy())
    assert (prompt.in_time, len(prompt.asked)) == (75, 75)
    assert not np.allclose(prompt.u, loop.u)


def test_a_delayed_command_comes_later() -> None:
    loop = close_loop(changed(delay=0.03), heavy())
    assert loop.u[:3] == pytest.approx(np.zeros((3, 1)))
    assert loop.u[3] != 0


@pytest.mark.slow
def test_noise_is_repeated_and_has_its_size() -> None:
    made = controller()
    rng = np.random.default_rng(0)
    read = reading_function(made.planner.rollout.world)
    seen = np.array(
        [[float(p) for p in read(made.reader.noisy(made.start, 0.02, 0.3, rng), [])[:2]] for _ in range(400)]
    )
    assert seen.std(axis=0) == pytest.approx([0.02, 0.3], rel=0.15)
    first, second = (close_loop(changed(noise=0.01), heavy()) for _ in range(2))
    assert np.array_equal(first.x, second.x)


def test_an_interrupt_keeps_what_happened(tmp_path: Path) -> None:
    seen: list[float] = []
    loop = close_loop(changed(), heavy(), seen.append, lambda: len(seen) >= 5)
    record, motion = write_closed_loop(loop, tmp_path)
    assert (loop.stopped, loop.ticks, len(motion.time)) == ("interrupted", 5, 11)
    assert not record.done


@pytest.mark.slow
def test_the_record_is_read_as_it_was_written(tmp_path: Path) -> None:
    record, motion = write_closed_loop(swing(), tmp_path)
    again = read_closed_loop(tmp_path)
    for name, value in vars(record).items():
        assert np.array_equal(np.asarray(getattr(again, name)), np.asarray(value)), name
    assert motion["pivot.angle"] == pytest.approx(record.actual[:, 0], abs=1e-9)
    assert record.plan_value[3][0, 0] == pytest.approx(
        np.interp(record.plan_time[3][0], motion.time, motion["pivot.angle"])
    )
    page = write_closed_loop_page(tmp_path).read_text(encoding="utf-8")
    assert "All targets are met at the end" in page and "Latency" in page
