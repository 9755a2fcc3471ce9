"""Compiled kernels against casadi's own C code with ``map``, on a row of balls that push each other.

Every comparison is made in one run, best of seven. Run with ``python benchmarks/kernels.py``.
"""

from __future__ import annotations

import platform
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any

import casadi as ca
import numpy as np

from symphys.kernel import Cache, Call, Layout, Place, Program, compile_program
from symphys.kernel.compiler import find_compiler
from symphys.kernel.processor import processor

BATCH, REPEATS, DT = 128, 7, 0.01


def functions() -> dict[str, Any]:
    """The calls of the toy: free motion, the contact's geometry, a visit with friction, the move, the cost."""
    x, y, v, w = ca.SX.sym("x", 6), ca.SX.sym("y", 6), ca.SX.sym("v", 3), ca.SX.sym("w", 3)
    n, gap, old = ca.SX.sym("n", 3), ca.SX.sym("gap"), ca.SX.sym("old", 4)
    way = y[:3] - x[:3]
    distance = ca.sqrt(ca.sumsqr(way) + 1e-6)
    slip = w - v
    push = old[0] - 0.5 * (ca.dot(n, slip) + 0.2 * gap / DT)
    normal = (push + ca.sqrt(push * push + 1e-6)) / 2
    v1, w1 = v - n * (normal - old[0]), w + n * (normal - old[0])
    slip = w1 - v1
    wanted = old[1:] - 0.5 * (slip - n * ca.dot(n, slip))
    friction = wanted * ca.fmin(1, 0.5 * normal / ca.sqrt(ca.sumsqr(wanted) + 1e-9))
    given = friction - old[1:]
    return {
        "free": ca.Function("free", [x], [x[3:] - ca.vertcat(0, 0, 9.81 * DT)]),
        "meet": ca.Function("meet", [x, y], [way / distance, distance - 1]),
        "visit": ca.Function("visit", [v, w, n, gap, old], [v1 - given, w1 + given, ca.vertcat(normal, friction)]),
        "move": ca.Function("move", [x, v], [ca.vertcat(x[:3] + DT * v, v)]),
        "cost": ca.Function("cost", [x], [ca.sumsqr(x[:3]) + ca.fmax(x[5], 0)]),
    }


def row_of_balls(balls: int, sweeps: int, steps: int) -> Program:
    """z is the state of all balls at the beginning; the output is a cost over time."""
    f, at = functions(), Layout()
    states = at.series(6 * balls, steps + 1)
    balls_at = [Place(states.offset + 6 * i, 6, states.stride) for i in range(balls)]
    merit, nothing = at.take(1), at.take(4)
    speeds, body = [at.take(3) for _ in balls_at], []
    body += [Call(f["free"], (x,), (v,)) for x, v in zip(balls_at, speeds, strict=True)]
    meetings = [(at.take(3), at.take(1)) for _ in balls_at[1:]]
    body += [Call(f["meet"], (balls_at[i], balls_at[i + 1]), place) for i, place in enumerate(meetings)]
    given = [nothing] * len(meetings)
    for _ in range(sweeps):
        for i in [*range(0, balls - 1, 2), *range(1, balls - 1, 2)]:
            new = at.take(3), at.take(3), at.take(4)
            body.append(Call(f["visit"], (speeds[i], speeds[i + 1], *meetings[i], given[i]), new))
            speeds[i], speeds[i + 1], given[i] = new
    body += [Call(f["move"], (x, v), (x.later(),)) for x, v in zip(balls_at, speeds, strict=True)]
    body += [Call(f["cost"], (x.later(),), (merit,), accumulate=True) for x in balls_at]
    z, empty = Place(states.offset, 6 * balls), Place(0, 0)
    return Program(at.size, z, empty, steps, {"merit": merit}, body=tuple(body), zeroed=(merit, nothing))


def flat_step(program: Program) -> Any:
    """One step of the program as one casadi Function: state -> next state, cost."""
    z, n = ca.SX.sym("z", program.z.size), program.z.size
    memory = ca.SX.zeros(program.size)
    memory[:n] = z
    for call in program.body:
        results = call.function.call([memory[p.offset : p.offset + p.size] for p in call.inputs], True, False)
        for place, result in zip(call.outputs, results, strict=True):
            span = slice(place.offset, place.offset + place.size)
            memory[span] = result + (memory[span] if call.accumulate else 0)
    cost = memory[program.outputs["merit"].offset]
    return ca.Function("step", [z], [memory[n : 2 * n], cost], {"cse": True})


def casadi_rollouts(program: Program, folder: Path) -> tuple[Any, Any, float]:
    """(rollouts, rollouts with gradient, seconds to compile) of casadi's C code for the whole batch."""
    x = ca.MX.sym("x", program.z.size)
    cost = ca.sum2(flat_step(program).mapaccum(program.steps)(x)[1])
    rollout = ca.Function("rollout", [x], [cost])
    slope = ca.Function("slope", [x], [cost, ca.jtimes(cost, x, 1, True)])
    code = ca.CodeGenerator("flat.c")
    code.add(rollout.map(BATCH))
    code.add(slope.map(BATCH))
    source = code.generate(str(folder) + "/")
    target, began = str(folder / "flat.so"), perf_counter()
    flags = ["-O2", "-fPIC", "-shared", *processor().flags()]
    subprocess.run([*find_compiler().command, *flags, source, "-o", target, "-lm"], check=True)
    seconds = perf_counter() - began
    names = rollout.map(BATCH).name(), slope.map(BATCH).name()
    return *(ca.external(name, target) for name in names), seconds


def best(work: Callable[[], object]) -> float:
    """Seconds of the fastest repetition."""
    times = []
    for _ in range(REPEATS):
        began = perf_counter()
        work()
        times.append(perf_counter() - began)
    return min(times)


def against_casadi(balls: int = 8, sweeps: int = 4, steps: int = 50) -> None:
    """Steps per second of 128 copies, one thread."""
    program = row_of_balls(balls, sweeps, steps)
    z = start(balls)
    with tempfile.TemporaryDirectory() as name:
        rollout, slope, seconds = casadi_rollouts(program, Path(name))
        kernel = compile_program(program, cache=Cache(Path(name)), threads=1)
        forward, gradient = best(lambda: rollout(z.T)), best(lambda: slope(z.T))
    print(f"\n{balls} balls, {sweeps} sweeps, {steps} steps, {BATCH} copies, one thread; compile in s, run in ms")
    print(f"casadi C with map     compile {seconds:6.2f}  forward {1e3 * forward:8.3f}  gradient {1e3 * gradient:8.3f}")
    mine, theirs = best(lambda: kernel.forward(z)), best(lambda: kernel.gradient(z, [1.0]))
    print(f"kernel                compile {kernel.report.seconds:6.2f}  forward {1e3 * mine:8.3f}  ", end="")
    print(f"gradient {1e3 * theirs:8.3f}\ntimes faster: forward {forward / mine:.1f}, gradient {gradient / theirs:.1f}")


def lanes_and_threads(balls: int = 20, sweeps: int = 10, steps: int = 50) -> None:
    """Nanoseconds of a visit and lane, for numbers of lanes, precision and threads."""
    program, z = row_of_balls(balls, sweeps, steps), start(balls)
    visits = (balls - 1) * sweeps * steps * BATCH
    print(f"\n{balls} balls, {sweeps} sweeps: ns per visit and lane; cold and warm compile in s")
    for lanes, precision, threads in [
        *((lanes, "double", 1) for lanes in (1, 2, 4, 8, 16)),
        (16, "single", 1),
        ("auto", "double", 2),
    ]:
        with tempfile.TemporaryDirectory() as name:
            cache = Cache(Path(name))
            kernel = compile_program(program, lanes, precision, cache, threads=threads)  # type: ignore[arg-type]
            warm = compile_program(program, lanes, precision, cache, threads=threads)  # type: ignore[arg-type]
        forward, gradient = best(lambda k=kernel: k.forward(z)), best(lambda k=kernel: k.gradient(z, [1.0]))
        print(
            f"lanes {lanes!s:4} {precision} threads {threads}  forward {1e9 * forward / visits:6.2f}  "
            f"gradient {1e9 * gradient / visits:6.2f}  ratio {gradient / forward:.2f}  "
            f"compile {kernel.report.seconds:.2f} {warm.report.seconds:.2f}"
        )


def sizes(steps: int = 50) -> None:
    """What grows with the number of balls and sweeps."""
    print("\nballs sweeps  us per step and lane: forward gradient   ns per visit   compile s   kB per lane")
    for balls, sweeps in [(2, 10), (8, 10), (16, 10), (32, 10), (64, 10), (20, 5), (20, 20), (20, 40)]:
        with tempfile.TemporaryDirectory() as name:
            kernel = compile_program(row_of_balls(balls, sweeps, steps), cache=Cache(Path(name)), threads=1)
        z = start(balls)
        forward, gradient = best(lambda k=kernel, z=z: k.forward(z)), best(lambda k=kernel, z=z: k.gradient(z, [1.0]))
        per_step = 1e6 / steps / BATCH
        print(
            f"{balls:5} {sweeps:6} {forward * per_step:30.3f} {gradient * per_step:8.3f} "
            f"{1e3 * forward * per_step / sweeps / (balls - 1):14.2f} {kernel.report.seconds:11.2f} "
            f"{kernel.report.bytes_per_lane / 1e3:13.0f}"
        )


def start(balls: int) -> Any:
    """(batch, 6 balls) states: in a row, almost touching, thrown about a little."""
    rest = np.concatenate([[0.98 * i, 0, 0, 0, 0, 0] for i in range(balls)])
    return rest + 0.01 * np.random.default_rng(1).normal(size=(BATCH, 6 * balls))


if __name__ == "__main__":
    print(f"{platform.processor() or platform.machine()}, {processor().architecture}, {find_compiler().version}")
    print({name: f.n_instructions() for name, f in functions().items()})
    against_casadi()
    lanes_and_threads()
    sizes()
