"""The targets of the Makefile, those of its pattern rule for benchmarks among them."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]


@cache
def benchmarks() -> frozenset[str]:
    """Return ``bench-NAME`` of each module of ``benchmarks/`` that has rows."""
    files = (ROOT / "benchmarks").glob("*.py")
    return frozenset(f"bench-{file.stem}" for file in files if "\ndef rows(" in file.read_text(encoding="utf-8"))


@cache
def targets() -> frozenset[str]:
    """Return all targets."""
    heads = re.findall(r"^([a-z][a-z0-9 -]*):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    return benchmarks() | {target for head in heads for target in head.split()}
