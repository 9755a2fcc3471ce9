"""Checks of a model's text before MuJoCo reads it: well-formed XML of limited size that names no file outside.

MuJoCo's own parser trusts its input. A pass by a streaming parser refuses what would make it read other files, run out
of memory, or compute without end. It reads no entities and makes no tree.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import Any, Literal
from xml.parsers import expat

from symphys.files import check_regular
from symphys.importing.reading.folders import Folders, exists
from symphys.importing.records import ImportProblem
from symphys.records import dataclass
from symphys.suggest import quote

MAX_BYTES = 50_000_000
"""Largest size of a file [bytes]."""
MAX_DEPTH = 200
"""Largest depth of nested elements."""
MAX_ELEMENTS = 500_000
"""Largest number of elements of a model."""
MAX_FILES = 200
"""Files of one model that include each other."""
MAX_COUNT = 1_000_000
"""Largest count that one attribute may ask for: rows times columns, copies, places for data."""
MAX_COPIES = 20_000
"""Largest product of the copies that replicates and composites make."""
TEXTS_WORDS = (
    "name class childclass file material mesh hfield texture joint joint1 joint2 jointinparent body body1 "
    "body2 geom geom1 geom2 site site1 site2 tendon tendon1 tendon2 actuator target objname refname plugin "
    "instance model key value data prefix content_type cranksite slidersite refsite sidesite sensor "
    "reference xmlns version link filename dclass"
)
TEXTS = frozenset(TEXTS_WORDS.split())
"""Attributes whose values are names or texts, though they may look like numbers."""
UNBOUNDED = {("limit", "effort"), ("limit", "velocity")}
"""Numbers of URDF that may be infinite: no limit."""
COPIES = ("replicate", "composite", "flexcomp")
COUNTED = {"hfield": ("nrow", "ncol"), "numeric": ("size",), "mesh": ("maxhullvert",)}
IMAGES = ("texture", "skin", "material")
"""Elements that are not read, so that their files do not matter."""
EXAMPLE = "a model is MJCF, <mujoco> ... </mujoco>, or URDF, <robot> ... </robot>"


@dataclass
class XmlText:
    """A checked model file.

    Attributes:
        kind: its format.
        text: of the file itself, as UTF-8.
        included: further files that it is made of.
        left: how often elements stand in it that nothing here reads, by name.
    """

    kind: Literal["mjcf", "urdf"]
    text: bytes
    included: list[Path] = field(default_factory=list)
    left: dict[str, int] = field(default_factory=dict)


def check_model(folders: Folders) -> XmlText:
    """Read and check the file of a model, and those that it includes.

    Raises:
        ImportProblem: names the file, the line, and what is wrong with it.
    """
    text = read_bytes(folders.file, folders.file)
    checker = Checker(folders)
    checker.read(folders.file, text)
    kinds: Mapping[str, Literal["mjcf", "urdf"]] = {"mujoco": "mjcf", "robot": "urdf"}
    if checker.root not in kinds:
        raise ImportProblem(str(folders.file), f"its outermost element is <{checker.root[:60]}>; {EXAMPLE}")
    kind = kinds[checker.root]
    if kind == "mjcf":
        checker.follow()
    return XmlText(kind, text, checker.files[1:], checker.left)


def read_bytes(file: Path, model: Path) -> bytes:
    """Return the content of a file; ImportProblem unless it is UTF-8 text of at most ``MAX_BYTES``."""
    try:
        if file.is_dir():
            raise ImportProblem(str(model), f"{named(file, model)} is a folder; name a model file in it")
        if not file.exists():
            raise ImportProblem(str(model), "there is no such file" if file == model else f"there is no file {file}")
        check_regular(file)
        with file.open("rb") as stream:
            content = stream.read(MAX_BYTES + 1)
    except OSError as error:
        raise ImportProblem(str(model), f"{named(file, model)} cannot be read: {error.strerror or error}") from None
    except ValueError:
        raise ImportProblem(str(model), "this is no valid path") from None
    if len(content) > MAX_BYTES:
        raise ImportProblem(str(model), f"{named(file, model)} is larger than {MAX_BYTES // 1_000_000} MB")
    content = content.removeprefix(b"\xef\xbb\xbf")
    if not content.strip():
        raise ImportProblem(str(model), f"{named(file, model)} is empty; {EXAMPLE}")
    try:
        content.decode("utf-8")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise ImportProblem(str(model), f"{named(file, model)} is not UTF-8 text (line {line})") from None
    if b"\0" in content:
        raise ImportProblem(str(model), f"{named(file, model)} has a zero byte; {EXAMPLE}")
    return content


def named(file: Path, model: Path) -> str:
    """Return the name of a file for messages about a model."""
    return "the file" if file == model else str(file)


class Checker:
    """The check of the files of one model, element by element."""

    def __init__(self, folders: Folders) -> None:
        """Keep the folders of the model and the files it may read."""
        self.folders = folders
        self.root = ""
        self.files: list[Path] = []
        self.references: list[tuple[str, str, int, Path]] = []
        self.asset_folders = {""}
        self.left: dict[str, int] = {}
        self.elements = 0
        self.file = folders.file
        self.stack: list[float] = []
        self.parser: Any = None

    def read(self, file: Path, text: bytes) -> None:
        """Check one file."""
        self.file, self.stack = file, []
        self.files.append(file)
        parser = self.parser = expat.ParserCreate("UTF-8")
        parser.StartElementHandler, parser.EndElementHandler = self.start, self.end
        parser.StartDoctypeDeclHandler = self.doctype
        try:
            parser.Parse(text, True)
        except expat.ExpatError as error:
            reason = expat.errors.messages.get(error.code, str(error))
            raise self.problem(f"this is not well-formed XML: {reason}", error.lineno) from None
        finally:
            parser.StartElementHandler = parser.EndElementHandler = parser.StartDoctypeDeclHandler = None

    def problem(self, message: str, line: int | None = None) -> ImportProblem:
        """Return the error at the present line."""
        at = self.parser.CurrentLineNumber if line is None else line
        inside = "" if self.file == self.folders.file else f"{self.file}, "
        return ImportProblem(str(self.folders.file), message, f"{inside}line {at}")

    def doctype(self, *_: Any) -> None:
        """Refuse entities, which could name files or grow without end."""
        raise self.problem("a model has no DOCTYPE and no entities; take it out")

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Check the start of an element."""
        self.elements += 1
        if not self.root:
            self.root = tag
        if len(self.stack) >= MAX_DEPTH:
            raise self.problem(f"elements are nested deeper than {MAX_DEPTH}")
        if self.elements > MAX_ELEMENTS:
            raise self.problem(f"the model has more than {MAX_ELEMENTS} elements")
        for name, value in attributes.items():
            self.check_numbers(tag, name, value)
        self.left[tag] = self.left.get(tag, 0) + 1
        copies = self.copies(tag, attributes) * (self.stack[-1] if self.stack else 1.0)
        if copies > MAX_COPIES:
            raise self.problem(f"<{tag}> makes {copies:.3g} copies; at most {MAX_COPIES} are made")
        self.stack.append(copies)
        self.check_counts(tag, attributes)
        if self.root == "mujoco":
            self.note_files(tag, attributes)

    def end(self, _: str) -> None:
        """Leave an element."""
        self.stack.pop()

    def check_numbers(self, tag: str, name: str, value: str) -> None:
        """Refuse numbers that are not finite."""
        if name in TEXTS or (tag, name) in UNBOUNDED or not value:
            return
        found = [number(word) for word in value.split()]
        if None not in found and not all(math.isfinite(each) for each in found if each is not None):
            raise self.problem(f'<{tag}> {name} = {quote(value)}: a finite number is needed, such as "0.5"')

    def copies(self, tag: str, attributes: Mapping[str, str]) -> float:
        """Return how often an element is copied."""
        if tag not in COPIES:
            return 1.0
        product = 1.0
        for word in attributes.get("count", "1").split():
            product *= max(number(word) or 1.0, 1.0)
        return product

    def check_counts(self, tag: str, attributes: Mapping[str, str]) -> None:
        """Refuse attributes that ask for memory without bound."""
        names = list(attributes) if tag == "size" else COUNTED.get(tag, ())
        product = 1.0
        for name in names:
            value = abs(number(attributes.get(name, "")) or 0.0)
            product = value if tag == "size" else product * max(value, 1.0)
            if product > MAX_COUNT and name != "memory":
                raise self.problem(f"<{tag}> {name} = {quote(attributes[name])}: more than {MAX_COUNT} is refused")

    def note_files(self, tag: str, attributes: Mapping[str, str]) -> None:
        """Collect the files that an element of MJCF names, and folders of files."""
        if tag == "compiler":
            self.asset_folders |= {
                attributes[key] for key in ("meshdir", "assetdir", "texturedir") if key in attributes
            }
        if tag in IMAGES:
            return
        line = self.parser.CurrentLineNumber
        self.references += [
            (tag, value, line, self.file) for name, value in attributes.items() if name.startswith("file") and value
        ]

    def follow(self) -> None:
        """Check all files that are named, and read those that are part of the model."""
        done = 0
        while done < len(self.references):
            tag, value, line, file = self.references[done]
            done += 1
            folders = {""} if tag in ("include", "model") else self.asset_folders
            bases = {self.folders.own, file.parent}
            for path in sorted({base / folder / value for base in bases for folder in folders}):
                if exists(path):
                    where = "" if file == self.folders.file else f" of {file}"
                    self.folders.check(path, value, f"line {line}{where}: <{tag}>")
                    if tag in ("include", "model") and path.resolve() not in {each.resolve() for each in self.files}:
                        self.enter(path)

    def enter(self, path: Path) -> None:
        """Read a file that is part of the model."""
        if len(self.files) >= MAX_FILES:
            raise ImportProblem(str(self.folders.file), f"it includes more than {MAX_FILES} files")
        if path.suffix.lower() not in (".xml", ".mjcf", ".urdf", ""):
            raise ImportProblem(str(self.folders.file), f"it includes {path.name}, which is no XML file")
        self.read(path, read_bytes(path, self.folders.file))


def number(word: str) -> float | None:
    """Return a word as a number; None if it is not one."""
    try:
        return float(word)
    except ValueError:
        return None
