"""A batch whose processes are killed at random: is everything there, whole, equal, and nothing computed twice?

Several commands share a folder. Again and again a process of one of them, driver or worker, gets SIGKILL; a command
that has died is started again. A watcher notes when each result is first seen: one that is written again later was
computed after it was there. In the end the folder is compared with that of a batch that nobody disturbed.

    python benchmarks/killing.py --runs 400 --kills 100 --drivers 3
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

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
SOLVERS = ("cma", "gradient")
SAME = ("status", "objective", "costs", "outputs", "checks", "z", "iterations", "counts")
"""Fields of a result that do not depend on time or machine."""


@dataclass
class Watcher:
    """Looks at the results while they are written.

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
        """Note what is new or other; how many results there are."""
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
        """Start as many as there are too few."""
        self.running = [each for each in self.running if each.poll() is None]
        while len(self.running) < self.count:
            command = [sys.executable, "-m", "symphys", "solve", *self.arguments]
            quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
            self.running.append(subprocess.Popen(command, start_new_session=True, **quiet))
            self.started += 1

    def processes(self) -> list[int]:
        """Drivers and their workers; each command has a session of its own."""
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

    What was seen; how many kills there were, how many of them of drivers; how many commands were started.
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
    """What is missing in the second folder, or other than in the first."""
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
    """Whether two arrays agree to the bit."""
    return one.dtype == other.dtype and one.tobytes() == other.tobytes()


def main(given: list[str] | None = None) -> int:
    """Print what came of it; 0 if everything is as it should be."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, value in (("runs", 400), ("kills", 100), ("drivers", 3), ("jobs", 2), ("evaluations", 4000), ("seed", 0)):
        parser.add_argument(f"--{name}", type=int, default=value)
    parser.add_argument(
        "--step", type=float, default=0.001, help="seconds of a time step: the smaller, the longer runs take"
    )
    parser.add_argument("--pause", type=float, default=1.0, help="seconds between two kills, at least")
    parser.add_argument("--folder", type=Path, help="where the folders go; else a temporary one")
    asked = parser.parse_args(given)
    with tempfile.TemporaryDirectory(prefix="symphys-killing-") as temporary:
        folder = asked.folder or Path(temporary)
        problem = folder / "trial.toml"
        problem.write_text(
            PROBLEM.replace("EVALUATIONS", str(asked.evaluations)).replace("STEP", str(asked.step)), encoding="utf-8"
        )
        seeds = asked.runs // len(SOLVERS)
        arguments = [str(problem), "--solver", ",".join(SOLVERS), "--seeds", str(seeds), "--jobs", str(asked.jobs)]
        arguments += ["--unexamined", "--no-report", "--backend", "simd"]
        began = time.monotonic()
        subprocess.run(
            [sys.executable, "-m", "symphys", "solve", *arguments, "--quiet", "--out", str(folder / "calm")],
            check=False,
        )
        calm = time.monotonic() - began
        if Watcher(folder / "calm").look() < seeds * len(SOLVERS):
            print("an undisturbed batch is not whole either")
            return 1
        began = time.monotonic()
        watcher, killed, drivers, started = disturbed(
            arguments, folder / "wild", asked.kills, asked.drivers, asked.pause, asked.seed, seeds * len(SOLVERS)
        )
        wild = time.monotonic() - began
        missing = differences(folder / "calm", folder / "wild")
        claims = list((folder / "wild").glob("*/*/.*"))
    print(f"{len(watcher.seen)} of {seeds * len(SOLVERS)} results; undisturbed {calm:.0f} s, disturbed {wild:.0f} s")
    print(f"{killed} kills while runs were left, {drivers} of drivers, of which {started} were started")
    print(f"{len(missing)} differences, {len(watcher.again)} results written again, {len(claims)} hidden files left")
    for line in (*missing[:10], *map(str, sorted(watcher.again)[:10]), *map(str, claims[:10])):
        print(f"  {line}")
    whole = killed == asked.kills and len(watcher.seen) == seeds * len(SOLVERS)
    return 0 if whole and not missing and not watcher.again else 1


if __name__ == "__main__":
    sys.exit(main())
