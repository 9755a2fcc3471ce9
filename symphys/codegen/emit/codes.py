"""Functions as codes for an interpreter, which is compiled once for all programs: it runs until a kernel is compiled.

Codes of an operation are its number, the operand that it gives and those that it takes, in the order of the C code: so
sums are added up in the same order, and bits are the same.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence

from symphys.codegen.emit.pieces import Cut, Form, pieces_of
from symphys.codegen.emit.source import DRIVER, SourceFile, head_of, resource
from symphys.codegen.errors import KernelUnavailable
from symphys.codegen.graph.graph import Graph
from symphys.codegen.graph.operations import FORMS
from symphys.records import dataclass

WORD_BITS = 21
"""Bits of an operand for the word; the others are for the place."""
REGISTERS, CONSTANTS, PLACES = 0, 1, 2
"""Places of an operand: values that the function keeps, constants, and from here on those of the call."""
MAX_REGISTERS = 4096
"""Values that a function keeps at once: they lie on the stack of a thread."""
OWN_CODES = ("end", "copy", "add_to", "fill")
NUMBERS = {name: number for number, name in enumerate((*OWN_CODES, *FORMS))}
MASKED = {"not": "I", "and": "II", "or": "II", "one": "I", "iez": "IV", "select": "IVV"}
"""Types of operands where one is a mask."""


@dataclass(frozen=True)
class Codes:
    """The functions of a plan.

    Attributes:
        words: codes of all functions, unsigned, 4 bytes each.
        starts: where each function begins.
        constants: numbers; every function finds their address at its codes 2 and 3.
    """

    words: array[int]
    starts: list[int]
    constants: list[float]


def codes_of(functions: Sequence[tuple[Graph, Form]]) -> Codes:
    """Return the codes of a plan's functions; KernelUnavailable where a function is too large for them."""
    words, starts, numbers = array("I"), list[int](), dict[str, int]()
    for graph, form in functions:
        starts.append(len(words))
        _Encoder(pieces_of(graph, form, fuses=True), form, numbers).encode(words)
    if len(numbers) >> WORD_BITS:
        raise KernelUnavailable("a program has too many constants to be interpreted")
    return Codes(words, starts, [float.fromhex(value) for value in numbers])


def interpreter(lanes: int, single: bool, driver: Sequence[str] = (*DRIVER, "phases.c")) -> SourceFile:
    """Return the C file: it depends on nothing of a program. ``driver``: files of what calls the functions."""
    cases = "".join(f"{name}_op: {{ {_case(name)} NEXT; }}\n" for name in FORMS)
    labels = ", ".join([*(f"&&{name}" for name in OWN_CODES), *(f"&&{name}_op" for name in FORMS)])
    text = resource("interpreter.c").replace("OPERATIONS", labels).replace("CASES", cases)
    start = f"{head_of(lanes, single)}#include <string.h>\n#define WORD_BITS {WORD_BITS}\n"
    return SourceFile(start + text + "".join(map(resource, driver)), straight=True)


def _case(name: str) -> str:
    count = max(i for i in range(3) if f"{{{i}}}" in FORMS[name]) + 1
    kinds = MASKED.get(name, "VVV")
    operands = [f"const {kinds[i]} {x} = ({kinds[i]})*AT(c[{i + 2}]);" for i, x in enumerate("xyz"[:count])]
    return f"{' '.join(operands)} *AT(c[1]) = (V)({FORMS[name].format('x', 'y', 'z')}); c += {count + 2};"


class _Encoder:
    """One function."""

    def __init__(self, cut: Cut, form: Form, numbers: dict[str, int]) -> None:
        """Start without codes; ``numbers``: of constants so far."""
        self.cut, self.form, self.numbers = cut, form, numbers
        self.where: dict[int, int] = {}
        self.free: list[int] = []
        self.kept = 0
        self.arguments = len(cut.graph.sizes)

    def encode(self, words: array[int]) -> None:
        """Add its codes."""
        graph, form, pieces = self.cut.graph, self.form, self.cut.pieces
        places = self.arguments + len(graph.results)
        sizes = [*graph.sizes, *map(len, graph.results)]
        if places + PLACES >= 1 << (32 - WORD_BITS) or max(sizes, default=0) >= 1 << WORD_BITS:
            raise KernelUnavailable("a function is too large to be interpreted")
        start = len(words)
        read = [0] * self.arguments
        for x in graph.needed() if form.shared else ():
            if graph.nodes[x].op == "input":
                argument, word = graph.nodes[x].at
                read[argument] = max(read[argument], word + 1)
        shared = [2 + count if form.shared else 0 for count in read[: form.primal]]
        adjoints = [1] * (self.arguments - form.primal) + [int(form.backward)] * len(graph.results)
        words.extend((places, 1, 0, 0, *shared, *adjoints))
        ends = self._ends(graph)
        for piece in pieces:
            for x in piece.nodes:
                node = graph.nodes[x]
                operands = [self._operand(graph, y) for y in node.operands]
                targets = piece.targets.get(x, ())
                if x in piece.fused:
                    for r, word, _ in targets:
                        to = self._result(r, word)
                        words.extend((NUMBERS["fma"], to, *operands, to))
                    self._release(x, node.operands, ends)
                    continue
                self._release(x, node.operands, ends)
                self.where[x] = mine = self._take()
                words.extend((NUMBERS[node.op], mine, *operands))
                self._store(words, graph, x, targets)
                if ends.get(x, x) == x:
                    self.free.append(mine)
            for x in piece.copied():
                self._store(words, graph, x, piece.targets[x])
        if form.clears:
            zero = self._constant((0.0).hex())
            for a in range(form.primal, self.arguments):
                if graph.sizes[a]:
                    words.extend((NUMBERS["fill"], (PLACES + a) << WORD_BITS, zero, graph.sizes[a]))
        words.append(NUMBERS["end"])
        kept = self.kept + sum(read[: form.primal])
        if kept > MAX_REGISTERS:
            raise KernelUnavailable("a function keeps too many values to be interpreted")
        words[start + 1] = max(kept, 1)

    def _ends(self, graph: Graph) -> dict[int, int]:
        """Return for each value the last value that depends on it."""
        ends: dict[int, int] = {}
        for piece in self.cut.pieces:
            for x in piece.nodes:
                for y in graph.nodes[x].operands:
                    ends[y] = x
        return ends

    def _release(self, x: int, operands: Sequence[int], ends: dict[int, int]) -> None:
        for y in set(operands):
            if ends[y] == x and y in self.where:
                self.free.append(self.where.pop(y))

    def _take(self) -> int:
        if self.free:
            return self.free.pop()
        self.kept += 1
        return self.kept - 1

    def _operand(self, graph: Graph, x: int) -> int:
        node = graph.nodes[x]
        if node.op == "const":
            return self._constant(node.value)
        if node.op == "input":
            return (PLACES + node.at[0]) << WORD_BITS | node.at[1]
        return self.where[x]

    def _constant(self, value: str) -> int:
        return CONSTANTS << WORD_BITS | self.numbers.setdefault(value, len(self.numbers))

    def _result(self, r: int, word: int) -> int:
        return (PLACES + self.arguments + r) << WORD_BITS | word

    def _store(self, words: array[int], graph: Graph, x: int, targets: Sequence[tuple[int, int, int]]) -> None:
        node = graph.nodes[x]
        if self.form.adds and node.op == "const" and float.fromhex(node.value) == 0:
            return
        value = self._operand(graph, x)
        for r, first, count in targets:
            if count > 1 and not self.form.adds:
                words.extend((NUMBERS["fill"], self._result(r, first), value, count))
                continue
            for word in range(first, first + count):
                words.extend((NUMBERS["add_to" if self.form.adds else "copy"], self._result(r, word), value))
