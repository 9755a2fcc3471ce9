"""What is kept beside kernels comes back as it was, and nothing else is read."""

from __future__ import annotations

from typing import Any, NamedTuple

import casadi as ca
import numpy as np
import pytest

from symphys.codegen.toolchain.kept_data import data_of, text_of
from symphys.records import dataclass


class Pair(NamedTuple):
    first: Any
    second: Any


@dataclass(frozen=True)
class Record:
    numbers: Any
    pairs: tuple[Pair, ...]


KINDS = (Pair, Record)


@pytest.mark.parametrize(
    "data",
    [None, True, 3, -0.1, float("inf"), "a \udc80 b", slice(1, 4), [1, (2, [])], Pair(1, Pair("a", None)), ()],
    ids=ascii,
)
def test_plain_data_come_back_with_their_types(data: Any) -> None:
    found = data_of(text_of(data), KINDS)
    assert found == data and type(found) is type(data)


@pytest.mark.parametrize("dtype", [np.float64, np.float32, np.int64, np.bool_])
@pytest.mark.parametrize("shape", [(0,), (3,), (2, 0), (2, 3)])
def test_arrays_come_back_to_the_bit(dtype: type, shape: tuple[int, ...]) -> None:
    given = np.random.default_rng(0).normal(size=shape).astype(dtype)
    found = data_of(text_of(Record(given, (Pair(1, 2),))), KINDS)
    assert found.pairs == (Pair(1, 2),) and found.numbers.dtype == given.dtype
    np.testing.assert_array_equal(found.numbers, given)
    found.numbers[...] = 1  # it may be written to


def test_functions_come_back() -> None:
    x = ca.SX.sym("x", 2)
    found = data_of(text_of([ca.Function("f", [x], [ca.sin(x) / 3])]), ())[0]
    np.testing.assert_array_equal(np.array(found([0.1, 0.2])).ravel(), np.sin([0.1, 0.2]) / 3)


def test_what_is_no_data_is_refused() -> None:
    with pytest.raises(TypeError, match="set cannot be kept"):
        text_of({1, 2})
    for text in (text_of(Pair(1, 2)), '{"made of": 1}', '{"function": "nothing"}'):
        with pytest.raises(ValueError, match="not the text of kept data"):
            data_of(text, (Record,))
