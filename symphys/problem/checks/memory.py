"""Whether a machine has the memory that a problem needs: estimated before anything of that size is made.

    bytes = 500 x 10^floor(log10 N) + 128 x N + 300 k + 40 w        x states, N steps, k numbers in variables, w weights

The first term is casadi's loop over the steps, which it lays out by powers of ten, the second what evaluations record;
both were measured with 1 to 8 bodies and 1,000 to a million steps (9.3 GB were used for a ball with as many knots), the
others with 300,000 numbers in knots and nets of 250,000 to 9 million weights. It may be off by a factor of two. What
solvers make beside it is not in it: the Jacobian of least squares is residuals x variables x 8 bytes, four times.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from math import floor, inf, log10
from pathlib import Path

from symphys.model.state_layout import Layout
from symphys.model.world import World
from symphys.problem.model import Simulation, Variable
from symphys.problem.reading.faults import Faults, Place

LOOP, RECORD, NUMBER, WEIGHT = 500, 128, 300, 40
"""Bytes: of a state in a loop of steps; of a state and step; of a number in a variable; of a weight of a net."""
LIMITS = (Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory/memory.limit_in_bytes"))
"""Where Linux states what a group of processes may use: version 2, version 1."""
GIB = 2.0**30


def available() -> float:
    """Bytes of the machine's memory, or what the processes of this group may use of it; inf where that is unknown."""
    try:
        found = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):  # not every system states it
        found = inf
    return min([found, *(limit(path) for path in LIMITS)])


def limit(path: Path) -> float:
    """The number in a file; inf where there is none."""
    try:
        return float(path.read_text())
    except (OSError, ValueError):
        return inf


def steps_need(states: int, steps: int) -> float:
    """Bytes for a rollout."""
    return LOOP * states * 10.0 ** floor(log10(max(steps, 1))) + RECORD * states * steps


def check_net(place: Place, weights: int, varied: bool, faults: Faults) -> bool:
    """Whether there is memory for a net; notes it if there is none. ``varied``: its weights are variables."""
    need, have = float(WEIGHT + NUMBER * varied) * weights, available()
    if need > have:
        text = f"a net of {weights} weights takes about {shown(need)} of memory, {shown(have)} can be used here"
        faults.add(place, f"{text}; take smaller layers")
    return need <= have


def check_rollout(world: World, simulation: Simulation, variables: Sequence[Variable], faults: Faults) -> None:
    """Notes steps and knots that there is no memory for."""
    states, have = Layout(world).size, available()
    need = steps_need(states, simulation.steps)
    if need > have:
        text = f"{simulation.steps} steps of {states} states take about {shown(need)} of memory, {shown(have)} can be"
        faults.add(("simulation", "dt"), f"{text} used here; take a larger dt or a shorter duration")
        return
    for index, variable in enumerate(variables):
        need += NUMBER * variable.guess.size
        if need > have:
            text = f"the steps, and all knots up to these, take about {shown(need)} of memory, {shown(have)} can be"
            faults.add(("variable", index, "knots"), f"{text} used here; take fewer")
            return


def shown(size: float) -> str:
    """``1.5 GiB``."""
    return f"{size / GIB:.3g} GiB"
