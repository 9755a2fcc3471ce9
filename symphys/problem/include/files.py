"""The files that a problem includes: found, read, and checked for what they may hold."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar, get_origin

from pydantic import ValidationError

from symphys.problem.include.merge import IncludedFile, MergedFiles, merge
from symphys.problem.reading.faults import Faults, SourceLocation
from symphys.problem.reading.messages import report
from symphys.problem.reading.source import MAX_BYTES, parse_toml, read_source, refuse
from symphys.problem.reading.value_texts import shown
from symphys.problem.schema import Document, SchemaTable
from symphys.problem.schema.include import MOST_INCLUDES, IncludedTable, IncludeTable
from symphys.problems import parts
from symphys.suggest import hint, quote

LABELLED = ("cost", "target", "constraint", "scenario")
"""Tables whose names nothing refers to."""
OTHER_TEXTS = ("at", "during", "file", "interpolation", "height", "activation", "output", "weights")
"""Keys whose texts name nothing of the file."""

BEFORE = r"(?:(?<![\w.])|(?<=\bstart\.)|(?<=\bend\.))"
"""Before a mention of a name: nothing of a longer one, but ``end.`` in ``end.knee.angle``."""


def prefixed(data: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    """The tables of a file with ``prefix`` before every name and group, and wherever a text mentions one."""
    lists = {key: value for key, value in data.items() if isinstance(value, list)}
    names = sorted(own_names(lists), key=len, reverse=True)
    mention = (
        re.compile(rf"(?:(?<![\w.])|(?<=\bstart\.)|(?<=\bend\.))(?:{'|'.join(map(re.escape, names))})(?!\w)")
        if names
        else None
    )

    def renamed(value: Any) -> Any:
        if isinstance(value, str):
            return mention.sub(lambda match: prefix + match[0], value) if mention else value
        if isinstance(value, list):
            return [renamed(item) for item in value]
        if isinstance(value, dict):
            return {key: item if key in OTHER_TEXTS else renamed(item) for key, item in value.items()}
        return value

    found = dict(data)
    for key, entries in lists.items():
        found[key] = [renamed(entry) for entry in entries]
        for entry in found[key] if key in LABELLED else ():
            if isinstance(entry, dict) and isinstance(entry.get("name"), str):
                entry["name"] = f"{prefix}{entry['name']}"
    return found


def own_names(lists: Mapping[str, list[Any]]) -> set[str]:
    """Return the names of the file's bodies, joints, variables and groups."""
    tables = [
        entry for key, entries in lists.items() if key not in LABELLED for entry in entries if isinstance(entry, dict)
    ]
    given = [table.get(key) for table in tables for key in ("name", "group")]
    return {name for name in given if isinstance(name, str) and name}


RECORDED = ("recording", "recorded", "identify")
OF_THE_PROBLEM = ("simulation", "phase", "termination", "fall", "objective", "solver", "solvers", "sweep", *RECORDED)
FURTHER = ("include", "included")
OWN = ("title", "description")
"""What an included file says about itself alone."""
MODELS = (".xml", ".mjcf", ".urdf")
"""Ends of the names of other programs' models."""
PACKAGE = "package://"
"""Before the path of a file in an installed package."""
OF_MODELS = {"keyframe", "self_collision", "base"}
"""Keys about them."""
LISTS = [name for name, field in Document.model_fields.items() if get_origin(field.annotation) is list]
Model = TypeVar("Model", bound=SchemaTable)


def with_included(path: Path, text: str, data: dict[str, Any]) -> MergedFiles:
    """A problem file together with what it includes.

    Args:
        path: the problem file.
        text: what is in it.
        data: its tables.

    Raises:
        ProblemError: names the file in which something is wrong, table and key.
    """
    if not data.get("include"):
        return MergedFiles(data, text)
    faults = Faults(str(path), data)
    tables = read_tables(data, "include", IncludeTable, faults)
    kept = {table.file: table.text for table in read_tables(data, "included", IncludedTable, faults)}
    faults.stop_if_any()
    texts: dict[str, str] = {}
    sources = []
    for index, table in enumerate(tables):
        file, content = find(path, index, table, kept, faults)
        if texts.setdefault(table.file, content) != content:
            faults.stop(("include", index), f"includes {quote(table.file)} otherwise than before; import it to a file")
        sources.append(source(file, content, table, faults))
    check_twice(sources, faults)
    faults.stop_if_any()
    whole = text if kept else text + appendix(texts)
    if len(whole.encode()) > MAX_BYTES:
        raise refuse(path, f"with the files that it includes, it is larger than {MAX_BYTES // 1_000_000} MB")
    return merge([*sources, IncludedFile(str(path), data, data)], LISTS, whole, faults)


def read_tables(data: Mapping[str, Any], key: str, model: type[Model], faults: Faults) -> list[Model]:
    """The tables of a list that is needed before all others."""
    if key not in data:
        return []
    entries, found = data[key], []
    if not isinstance(entries, list) or not 0 < len(entries) <= MOST_INCLUDES:
        faults.add((key,), f"must be a list of 1 to {MOST_INCLUDES} tables, [[{key}]], not {shown(entries)}")
        return []
    for index, entry in enumerate(entries):
        try:
            found.append(model.model_validate(entry))
        except ValidationError as error:
            report(error, model, faults, (key, index))
    return found


def find(path: Path, index: int, table: IncludeTable, kept: Mapping[str, str], faults: Faults) -> tuple[str, str]:
    """The name and the text of a file: as kept in the problem, beside it, or shipped."""
    place = ("include", index, "file")
    if kept:
        if table.file not in kept:
            faults.stop(place, f"{quote(table.file)} is not among the files kept in [[included]]: {hint('', kept)}")
        return table.file, kept[table.file]
    file = in_package(index, table, faults) if table.file.startswith(PACKAGE) else path.parent / table.file
    if not exists(file):
        shipped = parts()
        if table.file not in shipped:
            text = f"there is no file {quote(table.file)}, and no shipped robot of that path"
            faults.stop(place, f"{text}; {hint(table.file, shipped)}")
        file = shipped[table.file]
    if exists(path) and file.samefile(path):
        faults.stop(place, "the file includes itself")
    if file.suffix.lower() in MODELS:
        return str(file), text_of_model(file, index, table, faults)
    for key in sorted(OF_MODELS & table.model_fields_set):
        faults.add((*place[:2], key), f"is for models of other programs, {', '.join(MODELS)}, and this file is none")
    return str(file), read_source(file)


def in_package(index: int, table: IncludeTable, faults: Faults) -> Path:
    """A file of an installed package."""
    from symphys.importing.packages import model_file
    from symphys.importing.records import ImportProblem

    try:
        return model_file(table.file)
    except ImportProblem as error:
        faults.stop(("include", index, "file"), str(error))


def text_of_model(file: Path, index: int, table: IncludeTable, faults: Faults) -> str:
    """The tables of another program's model of a robot, as text."""
    from symphys.importing.records import ImportOptions, ImportProblem
    from symphys.importing.robot import read_robot
    from symphys.importing.writing import robot_text

    try:
        return robot_text(read_robot(file, ImportOptions(table.keyframe, table.self_collision, table.base)))
    except ImportProblem as error:
        faults.stop(("include", index, "file"), str(error))


def exists(file: Path) -> bool:
    """Whether there is something of that name, which may be none."""
    try:
        return file.exists()
    except OSError:
        return False


def source(file: str, text: str, table: IncludeTable, faults: Faults) -> IncludedFile:
    """The tables of an included file; notes those that it may not have."""
    written = parse_toml(Path(file), text)
    found = dict[str, Any]()
    for key, value in written.items():
        reason = key_fault(key, value, faults.file)
        if reason:
            faults.add_at(SourceLocation(file, written, (key,)), reason)
        elif key not in OWN:
            found[key] = value
    return IncludedFile(file, written, prefixed(found, table.prefix) if table.prefix else found, table)


def key_fault(key: str, value: object, problem: str) -> str:
    """Return the fault of a table or key at the top of an included file; empty without one."""
    if key in OF_THE_PROBLEM:
        return f"belongs to a whole problem; move it to {problem}, which includes this file"
    if key in FURTHER:
        return f"an included file includes no others; include them from {problem} too"
    if key not in Document.model_fields:
        valid = [name for name in Document.model_fields if name not in (*OF_THE_PROBLEM, *FURTHER)]
        return f"unknown key; {hint(key, valid)}"
    if key in LISTS:
        return "" if isinstance(value, list) else f"must be a list, not {shown(value)}; write [[{key}]]"
    if key in OWN and not isinstance(value, str):
        return f"must be text, not {shown(value)}"
    if key not in OWN and not isinstance(value, dict):
        return f"must be a table, not {shown(value)}"
    return ""


def check_twice(sources: list[IncludedFile], faults: Faults) -> None:
    """A file that is included twice needs different prefixes."""
    seen: dict[tuple[str, str], int] = {}
    for index, one in enumerate(sources):
        assert one.table is not None
        before = seen.setdefault((os.path.realpath(one.file), one.table.prefix), index)
        if before != index:
            text = f"include[{before}] includes this file with the same names; give one of them another prefix"
            faults.add(("include", index, "file"), text)


def appendix(texts: Mapping[str, str]) -> str:
    """Return [[included]] tables with the texts of included files, so that the problem's text is whole."""
    return "".join(f"\n[[included]]\nfile = {basic(file)}\ntext = {lines(text)}\n" for file, text in texts.items())


def basic(text: str) -> str:
    """A TOML string on one line."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def lines(text: str) -> str:
    """A TOML string of several lines, which the parser has let pass before: it has no control characters."""
    escaped = re.sub(r'"(?="")|"\Z', r"\"", text.replace("\\", "\\\\"))
    return f'"""\n{escaped}"""'
