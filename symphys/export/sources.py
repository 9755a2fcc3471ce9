"""Write a problem as C sources: step, derivatives, rollout and gradient, with a header, an example and a Makefile."""

from __future__ import annotations

import re
import textwrap
import unicodedata
from collections.abc import Iterable
from importlib.resources import files
from string import Template

import casadi as ca
import numpy as np

from symphys.codegen import MemoryLayout, Program
from symphys.codegen.emit.plain import plain_functions, plain_source, table
from symphys.export import words
from symphys.transcription import Transcription, rollout_program
from symphys.transcription.rollout import Rollout, call
from symphys.transcription.staged.step_program import StepArguments
from symphys.transcription.staged.tangent import Tangent

ARGUMENTS = ["x", "u", "p", "smoothing"]


def directional_slope(arguments: StepArguments) -> ca.Function:
    """Return the function (x, u, p, smoothing, dx, du, dp) -> (x_next (nx,), dx_next (n,)), all of it dense.

    dx (n,) is a tangent of x, and dx_next one of the next state; ``Tangent`` defines their coordinates. If there are
    controllers, the last entry of u is the time [s], which du does not have.
    """
    tangent, closed = arguments.tangent, arguments.rollout.closed
    x, u, p, smoothing = (ca.SX.sym(name, closed.size1_in(i)) for i, name in enumerate(ARGUMENTS))
    n, m, np_ = arguments.sizes[1:]
    dx, du, dp = ca.SX.sym("dx", n), ca.SX.sym("du", m), ca.SX.sym("dp", np_)
    after, *others = call(closed, x, u, p, smoothing)
    moved = ca.mtimes(tangent.basis(x, p), dx) + ca.mtimes(tangent.shift(x, p), dp)
    seeds = [moved, ca.vertcat(du, ca.SX.zeros(u.numel() - m)), dp, ca.SX.zeros(1)]
    pushed = closed.forward(1)(x, u, p, smoothing, after, *others, *seeds)
    pushed = pushed[0] if isinstance(pushed, tuple | list) else pushed
    off = ca.mtimes(tangent.projection(after, p), pushed - ca.mtimes(tangent.shift(after, p), dp))
    results = [ca.densify(each) for each in (after, off)]
    names = [*ARGUMENTS, "dx", "du", "dp"]
    return ca.Function("directional", [x, u, p, smoothing, dx, du, dp], results, names, ["x_next", "dx_next"])


def slopes_function(arguments: StepArguments) -> ca.Function:
    """Return the function (x, u, p, smoothing) -> (x_next (nx,), A (n, n), B (n, m), C (n, np)), in tangents."""
    one = directional_slope(arguments)
    x, u, p, smoothing = (ca.MX.sym(name, one.size1_in(i)) for i, name in enumerate(ARGUMENTS))
    n, m, np_ = arguments.sizes[1:]
    count = n + m + np_
    directions = ca.DM.eye(count)
    seeds = [directions[rows, :] for rows in (slice(n), slice(n, n + m), slice(n + m, count))]
    after, slopes = one.map(count)(*(ca.repmat(each, 1, count) for each in (x, u, p, smoothing)), *seeds)
    parts = ca.horzsplit(slopes, [0, n, n + m, count])
    return ca.Function("linearize", [x, u, p, smoothing], [after[:, 0], *parts], ARGUMENTS, ["x_next", "A", "B", "C"])


ROOM = "symphys.export"


def c_files(transcription: Transcription, version: str) -> dict[str, bytes]:
    """Return the files, name -> content."""
    rollout, name = transcription.rollout, identifier(transcription.problem.name)
    program, step = rollout_program(rollout), dense_step(rollout)
    arguments = tangent_of(transcription)
    slope = directional_slope(arguments)
    plain = plain_source(program, ("merit",), {"step": step})
    outputs = sum(place.size for place in program.outputs.values())
    values = {"name": name, "NAME": name.upper(), "memory": plain.memory}
    values |= {"work": max(plain.memory + outputs, *(each.nnz_in() + each.nnz_out() for each in (step, slope)))}
    values |= _sizes(rollout, step) | _documented(transcription, program, version)
    values |= _data(transcription, program) | {"places": _places(step), "slope_places": _places(slope)}
    values |= _linearized(arguments, slope)
    texts = {
        f"{name}.h": _filled("api.h", values),
        f"{name}.c": f'#include "{name}.h"\n\n' + plain.text + _filled("api.c", values),
        f"{name}_linearize.c": f'#include "{name}.h"\n\n'
        + plain_functions({"slope": slope})
        + _filled("linearize.c", values),
        f"{name}_main.c": _filled("main.c", values),
        "Makefile": _filled("Makefile", values),
    }
    return {file: text.encode() for file, text in texts.items()}


def identifier(name: str) -> str:
    """Turn a problem's name into the prefix of C names."""
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    plain = re.sub(r"\W+", "_", plain).strip("_")
    return plain if plain[:1].isalpha() else f"problem_{plain}".rstrip("_")


def dense_step(rollout: Rollout) -> ca.Function:
    """Return the step (x, u, p, smoothing) -> x_next of dense vectors, without controllers."""
    step = rollout.step
    arguments = step.sx_in()
    return ca.Function("step", arguments, [ca.densify(step(*arguments))], step.name_in(), step.name_out())


def tangent_of(transcription: Transcription) -> StepArguments:
    """Return the arguments of a step and of its derivatives."""
    return StepArguments(transcription.rollout, Tangent(transcription.rollout))


def _sizes(rollout: Rollout, step: ca.Function) -> dict[str, object]:
    nx, nu, np_, _ = (step.numel_in(i) for i in range(step.n_in()))
    problem = rollout.problem
    sizes = {"n": rollout.z.shape[0], "nx": nx, "nu": nu, "np": np_, "count": len(words.error_names(problem))}
    return {**sizes, "steps": rollout.steps, "dt": f"{rollout.dt:g}"}


def _linearized(arguments: StepArguments, slope: ca.Function) -> dict[str, object]:
    tangent, closed = arguments.tangent, arguments.rollout.feedback is not None
    sizes = {"nt": tangent.size, "given": slope.numel_in("u"), "varied": slope.numel_in("du")}
    meaning = "as variables give it, then the time [s]" if closed else "that of step"
    return {**sizes, "linearized": meaning, "tangent": words.indented(words.tangent_lines(tangent))}


def _documented(transcription: Transcription, program: Program, version: str) -> dict[str, object]:
    problem, rollout = transcription.problem, transcription.rollout
    members = [
        f"  double {name}{f'[{place.size}]' if place.size > 1 or name not in ('merit', 'objective') else ''};"
        for name, place in program.outputs.items()
    ]
    return {
        "title": words.one_line(problem.title or problem.name),
        "problem": words.one_line(problem.name),
        "version": version,
        "decision": words.indented(words.decision_lines(problem)),
        "state": words.indented(words.state_lines(rollout)),
        "inputs": words.indented(words.input_lines(rollout)),
        "parameters": words.indented(words.parameter_lines(rollout)),
        "errors": words.indented(words.error_lines(problem)),
        "outputs": words.indented(words.output_lines(problem)),
        "costs": words.indented(words.cost_lines(problem)),
        "constraints": words.indented(words.constraint_lines(transcription)),
        "members": "\n".join(members),
    }


def _data(transcription: Transcription, program: Program) -> dict[str, object]:
    shooting = transcription.shooting
    stacked = {name: _numbers(shooting.stacked(name)) for name in ("lower", "upper")}
    x, u, p = program.prologue[0].outputs
    names = [string(name) for name in words.error_names(transcription.problem)]
    return {
        **stacked,
        "guess": _numbers(shooting.start(0)),
        "names": _wrapped(names or ["0"]),
        **{"at_x": x.offset, "at_u": u.offset, "at_p": p.offset},
    }


def _places(step: ca.Function) -> str:
    layout = MemoryLayout()
    sizes = [step.numel_in(i) for i in range(step.n_in())] + [step.numel_out(i) for i in range(step.n_out())]
    return table([layout.take(size) for size in sizes])


def string(text: str) -> str:
    """Write a C string literal."""
    kept = [chr(b) if 32 <= b < 127 and chr(b) not in '"\\?' else f"\\{b:03o}" for b in text.encode()]
    return f'"{"".join(kept)}"'


def _numbers(values: Iterable[float]) -> str:
    def written(x: float) -> str:
        return repr(x) if np.isfinite(x) else ("-INFINITY" if x < 0 else "INFINITY")

    return _wrapped(written(float(x)) for x in values)


def _wrapped(items: Iterable[str]) -> str:
    whole = ", ".join(items)
    return whole if len(whole) < 60 else "\n" + textwrap.indent("\n".join(textwrap.wrap(whole, 116)), "  ") + "\n"


def _filled(name: str, values: dict[str, object]) -> str:
    return Template(files(ROOM).joinpath(name).read_text(encoding="utf-8")).substitute(values)
