"""Toy programs for the kernel's tests, and the graph that each of them stands for."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from symphys.codegen import FunctionCall, MemoryLayout, Place, Program

STEPS, BODIES, SWEEPS, KNOTS = 30, 4, 3, 5
PENDULUM_STATE = Place(STEPS + 5, 2, 2)


def pendulum() -> Program:
    """A driven pendulum with a running cost; z is the torque of each step, the parameter is gravity."""
    x, u, g, a = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("g"), ca.SX.sym("a")
    move = ca.Function("move", [x, u, g], [ca.vertcat(x[0] + 0.05 * x[1], x[1] + 0.05 * (u - g * ca.sin(x[0])))])
    cost = ca.Function("cost", [x, u], [ca.fmax(x[0] ** 2 - 0.1, 0) + 0.01 * u**2])
    end = ca.Function("end", [x, a], [a + 10 * ca.sumsqr(x), x - ca.vertcat(1, 0)])
    start = ca.Function("start", [], [ca.SX([1.0, 0.0])])
    at = MemoryLayout()
    torque, parameters, total, merit, residuals = at.series(1, STEPS), at.take(1), at.take(1), at.take(1), at.take(2)
    state = at.series(2, STEPS + 1)
    assert state == PENDULUM_STATE
    return Program(
        size=at.size,
        z=Place(torque.offset, STEPS),
        parameters=parameters,
        steps=STEPS,
        zeroed=(total,),
        prologue=(FunctionCall(start, (), (state.still(),)),),
        body=(
            FunctionCall(move, (state, torque, parameters), (state.later(),)),
            FunctionCall(cost, (state, torque), (total,), accumulate=True),
        ),
        epilogue=(FunctionCall(end, (state.later(STEPS), total), (merit, residuals)),),
        outputs={"merit": merit, "residuals": residuals},
    )


def chain(steps: int = STEPS) -> Program:
    """Masses on a line that push their neighbours away, in sweeps; z are the knots of a force on all of them."""
    f = _chain_functions()
    at = MemoryLayout()
    z, nothing, merit, errors, work = (at.take(n) for n in (KNOTS, 1, 1, 3, 1))
    force, states = at.series(1, STEPS), [at.series(2, STEPS + 1) for _ in range(BODIES)]
    speeds, pushes, effort = [at.take(1) for _ in states], [nothing] * (BODIES - 1), at.take(1)
    body = [FunctionCall(f["free"], (x, force), (v,)) for x, v in zip(states, speeds, strict=True)]
    body.append(FunctionCall(f["same"], (speeds[0],), (effort,)))
    for _ in range(SWEEPS):
        for i in range(BODIES - 1):
            new = at.take(1), at.take(1), at.take(1)
            body.append(FunctionCall(f["visit"], (*states[i : i + 2], *speeds[i : i + 2], pushes[i]), new))
            speeds[i], speeds[i + 1], pushes[i] = new
            body.append(FunctionCall(f["same"], (pushes[i],), (effort,), accumulate=True))
    body += [FunctionCall(f["move"], (x, v), (x.later(),)) for x, v in zip(states, speeds, strict=True)]
    body += [FunctionCall(f["cost"], (x.later(), force), (merit,), accumulate=True) for x in states]
    body.append(FunctionCall(f["square"], (effort, effort), (work,), accumulate=True))
    return Program(
        size=at.size,
        z=z,
        parameters=Place(0, 0),
        steps=steps,
        zeroed=(nothing, work),
        constants=tuple((x.still(), (0.8 * i, 0.1 * i)) for i, x in enumerate(states)),
        prologue=(
            FunctionCall(f["zero"], (), (merit,)),
            FunctionCall(f["forces"], (z,), (Place(force.offset, STEPS),)),
        ),
        body=tuple(body),
        epilogue=(FunctionCall(f["end"], (states[0].later(steps), states[-1].later(steps)), (errors,)),),
        outputs={"merit": merit, "errors": errors, "work": work},
    )


def _chain_functions() -> dict[str, Any]:
    x, y, knots = ca.SX.sym("x", 2), ca.SX.sym("y", 2), ca.SX.sym("knots", KNOTS)
    v, w, push, force = (ca.SX.sym(name) for name in ("v", "w", "push", "force"))
    hats = np.maximum(0, 1 - np.abs(np.linspace(0, KNOTS - 1, STEPS)[:, None] - np.arange(KNOTS)))
    new = ca.fmax(push - 0.5 * (w - v) + 0.2 * (1 - (y[0] - x[0])), 0)
    cubed = ca.if_else(force > 0, force**2, 0.1 * force**3)
    return {
        "zero": ca.Function("zero", [], [ca.SX([0.0])]),
        "forces": ca.Function("forces", [knots], [ca.mtimes(ca.SX(ca.DM(hats)), knots)]),
        "free": ca.Function("free", [x, force], [x[1] - 0.02 * x[0] + 0.05 * force]),
        "visit": ca.Function("visit", [x, y, v, w, push], [v - new + push, w + new - push, new]),
        "move": ca.Function("move", [x, v], [ca.vertcat(x[0] + 0.05 * v, v)]),
        "cost": ca.Function("cost", [x, force], [x[1] ** 2 + cubed]),
        "same": ca.Function("same", [v], [v]),
        "square": ca.Function("square", [v, w], [v * w]),
        "end": ca.Function("end", [x, y], [ca.vertcat(x - y, ca.sqrt(1 + ca.sumsqr(x)))]),
    }


def graph(program: Program) -> Any:
    """(z, parameters) -> all outputs and their Jacobian with respect to z, as one flat casadi Function."""
    z, parameters = ca.SX.sym("z", program.z.size), ca.SX.sym("parameters", program.parameters.size)
    memory = ca.SX.nan(program.size)
    for place in program.zeroed:
        memory[place.offset : place.offset + place.size] = 0
    for place, values in program.constants:
        memory[place.offset : place.offset + place.size] = values
    memory[program.z.offset : program.z.offset + program.z.size] = z
    memory[program.parameters.offset : program.parameters.offset + program.parameters.size] = parameters
    calls = [(call, 0) for call in program.prologue]
    calls += [(call, k) for k in range(program.steps) for call in program.body]
    for call, k in calls + [(call, 0) for call in program.epilogue]:
        spans = [slice(p.offset + k * p.stride, p.offset + k * p.stride + p.size) for p in call.inputs + call.outputs]
        results = call.function.call([memory[s] for s in spans[: len(call.inputs)]], True, False)
        for result, span in zip(results, spans[len(call.inputs) :], strict=True):
            memory[span] = result + (memory[span] if call.accumulate else 0)
    outputs = ca.vertcat(*(memory[p.offset : p.offset + p.size] for p in program.outputs.values()))
    return ca.Function("graph", [z, parameters], [outputs, ca.jacobian(outputs, z)])
