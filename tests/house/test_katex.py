"""The site sets formulas with files of its own: a copy of KaTeX, with its licence, and no request to a network."""

from __future__ import annotations

import hashlib
import re

from tools.markdown_pages import ROOT

KATEX = ROOT / "docs" / "_static" / "katex"
OWN = {"VERSION.txt", "render.js"}


def test_the_copy_is_what_its_list_says() -> None:
    """VERSION.txt has the checksum of each file."""
    listed = dict(re.findall(r"^(\w{64})  (\S+)$", (KATEX / "VERSION.txt").read_text("utf-8"), re.MULTILINE))
    found = {
        hashlib.sha256(file.read_bytes()).hexdigest(): file.relative_to(KATEX).as_posix()
        for file in KATEX.rglob("*")
        if file.is_file() and file.name not in OWN
    }
    assert found == listed


def test_its_version_is_the_one_named() -> None:
    version = re.findall(r"^katex (\S+) ", (KATEX / "VERSION.txt").read_text("utf-8"))[0]
    assert f'version:"{version}"' in (KATEX / "katex.min.js").read_text("utf-8")


def test_its_licence_is_beside_it() -> None:
    assert "The MIT License" in (KATEX / "katex.LICENSE").read_text("utf-8")


def test_its_style_names_fonts_that_are_there() -> None:
    named = set(re.findall(r"url\(([^)]+)\)", (KATEX / "katex.min.css").read_text("utf-8")))
    assert named == {f"fonts/{font.name}" for font in (KATEX / "fonts").iterdir()}


def test_the_site_asks_no_network_for_formulas() -> None:
    settings = (ROOT / "docs" / "conf.py").read_text("utf-8")
    assert 'mathjax_path = "katex/katex.min.js"' in settings and "katex/render.js" in settings
