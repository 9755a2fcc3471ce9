"""Every block of code in the documents works as it stands there.

- ``python``: the blocks of a page run in order, in one namespace and one fresh process, in an empty folder. A page with
  a line ``% needs: torch compiler`` is skipped where a package, or a C compiler, is missing.
- ``toml``: a whole problem, or after a line ``% fragment of: NAME`` (``<!-- fragment of: NAME -->`` where comments of
  MyST would show) tables that are put into a shipped problem, or into ``croquet``, the problem of the first lesson.
- ``sh``: commands of symphys with options that exist, targets of the Makefile, and a few commands of the shell.
- ``json``: can be read. ``c``: was printed by the page's Python. ``console`` and ``text``: not run.

Lessons are run from top to bottom by test_lessons.py: their Python, their ``console``, and their ``toml`` that names a
file in its first line. Options of the commands in ``console`` are checked here too.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import click
import pytest
from tools import run_blocks
from tools.makefile import targets
from tools.markdown_pages import ROOT, Block, available, blocks, is_lesson, needs, of, pages
from tools.run_lesson import file_name, steps

import symphys
from symphys.cli.app import app
from symphys.problem import load_problem

RULED = {"python", "toml", "sh", "json", "c", "console", "text"}
DIRECTIVE = re.compile(r"\{(?!code|sourcecode)[a-z:-]+\}")
"""Any of MyST, whose build checks them, but those that would hide code from these tests."""
PLAIN_COMMANDS = {"pip", "apt-get", "cd", "git", "eval", "export", "python", "python3", ".venv/bin/python"}
LESSON_COMMANDS = {"cat", "cut", "grep", "head", "ls", "tail"}
"""Commands of a console block, beside those above."""
OPERATOR = re.compile(r"\s(?:\||>|<|&&|\|\|)\s.*", re.DOTALL)
SECONDS = 1800.0
CROQUET = "docs/lessons/1_throw.md"


@cache
def of_page(page: str) -> tuple[Block, ...]:
    return tuple(blocks((ROOT / page).read_text(encoding="utf-8"), page))


def pages_with(language: str) -> list[str]:
    return [page for page in pages() if of(language, of_page(page))]


@cache
def printed(page: str, folder: Path) -> list[str]:
    """What each Python block of a page prints, run in a folder."""
    code = "".join(json.dumps([block.page, block.line, block.text]) + "\n" for block in of("python", of_page(page)))
    done = subprocess.run(
        [sys.executable, run_blocks.__file__],
        input=code,
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
        timeout=SECONDS,
        env=os.environ | {"MPLBACKEND": "agg", "CUDA_VISIBLE_DEVICES": ""},
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split(f"{run_blocks.END}\n")[:-1]


def tables_of(block: Block) -> dict[str, Any]:
    """The tables of a problem file, or those of the problem that a fragment belongs to, with the fragment's."""
    tables = tomllib.loads(block.text)
    if block.whole is None:
        return tables
    return with_fragment(tomllib.loads(whole_problem(block.whole)), tables)


def whole_problem(name: str) -> str:
    """The text of the problem that fragments belong to."""
    if name != "croquet":
        return (ROOT / "problems" / f"{name}.toml").read_text(encoding="utf-8")
    return next(block.text for block in of("toml", of_page(CROQUET)) if file_name(block) == "croquet.toml")


def with_fragment(whole: dict[str, Any], fragment: dict[str, Any]) -> dict[str, Any]:
    """Keys of tables replace or add; tables in lists are added, or go into the one of their name."""
    merged = dict(whole)
    for key, value in fragment.items():
        if isinstance(value, dict):
            merged[key] = with_fragment(merged.get(key, {}), value)
        elif isinstance(value, list) and all(isinstance(item, dict) for item in value):
            merged[key] = with_tables(merged.get(key, []), value)
        else:
            merged[key] = value
    return merged


def with_tables(whole: list[dict[str, Any]], fragment: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The tables of both lists; those of one name, and pairs of the same two, become one."""
    merged = list(whole)
    for table in fragment:
        known = [each.get("name", each.get("between")) for each in merged]
        name = table.get("name", table.get("between"))
        if name is not None and name in known:
            merged[known.index(name)] = {**merged[known.index(name)], **table}
        else:
            merged.append(table)
    return merged


def commands(text: str) -> list[list[str]]:
    """The words of each line of a shell block, comments aside."""
    lines = text.replace("\\\n", " ").splitlines()
    return [words for line in lines if (words := shlex.split(line, comments=True))]


def fault_of(words: list[str]) -> str | None:
    """What is wrong with a command; None where it can be given."""
    if words[0] == "symphys":
        return usage_fault(words[1:])
    if words[0].rpartition("/")[2].startswith("python") and words[1:3] == ["-m", "symphys"]:
        return usage_fault(words[3:])
    if words[0] == "make":
        missing = [word for word in words[1:] if "=" not in word and word not in targets()]
        return f"the Makefile has no {missing[0]}" if missing else None
    return None if words[0] in PLAIN_COMMANDS else f"{words[0]} is no command that these tests know"


def usage_fault(arguments: list[str]) -> str | None:
    """What click says of the arguments of symphys; nothing is run, and files need not be there."""
    if not arguments or arguments[0].startswith("-"):
        return None if not arguments or arguments[0] in ("--version", "--help", "-h") else f"no option {arguments[0]}"
    context: click.Context = click.Context(app, info_name="symphys")
    command: click.Command = app
    try:
        while isinstance(command, click.Group) and arguments and arguments[0] not in ("--help", "-h"):
            name, found, arguments = command.resolve_command(context, arguments)
            assert found is not None and name is not None
            command, context = found, click.Context(found, info_name=name, parent=context)
        if not {"--help", "-h"} & set(arguments):
            command.make_context(context.info_name, arguments, parent=context.parent)
    except click.ClickException as error:
        return error.format_message()
    return None


@pytest.mark.parametrize("page", pages())
def test_every_block_has_a_language_with_a_rule(page: str) -> None:
    """An indented block has none: it would not be run."""
    unruled = [
        f"{block.place}: {block.language or 'no language'}"
        for block in of_page(page)
        if block.language not in RULED and not DIRECTIVE.fullmatch(block.language)
    ]
    assert unruled == [], f"a fence has one of {', '.join(sorted(RULED))}, or a directive"


def pages_run_here() -> list[str]:
    """Pages with Python that are not lessons."""
    return [page for page in pages_with("python") if not is_lesson(page)]


@pytest.mark.slow
@pytest.mark.parametrize("page", pages_run_here())
def test_python_runs_and_prints_what_is_shown_in_c(page: str, tmp_path: Path) -> None:
    missing = [name for name in needs((ROOT / page).read_text(encoding="utf-8")) if not available(name)]
    if missing:
        pytest.skip(f"{page} needs {', '.join(missing)}")
    output = unspaced("".join(printed(page, tmp_path)))
    assert [block.place for block in of("c", of_page(page)) if unspaced(block.text) not in output] == []


def unspaced(text: str) -> str:
    """A text without spaces at the ends of lines and of itself."""
    return "\n".join(line.rstrip() for line in text.strip().splitlines())


def test_c_is_on_pages_with_python() -> None:
    """Elsewhere nothing would print it."""
    assert [page for page in pages_with("c") if page not in pages_run_here()] == []


@pytest.mark.slow
@pytest.mark.parametrize("page", pages_with("toml"))
def test_toml_loads(page: str, tmp_path: Path) -> None:
    for block in of("toml", of_page(page)):
        if is_lesson(page) and file_name(block) is not None:
            continue
        try:
            tables = tables_of(block)
            if block.whole is None:
                (tmp_path / "problem.toml").write_text(block.text, encoding="utf-8")
                load_problem(tmp_path / "problem.toml")
            else:
                symphys.load(tables)
        except (tomllib.TOMLDecodeError, symphys.SymphysError, FileNotFoundError) as error:
            pytest.fail(f"{block.place}: {error}")


@pytest.mark.parametrize("page", pages_with("sh"))
def test_commands_can_be_given(page: str) -> None:
    faults = [
        f"{block.place}: {shlex.join(words)}: {fault}"
        for block in of("sh", of_page(page))
        for words in commands(block.text)
        if (fault := fault_of(words))
    ]
    assert faults == []


@pytest.mark.parametrize("page", [page for page in pages_with("console") if is_lesson(page)])
def test_commands_of_lessons_can_be_given(page: str) -> None:
    """What follows a pipe is left to the run of the lesson."""
    given = [step for step in steps((ROOT / page).read_text(encoding="utf-8"), page) if step.kind == "command"]
    faults = [
        f"{page}:{step.line}: {shlex.join(words)}: {fault}"
        for step in given
        for words in commands(OPERATOR.sub("", step.text))
        if words[0] not in LESSON_COMMANDS and (fault := fault_of(words))
    ]
    assert faults == []


def test_json_can_be_read() -> None:
    for page in pages_with("json"):
        for block in of("json", of_page(page)):
            json.loads(block.text)


def test_text_is_no_command() -> None:
    """Commands are in sh, where they are looked at."""
    shown = [block for page in pages() for block in of("text", of_page(page))]
    assert [block.place for block in shown if re.search(r"^(symphys|make|pip) ", block.text, re.MULTILINE)] == []


def test_faults_in_blocks_are_found(tmp_path: Path) -> None:
    """The rules refuse what is wrong."""
    assert fault_of(["symphys", "solve", "my.toml", "--set", "a.b=1", "--out", "x"]) is None
    assert "--sets" in str(fault_of(["symphys", "solve", "my.toml", "--sets", "1"]))
    assert "solv" in str(fault_of(["symphys", "solv", "my.toml"]))
    assert "solv" in str(fault_of([".venv/bin/python", "-m", "symphys", "solv", "my.toml"]))
    assert "many" in str(fault_of(["symphys", "solve", "my.toml", "--seeds", "many"]))
    assert "Missing argument" in str(fault_of(["symphys", "solve"]))
    assert fault_of(["make", "test", "ARGS=-x"]) is None
    assert fault_of(["make", "tests"]) == "the Makefile has no tests"
    assert "no command" in str(fault_of(["sudo", "make"]))
    text = (
        "% fragment of: croquet\n```toml\n[simulation]\n```\n\n    code\n\n```\n```\n- a\n  ```{code-block} c\n  ```\n"
    )
    assert OPERATOR.sub("", "symphys ls reports | head -3") == "symphys ls reports"
    found = blocks(text, "p.md")
    assert [(block.language, block.line, block.whole) for block in found] == [
        ("toml", 3, "croquet"),
        ("indented", 6, None),
        ("", 9, None),
        ("{code-block}", 12, None),
    ]
    assert not DIRECTIVE.fullmatch("{code-block}") and DIRECTIVE.fullmatch("{toctree}")
    assert needs("% needs: torch jax\n") == ["torch", "jax"]
    assert needs("text\n<!-- needs: torch, compiler -->\n") == ["torch", "compiler"]


def test_fragments_go_into_their_problem() -> None:
    whole = {"simulation": {"dt": 0.1, "duration": 1}, "body": [{"name": "blue", "mass": 1}], "pair": []}
    fragment = {"simulation": {"dt": 0.2}, "body": [{"name": "blue", "mass": 2}, {"name": "red"}], "joint": [{}]}
    assert with_fragment(whole, fragment) == {
        "simulation": {"dt": 0.2, "duration": 1},
        "body": [{"name": "blue", "mass": 2}, {"name": "red"}],
        "pair": [],
        "joint": [{}],
    }
    with pytest.raises(symphys.SymphysError, match="no_such_key"):
        symphys.load(
            tables_of(Block("p.md", 1, "toml", "[simulation]\nno_such_key = 1\n", "% fragment of: ball_throw"))
        )
