"""One step as programs: the next state, and how far it is from another, of a change of the state in its tangent."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.codegen import FunctionCall, MemoryLayout, Program
from symphys.transcription.decision_variables import start_of
from symphys.transcription.feedback.controller_calls import control_calls
from symphys.transcription.program import step_calls
from symphys.transcription.rollout import Rollout
from symphys.transcription.staged.tangent import Tangent

Indices = NDArray[np.int64]
Expr = Any
"""casadi SX"""


@dataclass(frozen=True, eq=False)
class StepArguments:
    """The arguments of one step, and which of them it is differentiated by.

    What varies is (d, u, p as far as z sets it), what is given (x, the state after, time, p else).
    """

    rollout: Rollout
    tangent: Tangent

    @cached_property
    def sizes(self) -> tuple[int, int, int, int]:
        """Of x, d, u and p."""
        rollout = self.rollout
        return rollout.memory.size, self.tangent.size, int(rollout.given.shape[0]), int(rollout.p.shape[0])

    @cached_property
    def varied(self) -> Indices:
        """The entries of p that z sets."""
        rollout = self.rollout
        p = start_of(rollout.problem, rollout.world, rollout.inputs, rollout.parameters, rollout.z).p
        rows = ca.Function("p", [rollout.z], [p]).jac_sparsity(0, 0).row()
        return np.unique(np.array(rows, np.int64))

    @cached_property
    def fixed(self) -> Indices:
        """The other entries of p."""
        return np.setdiff1d(np.arange(self.sizes[3]), self.varied)

    @property
    def varying(self) -> list[int]:
        """Sizes of what varies."""
        _, n, m, _ = self.sizes
        return [n, m, len(self.varied)]

    @property
    def given(self) -> list[int]:
        """Sizes of what is given."""
        nx = self.sizes[0]
        return [nx, nx, 1, len(self.fixed)]

    def together(self, varied: Expr, fixed: Expr) -> Expr:
        """P of its parts."""
        if not self.sizes[3]:
            return type(fixed)(0, 1)
        order = np.argsort(np.concatenate([self.varied, self.fixed]))
        return ca.vertcat(varied, fixed)[order.tolist()]


class StepPlaces:
    """Where a program keeps one step; see ``Places``."""

    def __init__(self, arguments: StepArguments) -> None:
        """Places for what varies, what is given and the smoothing, and for what comes of these."""
        self.rollout, self.layout = arguments.rollout, MemoryLayout()
        nx, _, m, np_ = arguments.sizes
        self.varying = self.layout.take(sum(arguments.varying))
        self.given_row = self.layout.take(sum(arguments.given) + 1)
        self.x, self.given = self.layout.series(nx, 2), self.layout.take(m)
        self.u = self.given if self.rollout.feedback is None else self.layout.series(m, 1)
        self.p, self.time, self.smoothing = self.layout.take(np_), self.layout.series(1, 1), self.layout.take(1)


def step_program(arguments: StepArguments, exact: bool, tangent: bool) -> Program:
    """The program of one step, whose output is ``after``; with ``tangent`` also ``off``.

    Its vector is what varies and its parameters what is given, and the smoothing. ``off`` is (n,) how far the state
    after the step from retract(x, d) is from the one that is given. Without ``tangent`` d is left out of the step.
    """
    places = StepPlaces(arguments)
    body = [*control_calls(arguments.rollout, places), *step_calls(places, exact)]
    after, outputs, epilogue = places.x.later().still(), {}, ()
    if tangent:
        off = places.layout.take(arguments.tangent.size)
        outputs["off"] = off
        epilogue = (FunctionCall(_off(arguments), (places.given_row, places.p, after), (off,)),)
    written = (places.x.still(), places.given, places.p, places.time.still(), places.smoothing)
    return Program(
        size=places.layout.size,
        z=places.varying,
        parameters=places.given_row,
        steps=1,
        outputs={**outputs, "after": after},
        prologue=(FunctionCall(_begun(arguments, tangent), (places.varying, places.given_row), written),),
        body=tuple(body),
        epilogue=epilogue,
    )


def _begun(arguments: StepArguments, tangent: bool) -> ca.Function:
    """(varying, given) -> state, inputs, parameters, time and smoothing of the step."""
    varying, given = ca.SX.sym("varying", sum(arguments.varying)), ca.SX.sym("given", sum(arguments.given) + 1)
    d, u, varied = parts(varying, arguments.varying)
    x, _, time, fixed, smoothing = parts(given, [*arguments.given, 1])
    p = arguments.together(varied, fixed)
    start = arguments.tangent.retraction(x, d, p) if tangent else x
    return ca.Function("begun", [varying, given], [ca.densify(each) for each in (start, u, p, time, smoothing)])


def _off(arguments: StepArguments) -> ca.Function:
    """(given, p, after) -> how far ``after`` is from the state that is given."""
    given, p = ca.SX.sym("given", sum(arguments.given) + 1), ca.SX.sym("p", arguments.sizes[3])
    after = ca.SX.sym("after", arguments.sizes[0])
    aim = parts(given, [*arguments.given, 1])[1]
    return ca.Function("off", [given, p, after], [arguments.tangent.distance(aim, after, p)])


def step_functions(arguments: StepArguments) -> tuple[ca.Function, ca.Function]:
    """(varying, given with smoothing) -> after, and off: on casadi's virtual machine."""
    varying, given = ca.MX.sym("varying", sum(arguments.varying)), ca.MX.sym("given", sum(arguments.given) + 1)
    d, u, varied = parts(varying, arguments.varying)
    x, aim, time, fixed, smoothing = parts(given, [*arguments.given, 1])
    p, closed = arguments.together(varied, fixed), arguments.rollout.closed
    put = u if arguments.rollout.feedback is None else ca.vertcat(u, time)
    first = closed(x, put, p, smoothing)
    moved = closed(arguments.tangent.retraction(x, d, p), put, p, smoothing)
    first, moved = (each[0] if isinstance(each, tuple) else each for each in (first, moved))
    off = arguments.tangent.distance(aim, moved, p)
    return ca.Function("step", [varying, given], [first]), ca.Function("off", [varying, given], [off])


def parts(column: Expr, sizes: list[int]) -> list[Expr]:
    """A column cut into parts of these sizes."""
    ends = np.cumsum([0, *sizes]).tolist()
    return [column[a:b] for a, b in pairwise(ends)]
