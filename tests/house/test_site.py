"""The site is whole: its reference is current, its pages are listed, its links lead somewhere."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from urllib.parse import unquote

import pytest
from markdown_it import MarkdownIt
from tools.markdown_pages import ROOT, pages

import symphys
from symphys.problem import reference_page
from symphys.solvers import SOLVERS

DOCS = ROOT / "docs"
INCLUDE = re.compile(r"^```\{include\} (\S+)$", re.MULTILINE)
ADDRESS = re.compile(r"\w+://|mailto:")


def test_the_reference_is_what_the_schema_says() -> None:
    written = (DOCS / "problem_reference.md").read_text(encoding="utf-8")
    current = reference_page({name: each.Options for name, each in SOLVERS.items()})
    assert written == current, "the schema or an option of a solver has changed: run `make reference`"


def test_every_public_name_is_in_the_reference_of_the_package() -> None:
    """As an entry of its own; a new name needs a line in docs/api.md."""
    text = (DOCS / "api.md").read_text(encoding="utf-8")
    entries = set(re.findall(r"^\.\. (?:auto|py:)\w+:: (?:symphys\.)?([\w.]+)(?:\(.*\))?$", text, re.MULTILINE))
    world = [f"model.{name}" for name in symphys.model.__all__]
    assert [name for name in [*dir(symphys), *world] if name not in entries] == []


def test_every_page_is_in_the_index() -> None:
    """Once, in a table of contents of its folder's index; what those name exists."""
    for index in sorted(DOCS.rglob("index.md")):
        tables = re.findall(r"^```\{toctree\}\n(.*?)^```", index.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
        lines = [line.strip() for table in tables for line in table.splitlines()]
        listed = [line for line in lines if line and not line.startswith(":")]
        here = {path.stem for path in index.parent.iterdir() if path.suffix in (".md", ".ipynb")} - {"index"}
        below = {f"{path.parent.name}/index" for path in index.parent.glob("*/index.md")}
        assert sorted(listed) == sorted(here | below), f"{index.relative_to(ROOT)} and its folder"


@cache
def anchors(path: Path) -> frozenset[str]:
    """The anchors of a page's headings, as code hosts and the site make them; those of included pages, too."""
    text = path.read_text(encoding="utf-8")
    tokens = MarkdownIt("commonmark").parse(text)
    titles = [tokens[k + 1].content for k, token in enumerate(tokens) if token.type == "heading_open"]
    plain = [re.sub(r"\[([^\]]*)\]\([^)]*\)|[*`]", r"\1", title) for title in titles]
    found = [re.sub(r"[^\w\- ]", "", title.lower()).strip().replace(" ", "-") for title in plain]
    numbered = [name if not (n := found[:k].count(name)) else f"{name}-{n}" for k, name in enumerate(found)]
    return frozenset(numbered).union(*(anchors(path.parent / name) for name in INCLUDE.findall(text)))


def links(page: str) -> list[str]:
    """What the links and pictures of a page lead to, addresses on the network aside."""
    tokens = MarkdownIt("commonmark").enable("table").parse((ROOT / page).read_text(encoding="utf-8"))
    inner = [child for token in tokens for child in token.children or []]
    targets = [str(token.attrs.get("href") or token.attrs.get("src") or "") for token in inner]
    return [unquote(target) for target in targets if target and not ADDRESS.match(target)]


@pytest.mark.parametrize("page", pages())
def test_links_lead_to_files_and_headings(page: str) -> None:
    broken = []
    for target in links(page):
        name, _, heading = target.partition("#")
        path = (ROOT / page).parent / name if name else ROOT / page
        if not path.exists() or (heading and path.suffix == ".md" and heading not in anchors(path)):
            broken.append(target)
    assert broken == []


def test_anchors_are_those_of_code_hosts(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("# A `b.c`, [d](e.md)\n\n## Twice\n\n## Twice\n\n```sh\n# no heading\n```\n", encoding="utf-8")
    assert anchors(page) == {"a-bc-d", "twice", "twice-1"}
