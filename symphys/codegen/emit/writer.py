"""From graphs to C functions, cut where a compiler's register allocation would take too long."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import groupby

from symphys.codegen.emit.dialect import VECTORS, Dialect
from symphys.codegen.graph.graph import Graph
from symphys.codegen.graph.operations import MASKS
from symphys.codegen.graph.rewrite import fused_results, with_fused_products

LONGEST = 500
"""Statements in one C function, and copies of what is given: a compiler's time grows faster than its length."""

MANY = 8
"""Words in a row that are one constant are written by a loop: inputs that nothing sets fill thousands of them."""


@dataclass(frozen=True)
class Form:
    """How a graph meets the memory.

    Attributes:
        primal: how many of its arguments are places of the memory; the others are places of the adjoint memory.
        adds: results are added to what is there.
        backward: results go to the adjoint memory.
        clears: the adjoint arguments are zeroed when they have been read.
        shared: what it reads of the memory is one number for all lanes.
    """

    primal: int
    adds: bool
    backward: bool = False
    clears: bool = False
    shared: bool = False


def write(
    name: str, graph: Graph, form: Form, dialect: Dialect = VECTORS, moving: Collection[int] | None = None
) -> str:
    """The C function ``name(m, b, t, k)``: memory, adjoint memory, places as (offset, stride) pairs, step.

    ``moving``: the places that may have a stride; None: all.
    """
    fused: set[int] = set()
    if form.backward and dialect.fuses:
        graph = with_fused_products(graph, form.adds)
        fused = fused_results(graph) if form.adds else fused
    pieces = _cut(graph, dialect, fused)
    pointers = _pointers(graph, form, dialect)
    parameters = ", ".join(f"{kind}{pointer}" for kind, pointer, _ in pointers) + ", V *restrict w"
    text = []
    for i, piece in enumerate(pieces):
        lines = piece.statements(graph, form)
        if piece is pieces[-1] and form.clears:
            lines += [
                f"for (int j = 0; j < {graph.sizes[a]}; j++) {dialect.word.format(f'i{a}', 'j')} = S(0.0);"
                for a in range(form.primal, len(graph.sizes))
            ]
        head = f"{dialect.inline if len(pieces) == 1 else dialect.apart} {name}_{i}({parameters})"
        text.append("\n  ".join([f"{head} {{", "(void)w;", *lines]) + "\n}\n")
    return "".join([*text, _entry(name, pointers, pieces, dialect, moving)])


@dataclass
class _Piece:
    """A run of nodes that becomes one C function.

    Attributes:
        nodes: what it computes, in order.
        slots: the values that a later piece than their own reads, and their words in the buffer between pieces.
        dialect: how it is written.
        fused: products that are added to results in one rounding.
        targets: for a node, the words of results that it is; a loop's head comes before the words that it fills.
    """

    nodes: list[int]
    slots: dict[int, int]
    dialect: Dialect
    fused: set[int]
    targets: dict[int, list[str]] = field(default_factory=dict)

    def statements(self, graph: Graph, form: Form) -> list[str]:
        """Its C statements."""
        names: dict[int, str] = {}
        lines: list[str] = []
        for x in self.nodes:
            node = graph.nodes[x]
            operands = [self._use(graph, y, names, lines, form) for y in node.operands]
            if x in self.fused:
                lines += (f"{to} = FMA({operands[0]}, {operands[1]}, {to});" for to in self.targets[x])
                continue
            lines.append(f"const {_type(node.op)} v{x} = {self.dialect.forms[node.op].format(*operands)};")
            names[x] = f"v{x}"
            if x in self.slots:
                lines.append(f"w[{self.slots[x]}] = (V)v{x};")
            lines += self._stores(graph, x, names[x], form.adds)
        for x in set(self.targets) - set(self.nodes):
            value = self._use(graph, x, names, lines, form)
            lines += self._stores(graph, x, value, form.adds)
        return lines

    def _use(self, graph: Graph, x: int, names: dict[int, str], lines: list[str], form: Form) -> str:
        """How a value is called here; what comes from elsewhere is loaded first."""
        node = graph.nodes[x]
        if node.op == "const":
            return literal(node.value)
        if x not in names:
            given = node.op == "input"
            source = self.dialect.word.format(f"i{node.at[0]}", node.at[1]) if given else f"w[{self.slots[x]}]"
            names[x] = f"v{x}"
            value = f"ALL({source})" if given and form.shared and node.at[0] < form.primal else source
            lines.append(f"const {_type(node.op)} v{x} = ({_type(node.op)}){value};")
        return names[x]

    def _stores(self, graph: Graph, x: int, value: str, adds: bool) -> Iterator[str]:
        node = graph.nodes[x]
        if adds and node.op == "const" and float.fromhex(node.value) == 0:
            return
        for target in self.targets.get(x, ()):
            yield f"{target} {'+=' if adds else '='} {value};"


def _cut(graph: Graph, dialect: Dialect, fused: set[int]) -> list[_Piece]:
    order = [x for x in graph.needed() if graph.nodes[x].op not in ("const", "input")]
    runs = [order[i : i + LONGEST] for i in range(0, len(order), LONGEST)] or [[]]
    home = {x: i for i, run in enumerate(runs) for x in run}
    crossing = sorted({y for x in order for y in graph.nodes[x].operands if home.get(y, home[x]) != home[x]})
    slots = {x: slot for slot, x in enumerate(crossing)}
    pieces = [_Piece(run, slots, dialect, fused) for run in runs]
    copied = 0
    for r, result in enumerate(graph.results):
        for x, first, count in _runs(graph, result):
            if x not in home and (copied := copied + 1) % LONGEST == 0:
                pieces.append(_Piece([], slots, dialect, fused))
            target = dialect.word.format(f"o{r}", first if count == 1 else "j")
            loop = f"for (int j = {first}; j < {first + count}; j++) " if count > 1 else ""
            pieces[home.get(x, -1)].targets.setdefault(x, []).append(f"{loop}{target}")
    return pieces


def _runs(graph: Graph, result: Sequence[int]) -> Iterator[tuple[int, int, int]]:
    """(value, first word, number of words) of a result; words are together where one constant fills many of them."""
    first = 0
    for x, words in groupby(result):
        count = len(list(words))
        if graph.nodes[x].op == "const" and count >= MANY:
            yield x, first, count
        else:
            yield from ((x, word, 1) for word in range(first, first + count))
        first += count


def _type(op: str) -> str:
    return "I" if op in MASKS else "V"


def _pointers(graph: Graph, form: Form, dialect: Dialect) -> list[tuple[str, str, str]]:
    """(type, name, memory) of every argument and result; adjoints of arguments may coincide, all others may not."""
    kind, memory = ("const R *", "(const R *)m") if form.shared else (dialect.reads, "m")
    primal = [(kind, f"i{i}", memory) for i in range(form.primal)]
    seeds = [(dialect.writes, f"i{i}", "b") for i in range(form.primal, len(graph.sizes))]
    kind, memory = (dialect.shares, "b") if form.backward else (dialect.writes, "m")
    return [*primal, *seeds, *((kind, f"o{i}", memory) for i in range(len(graph.results)))]


def _entry(
    name: str,
    pointers: Sequence[tuple[str, str, str]],
    pieces: Sequence[_Piece],
    dialect: Dialect,
    moving: Collection[int] | None,
) -> str:
    steps = [f" + k * t[{2 * i + 1}]" if moving is None or i in moving else "" for i in range(len(pointers))]
    places = [f"{memory} + t[{2 * i}]{steps[i]}" for i, (_, _, memory) in enumerate(pointers)]
    slots = len(pieces[0].slots)
    arguments = ", ".join([*places, "w" if slots else "0"])
    lines = [f"V w[{slots}];"] if slots else []
    lines += [f"{name}_{i}({arguments});" for i in range(len(pieces))]
    head = f"{dialect.entry} {name}(V *m, V *b, const word *t, word k) {{"
    return "\n  ".join([head, "(void)b;", *lines]) + "\n}\n"


def literal(value: str) -> str:
    """A constant in all lanes."""
    number = float.fromhex(value)
    if number != number:
        return "S(NAN)"
    if number in (float("inf"), float("-inf")):
        return "S(-INFINITY)" if number < 0 else "S(INFINITY)"
    return f"S({number!r})"
