"""Folders of settings: of their own each, in any order, with names that every file system takes."""

from __future__ import annotations

import re

import pytest

from symphys.results.config import case_name


def test_without_settings_it_is_the_problem() -> None:
    assert case_name("Ball Throw", {}) == "Ball Throw"


def test_the_order_of_settings_does_not_matter() -> None:
    one, two = {"b": 1, "a": [0.5]}, {"a": [0.5], "b": 1}
    assert case_name("x", one) == case_name("x", two)


@pytest.mark.parametrize("value", ["a/b", "../..", "A", 'q"', "é", "l" * 500, [1, 2], None])
def test_values_of_any_kind_make_a_valid_name(value: object) -> None:
    name = case_name("x", {"k": value})
    assert re.fullmatch(r"x@[a-z0-9._=,+~-]{1,100}", name)


def test_settings_that_look_alike_have_names_of_their_own() -> None:
    values = [1, 1.0, "1", True, "true", "A", "a", "a/b", "a_b", "l" * 500, "l" * 501]
    assert len({case_name("x", {"k": value}).lower() for value in values}) == len(values)
