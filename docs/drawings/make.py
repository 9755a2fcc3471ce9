"""Write the drawings of the documents: `python docs/drawings/make.py` (standard library only).

`theory.py` and `concepts.py` map file names to functions that return a `style.Drawing`, in a table `DRAWINGS`.
"""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))


def drawings() -> dict[str, str]:
    """Return the text of every drawing by the name of its file."""
    from importlib import import_module

    modules = [import_module(name) for name in ("theory", "concepts") if (HERE / f"{name}.py").exists()]
    return {f"{name}.svg": draw().svg() for module in modules for name, draw in module.DRAWINGS.items()}


if __name__ == "__main__":
    for name, text in drawings().items():
        (HERE / name).write_text(text, encoding="utf-8")
        print(f"{name}: {len(text) / 1000:.1f} kB")
