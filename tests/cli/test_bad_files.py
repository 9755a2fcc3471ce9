"""A file that cannot be solved gives one message, exit code 2, and no output."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

Run = Callable[..., tuple[int, str, str]]

WORLD = """
[simulation]
duration = 0.2
dt = 0.02
[[body]]
name = "ball"
shape = { sphere = { radius = 0.1 } }
mass = 1.0
position = [0, 0, 1]
"""
VARIABLE = """
[[variable]]
name = "throw"
sets = "ball.velocity"
"""
TARGET = """
[[target]]
name = "there"
value = "ball.position"
tolerance = 0.1
"""
COST = """
[[cost]]
name = "height"
value = "ball.position[2]"
"""
WHOLE = WORLD + VARIABLE + TARGET
SECOND = """
[[body]]
name = "other"
shape = { sphere = { radius = 0.1 } }
mass = 1.0
position = [0, 0, 1.05]
"""
BRACKETS = 1_000_000
CHANGES: list[tuple[str, str, str]] = [
    ("mass = 1.0", "mass = 1.0\ncolour = 3", "colour: unknown key"),
    ("[[target]]", "[[tarket]]", 'did you mean "target"'),
    (
        "{ sphere = { radius = 0.1 } }",
        "{ cube = { side = 1.0 } }",
        "valid: sphere, box, capsule, cylinder, ellipsoid, convex, spheres, parts",
    ),
    ("[0, 0, 1]", "[0, 1]", "a list of 3 numbers"),
    ("mass = 1.0", "mass = -1.0", "at least 0"),
    ("mass = 1.0", "mass = nan", "a finite number"),
    ("mass = 1.0", f"mass = {'9' * 4000}", "that large"),
    ("mass = 1.0", f"mass = {'9' * 5000}", "5000 digits"),
    ("mass = 1.0", "mass = 1.0\nmass = 2.0", "line 9"),
    ("mass = 1.0", "mass = 1.0 # \0", "line 8"),
    ("dt = 0.02", "dt = 2e-10", "too many"),
    ("dt = 0.02", "dt = 0.02\nsmoothing = [0, 0.1]", "simulation.smoothing: stages must decrease"),
    ('"ball.position"', "\"__import__('os').getpid()\"", "only functions by plain name"),
    ('"ball.position"', '"open(1)"', "unknown function"),
    ('"ball.position"', '"ball.position.__class__"', "at most one dot"),
    ('"ball.position"', '"(lambda: 1)()"', "not allowed"),
    ('"ball.position"', '"9**9**9**9"', "not a finite"),
    ('"ball.position"', f'"{"(" * 4000}1{")" * 4000}"', "too many nested"),
    ('"ball.velocity"', '"ball.force"\nknots = 10000000', "knots"),
    ("[[body]]", SECOND + "[[body]]", "overlaps"),
    ("[[body]]", "[solver.adam]\nrates = 1\n[[body]]", "no solver"),
    ("[[body]]", "[solver.cma]\nsigma = -1\n[[body]]", "sigma must be above 0"),
    ("[[body]]", '[solver.cma]\nsigma = "x"\n[[body]]', "must be a number"),
    ("[[body]]", f"a = {'[' * BRACKETS}{']' * BRACKETS}\n[[body]]", "nested too deep"),
]
CONTENTS: list[tuple[bytes, str]] = [
    (b"", "empty"),
    (b" \n\n", "empty"),
    (b"hello, this is { not toml", "not valid TOML"),
    (bytes(range(256)) * 20, "not UTF-8"),
    (WHOLE.encode("utf-16"), "not UTF-8"),
    (f"# \xe9{WHOLE}".encode("latin-1"), "not UTF-8 text (line 1)"),
    (b"#" * 20_000_000, "too large"),
    (b"a." * 100_000 + b"b = 1", "dots"),
]


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str | bytes], Path]:
    """A problem file of this content."""

    def write(content: str | bytes) -> Path:
        path = tmp_path / "bad.toml"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (WORLD, ["[[variable]]", "[[target]]"]),
        (WORLD + VARIABLE, ["[[target]]"]),
        (WORLD + VARIABLE + "[objective]\ngoal = 1.0\n", ["[[target]]"]),
        (WORLD + TARGET, ["[[variable]]"]),
        (WORLD + COST, ["[[variable]]"]),
    ],
)
@pytest.mark.parametrize("command", ["solve", "check"])
def test_a_file_with_nothing_to_solve_says_what_is_missing(
    run: Run, write: Callable[[str], Path], command: str, text: str, words: list[str]
) -> None:
    code, _, err = run(command, write(text))
    assert code == 2
    assert [word for word in ("[[variable]]", "[[target]]") if word in err] == words
    assert len(err.splitlines()) == len(words)
    assert not Path("reports").exists()


@pytest.mark.parametrize("text", [WORLD, WORLD + VARIABLE, WORLD + TARGET])
def test_a_file_with_nothing_to_solve_is_shown(run: Run, write: Callable[[str], Path], text: str) -> None:
    code, out, _ = run("show", write(text))
    assert code == 0
    assert Path(out.strip()).exists()


@pytest.mark.slow
def test_what_the_message_says_to_add_makes_it_solvable(run: Run, write: Callable[[str], Path]) -> None:
    path = write(WORLD)
    advice = [line.partition("for instance, ")[2] for line in run("solve", path)[2].splitlines()]
    tables = [line.replace("]] with ", "]]\n").replace(", sets", "\nsets") for line in advice]
    tables = [line.replace(", value", "\nvalue").replace(", tolerance", "\ntolerance") for line in tables]
    path.write_text("\n".join([WORLD, *tables]), encoding="utf-8")
    assert run("solve", path, "--solver", "least_squares")[0] == 0


def refuses(run: Run, path: Path, words: str, *more: str) -> None:
    """Both commands do, with one short line, and leave nothing behind."""
    for command in ("solve", "check"):
        code, out, err = run(command, path, *more)
        assert (code, out) == (2, "")
        assert words in err
        assert len(err.splitlines()) == 1 and len(err) < 1000
        assert "sys.set_int" not in err
    assert not any(Path().iterdir())


@pytest.mark.parametrize(("old", "new", "words"), CHANGES, ids=[words for _, _, words in CHANGES])
def test_a_mistake_is_one_line(run: Run, write: Callable[[str], Path], old: str, new: str, words: str) -> None:
    assert WHOLE.count(old) == 1
    refuses(run, write(WHOLE.replace(old, new)), words)


@pytest.mark.parametrize(("content", "words"), CONTENTS, ids=[words for _, words in CONTENTS])
def test_what_is_no_problem_file_is_one_line(
    run: Run, write: Callable[[bytes], Path], content: bytes, words: str
) -> None:
    refuses(run, write(content), words)


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("body.bal.mass=1", 'did you mean "ball"'),
        ("body.ball.mass=-1", "at least 0"),
        ("body.ball.mass=nan", "a finite number"),
        ("body.ball.mass.x=1", 'has no "x"'),
        ("body.5.mass=1", 'there is no "5"'),
        ("simulation.dt=1e-12", "too many"),
        ("target.there.tolerance=0", "greater than 0"),
        ("=3", "write KEY=VALUE"),
        ("a" * 100_000 + "=1", "there is no"),
        ("body.ball.mass=" + "[" * 100_000, "must be a number"),
    ],
    ids=range(10),
)
def test_a_bad_setting_is_one_line(run: Run, write: Callable[[str], Path], setting: str, words: str) -> None:
    refuses(run, write(WHOLE), words, "--set", setting)


def test_the_whole_file_is_fine(run: Run, write: Callable[[str], Path]) -> None:
    assert run("check", write(WHOLE))[0] == 0


def test_places_that_are_no_files(run: Run, tmp_path: Path) -> None:
    link = tmp_path / "link.toml"
    link.symlink_to(link)
    for path, words in ((tmp_path, "folder"), (tmp_path / "gone.toml", "no file"), (link, "no file")):
        refuses(run, path, words)
