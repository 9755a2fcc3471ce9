"""The provenance of a run: versions, machine, process and working copy, as result.json records them."""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
import sys
import sysconfig
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from symphys import files
from symphys.version import __version__

PACKAGES = ("casadi", "numpy", "scipy", "cma")
"""Packages whose versions decide the last digits of a result."""
ANSWER_TIMEOUT = 2.0
"""[s] after which a program of the system is not waited for any more."""
COMMIT_PATTERN = re.compile("[0-9a-f]{40}|[0-9a-f]{64}")
MAX_LINKS = 5
"""Symbolic references that are followed."""
MAX_LINE_BYTES, MAX_PACKED_BYTES = 4096, 64 * 2**20
"""[bytes] Largest file with one line, and with all references."""


def provenance() -> dict[str, Any]:
    """Return machine, process and working copy as a table; unknown entries are left out.

    Keys: "host", "processor", "python_platform" (the target of this Python), "pid", "peak_memory" [bytes] of this
    process so far, "commit" of the working folder where it is in a git repository. Whether files differ from the
    commit is not known: see ``working_copy``.
    """
    found = {**machine(), "pid": os.getpid(), "peak_memory": peak_memory(), **working_copy()}
    return {key: value for key, value in found.items() if value not in ("", None)}


@cache
def versions() -> dict[str, str]:
    """Return the versions of all packages that take part, and the platform; packages that are missing are left out."""
    found = {"symphys": __version__, "python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return {**found, "platform": f"{platform.system()} {platform.machine()}"}


@cache
def machine() -> dict[str, str]:
    """Return "host", "processor" and "python_platform"; empty texts for unknown ones."""
    return {"host": platform.node(), "processor": processor_name(), "python_platform": sysconfig.get_platform()}


def processor_name() -> str:
    """Return the maker's name of the processor; empty where the system does not know it."""
    if sys.platform == "darwin":
        return answer("sysctl", "-n", "machdep.cpu.brand_string") or platform.processor()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return platform.processor()
    named = (line.partition(":")[2] for line in lines if line.lower().startswith("model name"))
    return " ".join(next(named, "").split()) or platform.processor()


def peak_memory() -> int | None:
    """Return the largest memory [bytes] that this process has held so far; None where the system does not know it.

    On Linux it is read from /proc, since ``getrusage`` includes the memory of the parent process.
    """
    try:
        lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
        return next(int(line.split()[1]) * 1024 for line in lines if line.startswith("VmHWM:"))
    except (OSError, StopIteration):  # not Linux, or /proc has no such line
        pass
    try:
        import resource
    except ImportError:  # Windows
        return None
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(most) if sys.platform == "darwin" else int(most) * 1024


@cache
def working_copy() -> dict[str, Any]:
    """Return the "commit" of the working folder, read once per process; empty outside a git repository.

    The files of the repository are read, and git is not asked: what is in a folder may name programs in its
    ``.git/config`` that git runs as soon as it looks for changes (filters, hooks, fsmonitor).
    """
    try:
        here = Path.cwd()
        git = next((folder / ".git" for folder in (here, *here.parents) if (folder / ".git").exists()), None)
        commit = commit_of(git) if git else ""
    except OSError:  # a folder that is gone, or may not be looked into: its commit is not known
        return {}
    return {"commit": commit} if commit else {}


def commit_of(git: Path) -> str:
    """Return the commit that is checked out; empty if there is none, or if it is stored in an unknown way."""
    if not git.is_dir():  # of a worktree or a submodule: a file that names the folder
        line = line_of(git)
        git = git.parent / (line.removeprefix("gitdir:").strip() if line.startswith("gitdir:") else "")
    common = git / (line_of(git / "commondir") or ".")
    value = line_of(git / "HEAD")
    for _ in range(MAX_LINKS):
        if not value.startswith("ref:"):
            break
        name = value.removeprefix("ref:").strip()
        if name.startswith("/") or ".." in name:
            return ""
        value = line_of(git / name) or line_of(common / name) or packed(common / "packed-refs", name)
    return value if COMMIT_PATTERN.fullmatch(value) else ""


def packed(path: Path, name: str) -> str:
    """Return the commit of a reference in packed-refs; empty if it is not there."""
    rows = (line.split() for line in read(path, MAX_PACKED_BYTES).splitlines())
    return next((row[0] for row in rows if len(row) == 2 and row[1] == name), "")


def line_of(path: Path) -> str:
    """Return the stripped text of a short file; empty if there is none."""
    return read(path, MAX_LINE_BYTES).strip()


def read(path: Path, most: int) -> str:
    """Return the text of a regular file of at most ``most`` bytes; empty if there is none.

    Most of the files that are looked for are missing, as each reference is kept in one of three places.
    """
    try:
        files.check_regular(path)
        with path.open("rb") as file:
            content = file.read(most + 1)
    except (OSError, ValueError):  # ValueError: the path, read from another file, has a null character
        return ""
    return content.decode(errors="replace") if len(content) <= most else ""


def answer(program: str, *arguments: str) -> str | None:
    """Return the output of a program; None if it is missing, fails, or exceeds ANSWER_TIMEOUT. Never raises."""
    path = shutil.which(program)
    if path is None:
        return None
    try:
        done = subprocess.run(
            [path, *arguments],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=ANSWER_TIMEOUT,
            check=False,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip() if done.returncode == 0 else None
