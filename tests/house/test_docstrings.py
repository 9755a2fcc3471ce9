"""Docstrings speak of what is there: names of code in double backticks exist."""

from __future__ import annotations

import ast
import builtins
import re
from dataclasses import dataclass

from house.test_source import ROOT, project_files

NAMED = re.compile(r"(?=\w*[a-z])(?:[A-Z]\w*[a-z]\w*|[a-z]\w*_\w+)")
"""Words that look like names of code: with a capital or an underscore."""
FOREIGN = {"DiagonalDecoding": "a class of pycma", "knee_joint": "an example of a name"}


@dataclass(frozen=True)
class Source:
    """The docstrings of a file, with their first lines, and all words that are in none of them."""

    docstrings: tuple[tuple[int, str], ...]
    words: frozenset[str]


def read(text: str) -> Source:
    """A docstring is any string that is a statement."""
    lines, found = text.splitlines(), list[tuple[int, str]]()
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.Expr(value=ast.Constant(value=str(string)), lineno=first, end_lineno=int(last)):
                found.append((first, string))
                lines[first - 1 : last] = [""] * (last - first + 1)
    return Source(tuple(found), frozenset(re.findall(r"\w+", "\n".join(lines))))


def test_names_in_docstrings_exist() -> None:
    paths = [path for path in project_files() if path.relative_to(ROOT).parts[0] in ("symphys", "solvers", "problems")]
    texts = {path: path.read_text(encoding="utf-8", errors="replace") for path in paths}
    sources = {path: read(text) for path, text in texts.items() if path.suffix == ".py"}
    known = set(dir(builtins)) | FOREIGN.keys()
    for path, text in texts.items():
        known |= {*path.relative_to(ROOT).parts, path.stem}
        known |= sources[path].words if path in sources else set(re.findall(r"\w+", text))
    stale = [
        f"{path.relative_to(ROOT)}:{line}: {name}"
        for path, source in sources.items()
        for line, docstring in source.docstrings
        for code in re.findall(r"``([^`]+)``", docstring)
        for name in re.findall(r"[A-Za-z_]\w+", code)
        if NAMED.fullmatch(name) and name not in known
    ]
    assert stale == []
