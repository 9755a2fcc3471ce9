"""A kernel gives what the flat graph of its program gives, for any batch and any number of threads."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from tools.repeats import few
from worlds import programs

from symphys.codegen import Cache, Kernel, ProgramError, compile_program, interpret
from symphys.codegen.emit.plan import plan
from symphys.codegen.runtime import thread_pool
from symphys.codegen.runtime.thread_pool import Pace


def draw(kernel: Kernel, rows: int) -> Any:
    return np.random.default_rng(1).normal(size=(rows, kernel.program.z.size))


def gravity(kernel: Kernel) -> Any:
    return np.full(kernel.program.parameters.size, 9.81)


def joined(outputs: dict[str, Any]) -> Any:
    return np.concatenate(list(outputs.values()), axis=-1)


def test_outputs_and_jacobian_are_those_of_the_graph(kernel: Kernel) -> None:
    graph = programs.graph(kernel.program)
    for z in draw(kernel, 3):
        outputs, jacobian = (value.full() for value in graph(z, gravity(kernel)))
        np.testing.assert_allclose(
            joined(kernel.forward(z, gravity(kernel)))[0], outputs.ravel(), rtol=1e-12, atol=1e-13
        )
        rows = [kernel.jacobian(z, name, gravity(kernel)) for name in kernel.program.outputs]
        np.testing.assert_allclose(np.vstack(rows), jacobian, rtol=1e-12, atol=1e-13)


def test_the_interpreter_agrees_to_the_bit(kernel: Kernel) -> None:
    z = draw(kernel, 1)[0]
    outputs = kernel.forward(z, gravity(kernel))
    for name, value in interpret(kernel.program, z, gravity(kernel)).items():
        np.testing.assert_array_equal(outputs[name][0], value)


def test_a_gradient_is_the_seed_times_the_jacobian(kernel: Kernel) -> None:
    z = draw(kernel, 9)
    seed = np.random.default_rng(2).normal(size=(9, sum(p.size for p in kernel.program.outputs.values())))
    outputs, gradient = kernel.gradient(z, seed, gravity(kernel))
    np.testing.assert_array_equal(joined(outputs), joined(kernel.forward(z, gravity(kernel))))
    jacobians = [
        np.vstack([kernel.jacobian(row, name, gravity(kernel)) for name in kernel.program.outputs]) for row in z
    ]
    np.testing.assert_allclose(gradient, np.einsum("bs,bsn->bn", seed, jacobians), rtol=1e-11, atol=1e-12)


def test_of_one_step_nothing_is_computed_twice(cache: Cache, monkeypatch: pytest.MonkeyPatch) -> None:
    """The driver takes what fills the tape for the values; they and gradients are those of two passes, to the bit."""
    program, found = programs.chain(1), []
    for once in (True, False):
        with monkeypatch.context() as patch:
            if not once:
                patch.setattr("symphys.codegen.emit.plan._taped_at_once", lambda program: False)
            tables = plan(program, list(program.outputs)).tables
            assert (tables["again"][0] == tables["body"][0]) == once
            kernel = compile_program(program, cache=cache, threads=1)
            found.append(kernel.gradient(draw(kernel, 9), np.ones(5)))
    (values, gradients), (others, expected) = found
    np.testing.assert_array_equal(joined(values), joined(others))
    np.testing.assert_array_equal(gradients, expected)
    assert np.abs(expected).max() > 0


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("rows", [1, 7, 8, 9, 129])
def test_rows_depend_on_neither_batch_nor_threads(chain: Kernel, rows: int, threads: int) -> None:
    z = draw(chain, 129)
    seed = np.ones(5)
    alone = [chain.gradient(row, seed)[1][0] for row in z[:rows]]
    chain.threads = threads
    try:
        outputs, gradient = chain.gradient(z[:rows], seed)
        again = chain.forward(z[:rows])
    finally:
        chain.threads = 1
    np.testing.assert_array_equal(gradient, alone)
    np.testing.assert_array_equal(joined(outputs), joined(again))


def test_each_row_may_have_its_own_parameters(pendulum: Kernel) -> None:
    z, gravity = draw(pendulum, 3), np.array([[1.0], [9.0], [20.0]])
    together = joined(pendulum.forward(z, gravity))
    for i in range(3):
        np.testing.assert_array_equal(together[i], joined(pendulum.forward(z[i], gravity[i]))[0])


def test_a_nan_stays_in_its_lane_and_is_found(pendulum: Kernel) -> None:
    z = draw(pendulum, 8)
    clean, slope = pendulum.gradient(z, np.ones(3), gravity(pendulum))
    z[5, 20] = 1e200
    bad, bent = pendulum.gradient(z, np.ones(3), gravity(pendulum))
    others = np.arange(8) != 5
    np.testing.assert_array_equal(joined(bad)[others], joined(clean)[others])
    np.testing.assert_array_equal(bent[others], slope[others])
    assert not np.isfinite(bad["merit"][5, 0])
    found = pendulum.first_bad(z[5], gravity(pendulum))
    assert found is not None
    assert (found.phase, found.step, found.function) == ("body", 20, "cost")
    assert str(found).startswith("step 20, cost: word")
    assert pendulum.first_bad(z[4], gravity(pendulum)) is None
    z[5, 20] = np.nan
    found = pendulum.first_bad(z[5], gravity(pendulum))
    assert found is not None
    assert (found.phase, found.function, found.word) == ("inputs", "z", 20)


def test_trajectories_lie_in_the_memory(pendulum: Kernel) -> None:
    z = draw(pendulum, 9)
    states = pendulum.trajectory(z, programs.PENDULUM_STATE, programs.STEPS + 1, gravity(pendulum))
    assert states.shape == (9, programs.STEPS + 1, 2)
    np.testing.assert_array_equal(states[:, 0], np.tile([1.0, 0.0], (9, 1)))
    residuals = pendulum.forward(z, gravity(pendulum))["residuals"]
    np.testing.assert_array_equal(states[:, -1] - [1, 0], residuals)
    with pytest.raises(ProgramError, match="memory"):
        pendulum.trajectory(z, programs.PENDULUM_STATE, programs.STEPS + 2, gravity(pendulum))


@few("lanes", [1, 2, 4, 16], 1)
def test_the_number_of_lanes_changes_nothing(chain: Kernel, cache: Cache, lanes: int) -> None:
    other = compile_program(chain.program, lanes=lanes, cache=cache)
    z = draw(chain, 17)
    for mine, theirs in zip(chain.gradient(z, np.ones(5)), other.gradient(z, np.ones(5)), strict=True):
        np.testing.assert_array_equal(
            joined(mine) if isinstance(mine, dict) else mine, joined(theirs) if isinstance(theirs, dict) else theirs
        )


def test_single_precision_is_close(pendulum: Kernel, cache: Cache) -> None:
    single = compile_program(pendulum.program, precision="single", cache=cache)
    assert single.report.lanes == 2 * pendulum.report.lanes
    z = draw(pendulum, 20)
    value, gradient = pendulum.gradient(z, [1, 0, 0], gravity(pendulum))
    close, slope = single.gradient(z, [1, 0, 0], gravity(pendulum))
    np.testing.assert_allclose(close["merit"], value["merit"], rtol=1e-4)
    np.testing.assert_allclose(slope, gradient, rtol=1e-3, atol=1e-4)


def test_only_seeded_outputs_are_differentiated(chain: Kernel, cache: Cache) -> None:
    merit = compile_program(chain.program, cache=cache, seeded=["merit"])
    assert merit.report.functions < chain.report.functions
    z = draw(chain, 3)
    np.testing.assert_array_equal(merit.gradient(z, [1])[1], chain.gradient(z, [1, 0, 0, 0, 0])[1])
    with pytest.raises(ProgramError, match=r"'work'.*merit"):
        merit.jacobian(z[0], "work")
    with pytest.raises(ProgramError, match="'cost'"):
        compile_program(chain.program, cache=cache, seeded=["cost"])


def test_wrong_shapes_are_named(pendulum: Kernel) -> None:
    with pytest.raises(ProgramError, match=r"lanes .*1 to 64"):
        compile_program(pendulum.program, lanes=3)
    with pytest.raises(ProgramError, match=r"z .*\(3,\).*\(batch, 30\)"):
        pendulum.forward(np.ones(3), [1.0])
    with pytest.raises(ProgramError, match=r"\[2, 3\] of z, parameters"):
        pendulum.forward(np.ones((3, 30)), np.ones((2, 1)))


def test_an_empty_batch_is_empty(pendulum: Kernel) -> None:
    outputs, gradient = pendulum.gradient(np.ones((0, 30)), np.ones(3), [1.0])
    assert outputs["residuals"].shape == (0, 2)
    assert gradient.shape == (0, 30)


def test_the_report_says_how_it_was_built(pendulum: Kernel) -> None:
    report = pendulum.report
    assert report.bytes_per_lane == 16 * pendulum.program.size
    assert report.functions > 4
    assert report.seconds > 0
    assert report.note == ""


def test_a_call_is_shared_among_threads_where_that_pays(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first call is cut as finely as may be, later ones by the time that a block took; none has no part."""
    pace = Pace()
    assert pace.parts(100, 8) == 8 and pace.parts(3, 8) == 3 and pace.parts(0, 8) == 0
    clock = [0.0]
    monkeypatch.setattr(thread_pool, "perf_counter", lambda: clock[0])

    def takes(seconds: float) -> Callable[[Any], None]:
        return lambda _: clock.append(clock.pop() + seconds)

    pace.measured(takes(0.002), 10)(np.zeros(0))  # 0.2 ms a block
    assert pace.parts(100, 8) == 8 and pace.parts(3, 8) == 3
    pace.measured(takes(0.002), 1000)(np.zeros(0))  # 2 us a block
    assert pace.parts(100, 8) == 1
    pace.measured(takes(9.0), 1000)(np.zeros(0))  # once it had to wait for a processor
    assert pace.parts(100, 8) == 1
