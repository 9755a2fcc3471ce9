"""What recordings do not determine is named, in every draw of the noise; what they do is not."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from data.analytic_recordings import TRUTHS, Truth, recordings, slide
from tools.repeats import few

from symphys.identification import FitOptions, IdentificationOptions, fit_parameters, identify
from symphys.identification.inference.identifiability import (
    GENERAL,
    advice,
    components,
    echelon,
    monomial,
    whole_powers,
)
from symphys.results.identification import Identification
from symphys.types import Array

SEEDS = range(20)
OWN = np.array([[1.0], [1.5], [2.2]])


def named(
    model: Callable[..., Array], names: tuple[str, ...], values: list[float], seed: int, own: Array = OWN
) -> Identification:
    truth = Truth(model, names, np.array(values), own, 0.9, np.array([0.004]), samples=15)
    return identify(recordings(truth, seed), IdentificationOptions(draws=0))


def product(shared: Array, own: Array, time: Array) -> Array:
    return slide(shared[:1] * shared[1:2], own, time)


CASES: dict[str, tuple[Callable[..., Array], tuple[str, ...], list[float], str]] = {
    "product": (
        product,
        ("block.mass", "ground.friction"),
        [0.6, 0.5],
        "block.mass and ground.friction appear only as their product block.mass * ground.friction",
    ),
    "ratio": (
        lambda s, o, t: slide(s[:1] / s[1:2], o, t),
        ("joint.damping", "cube.mass"),
        [0.6, 2.0],
        "joint.damping and cube.mass appear only as the ratio joint.damping / cube.mass",
    ),
    "three": (
        lambda s, o, t: slide(s[:1] * s[1:2] / s[2:3] ** 2, o, t),
        ("a", "b", "c"),
        [0.6, 0.5, 1.0],
        "a, b and c appear only as the combination a * b / c^2",
    ),
    "no effect": (
        lambda s, o, t: slide(s[:1], o, t),
        ("ground.friction", "cube.size[2]"),
        [0.3, 1.0],
        "cube.size[2] has no effect on what was measured",
    ),
    "sum": (
        lambda s, o, t: slide(s[:1] + 2 * s[1:2], o, t),
        ("a", "b"),
        [0.1, 0.1],
        "a and b appear only as 0.5 a + 1 b",
    ),
}


@few("case", CASES, 2)
def test_an_open_direction_is_named_in_each_draw(case: str) -> None:
    model, names, values, text = CASES[case]
    found = [named(model, names, values, seed) for seed in SEEDS]
    assert [[each.text for each in one.open] for one in found] == [[text]] * len(SEEDS)
    assert all(np.isinf(one[name].error) for one in found for name in one.open[0].names)


def test_an_own_number_that_follows_is_named() -> None:
    """The height of the ground, and an offset of each recording."""
    own = np.array([[1.0, 0.01], [1.5, 0.02], [2.2, -0.03]])
    for seed in SEEDS:
        found = named(
            lambda s, o, t: slide(s[:1], o[:1], t) + s[1] + o[1], ("friction", "height"), [0.3, 0.2], seed, own
        )
        (direction,) = found.open
        assert direction.names == ("height",) and direction.own_names == ("own 1",)
        assert "together with own 1 of each recording" in direction.text
        assert np.isfinite(found["friction"].error) and np.isinf(found.own_error[:, 1]).all()


@few("name", TRUTHS, 1)
def test_what_is_determined_raises_no_alarm(name: str) -> None:
    for seed in SEEDS:
        assert identify(recordings(TRUTHS[name], seed), IdentificationOptions(draws=0)).open == ()


def test_nor_does_it_under_hubers_loss_where_the_product_is_named_too() -> None:
    robust = IdentificationOptions(fit=FitOptions(threshold=1.345), draws=0)
    assert identify(recordings(TRUTHS["bounce"], 0), robust).open == ()
    truth = Truth(product, ("a", "b"), np.array([0.6, 0.5]), OWN, 0.9, np.array([0.004]))
    (direction,) = identify(recordings(truth, 0), robust).open
    assert direction.text == "a and b appear only as their product a * b"


def test_nearly_open_is_said_with_its_size() -> None:
    """b acts by less than noise: open by more than its own size, but not without any information."""
    model = lambda s, o, t: slide(s[:1] + 1e-6 * s[1:2] * o[0] ** 2, o, t)  # noqa: E731
    (direction,) = named(model, ("a", "b"), [0.3, 1.0], 0).open
    assert direction.names == ("b",) and "nearly so" in direction.text and np.isfinite(direction.error)


def test_a_product_is_claimed_only_where_it_holds_farther_away() -> None:
    """Of a^2 + b^2 with a = b the Jacobian is that of a b."""
    (direction,) = named(lambda s, o, t: slide(s[:1] ** 2 + s[1:2] ** 2, o, t), ("a", "b"), [0.4, 0.4], 0).open
    assert direction.text == "a and b appear only as 1 a + 1 b near the estimate"


def test_a_prior_that_alone_determines_is_said() -> None:
    truth = Truth(product, ("mass", "friction"), np.array([0.6, 0.5]), OWN, 0.9, np.array([0.004]))
    problem = recordings(truth, 0)
    problem.shared = fit_parameters(truth.names, [0.6, 0.5], prior_mean=0.6, prior_deviation=[0.01, np.inf])
    found = identify(problem)
    (direction,) = found.open
    assert direction.by_prior
    assert found["mass"].error == pytest.approx(0.01, rel=1e-3)
    assert found["friction"].error == pytest.approx(0.01 / 0.6 * found["friction"].value, rel=0.1)


def test_directions_fall_apart_where_numbers_have_nothing_to_do_with_each_other() -> None:
    """A mixture of d a = d b and of d d alone, as singular vectors have it."""
    basis = np.array([[1.0, -1.0, 0, 0, 0], [0, 0, 0, 1.0, 0]])
    mixed = np.array([[0.6, 0.8], [-0.8, 0.6]]) @ basis
    found = [(members.tolist(), len(part)) for members, part in components(echelon(mixed))]
    assert sorted(found) == [([0, 1], 1), ([3], 1)]


def test_powers_are_recognised_where_they_are_whole() -> None:
    assert whole_powers(np.array([-0.5, 1.0, 0.25])) is None
    assert whole_powers(np.array([-0.5, 1.0])).tolist() == [1.0, -2.0]  # type: ignore[union-attr]
    assert whole_powers(np.array([0.5, 0.61])) is None
    assert monomial(["a", "b", "c"], np.array([1, -2, -1])) == "a / (b^2 * c)"


def test_advice_depends_on_the_kind_of_quantity() -> None:
    assert "known mass" in advice(["cube.mass"]) and "spin freely" in advice(["cube.center_of_mass[0]"])
    assert "slide" in advice(["ground.friction"]) and "known mass" in advice(["ground.friction", "cube.mass"])
    assert advice(["cube.colour"])[1:] == GENERAL[1:]
    assert "dry friction" in advice(["hinge.dry_friction"]) and "roll" in advice(["ball.rolling_friction"])
