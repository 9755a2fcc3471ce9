"""From text to a Python syntax tree of bounded size; every way in which that fails is a FormulaError."""

from __future__ import annotations

import ast
import warnings

from symphys.expression.errors import FormulaError
from symphys.suggest import quote

MAX_LENGTH = 10_000
MAX_NODES = 2_000
MAX_DEPTH = 100

REPLACEMENTS = {
    "\u00d7": "*",
    "\u00b7": "*",
    "\u00f7": "/",
    "\u2212": "-",
    "\u2013": "-",
    "\u00b2": "**2",
    "\u00b3": "**3",
    "\u03c0": "pi",
    "\u221a": "sqrt()",
}
"""Typographic characters that people paste, and what the language has instead."""
FORBIDDEN = "#\\\x00"


def flatten(text: str) -> str:
    """The text on one line, without spaces at its ends; FormulaError for a character that no formula has."""
    if len(text) > MAX_LENGTH:
        raise FormulaError(f"the formula has {len(text)} characters; {MAX_LENGTH} are allowed")
    line = "".join(" " if c in "\t\r\n" else c for c in text).strip(" ")
    if not line:
        raise FormulaError("the formula is empty")
    for c in line:
        if not " " <= c <= "~" or c in FORBIDDEN:
            instead = f"; write {REPLACEMENTS[c]}" if c in REPLACEMENTS else ""
            raise FormulaError(f"the character {c!r} is not allowed in the formula {quote(line)}{instead}")
    return line


def read(line: str) -> ast.expr:
    """The syntax tree of one line."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # the tokeniser warns of such things as 1if
            root = ast.parse(line, mode="eval").body
    except SyntaxError as error:
        raise FormulaError(f"cannot read the formula {quote(line)}: {syntax_fault(error)}") from None
    except (RecursionError, MemoryError):
        raise FormulaError(f"the formula {quote(line)} is nested too deep; {MAX_DEPTH} levels are allowed") from None
    except (ValueError, OverflowError, Warning) as error:
        raise FormulaError(f"cannot read the formula {quote(line)}: {error}") from None
    require_size(root, line)
    return root


def syntax_fault(error: SyntaxError) -> str:
    """The parser's message with the column, without Python's advice to programmers."""
    reason = (error.msg or "invalid syntax").split(". Perhaps")[0].split(";")[0]
    return f"{reason} at column {error.offset}" if error.offset else reason


def require_size(root: ast.expr, line: str) -> None:
    """FormulaError for a tree with too many nodes or levels; walks without recursion."""
    level: list[ast.AST] = [root]
    nodes = depth = 0
    while level:
        nodes, depth = nodes + len(level), depth + 1
        if nodes > MAX_NODES:
            raise FormulaError(f"the formula {quote(line)} is too long; {MAX_NODES} pieces are allowed")
        if depth > MAX_DEPTH:
            raise FormulaError(
                f"the formula {quote(line)} is nested too deep; {MAX_DEPTH} levels are allowed "
                "(write a long sum as sum([a, b, c]))"
            )
        level = [child for node in level for child in ast.iter_child_nodes(node) if isinstance(child, ast.expr)]
