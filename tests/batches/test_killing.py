"""A batch whose processes are killed at random: everything is there, whole, equal, and nothing was computed twice.

Several commands share a folder. Again and again a process of one of them, driver or worker, gets SIGKILL; a command
that has died is started again. A watcher notes when each result is first seen: one that is written again later was
computed after it was there. In the end the folder is compared with that of a batch that nobody disturbed.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from tools.repeats import thorough
from worlds.toys import require

from symphys.results.result import read_result
from symphys.runs.inspection import file_stamp

PROBLEM = """
title = "A throw to be found by trial"
[simulation]
duration = 1.0
dt = STEP
[[body]]
name = "ball"
shape = { sphere = { radius = 0.1 } }
mass = 1.0
position = [0, 0, 1]
[ground]
[[variable]]
name = "throw"
sets = "ball.velocity"
guess = [1, 0, 0]
lower = [-10, -10, 0]
upper = [10, 10, 10]
spread = 0.5
[[cost]]
name = "misses"
squares = "ball.position[0:2] - [0.5, 0]"
[solver.cma]
evaluations = EVALUATIONS
"""
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="finds processes by /proc")
SOLVERS = ("cma", "gradient")
SAME = ("status", "objective", "costs", "outputs", "checks", "z", "iterations", "counts")
"""Fields of a result that do not depend on time or machine."""


@dataclass
class Watcher:
    """Watches the results while they are written.

    Attributes:
        begun: folders of runs.
        seen: the first stamp of each result, by its folder.
        again: folders whose result was written again.
    """

    out: Path
    begun: set[Path] = field(default_factory=set)
    seen: dict[Path, str] = field(default_factory=dict)
    again: set[Path] = field(default_factory=set)

    def look(self) -> int:
        """Note what is new or changed; returns how many results there are."""
        count = 0
        for path in self.out.glob("*/*-seed*"):
            self.begun.add(path)
            stamp = file_stamp(path / "result.json")
            if path in self.seen and stamp != self.seen[path]:
                self.again.add(path)
            if stamp:
                count += 1
                self.seen.setdefault(path, stamp)
        return count


@dataclass
class Commands:
    """The commands that share the folder."""

    arguments: list[str]
    count: int
    running: list[subprocess.Popen[bytes]] = field(default_factory=list)
    started: int = 0

    def fill(self) -> None:
        """Start commands until there are enough."""
        self.running = [each for each in self.running if each.poll() is None]
        while len(self.running) < self.count:
            command = [sys.executable, "-m", "symphys", "solve", *self.arguments]
            quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
            self.running.append(subprocess.Popen(command, start_new_session=True, **quiet))
            self.started += 1

    def processes(self) -> list[int]:
        """Return drivers and their workers; each command has a session of its own."""
        sessions, found = {each.pid for each in self.running}, []
        for path in Path("/proc").iterdir():
            try:
                fields = (path / "stat").read_text().rpartition(")")[2].split() if path.name.isdigit() else []
            except OSError:
                continue
            if fields and fields[0] != "Z" and int(fields[3]) in sessions:
                found.append(int(path.name))
        return found


def disturbed(
    arguments: list[str], out: Path, kills: int, drivers: int, pause: float, seed: int, runs: int
) -> tuple[Watcher, int, int, int]:
    """Kill so often, each time after a pause in which a run has begun, as long as runs are left; let the rest be done.

    Returns:
        The watcher, the number of kills, how many of them hit drivers, and how many commands were started.
    """
    random.seed(seed)
    watcher, commands = Watcher(out), Commands([*arguments, "--out", str(out)], drivers)
    hit, left = 0, kills
    while left and watcher.look() < runs:
        commands.fill()
        until, begun = time.monotonic() + random.uniform(0.2, 1.8) * pause, len(watcher.begun)
        while watcher.look() < runs and (time.monotonic() < until or len(watcher.begun) == begun):
            time.sleep(0.02)
        victims = commands.processes()
        if victims:
            victim = random.choice(victims)
            hit += victim in {each.pid for each in commands.running}
            os.kill(victim, signal.SIGKILL)
            left -= 1
    commands.fill()
    while any(each.poll() is None for each in commands.running):
        watcher.look()
        time.sleep(0.02)
    watcher.look()
    return watcher, kills - left, hit, commands.started


def differences(one: Path, other: Path) -> list[str]:
    """Return what is missing in the second folder, or differs from the first."""
    found = []
    for path in sorted(one.glob("*/*-seed*")):
        twin = other / path.relative_to(one)
        try:
            a, b = read_result(path / "result.json"), read_result(twin / "result.json")
            found += [f"{twin}: {name}" for name in SAME if getattr(a, name) != getattr(b, name)]
            with np.load(path / "trajectory.npz") as first, np.load(twin / "trajectory.npz") as second:
                found += [f"{twin}: {name}" for name in first.files if not same(first[name], second[name])]
        except Exception as error:  # whatever is not whole is a difference
            found.append(f"{twin}: {error}")
    return found


def same(one: np.ndarray, other: np.ndarray) -> bool:
    """Return whether two arrays agree to the bit."""
    return one.dtype == other.dtype and one.tobytes() == other.tobytes()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("runs", "kills", "drivers", "evaluations", "pause"), [(8, 3, 2, 400, 0.0), thorough(400, 100, 3, 4000, 1.0)]
)
def test_a_batch_whose_processes_are_killed_is_whole(
    tmp_path: Path, runs: int, kills: int, drivers: int, evaluations: int, pause: float
) -> None:
    """``pause``: seconds between two kills, about; a process is killed after a run has begun."""
    require("simd")
    problem = tmp_path / "trial.toml"
    text = PROBLEM.replace("EVALUATIONS", str(evaluations)).replace("STEP", "0.001")
    problem.write_text(text, encoding="utf-8")
    arguments = [str(problem), "--solver", ",".join(SOLVERS), "--seeds", str(runs // len(SOLVERS)), "--jobs", "2"]
    arguments += ["--unexamined", "--no-report", "--backend", "simd"]
    calm, wild = tmp_path / "calm", tmp_path / "wild"
    command = [sys.executable, "-m", "symphys", "solve", *arguments, "--quiet", "--out", str(calm)]
    subprocess.run(command, check=False)
    assert Watcher(calm).look() == runs, "an undisturbed batch is whole"
    watcher, killed, of_drivers, started = disturbed(arguments, wild, kills, drivers, pause, 0, runs)
    assert killed == kills and started >= drivers + of_drivers
    assert len(watcher.seen) == runs
    assert differences(calm, wild) == []
    assert watcher.again == set()
