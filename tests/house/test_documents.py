"""Documents name what exists."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest
from tools.makefile import benchmarks, targets

ROOT = Path(__file__).parents[2]
MADE = {"build/kernels"}
"""Paths that are made by running something."""
WRITTEN = {"api.md", "problem_reference.md"}
"""Pages of docs/ that a program writes."""
PAGES = sorted(path.name for path in (ROOT / "docs").glob("*.md") if path.name not in WRITTEN)
FOLDERS = ("lessons", "concepts")
"""Folders of docs/ whose pages their own index.md names."""
BELOW = sorted(str(path.relative_to(ROOT)) for name in FOLDERS for path in (ROOT / "docs" / name).glob("*.md"))
DOCUMENTS = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", *(f"docs/{page}" for page in PAGES), *BELOW]
FRONT_PAGE = "docs/index.md"


def entries() -> list[tuple[str, str]]:
    """(term, where) of the glossary."""
    lines = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8").splitlines()
    rows = [line.strip("|").split("|") for line in lines if line.startswith("| ")][1:]
    return [(term.strip(), where.strip()) for term, _, where in rows]


def test_the_glossary_is_sorted_and_has_each_term_once() -> None:
    terms = [term.casefold() for term, _ in entries()]
    assert terms == sorted(set(terms))


def test_every_term_lives_where_the_glossary_says() -> None:
    missing = [
        (term, path)
        for term, where in entries()
        for path in re.findall(r"`([^`]+)`", where)
        if not (ROOT / path).exists()
    ]
    assert missing == []


@pytest.mark.parametrize("name", DOCUMENTS)
def test_paths_that_documents_name_exist(name: str) -> None:
    """From the top, or below symphys/; with or without their ending."""
    text = (ROOT / name).read_text(encoding="utf-8")
    tops = {path.name for folder in (ROOT, ROOT / "symphys") for path in folder.iterdir() if path.is_dir()}
    named = {
        found for found in re.findall(r"`([a-z_]+(?:/[a-z_0-9]+)+)(?:\.py)?`", text) if found.split("/")[0] in tops
    }
    missing = [
        found
        for found in sorted(named - MADE)
        if not any((base / f"{found}{end}").exists() for base in (ROOT, ROOT / "symphys") for end in ("", ".py"))
    ]
    assert missing == []


def test_every_page_is_named_on_the_front_page() -> None:
    """With a link that people see; the contents beside it are tested with the site."""
    text = (ROOT / FRONT_PAGE).read_text(encoding="utf-8")
    assert [page for page in PAGES if page != "index.md" and f"({page})" not in text] == []


@pytest.mark.parametrize("folder", FOLDERS)
def test_every_page_of_a_folder_is_named_on_its_index(folder: str) -> None:
    """And the front page names that index."""
    index = (ROOT / "docs" / folder / "index.md").read_text(encoding="utf-8")
    names = [path.name for path in (ROOT / "docs" / folder).glob("*.md") if path.name != "index.md"]
    assert [name for name in sorted(names) if f"({name})" not in index] == []
    assert f"({folder}/index.md)" in (ROOT / FRONT_PAGE).read_text(encoding="utf-8")


@cache
def words_of_the_code() -> set[str]:
    """Every word in the files of the code, their names, and what libraries and formats are called."""
    rooms = [ROOT / room for room in ("symphys", "solvers", "problems", "tests", "benchmarks")]
    files = [file for room in rooms for file in room.rglob("*") if file.suffix in (".py", ".toml", ".c", ".h", ".js")]
    words = {file.stem for file in files} | {"casadi", "numpy", "py", "toml", "json", "md"}
    for file in files:
        words |= set(re.findall(r"\w+", file.read_text(encoding="utf-8")))
    return words


@pytest.mark.parametrize("name", DOCUMENTS)
def test_names_that_documents_name_are_those_of_the_code(name: str) -> None:
    """Of ``module.function`` and ``Class.attribute`` both."""
    text = (ROOT / name).read_text(encoding="utf-8")
    named = re.findall(r"`([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)+)`", text)
    assert [found for found in named if not words_of_the_code().issuperset(found.split("."))] == []


def test_results_name_every_benchmark_and_only_what_exists() -> None:
    """Targets of make, scripts and notes."""
    pages = sorted((ROOT / "docs" / "results").glob("*.md"))
    whole = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    made = set(re.findall(r"(?:`|^)make\s([a-z][\w-]*)", whole, re.MULTILINE))
    assert made - targets() == set()
    assert benchmarks() - made == set()
    named = set(re.findall(r"benchmarks/[\w./-]+\.(?:py|md)", whole))
    assert sorted(path for path in named if not (ROOT / path).exists()) == []


def test_the_index_of_results_links_to_every_page() -> None:
    """In its table; the table of contents is tested with the site."""
    folder = ROOT / "docs" / "results"
    linked = set(re.findall(r"\]\((\w+\.md)", (folder / "index.md").read_text(encoding="utf-8")))
    assert linked >= {page.name for page in folder.glob("*.md")} - {"index.md"}


def test_the_list_of_notes_has_each_note_in_a_line_of_its_own() -> None:
    """Notes lie beside the list, or in a folder that is named after the month until which they were measured."""
    folder = ROOT / "benchmarks" / "notes"
    lines = (folder / "README.md").read_text(encoding="utf-8").splitlines()
    rows = [re.fullmatch(r"\| \[[\w -]+\]\(([\w./-]+\.md)\) \| (\S.*) \|", line) for line in lines]
    notes = [note.relative_to(folder).as_posix() for note in folder.rglob("*.md")]
    assert sorted(row[1] for row in rows if row) == sorted(set(notes) - {"README.md"})


def test_links_of_notes_lead_to_files() -> None:
    for note in sorted((ROOT / "benchmarks" / "notes").rglob("*.md")):
        targets_of_links = re.findall(r"\]\(([^()#\s:]+)[^():]*\)", note.read_text(encoding="utf-8"))
        assert [target for target in targets_of_links if not (note.parent / target).exists()] == [], note.name
