"""What can be wrong with files that include others, and that the file that has it is named."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from worlds.included import MAIN, ROBOT

from symphys.cli import main

Refused = Callable[..., list[str]]

SECOND = '[[include]]\nfile = "parts/robot.toml"\n'
FAULTS = [
    (("mass = 2", "mass = -2"), ("", ""), r'parts/robot.toml: body "torso".mass: must be at least 0'),
    (("mass = 2", "mas = 2"), ("", ""), r'parts/robot.toml: body "torso".mas: unknown key; did you mean "mass"'),
    (("mass = 2", ""), ("", ""), r'parts/robot.toml: body "torso".mass: give either mass'),
    (('name = "shin"', ""), ("", ""), r"parts/robot.toml: body\[1\].name: this key is required"),
    (('["torso", "shin"]', '["torso", "shn"]'), ("", ""), r'parts/robot.toml: joint "knee".between: no body .*"shin"'),
    (
        ("knee.command", "kne.command"),
        ("", ""),
        r'parts/robot.toml: variable "bend".sets: .* did you mean "knee.command"',
    ),
    (('squares = "knee', 'squares = "kne'), ("", ""), r'parts/robot.toml: cost "effort".squares: '),
    (("friction = 0.3", "friction = -1"), ("", ""), "parts/robot.toml: contact.friction: must be at least 0"),
    (("friction = 0.3", "damping = 1"), ("", ""), "parts/robot.toml: contact.damping: has no effect on rigid"),
    (("[contact]\nfriction = 0.3", "contact = 3"), ("", ""), "parts/robot.toml: contact: must be a table, not 3"),
    (("[contact]", "[[contact]]"), ("", ""), "parts/robot.toml: contact: must be a table, not a list of 1"),
    (("[contact]", "[contct]"), ("", ""), 'parts/robot.toml: contct: unknown key; did you mean "contact"'),
    (("[contact]\nfriction = 0.3", "[qqq]"), ("", ""), "parts/robot.toml: qqq: unknown key; valid: "),
    (
        ("[contact]\nfriction = 0.3", "terrain = 3"),
        ("", ""),
        r"parts/robot.toml: terrain: must be a list, not 3; write \[\[terrain",
    ),
    (
        ("[contact]\nfriction = 0.3", "terrain = [3]"),
        ("", ""),
        r"parts/robot.toml: terrain\[0\]: must be a table, not 3",
    ),
    (('title = "Two links"', "title = 3"), ("", ""), "parts/robot.toml: title: must be text, not 3"),
    (
        ("[contact]", "[simulation]\ndt = 1\n[contact]"),
        ("", ""),
        "parts/robot.toml: simulation: .* move it to main.toml",
    ),
    (("[contact]", "[solver.cma]\n[contact]"), ("", ""), "parts/robot.toml: solver: belongs to a whole problem"),
    (("[contact]", "[objective]\n[contact]"), ("", ""), "parts/robot.toml: objective: belongs to a whole problem"),
    (("title =", 'solvers = ["cma"]\ntitle ='), ("", ""), "parts/robot.toml: solvers: belongs to a whole problem"),
    (
        ("[contact]", SECOND + "[contact]"),
        ("", ""),
        "parts/robot.toml: include: an included file includes no others; .* main.toml too",
    ),
    (("friction = 0.3", "friction ="), ("", ""), "parts/robot.toml: this is not valid TOML"),
    ((ROBOT, ""), ("", ""), "parts/robot.toml: the file is empty"),
    (
        ("", ""),
        ("[[body]]", "[contact]\nfriction = 0.4\n[[body]]"),
        "main.toml: contact.friction: differs from what parts/robot.toml gives",
    ),
    (
        ("", ""),
        ('"ball"', '"torso"'),
        'main.toml: body "torso".name: "torso" is already the name of .* of parts/robot.toml',
    ),
    (
        ("", ""),
        ('"ball"\nshape', '"ball"\ngroup = "shin"\nshape'),
        'main.toml: body "ball".group: "shin" .* a body of parts/robot.toml',
    ),
    (
        ('group = "robot"', 'group = "ball"'),
        ("", ""),
        'parts/robot.toml: body "torso".group: "ball" is .* of main.toml',
    ),
    (
        ("[[plane]]", '[[sensor]]\nname = "gaze"\nreads = "knee.angl"\n[[plane]]'),
        ("", ""),
        'parts/robot.toml: sensor "gaze".reads: .*"knee.angle"',
    ),
    (("", ""), ("knee.angle", "kne.angle"), 'main.toml: target "bent".value: .*did you mean "knee.angle"'),
    (("", ""), ("duration = 1.0", "duration = -1"), "main.toml: simulation.duration: must be greater"),
    (("", ""), ("position = [0, 2, 9]", "position = [0, 2]"), 'main.toml: body "ball".position: must be a list of 3'),
    (
        ("", ""),
        ("parts/robot.toml", "parts/robt.toml"),
        r'main.toml: include\[0\].file: there is no file "parts/robt.toml", and no shipped robot',
    ),
    (("", ""), ("parts/robot.toml", "robots/am.toml"), 'did you mean "robots/arm.toml"'),
    (("", ""), ("parts/robot.toml", ""), r"main.toml: include\[0\].file: "),
    (("", ""), ("parts/robot.toml", "a" * 5000), r"main.toml: include\[0\].file: there is no file"),
    (("", ""), ("parts/robot.toml", "\\u0000"), r"main.toml: include\[0\].file: there is no file"),
    (("", ""), ("parts/robot.toml", "parts"), "parts: this is a folder"),
    (("", ""), ("parts/robot.toml", "main.toml"), r"main.toml: include\[0\].file: the file includes itself"),
    (("", ""), ("parts/robot.toml", "parts/../main.toml"), r"include\[0\].file: the file includes itself"),
    (
        ("", ""),
        ('robot.toml"', 'robot.toml"\nyaw = 3'),
        r'main.toml: include\[0\].yaw: unknown key; did you mean "yaw_deg"',
    ),
    (("", ""), ('robot.toml"', 'robot.toml"\nprefix = "2_"'), r'main.toml: include\[0\].prefix: "2_" is no name'),
    (("", ""), (MAIN, "include = 3"), r"main.toml: include: must be a list of 1 to 100 tables, \[\[include\]\], not 3"),
    (
        ("", ""),
        (SECOND, SECOND * 2),
        r"main.toml: include\[1\].file: include\[0\] includes this file with the same names",
    ),
    (("", ""), (SECOND, SECOND * 101), "include: must be a list of 1 to 100 tables"),
    (
        ("[[plane]]", '[[terrain]]\nname = "hills"\nheight = "x"\n[[plane]]'),
        ('robot.toml"', 'robot.toml"\nyaw_deg = 3'),
        'parts/robot.toml: terrain "hills": terrain cannot be moved',
    ),
]


@pytest.mark.parametrize(("robot", "problem", "pattern"), FAULTS)
def test_faults_name_their_file(
    refused_both: Refused, robot: tuple[str, str], problem: tuple[str, str], pattern: str
) -> None:
    lines = refused_both(robot=robot, problem=problem)
    assert any(re.match(f"(.* )?{pattern}", line) for line in lines), lines


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("body.tors.mass", 'did you mean "torso"'),
        ("body", "included files have tables in this list"),
        ("include.0.yaw", "yaw_deg"),
        ("include.1.yaw_deg", 'there is no "1"'),
    ],
)
def test_settings_that_have_no_place(refused_both: Refused, key: str, message: str) -> None:
    assert message in refused_both(settings={key: 1})[0]


def test_two_included_files_must_not_differ(refused_both: Refused, tmp_path: Path) -> None:
    (tmp_path / "moon.toml").write_text("[contact]\nfriction = 0.4\n", encoding="utf-8")
    lines = refused_both(problem=("[[body]]", '[[include]]\nfile = "moon.toml"\n[[body]]'))
    assert lines == [
        "moon.toml: contact.friction: differs from what parts/robot.toml gives; leave one of them out, or make them "
        "equal"
    ]


def test_a_file_that_is_too_large(refused_both: Refused, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("symphys.problem.reading.source.MAX_BYTES", len(ROBOT) - 1)
    assert "too large for a problem file" in refused_both(problem=(MAIN, MAIN[:-2]))[0]
    monkeypatch.undo()
    monkeypatch.setattr("symphys.problem.include.files.MAX_BYTES", len(ROBOT) + len(MAIN))
    assert refused_both()[0].startswith("main.toml: with the files that it includes, it is larger than")


def test_files_that_are_no_text(refused_both: Refused, tmp_path: Path) -> None:
    (tmp_path / "bad.toml").write_bytes(b"a = 1\n\xff")
    assert refused_both(problem=("parts/robot.toml", "bad.toml"))[0].startswith(
        "bad.toml: the file is not UTF-8 text (line 2)"
    )


@pytest.mark.parametrize("file", ["parts/none.toml", "parts", "main.toml", "parts/bad.toml"])
def test_the_command_ends_with_2(
    write_both: Callable[..., Path], file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_both(problem=("parts/robot.toml", file))
    (tmp_path / "parts" / "bad.toml").write_text("= 3", encoding="utf-8")
    assert main(["check", str(path)]) == 2
    assert file in capsys.readouterr().err
