"""Tables of problem files from the classes that they describe: a key for each field whose metadata have a ``value``."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import MISSING, Field
from typing import Annotated, Any

import pydantic
from pydantic import create_model

from symphys.model.numbers import Number
from symphys.problem.schema.types import (
    Direction,
    Ends,
    Finite,
    Friction,
    Identifier,
    NonNegative,
    NonZero,
    Positive,
    SchemaTable,
    Share,
    Vector,
)

VALUES: dict[str, Any] = {
    "count": Annotated[int, pydantic.Field(ge=1, le=100)],
    "direction": Vector,
    "directions": Annotated[list[Vector], pydantic.Field(min_length=2, max_length=2)],
    "ends": Ends,
    "friction": Friction,
    "identifier": Identifier,
    "nonzero": NonZero,
    "nonzero direction": Direction,
    "positive": Positive,
}
"""Types of values, by the metadata ``value``; see ``symphys.model.numbers``."""


def value_of(each: Field[Any]) -> Any:
    """Return the type of the values of a key."""
    word = each.metadata["value"]
    if word:
        return VALUES[word]
    number: Number = each.metadata["number"]
    if number.least:
        return Finite
    return Share if number.most == 1 else NonNegative


def keys_of(described: Iterable[Field[Any]], optional: bool = False) -> dict[str, Any]:
    """Return the keys of a table, as ``create_model`` takes them.

    Args:
        described: fields of a class.
        optional: whether each may be left out, and is None then; else the class says what holds without it.
    """
    found: dict[str, Any] = {}
    for each in described:
        if "value" not in each.metadata:
            continue
        value, about = value_of(each), each.metadata["about"]
        if optional or each.default is None:
            found[each.name] = (value | None, pydantic.Field(default=None, description=about))
        elif each.default is MISSING:
            found[each.name] = (value, pydantic.Field(description=about))
        else:
            default = list(each.default) if isinstance(each.default, tuple) else each.default
            found[each.name] = (value, pydantic.Field(default=default, description=about))
    return found


def table_of(
    name: str,
    described: Iterable[Field[Any]],
    about: str = "",
    base: type[SchemaTable] = SchemaTable,
    optional: bool = False,
) -> type[SchemaTable]:
    """Make the table with the keys of a class after those of ``base``."""
    return create_model(name, __base__=base, __doc__=about, __module__=__name__, **keys_of(described, optional))
