"""Write a problem as serialised functions that casadi loads without symphys."""

from __future__ import annotations

import tempfile
import textwrap
from pathlib import Path
from typing import Any

import casadi as ca

from symphys.export import words
from symphys.export.sources import dense_step, slopes_function, tangent_of
from symphys.transcription import Transcription

RESULTS = {
    "value": ("merit", "objective", "errors", "outputs"),
    "gradient": ("merit", "objective", "errors", "gradient", "outputs"),
    "residuals": ("residuals", "objective", "errors", "outputs"),
    "jacobian": ("residuals", "objective", "errors", "jacobian", "outputs"),
    "nlp": ("objective", "constraints"),
}
"""The results of each function of (z, smoothing), as in ``ShootingProblem``."""
INTRODUCTION = """{title}

Written by symphys {version} from the problem {problem}, with casadi {casadi}. Each file holds a function:

    import casadi
    gradient = casadi.Function.load("gradient.casadi")
    merit, objective, errors, slope, outputs = gradient(z, 0)

SI units; z points up; world frame. {steps} steps of {dt:g} s.
merit is the objective and the penalties of violated constraints; without constraints both are one. It is the sum of the
squares of the residuals. smoothing [m/s] >= 0 rounds off contact; 0 is the exact law.
"""


def casadi_files(transcription: Transcription, version: str) -> dict[str, bytes]:
    """Return the files, name -> content."""
    functions = {"step": dense_step(transcription.rollout), "linearize": slopes_function(tangent_of(transcription))}
    if transcription.rollout.feedback is not None:
        functions["control"] = transcription.rollout.feedback
    for name, results in RESULTS.items():
        function = getattr(transcription.functions, name)
        if function is not None:
            functions[name] = _named(name, function, results)
    contents = {f"{name}.casadi": _serialised(function) for name, function in functions.items()}
    return contents | {"README.txt": _readme(transcription, functions, version).encode()}


def _named(name: str, function: Any, results: tuple[str, ...]) -> ca.Function:
    arguments = function.mx_in()
    return ca.Function(name, arguments, list(function.call(arguments)), ["z", "smoothing"], list(results))


def _serialised(function: ca.Function) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "function"
        function.save(str(path))
        return path.read_bytes()


def _readme(transcription: Transcription, functions: dict[str, ca.Function], version: str) -> str:
    problem, rollout = transcription.problem, transcription.rollout
    head = INTRODUCTION.format(
        title=problem.title,
        version=version,
        problem=problem.name,
        casadi=ca.CasadiMeta.version(),
        steps=rollout.steps,
        dt=rollout.dt,
    )
    sections = {
        "Functions": [_signature(function) for function in functions.values()],
        "z, what may be chosen": words.decision_lines(problem),
        "The guess of z": textwrap.wrap(", ".join(map(repr, transcription.shooting.start(0).tolist())), 110),
        "x, the state": words.state_lines(rollout),
        "u, forces, torques and commands, constant over a step": words.input_lines(rollout),
        "p, parameters": words.parameter_lines(rollout),
        "A (by the state), B (by u), C (by p): slopes of the step with its controllers; their rows, and A's columns": (
            words.tangent_lines(tangent_of(transcription).tangent)
        ),
        "errors, each error / tolerance, met where <= 1": words.error_lines(problem),
        "outputs": words.output_lines(problem),
        "constraints, their values": words.constraint_lines(transcription),
    }
    return "\n".join([head, *(f"{title}:\n{words.indented(lines)}\n" for title, lines in sections.items())])


def _signature(function: ca.Function) -> str:
    taken = ", ".join(f"{name} ({function.numel_in(i)})" for i, name in enumerate(function.name_in()))
    given = ", ".join(f"{name} {_shape(function, i)}" for i, name in enumerate(function.name_out()))
    return f"{function.name()}: {taken} -> {given}"


def _shape(function: ca.Function, i: int) -> str:
    rows, columns = function.size_out(i)
    return f"({rows})" if columns == 1 else f"({rows} x {columns})"
