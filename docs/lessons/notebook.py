"""Make a Jupyter notebook of a lesson: ``python docs/lessons/notebook.py 1_throw.md 1_throw.ipynb``.

- Blocks of TOML that name a file become cells that write it, commands become ``!command``, Python stays as it is.
- Shown output is left out, since a notebook makes its own.
- Pictures are embedded, and links within the site become plain text.

The site links each lesson to its notebook: ``docs/conf.py`` connects `write_notebooks` to ``builder-inited``.
"""

from __future__ import annotations

import base64
import json
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markdown_it import MarkdownIt

if TYPE_CHECKING:
    from sphinx.application import Sphinx

LESSONS = Path(__file__).parent
STATIC = "_static/lessons"
"""Folder of the notebooks in the site."""
NAMED = re.compile(r"# ([\w-]+\.toml)\n")
COMMENT = re.compile(r"^(?:%.*|<!--.*-->)\n", re.MULTILINE)
LINK = re.compile(r"(?<!!)\[([^\]]*)\]\((?!\w+://|mailto:)[^)]*\)")
PICTURE = re.compile(r"!\[([^\]]*)\]\((?!\w+://)([^)]*)\)")
KINDS = {".svg": "image/svg+xml", ".png": "image/png", ".webp": "image/webp"}
START = "*Run this notebook in an environment that has symphys.*"


def notebook(text: str, folder: Path) -> dict[str, Any]:
    """Return the notebook of a lesson, in version 4.5 of the format.

    Args:
        text: the lesson, in Markdown.
        folder: where its pictures are found.
    """
    lines = text.splitlines(keepends=True)
    cells: list[dict[str, Any]] = []
    end, after_python = 0, False
    for token in MarkdownIt("commonmark").parse(text):
        if token.type != "fence" or token.map is None or token.level:
            continue
        language = token.info.strip()
        between = "".join(lines[end : token.map[0]])
        is_output = after_python and language == "text" and not between.strip()
        code = "" if is_output else code_of(language, token.content)
        after_python = language == "python"
        if not code and not is_output:
            continue
        cells += [markdown_cell(between, folder)] if between.strip() else []
        cells += [code_cell(code)] if code else []
        end = token.map[1]
    rest = "".join(lines[end:])
    cells += [markdown_cell(rest, folder)] if rest.strip() else []
    cells.insert(1, markdown_cell(START, folder))
    for k, cell in enumerate(cells):
        cell["id"] = f"cell-{k:02d}"
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    metadata = {"kernelspec": kernel, "language_info": {"name": "python"}}
    return {"cells": cells, "metadata": metadata, "nbformat": 4, "nbformat_minor": 5}


def code_of(language: str, content: str) -> str:
    """Return the code of the cell that a block becomes; "" for a block that stays Markdown."""
    if language == "python":
        return content
    if language == "toml" and (name := NAMED.match(content)):
        return f"%%writefile {name[1]}\n{content}"
    return commands(content) if language == "console" else ""


def commands(content: str) -> str:
    """Return the commands of a block, without their output; IPython would replace `$` and braces."""
    found: list[str] = []
    continued = False
    for line in content.splitlines():
        if line.startswith("$ ") or continued:
            line = line if continued else f"!{line[2:]}"
            found.append(line.replace("$", "$$").replace("{", "{{").replace("}", "}}"))
            continued = line.endswith("\\")
    return "\n".join(found)


def code_cell(code: str) -> dict[str, Any]:
    """Return a cell that has not been run."""
    return {"cell_type": "code", "execution_count": None, "metadata": {}, "outputs": [], "source": sources(code)}


def markdown_cell(text: str, folder: Path) -> dict[str, Any]:
    """Return a cell of text with its pictures."""
    attachments: dict[str, dict[str, str]] = {}

    def embed(found: re.Match[str]) -> str:
        path = folder / found[2]
        attachments[path.name] = {KINDS[path.suffix]: base64.b64encode(path.read_bytes()).decode()}
        return f"![{found[1]}](attachment:{path.name})"

    shown = PICTURE.sub(embed, LINK.sub(r"\1", COMMENT.sub("", text)))
    cell = {"cell_type": "markdown", "metadata": {}, "source": sources(shown)}
    return cell | ({"attachments": attachments} if attachments else {})


def sources(text: str) -> list[str]:
    """Return the lines of a cell."""
    return text.strip("\n").splitlines(keepends=True)


def write(page: Path, path: Path) -> None:
    """Write the notebook of a lesson."""
    made = notebook(page.read_text(encoding="utf-8"), page.parent)
    path.write_text(json.dumps(made, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def write_notebooks(app: Sphinx) -> None:
    """Write the notebooks of all lessons into the static files of the site, and let each lesson link to its own."""
    if app.builder.format != "html":
        return
    folder = Path(app.outdir) / STATIC
    folder.mkdir(parents=True, exist_ok=True)
    for page in LESSONS.glob("[0-9]*.md"):
        write(page, folder / f"{page.stem}.ipynb")
    app.connect("source-read", add_link)


def add_link(app: Sphinx, name: str, source: list[str]) -> None:
    """Put a link to the notebook below the title of a lesson."""
    if re.match(r"lessons/[0-9]", name):
        stem = name.partition("/")[2]
        link = f'<p><a href="../{STATIC}/{stem}.ipynb" download>Download as a notebook</a></p>'
        source[0] = re.sub(r"^(# .*\n)", rf"\1{link}\n", source[0], count=1, flags=re.MULTILINE)


if __name__ == "__main__":
    write(Path(sys.argv[1]), Path(sys.argv[2]))
