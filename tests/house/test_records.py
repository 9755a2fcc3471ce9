"""Data classes of ``symphys.records`` are as those of the standard library."""

from __future__ import annotations

import copy
import pickle
from dataclasses import FrozenInstanceError, field, fields, replace
from dataclasses import dataclass as standard
from typing import Any

import numpy as np
import pytest

from symphys.records import dataclass


def classes(make: Any) -> tuple[type, type, type, type]:
    """A frozen class, one that inherits from it, one without equality, and one that may change."""

    @make(frozen=True)
    class Point:
        x: float
        y: float = 2.0
        tags: list[str] = field(default_factory=list, compare=False)
        hidden: int = field(default=1, repr=False)

    @make(frozen=True, kw_only=True)
    class Named(Point):
        name: str

    @make(frozen=True, eq=False, repr=False)
    class Alone:
        x: float

    @make
    class Loose:
        x: float

    return Point, Named, Alone, Loose


PAIRS = list(zip(classes(dataclass), classes(standard), strict=True))


@dataclass(frozen=True)
class Kept:
    x: float
    values: Any = None


@pytest.mark.parametrize(("ours", "theirs"), PAIRS[:2])
def test_equality_hashes_and_text_are_those_of_the_standard_library(ours: Any, theirs: Any) -> None:
    more = {"name": "a"} if "name" in {each.name for each in fields(ours)} else {}
    for make in (ours, theirs):
        one, same, other = make(1.0, tags=["a"], **more), make(1.0, **more), make(1.0, 3.0, **more)
        assert one == same and hash(one) == hash(same) and one != other
        assert one != 1.0 and one != theirs and one.__eq__(1.0) is NotImplemented
        assert replace(one, y=3.0) == other
        with pytest.raises(FrozenInstanceError, match="y"):
            one.y = 5.0
        with pytest.raises(FrozenInstanceError, match="y"):
            del one.y
        assert copy.copy(one) == copy.deepcopy(one) == one
    assert repr(ours(1.0, tags=["b"], **more)) == repr(theirs(1.0, tags=["b"], **more))
    assert hash(ours(1.0, **more)) == hash(theirs(1.0, **more))
    assert ours(1.0, **more) != theirs(1.0, **more), "of another class"


def test_without_equality_objects_are_themselves() -> None:
    for alone in PAIRS[2]:
        one = alone(1.0)
        assert one == one and one != alone(1.0) and len({one, alone(1.0)}) == 2
        assert repr(one).startswith("<")


def test_what_may_change_has_no_hash() -> None:
    for loose in PAIRS[3]:
        one = loose(1.0)
        one.x = 2.0
        assert one == loose(2.0)
        with pytest.raises(TypeError):
            hash(one)


def test_one_field_is_compared_as_a_tuple_of_it() -> None:
    """So that an array is itself, and one that is none raises as in the standard library."""
    values = np.zeros(3)
    assert Kept(1.0, values) == Kept(1.0, values)
    with pytest.raises(ValueError, match="ambiguous"):
        Kept(1.0, values) == np.zeros(3) or Kept(1.0, values) == Kept(1.0, np.zeros(3))


def test_objects_are_pickled_and_may_hold_themselves() -> None:
    one = Kept(1.0)
    assert pickle.loads(pickle.dumps(one)) == one
    loop = Kept(1.0, [])
    loop.values.append(loop)
    assert repr(loop) == "Kept(x=1.0, values=[...])"


@pytest.mark.parametrize(("outer", "inner"), [(dataclass, standard), (standard, dataclass), (dataclass, dataclass)])
def test_either_inherits_from_the_other(outer: Any, inner: Any) -> None:
    @outer(frozen=True)
    class Base:
        x: float

    @inner(frozen=True)
    class Inherits(Base):
        y: float = 2.0

    one = Inherits(1.0)
    assert one == Inherits(1.0, 2.0) and hash(one) == hash(Inherits(1.0)) and one != Inherits(1.0, 3.0)
    assert repr(one).endswith("Inherits(x=1.0, y=2.0)")
    for name in ("x", "y"):
        with pytest.raises(FrozenInstanceError):
            setattr(one, name, 3.0)
