"""Each run says on which machine, in which process and from which commit it was made."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from symphys import files
from symphys.results.file_names import RESULT
from symphys.results.result import read_result
from symphys.runs import Job, execute, provenance
from symphys.runs.record import failure
from symphys.runs.transcription_cache import TranscriptionCache
from symphys.transcription import transcribe

MakeJob = Callable[..., Job]


@pytest.fixture(autouse=True)
def _asked_anew() -> None:
    provenance.working_copy.cache_clear()
    provenance.machine.cache_clear()


def git(folder: Path, *arguments: str) -> str:
    names = ["-c", "user.name=n", "-c", "user.email=e@e"]
    return subprocess.run(["git", *names, *arguments], cwd=folder, capture_output=True, text=True, check=True).stdout


def test_a_run_has_it_however_it_ends(make_job: MakeJob) -> None:
    job = make_job()
    result = execute(job, lambda row: None, TranscriptionCache(transcribe))
    for found in (result, failure(job, "no")):
        assert found.provenance["pid"] == os.getpid()
        assert found.provenance["peak_memory"] > 10 * 2**20
        assert {"host", "processor", "python_platform"} <= set(found.provenance)
        assert {"symphys", "python", "casadi", "numpy"} <= set(found.versions)
    compiled = result.backend.compiler
    assert ("-O" in result.provenance.get("flags", "")) is bool(compiled)


def test_a_file_without_it_is_read(make_job: MakeJob) -> None:
    job = make_job()
    execute(job, lambda row: None, TranscriptionCache(lambda problem: transcribe(problem, backend="casadi")))
    path = job.folder.path / RESULT
    value = files.read_json(path)
    del value["provenance"]
    files.write_json(path, value)
    assert read_result(path).provenance == {}


def test_the_commit_and_whether_files_differ_from_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    git(tmp_path, "init", "-q")
    assert provenance.working_copy() == {}, "no commit yet"
    (tmp_path / "file").write_text("1", encoding="utf-8")
    git(tmp_path, "add", "file")
    git(tmp_path, "commit", "-q", "-m", "one")
    (tmp_path / "untracked").write_text("1", encoding="utf-8")
    provenance.working_copy.cache_clear()
    commit = git(tmp_path, "rev-parse", "HEAD").strip()
    assert provenance.working_copy() == {"commit": commit, "dirty": False}
    (tmp_path / "file").write_text("2", encoding="utf-8")
    assert provenance.working_copy()["dirty"] is False, "asked once per process"
    provenance.working_copy.cache_clear()
    assert provenance.working_copy()["dirty"] is True


def test_it_never_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without git, and with a program of its name that does not end or cannot be run."""
    monkeypatch.setattr(provenance, "PATIENCE", 0.05)
    for text in (None, "#!/bin/sh\nexec sleep 5\n", "#!/nowhere\n", "#!/bin/sh\nexit 3\n"):
        if text is not None:
            (tmp_path / "git").write_text(text, encoding="utf-8")
            (tmp_path / "git").chmod(0o755)
        monkeypatch.setenv("PATH", f"{tmp_path}:/bin" if text else str(tmp_path))
        if text is not None:
            provenance.working_copy.cache_clear()
            assert provenance.answer("git", "status") is None
        else:
            assert provenance.working_copy() == {}
    assert "commit" not in provenance.provenance()
