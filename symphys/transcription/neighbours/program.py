"""The step of many bodies as a crowd for the compiler."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import casadi as ca

from symphys.codegen import FunctionCall, MemoryLayout, Place, Program
from symphys.codegen.neighbours.program import Crowd, Meeting, MemberCall, Room, SightPlaces
from symphys.dynamics.collision.near_points import can_measure
from symphys.dynamics.neighbours.sample import TWINS, Sample, sample_of
from symphys.dynamics.neighbours.step import RecordedStep, recorded_step
from symphys.dynamics.tracing.recording import TracedCall, TracedVector
from symphys.errors import SymphysError
from symphys.model.scalar import is_number
from symphys.model.shapes import Plane
from symphys.model.state_layout import Layout
from symphys.model.world import UNEQUAL, Law, Scheme, World
from symphys.suggest import quote
from symphys.transcription.neighbours.loops import LoopStep, loops_of

ROOM_FOR = 2
"""Pairs of a kind for each body, for which there is room at first."""


def crowd_of(world: World, law: Law, scheme: Scheme, exact: bool = False) -> Crowd:
    """The step of bodies without joints, which are known in numbers, on planes; all touch all with one law.

    Args:
        world: bodies and planes; its pairs are not looked at.
        law: of all contacts.
        scheme: how a step is taken.
        exact: for smoothing 0 only, whatever is given.

    Raises:
        SymphysError: names the body or the surface that is none of these.
    """
    _check(world)
    sample = sample_of(world, law)
    crowd = _crowd(sample, recorded_step(sample, scheme, exact=exact))
    if any(can_measure(body) for body in sample.world.bodies):
        return crowd
    # Of balls all that is near touches in a heap, so that to look again costs more than it saves where a tape is read.
    return replace(crowd, taped=_crowd(sample, recorded_step(sample, scheme, exact=exact, again=False)))


def _crowd(sample: Sample, recorded: RecordedStep) -> Crowd:
    step = loops_of(sample, recorded)
    species, counts = len(sample.species), [len(own) for own in sample.species]
    members = [1, *counts, *(ROOM_FOR * counts[kind.first] for kind in sample.kinds)]
    meetings = []
    for kind in sample.kinds:
        if kind.second is not None:
            meetings.append(Meeting(kind.first, kind.second))
            continue
        plane = sample.world.statics[kind.plane]
        assert isinstance(plane, Plane)
        x, y, z = map(float, plane.normal)
        meetings.append(Meeting(kind.first, normal=(x, y, z), offset=float(plane.offset)))
    *seen, striking = recorded.recorder.sights
    begin = [step.homes[number][1] for number in seen[::TWINS]]
    sights = [SightPlaces(position, position + 3) for position in begin]
    rooms = [Room(*each) for each in zip(step.work, step.states, members, strict=True)]
    program, places = step_program(sample.world, recorded.calls, recorded.sizes)
    roots = tuple(place for vector, place in places.items() if vector.number in recorded.recorder.roots)
    return Crowd(
        program,
        step.loops,
        step.sieves,
        tuple(rooms),
        tuple(meetings),
        tuple(sights),
        step.homes[striking][1],
        next(k for k, loop in enumerate(step.loops) if loop.room > species),
        _looked(step, recorded),
        tuple(_near_words(sample, recorded, step, kind) for kind in range(len(sample.kinds))),
        sum(recorded.sizes.values()),
        roots,
    )


def _looked(step: LoopStep, recorded: RecordedStep) -> int:
    """The number of the loop after the last call that finds out whether a pair is near."""
    words = {vector.number for vector in recorded.recorder.guards}
    found = 0
    for number, loop in enumerate(step.loops):
        for does in loop.does:
            if isinstance(does, MemberCall) and not words.isdisjoint(
                vector.number for vector in recorded.calls[does.number].outputs
            ):
                found = number + 1
    return found


def _near_words(sample: Sample, recorded: RecordedStep, step: LoopStep, kind: int) -> tuple[int, ...]:
    """Where the words of guards of a kind of pairs lie: those of its points, where these are looked at."""
    first = {(pair.first, pair.second) for pair in (sample.world.pairs[k] for k in sample.pairs[kind])}
    recorder = recorded.recorder
    words = [vector.number for vector in recorder.guards if recorder.words[vector.number] in first]
    return tuple(step.homes[number][1] for number in [n for n in words if n in recorder.points] or words)


def step_program(
    world: World, traced: Sequence[TracedCall], sizes: Mapping[str, int]
) -> tuple[Program, Mapping[TracedVector, Place]]:
    """One step without guards, from z, the state, to "x", the parts of the next; where its vectors lie.

    ``sizes`` are those of "u", "p" and "smoothing", the parameters.
    """
    layout, at = Layout(world), MemoryLayout()
    x = at.take(layout.size)
    given = {name: at.take(size) for name, size in sizes.items()}
    places: dict[TracedVector, Place] = {}
    calls = []
    for call in traced:
        for vector in call.inputs:
            if vector.name in given:
                places[vector] = given[vector.name]
            elif vector.name:
                part = layout[vector.name]
                places[vector] = Place(x.offset + part.start, part.stop - part.start)
        for vector in call.outputs:
            places[vector] = at.take(vector.size)
        inputs, outputs = (tuple(places[v] for v in vectors) for vectors in (call.inputs, call.outputs))
        calls.append(FunctionCall(call.function, inputs, outputs))
    ends = [places[vector] for call in traced for vector in call.outputs if vector.name == "next"]
    symbols = [ca.SX.sym("end", place.size) for place in ends]
    after = at.take(sum(place.size for place in ends))
    stack = ca.Function("after", symbols, [ca.vertcat(*symbols)])
    first, size = given["u"].offset, sum(sizes.values())
    program = Program(
        size=at.size,
        z=x,
        parameters=Place(first, size),
        steps=1,
        outputs={"x": after},
        body=(*calls, FunctionCall(stack, tuple(ends), (replace(after, stride=after.size),))),
        in_order=True,
    )
    return program, places


def _check(world: World) -> None:
    """Refuse what steps of many bodies do not know."""
    held = {index for joint in world.joints for index in joint.bodies}
    for index, body in enumerate(world.bodies):
        if index in held or body.massless:
            raise SymphysError(f"neighbours: {quote(body.name)} must have a mass and no joint")
        if not is_number((body.mass, body.inertia, *((shape.centre, shape.sizes) for shape in body.shapes))):
            raise SymphysError(f"neighbours: no number of {quote(body.name)} may vary")
    for static in world.statics:
        if not isinstance(static, Plane):
            raise SymphysError(f"neighbours: {quote(static.name)} must be a plane")
    masses = [float(body.mass) for body in world.bodies]
    if masses and max(masses) > UNEQUAL * min(masses):
        raise SymphysError(f"neighbours: masses must not differ by more than a factor of {UNEQUAL:g}")
