"""What is asked of a state without a step: bodies alike share what they compute, as in a recorded step."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from tools.repeats import first

from symphys.dynamics.collision import RULES
from symphys.dynamics.functions import step_function
from symphys.dynamics.observation.queries import gap_function
from symphys.dynamics.tracing import trace
from symphys.model.shapes import Box, Plane
from symphys.model.state_layout import initial_state
from symphys.model.world import Body, Law, World, make_world


def boxes(count: int) -> World:
    """Cubes on the ground, 0.1 m, 0.2 m, ... above it, which meet nothing else."""
    bodies = [Body(f"b{i}", 1.0, (0.1, 0.1, 0.1), (Box((0.5, 0.5, 0.5)),)) for i in range(count)]
    world = make_world(bodies, [Plane.ground()], Law(0.5, 0.5))
    return World(world.bodies, world.statics, tuple(pair for pair in world.pairs if pair.second.body is None))


@pytest.mark.slow
@first("make", [gap_function, step_function])
def test_boxes_alike_are_built_once(make: Callable[[World], object], monkeypatch: pytest.MonkeyPatch) -> None:
    built: list[int] = []
    rule = RULES[Box, Plane]

    def counted(*arguments: Any) -> Any:
        built.append(1)
        return rule(*arguments)

    monkeypatch.setitem(RULES, (Box, Plane), counted)
    monkeypatch.setattr(trace, "_CACHE", trace.TraceCache())
    make(boxes(2))
    of_two = len(built)
    make(boxes(4))
    assert len(built) == of_two > 0


def test_each_of_them_is_where_it_is() -> None:
    world = boxes(3)
    x = initial_state(world, {f"b{i}.position": (2.0 * i, 0.0, 0.6 + 0.1 * i) for i in range(3)})
    gaps = np.asarray(gap_function(world)(x)).reshape(3, -1)
    assert gaps.min(axis=1) == pytest.approx([0.1, 0.2, 0.3])
