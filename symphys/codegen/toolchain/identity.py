"""Checksums of the data that a program is built from, and of the package that builds it, for kept plans."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache, partial
from pathlib import Path
from types import BuiltinFunctionType, FunctionType
from typing import Any

import casadi as ca
import numpy as np

PACKAGE = Path(__file__).parents[2]
SOURCES = ("*.py", "*.c", "*.h")
PLAIN = (str, int, bool, type(None), bytes, complex, range, slice)
OWN = ("symphys", "casadi", "numpy", "operator", "_operator", "math", "builtins")
"""Packages whose functions are identified by name: their sources or versions are part of ``package_stamp``."""


def identity_of(*data: Any) -> str | None:
    """Return a checksum, equal for equal data in every process; None if some of it has none, as Python functions do."""
    found = hashlib.sha256()
    try:
        _add(found.update, data)
    except TypeError:
        return None
    return found.hexdigest()


@cache
def package_stamp() -> str:
    """Return the checksum of all sources of this package, and of the versions of Python, casadi and numpy."""
    found = hashlib.sha256(f"{sys.version} {ca.CasadiMeta.version()} {np.__version__}".encode())
    for path in sorted(path for pattern in SOURCES for path in PACKAGE.rglob(pattern)):
        found.update(f"\0{path.relative_to(PACKAGE)}\0".encode())
        found.update(path.read_bytes())
    return found.hexdigest()


def _add(update: Any, data: Any) -> None:
    """Add a tree of data to a checksum; TypeError for data without identity. Every piece has its kind and length."""
    kind = type(data)
    if kind is float:
        update(b"f" + data.hex().encode() + b";")
    elif kind in PLAIN:
        text = repr(data)
        update(f"{kind.__name__}{len(text)}:{text}".encode(errors="surrogatepass"))
    elif isinstance(data, Enum):
        update(f"enum {kind.__module__}.{kind.__qualname__}.{data.name};".encode())
    elif isinstance(data, np.ndarray | np.generic):
        array = np.asarray(data)
        if array.dtype.hasobject:
            raise TypeError("an array of objects")
        update(f"array {array.dtype.str}{array.shape};".encode() + array.tobytes())
    elif isinstance(data, Mapping):
        _all(update, f"map {len(data)};", [part for item in data.items() for part in item])
    elif isinstance(data, tuple | list):
        _all(update, f"{kind.__qualname__} {len(data)};", data)
    elif isinstance(data, frozenset | set):
        _all(update, f"set {len(data)};", sorted(data))
    elif isinstance(data, ca.DM | ca.SX | ca.Function):
        whole = data if isinstance(data, ca.Function) else ca.Function("f", [], [ca.SX(data)])
        _all(update, f"casadi {kind.__name__};", [whole.serialize()])
    elif isinstance(data, partial):
        _all(update, "partial;", [data.func, data.args, data.keywords])
    elif isinstance(data, FunctionType | BuiltinFunctionType | type):
        _add_code(update, data)
    elif isinstance(data, Path):
        _all(update, "path;", [str(data)])
    elif is_dataclass(kind):
        owned = [(field.name, getattr(data, field.name)) for field in fields(kind)]
        _all(update, f"{kind.__module__}.{kind.__qualname__} {len(owned)};", [part for item in owned for part in item])
    else:
        raise TypeError(f"{kind.__qualname__} has no identity")


def _add_code(update: Any, data: Any) -> None:
    """Add a function or a class of OWN: its name and, for a nested function, its captured values."""
    if (data.__module__ or "").partition(".")[0] not in OWN:
        raise TypeError(f"{data.__qualname__} of {data.__module__} has no identity")
    inner: list[Any] = []
    if isinstance(data, FunctionType):
        code = data.__code__
        cells = [cell.cell_contents for cell in data.__closure__ or ()]
        inner = [code.co_firstlineno, code.co_code, data.__defaults__, data.__kwdefaults__, *cells]
    _all(update, f"code {data.__module__}.{data.__qualname__} {len(inner)};", inner)


def _all(update: Any, head: str, parts: Any) -> None:
    update(head.encode())
    for part in parts:
        _add(update, part)
