"""CSV files: the quick way and the careful one read the same numbers, and faults name row and column."""

from __future__ import annotations

import io
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symphys.problem.recordings import columns
from symphys.problem.recordings.columns import MISSING_WORDS, RecordingFault, read_csv
from symphys.types import Array

CELLS = st.one_of(st.floats(allow_infinity=False, width=64), st.integers(-(10**6), 10**6).map(float))


def read(content: str | bytes, *wanted: str) -> Array:
    """(n, columns): what is read of a file with this content."""
    raw = content.encode() if isinstance(content, str) else content
    columns = read_csv(io.BytesIO(raw), "a.csv", set(wanted))
    return np.column_stack([columns.values[name] for name in wanted])


@settings(max_examples=60, deadline=None)
@given(
    values=st.integers(1, 4).flatmap(
        lambda m: st.lists(st.lists(CELLS, min_size=m, max_size=m), min_size=1, max_size=30)
    ),
    missing=st.sampled_from(sorted(MISSING_WORDS)),
    end=st.sampled_from(["\n", "\r\n"]),
    mark=st.sampled_from([",", ";", "\t"]),
    chunk=st.integers(4, 200),
)
def test_what_was_written_is_read(values: list[list[float]], missing: str, end: str, mark: str, chunk: int) -> None:
    """Whatever the line ends, the delimiter, the word for a missing number, and where chunks end."""
    names = [f"c{k}" for k in range(len(values[0]))]
    only = len(names) == 1  # a line without anything is no row
    word = (missing or "nan") if only else missing
    lines = [mark.join(word if value != value else repr(value) for value in row) for row in values]
    content = end.join([mark.join(names), *lines])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(columns, "CHUNK_BYTES", chunk)
        np.testing.assert_array_equal(read(content, *names), np.array(values))


@pytest.mark.parametrize(
    ("content", "rows"),
    [
        ("a,b\n1,2\n\n3,4\n\n", [[1, 2], [3, 4]]),
        ('a,b\n"1","2"\n', [[1, 2]]),
        ("\ufeffa,b\n 1 , 2\n", [[1, 2]]),
        ("# a,b\n1,2\n", [[1, 2]]),
        ("a,b\n1,\n,2\n,\n", [[1, np.nan], [np.nan, 2], [np.nan, np.nan]]),
        ("b,a,note\n2,1,left\n4,3,\n", [[1, 2], [3, 4]]),
    ],
)
def test_what_programs_write(content: str, rows: list[list[float]]) -> None:
    """Empty lines, quotes, byte order marks, the mark of savetxt, spaces, empty cells, texts that are not used."""
    np.testing.assert_array_equal(read(content, "a", "b"), np.array(rows))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "a.csv is empty; the first row must name the columns"),
        ("\na,b\n", "begins with an empty line"),
        ("a,b\n", "has a header, but no row of numbers"),
        ("1,2\n3,4\n", 'row 1: "1" is a number; the first row must name'),
        ("a,a,b\n1,2,3\n", 'row 1: two columns have the name "a"'),
        ("a,b\n1,2\n3,x\n", 'row 3, column "b": "x" is no number'),
        ("a,b\n1,2\n3\n", "row 3 has 1 cells, but the header has 2"),
        ("a,b\n1,2\n3,4,5\n", "row 3 has 3 cells, but the header has 2"),
        ("a;b\n1,5;2\n", 'row 2, column "a": "1,5" is no number; write 1.5'),
        ("a,b\n1,inf\n", 'row 2, column "b": "inf" is not finite'),
        ("a,b\n1,1e999\n", "is not finite"),
        ("a,b\n1,1_000\n", '"1_000" is no number'),
        (b"a,b\n1,2\n\xff\xfe,3\n", "row 3: this is no UTF-8 text"),
        (b"PK\x03\x04\xff\n", "row 1: this is no UTF-8 text"),
        ('a,b\n"1,2\n', "row 2"),
    ],
)
def test_faults_name_row_and_column(content: str | bytes, message: str) -> None:
    with pytest.raises(RecordingFault) as found:
        read(content, "a", "b")
    assert message in str(found.value)


def test_a_fault_far_down_is_found_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(columns, "CHUNK_BYTES", 1000)
    lines = ["a,b", *(f"{k},{k}" for k in range(5000)), "7,?", *(f"{k},{k}" for k in range(100))]
    with pytest.raises(RecordingFault, match='row 5002, column "b"'):
        read("\n".join(lines), "a", "b")


@settings(max_examples=200, deadline=None)
@given(
    st.binary(max_size=200)
    | st.text("0123456789.,;-+eEnaif \n\r\t\"'x_", max_size=200).map(lambda t: f"a,b\n{t}".encode())
)
def test_any_content_is_numbers_or_a_fault(content: bytes) -> None:
    try:
        found = read(content, "a", "b")
    except (RecordingFault, KeyError):  # KeyError: there are no such columns, of which tables tell
        return
    assert found.shape[1] == 2 and not np.isinf(found).any()


@pytest.mark.slow
def test_long_files_are_read_by_chunks_into_the_memory_of_their_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    """No chunk goes cell by cell, and rows are filled in where they stay; what is held beside them is a few chunks."""
    monkeypatch.setattr(columns, "CHUNK_BYTES", 1 << 14)
    monkeypatch.setattr(columns, "cell_by_cell", pytest.fail)
    count = 100_000
    content = "time,x,y\n" + "".join(f"{k / 1000:.3f},{k % 1000},\n" for k in range(count))
    stream = io.BytesIO(content.encode())
    tracemalloc.start()
    found = read_csv(stream, "long.csv", {"time", "x"})
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert found.count == count and found.values["x"][-1] == 999 and found.values["time"][-1] == 99.999
    assert found.values["x"].base is not None
    assert peak < 2 * count * 8 + 20 * (1 << 14)
