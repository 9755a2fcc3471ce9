"""Settings replace values by dotted key, before validation."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from symphys.errors import ProblemError
from symphys.problem import Problem

Load = Callable[..., Problem]
Refused = Callable[..., ProblemError]


def test_a_key_of_a_table(load: Load, valid: str) -> None:
    problem = load(settings={"simulation.dt": 0.005, "ground.friction": 0.25})
    assert problem.simulation.steps == 200
    assert problem.parameters["ground.friction"] == 0.25
    assert problem.text == valid


def test_a_key_that_the_file_leaves_out(load: Load) -> None:
    assert load(settings={"simulation.sweeps": 20}).simulation.sweeps == 20


def test_stages_of_smoothing(load: Load) -> None:
    assert load(settings={"simulation.smoothing": [0.1, 0]}).simulation.smoothing == (0.1, 0.0)


@pytest.mark.parametrize("key", ["body.ball.mass", "body.0.mass"])
def test_a_table_by_name_or_index(load: Load, key: str) -> None:
    assert load(settings={key: 7}).parameters["ball.mass"] == 7


def test_a_name_with_spaces_and_dots(load: Load) -> None:
    problem = load(("lands there", "lands at 0.5"), settings={"target.lands at 0.5.tolerance": 0.5})
    assert problem.targets[0].tolerance == 0.5


def test_deep_keys_and_list_entries(load: Load) -> None:
    problem = load(
        settings={"body.ball.shape.sphere.radius": 0.25, "body.ball.position.2": 3, "variable.throw.guess": 5}
    )
    assert problem.parameters["ball.radius"] == 0.25
    np.testing.assert_array_equal(problem.initial["ball.position"], [0, 0, 3])
    np.testing.assert_array_equal(problem.variables[0].guess, [5, 5, 5])


def test_a_pair_by_its_names(load: Load) -> None:
    pair = ("[ground]", '[[pair]]\nbetween = ["ball", "ground"]\nfriction = 1\n[ground]')
    assert load(pair, settings={"pair.ball-ground.friction": 2}).parameters["ball-ground.friction"] == 2


def test_tables_that_a_setting_opens(load: Load) -> None:
    settings = {"solver.cma.sigma": 2, "solver.cma.options.x": 1, "contact.friction": 0.1, "world.gravity": [0, 0, 0]}
    problem = load(settings=settings | {"objective.goal": 3, "solver.gradient.iterations": 20})
    assert problem.solver_tables == {"gradient": {"iterations": 20}, "cma": {"sigma": 2, "options": {"x": 1}}}
    assert (problem.goal, problem.world().gravity) == (3, (0, 0, 0))


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("simulaton.dt", '"simulation"'),
        ("simulaton", '"simulation"'),
        ("body.bal.mass", '"ball"'),
        ("body.7.mass", 'no "7"'),
        ("body.ball.shpe.sphere", '"shape"'),
        ("body.ball.mass.kg", '"kg"'),
        ("body.ball.position.3", 'no "3"'),
        ("plane.wall.offset", '"plane"'),
        ("pair.a-b.friction", '"pair"'),
        ("", 'there is no ""'),
        (".", 'there is no ""'),
        ("x" * 10_000, "there is no"),
    ],
)
def test_no_such_place(refused: Refused, key: str, message: str) -> None:
    error = refused(settings={key: 1})
    assert error.issues[0].where.startswith("setting ")
    assert message in error.issues[0].message
    assert len(str(error)) < 1000


def test_no_ground_is_added(refused: Refused) -> None:
    ground = ("[ground]\nfriction = 0.8\nrestitution = 0.5", "")
    assert "cannot add one" in str(refused(ground, settings={"ground.friction": 1}))


def test_values_are_validated(refused: Refused) -> None:
    error = refused(settings={"body.ball.mass": -1, "simulation.dtt": 1, "body.marble.density": "heavy"})
    assert {issue.where for issue in error.issues} == {'body "ball".mass', "simulation.dtt", 'body "marble".density'}


def test_every_bad_setting_is_named(refused: Refused) -> None:
    assert len(refused(settings={"a.b": 1, "c.d": 2}).issues) == 2
