"""Compilers that do as a script says, and processes that build with them."""

from __future__ import annotations

import contextlib
import os
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

BUILD = """
from symphys.codegen import compile_program
from worlds.programs import pendulum
print(compile_program(pendulum()).report.cached)
"""


HANGS = "while kill -0 $PPID; do sleep 0.1; done"
"""The end of a script that hangs as long as the process lives that has called it."""


def fake(folder: Path, script: str) -> str:
    """A compiler that knows its version and then does as the script says."""
    path = folder / "fakecc"
    path.write_text(f'#!/bin/sh\nif [ "$1" = --version ]; then echo fake 1.0; exit 0; fi\n{script}\n', "utf-8")
    path.chmod(0o755)
    return str(path)


def logged(folder: Path, log: Path, gate: Path, real: Sequence[str]) -> str:
    """A PATH whose gcc logs the process that calls it and its arguments, waits for a gate, and does as the real one."""
    folder.mkdir()
    version = f'if [ "$1" = --version ]; then exec {shlex.join(real)} --version; fi\n'
    wait = f"n=0; while [ ! -e {gate} ] && [ $n -lt 90000 ]; do n=$((n + 1)); sleep 0.02; done\n"
    (folder / "gcc").write_text(
        f'#!/bin/sh\n{version}echo "$PPID $@" >> {log}\n{wait}exec {shlex.join(real)} "$@"\n', "utf-8"
    )
    (folder / "gcc").chmod(0o755)
    return f"{folder}{os.pathsep}{os.environ['PATH']}"


def waits(process: subprocess.Popen[str]) -> bool:
    """Whether a process has opened a lock."""
    opened = Path("/proc") / str(process.pid) / "fd"
    with contextlib.suppress(OSError):
        return any(each.readlink().suffix == ".lock" for each in opened.iterdir())
    return False


def building(folder: Path, compiler: str, code: str = BUILD, **places: str) -> subprocess.Popen[str]:
    """A process that builds the pendulum with a compiler, into a cache in the folder.

    ``compiler``: what CC names; empty: that of PATH. ``code``: what it runs. ``places``: of its environment.
    """
    environment = os.environ | {
        "CC": compiler,
        "SYMPHYS_CACHE": str(folder / "cache"),
        "PYTHONPATH": os.pathsep.join([str(Path(__file__).parents[1]), *sys.path]),
        **places,
    }
    command = [sys.executable, "-c", code]
    return subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
