"""Reading and writing files: what is written appears at once and whole, or not at all."""

from __future__ import annotations

import contextlib
import errno
import io
import json
import math
import os
import re
import stat
import zipfile
from collections.abc import Iterable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from symphys.errors import SymphysError

NON_FINITE = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}
SPECIAL = {
    stat.S_IFIFO: "a named pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}
"""Kinds of files that have no end, or are read only as fast as another process writes."""
LONE_SURROGATE = re.compile("[\ud800-\udfff]")
"""What stands in a text for bytes of a file name that are no UTF-8."""


SMALL = 1024
"""[bytes] Arrays that are no larger are not compressed: it takes longer than it spares."""
FSYNC = "SYMPHYS_FSYNC"
"""The variable of the environment that, set, makes each file wait for the disk: what is done survives a power cut."""


class FileError(SymphysError):
    """A file or folder that cannot be read or written; names it and says why."""


def printable(name: str) -> str:
    """The text with U+FFFD for what is no UTF-8 in the name of a file."""
    return LONE_SURROGATE.sub("\ufffd", name)


def make_folder(path: Path) -> None:
    """Make a folder and its parents; FileError if that cannot be."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"cannot make the folder {path}: {reason(error)}") from error


def write_bytes(path: Path, content: bytes, at_once: bool = True) -> None:
    """Write to a temporary name in the same folder, then replace; FileError if that cannot be.

    ``at_once`` False: write in its place, for what counts for nothing before another file is written at once. On a disk
    that takes half the time.
    """
    own = f".{path.name}.{os.getpid()}-{os.urandom(3).hex()}"  # two machines may have processes of one number
    written, whole = path.with_name(own) if at_once else path, False
    try:
        try:
            write_through(written, content)
        except (FileNotFoundError, NotADirectoryError):
            make_folder(path.parent)
            write_through(written, content)
        if at_once:
            rename(written, path)
        whole = True
    except OSError as error:
        raise FileError(f"cannot write {path}: {reason(error)}") from error
    finally:
        if not whole:
            with contextlib.suppress(OSError):
                written.unlink(missing_ok=True)


def write_through(path: Path, content: bytes) -> None:
    """Write a file, and wait until it is on the disk if ``SYMPHYS_FSYNC`` is set; OSError if that cannot be."""
    path.write_bytes(content)
    if os.environ.get(FSYNC):
        with path.open("rb+") as file:
            os.fsync(file.fileno())


def rename(written: Path, path: Path) -> None:
    """Put a file in the place of another; its name waits for the disk as contents do. OSError if that cannot be."""
    written.replace(path)
    if os.environ.get(FSYNC) and hasattr(os, "O_DIRECTORY"):
        folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def write_text(path: Path, text: str, at_once: bool = True) -> None:
    """Write UTF-8 text with the line ends as they are; parts of file names that are no UTF-8 are replaced."""
    write_bytes(path, printable(text).encode(), at_once)


def write_json(path: Path, value: object, at_once: bool = True) -> None:
    """Write strict JSON; see ``json_text``."""
    write_text(path, json_text(value), at_once)


def json_text(value: object) -> str:
    """Strict JSON; numbers that are not finite become the strings "nan", "inf" and "-inf".

    An object has a line for each of its keys: all lines of nested values would take ten times as long to write.
    """
    plain = strict(value)
    if not isinstance(plain, dict) or not plain:
        return printable(as_json(plain)) + "\n"
    lines = ",\n".join(f" {as_json(key)}: {as_json(item)}" for key, item in plain.items())
    return printable(f"{{\n{lines}\n}}\n")


def emptied(text: bytes, keys: Iterable[str]) -> bytes:
    """The text of a JSON object with ``{}`` for the objects at some of its keys, which are then quick to read past.

    It is for what ``write_json`` writes, and what it wrote when nested values had lines of their own: only a key of the
    outermost object follows the end of a line and one space. A text of another layout is left as it is.
    """
    for key in keys:
        begin = b'\n "%s": {' % key.encode()
        start = text.find(begin)
        ends = [end for end in (text.find(b'\n "', start + 1), text.find(b"\n}", start + 1)) if end >= 0]
        if start >= 0 and ends:
            comma = b"," if text[: min(ends)].endswith(b",") else b""
            text = text[:start] + begin + b"}" + comma + text[min(ends) :]
    return text


def as_json(value: object) -> str:
    """A value of JSON's own types as text, in one line."""
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def write_npz(path: Path, arrays: Mapping[str, Any], at_once: bool = True) -> None:
    """Write named arrays of numbers and texts, compressed; quickly, as they are most of what a run writes."""
    import numpy as np  # late: the command line's help needs none

    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, value in arrays.items():
            array = np.asarray(value, order="C")
            content = npy_header(array.dtype.str, array.shape) + array.tobytes()
            member = zipfile.ZipInfo(f"{name}.npy")  # without the time of day: equal arrays make equal files
            member.compress_type = zipfile.ZIP_DEFLATED if len(content) > SMALL else zipfile.ZIP_STORED
            archive.writestr(member, content, compresslevel=1)
    write_bytes(path, buffer.getvalue(), at_once)


@lru_cache(maxsize=4096)
def npy_header(kind: str, shape: tuple[int, ...]) -> bytes:
    """Return the .npy header of an array; cached, since making it takes longer than writing a small array."""
    from numpy.lib import format as npy

    if "O" in kind or "V" in kind:
        raise ValueError(f"arrays of {kind} have no place in an archive of numbers and texts")
    header = io.BytesIO()
    npy.write_array_header_1_0(header, {"descr": kind, "fortran_order": False, "shape": shape})
    return header.getvalue()


def remove(path: Path) -> None:
    """Remove a file if it is there; FileError if it stays."""
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise FileError(f"cannot remove {path}: {reason(error)}") from error


def modified(path: Path) -> int | None:
    """Return the modification time of a file [ns]; None if there is none."""
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return None


def check_regular(path: Path) -> None:
    """Raise OSError, whose text says what is valid, if reading a path could wait for ever; the path is not opened."""
    kind = SPECIAL.get(stat.S_IFMT(path.stat().st_mode))
    if kind:
        raise OSError(errno.EINVAL, f"this is {kind}, a regular file is needed", str(path))


def read_text(path: Path) -> str:
    """The UTF-8 text of a file; FileError if there is none."""
    try:
        check_regular(path)
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise FileError(f"cannot read {path}: {reason(error)}") from error
    except UnicodeDecodeError as error:
        raise FileError(f"cannot read {path}: it is not UTF-8 text") from error


def read_json(path: Path) -> Any:
    """The value in a JSON file; FileError if it cannot be read or is not JSON."""
    text = read_text(path)
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise FileError(f"{path} is not valid JSON: {error}") from error


def strict(value: Any) -> Any:
    """The value in JSON's own types: arrays as lists, numbers that are not finite as strings."""
    match value:
        case float():  # first, since most values are numbers and a Mapping takes long to recognise
            return value if math.isfinite(value) else "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"
        case None | bool() | int() | str():
            return value
        case list() | tuple():
            return [strict(item) for item in value]
        case Mapping():
            return {str(key): strict(item) for key, item in value.items()}
    if hasattr(value, "tolist"):  # an array or one of its numbers
        return strict(value.tolist())
    raise TypeError(f"{type(value).__name__} has no place in a JSON file")


def numbers(value: Any) -> Any:
    """The inverse of ``strict`` for data without text of its own: "nan", "inf" and "-inf" become floats again."""
    match value:
        case dict():
            return {key: numbers(item) for key, item in value.items()}
        case list():
            return [numbers(item) for item in value]
        case str():
            return NON_FINITE.get(value, value)
    return value


def reason(error: OSError) -> str:
    """Why the system refused, in lower case and without the path."""
    text = error.strerror or str(error)
    return text[:1].lower() + text[1:]
