"""Layouts of variables and rows of multiple shooting: with shared entries of z, or in stages as FATROP needs.

The shared layout has every entry of z once, then the tangents of the nodes. FATROP solves chains: the rows of a stage
hold its own variables and the states of the next stage alone. There an entry of z that acts in several intervals is a
control of the first of these, and a state with a row that copies it in all others; static entries are carried to the
end. Copies are linear and hold from the start on, so they hold at every iterate.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from symphys.errors import SymphysError
from symphys.solvers.multiple_shooting.grid import IntervalGrid
from symphys.types import Ints

SPREAD = (
    "solver.multiple_shooting.backend: FATROP takes a constraint on the states and inputs of one interval, and "
    "constraint number {} depends on several: use backend = 'ipopt'"
)


@dataclass(frozen=True)
class NlpLayout:
    """The places of everything among variables w and constraint rows.

    Attributes:
        size, rows: how many variables and rows.
        home: (len(z),) index of each entry of z.
        local: of each stage, the indices of its local vector, see ``IntervalGrid``.
        nodes: (M, n) indices of the tangents of nodes 1 to M.
        defects: (M, n) rows.
        limits: (c,) rows.
        copies: (r, 3) row, the copy, and what it is a copy of.
        structure: FATROP's N, nx, nu and ng; empty in the shared layout.
    """

    size: int
    rows: int
    home: Ints
    local: tuple[Ints, ...]
    nodes: Ints
    defects: Ints
    limits: Ints
    copies: Ints
    structure: dict[str, object] = field(default_factory=dict)


def shared(grid: IntervalGrid, variables: int, limits: int) -> NlpLayout:
    """Return the layout with every entry of z once, then all tangents; all defects, then all limits."""
    n, count = grid.tangent_size, grid.intervals
    nodes = variables + np.arange(count * n).reshape(count, n)
    local = []
    for stage in range(count + 1):
        own = nodes[stage - 1] if stage else nodes[:0].ravel()
        knots = grid.knots[stage] if stage < count else grid.statics[:0]
        local.append(np.concatenate([own, knots, grid.statics]))
    return NlpLayout(
        size=variables + count * n,
        rows=count * n + limits,
        home=np.arange(variables),
        local=tuple(local),
        nodes=nodes,
        defects=np.arange(count * n).reshape(count, n),
        limits=count * n + np.arange(limits),
        copies=np.zeros((0, 3), np.int64),
    )


def staged(grid: IntervalGrid, variables: int, stages_of_limits: list[list[int]]) -> NlpLayout:
    """Return the chain of stages; ``stages_of_limits``: the stages that each limit depends on, at most one."""
    for number, stages in enumerate(stages_of_limits):
        if len(stages) > 1:
            raise SymphysError(SPREAD.format(number + 1))
    return StageChain(grid, variables, [stages[0] if stages else 0 for stages in stages_of_limits]).layout()


class StageChain:
    """Builds the layout in stages: a stage has states, then controls; its rows have the copies likewise."""

    def __init__(self, grid: IntervalGrid, variables: int, stage_of_limit: list[int]) -> None:
        """Find where each entry of z is first and last needed."""
        self.grid, self.stage_of_limit = grid, np.array(stage_of_limit, np.int64)
        self.first = np.zeros(variables, np.int64)
        self.last = np.zeros(variables, np.int64)
        for stage in reversed(range(grid.intervals)):
            self.first[grid.knots[stage]] = stage
        for stage in range(grid.intervals):
            self.last[grid.knots[stage]] = stage
        self.first[grid.statics], self.last[grid.statics] = 0, grid.intervals
        self.home = np.zeros(variables, np.int64)

    def layout(self) -> NlpLayout:
        """Number the variables of each stage, then the rows."""
        grid, n = self.grid, self.grid.tangent_size
        places, nodes, states, controls, size = [], [], [], [], 0
        for stage in range(grid.intervals + 1):
            carried = np.flatnonzero((self.first < stage) & (self.last >= stage))
            new = np.flatnonzero(self.first == stage) if stage < grid.intervals else carried[:0]
            own = grid.node_size(stage)
            entries = np.concatenate([carried, new])
            places.append(dict(zip(entries.tolist(), range(size + own, size + own + len(entries)), strict=True)))
            self.home[new] = [places[-1][entry] for entry in new.tolist()]
            if stage:
                nodes.append(size + np.arange(n))
            states.append(own + len(carried))
            controls.append(len(new))
            size += own + len(entries)
        defects, limits, copies, rows = self._rows(places)
        structure: dict[str, object] = {
            "N": grid.intervals,
            "nx": states,
            "nu": controls,
            "ng": np.bincount(self.stage_of_limit, minlength=grid.intervals + 1).tolist(),
        }
        local = tuple(self._local(stage, nodes, places[stage]) for stage in range(grid.intervals + 1))
        return NlpLayout(size, rows, self.home, local, np.array(nodes), defects, limits, copies, structure)

    def _local(self, stage: int, nodes: list[Ints], places: dict[int, int]) -> Ints:
        """Return the indices of the local vector of a stage."""
        knots = self.grid.knots[stage] if stage < self.grid.intervals else self.grid.statics[:0]
        entries = [places[entry] for entry in [*knots.tolist(), *self.grid.statics.tolist()]]
        own = nodes[stage - 1] if stage else nodes[0][:0]
        return np.concatenate([own, np.array(entries, np.int64)])

    def _rows(self, places: list[dict[int, int]]) -> tuple[Ints, Ints, Ints, int]:
        """Return the rows of the defects, of the limits, of the copies, and their number."""
        grid, n, row = self.grid, self.grid.tangent_size, 0
        defects, copies = [], []
        limits = np.zeros(len(self.stage_of_limit), np.int64)
        for stage in range(grid.intervals + 1):
            if stage < grid.intervals:
                defects.append(row + np.arange(n))
                row += n
                for entry, place in places[stage + 1].items():
                    if self.first[entry] <= stage:
                        copies.append((row, place, places[stage][entry]))
                        row += 1
            here = np.flatnonzero(self.stage_of_limit == stage)
            limits[here] = row + np.arange(len(here))
            row += len(here)
        return np.array(defects), limits, np.array(copies, np.int64).reshape(-1, 3), row
