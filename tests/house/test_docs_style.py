"""The documents keep to the language, the length and the contents that their readers need.

Each rule names the file and the line that break it. A rule that a page must break for a good reason is changed here.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from markdown_it import MarkdownIt
from tools.markdown_pages import ROOT

DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted(DOCS.rglob("*.md"))]
MAX_WORDS = 45_000
"""Words of all pages below docs/ but `GENERATED`; signs without a letter or digit, as bars of tables, are no words."""
GENERATED = "docs/problem_reference.md"
MIN_FORMULAS = {"docs/time_step.md": 10, "docs/contact.md": 3, "docs/joints.md": 3, "docs/concepts/contact.md": 3}
"""Least number of displayed or inline formulas of a page."""

TURNS = (
    r"in turns\b",
    r"\btold\b",
    r"\bas ever\b",
    r"\bearlier versions?\b",
    r"\ban earlier\b",
    r"\bon a quiet machine\b",
    r"\bwhat is (?:told|said|asked|left|heard)\b",
)
"""Turns of phrase that readers had to translate, as regular expressions; letters of either case."""
FIRST_WORDS = ("Of ", "What is told", "What is said")
"""Beginnings of sentences whose subject comes late, or is a clause."""
TITLES = {
    "alone",
    "bits",
    "heavy on light",
    "one rollout alone",
    "questions",
    "the arrow",
    "what is left",
    "what is not determined",
    "what is without effect",
    "where this comes from",
    "without a name",
}
"""Headings that are fragments, or that nobody would search for."""
QUESTION = re.compile(r"\?\W*$")


@cache
def prose(path: Path) -> tuple[tuple[int, str], ...]:
    """Return (line, text) of each paragraph, heading and table cell, with code replaced by a backtick pair."""
    tokens = MarkdownIt("commonmark").enable("table").parse(path.read_text(encoding="utf-8"))
    found = []
    line = 1
    for token in tokens:
        if token.map is not None:
            line = token.map[0] + 1
        if token.type != "inline":
            continue
        row = line
        for child in token.children or []:
            if child.type in ("softbreak", "hardbreak"):
                found.append((row, "\n"))
                row += 1
            elif child.type == "text":
                found.append((row, child.content))
            elif child.type == "code_inline":
                found.append((row, "``"))
        found.append((row, "\n\n"))
    return tuple(found)


def lines_of(path: Path) -> Iterator[tuple[int, str]]:
    """Yield (line, text without code) of a page."""
    texts: dict[int, str] = {}
    for line, text in prose(path):
        texts[line] = texts.get(line, "") + text.strip("\n")
    yield from sorted(texts.items())


def sentences(path: Path) -> Iterator[tuple[int, str]]:
    """Yield (line, sentence) of the prose of a page, headings left out."""
    line, collected, titles = 1, "", {row for row, _ in headings(path)}
    for row, text in prose(path):
        if row in titles:
            continue
        if not collected.strip():
            line = row
        if text == "\n\n":
            yield from ((line, part) for part in re.split(r"(?<=[.!?])\s+", collected.strip()) if part)
            collected = ""
        else:
            collected += " " if text == "\n" else text


def headings(path: Path) -> Iterator[tuple[int, str]]:
    """Yield (line, title) of the headings of a page."""
    tokens = MarkdownIt("commonmark").parse(path.read_text(encoding="utf-8"))
    for k, token in enumerate(tokens):
        if token.type == "heading_open" and token.map is not None:
            yield token.map[0] + 1, tokens[k + 1].content


def name(path: Path) -> str:
    """Return a page's path from the checkout."""
    return path.relative_to(ROOT).as_posix()


def words(text: str) -> int:
    """Count the words of a text."""
    return len([word for word in text.split() if re.search(r"\w", word)])


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_pages_have_no_banned_turns(path: Path) -> None:
    pattern = re.compile("|".join(TURNS), re.IGNORECASE)
    found = [f"{name(path)}:{line}: {hit[0]!r}" for line, text in lines_of(path) for hit in pattern.finditer(text)]
    assert found == []


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_sentences_begin_with_their_subject(path: Path) -> None:
    found = [
        f"{name(path)}:{line}: {sentence[:60]!r}"
        for line, sentence in sentences(path)
        if sentence.startswith(FIRST_WORDS) and not QUESTION.search(sentence) and words(sentence) > 4
    ]
    assert found == []


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_titles_name_what_a_person_would_search(path: Path) -> None:
    assert [f"{name(path)}:{line}: {title}" for line, title in headings(path) if title.casefold() in TITLES] == []


def test_the_documents_are_short() -> None:
    counts = {name(path): words(path.read_text(encoding="utf-8")) for path in sorted(DOCS.rglob("*.md"))}
    counts.pop(GENERATED)
    longest = sorted(counts, key=lambda page: -counts[page])[:8]
    text = ", ".join(f"{page} {counts[page]}" for page in longest)
    assert sum(counts.values()) <= MAX_WORDS, f"{sum(counts.values())} words; the longest pages: {text}"


@pytest.mark.parametrize("page", MIN_FORMULAS)
def test_the_theory_sets_its_equations(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    shown = len(re.findall(r"^\$\$.+?^\$\$|^```\{math\}|\\begin\{", text, re.MULTILINE | re.DOTALL))
    inline = len(re.findall(r"(?<![\\$])\$(?![\s$])[^$\n]+\$", text))
    assert shown + inline >= MIN_FORMULAS[page], f"{page}: {shown} displayed and {inline} inline formulas"


def test_the_gallery_names_every_problem_and_robot() -> None:
    text = (DOCS / "gallery.md").read_text(encoding="utf-8")
    files = [path.relative_to(ROOT / "problems") for path in (ROOT / "problems").rglob("*.toml")]
    named = {path: path.stem if len(path.parts) == 1 else path.as_posix() for path in files}
    assert [str(path) for path in sorted(files) if f"`{named[path]}`" not in text] == []
    problems = sum(len(path.parts) == 1 for path in files)
    assert f"ships with {problems} problems" in text, f"there are {problems} problems"


@cache
def texts_of_the_program() -> str:
    """Return every text in the code, one a line, with a gap where a value is put in."""
    found = []
    for file in [*(ROOT / "symphys").rglob("*.py"), *(ROOT / "solvers").rglob("*.py")]:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.append(node.value)
    return "\n".join(found)


def test_troubleshooting_quotes_what_the_program_prints() -> None:
    """Parts of a message between dots are texts of the program, so that a search for the message finds the page."""
    page = DOCS / "troubleshooting.md"
    tokens = MarkdownIt("commonmark").parse(page.read_text(encoding="utf-8"))
    missing = []
    for token in tokens:
        if token.type == "fence" and token.info == "text" and token.map is not None:
            for k, message in enumerate(token.content.splitlines()):
                parts = [part.strip(" :;,()") for part in message.split("...")]
                missing += [
                    f"{name(page)}:{token.map[0] + 2 + k}: {part!r}"
                    for part in parts
                    if part and part not in texts_of_the_program()
                ]
    assert missing == []


def test_rules_find_what_they_forbid(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("# Bits\n\nA is\ntold `told`. Of this one may say nothing more. Is it so?\n\n```\ntold\n```\n")
    pattern = re.compile("|".join(TURNS))
    assert [line for line, text in lines_of(page) if pattern.search(text)] == [4]
    assert [line for line, text in sentences(page) if text.startswith(FIRST_WORDS)] == [3]
    assert [title for _, title in headings(page)] == ["Bits"]
    assert words("| a | b-c | -- | `x` |") == 3
