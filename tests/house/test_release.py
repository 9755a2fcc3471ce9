"""What is released agrees with itself: versions, the changelog, the citation, and the description of the package."""

from __future__ import annotations

import importlib.util
import re
from itertools import pairwise
from pathlib import Path
from types import ModuleType

import pytest

import symphys

ROOT = Path(__file__).parents[2]
MAX_LINES = 200
"""Lines of the changelog."""


def module(name: str) -> ModuleType:
    """Return a script of the checkout as a module."""
    spec = importlib.util.spec_from_file_location(Path(name).stem, ROOT / name)
    assert spec is not None and spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


def test_versions_agree() -> None:
    assert module(".ci/release.py").version_faults() == []


def test_the_changelog_has_a_line_for_each_entry() -> None:
    """One that wraps is indented; no entry takes more than two lines."""
    lines = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").splitlines()
    assert len(lines) <= MAX_LINES
    assert [line for line, after in pairwise(lines) if line[:2] == after[:2] == "  "] == []


def test_the_citation_names_what_the_format_asks_for() -> None:
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    citation = dict(re.findall(r"^([\w-]+):[ ]*(.*)$", text, re.MULTILINE))
    assert {"cff-version", "message", "title", "authors"} <= citation.keys()
    assert citation["version"] == symphys.__version__


def test_links_of_the_description_lead_to_the_repository() -> None:
    """Without an address links are text and pictures are left out; absolute links and anchors stay."""
    description = module("setup.py").description
    text = "![A film](a/b.webp) [page](docs/x.md#y) [site](https://example.org) [here](#there)"
    assert description(text, "", "v1") == " page [site](https://example.org) [here](#there)"
    assert description(text, "https://example.org/o/r", "v1") == (
        "![A film](https://example.org/o/r/raw/v1/a/b.webp) [page](https://example.org/o/r/blob/v1/docs/x.md#y)"
        " [site](https://example.org) [here](#there)"
    )


def test_the_description_has_no_relative_link() -> None:
    setup = module("setup.py")
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    for address in ("", "https://example.org/o/r"):
        targets = re.findall(r"\]\(([^)]+)\)", setup.description(readme, address, "v1"))
        assert [target for target in targets if not target.startswith(("https://", "#"))] == []


def test_the_description_renders() -> None:
    markdown = pytest.importorskip("readme_renderer.markdown")
    setup = module("setup.py")
    page = markdown.render(setup.description((ROOT / "README.md").read_text(encoding="utf-8"), "", "v1"))
    assert page is not None and "<table>" in page and "<h1" in page
