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
from symphys.runs.execute import TranscriptionCache
from symphys.runs.record import failure
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


def here(folder: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, object]:
    """What is known in a folder."""
    monkeypatch.chdir(folder)
    provenance.working_copy.cache_clear()
    return provenance.working_copy()


def committed(folder: Path) -> str:
    """Make a repository with a commit."""
    folder.mkdir(parents=True, exist_ok=True)
    git(folder, "init", "-q")
    (folder / "file").write_text("1", encoding="utf-8")
    (folder / ".gitattributes").write_text("file filter=f diff=f\n", encoding="utf-8")
    git(folder, "add", ".")
    git(folder, "commit", "-q", "-m", "one")
    return git(folder, "rev-parse", "HEAD").strip()


def test_the_commit_is_that_which_git_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a branch, deep in folders, with packed references, without a branch, in a worktree, and before a commit."""
    assert here(tmp_path, monkeypatch) == {}
    (tmp_path / "new").mkdir()
    git(tmp_path / "new", "init", "-q")
    assert here(tmp_path / "new", monkeypatch) == {}, "no commit yet"
    known = {"commit": committed(tmp_path / "a")}
    (tmp_path / "a" / "b" / "c").mkdir(parents=True)
    assert here(tmp_path / "a", monkeypatch) == here(tmp_path / "a" / "b" / "c", monkeypatch) == known
    git(tmp_path / "a", "pack-refs", "--all")
    assert here(tmp_path / "a", monkeypatch) == known
    git(tmp_path / "a", "worktree", "add", "-q", "-b", "other", str(tmp_path / "tree"))
    assert here(tmp_path / "tree", monkeypatch) == known
    git(tmp_path / "tree", "commit", "-q", "--allow-empty", "-m", "two")
    two = {"commit": git(tmp_path / "tree", "rev-parse", "HEAD").strip()}
    assert here(tmp_path / "tree", monkeypatch) == two != known == here(tmp_path / "a", monkeypatch)
    git(tmp_path / "a", "checkout", "-q", "--detach")
    assert here(tmp_path / "a", monkeypatch) == known


def test_nothing_that_a_folder_names_is_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever its configuration says, and files that it includes; git itself runs some of this."""
    commit, marks = committed(tmp_path / "a"), tmp_path / "marks"
    marks.mkdir()

    def script(name: str) -> str:
        path = tmp_path / name
        path.write_text(f"#!/bin/sh\ntouch {marks / name}\ncat\n", encoding="utf-8")
        path.chmod(0o755)
        return str(path)

    hooks = tmp_path / "hooks"
    hooks.mkdir()
    for name in ("post-index-change", "reference-transaction", "fsmonitor-watchman", "post-checkout"):
        Path(script(name)).replace(hooks / name)
    included = tmp_path / "included"
    included.write_text(f'[filter "f"]\n process = {script("process")}\n clean = {script("clean")}\n', encoding="utf-8")
    with (tmp_path / "a" / ".git" / "config").open("a", encoding="utf-8") as config:
        config.write(
            f"[core]\n fsmonitor = {script('fsmonitor')}\n hooksPath = {hooks}\n sshCommand = {script('ssh')}\n"
            f" pager = {script('pager')}\n editor = {script('editor')}\n gitProxy = {script('proxy')}\n"
            f'[filter "f"]\n smudge = {script("smudge")}\n clean = {script("clean2")}\n required = true\n'
            f'[diff]\n external = {script("external")}\n[diff "f"]\n textconv = {script("textconv")}\n'
            f"[alias]\n status = !{script('alias')}\n rev-parse = !{script('alias2')}\n"
            f"[include]\n path = {included}\n[credential]\n helper = {script('helper')}\n"
        )
    (tmp_path / "a" / "file").write_text("2", encoding="utf-8")  # which git would have to look at
    Path(script("git")).rename(tmp_path / "a" / "git")
    monkeypatch.setenv("PATH", f"{tmp_path / 'a'}:{os.environ['PATH']}")
    assert here(tmp_path / "a", monkeypatch) == {"commit": commit}
    assert provenance.provenance()["commit"] == commit
    assert list(marks.iterdir()) == []


@pytest.mark.parametrize(
    "head",
    [
        "",
        "ref: ../../secret",
        "ref: /etc/hostname",
        "ref: refs/heads/loop",
        "ref: refs/heads/none",
        "x" * 40,
        "a" * 10**5,
        "\0" * 40,
        "ref: refs/heads/" + "x" * 300,
        "ref: refs/heads/\0",
    ],
)
def test_odd_repositories_have_no_commit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, head: str) -> None:
    (tmp_path / ".git" / "refs" / "heads").mkdir(parents=True)
    (tmp_path / ".git" / "refs" / "heads" / "loop").write_text("ref: refs/heads/loop", encoding="utf-8")
    (tmp_path / "secret").write_text("a" * 40, encoding="utf-8")
    (tmp_path / ".git" / "HEAD").write_text(head, encoding="utf-8")
    assert here(tmp_path, monkeypatch) == {}
    (tmp_path / ".git" / "HEAD").unlink()
    os.mkfifo(tmp_path / ".git" / "HEAD")
    assert here(tmp_path, monkeypatch) == {}


def test_a_program_that_does_not_answer_is_not_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(provenance, "ANSWER_TIMEOUT", 0.05)
    monkeypatch.setenv("PATH", f"{tmp_path}:/bin")
    for text in ("#!/bin/sh\nexec sleep 100000\n", "#!/nowhere\n", "#!/bin/sh\nexit 3\n"):
        (tmp_path / "sysctl").write_text(text, encoding="utf-8")
        (tmp_path / "sysctl").chmod(0o755)
        assert provenance.answer("sysctl", "-n") is None
