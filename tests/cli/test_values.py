"""Values typed on the command line are read as TOML means them, and as text where they are no TOML."""

from __future__ import annotations

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symphys.cli.arguments import UsageFault, read_settings
from symphys.problem.reading.messages import read_value


@settings(deadline=None)
@given(st.recursive(st.booleans() | st.integers(-(2**60), 2**60) | st.floats(allow_nan=False), st.lists, max_leaves=5))
def test_a_toml_value_is_read_as_such(value: object) -> None:
    assert read_value(json.dumps(value).replace("Infinity", "inf")) == value


@settings(deadline=None)
@given(st.text())
def test_anything_else_is_text(text: str) -> None:
    assert read_value(f"no {text}") == f"no {text}"


@pytest.mark.parametrize("text", ["1\nb = 2", "[" * 100_000, "2020-01-01", "", "1 2"])
def test_odd_values_are_text(text: str) -> None:
    assert read_value(text) == text


def test_settings_keep_their_keys() -> None:
    assert read_settings(["a.b=1.5", " c = x=y"]) == {"a.b": 1.5, "c": "x=y"}


@pytest.mark.parametrize("assignment", ["a", "=1", ""])
def test_a_setting_needs_key_and_value(assignment: str) -> None:
    with pytest.raises(UsageFault, match="KEY=VALUE"):
        read_settings([assignment])
