"""Files that are broken at random are read, or become a message; the same number breaks the same places."""

from __future__ import annotations

import contextlib
import io
import random
import re
import resource
import shutil
import signal
import traceback
import zipfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from data.mutated_texts import MODELS, PROBLEM, RECORDED
from tools.mutations import (
    MEMBER,
    MODEL_CHANGES,
    SPOIL_NUMBER,
    TEXT_CHANGES,
    VALUES,
    cut,
    flip,
    mutated,
    replacing,
)
from tools.repeats import thorough

import symphys
import symphys.problems
from symphys.cli.runs import best, ls
from symphys.errors import SymphysError
from symphys.importing import robot as model_source
from symphys.importing.reading.child import main as read_in_this_process
from symphys.problem import load, load_problem
from symphys.report.pages.run import write_run_report
from symphys.results.discovery import read_all
from symphys.results.table import journal

LONGEST = 10
"""Seconds of a processor for one file."""
MEMORY = 4 * 2**30
"""Bytes of data that the process may have."""


def repacked(content: bytes, dice: random.Random) -> bytes:
    """Return an archive whose members are broken, not the archive around them."""
    written = io.BytesIO()
    methods = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2)
    with zipfile.ZipFile(io.BytesIO(content)) as source, zipfile.ZipFile(written, "w", dice.choice(methods)) as target:
        chosen = dice.choice(source.namelist())
        for name in source.namelist():
            member = source.read(name)
            if name == chosen:
                head = member.index(b"\n") + 1
                where = dice.choice(("head", "head", "all", "shape"))
                if where == "head":
                    member = mutated(member[:head], dice, (flip, SPOIL_NUMBER)) + member[head:]
                elif where == "shape":
                    wild = dice.choice((b"(10000000000000000000000000000000,)", b"(-1,)", b"()", b"(4, 0)", b"(2, 2)"))
                    member = re.sub(rb"\([\d, ]*\)", wild, member[:head]) + member[head:]
                else:
                    member = mutated(member, dice, (flip, cut))
            target.writestr(name, member)
    return written.getvalue()


def archive(**arrays: Any) -> bytes:
    """Return the content of an NPZ file."""
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


class Problems:
    """Problem files: loaded, and their world made."""

    def __init__(self, folder: Path) -> None:
        """Files are written into a folder."""
        self.file = folder / "problem.toml"

    def __call__(self, dice: random.Random) -> None:
        """Load one."""
        self.file.write_bytes(mutated(PROBLEM.encode(), dice, TEXT_CHANGES))
        load_problem(self.file).world()


class ShippedProblems:
    """The problem files of the package, beside the files that they include."""

    def __init__(self, folder: Path) -> None:
        """Files are written into a copy of their folder."""
        self.folder = folder / "problems"
        shutil.copytree(Path(symphys.problems.__path__[0]), self.folder)
        self.texts = [path.read_bytes() for path in sorted(self.folder.glob("*.toml"))]

    def __call__(self, dice: random.Random) -> None:
        """Load one."""
        file = self.folder / "broken.toml"
        file.write_bytes(mutated(dice.choice(self.texts), dice, TEXT_CHANGES))
        load_problem(file).world()


class Recordings:
    """Recordings beside a problem file, as CSV or NPZ."""

    def __init__(self, folder: Path) -> None:
        """Files are written into a folder."""
        self.folder = folder
        rows = np.linspace(0, 0.4, 5)
        self.arrays = archive(time=rows, z=1 - rows, other=np.ones((5, 2)))
        lines = ["time,z,other", *(f"{t:.2f},{1 - t:.3f},1" for t in rows)]
        self.text = ("\n".join(lines) + "\n").encode()

    def __call__(self, dice: random.Random) -> None:
        """Load one."""
        kind = dice.choice(("csv", "npz", "npz packed"))
        name = "a." + kind[:3]
        if kind == "csv":
            content = mutated(self.text, dice, TEXT_CHANGES)
        else:
            content = mutated(self.arrays, dice, (flip, cut)) if kind == "npz" else repacked(self.arrays, dice)
        (self.folder / name).write_bytes(content)
        file = self.folder / "problem.toml"
        file.write_text(RECORDED.replace("FILE", name))
        load_problem(file)


def solved(folder: Path) -> Path:
    """Solve the problem of all sorts below a folder, and return the folder of the run."""
    file = folder / "all.toml"
    file.write_text(PROBLEM)
    symphys.solve(file, "gradient", folder=folder / "out", backend="casadi", iterations=2)
    (result,) = folder.rglob("result.json")
    return result.parent


def list_runs(root: Path) -> None:
    """List the runs below a folder, and the best of them, as the command line does."""
    with contextlib.redirect_stdout(io.StringIO()):
        for command in (ls, best):
            command.main([str(root)], standalone_mode=False)


class Runs:
    """Run folders: one of their files is broken; the run is read, listed and its page made."""

    def __init__(self, folder: Path) -> None:
        """Solve one problem."""
        self.root, self.folder = folder / "out", solved(folder)
        kinds = (".json", ".npz", ".csv", ".toml", ".jsonl")
        self.files = {path: path.read_bytes() for path in sorted(self.folder.iterdir()) if path.suffix in kinds}
        self.broken = next(iter(self.files))

    def __call__(self, dice: random.Random) -> None:
        """Read one."""
        self.broken.write_bytes(self.files[self.broken])
        self.broken = dice.choice([*self.files])
        content = self.files[self.broken]
        if self.broken.suffix != ".npz":
            content = mutated(content, dice, TEXT_CHANGES)
        else:
            content = repacked(content, dice) if dice.random() < 0.7 else mutated(content, dice, (flip, cut))
        self.broken.write_bytes(content)
        read_all(self.root)
        symphys.results.runs(self.root)
        list_runs(self.root)
        write_run_report(self.folder)


class Journals:
    """Journals of run folders, most of whose broken lines have a right checksum: the runs are listed."""

    def __init__(self, folder: Path) -> None:
        """Solve one problem."""
        solved(folder)
        self.root = folder / "out"
        self.journal = self.root / journal.JOURNAL_FILE
        self.line = self.journal.read_bytes()

    def __call__(self, dice: random.Random) -> None:
        """List one."""
        body = mutated(
            self.line[journal.BODY_START :].rstrip(b"\n"), dice, (*TEXT_CHANGES, replacing(MEMBER, spoilt_member))
        )
        checksum = zlib.crc32(body) if dice.random() < 0.9 else dice.randrange(2**32)
        lines = [journal.LINE_PREFIX + b'%08x",' % checksum + body + b"\n", self.line]
        self.journal.write_bytes(b"".join(dice.sample(lines, dice.choice((1, 2)))))
        list_runs(self.root)


def spoilt_member(match: re.Match[bytes], dice: random.Random) -> bytes:
    """Return a member of a JSON object with another name, or with another value."""
    if dice.random() < 0.2:
        return dice.choice((b'"run"', b'"fault"', b'"solved"', b'"\\u001b[2J"')) + match[2] + match[3]
    return match[1] + match[2] + (dice.choice((*VALUES, b'"\\u001b[2J"', b"false", b'"solved"')) or b"null")


class Robots:
    """Small robots as URDF and MJCF, read in this process, and as problems."""

    def __init__(self, folder: Path) -> None:
        """Files are written into a folder."""
        self.folder = folder

    def __call__(self, dice: random.Random) -> None:
        """Read one."""
        name = dice.choice(sorted(MODELS))
        (self.folder / name).write_bytes(mutated(MODELS[name], dice, MODEL_CHANGES))
        robot = symphys.load_robot(self.folder / name, self_collision=False)
        robot.text()
        robot.problem()


KINDS: dict[str, Callable[[Path], Callable[[random.Random], None]]] = {
    "problem": Problems,
    "shipped": ShippedProblems,
    "recording": Recordings,
    "run": Runs,
    "journal": Journals,
    "robot": Robots,
}


def outcome(attempt: Callable[[random.Random], None], kind: str, number: int) -> str:
    """Return what becomes of one file: read, message, or the traceback."""

    def late(*_: object) -> None:
        raise TimeoutError(f"longer than {LONGEST} s")

    signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, LONGEST)
    try:
        attempt(random.Random(f"{kind} {number}"))
    except SymphysError:
        return "message"
    except BaseException:
        return traceback.format_exc()
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    return "read"


@pytest.fixture
def memory() -> Iterator[None]:
    """Limit the memory of the process."""
    limits = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, limits[1]))
    yield
    resource.setrlimit(resource.RLIMIT_DATA, limits)


@pytest.mark.parametrize(("kind", "count"), [("problem", 25), ("recording", 60)])
def test_broken_files_are_read_or_become_messages(tmp_path: Path, kind: str, count: int) -> None:
    attempt = KINDS[kind](tmp_path)
    found = {outcome(attempt, kind, number) for number in range(count)}
    assert found == {"read", "message"}


@pytest.mark.parametrize("kind", [thorough(kind) for kind in KINDS])
@pytest.mark.usefixtures("memory")
def test_a_thousand_broken_files_are_read_or_become_messages(
    tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if kind == "recording":  # the check of times takes half of the time, and is the same for all
        monkeypatch.setattr(load, "check_overlap", lambda *_: None)
    if kind == "robot":
        pytest.importorskip("mujoco")
        monkeypatch.setattr(model_source, "run", lambda place, _: read_in_this_process(place) or 0)
    attempt = KINDS[kind](tmp_path)
    bad = {number: found for number in range(1000) if len(found := outcome(attempt, kind, number)) > len("message")}
    assert bad == {}


def test_every_change_changes_something() -> None:
    """Else the thousands would be copies of what works."""
    dice, text = random.Random(1), PROBLEM.encode()
    assert all(change(text, dice) != text for change in TEXT_CHANGES)
    assert len({mutated(text, dice, TEXT_CHANGES) for _ in range(20)}) > 15
