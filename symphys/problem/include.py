"""Included files: found, read, checked, renamed by their prefix, merged with the problem, and put in their places."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import field
from math import hypot
from pathlib import Path
from typing import Any, TypeVar, get_origin

import numpy as np
from pydantic import ValidationError

from symphys.model.joints import JOINTS
from symphys.model.joints.frames import WORLD
from symphys.model.orientation import turned
from symphys.problem.reading.faults import Faults, Place, SourceLocation
from symphys.problem.reading.messages import report, shown
from symphys.problem.reading.source import MAX_BYTES, parse_toml, read_source, refuse, toml_string
from symphys.problem.schema import Document, SchemaTable
from symphys.problem.schema.include import MAX_INCLUDES, IncludedTable, IncludeTable
from symphys.problem.schema.joints import JointTable, SiteTable
from symphys.problem.schema.physics import BlockTable, BodyTable, PlaneTable, TerrainTable
from symphys.problem.tables.bodies import read_orientation
from symphys.problems import parts
from symphys.records import dataclass
from symphys.suggest import hint, quote

LABELLED = ("cost", "target", "constraint", "scenario")
"""Tables whose names nothing refers to."""
OTHER_TEXTS = ("at", "during", "file", "interpolation", "height", "activation", "output", "weights")
"""Keys whose texts name nothing of the file."""
RECORDED = ("recording", "recorded", "identify")
OF_THE_PROBLEM = ("simulation", "phase", "termination", "fall", "objective", "solver", "solvers", "sweep", *RECORDED)
INCLUDING_KEYS = ("include", "included")
DESCRIPTIVE_KEYS = ("title", "description")
"""What an included file says about itself alone."""
MODELS = (".xml", ".mjcf", ".urdf")
"""Ends of the names of other programs' models."""
PACKAGE = "package://"
"""Before the path of a file in an installed package."""
MODEL_KEYS = {"keyframe", "self_collision", "base"}
"""Keys about them."""
LISTS = [name for name, field in Document.model_fields.items() if get_origin(field.annotation) is list]
Model = TypeVar("Model", bound=SchemaTable)


@dataclass(frozen=True)
class IncludedFile:
    """A file.

    Attributes:
        file: its name.
        written: its tables as they stand there.
        data: those of them that are used, with prefixes.
        table: what includes it; None for the problem itself.
    """

    file: str
    written: Mapping[str, Any]
    data: Mapping[str, Any]
    table: IncludeTable | None = None


@dataclass
class MergedFiles:
    """A problem together with what it includes.

    Attributes:
        data: all tables.
        text: of the problem, with those of the included files.
        origins: where what was written; see ``faults.Origins``. Empty if nothing is included.
        moves: each include, with the places of its tables in the lists of ``data``.
    """

    data: dict[str, Any]
    text: str
    origins: dict[tuple[str | int, ...], SourceLocation] = field(default_factory=dict)
    moves: list[tuple[IncludeTable, dict[str, range]]] = field(default_factory=list)

    @property
    def shared(self) -> Collection[str]:
        """The lists that hold tables of included files."""
        return {key for _, ranges in self.moves for key in ranges}


def merge(sources: Sequence[IncludedFile], lists: Collection[str], text: str, faults: Faults) -> MergedFiles:
    """Merge the tables in the order of the files; note keys that two files give differently.

    Args:
        sources: the included files, whose tables are of the right kinds, then the problem.
        lists: the names of tables that are lists.
        text: of all.
        faults: gets what does not fit together.
    """
    merged = MergedFiles({}, text)
    for source in sources:
        ranges = dict[str, range]()
        for key, value in source.data.items():
            if key in lists and isinstance(value, list):
                ranges[key] = append(merged, source, key, value)
            elif isinstance(value, dict) and isinstance(merged.data.get(key, {}), dict):
                overlay(merged, source, key, value, faults)
            else:
                merged.data[key] = value
        if source.table is not None:
            merged.moves.append((source.table, ranges))
    faults.stop_if_any()
    return merged


def append(merged: MergedFiles, source: IncludedFile, key: str, entries: Sequence[Any]) -> range:
    """Put the tables of a list after those that are there; where they then are."""
    known = merged.data.setdefault(key, [])
    start = len(known)
    known.extend(entries)
    for index in range(len(entries)):
        merged.origins[key, start + index] = SourceLocation(source.file, source.written, (key, index))
    return range(start, len(known))


def overlay(merged: MergedFiles, source: IncludedFile, key: str, table: Mapping[str, Any], faults: Faults) -> None:
    """Add the keys of a table to those that are there."""
    known = merged.data.setdefault(key, {})
    for name, value in table.items():
        origin = SourceLocation(source.file, source.written, (key, name))
        if name not in known:
            known[name], merged.origins[key, name] = value, origin
        elif known[name] != value:
            other = merged.origins[key, name].file
            faults.add_at(origin, f"differs from what {other} gives; leave one of them out, or make them equal")


def prefixed(data: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    """The tables of a file with ``prefix`` before every name and group, and wherever a text mentions one."""
    lists = {key: value for key, value in data.items() if isinstance(value, list)}
    names = sorted(own_names(lists), key=len, reverse=True)
    # nothing of a longer name comes before a mention, but ``end.`` in ``end.knee.angle``
    before = r"(?:(?<![\w.])|(?<=\bstart\.)|(?<=\bend\.))"
    mention = re.compile(rf"{before}(?:{'|'.join(map(re.escape, names))})(?!\w)") if names else None

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
    if not isinstance(entries, list) or not 0 < len(entries) <= MAX_INCLUDES:
        faults.add((key,), f"must be a list of 1 to {MAX_INCLUDES} tables, [[{key}]], not {shown(entries)}")
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
    for key in sorted(MODEL_KEYS & table.model_fields_set):
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
        elif key not in DESCRIPTIVE_KEYS:
            found[key] = value
    return IncludedFile(file, written, prefixed(found, table.prefix) if table.prefix else found, table)


def key_fault(key: str, value: object, problem: str) -> str:
    """Return the fault of a table or key at the top of an included file; empty without one."""
    if key in OF_THE_PROBLEM:
        return f"belongs to a whole problem; move it to {problem}, which includes this file"
    if key in INCLUDING_KEYS:
        return f"an included file includes no others; include them from {problem} too"
    if key not in Document.model_fields:
        valid = [name for name in Document.model_fields if name not in (*OF_THE_PROBLEM, *INCLUDING_KEYS)]
        return f"unknown key; {hint(key, valid)}"
    if key in LISTS:
        return "" if isinstance(value, list) else f"must be a list, not {shown(value)}; write [[{key}]]"
    if key in DESCRIPTIVE_KEYS and not isinstance(value, str):
        return f"must be text, not {shown(value)}"
    if key not in DESCRIPTIVE_KEYS and not isinstance(value, dict):
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
    tables = (f"file = {toml_string(file)}\ntext = {lines(text)}\n" for file, text in texts.items())
    return "".join(f"\n[[included]]\n{table}" for table in tables)


def lines(text: str) -> str:
    """A TOML string of several lines, which the parser has let pass before: it has no control characters."""
    escaped = re.sub(r'"(?="")|"\Z', r"\"", text.replace("\\", "\\\\"))
    return f'"""\n{escaped}"""'


def placed(document: Document, merged: MergedFiles, faults: Faults) -> Document:
    """The document with the tables of included files where these were put.

    Bodies, joints, planes and blocks move. The ground stays, and so does what variables set and formulas say. Terrain
    cannot move; a fault says so.
    """
    changed = {key: list(getattr(document, key)) for key in MOVES}
    for include, ranges in merged.moves:
        shift = Placement(include, faults)
        if not shift.moves:
            continue
        for key, move in MOVES.items():
            for index in ranges.get(key, ()):
                changed[key][index] = move(shift, (key, index), changed[key][index])
    return document.model_copy(update=changed)


@dataclass(frozen=True)
class Placement:
    """A turn about the z axis of the world, then a shift."""

    include: IncludeTable
    faults: Faults

    @property
    def moves(self) -> bool:
        """Whether anything changes."""
        return any(self.include.position) or self.include.yaw_deg != 0

    def direction(self, vector: Sequence[float]) -> list[float]:
        """(3,) turned."""
        angle = np.deg2rad(self.include.yaw_deg)
        cos, sin = float(np.cos(angle)), float(np.sin(angle))
        x, y, z = vector
        return [cos * x - sin * y, sin * x + cos * y, z]

    def point(self, vector: Sequence[float]) -> list[float]:
        """(3,) turned and shifted."""
        return [a + b for a, b in zip(self.direction(vector), self.include.position, strict=True)]

    def orientation(self, place: Place, given: Any) -> Any:
        """Return the orientation of the file, turned."""
        if not self.include.yaw_deg:
            return given
        return turned(read_orientation((*place, "orientation"), given, self.faults), 2, self.include.yaw_deg).tolist()

    def body(self, place: Place, table: BodyTable) -> SchemaTable:
        """A body, with its velocities."""
        velocities = {key: self.direction(getattr(table, key)) for key in ("velocity", "angular_velocity")}
        return self.block(place, table.model_copy(update=velocities))

    def block(self, place: Place, table: BodyTable | BlockTable | SiteTable) -> SchemaTable:
        """Move what has a position and an orientation."""
        orientation = self.orientation(place, table.orientation)
        return table.model_copy(update={"position": self.point(table.position), "orientation": orientation})

    def plane(self, place: Place, table: PlaneTable) -> SchemaTable:
        """A static wall."""
        update: dict[str, Any] = {"normal": self.direction(table.normal)}
        if table.point is not None:
            update["point"] = self.point(table.point)
        if table.offset is not None:
            unit = np.array(update["normal"]) / (hypot(*table.normal) or 1.0)
            update["offset"] = table.offset + float(unit @ np.array(self.include.position))
        changed: SchemaTable = table.model_copy(update=update)
        return changed

    def joint(self, place: Place, table: JointTable) -> SchemaTable:
        """A joint: its point, axes, and an anchor on the world."""
        update: dict[str, Any] = {}
        if table.point is not None:
            update["point"] = self.point(table.point)
        if table.anchors is not None:
            sides = zip(table.between, table.anchors, strict=True)
            update["anchors"] = [self.point(anchor) if name == WORLD else anchor for name, anchor in sides]
        for word, spec in JOINTS.items():
            if (own := getattr(table, word)) is not None:
                moved: dict[str, Any] = {}
                for each in spec.own_fields():
                    given, value = getattr(own, each.name), each.metadata["value"]
                    if value == "direction":
                        moved[each.name] = self.direction(given)
                    elif value == "directions":
                        moved[each.name] = [self.direction(axis) for axis in given]
                update[word] = own.model_copy(update=moved)
        changed: SchemaTable = table.model_copy(update=update)
        return changed

    def site(self, place: Place, table: SiteTable) -> SchemaTable:
        """A site of the world; one of a body moves with that."""
        return self.block(place, table) if table.body == WORLD else table

    def terrain(self, place: Place, table: TerrainTable) -> SchemaTable:
        """Terrain stays."""
        text = "terrain cannot be moved; include this file without position and yaw_deg, or take the terrain out of it"
        self.faults.add(place, text)
        return table


MOVES: dict[str, Callable[[Placement, Place, Any], SchemaTable]] = {
    "body": Placement.body,
    "joint": Placement.joint,
    "site": Placement.site,
    "plane": Placement.plane,
    "block": Placement.block,
    "terrain": Placement.terrain,
}
