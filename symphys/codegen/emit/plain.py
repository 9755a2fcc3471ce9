"""A program as one plain C file, for one rollout at a time: no vectors, no Python, nothing that is not C99."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence

from symphys.codegen.emit.dialect import NUMBERS
from symphys.codegen.emit.form import Form
from symphys.codegen.emit.guarding import Guarding
from symphys.codegen.emit.plan import plan
from symphys.codegen.emit.source import DRIVER
from symphys.codegen.emit.writer import write
from symphys.codegen.graph.instructions import graph_of
from symphys.codegen.program.program import Function, Place, Program
from symphys.codegen.runtime.library import data_places
from symphys.codegen.toolchain.source_file import resource
from symphys.records import dataclass

RANGES = ("z", "parameters", "zeroed", "constants", "outputs", "seeded")
TABLES = ("prologue", "body", "epilogue", "again", "back_body", "back_prologue", "back_epilogue")
"""Tables in the order of the driver's ``program``."""


@dataclass(frozen=True)
class PlainSource:
    """C text in which everything is static.

    Attributes:
        text: the functions; the driver with ``evaluate`` and its parts; ``PROGRAM``, the data; and one function
            ``name(m, b, t, k)`` for each further function.
        memory: numbers that ``evaluate`` works in.
    """

    text: str
    memory: int


def plain_source(program: Program, seeded: Sequence[str], further: Mapping[str, Function]) -> PlainSource:
    """Return the program, the gradient of the seeded outputs, and further functions of their own."""
    planned = plan(program, seeded)
    texts = [write(f"f{number}", graph, form, NUMBERS) for number, (graph, form) in enumerate(planned.functions)]
    for name, function in further.items():
        texts.append(write(name, graph_of(function), Form(primal=function.n_in(), adds=False), NUMBERS))
    names = [f"f{number}" for number in range(len(planned.functions))]
    declared = [f"static void {name}(V *m, V *b, const word *t, word k);\n" for name in [*names, *further]]
    listed = _array("void (*const", "FUNCTIONS[])(V *, V *, const word *, word)", names)
    values = _array("double", "VALUES[]", [repr(float(x)) for _, row in program.constants for x in row])
    places = data_places(program, seeded)
    counts = {name: len(places[name]) for name in RANGES} | {name: planned.tables[name][0] for name in TABLES}
    words = {name: [x for place in places[name] for x in (place.offset, place.size)] for name in RANGES}
    words |= {name: planned.tables[name][1].tolist() for name in TABLES}
    arrays = [_array("word", f"{name.upper()}[]", map(str, row)) for name, row in words.items()]
    lists = {name: f"{{{count}, {name.upper()}}}" for name, count in counts.items()}
    fields = [str(program.size), str(planned.tape), str(program.steps), *(lists[name] for name in RANGES), "VALUES"]
    rows, left = _guarding(planned.guarding)
    data = _array("program", "PROGRAM", [*fields, *(lists[name] for name in TABLES), *left])
    driver = "".join(map(resource, DRIVER))
    text = "\n".join([resource("plain.h"), *declared, listed, *texts, driver, values, *arrays, *rows, data])
    return PlainSource(text, 2 * program.size + planned.tape + (planned.guarding.arena if planned.guarding else 0))


def _guarding(guarding: Guarding | None) -> tuple[list[str], list[str]]:
    """Return the arrays of what may be left out, and the fields of the program that name them."""
    if guarding is None:
        return [], []
    arrays = [_array("word", f"{name.upper()}[]", map(str, words)) for name, words in guarding.rows.items()]
    fields = [f".{name} = {{{guarding.count(name)}, {name.upper()}}}" for name in guarding.rows]
    return arrays, [f".first = {guarding.first}", *fields]


def plain_functions(functions: Mapping[str, Function]) -> str:
    """Return functions ``name(m, b, t, k)`` alone, in a C file of their own."""
    texts = [
        write(name, graph_of(function), Form(primal=function.n_in(), adds=False), NUMBERS)
        for name, function in functions.items()
    ]
    return "\n".join([resource("plain.h"), *texts])


def table(places: Iterable[Place]) -> str:
    """Return the places of a call as C numbers: offset and stride of each."""
    return ", ".join(f"{place.offset}, {place.stride}" for place in places)


def _array(kind: str, name: str, items: Iterable[str]) -> str:
    """Return a constant with its values; C knows no empty ones."""
    const = "" if kind.startswith("void") else "const "
    body = textwrap.fill(", ".join(items) or "0", 118, initial_indent="  ", subsequent_indent="  ")
    return f"static {const}{kind} {name} = {{\n{body}\n}};\n"
