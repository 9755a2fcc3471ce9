"""A function as a graph of operations, each distinct value once; masks apart from numbers.

Comparisons and logic give masks, integers of all ones or all zeros in each lane, which selects take as they are.
"""

from __future__ import annotations

from dataclasses import field
from itertools import compress
from math import frexp
from typing import NamedTuple

from symphys.codegen.graph.operations import MASKS
from symphys.records import dataclass

MAX_EXPONENT = 100
"""Exponents for which powers of two have reciprocals, in single precision too."""
COMMUTE = frozenset({"add", "mul", "eq", "ne", "and", "or", "hypot"})


def _reciprocal(x: float) -> float | None:
    """Return 1 / x of a power of two, whose product is the division to the last bit; None for other numbers."""
    return 1 / x if abs(frexp(x)[0]) == 0.5 and abs(frexp(x)[1]) < MAX_EXPONENT else None


def ordered(op: str, operands: tuple[int, ...]) -> tuple[int, ...]:
    """Return the operands as equal values have them, whichever way round they were written."""
    return operands[::-1] if op in COMMUTE and operands[0] > operands[1] else operands


class Node(NamedTuple):
    """One value: a tuple, since millions are made and looked up.

    Attributes:
        op: ``input``, ``const`` or a name in ``operations.FORMS``.
        operands: numbers of the nodes that it is made from.
        at: (argument, word) of an input.
        value: of a constant, exact, as text.
    """

    op: str
    operands: tuple[int, ...] = ()
    at: tuple[int, int] = (-1, -1)
    value: str = ""


def made(op: str, operands: tuple[int, ...], at: tuple[int, int] = (-1, -1), value: str = "") -> Node:
    """Return a node as ``Node`` makes it, in a third of the time."""
    return tuple.__new__(Node, (op, operands, at, value))


@dataclass
class Graph:
    """Nodes in an order in which they can be computed, and for each result the nodes of its words."""

    sizes: tuple[int, ...]
    nodes: list[Node] = field(default_factory=list)
    results: list[list[int]] = field(default_factory=list)
    numbers: dict[Node, int] = field(default_factory=dict)

    def put(self, node: Node) -> int:
        """Return the number of a node, a new one if there is none like it."""
        number, count = self.numbers.setdefault(node, len(self.nodes)), len(self.nodes)
        if number == count:
            self.nodes.append(node)
        return number

    def constant(self, value: float) -> int:
        """Return a constant."""
        return self.put(Node("const", value=float(value).hex()))

    def add(self, op: str, *operands: int) -> int:
        """Return a value, simplified where that is cheap; operands are cast to what the operation takes."""
        if op in ("and", "or", "not"):
            operands = tuple(self.mask(x) for x in operands)
        elif op == "iez":
            operands = (self.mask(operands[0]), self.number(operands[1]))
        elif op == "select":
            operands = (operands[0], self.number(operands[1]), self.number(operands[2]))
        else:
            operands = tuple(self.number(x) for x in operands)
        operands = ordered(op, operands)
        simpler = self._simpler(op, operands)
        return self.put(made(op, operands)) if simpler is None else simpler

    def mask(self, x: int) -> int:
        """Return the node as a mask: itself, what it was made from, or x != 0."""
        node = self.nodes[x]
        if node.op in MASKS:
            return x
        return node.operands[0] if node.op == "one" else self.put(Node("isnt0", (x,)))

    def number(self, x: int) -> int:
        """Return the node as a number: a mask becomes 0 or 1."""
        return self.put(Node("one", (x,))) if self.nodes[x].op in MASKS else x

    def _simpler(self, op: str, operands: tuple[int, ...]) -> int | None:
        nodes = [self.nodes[x] for x in operands]
        if op == "not" and nodes[0].op == "not":
            return nodes[0].operands[0]
        if op == "add" and nodes[0].op == nodes[1].op == "iez":
            return self._select(*nodes)
        if op == "div" and nodes[1].op == "const" and (power := _reciprocal(float.fromhex(nodes[1].value))) is not None:
            return self.add("mul", operands[0], self.constant(power))
        if op == "div" and nodes[0].op == "one" and nodes[1].op == "add" and operands[0] in nodes[1].operands:
            return self._share(operands[0], nodes[1])
        return None

    def _select(self, a: Node, b: Node) -> int | None:
        """Simplify (c ? x : 0) + (not c ? y : 0) to one select."""
        if self.nodes[b.operands[0]] == Node("not", (a.operands[0],)):
            return self.add("select", a.operands[0], a.operands[1], b.operands[1])
        if self.nodes[a.operands[0]] == Node("not", (b.operands[0],)):
            return self.add("select", b.operands[0], b.operands[1], a.operands[1])
        return None

    def _share(self, p: int, total: Node) -> int | None:
        """Simplify p / (p + q) of truth values, as in derivatives of fmin and fmax, without the division."""
        q = total.operands[1] if total.operands[0] == p else total.operands[0]
        if self.nodes[q].op != "one":
            return None
        share = self.add("select", self.mask(q), self.constant(0.5), self.constant(1.0))
        other = self.add("select", self.mask(q), self.constant(0.0), self.constant(float("nan")))
        return self.add("select", self.mask(p), share, other)

    def needed(self) -> list[int]:
        """Return the nodes that results are made from, in order."""
        wanted, nodes = bytearray(len(self.nodes)), self.nodes
        for result in self.results:
            for x in result:
                wanted[x] = 1
        for x in range(len(nodes) - 1, -1, -1):
            if wanted[x]:
                for y in nodes[x][1]:
                    wanted[y] = 1
        return list(compress(range(len(nodes)), wanted))

    def origins(self) -> list[int]:
        """Return for each node the arguments that it depends on, as bits."""
        bits: list[int] = []
        for node in self.nodes:
            own = 1 << node.at[0] if node.op == "input" else 0
            for x in node.operands:
                own |= bits[x]
            bits.append(own)
        return bits

    def key(self) -> tuple[object, ...]:
        """Equal for equal functions."""
        return (self.sizes, tuple(self.nodes), tuple(tuple(r) for r in self.results))
