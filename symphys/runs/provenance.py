"""Where a run comes from: versions, machine, process and working copy, as result.json records them."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
import sysconfig
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from symphys.version import __version__

PACKAGES = ("casadi", "numpy", "scipy", "cma")
"""Whose versions decide the last digits of a result."""
PATIENCE = 2.0
"""[s] that git may take for an answer; without one the commit is not known."""


def provenance() -> dict[str, Any]:
    """The machine, this process and the working copy; what is not known is left out.

    Keys: "host", "processor", "python_platform" (that Python is built for), "pid", "peak_memory" [bytes] of this
    process so far, "commit" of the working folder where it is in a git repository, "dirty", whether tracked files
    differ from it.
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
    except (OSError, StopIteration, ValueError, IndexError):
        pass
    try:
        import resource
    except ImportError:  # Windows
        return None
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(most) if sys.platform == "darwin" else int(most) * 1024


@cache
def working_copy() -> dict[str, Any]:
    """The "commit" of the folder in which this process works, and whether it is "dirty"; asked once per process.

    Empty without git or outside a repository. ``dirty`` is left out where git does not answer in time.
    """
    commit = git("rev-parse", "--verify", "HEAD")
    if not commit:
        return {}
    changed = git("status", "--porcelain", "--untracked-files=no")
    return {"commit": commit} if changed is None else {"commit": commit, "dirty": bool(changed)}


def git(*arguments: str) -> str | None:
    """What git answers in the working folder, where it takes no locks and starts no helpers; None if it does not."""
    return answer("git", "-c", "core.fsmonitor=false", "--no-optional-locks", *arguments)


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
