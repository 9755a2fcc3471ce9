"""The drawings of the documents are what their scripts write: small, with texts as text, and used on a page."""

from __future__ import annotations

import json
import subprocess
import sys

from tools.markdown_pages import ROOT

FOLDER = ROOT / "docs" / "drawings"
MAX_BYTES = 30_000


def test_the_drawings_are_those_of_their_scripts() -> None:
    program = "import json, make; print(json.dumps(make.drawings()))"
    done = subprocess.run([sys.executable, "-c", program], cwd=FOLDER, capture_output=True, text=True, check=True)
    written = {file.name: file.read_text("utf-8") for file in FOLDER.glob("*.svg")}
    assert written == json.loads(done.stdout), "run docs/drawings/make.py"


def test_they_are_small_and_have_texts_and_titles() -> None:
    for file in sorted(FOLDER.glob("*.svg")):
        text = file.read_text("utf-8")
        assert len(text.encode()) <= MAX_BYTES, file.name
        assert "<title>" in text and "<text" in text, file.name


def test_each_is_shown_on_a_page() -> None:
    pages = "".join(page.read_text("utf-8") for page in (ROOT / "docs").rglob("*.md"))
    assert [file.name for file in sorted(FOLDER.glob("*.svg")) if f"drawings/{file.name})" not in pages] == []
