"""C functions of graphs.

Statements come in order: loads where they are used, or many of them at once, ahead of what uses them. A processor
looks ahead by itself. A thread of a device waits at the first value that is not there yet, and its compiler moves no
load across a store that might write the same word. ``graphs.c`` writes them, with templates that are made here.
"""

from __future__ import annotations

import ctypes
from collections.abc import Collection, Sequence
from functools import cache
from typing import Any

from symphys.codegen.emit.dialect import VECTORS, Dialect
from symphys.codegen.emit.form import Form
from symphys.codegen.emit.shapes import PackWords, PlaceWords, Shape
from symphys.codegen.graph.graph import Graph, library, operations

VALUE, FACTORS = "\2", ("\3", "\4")
"""Stand for a value, and for the factors of a product, in templates."""
TEXTS = ctypes.POINTER(ctypes.c_char_p)


class _Word(int):
    """Stands for the number of a word in templates: a step between two marks is that times the word."""

    def __mul__(self, step: int) -> Any:
        return f"\1{step}\1"

    def __format__(self, form: str) -> str:
        return "\1" + "1\1"


WORD = _Word(0)


class _Style(ctypes.Structure):
    _fields_ = (
        ("forms", TEXTS),
        ("both", ctypes.c_char_p),
        *((name, TEXTS) for name in ("load", "read", "store", "loop", "add", "add_loop", "add_product")),
        ("apart", ctypes.POINTER(ctypes.c_uint8)),
        *((name, ctypes.c_char_p) for name in ("head", "name", "parameters", "last")),
        ("ahead", ctypes.c_int64),
    )


def write(
    name: str,
    graph: Graph,
    form: Form,
    dialect: Dialect = VECTORS,
    moving: Collection[int] | None = None,
    shape: Shape | None = None,
    apart: Collection[int] = (),
) -> str:
    """Return the C function ``name(m, b, t, k)``: memory, adjoint memory, places as (offset, stride) pairs, step.

    ``moving``: the pairs that may have a stride; None: all. ``shape``: of a function in a library of one lane.
    ``apart``: the results that meet no other in any call.
    """
    words = PlaceWords(dialect.word) if shape is None else PackWords(shape, len(graph.sizes), form.backward)
    pointers = _pointers(graph, form, dialect, words)
    parameters = ", ".join(f"{kind}{pointer}" for kind, pointer, _ in pointers) + ", V *restrict w"
    cleared = range(form.primal, len(graph.sizes)) if form.clears else ()
    last = [f"for (int j = 0; j < {graph.sizes[a]}; j++) {words.clear(f'i{a}', 'j')}" for a in cleared]
    arguments, results = [f"i{i}" for i in range(len(graph.sizes))], [f"o{i}" for i in range(len(graph.result_sizes))]
    product = f"FMA({FACTORS[0]}, {FACTORS[1]}, {{}})"
    templates = {
        "load": [_given(words.load(i, WORD), form.shared and k < form.primal) for k, i in enumerate(arguments)],
        "read": [words.load(o, WORD) for o in results],
        "store": [words.store(o, WORD, VALUE) for o in results],
        "loop": [words.store(o, "j", VALUE) for o in results],
        "add": [words.add(o, WORD, VALUE) for o in results],
        "add_loop": [words.add(o, "j", VALUE) for o in results],
        "add_product": [words.add(o, WORD, product) for o in results],
    }
    style = _Style(
        _forms(dialect),
        dialect.both.encode(),
        *(_texts(tuple(each)) for each in templates.values()),
        (ctypes.c_uint8 * max(len(results), 1))(*(r in apart for r in range(len(results)))),
        *(text.encode() for text in (dialect.inline, name, parameters, "".join(f"\n  {line}" for line in last))),
        dialect.ahead,
    )
    pieces, slots = ctypes.c_int32(), ctypes.c_int32()
    address = library().graph_write(
        graph.address, ctypes.byref(style), form.adds, form.backward, dialect.fuses,
        ctypes.byref(pieces), ctypes.byref(slots),
    )  # fmt: skip
    text = ctypes.string_at(address).decode()
    library().text_free(address)
    return text + _entry(name, pointers, pieces.value, slots.value, dialect, moving)


def _given(source: str, shared: bool) -> str:
    return f"ALL({source})" if shared else source


@cache
def _texts(texts: tuple[str, ...]) -> Any:
    """Return strings for C."""
    return (ctypes.c_char_p * max(len(texts), 1))(*(text.encode() for text in texts))


def _forms(dialect: Dialect) -> Any:
    return _texts(tuple(dialect.forms.get(name, "") for name in operations()))


def _pointers(graph: Graph, form: Form, dialect: Dialect, words: PlaceWords) -> list[tuple[str, str, str]]:
    """Return (type, name, memory) of every argument and result; only adjoints of arguments may coincide."""
    kind, memory = ("const R *", "(const R *)m") if form.shared else (dialect.reads, "m")
    primal = [(kind, f"i{i}", memory) for i in range(form.primal)]
    seeds = [(dialect.writes, f"i{i}", "b") for i in range(form.primal, len(graph.sizes))]
    kind, memory = (dialect.shares, "b") if form.backward else (dialect.writes, "m")
    places = [*primal, *seeds, *((kind, f"o{i}", memory) for i in range(len(graph.result_sizes)))]
    return [(kind, pointer, memory) for kind, name, memory in places for pointer in words.pointers(name)]


def _entry(
    name: str,
    pointers: Sequence[tuple[str, str, str]],
    pieces: int,
    slots: int,
    dialect: Dialect,
    moving: Collection[int] | None,
) -> str:
    """Return the function itself.

    Pieces of one that is cut are called apart, and each finds the places that it needs.
    """
    each, moving = (1, ()) if dialect.dense else (2, moving)
    steps = [f" + k * t[{2 * i + 1}]" if moving is None or i in moving else "" for i in range(len(pointers))]
    places = [f"{memory} + t[{each * i}]{steps[i]}" for i, (_, _, memory) in enumerate(pointers)]
    arguments = ", ".join([*places, "w" if slots else "0"])
    given = f"{dialect.memory}m, {dialect.memory}b, {dialect.table}t, word k"
    lines, apart = [f"V w[{slots}];"] if slots else [], []
    if pieces == 1:
        lines.append(f"{name}_0({arguments});")
    for i in range(pieces) if pieces > 1 else ():
        lines.append(f"{name}_{i}_({'m, b, t, k, ' + ('w' if slots else '0')});")
        head = f"{dialect.apart} {name}_{i}_({given}, V *restrict w) {{"
        apart.append("\n  ".join([head, "(void)b;", f"{name}_{i}({arguments});"]) + "\n}\n")
    head = f"{dialect.entry} {name}({given}) {{"
    return "".join(apart) + "\n  ".join([head, "(void)b;", *lines]) + "\n}\n"
