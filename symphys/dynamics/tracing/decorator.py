"""``traced`` functions: within ``with tracing(tracer):`` the tracer calls them once, as functions of symbols.

Physics calls a traced function like any other. While a step is traced, equal calls (the same function, arguments of
the same structure) share one casadi function, and what lies between two calls is a ``TracedMatrix``. Without a tracer,
and within a function that is being traced, a call is a plain Python call on casadi expressions. A traced function must
depend on its arguments alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from typing import Any, ParamSpec, Protocol, TypeVar

import casadi as ca

P = ParamSpec("P")
T = TypeVar("T")
C = TypeVar("C")


class Tracing(Protocol):
    """A tracer of the calls of a step."""

    def guard(self, word: Any) -> None:
        """Allow calls that depend on ``word`` to be left out where it is 0."""
        ...

    def call(self, function: Callable[..., T], arguments: tuple[Any, ...], named: dict[str, Any]) -> T:
        """Call ``function(*arguments, **named)``."""
        ...

    def share(self, function: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[Any, ...]:
        """Return the arguments of a ``shared`` function, placed so that few functions are needed."""
        ...

    def section(self, word: Any) -> None:
        """Allow all calls that depend on ``word`` to be jumped over together."""
        ...

    def contiguous(self, tree: T, constants: bool = False) -> T:
        """Store a tree contiguously."""
        ...

    def repeat(self, count: int, once: Callable[[Any, T], T], context: Any, state: T) -> T:
        """Repeat ``state = once(context, state)`` ``count`` times."""
        ...


_TRACER: ContextVar[Tracing | None] = ContextVar("tracer", default=None)


@contextmanager
def tracing(tracer: Tracing | None) -> Iterator[None]:
    """Call traced functions through ``tracer`` in the block; None: plainly."""
    token = _TRACER.set(tracer)
    try:
        yield
    finally:
        _TRACER.reset(token)


def traced(function: Callable[P, T]) -> Callable[P, T]:
    """Return the function (or method of a dataclass), called through the current tracer."""

    @wraps(function)
    def call(*arguments: P.args, **named: P.kwargs) -> T:
        tracer = _TRACER.get()
        return function(*arguments, **named) if tracer is None else tracer.call(function, arguments, named)

    return call


def shared(function: Callable[P, T]) -> Callable[P, T]:
    """Return a traced function that is long and called with arguments that lie in many ways.

    Where copies of the arguments let calls share one function, a recorder copies them.
    """

    @wraps(function)
    def call(*arguments: P.args, **named: P.kwargs) -> T:
        tracer = _TRACER.get()
        if tracer is None:
            return function(*arguments, **named)
        return tracer.call(function, tracer.share(function, arguments), named)

    return call


def guard(word: T) -> T:
    """Mark a predicate, 0 or 1: a kernel skips calls that have no effect where it is 0.

    All that it depends on comes before what is left out.
    """
    tracer = _TRACER.get()
    if tracer is not None:
        tracer.guard(word)
    return word


def section(word: T) -> T:
    """Mark a predicate, 0 or 1: a kernel jumps over a section that has no effect where it is 0."""
    tracer = _TRACER.get()
    if tracer is not None:
        tracer.section(word)
    return word


def contiguous(tree: T, constants: bool = False) -> T:
    """Return the tree, stored contiguously between calls so that it can substitute results of a call.

    ``constants``: these become numbers of calls too, so that calls which differ in them share a function.
    """
    tracer = _TRACER.get()
    return tree if tracer is None else tracer.contiguous(tree, constants)


def as_arguments(values: Any) -> Any:
    """Return numbers, and tuples and dicts of them, as arguments: calls that differ in them share a function.

    Zeros and ones stay constants, which cost nothing.
    """
    return values if _TRACER.get() is None else contiguous(_symbolic(values), constants=True)


def _symbolic(values: Any) -> Any:
    if isinstance(values, Mapping):
        return {name: _symbolic(value) for name, value in values.items()}
    if isinstance(values, tuple):
        return tuple(map(_symbolic, values))
    return ca.SX(values) if isinstance(values, int | float) and values not in (0, 1) else values


def repeat(count: int, once: Callable[[C, T], T], context: C, state: T) -> T:
    """Repeat ``state = once(context, state)`` ``count`` times; a tracer copies calls that repeat."""
    tracer = _TRACER.get()
    if tracer is not None:
        return tracer.repeat(count, once, context, state)
    for _ in range(count):
        state = once(context, state)
    return state
