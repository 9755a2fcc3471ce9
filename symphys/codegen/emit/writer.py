"""C functions of graphs.

Statements come in order: loads where they are used, or many of them at once, ahead of what uses them. A processor
looks ahead by itself. A thread of a device waits at the first value that is not there yet, and its compiler moves no
load across a store that might write the same word.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from symphys.codegen.emit.dialect import VECTORS, Dialect
from symphys.codegen.emit.pieces import Form, GraphPiece, pieces_of
from symphys.codegen.emit.shapes import PackWords, PlaceWords, Shape
from symphys.codegen.graph.graph import Graph
from symphys.codegen.graph.operations import MASKS
from symphys.records import dataclass


class Lines:
    """Statements as they come, in groups: of each group first all loads, then what is computed, then all stores."""

    def __init__(self, ahead: int) -> None:
        """Start without statements; ``ahead``: loads of a group, 0: statements stay where they are."""
        self._ahead = ahead
        self._done: list[str] = []
        self._loads: list[str] = []
        self._computed: list[str] = []
        self._stores: list[str] = []
        self._sums: dict[str, str] = {}
        self._count = 0

    def load(self, line: str) -> None:
        """Add a statement that reads a place."""
        self._loads.append(line)
        self._next()

    def compute(self, line: str) -> None:
        """Add a statement that reads and writes no place."""
        self._computed.append(line)
        self._next()

    def store(self, line: str) -> None:
        """Add a statement that writes a place."""
        self._stores.append(line)
        self._next()

    def add(self, to: str, value: str) -> None:
        """Add to a word that no other name leads to."""
        if to not in self._sums:
            self._sums[to], self._count = f"s{self._count}", self._count + 1
            self._loads.append(f"V {self._sums[to]} = {to};")
        self._computed.append(f"{self._sums[to]} += {value};")
        self._next()

    def all(self) -> list[str]:
        """Return the statements in their order."""
        self._close()
        return self._done

    def _next(self) -> None:
        if len(self._loads) >= self._ahead:
            self._close()

    def _close(self) -> None:
        sums = [f"{to} = {name};" for to, name in self._sums.items()]
        self._done += [*self._loads, *self._computed, *self._stores, *sums]
        for group in (self._loads, self._computed, self._stores, self._sums):
            group.clear()


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
    cut = pieces_of(graph, form, dialect.fuses)
    graph, pieces = cut.graph, [_Written(piece, dialect, words, apart) for piece in cut.pieces]
    pointers = _pointers(graph, form, dialect, words)
    parameters = ", ".join(f"{kind}{pointer}" for kind, pointer, _ in pointers) + ", V *restrict w"
    text = []
    for i, piece in enumerate(pieces):
        lines = piece.statements(graph, form)
        if piece is pieces[-1] and form.clears:
            lines += [
                f"for (int j = 0; j < {graph.sizes[a]}; j++) {words.clear(f'i{a}', 'j')}"
                for a in range(form.primal, len(graph.sizes))
            ]
        head = f"{dialect.inline} {name}_{i}({parameters})"
        text.append("\n  ".join([f"{head} {{", "(void)w;", *lines]) + "\n}\n")
    return "".join([*text, _entry(name, pointers, pieces, dialect, moving)])


@dataclass(frozen=True)
class _Written:
    """A piece in C."""

    piece: GraphPiece
    dialect: Dialect
    words: PlaceWords
    apart: Collection[int] = ()

    def statements(self, graph: Graph, form: Form) -> list[str]:
        """Return the C statements of the piece."""
        names: dict[int, str] = {}
        lines = Lines(self.dialect.ahead)
        piece, both = self.piece, self._both(graph)
        for x in piece.nodes:
            node = graph.nodes[x]
            operands = [self._use(graph, y, names, lines, form) for y in node.operands]
            if x in piece.fused:
                product = f"FMA({operands[0]}, {operands[1]}, {{}})"
                for r, word, _ in piece.targets[x]:
                    lines.store(self.words.add(f"o{r}", word, product))
                continue
            if x not in both:
                lines.compute(f"const {_type(node.op)} v{x} = {self.dialect.forms[node.op].format(*operands)};")
            elif names.keys().isdisjoint(both[x]):
                sine, cosine = (f"v{y}" for y in both[x])
                lines.compute(f"V {sine}, {cosine}; {self.dialect.both.format(operands[0], sine, cosine)};")
            names[x] = f"v{x}"
            if x in piece.slots:
                lines.compute(f"w[{piece.slots[x]}] = (V)v{x};")
            self._stores(graph, x, names[x], lines, form.adds)
        for x in piece.copied():
            self._stores(graph, x, self._use(graph, x, names, lines, form), lines, form.adds)
        return lines.all()

    def _both(self, graph: Graph) -> dict[int, tuple[int, int]]:
        """Return sines, and cosines of the same numbers, that are computed together."""
        if not self.dialect.both:
            return {}
        found: dict[int, dict[str, int]] = {}
        for x in self.piece.nodes:
            if graph.nodes[x].op in ("sin", "cos"):
                found.setdefault(graph.nodes[x].operands[0], {})[graph.nodes[x].op] = x
        pairs = [(each["sin"], each["cos"]) for each in found.values() if len(each) == 2]
        return {x: pair for pair in pairs for x in pair}

    def _use(self, graph: Graph, x: int, names: dict[int, str], lines: Lines, form: Form) -> str:
        """Return the C name of a value; a value from another piece is loaded first."""
        node = graph.nodes[x]
        if node.op == "const":
            return literal(node.value)
        if x not in names:
            given = node.op == "input"
            source = self.words.load(f"i{node.at[0]}", node.at[1]) if given else f"w[{self.piece.slots[x]}]"
            names[x] = f"v{x}"
            value = f"ALL({source})" if given and form.shared and node.at[0] < form.primal else source
            lines.load(f"const {_type(node.op)} v{x} = ({_type(node.op)}){value};")
        return names[x]

    def _stores(self, graph: Graph, x: int, value: str, lines: Lines, adds: bool) -> None:
        node = graph.nodes[x]
        if adds and node.op == "const" and float.fromhex(node.value) == 0:
            return
        for r, first, count in self.piece.targets.get(x, ()):
            if adds and count == 1 and r in self.apart:
                lines.add(self.words.load(f"o{r}", first), value)
                continue
            loop = f"for (int j = {first}; j < {first + count}; j++) " if count > 1 else ""
            write = self.words.add if adds else self.words.store
            lines.store(loop + write(f"o{r}", first if count == 1 else "j", value))


def _type(op: str) -> str:
    return "I" if op in MASKS else "V"


def _pointers(graph: Graph, form: Form, dialect: Dialect, words: PlaceWords) -> list[tuple[str, str, str]]:
    """Return (type, name, memory) of every argument and result; only adjoints of arguments may coincide."""
    kind, memory = ("const R *", "(const R *)m") if form.shared else (dialect.reads, "m")
    primal = [(kind, f"i{i}", memory) for i in range(form.primal)]
    seeds = [(dialect.writes, f"i{i}", "b") for i in range(form.primal, len(graph.sizes))]
    kind, memory = (dialect.shares, "b") if form.backward else (dialect.writes, "m")
    places = [*primal, *seeds, *((kind, f"o{i}", memory) for i in range(len(graph.results)))]
    return [(kind, pointer, memory) for kind, name, memory in places for pointer in words.pointers(name)]


def _entry(
    name: str,
    pointers: Sequence[tuple[str, str, str]],
    pieces: Sequence[_Written],
    dialect: Dialect,
    moving: Collection[int] | None,
) -> str:
    """Return the function itself.

    Pieces of one that is cut are called apart, and each finds the places that it needs.
    """
    each, moving = (1, ()) if dialect.dense else (2, moving)
    steps = [f" + k * t[{2 * i + 1}]" if moving is None or i in moving else "" for i in range(len(pointers))]
    places = [f"{memory} + t[{each * i}]{steps[i]}" for i, (_, _, memory) in enumerate(pointers)]
    slots = len(pieces[0].piece.slots)
    arguments = ", ".join([*places, "w" if slots else "0"])
    given = f"{dialect.memory}m, {dialect.memory}b, {dialect.table}t, word k"
    lines, apart = [f"V w[{slots}];"] if slots else [], []
    if len(pieces) == 1:
        lines.append(f"{name}_0({arguments});")
    for i in range(len(pieces)) if len(pieces) > 1 else ():
        lines.append(f"{name}_{i}_({'m, b, t, k, ' + ('w' if slots else '0')});")
        head = f"{dialect.apart} {name}_{i}_({given}, V *restrict w) {{"
        apart.append("\n  ".join([head, "(void)b;", f"{name}_{i}({arguments});"]) + "\n}\n")
    head = f"{dialect.entry} {name}({given}) {{"
    return "".join(apart) + "\n  ".join([head, "(void)b;", *lines]) + "\n}\n"


def literal(value: str) -> str:
    """Return a constant in all lanes."""
    number = float.fromhex(value)
    if number != number:
        return "S(NAN)"
    if number in (float("inf"), float("-inf")):
        return "S(-INFINITY)" if number < 0 else "S(INFINITY)"
    return f"S({number!r})"
