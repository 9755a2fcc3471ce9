"""The step of many bodies, recorded for a sample of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca

from symphys.dynamics.arguments import arguments_of, context_of, parts_of
from symphys.dynamics.impact.restitution import eccentric_bodies
from symphys.dynamics.neighbours.recording import MemberRecorder
from symphys.dynamics.neighbours.sample import Sample
from symphys.dynamics.step import SPLITS_OFF_CENTRE, take_step
from symphys.dynamics.tracing.dead_code import without_dead_code
from symphys.dynamics.tracing.decorator import tracing
from symphys.dynamics.tracing.guards import with_guards
from symphys.dynamics.tracing.recording import TracedCall
from symphys.model.state_layout import Layout
from symphys.model.world import Scheme, World

Expr = Any
"""casadi SX"""


@dataclass(frozen=True)
class StateNames:
    """Where named parts of a state lie.

    Attributes:
        owners: of the parts, "" for what is there once.
        offsets: of the parts in the state of their owner.
        results: for the numbers of vectors of the next state where they lie in that of their owner.
    """

    owners: Mapping[str, str]
    offsets: Mapping[str, int]
    results: Mapping[int, int]


@dataclass(frozen=True)
class RecordedStep:
    """A step of a sample.

    Attributes:
        calls: with guards.
        recorder: that recorded them.
        names: of the parts of its state.
        sizes: of "u", "p" and "smoothing", which are given one after the other.
    """

    calls: tuple[TracedCall, ...]
    recorder: MemberRecorder
    names: StateNames
    sizes: Mapping[str, int]


def recorded_step(
    sample: Sample,
    scheme: Scheme,
    inputs: Sequence[str] = (),
    parameters: Sequence[Any] = (),
    exact: bool = False,
    again: bool = True,
) -> RecordedStep:
    """The step of a sample.

    Args:
        sample: a few bodies.
        scheme: how a step is taken.
        inputs: of the step.
        parameters: of the step.
        exact: at smoothing 0 only.
        again: whether what is near is looked at again in each substep, which changes no bit.
    """
    world = sample.world
    scheme = replace(scheme, cuts=_cuts(world, scheme))
    x, u, p, smoothing = arguments_of(world, inputs, parameters)
    layout, recorder = Layout(world), MemberRecorder()
    for name, symbols in (("u", u), ("p", p), ("smoothing", smoothing), *parts_of(layout, x).items()):
        recorder.argument(name, symbols)
    owners, offsets = _names(sample, layout)
    with tracing(recorder):
        context = context_of(world, scheme, inputs, [x, u, p, ca.SX(0) if exact else smoothing])
        context = replace(context, sample=True, again=again)
        after, _ = take_step(context, parts_of(layout, x))
        results = {}
        for owner in dict.fromkeys(owners.values()):
            own = [name for name in layout.names() if owners[name] == owner]
            results[recorder.give("next", [after[name] for name in own]).number] = offsets[own[0]]
    calls = with_guards(without_dead_code(recorder.calls), recorder.guards, recorder.sections, recorder.late_guards)
    calls = _seen_first(calls, recorder.sights)
    sizes = {"u": u.numel(), "p": p.numel(), "smoothing": 1}
    return RecordedStep(calls, recorder, StateNames(owners, offsets, results), sizes)


def _cuts(world: World, scheme: Scheme) -> int:
    """How often a step is split, where bodies have several pairs; see ``splits_of``."""
    if not scheme.time_of_impact:
        return 0
    if scheme.cuts is not None:
        return scheme.cuts
    return SPLITS_OFF_CENTRE if eccentric_bodies(world) else 1


def _seen_first(calls: Sequence[TracedCall], sights: Sequence[int]) -> tuple[TracedCall, ...]:
    """The calls that vectors depend on, then the others: pairs are looked for between the two."""
    wanted, first = set(sights), set[int]()
    for k in range(len(calls) - 1, -1, -1):
        if not wanted.isdisjoint(vector.number for vector in calls[k].outputs):
            wanted.update(vector.number for vector in calls[k].inputs)
            first.add(k)
    return tuple([calls[k] for k in sorted(first)] + [call for k, call in enumerate(calls) if k not in first])


def _names(sample: Sample, layout: Layout) -> tuple[dict[str, str], dict[str, int]]:
    """Owners of the parts of a state, and where they lie; the points of a pair lie one after the other."""
    owners, offsets, taken = dict[str, str](), dict[str, int](), dict[object, int]()
    sides = {pair.name: (pair.first, pair.second) for pair in sample.world.pairs}
    for name in layout.names():
        owner = name.rpartition(".")[0]
        key = sides.get(owner, owner)
        owners[name], offsets[name] = owner, taken.get(key, 0)
        taken[key] = offsets[name] + layout[name].stop - layout[name].start
    return owners, offsets
