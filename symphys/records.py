"""Data classes that are quick to define.

The standard library writes and compiles six methods of each frozen data class: half a millisecond of each of 480
classes, a quarter of the time that a command needs before its first iteration. Here a class gets its ``__init__`` from
there and shares all other methods.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from operator import attrgetter
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:

    def dataclass(cls=None, /, *, frozen=False, eq=True, repr=True, kw_only=False):
        """Make a data class; see ``dataclasses.dataclass``. A frozen one has each attribute set once."""
        if cls is None:
            return lambda cls: dataclass(cls, frozen=frozen, eq=eq, repr=repr, kw_only=kw_only)
        inherits = frozen and any(dataclasses.is_dataclass(base) for base in cls.__mro__[1:])
        made = dataclasses.dataclass(repr=False, eq=False, frozen=inherits, kw_only=kw_only)(cls)
        made.__dataclass_params__.frozen = frozen  # so that those of the standard library may inherit
        shared = {"__repr__": _repr} if repr else {}
        if eq:
            compared = [each.name for each in dataclasses.fields(made) if each.compare]
            made._compared = _getter(compared)
            shared |= {"__eq__": _eq, "__hash__": _hash if frozen else None}
        if frozen and not inherits:
            shared |= {"__setattr__": _set_once, "__delattr__": _delete}
        for name, method in shared.items():
            if name not in vars(cls):
                setattr(made, name, method)
        return made


def _getter(names: list[str]) -> Callable[[Any], Any]:
    """Return a function from an object to the values of these attributes as a tuple."""
    if len(names) > 1:
        return attrgetter(*names)
    return staticmethod(lambda self: tuple(getattr(self, name) for name in names))


def _eq(self: Any, other: Any) -> Any:
    return self._compared(self) == self._compared(other) if other.__class__ is self.__class__ else NotImplemented


def _hash(self: Any) -> int:
    return hash(self._compared(self))


@recursive_repr()
def _repr(self: Any) -> str:
    shown = (f"{each.name}={getattr(self, each.name)!r}" for each in dataclasses.fields(self) if each.repr)
    return f"{type(self).__qualname__}({', '.join(shown)})"


def _set_once(self: Any, name: str, value: object) -> None:
    if name in self.__dict__:
        raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
    self.__dict__[name] = value


def _delete(self: Any, name: str) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")
