"""Data of arrays, functions of casadi and records, as a text to be kept and back; nothing in the text is executed."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import casadi as ca
import numpy as np

PLAIN = (bool, int, float, str)


def text_of(data: object) -> str:
    """Return a text; TypeError for what has none.

    Args:
        data: None, numbers, texts, slices, arrays, functions of casadi, and lists, tuples, named tuples and data
            classes of these.
    """
    return json.dumps(_plain(data))


def data_of(text: str, kinds: Sequence[type]) -> Any:
    """Return the data of a text; ValueError for what ``text_of`` has not written, or of a class not in ``kinds``."""
    try:
        return _data(json.loads(text), {kind.__name__: kind for kind in kinds})
    except (KeyError, TypeError, RuntimeError) as error:
        raise ValueError(f"not the text of kept data: {error}") from error


def _plain(data: Any) -> Any:
    if data is None or isinstance(data, PLAIN):
        return data
    if isinstance(data, np.ndarray):
        return {"array": [data.dtype.str, data.shape, base64.b64encode(data.tobytes()).decode()]}
    if isinstance(data, ca.Function):
        return {"function": data.serialize()}
    if isinstance(data, slice):
        return {"slice": [data.start, data.stop, data.step]}
    if type(data) in (list, tuple):
        return {type(data).__name__: list(map(_plain, data))}
    if is_dataclass(data):
        return {"record": [type(data).__name__, *(_plain(getattr(data, field.name)) for field in fields(data))]}
    if isinstance(data, tuple):
        return {"record": [type(data).__name__, *map(_plain, data)]}
    raise TypeError(f"{type(data).__name__} cannot be kept")


def _data(plain: Any, kinds: Mapping[str, type]) -> Any:
    if plain is None or isinstance(plain, PLAIN):
        return plain
    ((kind, value),) = plain.items()
    if kind == "array":
        dtype, shape, text = value
        return np.frombuffer(base64.b64decode(text), np.dtype(dtype)).reshape(shape).copy()
    if kind == "function":
        return ca.Function.deserialize(value)
    if kind == "slice":
        return slice(*value)
    if kind == "record":
        name, *parts = value
        return kinds[name](*(_data(part, kinds) for part in parts))
    return {"list": list, "tuple": tuple}[kind](_data(part, kinds) for part in value)
