"""Archives of plain arrays (.npz): what they take in memory is known from their headers before anything is unpacked."""

from __future__ import annotations

import math
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.lib import format as npy

from symphys import json_values as values
from symphys.files import check_regular
from symphys.results.text_files import ReportError, reason
from symphys.trajectory import Array

MOST_BYTES = 2**30
"""That the arrays of one file may take together."""
GIB = 2**30
NUMBER, TEXT = 8, 100
"""[bytes] An entry takes at least as many once it is a float, or a text of Python's beside its letters."""
UNREADABLE = (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error, NotImplementedError, MemoryError)
"""What numpy and zipfile raise at files that are no archives of plain arrays."""


def read_archive(path: Path, only: Sequence[str] = ()) -> dict[str, Array]:
    """Every array of an archive, or ``only`` those of these names that it has.

    Raises:
        ReportError: no such file, not an archive of plain arrays, or arrays of more than MOST_BYTES.
    """
    try:
        check_regular(path)
        with path.open("rb") as file:
            return unpack(path, np.load(file, allow_pickle=False), only)
    except UNREADABLE as error:
        if isinstance(error, OSError) and error.strerror:
            raise ReportError(f"{path.name}: {reason(error)}") from error
        raise ReportError(f"{path.name}: not an archive of plain arrays ({values.name(str(error))})") from error


def unpack(path: Path, content: object, only: Sequence[str]) -> dict[str, Array]:
    """The arrays, if they are not too large; ValueError for anything else that numpy reads."""
    if not isinstance(content, np.lib.npyio.NpzFile):
        raise ValueError("one array, not an archive of several")
    with content as archive:
        assert archive.zip is not None
        names = [key for key in archive.files if not only or key in only]
        members = set(archive.zip.namelist())
        check_size(path, archive.zip, [f"{key}.npy" if f"{key}.npy" in members else key for key in names])
        return {key: archive[key] for key in names}


def check_size(path: Path, archive: zipfile.ZipFile, members: Sequence[str]) -> None:
    """ReportError names the array with which the arrays are too large."""
    total = 0
    for name in members:
        size = unpacked_bytes(archive, name)
        total += size
        if total > MOST_BYTES:
            array, most = values.name(name.removesuffix(".npy")), f"at most {MOST_BYTES / GIB:.3g} GiB are read"
            others = "" if size > MOST_BYTES else f", {total / GIB:.3g} GiB with the arrays before it"
            raise ReportError(f"{path.name}: {array} takes {size / GIB:.3g} GiB in memory{others}; {most}")


def unpacked_bytes(archive: zipfile.ZipFile, name: str) -> int:
    """What a member takes in memory, as the header of its array says; of other members the size in the archive's list.

    More than that is never unpacked. Raises what is in UNREADABLE.
    """
    with archive.open(name) as member:
        if member.read(len(npy.MAGIC_PREFIX)) != npy.MAGIC_PREFIX:
            return archive.getinfo(name).file_size
        member.seek(0)
        version = npy.read_magic(member)
        if version not in ((1, 0), (2, 0)):
            raise ValueError(f"version {version} of the format of arrays")
        shape, _, kind = (npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0)(member)
    entry = max(kind.itemsize, NUMBER) if kind.kind in "fiub" else kind.itemsize + TEXT
    return math.prod(map(abs, shape)) * entry
