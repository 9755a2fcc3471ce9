"""Archives from anywhere give their arrays or a message, and never more memory than their headers say."""

from __future__ import annotations

import io
import random
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest
from tools.repeats import thorough

from symphys.archives import ArchiveError, OtherShape, TooLarge, read_array, read_arrays

ROWS = np.arange(60.0).reshape(20, 3)


def packed(content: bytes, method: int = zipfile.ZIP_DEFLATED, name: str = "z.npy") -> bytes:
    """An archive of one member."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as archive:
        archive.writestr(name, content)
    return stream.getvalue()


def array(value: np.ndarray, shape: tuple[int, ...] | None = None) -> bytes:
    """An array as .npy, with another shape in its header where one is given."""
    stream = io.BytesIO()
    head = {"descr": value.dtype.str, "fortran_order": False, "shape": value.shape if shape is None else shape}
    np.lib.format.write_array_header_1_0(stream, head)
    return stream.getvalue() + value.tobytes()


def header(text: str) -> bytes:
    """A member with this header and nothing else."""
    padded = text.encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(padded).to_bytes(2, "little") + padded


@pytest.mark.parametrize("method", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
@pytest.mark.parametrize("value", [ROWS, np.asfortranarray(ROWS), np.array(["a", "bc"]), np.zeros((0, 3)), np.array(4)])
def test_arrays_are_those_that_numpy_reads(method: int, value: np.ndarray) -> None:
    stream = io.BytesIO()
    np.save(stream, value)
    names, found = read_arrays(io.BytesIO(packed(stream.getvalue(), method)))
    assert names == ("z",) and found["z"].dtype == value.dtype and np.array_equal(found["z"], value)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (packed(b"no array"), '"z" is no array'),
        (packed(header("{'descr': '<f8', 'fortran_order': False, 'shape': (1, -2), }")), '"z" is no array'),
        (packed(header("{'descr': '|O', 'fortran_order': False, 'shape': (1,), }")), "objects of Python"),
        (packed(header("{1: 2, 'a': (")), '"z" is no array'),
        (packed(header("(" * 110)), '"z" is no array'),
        (packed(array(ROWS, (10**30, 3))), "z takes 2.24e.22 GiB in memory; at most 1 GiB"),
        (packed(array(ROWS, (21, 3))), "has 480 bytes of numbers, but its header says 504"),
        (packed(array(ROWS))[:-60], "it is no NPZ file"),
        (array(ROWS), "it holds one array"),
        (b"", "it is no NPZ file"),
    ],
)
def test_what_is_no_archive_of_plain_arrays_is_said(content: bytes, said: str) -> None:
    with pytest.raises(ArchiveError, match=said):
        read_arrays(io.BytesIO(content))


@pytest.mark.parametrize("method", [zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_damage_is_a_message_wherever_it_is(method: int) -> None:
    whole, dice = packed(array(np.random.default_rng(0).standard_normal(400)), method), random.Random(1)
    refused = 0
    for _ in range(200):
        broken = bytearray(whole)
        broken[dice.randrange(len(broken))] = dice.randrange(256)
        try:
            read_arrays(io.BytesIO(bytes(broken)))
        except (ArchiveError, OSError):
            refused += 1
    assert refused > 100


@pytest.mark.slow
@pytest.mark.parametrize("method", [zipfile.ZIP_DEFLATED, thorough(zipfile.ZIP_LZMA)])
def test_no_more_is_unpacked_than_the_header_says(method: int) -> None:
    """Of 200 MB in a few kilobytes, under a header of 20 rows, and under one of all; none of it comes to memory."""
    for rows, kind in ((20, ArchiveError), (25 * 2**20, TooLarge)):
        content = packed(array(np.zeros(0), (rows,)) + bytes(200 * 2**20), method)
        assert len(content) < 300_000
        tracemalloc.start()
        with pytest.raises(kind):
            read_arrays(io.BytesIO(content), most=100 * 2**20)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 80 * 2**20  # LZMA unpacks 4 KiB to some 30 MB, whatever is asked for


def test_what_is_not_wanted_may_be_anything(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("z.npy", array(ROWS))
        archive.writestr("notes.txt", "no array")
    with path.open("rb") as stream:
        names, found = read_arrays(stream, ("z", "absent"))
    assert names == ("z", "notes.txt") and list(found) == ["z"]


def test_an_array_of_another_shape_is_not_read() -> None:
    """However large its header says that it is."""
    assert np.array_equal(read_array(io.BytesIO(array(ROWS)), (20, 3)), ROWS)
    for shape in ((20, 4), (10**30,)):
        with pytest.raises(OtherShape, match=str(shape[0])):
            read_array(io.BytesIO(array(ROWS, shape)), (20, 3))
    with pytest.raises(ArchiveError, match="last number"):
        read_array(io.BytesIO(array(ROWS)[:-1]), (20, 3))
