"""Docstrings speak of what is there: names of code in double backticks exist."""

from __future__ import annotations

import ast
import builtins
import io
import re
import tokenize
from collections.abc import Iterator

from house.test_source import ROOT, project_files

NAMED = re.compile(r"(?=\w*[a-z])(?:[A-Z]\w*[a-z]\w*|[a-z]\w*_\w+)")
"""Words that look like names of code: with a capital or an underscore."""
FOREIGN = {"DiagonalDecoding": "a class of pycma", "knee_joint": "an example of a name"}


def docstrings(source: str) -> Iterator[tuple[int, int, str]]:
    """First and last line, and text, of every string that is a statement."""
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Expr(value=ast.Constant(value=str(text))):
                yield node.lineno, node.end_lineno or node.lineno, text


def words_of(source: str) -> Iterator[str]:
    """Of code and of texts in it, docstrings and comments apart."""
    lines = {line for first, last, _ in docstrings(source) for line in range(first, last + 1)}
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type != tokenize.COMMENT and token.start[0] not in lines:
            yield from re.findall(r"\w+", token.string)


def test_names_in_docstrings_exist() -> None:
    paths = [path for path in project_files() if path.relative_to(ROOT).parts[0] in ("symphys", "solvers", "problems")]
    texts = {path: path.read_text(encoding="utf-8", errors="replace") for path in paths}
    known = set(dir(builtins)) | FOREIGN.keys()
    for path, text in texts.items():
        known |= {*path.relative_to(ROOT).parts, path.stem}
        known |= set(words_of(text) if path.suffix == ".py" else re.findall(r"\w+", text))
    stale = [
        f"{path.relative_to(ROOT)}:{first}: {name}"
        for path, text in texts.items()
        if path.suffix == ".py"
        for first, _, doc in docstrings(text)
        for code in re.findall(r"``([^`]+)``", doc)
        for name in re.findall(r"[A-Za-z_]\w+", code)
        if NAMED.fullmatch(name) and name not in known
    ]
    assert stale == []
