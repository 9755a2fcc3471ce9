"""Archives of plain arrays (.npz), which may come from anywhere: sizes are known before anything is unpacked.

The header of a member says what its array takes. It must agree with the archive's own list, and no more than that is
unpacked, so a small file cannot fill the memory.
"""

from __future__ import annotations

import math
import zipfile
from collections.abc import Container, Sequence
from typing import IO, BinaryIO, NamedTuple

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from symphys.suggest import quote

PlainArray = NDArray[np.generic]
GIB = 2**30
MOST_BYTES = GIB
"""Largest memory of the arrays of one file together."""
NUMBER, TEXT = 8, 100
"""[bytes] Memory of an entry, at least, as a float; and as a Python text, without its letters."""
CHUNK, PACKED_CHUNK = 2**20, 2**12
"""[bytes] Read at once of members that are stored or deflated, and of others, whose libraries do not bound what they
unpack: 4 KiB of these become 100 MB at most."""
SUFFIX = ".npy"


class ArchiveError(ValueError):
    """Why a file is no archive of plain arrays, or one that takes too much memory."""


class TooLarge(ArchiveError):
    """Arrays would take more memory than is allowed."""


class OtherShape(ArchiveError):
    """An array has another shape than the one that is wanted; the message is its shape."""


class ArrayHeader(NamedTuple):
    """The type and shape of an array, from its header.

    Attributes:
        shape: of the array.
        by_columns: whether its first index runs fastest.
        kind: of its entries.
        size: [bytes] of its entries in the file.
        memory: [bytes] that it takes once it is read.
    """

    shape: tuple[int, ...]
    by_columns: bool
    kind: np.dtype[np.generic]
    size: int
    memory: int


def read_arrays(
    stream: BinaryIO, wanted: Container[str] | None = None, most: int = MOST_BYTES
) -> tuple[tuple[str, ...], dict[str, PlainArray]]:
    """The names of all members without ``.npy``, and the arrays of those that are ``wanted``; None: of all.

    Args:
        stream: an archive.
        wanted: names.
        most: [bytes] that the wanted arrays may take together.

    Raises:
        ArchiveError: says what is wrong, and with which array.
        OSError: the file cannot be read.
    """
    try:
        if stream.read(len(npy.MAGIC_PREFIX)) == npy.MAGIC_PREFIX:
            raise ArchiveError("it holds one array; an NPZ file of arrays by name is wanted")
        with zipfile.ZipFile(stream) as archive:
            members = {name.removesuffix(SUFFIX): name for name in archive.namelist()}
            asked = {name: member for name, member in members.items() if wanted is None or name in wanted}
            headers = {name: _member_header(archive, member, name) for name, member in asked.items()}
            _check_memory(headers, most)
            found = {name: _member(archive, asked[name], header, name) for name, header in headers.items()}
            return tuple(members), found
    except (ArchiveError, OSError):
        raise
    except Exception as error:  # zipfile raises most kinds of errors at files that are broken
        raise ArchiveError("it is no NPZ file of numbers") from error


def read_array(stream: BinaryIO, shape: Sequence[int]) -> PlainArray:
    """The array of an ``.npy`` file, which must have this shape; ArchiveError says what is wrong."""
    header = _header(stream)
    if header.shape != tuple(shape):
        raise OtherShape(f"{header.shape}")
    return _entries(stream, header, CHUNK)


def _member_header(archive: zipfile.ZipFile, member: str, name: str) -> ArrayHeader:
    with archive.open(member) as stream:
        try:
            return _header(stream)
        except ArchiveError as error:
            raise ArchiveError(f"{quote(name)} {error}") from error


def _header(stream: IO[bytes]) -> ArrayHeader:
    """Read the header of an array."""
    try:
        version = npy.read_magic(stream)
        read = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}[version]
        shape, by_columns, kind = read(stream)
    except Exception as error:  # numpy lets Python parse the header, which raises most kinds of errors
        raise ArchiveError("is no array") from error
    if kind.hasobject:
        raise ArchiveError("holds objects of Python, not numbers")
    if any(length < 0 for length in shape):
        raise ArchiveError("is no array")
    entry = max(kind.itemsize, NUMBER) if kind.kind in "fiub" else kind.itemsize + TEXT
    return ArrayHeader(shape, by_columns, kind, math.prod(shape) * kind.itemsize, math.prod(shape) * entry)


def _check_memory(headers: dict[str, ArrayHeader], most: int) -> None:
    """Name the array with which the arrays are too large."""
    total = 0
    for name, header in headers.items():
        total += header.memory
        if total > most:
            others = "" if header.memory > most else f", {total / GIB:.3g} GiB with the arrays before it"
            takes = f"{name} takes {header.memory / GIB:.3g} GiB in memory{others}"
            raise TooLarge(f"{takes}; at most {most / GIB:.3g} GiB are read")


def _member(archive: zipfile.ZipFile, member: str, header: ArrayHeader, name: str) -> PlainArray:
    plain = archive.getinfo(member).compress_type in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
    try:
        with archive.open(member) as stream:
            _header(stream)
            declared = archive.getinfo(member).file_size - stream.tell()
            if declared != header.size:
                text = f"has {declared} bytes of numbers, but its header says {header.size}"
                raise ArchiveError(f"{quote(name)} {text}")
            return _entries(stream, header, CHUNK if plain else PACKED_CHUNK)
    except (ArchiveError, OSError):
        raise
    except Exception as error:  # what zlib, lzma and bz2 raise has no common kind
        raise ArchiveError(f"{quote(name)} is damaged") from error


def _entries(stream: IO[bytes], header: ArrayHeader, chunk: int) -> PlainArray:
    content, place = bytearray(header.size), 0
    while place < header.size:
        part = stream.read(min(chunk, header.size - place))
        if not part:
            raise ArchiveError("ends before its last number")
        content[place : place + len(part)] = part
        place += len(part)
    return np.ndarray(header.shape, header.kind, buffer=content, order="F" if header.by_columns else "C")
