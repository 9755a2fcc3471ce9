"""What is no regular file is refused before it is opened: reading a pipe waits for whoever writes into it."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from symphys import files
from symphys.errors import SymphysError
from symphys.export.folder import ExportError, write_folders
from symphys.problem import load_problem
from symphys.results.text_files import ReportError, read_table, read_words
from symphys.results.trace import read_trace
from symphys.results.trajectories import read_trajectory

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes")
PIPE = "named pipe"
ARM = """
include = [{ file = "arm.toml" }]
[simulation]
duration = 1.0
dt = 0.01
"""
NET = """
[simulation]
duration = 1.0
dt = 0.01
[[body]]
name = "arm"
shape = { sphere = { radius = 0.05 } }
mass = 2.0
[[sensor]]
name = "state"
reads = ["arm.position"]
[[controller]]
name = "brain"
drives = "arm.force"
senses = ["state"]
net = { hidden = [3], weights = "w.npy" }
"""


@pytest.fixture
def pipe(tmp_path: Path) -> Iterator[Callable[[str], Path]]:
    """A named pipe of this name, into which nobody writes; who opens it is stopped."""

    def made(name: str) -> Path:
        os.mkfifo(tmp_path / name)
        return tmp_path / name

    def waits(*_: object) -> None:
        raise AssertionError("the pipe was opened")

    before = signal.signal(signal.SIGALRM, waits)
    signal.alarm(5)
    yield made
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize(
    ("read", "name"),
    [
        (files.read_text, "log.txt"),
        (files.read_json, "config.json"),
        (read_words, "problem.toml"),
        (read_table, "result.json"),
        (read_trajectory, "trajectory.npz"),
        (load_problem, "problem.toml"),
    ],
)
def test_a_pipe_is_refused(pipe: Callable[[str], Path], read: Callable[[Path], object], name: str) -> None:
    with pytest.raises(SymphysError, match=f"{name}: .*{PIPE}"):
        read(pipe(name))


def test_a_trace_that_is_a_pipe(pipe: Callable[[str], Path]) -> None:
    faults = list[str]()
    assert read_trace(pipe("trace.csv"), faults).columns == {}
    (fault,) = faults
    assert fault.startswith("trace.csv: ") and PIPE in fault


@pytest.mark.parametrize(("text", "name"), [(ARM, "arm.toml"), (NET, "w.npy")])
def test_a_pipe_that_a_problem_names(pipe: Callable[[str], Path], tmp_path: Path, text: str, name: str) -> None:
    pipe(name)
    (tmp_path / "problem.toml").write_text(text, "utf-8")
    with pytest.raises(SymphysError, match=rf"{name}\b.*{PIPE}"):
        load_problem(tmp_path / "problem.toml")


def test_a_pipe_in_the_way_of_an_export(pipe: Callable[[str], Path], tmp_path: Path) -> None:
    pipe("README.txt")
    with pytest.raises(ExportError, match=r"README.txt"):
        write_folders({tmp_path: {"README.txt": b"text"}})


def test_a_device_is_refused() -> None:
    with pytest.raises(ReportError, match="device"):
        read_words(Path("/dev/zero"))
