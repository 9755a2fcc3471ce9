"""Documents name what exists."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
MOST_TERMS = 60


def entries() -> list[tuple[str, str, str]]:
    """(term, meaning, where) of the glossary."""
    lines = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8").splitlines()
    rows = [line.strip("|").split("|") for line in lines if line.startswith("| ")][1:]
    return [(term.strip(), meaning.strip(), where.strip()) for term, meaning, where in rows]


def test_the_glossary_is_short_sorted_and_one_fact_a_sentence() -> None:
    terms = [term.casefold() for term, _, _ in entries()]
    assert len(terms) <= MOST_TERMS
    assert terms == sorted(set(terms))
    assert [term for term, meaning, _ in entries() if not meaning.endswith(".")] == []


def test_every_term_lives_where_the_glossary_says() -> None:
    missing = [
        (term, path)
        for term, _, where in entries()
        for path in re.findall(r"`([^`]+)`", where)
        if not (ROOT / path).exists()
    ]
    assert missing == []
