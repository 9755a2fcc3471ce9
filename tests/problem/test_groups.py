"""Groups: names that several surfaces share, in collides_with and [[pair]]."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from symphys.errors import ProblemError
from symphys.problem import Problem, load_problem

Load = Callable[..., Problem]
Refused = Callable[..., ProblemError]
Names = Callable[[ProblemError, str, str], None]

BASE = "[simulation]\nduration = 1.0\ndt = 0.01\n[ground]\n"


def body(name: str, keys: str = "") -> str:
    at = f"position = [{ord(name[0])}, 0, 1]"
    return f'[[body]]\nname = "{name}"\nshape = {{ sphere = {{ radius = 0.1 }} }}\nmass = 1\n{at}\n{keys}\n'


def pair(a: str, b: str, keys: str) -> str:
    return f'[[pair]]\nbetween = ["{a}", "{b}"]\n{keys}\n'


def in_group(names: str, group: str) -> str:
    return "".join(body(name, f'group = "{group}"') for name in names)


def friction(problem: Problem) -> dict[str, float]:
    return {pair.name: pair.law.friction for pair in problem.world().pairs}


def test_collides_with_a_group(load: Load) -> None:
    text = BASE + in_group("ab", "pins") + body("c", 'collides_with = ["pins"]') + body("d")
    assert set(friction(load(text=text))) == {"a-ground", "b-ground", "d-ground", "a-b", "a-c", "b-c", "a-d", "b-d"}


def test_a_group_may_keep_to_itself(load: Load) -> None:
    keys = 'group = "pins"\ncollides_with = ["pins", "ground"]'
    text = BASE + body("a", keys) + body("b", keys) + body("c")
    assert set(friction(load(text=text))) == {"a-ground", "b-ground", "c-ground", "a-b"}


def test_static_surfaces_have_groups(load: Load) -> None:
    walls = '[[plane]]\nname = "left"\nnormal = [1, 0, 0]\noffset = 0\ngroup = "walls"\n'
    walls += '[[block]]\nname = "right"\nshape = { sphere = { radius = 1 } }\ngroup = "walls"\n'
    walls += '[[terrain]]\nname = "floor"\nheight = "-x"\ngroup = "walls"\n'
    text = (
        BASE.replace("[ground]", '[ground]\ngroup = "walls"') + walls + body("a") + pair("a", "walls", "friction = 2")
    )
    assert friction(load(text=text)) == {"a-ground": 2, "a-left": 2, "a-right": 2, "a-floor": 2}
    through = text.replace("friction = 2", "collide = false")
    assert friction(load(text=through)) == {}


def test_a_pair_of_a_group_with_itself(load: Load) -> None:
    text = BASE + in_group("abc", "pins") + body("d") + pair("pins", "pins", "friction = 0.1")
    problem = load(text=text)
    found = friction(problem)
    assert {name for name, value in found.items() if value == 0.1} == {"a-b", "a-c", "b-c"}
    assert problem.parameters["pins-pins.friction"] == 0.1
    apart = load(text=text.replace("friction = 0.1", "collide = false"))
    assert set(found) - set(friction(apart)) == {"a-b", "a-c", "b-c"}


def test_the_closer_table_goes_before(load: Load) -> None:
    text = BASE + in_group("ab", "pins") + in_group("cd", "cups")
    text += (
        pair("pins", "cups", "friction = 0.1") + pair("a", "cups", "friction = 0.2") + pair("c", "a", "friction = 0.3")
    )
    found = friction(load(text=text))
    assert [found[name] for name in ("b-c", "b-d", "a-d", "a-c")] == [0.1, 0.1, 0.2, 0.3]


def test_the_closer_table_decides_whether_they_collide(load: Load) -> None:
    text = BASE + in_group("abc", "pins") + pair("pins", "pins", "collide = false") + pair("a", "b", "friction = 0.3")
    assert friction(load(text=text)) == {"a-ground": 0.5, "b-ground": 0.5, "c-ground": 0.5, "a-b": 0.3}
    one = BASE + in_group("abc", "pins") + pair("pins", "pins", "collide = false") + pair("a", "pins", "friction = 0.3")
    assert {name: mu for name, mu in friction(load(text=one)).items() if "ground" not in name} == {
        "a-b": 0.3,
        "a-c": 0.3,
    }


AMBIGUOUS = in_group("ab", "pins") + in_group("cd", "cups") + pair("a", "cups", "friction = 0.2")


def test_tables_of_one_rank_that_contradict(refused: Refused, names: Names) -> None:
    error = refused(text=BASE + AMBIGUOUS + pair("c", "pins", "friction = 0.3"))
    names(
        error, "pair[1].between", r"for c and a, this table and pair\[0\] say different things; add .*\[\"c\", \"a\"\]"
    )
    assert len(error.issues) == 1
    inside = in_group("ab", "pins") + pair("a", "pins", "friction = 1") + pair("b", "pins", "collide = false")
    names(refused(text=BASE + inside), "pair[1].between", r"for b and a, this table and pair\[0\]")


def test_tables_of_one_rank_that_agree_or_are_settled(load: Load) -> None:
    agreed = friction(load(text=BASE + AMBIGUOUS + pair("c", "pins", "friction = 0.2")))
    assert [agreed[name] for name in ("a-c", "a-d", "b-c", "b-d")] == [0.2, 0.2, 0.2, 0.5]
    settled = AMBIGUOUS + pair("c", "pins", "friction = 0.3") + pair("a", "c", "friction = 0.9")
    assert friction(load(text=BASE + settled))["a-c"] == 0.9
    never = AMBIGUOUS.replace('name = "c"', 'name = "c"\ncollides_with = ["b"]')
    assert friction(load(text=BASE + never + pair("c", "pins", "friction = 0.3")))["b-c"] == 0.3


def test_a_table_that_closer_ones_hide(refused: Refused, names: Names) -> None:
    text = BASE + in_group("ab", "pins") + pair("pins", "pins", "friction = 1") + pair("a", "b", "friction = 0.3")
    names(refused(text=text), "pair[0].between", "tables that name them more closely go before")


def test_settings_reach_pairs_of_groups(load: Load) -> None:
    text = BASE + in_group("ab", "pins") + pair("pins", "pins", "friction = 1")
    assert friction(load(text=text, settings={"pair.pins-pins.friction": 2}))["a-b"] == 2


@pytest.mark.parametrize(
    ("text", "where", "message"),
    [
        (body("a", 'group = "a"'), 'body "a".group', '"a"'),
        (body("a", 'group = "b"') + body("b"), 'body "a".group', '"b"'),
        (body("a", 'group = "ground"'), 'body "a".group', "already has a meaning"),
        (body("a", "group = 3"), 'body "a".group', "is no name"),
        (body("a", 'group = "pins"\ncollides_with = ["pin"]'), 'body "a".collides_with', '"pins"'),
        (in_group("ab", "pins") + pair("pin", "a", "friction = 1"), "pair[0].between", '"pins"'),
        (
            in_group("ab", "pins") + pair("pins", "pins", "friction = 1") + pair("pins", "pins", "friction = 2"),
            "pair[1].between",
            "already have a",
        ),
        (in_group("a", "pins") + pair("pins", "pins", "friction = 1"), "pair[0].between", "no two of these ever touch"),
        (pair("ground", "ground", "friction = 1") + body("a"), "pair[0].between", "same surface twice"),
    ],
)
def test_refused(refused: Refused, names: Names, text: str, where: str, message: str) -> None:
    names(refused(text=BASE + text), where, message)


def test_ground_in_a_group_of_a_body_name(refused: Refused, names: Names) -> None:
    text = BASE.replace("[ground]", '[ground]\ngroup = "a"') + body("a")
    names(refused(text=text), "ground.group", "already the name of a body")


@pytest.mark.parametrize(
    ("static", "name"),
    [
        ('[ground]\ncollides_with = ["ball"]\n', "ground"),
        ('[[block]]\nname = "ramp"\nshape = { box = { size = [1, 1, 1] } }\ncollides_with = ["ball"]\n', "ramp"),
        ('[[plane]]\nname = "wall"\nnormal = [0, 0, 1]\noffset = 0\ncollides_with = ["ball"]\n', "wall"),
    ],
)
def test_what_stands_still_says_who_touches_it(tmp_path: Path, static: str, name: str) -> None:
    """As bodies do: what it does not list passes through."""
    body = '[[body]]\nname = "{}"\nshape = {{ sphere = {{ radius = 0.1 }} }}\nmass = 1\nposition = [{}, 0, 3]\n'
    path = tmp_path / "static.toml"
    head = "[simulation]\nduration = 0.1\ndt = 0.01\n"
    path.write_text(head + body.format("ball", 0) + body.format("other", 1) + static, encoding="utf-8")
    pairs = [pair.name for pair in load_problem(path).world().pairs]
    assert f"ball-{name}" in pairs and f"other-{name}" not in pairs and "ball-other" in pairs
    path.write_text(path.read_text(encoding="utf-8").replace('["ball"]', '["bal"]'), encoding="utf-8")
    with pytest.raises(ProblemError, match=rf'{name}.*collides_with: .*"ball"'):
        load_problem(path)
