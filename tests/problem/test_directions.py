"""Directions may have any length that a number can have: their squares may not be."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import symphys
from symphys.errors import ProblemError

HUGE = [1.34e154, 1e300]
WORLD: dict[str, Any] = {
    "simulation": {"duration": 0.1, "dt": 0.01},
    "body": [{"name": "bar", "mass": 1, "inertia": 1, "position": [0, 0, 1]}],
}


def with_wall(length: float) -> dict[str, Any]:
    return WORLD | {"plane": [{"name": "wall", "normal": [length, 0, length], "offset": 0.4}]}


@pytest.mark.parametrize("length", HUGE)
def test_normals(length: float) -> None:
    found, plain = (symphys.load(with_wall(each)).parametric.statics[0].static for each in (length, 1.0))
    np.testing.assert_allclose(found.normal, plain.normal, rtol=1e-15)
    assert found.offset == plain.offset


@pytest.mark.parametrize("length", HUGE)
def test_normals_of_included_planes(length: float, tmp_path: Path) -> None:
    """The offset grows by how far the plane is moved along its normal."""
    text = f'[[plane]]\nname = "wall"\nnormal = [{length!r}, 0, {length!r}]\noffset = 0.4\n'
    (tmp_path / "wall.toml").write_text(text, "utf-8")
    (tmp_path / "yard.toml").write_text(
        '[simulation]\nduration = 0.1\ndt = 0.01\n[[include]]\nfile = "wall.toml"\nposition = [1, 0, 0]\n'
        '[[body]]\nname = "bar"\nmass = 1\ninertia = 1\nposition = [0, 0, 1]\n',
        "utf-8",
    )
    (wall,) = symphys.load(tmp_path / "yard.toml").parametric.statics
    assert wall.static.offset == pytest.approx(0.4 + np.sqrt(0.5))


@pytest.mark.parametrize("length", HUGE)
@pytest.mark.parametrize(
    "kind", [{"hinge": {"axis": "one"}}, {"slider": {"axis": "one"}}, {"universal": {"axes": ["one", "other"]}}]
)
def test_axes(length: float, kind: dict[str, Any]) -> None:
    def frames(size: float) -> Any:
        axes = {"one": [size, size, 0], "other": [0, 0, size]}
        named = {
            name: {key: axes[value] if isinstance(value, str) else [axes[each] for each in value]}
            for name, of in kind.items()
            for key, value in of.items()
        }
        joint = {"name": "pin", "between": ["world", "bar"], "point": [0, 0, 1], **named}
        return symphys.load(WORLD | {"joint": [joint]}).parametric.joints[0].frames

    for found, plain in zip(frames(length), frames(1.0), strict=True):
        np.testing.assert_allclose(found.orientation, plain.orientation, atol=1e-15)


@pytest.mark.parametrize("length", HUGE)
def test_quaternions_are_near_unit_ones(length: float) -> None:
    body = WORLD["body"][0] | {"orientation": [length, length, 0, 0]}
    with pytest.raises(ProblemError, match="orientation"):
        symphys.load(WORLD | {"body": [body]})
