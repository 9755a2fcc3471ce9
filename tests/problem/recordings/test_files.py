"""Files of recordings: a problem depends on their contents, and its text is whole without them or finds them again."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from data.recorded import HEIGHT, beside

from symphys.errors import ProblemError
from symphys.problem import Problem, load_problem
from symphys.problem.recordings import files

ROWS = ["time,z", "0,1", "0.1,0.95", "0.2,0.8"]


def written(folder: Path, large: bool, rows: list[str] = ROWS) -> Problem:
    """A problem with a small file, or with one that counts as large."""
    folder.mkdir(exist_ok=True)
    (folder / "a.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(files, "MAX_KEPT_BYTES", 10 if large else 100_000)
        return beside(folder, {"files": "a.csv"})


@pytest.mark.parametrize("large", [False, True])
def test_runs_are_told_apart_by_data_not_by_places(large: bool, tmp_path: Path) -> None:
    problem = written(tmp_path / "one", large)
    moved = written(tmp_path / "two", large)
    other = written(tmp_path / "three", large, [*ROWS[:-1], "0.2,0.81"])
    assert problem.identity == moved.identity != other.identity
    (file,) = problem.recorded_files
    assert (file.file, file.path, file.text is None) == ("a.csv", str(tmp_path / "one" / "a.csv"), large)


@pytest.mark.parametrize("large", [False, True])
def test_the_text_of_a_problem_is_read_anywhere(large: bool, tmp_path: Path) -> None:
    """As from a run folder. Of a large file place and digest are kept; of a small one the text, which outlives it."""
    problem = written(tmp_path / "one", large)
    kept = tmp_path / "kept.toml"
    kept.write_text(problem.to_toml(), encoding="utf-8")
    again = load_problem(kept)
    np.testing.assert_array_equal(again.recordings[0].measured[0].values, problem.recordings[0].measured[0].values)
    assert again.identity == problem.identity == problem.set("ball.mass", 2.0).identity
    assert again.text == problem.text
    shutil.rmtree(tmp_path / "one")
    if large:
        with pytest.raises(ProblemError, match=r'recording "drop".files: a.csv .*one.a.csv'):
            load_problem(kept)
    else:
        assert load_problem(kept).identity == problem.identity


def test_data_that_changed_are_refused(tmp_path: Path) -> None:
    problem = written(tmp_path / "one", large=True)
    (tmp_path / "one" / "a.csv").write_text("\n".join([*ROWS, "0.3,0.6"]), encoding="utf-8")
    with pytest.raises(ProblemError, match=r"a\.csv has changed"):
        problem.set("ball.mass", 2.0)


def test_text_with_everything_toml_escapes(tmp_path: Path) -> None:
    """Quotes, backslashes and triple quotes in a column that is not used."""
    rows = ["time,z,note", '0,1,"a ""b"" \\n \\"', '0.1,0.9,""""""', "0.2,0.8,'é"]
    problem = written(tmp_path / "one", large=False, rows=rows)
    (tmp_path / "kept.toml").write_text(problem.to_toml(), encoding="utf-8")
    assert problem.recorded_files[0].text is not None
    assert load_problem(tmp_path / "kept.toml").recordings[0].measured[0].values.ravel().tolist() == [1, 0.9, 0.8]


def test_large_files_stay_out_of_the_text(tmp_path: Path) -> None:
    lines = [f"{k / 1e5:.5f},1.0" for k in range(50_000)]
    problem = written(tmp_path / "one", large=False, rows=["time,z", *lines])
    assert problem.recordings[0].samples == 50_000 and len(problem.text) < 2000


@pytest.mark.parametrize(
    ("pattern", "message"),
    [
        ("b.csv", 'there is no file "b.csv"; did you mean "a.csv"'),
        ("*.npz", 'no file matches "\\*.npz"; .* has a.csv, problem.toml'),
        ("no/*.csv", 'no file matches "no/\\*.csv"; .*no has no files'),
        ("../*.csv", "leaves the folder of this file"),
        ("/tmp/*.csv", "leaves the folder of this file"),
        ("**/*.csv", "is no part of a pattern"),
        ("problem.toml", "is no file that can be read: names end with .csv"),
        ("folder", "is no file that can be read"),
        ("folder.csv", 'is a folder; write "folder.csv/\\*.csv"'),
        ("a\x00.csv", "there is no file"),
        ("[.csv", "no file matches"),
        ("", "is no file that can be read"),
    ],
)
def test_names_that_lead_to_no_file(pattern: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("\n".join(ROWS))
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(ProblemError, match=message):
        beside(tmp_path, {"files": pattern, "measured": [HEIGHT]})


def test_digits_in_names_count_as_numbers() -> None:
    assert sorted(["t10", "t2", "t9a", "u1", "1"], key=files.natural) == ["1", "t2", "t9a", "t10", "u1"]
