"""Source and interface of all backends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field
from typing import Any, Protocol

from symphys.codegen import Program
from symphys.records import dataclass
from symphys.shooting import Evaluator, Nlp

Function = Any
"""casadi.Function"""


class ProblemFunctions(Protocol):
    """A problem as casadi functions of (z, smoothing); each is made when it is first asked for."""

    @property
    def value(self) -> Function:
        """Return the function -> (merit, objective, errors, outputs)."""

    @property
    def gradient(self) -> Function:
        """Return the function -> (merit, objective, errors, d merit / dz (n,), outputs)."""

    @property
    def residuals(self) -> Function | None:
        """Return the function -> (r, objective, errors, outputs), merit = r . r.

        None where a cost is no sum of squares.
        """

    @property
    def jacobian(self) -> Function | None:
        """Return the function -> (r, objective, errors, dr/dz (m, n), outputs); None likewise."""

    @property
    def nlp(self) -> Function:
        """Return the function -> (objective, constraints)."""


@dataclass(frozen=True)
class BackendSource:
    """A problem in the forms from which backends are made.

    Attributes:
        functions: as casadi functions.
        program: makes the program of its rollout: the outputs merit, objective and, where the problem has any, errors,
            constraints, outputs and residuals, of z and the smoothing as its parameters. None: there is none.
        exact: whether that program is for smoothing 0 only.
        identity: of that program, see ``ProgramSource``; None: not known.
    """

    functions: ProblemFunctions
    program: Callable[[], Program] | None = None
    exact: bool = False
    identity: str | None = None


def no_note() -> str:
    """Return an empty note."""
    return ""


def joined(*notes: str) -> str:
    """Join notes that are not empty."""
    return "; ".join(filter(None, notes))


@dataclass(frozen=True)
class Description:
    """Description of a backend, for results.

    Attributes:
        name: of the backend.
        lanes: rollouts that one instruction computes.
        threads: blocks that are computed at once.
        precision: of the arithmetic.
        compiler: its version; empty where nothing is compiled.
        cached: whether what was compiled came from the cache; None where nothing is compiled.
        seconds: until it could evaluate.
        note: what the user should know, such as why it is not the backend that was wanted; or empty.
        later: what was decided while it evaluated, to be asked when that is over; or empty.
        doubt: what the user should know of the gradients computed so far; or empty.
        flags: with which the compiler was called.
        finish: waits for what is still being compiled.
    """

    name: str
    lanes: int = 1
    threads: int = 1
    precision: str = "double"
    compiler: str = ""
    cached: bool | None = None
    seconds: float = 0.0
    note: str = ""
    later: Callable[[], str] = field(default=no_note, repr=False, compare=False)
    doubt: Callable[[], str] = field(default=no_note, repr=False, compare=False)
    flags: tuple[str, ...] = ()
    finish: Callable[[], object] = field(default=no_note, repr=False, compare=False)

    def __str__(self) -> str:
        """Describe the backend in one line."""
        parts = [f"{self.name}: lanes {self.lanes}, threads {self.threads}, {self.precision} precision"]
        if self.cached is not None:
            parts.append(f"{self.compiler}, {'taken from the cache' if self.cached else 'compiled'}")
        return joined(*parts, self.note)

    def said(self) -> str:
        """Return the note, with what was decided since."""
        return joined(self.note, self.later())


@dataclass(frozen=True)
class Backend:
    """A backend of one problem."""

    description: Description
    evaluator: Evaluator
    nlp: Nlp
