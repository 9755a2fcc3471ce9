"""Lessons show what their commands and their Python print; their notebooks run (see tests/tools/run_lesson.py)."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from itertools import groupby
from pathlib import Path
from types import ModuleType

import pytest
from tools.markdown_pages import ROOT, available, blocks, is_lesson, needs, pages
from tools.run_lesson import Step, environment, fault, file_name, mismatch, run, says_nothing, steps

LESSONS = [page for page in pages() if is_lesson(page)]
QUICK = "docs/lessons/1_throw.md"
MARKED = [pytest.param(page, marks=[] if page == QUICK else pytest.mark.slow, id=Path(page).stem) for page in LESSONS]


@cache
def text_of(page: str) -> str:
    return (ROOT / page).read_text(encoding="utf-8")


def skip_without_needs(page: str) -> None:
    missing = [name for name in needs(text_of(page)) if not available(name)]
    if missing:
        pytest.skip(f"{page} needs {', '.join(missing)}")


@pytest.mark.parametrize("page", MARKED)
def test_output_is_as_shown(page: str, tmp_path: Path) -> None:
    skip_without_needs(page)
    faults = run(page, tmp_path)
    assert faults == [], "\n\n".join(faults)


@cache
def maker() -> ModuleType:
    """The module that makes notebooks, which lies beside the lessons."""
    spec = spec_from_file_location("notebook", ROOT / "docs" / "lessons" / "notebook.py")
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("page", MARKED)
def test_the_notebook_runs(page: str, tmp_path: Path) -> None:
    """In an empty folder; its Python prints what the lesson shows, and its commands print no error."""
    pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    skip_without_needs(page)
    path, folder = tmp_path / "lesson.ipynb", tmp_path / "empty"
    maker().write(ROOT / page, path)
    folder.mkdir()
    done = subprocess.run(
        [sys.executable, str(ROOT / "tests" / "tools" / "run_notebook.py"), str(path)],
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
        env=environment()
        | {"IPYTHONDIR": str(tmp_path / "ipython"), "PYTHONWARNINGS": "error:symphys:DeprecationWarning"},
    )
    assert done.returncode == 0, done.stderr
    cells = ["".join(text for _, text in outputs) for outputs in json.loads(done.stdout.splitlines()[-1])]
    blocks_of_steps = [list(group) for _, group in groupby(steps(text_of(page), page), key=lambda step: step.block)]
    for block, output in zip(blocks_of_steps, cells, strict=True):
        if block[0].kind == "python":
            assert fault(block[0], 0, output.splitlines()) is None, fault(block[0], 0, output.splitlines())
        elif block[0].kind == "command" and not any(step.exit_code for step in block):
            assert not re.search(r"^(Error|Usage)\b|Traceback|not found", output, re.MULTILINE), output


def test_cells_of_a_notebook(tmp_path: Path) -> None:
    page = (
        "# Title\n\n% needs: compiler\n\nSee [solvers](../solvers.md#race) and [casadi](https://web.casadi.org).\n\n"
        "```sh\npip install .\n```\n\n```toml\n# a.toml\nx = 1\n```\n\n"
        "```console\n$ symphys solve a.toml \\\n  --set x={}\nout\n$ ls $HOME\n```\n\n"
        "![A picture](p.svg)\n\n```python\nprint(1)\n```\n\n```text\n1\n```\n\nThe end.\n\n```text\nkept\n```\n"
    )
    (tmp_path / "p.svg").write_text("<svg/>", encoding="utf-8")
    made = maker().notebook(page, tmp_path)
    cells = [(cell["cell_type"], "".join(cell["source"])) for cell in made["cells"]]
    assert cells == [
        ("markdown", "# Title\n\n\nSee solvers and [casadi](https://web.casadi.org).\n\n```sh\npip install .\n```"),
        ("markdown", maker().START),
        ("code", "%%writefile a.toml\n# a.toml\nx = 1"),
        ("code", "!symphys solve a.toml \\\n  --set x={{}}\n!ls $$HOME"),
        ("markdown", "![A picture](attachment:p.svg)"),
        ("code", "print(1)"),
        ("markdown", "The end.\n\n```text\nkept\n```"),
    ]
    assert made["cells"][4]["attachments"] == {"p.svg": {"image/svg+xml": "PHN2Zy8+"}}
    assert made["nbformat"] == 4 and len({cell["id"] for cell in made["cells"]}) == len(cells)
    assert all(cell["outputs"] == [] for cell in made["cells"] if cell["cell_type"] == "code")


@pytest.mark.parametrize("page", LESSONS)
def test_every_file_of_a_lesson_is_used(page: str) -> None:
    """By a later command, block of Python or file; a block of TOML that is not a file is a fragment."""
    found = steps(text_of(page), page)
    unused = [
        f"{step.page}:{step.line}: {step.name}"
        for k, step in enumerate(found)
        if step.kind == "file" and not any(Path(step.name).stem in later.text for later in found[k + 1 :])
    ]
    assert unused == []
    toml = [block for block in blocks(text_of(page), page) if block.language == "toml"]
    assert [block.place for block in toml if file_name(block) is None and block.whole is None] == []


@pytest.mark.parametrize("page", LESSONS)
def test_shown_output_is_compared(page: str) -> None:
    """Output of dots alone would match anything."""
    assert [f"{page}:{step.shown_at}" for step in steps(text_of(page), page) if says_nothing(step)] == []


def test_steps_of_a_page() -> None:
    page = (
        "```toml\n# a.toml\nx = 1\n```\n```toml\n[[body]]\n```\n```console\n$ one \\\n  two\nout\n\n$ three\n```\n"
        "```python\nprint(1)\n```\n\n```text\n1\n```\n```python\nx = 1\n```\nwords\n```text\nnot output\n```\n"
        "% exit code: 2\n```console\n$ four\n```\n"
    )
    assert steps(page, "p.md") == [
        Step("file", "p.md", 2, "# a.toml\nx = 1\n", "a.toml", block=2),
        Step("command", "p.md", 9, "one \\\n  two", "", ("out", ""), 11, 0, 9),
        Step("command", "p.md", 13, "three", "", (), 14, 0, 9),
        Step("python", "p.md", 16, "print(1)\n", "", ("1",), 20, 0, 16),
        Step("python", "p.md", 23, "x = 1\n", "", (), 24, 0, 23),
        Step("command", "p.md", 31, "four", "", (), 32, 2, 31),
    ]
    with pytest.raises(ValueError, match=r"p\.md:2"):
        steps("```console\nno command\n```\n", "p.md")


@pytest.mark.parametrize(
    ("expected", "got", "place"),
    [
        ([], [], None),
        (["a", "b"], ["a", "b"], None),
        (["a", "c"], ["a", "b"], (1, 1)),
        (["a"], ["a", "b"], (1, 1)),
        (["a", "b"], ["a"], (1, 1)),
        (["a ... s", "..."], ["a 0.25 s"], None),
        (["a ... s"], ["a 0.25 ms"], (0, 0)),
        (["..."], ["a", "b"], None),
        (["a", "...", "b"], ["a", "b"], None),
        (["a", "...", "b"], ["a", "x", "b", "y", "b"], None),
        (["a", "...", "b"], ["a", "x"], (2, 1)),
        (["x(...)+"], ["x(1)+"], None),
        (["x..."], ["y"], (0, 0)),
    ],
)
def test_lines_are_compared(expected: list[str], got: list[str], place: tuple[int, int] | None) -> None:
    assert mismatch(expected, got) == place


def test_a_fault_names_page_line_and_both_lines() -> None:
    step = Step("command", "p.md", 7, "run", "", ("a", "b  "), 8)
    assert fault(step, 0, ["a  ", "b", ""]) is None
    message = str(fault(step, 0, ["a", "c"]))
    assert re.search(r"p\.md:9\n +expected: b\n +got: c\n", message)
    assert "exit code 1, expected 0" in str(fault(step, 1, ["a", "b"]))
    assert says_nothing(Step("command", "p.md", 7, "run", "", ("...", "  ... ...")))
    assert not says_nothing(Step("command", "p.md", 7, "run", "", ("...", "solved ...")))


def test_a_lesson_runs_in_one_folder_and_one_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "```toml\n# a.toml\nx = 1\n```\n```console\n$ cat a.toml\n# a.toml\nx = 1\n```\n"
        "```python\nfrom pathlib import Path\nx = Path('a.toml').read_text()\nPath('b').write_text('b')\n```\n"
        "```console\n$ cat b; exit 1\n```\n"
        "```python\nprint(len(x))\n```\n```text\n15\n```\n```python\nprint(x.nothing)\n```\n```python\nprint(2)\n```\n",
        encoding="utf-8",
    )
    folder = tmp_path / "empty"
    folder.mkdir()
    monkeypatch.setattr("tools.run_lesson.ROOT", tmp_path)
    first, second = run("page.md", folder)
    assert "page.md:16: cat b; exit 1" in first and "got: b" in first
    assert "page.md:25: print(x.nothing)" in second and "AttributeError" in second
