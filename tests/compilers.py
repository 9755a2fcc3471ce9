"""Compilers that do as a script says, and processes that build with them."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import programs

BUILD = "import programs; from symphys.codegen import compile_program as c; print(c(programs.pendulum()).report.cached)"


def fake(folder: Path, script: str) -> str:
    """A compiler that knows its version and then does as the script says."""
    path = folder / "fakecc"
    path.write_text(f'#!/bin/sh\nif [ "$1" = --version ]; then echo fake 1.0; exit 0; fi\n{script}\n', "utf-8")
    path.chmod(0o755)
    return str(path)


def building(folder: Path, compiler: str) -> subprocess.Popen[str]:
    """A process that builds the pendulum with a compiler, into a cache in the folder."""
    environment = os.environ | {
        "CC": compiler,
        "SYMPHYS_CACHE": str(folder / "cache"),
        "PYTHONPATH": os.pathsep.join([str(Path(programs.__file__).parent), *sys.path]),
    }
    return subprocess.Popen(
        [sys.executable, "-c", BUILD], env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def wait_for(path: Path) -> None:
    """Until a file says something."""
    end = time.monotonic() + 30
    while not (path.exists() and path.read_text("utf-8").endswith("\n")):
        assert time.monotonic() < end
        time.sleep(0.05)


def assert_gone(started: Path) -> None:
    """Every process whose number is in the file ends soon."""
    end = time.monotonic() + 5
    while any(alive(int(number)) for number in started.read_text("utf-8").split()):
        assert time.monotonic() < end
        time.sleep(0.05)


def alive(number: int) -> bool:
    """Whether a process runs; one that nobody has waited for yet does not."""
    done = subprocess.run(["ps", "-o", "stat=", "-p", str(number)], capture_output=True, text=True, check=False)
    return bool(done.stdout.strip()) and not done.stdout.startswith("Z")
