"""Functions as graphs of operations, each distinct value once; masks apart from numbers.

Comparisons and logic give masks, integers of all ones or all zeros in each lane, which selects take as they are. The
graphs of a robot have hundreds of thousands of nodes, so ``graphs.c`` makes and rewrites them; it is compiled once.
"""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Sequence
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.toolchain.libraries import own_library
from symphys.types import Array, Bools

POINTER, COUNT, INT = ctypes.c_void_p, ctypes.c_int64, ctypes.c_int32
SIGNATURES: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "operation_names": (ctypes.c_char_p, ()),
    "foreign_names": (ctypes.c_char_p, ()),
    "graph_free": (None, (POINTER,)),
    "graph_count": (COUNT, (POINTER,)),
    "graph_arguments": (INT, (POINTER,)),
    "graph_outputs": (INT, (POINTER,)),
    "graph_sizes": (None, (POINTER, POINTER)),
    "graph_nodes": (None, (POINTER, POINTER, POINTER, POINTER)),
    "graph_needed": (None, (POINTER, POINTER)),
    "graph_operations": (COUNT, (POINTER,)),
    "graph_reads": (None, (POINTER, POINTER)),
    "graph_key": (None, (POINTER, POINTER)),
    "graph_dependence": (None, (POINTER, INT, POINTER)),
    "graph_fused": (POINTER, (POINTER, INT)),
    "graph_early_sums": (POINTER, (POINTER, INT)),
    "graph_taped": (INT, (POINTER, POINTER, POINTER, POINTER)),
    "graph_write": (POINTER, (POINTER, POINTER, *[INT] * 3, POINTER, POINTER)),
    "text_free": (None, (POINTER,)),
    "function_new": (POINTER, (COUNT, *[POINTER] * 4, INT, INT, POINTER, INT, POINTER)),
    "function_free": (None, (POINTER,)),
    "function_graph": (POINTER, (POINTER,)),
    "function_adjoint": (POINTER, (POINTER, POINTER, POINTER)),
    "function_tabled": (POINTER, (POINTER, POINTER, POINTER)),
    "codes_new": (POINTER, ()),
    "codes_free": (None, (POINTER,)),
    "codes_add": (INT, (POINTER, POINTER, *[INT] * 5)),
    "codes_count": (COUNT, (POINTER,)),
    "codes_constants": (COUNT, (POINTER,)),
    "codes_read": (None, (POINTER, POINTER, POINTER)),
}
"""Result and arguments of the functions of ``graphs.c``."""
OWN = "graphs.c", True
"""The library, which is compiled quickly."""
Mask = tuple[bool, ...]


@cache
def library() -> Any:
    """Return the compiled ``graphs.c``; KernelUnavailable without a compiler."""
    found = own_library(*OWN)
    for name, (result, arguments) in SIGNATURES.items():
        function = getattr(found, name)
        function.restype, function.argtypes = result, arguments
    return found


@cache
def operations() -> tuple[str, ...]:
    """Return the names of all operations in the order of their numbers; the first two are ``input`` and ``const``."""
    return tuple(library().operation_names().decode().split())


class Handle:
    """An object of ``graphs.c``, which is freed together with this one."""

    def __init__(self, address: int, free: str) -> None:
        """Keep an address; ``free``: the name of the function that ends its life."""
        self.address = address
        weakref.finalize(self, getattr(library(), free), address)


class Node(NamedTuple):
    """One value, for who looks at a graph.

    Attributes:
        op: ``input``, ``const`` or another of ``operations``.
        operands: numbers of the nodes that it is made from.
        at: (argument, word) of an input.
        value: of a constant.
    """

    op: str
    operands: tuple[int, ...] = ()
    at: tuple[int, int] = (-1, -1)
    value: float = 0.0


class Graph(Handle):
    """Nodes in an order in which they can be computed, and for each result the nodes of its words.

    Attributes:
        sizes: of the arguments.
        result_sizes: of the results.
    """

    def __init__(self, address: int) -> None:
        """Take over a graph of ``graphs.c``."""
        super().__init__(address, "graph_free")
        c = library()
        arguments, outputs = c.graph_arguments(address), c.graph_outputs(address)
        sizes = (INT * max(arguments + outputs, 1))()
        c.graph_sizes(address, sizes)
        self.sizes = tuple(sizes[:arguments])
        self.result_sizes = tuple(sizes[arguments : arguments + outputs])

    def __len__(self) -> int:
        """Return the number of nodes."""
        return int(library().graph_count(self.address))

    @cached_property
    def operations(self) -> int:
        """The number of operations that results need."""
        return int(library().graph_operations(self.address))

    @cached_property
    def key(self) -> bytes:
        """128 bits that are equal for equal functions."""
        found = np.zeros(2, np.uint64)
        library().graph_key(self.address, found.ctypes.data)
        return found.tobytes()

    @cached_property
    def reads(self) -> frozenset[int]:
        """The arguments that results depend on."""
        found: Bools = np.zeros(len(self.sizes), bool)
        library().graph_reads(self.address, found.ctypes.data)
        return frozenset(np.flatnonzero(found).tolist())

    @cached_property
    def dependence(self) -> list[Bools]:
        """For each result the matrix (size, arguments) of dependencies."""
        flags = self._dependence(False, len(self.sizes))
        return np.split(flags, np.cumsum(self.result_sizes)[:-1]) if self.result_sizes else []

    def sparsity(self) -> Bools:
        """Return the matrix (words of all results, words of all arguments) of dependencies."""
        return self._dependence(True, sum(self.sizes))

    def _dependence(self, by_word: bool, columns: int) -> Bools:
        flags: Bools = np.zeros((sum(self.result_sizes), columns), bool)
        library().graph_dependence(self.address, by_word, flags.ctypes.data)
        return flags

    @property
    def nodes(self) -> list[Node]:
        """All nodes."""
        nodes, values, _ = self._arrays()
        names = operations()
        found = []
        for (op, *rest), value in zip(nodes.tolist(), values.tolist(), strict=True):
            given = names[op] == "input"
            operands = () if given else tuple(y for y in rest if y >= 0)
            found.append(Node(names[op], operands, (rest[0], rest[1]) if given else (-1, -1), value))
        return found

    @property
    def results(self) -> list[NDArray[np.int32]]:
        """For each result the numbers of the nodes of its words."""
        words = self._arrays()[2]
        return np.split(words, np.cumsum(self.result_sizes)[:-1]) if self.result_sizes else []

    def needed(self) -> list[int]:
        """Return the nodes that results are made from, in order."""
        flags: Bools = np.zeros(len(self), bool)
        library().graph_needed(self.address, flags.ctypes.data)
        return [int(x) for x in np.flatnonzero(flags)]

    def fused(self, adds: bool) -> Graph:
        """Return it with products that are only added or subtracted fused with their sums: fma, fms and fnma.

        Nodes keep their numbers. ``adds``: results are added to what is there, so that products among them are fused
        there.
        """
        return Graph(library().graph_fused(self.address, adds))

    def with_early_sums(self, primal: int) -> Graph:
        """Return it with sums of what depends on arguments from ``primal`` on in an order that waits for less."""
        return Graph(library().graph_early_sums(self.address, primal))

    def _arrays(self) -> tuple[NDArray[np.int32], Array, NDArray[np.int32]]:
        nodes, values = np.zeros((len(self), 4), np.int32), np.zeros(len(self))
        results = np.zeros(max(sum(self.result_sizes), 1), np.int32)
        library().graph_nodes(self.address, nodes.ctypes.data, values.ctypes.data, results.ctypes.data)
        return nodes, values, results[: sum(self.result_sizes)]


class Taped(NamedTuple):
    """A call's two functions, with values that the first stores and the second needs not compute again.

    Attributes:
        forward: has the tape as its last result.
        adjoint: has the tape as an argument between those of the call and the adjoints of its results.
        size: words of the tape.
    """

    forward: Graph
    adjoint: Graph
    size: int


def taped(forward: Graph, adjoint: Graph) -> Taped | None:
    """Put all that depends on the call's arguments only on a tape; None if there is nothing."""
    push, pull = POINTER(), POINTER()
    size = library().graph_taped(forward.address, adjoint.address, ctypes.byref(push), ctypes.byref(pull))
    return Taped(Graph(push.value or 0), Graph(pull.value or 0), size) if size else None


class Instructions(Handle):
    """The instructions of a function, from which its graph and those of its adjoints are made."""

    def graph(self) -> Graph:
        """Return the graph of the function itself."""
        return Graph(library().function_graph(self.address))

    def adjoint(self, inputs: Mask, outputs: Mask, tabled: bool = False) -> Graph:
        """Return a graph of the arguments, then the adjoints of the marked results; a result for each marked argument.

        ``tabled``: all slopes are computed, then multiplied with the adjoints: more to compute, but of it only the
        products depend on the adjoints.
        """
        make = library().function_tabled if tabled else library().function_adjoint
        return Graph(make(self.address, _flags(inputs), _flags(outputs)))


def _flags(marks: Sequence[bool]) -> Any:
    return (ctypes.c_uint8 * max(len(marks), 1))(*marks)
