"""Where a run comes from: versions, machine, process and working copy, as result.json records them."""

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
"""Whose versions decide the last digits of a result."""
PATIENCE = 2.0
"""[s] that a program of the system may take for an answer."""
COMMIT = re.compile("[0-9a-f]{40}|[0-9a-f]{64}")
MOST_LINKS = 5
"""References that lead from one to the next."""
MOST_LINE, MOST_PACKED = 4096, 64 * 2**20
"""[bytes] of a file that holds one line, and of one that holds all references."""


def provenance() -> dict[str, Any]:
    """The machine, this process and the working copy; what is not known is left out.

    Keys: "host", "processor", "python_platform" (that Python is built for), "pid", "peak_memory" [bytes] of this
    process so far, "commit" of the working folder where it is in a git repository. Whether files differ from the
    commit is not known: see ``working_copy``.
    """
    found = {**machine(), "pid": os.getpid(), "peak_memory": peak_memory(), **working_copy()}
    return {key: value for key, value in found.items() if value not in ("", None)}


@cache
def versions() -> dict[str, str]:
    """Of everything that takes part, and the platform; packages that are not installed are left out."""
    found = {"symphys": __version__, "python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return {**found, "platform": f"{platform.system()} {platform.machine()}"}


@cache
def machine() -> dict[str, str]:
    """The "host", its "processor" and the "python_platform"; empty texts for what is not known."""
    return {"host": platform.node(), "processor": processor_name(), "python_platform": sysconfig.get_platform()}


def processor_name() -> str:
    """As the maker calls it; empty where the system does not say."""
    if sys.platform == "darwin":
        return answer("sysctl", "-n", "machdep.cpu.brand_string") or platform.processor()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return platform.processor()
    named = (line.partition(":")[2] for line in lines if line.lower().startswith("model name"))
    return " ".join(next(named, "").split()) or platform.processor()


def peak_memory() -> int | None:
    """[bytes] The most memory that this process has held so far; None where the system does not say.

    Linux says it in /proc. There ``getrusage`` counts that of the process that started this one, too.
    """
    try:
        lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
        return next(int(line.split()[1]) * 1024 for line in lines if line.startswith("VmHWM:"))
    except (OSError, StopIteration):  # no Linux, or one whose /proc does not say it
        pass
    try:
        import resource
    except ImportError:  # Windows
        return None
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(most) if sys.platform == "darwin" else int(most) * 1024


@cache
def working_copy() -> dict[str, Any]:
    """The "commit" of the folder in which this process works; read once per process, empty outside a git repository.

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
    """The commit that is checked out; empty where there is none yet, or where it is not written in files like these."""
    if not git.is_dir():  # of a worktree or a submodule: a file that names the folder
        git = git.parent / named_in(git, "gitdir:")
    common = git / (line_of(git / "commondir") or ".")
    value = line_of(git / "HEAD")
    for _ in range(MOST_LINKS):
        if not value.startswith("ref:"):
            break
        name = value.removeprefix("ref:").strip()
        if name.startswith("/") or ".." in name:
            return ""
        value = line_of(git / name) or line_of(common / name) or packed(common / "packed-refs", name)
    return value if COMMIT.fullmatch(value) else ""


def named_in(path: Path, key: str) -> str:
    """What follows a word at the beginning of a file; empty if there is no such file."""
    line = line_of(path)
    return line.removeprefix(key).strip() if line.startswith(key) else ""


def packed(path: Path, name: str) -> str:
    """The commit of a reference in a list of many; empty if it is not there."""
    rows = (line.split() for line in read(path, MOST_PACKED).splitlines())
    return next((row[0] for row in rows if len(row) == 2 and row[1] == name), "")


def line_of(path: Path) -> str:
    """The text of a short file without spaces around it; empty if there is none."""
    return read(path, MOST_LINE).strip()


def read(path: Path, most: int) -> str:
    """The text of a regular file of so many bytes at most; empty if there is none.

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
    """What a program prints; None if it is not there, fails, or takes longer than PATIENCE. Never raises."""
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
            timeout=PATIENCE,
            check=False,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip() if done.returncode == 0 else None
