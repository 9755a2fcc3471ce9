"""Programs with guards: heaps, and small ones, with and without."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from functools import cache
from typing import Any

import casadi as ca
from worlds.heaps import heap

import symphys
from symphys.codegen import FunctionCall, MemoryLayout, Place, Program
from symphys.transcription import rollout_program
from symphys.transcription.rollout import symbolic_rollout

HEAPS = {
    "spheres": heap(["sphere"] * 5),
    "capsules": heap(["capsule"] * 5, law="friction = 0.4\ntorsion = 0.01\nrolling = 0.005"),
    "a box": heap(["box", "sphere", "sphere"], restitution=0.0),
    "soft": heap(["sphere"] * 6, law="friction = 0.4\nfrequency = 30", restitution=0.0),
}


@cache
def program_of(name: str, duration: float | None = None) -> Program:
    """Built once: a program never changes."""
    text = HEAPS[name] if duration is None else HEAPS[name].replace("duration = 0.2", f"duration = {duration}")
    return rollout_program(symbolic_rollout(symphys.load(tomllib.loads(text))), exact=True)


def whole(program: Program) -> Program:
    """The same without guards and sections, in the same order: adjoints add up in that of the calls."""
    bare: dict[str, Any] = {"guard": None, "otherwise": (), "section": None, "beside": ()}
    return replace(program, body=tuple(replace(call, **bare) for call in program.body), in_order=True)


def halving(guard: bool, older: bool = False) -> Program:
    """x is moved by z where it is above 1; otherwise by nothing."""
    at = MemoryLayout()
    z, word, moved, more, out = at.take(1), at.take(1), at.take(1), at.take(1), at.take(1)
    x, g, y = ca.SX.sym("x"), ca.SX.sym("g"), ca.SX.sym("y")
    above = ca.Function("above", [x], [x > 1])
    move = ca.Function("move", [g, x], [x + g * x * x])
    last = ca.Function("last", [x, y], [x + y])
    guarded = {"guard": word, "otherwise": (z,)} if guard else {}
    chained = {"guard": word, "otherwise": (moved,)} if guard else {}
    body = (
        FunctionCall(above, (z,), (word,)),
        FunctionCall(move, (word, z), (moved,), **guarded),
        FunctionCall(move, (word, moved), (more,), **chained),
        FunctionCall(last, (more, moved if older else z), (out,)),
    )
    end = Place(at.take(1).offset, 1)
    keep = FunctionCall(ca.Function("keep", [x], [x]), (out,), (end,), accumulate=True)
    return Program(at.size, z, Place(0, 0), 1, {"end": end}, body=(*body, keep), zeroed=(end,))


def guarded_sections(guard: bool) -> Program:
    """Two sections of calls that have guards too; z is (x, y, g): x is moved where y > 0, twice where g > 0."""
    at = MemoryLayout()
    z, none, out = at.take(3), at.take(1), at.take(1)
    x, w = ca.SX.sym("x"), ca.SX.sym("w")
    parts = ca.SX.sym("z", 3)
    split = ca.Function("split", [parts], [parts[0], parts[1] > 0, parts[2] > 0])
    move = ca.Function("move", [w, x], [x + w * ca.sin(x)])
    places = at.take(1), at.take(1), at.take(1)
    body, now = [FunctionCall(split, (z,), places)], places[0]
    for _ in range(2):
        for word in (places[1], places[2]):
            new = at.take(1)
            more = {"guard": places[2], "otherwise": (now,), "section": word, "beside": (now,)} if guard else {}
            both, v = at.take(1), ca.SX.sym("v")
            body.append(FunctionCall(ca.Function("both", [w, v], [w * v]), (word, places[2]), (both,)))
            body.append(FunctionCall(move, (both, now), (new,), **more))
            now = new
    last = ca.Function("last", [x], [x * x])
    body.append(FunctionCall(last, (now,), (out,), accumulate=True))
    return Program(at.size, z, Place(0, 0), 1, {"out": out}, body=tuple(body), zeroed=(none, out))
