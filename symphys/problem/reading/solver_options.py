"""Solver options: raw [solver.NAME] tables checked against a solver's frozen dataclass, which the caller brings."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from inspect import cleandoc
from math import isnan
from typing import Any, TypeVar, get_type_hints

from pydantic import BaseModel, ConfigDict, ValidationError, create_model
from pydantic import Field as KeyInfo
from pydantic_core import to_json

from symphys.errors import Issue, ProblemError, SymphysError
from symphys.problem.reading.faults import Faults
from symphys.problem.reading.messages import report
from symphys.suggest import hint, quote

Options = TypeVar("Options")
MODELS: dict[type[Any], type[BaseModel]] = {}
"""Models of dataclasses: making one takes a millisecond, and a batch asks for one in each of its runs."""


def validate_options(cls: type[Options], table: Mapping[str, object], file: str, where: str) -> Options:
    """An instance of the dataclass ``cls`` with the values of a table; what the table leaves out keeps its default.

    Args:
        cls: a frozen dataclass; its annotations say what is valid.
        table: raw values, as TOML gives them.
        file: for messages.
        where: the table's place in the file, for instance ``solver.gradient``.

    Raises:
        ProblemError: names unknown keys with the nearest valid ones, and values of the wrong kind.
    """
    faults = Faults(file, {where: table})
    table = by_present_names(cls, table, where, faults)
    given = read_options(options_model(cls), table, where, faults)
    faults.stop_if_any()
    try:
        return cls(**given)
    except (ValueError, SymphysError) as error:
        raise ProblemError(file, [Issue(where, str(error))]) from None


def read_options(model: type[BaseModel], table: Mapping[str, object], where: str, faults: Faults) -> dict[str, Any]:
    """The values that the table gives, in the kinds of the model; empty after a fault."""
    for key, value in table.items():
        if any(isinstance(item, float) and isnan(item) for item in (value if isinstance(value, list) else [value])):
            faults.add((where, key), "must be a number, not nan")
    try:
        # as JSON, a list may become a tuple and a text an enum, and nothing else is converted
        given = model.model_validate_json(to_json(table, inf_nan_mode="constants"))
    except ValidationError as error:
        report(error, model, faults, (where,))
    except (ValueError, RecursionError) as error:
        faults.add((where,), f"cannot be used: {error}")
    else:
        return {key: getattr(given, key) for key in given.model_fields_set}
    return {}


def by_present_names(cls: type[Any], table: Mapping[str, object], where: str, faults: Faults) -> dict[str, object]:
    """The table with the present names of its options; a complaint where it has both names of one."""
    present = old_names(cls)
    for old, name in present.items():
        if old in table and name in table:
            faults.add((where, old), f"is the old name of {name}, which is given too; leave one of the two out")
    return {present.get(key, key): value for key, value in table.items()}


def old_names(cls: type[Any]) -> dict[str, str]:
    """Deprecated names of options, which are still read, to the present ones: metadata "was" of a field."""
    return {field.metadata["was"]: field.name for field in fields(cls) if "was" in field.metadata}


def require_solvers(tables: Iterable[str], asked: Iterable[str], known: Iterable[str], file: str) -> None:
    """ProblemError if a [solver.NAME] table, or a name that the file's ``solvers`` asks for, is that of no solver."""
    names = list(known)
    named = [(f"solver.{name}", name) for name in tables]
    named += [(f"solvers[{k}]", name) for k, name in enumerate(asked)]
    issues = [
        Issue(where, f"there is no solver {quote(name)}; {hint(name, names)}")
        for where, name in named
        if name not in names
    ]
    if issues:
        raise ProblemError(file, issues)


def options_model(cls: type[Any]) -> type[BaseModel]:
    """The pydantic model of a dataclass: the same keys, kinds and defaults, strict and without others."""
    if cls not in MODELS:
        MODELS[cls] = made_model(cls)
    return MODELS[cls]


def made_model(cls: type[Any]) -> type[BaseModel]:
    """The model of a dataclass, made anew."""
    kinds = get_type_hints(cls, include_extras=True)
    meanings = option_descriptions(cls)
    entries: dict[str, Any] = {
        field.name: (kinds[field.name], KeyInfo(default(field), description=meanings.get(field.name)))
        for field in fields(cls)
        if field.init
    }

    def add_old_names(schema: dict[str, Any]) -> None:
        for old, name in old_names(cls).items():
            schema["properties"][old] = {
                **schema["properties"][name],
                "description": f"old name of {name}",
                "deprecated": True,
            }

    config = ConfigDict(extra="forbid", strict=True, json_schema_extra=add_old_names)
    return create_model(cls.__name__, __config__=config, __doc__=documentation(cls), **entries)


def option_descriptions(cls: type[Any]) -> dict[str, str]:
    """Map options to their meaning, from ``Attributes:`` of the docstrings; those of the class itself count first."""
    found: dict[str, str] = {}
    for each in (each for each in cls.__mro__ if is_dataclass(each)):
        _, _, listed = cleandoc(each.__doc__ or "").partition("Attributes:\n")
        attributes, _, _ = listed.partition("\n\n")
        for entry in re.split(r"\n(?=    \w)", f"\n{attributes}")[1:]:
            name, _, meaning = entry.strip().partition(": ")
            found.setdefault(name, " ".join(meaning.split()))
    return found


def documentation(cls: type[Any]) -> str:
    """Yield the docstrings of a dataclass and of those from which it has options."""
    return "\n\n".join(cleandoc(each.__doc__ or "") for each in cls.__mro__ if is_dataclass(each))


def default(field: Field[Any]) -> Any:
    """The default of a dataclass field; ``...`` for none."""
    if field.default is not MISSING:
        return field.default
    return ... if field.default_factory is MISSING else field.default_factory()
