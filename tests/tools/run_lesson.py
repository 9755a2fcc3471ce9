"""Run a lesson from top to bottom and compare its output: ``python tests/tools/run_lesson.py docs/lessons/PAGE.md``.

The page runs in an empty folder. ``--show`` prints the output of every block, ``--folder DIR`` keeps the files.

- ``toml`` whose first line is ``# NAME.toml``: written to that file. A later block of the same name replaces it.
- ``console``: a line that begins with ``$`` and a space is a command; what follows until the next one is its output.
  A command that ends with a backslash continues in the next line. Commands succeed, unless a line ``% exit code: 1`` is
  before the block.
- ``python``: the blocks run in order in one process. A ``text`` block directly after one is its output; without a
  ``text`` block it prints nothing.
- ``...`` within a line of output matches any text, and a line ``...`` any number of lines.
- Other blocks are not run.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from threading import Timer
from types import TracebackType

sys.path.insert(0, str(Path(__file__).parents[1]))

from tools import run_blocks
from tools.markdown_pages import ROOT, Block, blocks

SECONDS = 900.0
"""[s] A command or a block that takes longer is ended."""
COLUMNS = 100
ANY = "..."
NAMED = re.compile(r"# ([\w-]+\.toml)\n")
EXIT_CODE = re.compile(r"(?:% exit code: (\d+)|<!-- exit code: (\d+) -->)")
ESCAPE = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


@dataclass(frozen=True)
class Step:
    """One thing to be done.

    Attributes:
        kind: "file", "command" or "python".
        page: the lesson, relative to the checkout.
        line: of the page, where `text` begins.
        text: content of a file, command, or code.
        name: of a file.
        expected: lines of output.
        shown_at: line of the page, where `expected` begins.
        exit_code: of a command.
        block: line of the page, where its block begins.
    """

    kind: str
    page: str
    line: int
    text: str
    name: str = ""
    expected: tuple[str, ...] = ()
    shown_at: int = 0
    exit_code: int = 0
    block: int = 0


def file_name(block: Block) -> str | None:
    """The file that a TOML block is written to; None for a fragment."""
    found = NAMED.match(block.text) if block.language == "toml" else None
    return found[1] if found else None


def steps(text: str, page: str) -> list[Step]:
    """Return the steps of a lesson in their order."""
    found: list[Step] = []
    all_blocks = blocks(text, page)
    for k, block in enumerate(all_blocks):
        name = file_name(block)
        if name is not None:
            found.append(Step("file", page, block.line, block.text, name, block=block.line))
        elif block.language == "console":
            found += commands(block)
        elif block.language == "python":
            output = output_of(block, all_blocks[k + 1 : k + 2], text)
            lines = tuple(output.text.splitlines()) if output else ()
            at = output.line if output else block.line + len(block.text.splitlines())
            found.append(Step("python", page, block.line, block.text, "", lines, at, 0, block.line))
    return found


def output_of(block: Block, following: Sequence[Block], text: str) -> Block | None:
    """The ``text`` block directly after a block of Python."""
    if not following or following[0].language != "text":
        return None
    end = block.line + len(block.text.splitlines())  # the line of the closing fence, from 1
    between = text.splitlines()[end : following[0].line - 2]
    return None if any(line.strip() for line in between) else following[0]


def commands(block: Block) -> list[Step]:
    """Return the commands of a console block, each with its output."""
    code = EXIT_CODE.fullmatch(block.note)
    exit_code = int(code[1] or code[2]) if code else 0
    lines = block.text.splitlines()
    starts = [k for k, line in enumerate(lines) if line.startswith("$ ")]
    if not starts or any(line.strip() for line in lines[: starts[0]]):
        raise ValueError(f'{block.place}: a console block of a lesson begins with "$ " and a command')
    found = []
    for start, end in zip(starts, [*starts[1:], len(lines)], strict=True):
        after = start
        while lines[after].endswith("\\") and after + 1 < end:
            after += 1
        command = "\n".join(lines[start : after + 1])[2:]
        at = block.line + after + 1
        output = tuple(lines[after + 1 : end])
        found.append(Step("command", block.page, block.line + start, command, "", output, at, exit_code, block.line))
    return found


def stripped(lines: Sequence[str]) -> list[str]:
    """Lines without spaces at their ends, and without empty lines before the first and after the last."""
    return ["", *"\n".join(line.rstrip() for line in lines).strip("\n").splitlines()][1:]


def line_matches(expected: str, got: str) -> bool:
    """Whether a line is as expected, where ``...`` is any text."""
    return re.fullmatch(".*".join(re.escape(part) for part in expected.split(ANY)), got) is not None


def mismatch(expected: Sequence[str], got: Sequence[str]) -> tuple[int, int] | None:
    """Index of the first expected line that nothing matches, and of the line of output in its place; None for none.

    Expected lines are matched by `reached[k]`: the places in the output that the first k of them can end at.
    """
    places = {0}
    for k, line in enumerate(expected):
        if line.strip() == ANY:
            following = set(range(min(places), len(got) + 1))
        else:
            following = {j + 1 for j in places if j < len(got) and line_matches(line, got[j])}
        if not following:
            return k, min(places)
        places = following
    return None if len(got) in places else (len(expected), min(places))


def says_nothing(step: Step) -> bool:
    """Whether output is shown, but no word of it is compared."""
    return bool(step.expected) and not re.search(r"\w", "".join(step.expected))


def environment() -> dict[str, str]:
    """Variables of the processes: fixed width, no colours, no GPU, kernels that are waited for."""
    variables = {key: value for key, value in os.environ.items() if key not in ("FORCE_COLOR", "TTY_COMPATIBLE")}
    path = f"{Path(sys.executable).parent}{os.pathsep}{variables.get('PATH', '')}"
    fixed = {"PATH": path, "COLUMNS": str(COLUMNS), "LINES": "50", "NO_COLOR": "1", "TERM": "dumb", "MPLBACKEND": "agg"}
    defaults = {"SYMPHYS_CACHE": str(ROOT / "build" / "kernels"), "SYMPHYS_WAIT": "1", "SYMPHYS_CFLAGS": "-Og"}
    return defaults | variables | fixed | {"CUDA_VISIBLE_DEVICES": "", "PYTHONIOENCODING": "utf-8"}


class Python:
    """A process that runs the Python blocks of a lesson."""

    def __init__(self, folder: Path) -> None:
        """Start it in a folder."""
        self.process = subprocess.Popen(
            [sys.executable, run_blocks.__file__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            cwd=folder,
            env=environment(),
            encoding="utf-8",
        )

    def __enter__(self) -> Python:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """End it."""
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.close()
        self.process.wait()
        self.process.stdout.close()

    def run(self, step: Step) -> tuple[int, list[str]]:
        """Run one block; return 0, or the exit code of a process that has ended, and the output."""
        assert self.process.stdin is not None and self.process.stdout is not None
        watchdog = Timer(SECONDS, self.process.kill)
        watchdog.start()
        try:
            self.process.stdin.write(json.dumps([step.page, step.line, step.text]) + "\n")
            self.process.stdin.flush()
            lines = []
            for line in self.process.stdout:
                if line.rstrip("\n") == run_blocks.END:
                    return 0, lines
                lines.append(ESCAPE.sub("", line.rstrip("\n")))
        finally:
            watchdog.cancel()
        return self.process.wait() or 1, lines


def run_command(step: Step, folder: Path) -> tuple[int, list[str]]:
    """Run a command in a shell; return its exit code and its output."""
    done = subprocess.run(
        step.text,
        shell=True,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        cwd=folder,
        env=environment(),
        encoding="utf-8",
        timeout=SECONDS,
        check=False,
    )
    return done.returncode, [ESCAPE.sub("", line) for line in done.stdout.splitlines()]


def fault(step: Step, exit_code: int, got: Sequence[str]) -> str | None:
    """A message that shows where the output differs from the page; None where it agrees."""
    expected, output = [line.rstrip() for line in step.expected], stripped(got)
    shift = next((k for k, line in enumerate(expected) if line), 0)
    at = mismatch(stripped(expected), output)
    title = f"{step.page}:{step.line}: {step.text.strip().splitlines()[0]}"
    whole = "\n".join(f"    | {line}" for line in output)
    if at is not None:
        wanted = [*stripped(expected), "the end of the output"][at[0]]
        found = [*output, "the end of the output"][at[1]]
        place = f"{step.page}:{step.shown_at + shift + at[0]}"
        hint = " or a later line" if at[0] and stripped(expected)[at[0] - 1].strip() == ANY else ""
        return f"{title}\n  {place}\n  expected: {wanted}\n  got{hint}: {found}\n  whole output:\n{whole}"
    if exit_code != step.exit_code:
        return f"{title}\n  exit code {exit_code}, expected {step.exit_code}\n  whole output:\n{whole}"
    return None


def run(page: str, folder: Path, show: Callable[[str], object] | None = None) -> list[str]:
    """Run a lesson in an empty folder; return a message for each step whose output differs.

    A failing block of Python ends it, since later blocks need its names.
    """
    faults: list[str] = []
    with ExitStack() as stack:
        python: Python | None = None
        for step in steps((ROOT / page).read_text(encoding="utf-8"), page):
            if step.kind == "file":
                (folder / step.name).write_text(step.text, encoding="utf-8")
                continue
            if step.kind == "python":
                python = python or stack.enter_context(Python(folder))
                exit_code, got = python.run(step)
            else:
                exit_code, got = run_command(step, folder)
            if show:
                show(f"{page}:{step.line}\n$ {step.text.rstrip()}\n" + "\n".join(stripped(got)) + "\n")
            found = fault(step, exit_code, got)
            faults += [found] if found else []
            if step.kind == "python" and exit_code:
                break
    return faults


def main() -> int:
    """Run the lessons of the command line."""
    parser = argparse.ArgumentParser(description="Run lessons and compare their output.")
    parser.add_argument("pages", nargs="+", type=Path)
    parser.add_argument("--show", action="store_true", help="print the output of every block")
    parser.add_argument("--folder", type=Path, help="run in this folder and keep it")
    options = parser.parse_args()
    failed = 0
    for path in options.pages:
        page = str(path.resolve().relative_to(ROOT))
        with tempfile.TemporaryDirectory() as temporary:
            folder = options.folder or Path(temporary)
            folder.mkdir(parents=True, exist_ok=True)
            faults = run(page, folder, print if options.show else None)
        print("\n\n".join(faults) if faults else f"{page}: output is as shown")
        failed += bool(faults)
    return min(failed, 1)


if __name__ == "__main__":
    sys.exit(main())
