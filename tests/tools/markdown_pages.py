"""The project's Markdown pages and the code blocks in them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from markdown_it import MarkdownIt

from symphys.codegen import KernelUnavailable
from symphys.codegen.toolchain.compiler import find_compiler

ROOT = Path(__file__).parents[2]
NEEDS = re.compile(r"^(?:% needs: (.*)|<!-- needs: (.*) -->)$", re.MULTILINE)
FRAGMENT = re.compile(r"(?:% fragment of: (\w+)|<!-- fragment of: (\w+) -->)")


@dataclass(frozen=True)
class Block:
    """A fenced block of code.

    Attributes:
        page: its page, relative to the checkout.
        line: of its first line of code, from 1.
        language: what follows the fence; "" for none; "{name}" for a directive of MyST.
        text: the code, with its end of line.
        note: the line before the fence.
    """

    page: str
    line: int
    language: str
    text: str
    note: str = ""

    @property
    def place(self) -> str:
        """Page and line, for messages."""
        return f"{self.page}:{self.line}"

    @property
    def whole(self) -> str | None:
        """The problem that a fragment belongs to: what its note names; None for what is no fragment."""
        found = FRAGMENT.fullmatch(self.note)
        return (found[1] or found[2]) if found else None


def pages() -> list[str]:
    """README.md, CONTRIBUTING.md, ARCHITECTURE.md and all below docs/, relative to the checkout."""
    tops = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "ARCHITECTURE.md")]
    return [str(path.relative_to(ROOT)) for path in [*tops, *sorted((ROOT / "docs").rglob("*.md"))]]


def needs(text: str) -> list[str]:
    """The packages that a page's Python needs: ``% needs: torch gymnasium`` on a line of its own."""
    return [name for found in NEEDS.finditer(text) for name in re.split(r"[,\s]+", found[1] or found[2])]


def available(need: str) -> bool:
    """Whether a package is installed; "compiler" is a C compiler."""
    if need != "compiler":
        return find_spec(need) is not None
    try:
        find_compiler()
    except KernelUnavailable:
        return False
    return True


def is_lesson(page: str) -> bool:
    """Whether a page is a lesson, which is run from top to bottom: ``docs/lessons/1_throw.md``."""
    return re.fullmatch(r"docs/lessons/\d.*\.md", page) is not None


def blocks(text: str, page: str) -> list[Block]:
    """The fenced blocks of a page in their order; an indented block of code has the language "indented"."""
    lines = text.splitlines()
    found = []
    for token in MarkdownIt("commonmark").parse(text):
        if token.type not in ("fence", "code_block") or token.map is None:
            continue
        first, fenced = token.map[0], token.type == "fence"
        language = (token.info.split() or [""])[0] if fenced else "indented"
        note = lines[first - 1].strip() if first else ""
        found.append(Block(page, first + 1 + fenced, language, token.content, note))
    return found


def of(language: str, found: Iterable[Block]) -> list[Block]:
    """Those in a language."""
    return [block for block in found if block.language == language]
