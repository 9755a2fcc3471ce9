"""Pydantic's findings in the words of this project; how values of a file are shown, and what typed ones mean."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError

from symphys import files
from symphys.problem.reading.faults import Faults, Place
from symphys.suggest import hint, quote

Finding = Mapping[str, Any]
REMOVED: dict[tuple[str, str], str] = {
    ("joint", "centre"): "leave it out: angles of joints count whole turns; where a formula needs one between -pi and "
    "pi, wrap_to_pi(knee.angle) gives it",
}
"""Keys that there were, by table and name, and what is there instead."""


def shown(value: object) -> str:
    """A value as its author would recognise it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f"the text {quote(value)}"
    if isinstance(value, int | float):
        return repr(value) if isinstance(value, float) or abs(value) < 10**18 else "a number that large"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    return "a table" if isinstance(value, Mapping) else f"a {type(value).__name__}"


def listed(words: Sequence[str], last: str) -> str:
    """``a, b or c``; ``last`` is the word before the last one."""
    return f"{', '.join(words[:-1])} {last} {words[-1]}"


def wanted(given: Sequence[str]) -> str:
    """Return the beginning of the message for a table that gives none or several of keys that exclude each other."""
    return f"has {' and '.join(given)}; give only" if given else "give"


def read_value(text: str) -> object:
    """A TOML value that JSON has too, else the text itself."""
    try:
        table = tomllib.loads(f"value = {text}")
        files.strict(table)
    except (ValueError, TypeError, RecursionError):
        return text
    return table["value"] if table.keys() == {"value"} else text


def size(value: object) -> str:
    """``has 2`` or ``has none``."""
    count = len(value) if isinstance(value, list | str | dict) else 0
    return f"has {count}" if count else "has none"


MESSAGES: dict[str, Callable[[Finding], str]] = {
    "missing": lambda e: "this key is required",
    "float_type": lambda e: f"must be a number, not {shown(e['input'])}",
    "int_type": lambda e: f"must be a whole number, not {shown(e['input'])}",
    "int_from_float": lambda e: f"must be a whole number, not {shown(e['input'])}",
    "bool_type": lambda e: f"must be true or false, not {shown(e['input'])}",
    "string_type": lambda e: f"must be text, not {shown(e['input'])}",
    "list_type": lambda e: f"must be a list, not {shown(e['input'])}",
    "tuple_type": lambda e: f"must be a list, not {shown(e['input'])}",
    "dict_type": lambda e: f"must be a table, not {shown(e['input'])}",
    "model_type": lambda e: f"must be a table, not {shown(e['input'])}",
    "model_attributes_type": lambda e: f"must be a table, not {shown(e['input'])}",
    "finite_number": lambda e: f"must be a finite number, not {shown(e['input'])}",
    "greater_than": lambda e: f"must be greater than {e['ctx']['gt']:g}, not {shown(e['input'])}",
    "greater_than_equal": lambda e: f"must be at least {e['ctx']['ge']:g}, not {shown(e['input'])}",
    "less_than": lambda e: f"must be less than {e['ctx']['lt']:g}, not {shown(e['input'])}",
    "less_than_equal": lambda e: f"must be at most {e['ctx']['le']:g}, not {shown(e['input'])}",
    "literal_error": lambda e: f"must be {e['ctx']['expected']}, not {shown(e['input'])}",
    "enum": lambda e: f"must be {e['ctx']['expected']}, not {shown(e['input'])}",
    "too_short": lambda e: f"must have {e['ctx']['min_length']} or more entries, {size(e['input'])}",
    "too_long": lambda e: f"must have at most {e['ctx']['max_length']} entries, {size(e['input'])}",
}


def report(error: ValidationError, model: type[BaseModel], faults: Faults, prefix: Place = ()) -> None:
    """Note every finding of a validation, at its place below ``prefix``."""
    merged: dict[tuple[str | int, ...], list[str]] = {}
    for finding in error.errors(include_url=False):
        place = tuple(key for key in finding["loc"] if not (isinstance(key, str) and key.startswith("<")))
        merged.setdefault(place, []).append(message(finding, model))
    for place, messages in merged.items():
        faults.add((*prefix, *place), ", or ".join(dict.fromkeys(messages)))


def message(finding: Finding, model: type[BaseModel]) -> str:
    """Say what is wrong and what would be valid."""
    kind = finding["type"]
    if kind == "extra_forbidden":
        key = str(finding["loc"][-1])
        if removed := REMOVED.get((str(finding["loc"][0]), key)):
            return removed
        return f"unknown key; {hint(key, keys_at(model, finding['loc'][:-1]))}"
    return MESSAGES[kind](finding) if kind in MESSAGES else str(finding["msg"])


def keys_at(model: type[BaseModel], place: Place) -> list[str]:
    """The keys of the table at a place."""
    table = inner_model(type_at(model, place))
    return [field.alias or name for name, field in table.model_fields.items()] if table else []


def type_at(model: type[BaseModel], place: Place) -> Any:
    """The annotation at a place of a model."""
    annotation: Any = model
    for key in place:
        if get_origin(annotation) is dict:
            annotation = get_args(annotation)[1]
            continue
        table = inner_model(annotation)
        if table and isinstance(key, str) and not key.startswith("<"):
            field = table.model_fields.get(key)
            annotation = field.annotation if field else None
    return annotation


def inner_model(annotation: Any) -> type[BaseModel] | None:
    """The first model inside an annotation, such as that of a list's items or of a union."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    if get_origin(annotation) in (list, Union, UnionType, Annotated):
        found = (inner_model(branch) for branch in get_args(annotation))
        return next((model for model in found if model), None)
    return None
