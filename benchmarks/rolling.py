"""Compiled rollouts of any world under any scheme, without a problem file: values, gradients, states along the way."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import casadi as ca
import numpy as np

from symphys.codegen import FunctionCall, Kernel, MemoryLayout, Place, Program, compile_program
from symphys.dynamics.functions import trace_step
from symphys.model.state_layout import Layout as Columns
from symphys.model.world import Scheme, World
from symphys.types import Array, Expr

WORDS = 2_000_000
"""Of memory a lane for states in one call; longer rollouts are done in several calls, a state handed on."""


class Rolling:
    """Rollouts of one world under one scheme in one thread."""

    def __init__(
        self,
        world: World,
        scheme: Scheme,
        steps: int,
        start: tuple[int, Callable[[Expr], Expr]] | None = None,
        end: Callable[[Expr], Expr] | None = None,
        seeded: Sequence[str] | None = None,
        rows: int | None = None,
    ) -> None:
        """Say what is rolled out; it is compiled when first needed.

        Args:
            world: bodies and what they touch.
            scheme: time step and switches.
            steps: of one call.
            start: the size of z, and the state at the start as an expression of z; None: z is that state.
            end: what is asked of the state at the end; None: all of it.
            seeded: ("end",) or None: it can be differentiated; (): it cannot, which compiles faster.
            rows: see ``compile_program``.
        """
        self.columns = Columns(world)
        self.world, self.scheme, self.steps = world, scheme, steps
        self.size, self.start = start or (self.columns.size, lambda z: z)
        self.end, self.seeded, self.rows = end or (lambda x: x), seeded, rows

    @cached_property
    def kernel(self) -> Kernel:
        """The compiled rollout."""
        return compile_program(self._program(), seeded=self.seeded, threads=1, rows=self.rows)

    def ends(self, Z: Array) -> Array:
        """(batch, m) what is asked of the ends of rollouts from (batch, n)."""
        return self.kernel.forward(Z, [0.0])["end"]

    def jacobian(self, z: Array) -> Array:
        """(m, n): its derivatives, by the adjoint of the rollout."""
        return self.kernel.jacobian(z, "end", [0.0])

    def _program(self) -> Program:
        layout, columns = MemoryLayout(), self.columns
        z, parameters = layout.take(self.size), layout.take(1)
        x = layout.series(columns.size, self.steps + 1)
        body = step_calls(self.world, self.scheme, layout, x, parameters)
        (symbols, state) = ca.SX.sym("z", self.size), ca.SX.sym("x", columns.size)
        first = ca.Function("first", [symbols], [ca.densify(self.start(symbols))])
        asked = ca.densify(self.end(state))
        last = ca.Function("last", [state], [asked])
        end = layout.take(int(asked.shape[0]))
        return Program(
            size=layout.size,
            z=z,
            parameters=parameters,
            steps=self.steps,
            outputs={"end": end},
            prologue=(FunctionCall(first, (z,), (x.still(),)),),
            body=tuple(body),
            epilogue=(FunctionCall(last, (x.later(self.steps).still(),), (end,)),),
        )


def step_calls(world: World, scheme: Scheme, layout: MemoryLayout, x: Place, parameters: Place) -> list[FunctionCall]:
    """The calls of one exact time step, from the states ``x`` to the next ones."""
    columns, recording = Columns(world), trace_step(world, scheme, exact=True)
    after, empty = x.later(), Place(0, 0)
    places = {slot: Place(after.offset + s.start, s.stop - s.start, x.stride) for slot, s in recording.results.items()}
    calls = []
    for piece in recording.calls:
        for slot in piece.inputs:
            if slot.name in columns:
                part = columns[slot.name]
                places[slot] = Place(x.offset + part.start, part.stop - part.start, x.stride)
            elif slot.name:
                places[slot] = parameters if slot.name == "smoothing" else empty
        for slot in piece.outputs:
            places.setdefault(slot, layout.take(slot.size))
        inputs, outputs = (tuple(places[slot] for slot in slots) for slots in (piece.inputs, piece.outputs))
        calls.append(FunctionCall(piece.function, inputs, outputs))
    return calls


class Walk:
    """Long rollouts from one state to the next, in calls that memory allows."""

    def __init__(self, world: World, scheme: Scheme, interval: int) -> None:
        """States are asked for after every ``interval`` steps."""
        most = max(1, WORDS // Columns(world).size)
        lengths = (interval // k for k in range(1, interval + 1) if interval % k == 0)
        self.rolling = Rolling(world, scheme, next(length for length in lengths if length <= most), seeded=())
        self.calls = interval // self.rolling.steps

    def along(self, X: Array, count: int) -> Array:
        """(count, batch, nx): the states after each interval, from (batch, nx)."""
        states = []
        for _ in range(count):
            for _ in range(self.calls):
                X = self.rolling.ends(X)
            states.append(X)
        return np.array(states)
