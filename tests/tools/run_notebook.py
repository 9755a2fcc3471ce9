"""Run a notebook in the working directory: ``python run_notebook.py PATH``; print what its cells show, as JSON.

The list has an entry for each cell of code: the kinds of its outputs, and their text. A cell that fails ends it.
"""

from __future__ import annotations

import json
import sys
from typing import Any

import nbclient
import nbformat

SECONDS = 1800


def shown(output: dict[str, Any]) -> tuple[list[str], str]:
    """The kinds of an output, and its text."""
    data = output.get("data", {})
    return sorted(data), str(output.get("text") or data.get("text/plain", ""))


def main(path: str) -> None:
    """Run the notebook and print its outputs."""
    notebook = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(notebook, timeout=SECONDS, kernel_name="python3").execute()
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    print(json.dumps([[shown(output) for output in cell.outputs] for cell in cells]))


if __name__ == "__main__":
    main(sys.argv[1])
