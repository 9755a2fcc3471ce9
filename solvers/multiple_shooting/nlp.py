"""The nonlinear program of multiple shooting: layout, objective, constraints, sparse derivatives, multipliers.

w holds z / scale and the tangents of the nodes, in the order of a ``NlpLayout``. Derivatives are dense blocks, a stage
each, that are scattered into fixed sparsity patterns, column by column as casadi has them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

import casadi as ca
import numpy as np

from symphys.errors import SymphysError
from symphys.records import dataclass
from symphys.shooting import StagedMotion, StagedProblem
from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.outcome import Counts
from symphys.solvers.multiple_shooting.chart import curved_columns, interpolated
from symphys.solvers.multiple_shooting.grid import IntervalGrid
from symphys.solvers.multiple_shooting.shots import IntervalSteps, ShootingPlan, Shots
from symphys.types import Array, Ints

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
    """Builds the layout in stages: a stage has states, then controls; its rows have the copies likewise.

    FATROP solves chains: the rows of a stage hold only its own variables and the states of the next stage. So an entry
    of z that acts in several intervals is a control of the first of these, and a state with a row that copies it in all
    others; static entries are carried to the end. Copies are linear and hold from the start on, so at every iterate.
    """

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


DIFFERENCE_STEP = 1e-6
"""Step of the differences for an exact Hessian, in local vectors."""


@dataclass(frozen=True)
class ScatterPattern:
    """A sparsity pattern with the places of the entries of blocks; entries of one place add up.

    Attributes:
        sparsity: casadi's.
        place: (entries,) the place of each entry among the nonzeros.
    """

    sparsity: ca.Sparsity
    place: Ints

    def nonzeros(self, entries: Array) -> Array:
        """Return the nonzeros: entries summed by place."""
        return np.bincount(self.place, weights=entries, minlength=self.sparsity.nnz()).astype(float)


def pattern(shape: tuple[int, int], rows: Ints, columns: Ints) -> ScatterPattern:
    """Make the pattern of entries at (rows, columns)."""
    keys, place = np.unique(columns * shape[0] + rows, return_inverse=True)
    starts = np.searchsorted(keys, shape[0] * np.arange(shape[1] + 1))
    return ScatterPattern(ca.Sparsity(*shape, starts.tolist(), (keys % max(shape[0], 1)).tolist()), place)


class MultipleShootingNlp:
    """The program in w; the last evaluation is cached, since solvers request its parts one by one."""

    def __init__(
        self, plan: ShootingPlan, layout: NlpLayout, limit_rows: list[Ints], scale: Array, exact: bool
    ) -> None:
        """Make the patterns.

        Args:
            plan: the part that all evaluations share.
            layout: where everything is.
            limit_rows: the limits that depend on each stage.
            scale: (len(z),).
            exact: whether the Hessian has the curvature of the steps, by differences of slopes.
        """
        self.plan, self.layout, self.limit_rows, self.scale, self.exact = plan, layout, limit_rows, scale, exact
        grid = plan.grid
        self.local_scale = [np.ones(grid.local_size(stage)) for stage in range(grid.intervals + 1)]
        for stage, local in enumerate(self.local_scale):
            if stage < grid.intervals:
                local[grid.knot_part(stage)] = scale[grid.knots[stage]]
            local[grid.static_part(stage)] = scale[grid.statics]
        self.jacobian_pattern = self._jacobian_pattern()
        pairs = [np.meshgrid(local, local, indexing="ij") for local in layout.local]
        rows, columns = (np.concatenate([pair[side].ravel() for pair in pairs]) for side in (0, 1))
        self.hessian_pattern = pattern((layout.size, layout.size), rows, columns)
        self.upper = rows <= columns
        self.upper_pattern = pattern((layout.size, layout.size), rows[self.upper], columns[self.upper])
        self.work = Counts()
        self._key = b""
        self._shots: Shots | None = None
        self._kept: dict[str, Array] = {}

    def pack(self, z: Array, d: Array) -> Array:
        """Return w (size,) of z and the tangents d (M, n), copies included."""
        w = np.zeros(self.layout.size)
        w[self.layout.home], w[self.layout.nodes] = z / self.scale, d
        for _, copy, origin in self.layout.copies.tolist():
            w[copy] = w[origin]
        return w

    def unpack(self, w: Array) -> tuple[Array, Array]:
        """Return z and d (M, n)."""
        return w[self.layout.home] * self.scale, w[self.layout.nodes]

    def bounds(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Return the bounds (size,) of w from those of z; copies and tangents have none."""
        low, high = np.full(self.layout.size, -np.inf), np.full(self.layout.size, np.inf)
        low[self.layout.home], high[self.layout.home] = lower / self.scale, upper / self.scale
        return low, high

    def row_bounds(self) -> tuple[Array, Array]:
        """Return the bounds (rows,) of the constraints: 0 except for the limits."""
        low, high = np.zeros(self.layout.rows), np.zeros(self.layout.rows)
        low[self.layout.limits], high[self.layout.limits] = self.plan.problem.lower, self.plan.problem.upper
        return low, high

    def shots(self, w: Array) -> Shots:
        """Return the evaluation at w."""
        key = w.tobytes()
        if self._shots is None or key != self._key:
            z, d = self.unpack(w)
            problem = self.plan.problem
            u = np.asarray(problem.weights @ z).reshape(problem.steps, problem.input_size)
            self._shots, self._key, self._kept = Shots(self.plan, z, u, d), key, {}
            self.work += Counts(rollouts=1)
        return self._shots

    def largest_defect(self, z: Array) -> float:
        """Return the largest defect at z with all nodes at their references."""
        nodes = np.zeros(self.layout.nodes.shape)
        return float(np.abs(self.shots(self.pack(z, nodes)).defects).max())

    def objective(self, w: Array) -> float:
        """Return the objective at w."""
        return self.shots(w).measured[0]

    def constraints(self, w: Array) -> Array:
        """Return the constraints (rows,) at w."""
        shots, rows = self.shots(w), np.zeros(self.layout.rows)
        rows[self.layout.defects] = shots.defects
        rows[self.layout.limits] = shots.measured[1]
        row, copy, origin = self.layout.copies.T
        rows[row] = w[copy] - w[origin]
        return rows

    def gradient(self, w: Array) -> Array:
        """Return the gradient (size,) of the objective."""
        shots = self._sloped(w)
        if "gradient" not in self._kept:
            self._kept["gradient"] = self._gathered(shots.gradients)
        return self._kept["gradient"]

    def jacobian(self, w: Array) -> Array:
        """Return the nonzeros of the constraints' Jacobian in the order of the pattern."""
        shots, n = self._sloped(w), self.plan.grid.tangent_size
        if "jacobian" in self._kept:
            return self._kept["jacobian"]
        entries = [np.ones(n * self.plan.grid.intervals)]
        entries += [-(s.reached * scale).ravel() for s, scale in zip(shots.slopes, self.local_scale, strict=True)]
        blocks = zip(shots.limit_slopes(self.limit_rows), self.local_scale, strict=True)
        entries += [(block * scale).ravel() for block, scale in blocks]
        copies = np.ones(len(self.layout.copies))
        self._kept["jacobian"] = self.jacobian_pattern.nonzeros(np.concatenate([*entries, copies, -copies]))
        return self._kept["jacobian"]

    def unit_slopes(self) -> Array:
        """Return the nonzeros of the Jacobian if no interval and no limit depended on anything."""
        entries, copies = np.zeros(len(self.jacobian_pattern.place)), len(self.layout.copies)
        entries[: self.layout.nodes.size] = 1
        entries[len(entries) - 2 * copies :] = np.repeat([1, -1], copies)
        return self.jacobian_pattern.nonzeros(entries)

    def hessian(self, w: Array, factor: float, multipliers: Array, upper: bool) -> Array:
        """Return nonzeros of the Hessian of factor * objective + multipliers . constraints, or its upper half."""
        if self.exact:
            blocks = self._differences(w, factor, multipliers)
        else:
            blocks = [factor * block for block in self._sloped(w).gauss_newton()]
        scaled = [block * np.outer(s, s) for block, s in zip(blocks, self.local_scale, strict=True)]
        entries = np.concatenate([block.ravel() for block in scaled])
        return self.upper_pattern.nonzeros(entries[self.upper]) if upper else self.hessian_pattern.nonzeros(entries)

    def _sloped(self, w: Array) -> Shots:
        shots = self.shots(w)
        if "slopes" not in shots.__dict__:
            self.work += Counts.of_slopes(self.plan.problem.tangent_size)
        return shots

    def _gathered(self, local: list[Array]) -> Array:
        """Return (size,) the sum of local gradients."""
        scaled = [gradient * scale for gradient, scale in zip(local, self.local_scale, strict=True)]
        indices = np.concatenate(self.layout.local)
        return np.bincount(indices, weights=np.concatenate(scaled), minlength=self.layout.size).astype(float)

    def _jacobian_pattern(self) -> ScatterPattern:
        layout = self.layout
        rows, columns = [layout.defects.ravel()], [layout.nodes.ravel()]
        blocks = [*zip(layout.defects, layout.local[:-1], strict=True)]
        blocks += [(layout.limits[here], local) for here, local in zip(self.limit_rows, layout.local, strict=True)]
        for block_rows, local in blocks:
            rows.append(np.repeat(block_rows, len(local)))
            columns.append(np.tile(local, len(block_rows)))
        row, copy, origin = layout.copies.T
        rows += [row, row]
        columns += [copy, origin]
        return pattern((layout.rows, layout.size), np.concatenate(rows), np.concatenate(columns))

    def _differences(self, w: Array, factor: float, multipliers: Array) -> list[Array]:
        """Return blocks of the exact Hessian: all stages move at once along one local entry.

        Local gradients depend on the own local vector alone, so each move gives a column of every block.
        """
        grid, base = self.plan.grid, self._sloped(w)
        before = self._lagrangian(base, factor, multipliers)
        blocks = [np.zeros((len(each), len(each))) for each in before]
        statics, knots = len(grid.statics), max(len(each) for each in grid.knots)
        # Columns of the node tangents, all nodes at once.
        for column in range(grid.tangent_size):
            d = base.d.copy()
            d[:, column] += DIFFERENCE_STEP
            after = self._lagrangian(self._moved(base.motion.z, base.motion.u, d), factor, multipliers)
            for stage in range(1, grid.intervals + 1):
                blocks[stage][:, column] = (after[stage] - before[stage]) / DIFFERENCE_STEP
        # Columns of the knots: each stage moves its own knot.
        for column in range(knots):
            u, moving = base.motion.u.copy(), [stage for stage, own in enumerate(grid.knots) if column < len(own)]
            steps = {stage: DIFFERENCE_STEP * self.scale[grid.knots[stage][column]] for stage in moving}
            for stage, step in steps.items():
                u[list(grid.steps(stage))] += step * grid.shares[stage][:, :, column]
            after = self._lagrangian(self._moved(base.motion.z, u, base.d), factor, multipliers)
            for stage, step in steps.items():
                blocks[stage][:, grid.node_size(stage) + column] = (after[stage] - before[stage]) / step
        # Columns of the static entries, which all stages share.
        for column in range(statics):
            z = base.motion.z.copy()
            step = DIFFERENCE_STEP * self.scale[grid.statics[column]]
            z[grid.statics[column]] += step
            after = self._lagrangian(self._moved(z, base.motion.u, base.d), factor, multipliers)
            for stage, block in enumerate(blocks):
                block[:, grid.static_part(stage).start + column] = (after[stage] - before[stage]) / step
        return [(block + block.T) / 2 for block in blocks]

    def _moved(self, z: Array, u: Array, d: Array) -> Shots:
        self.work += Counts(rollouts=1) + Counts.of_slopes(self.plan.problem.tangent_size)
        return Shots(self.plan, z, u, d)

    def _lagrangian(self, shots: Shots, factor: float, multipliers: Array) -> list[Array]:
        """Return local gradients of the Lagrangian, without the tangents' own part."""
        lagrangians = [factor * gradient for gradient in shots.gradients]
        if len(self.layout.limits):
            blocks = shots.limit_slopes(self.limit_rows)
            for gradient, block, here in zip(lagrangians, blocks, self.limit_rows, strict=True):
                gradient += multipliers[self.layout.limits[here]] @ block
        for gradient, slopes, rows in zip(lagrangians, shots.slopes, self.layout.defects, strict=False):
            gradient -= multipliers[rows] @ slopes.reached
        return lagrangians


STARTS, DEFECTS, LIMITS, BOUNDS, BARRIER = "starts", "defects", "limits", "bounds", "barrier"
"""Names of the arrays: (M + 1,), (M, n), (c,), (len(z),) and ()."""


@dataclass(frozen=True)
class NlpMultipliers:
    """Multipliers in the layout of a program, by which another solve, by either library, starts.

    By name they are those of the defects, each in the tangent of its own node, of the limits, and of the bounds of z,
    unscaled. In the layout in stages the rows of copies have multipliers too, which follow from these.

    Attributes:
        bounds: (size,) of w's bounds; empty: there are none, as for the rows.
        rows: (rows,), those of defects for tangents that begin at the nodes.
        barrier: mu there.
    """

    bounds: Array
    rows: Array
    barrier: float

    def by_name(self, nlp: MultipleShootingNlp) -> dict[str, Array]:
        """Return the multipliers as named arrays; empty if there are none."""
        if not self.rows.size:
            return {}
        layout = nlp.layout
        return {
            STARTS: np.asarray(nlp.plan.grid.starts, float),
            DEFECTS: self.rows[layout.defects],
            LIMITS: self.rows[layout.limits],
            BOUNDS: self.bounds[layout.home] / nlp.scale,
            BARRIER: np.asarray(self.barrier),
        }


def fitted(nlp: MultipleShootingNlp, saved: Mapping[str, Array]) -> NlpMultipliers | None:
    """Arrange named multipliers in the layout of a program; None if nodes or limits differ.

    Steps may be shorter or longer: nodes are compared as shares of the duration.
    """
    layout, starts = nlp.layout, nlp.plan.grid.starts
    shapes = {
        STARTS: starts.shape,
        DEFECTS: layout.defects.shape,
        LIMITS: layout.limits.shape,
        BOUNDS: nlp.scale.shape,
        BARRIER: (),
    }
    if any(name not in saved or np.shape(saved[name]) != shape for name, shape in shapes.items()):
        return None
    if not all(np.isfinite(saved[name]).all() for name in shapes):
        return None
    if not np.allclose(saved[STARTS] * starts[-1], starts * saved[STARTS][-1]):
        return None
    bounds, rows = np.zeros(layout.size), np.zeros(layout.rows)
    bounds[layout.home] = saved[BOUNDS] * nlp.scale
    rows[layout.defects], rows[layout.limits] = saved[DEFECTS], saved[LIMITS]
    return NlpMultipliers(bounds, rows, float(saved[BARRIER]))


def at_nodes(nlp: MultipleShootingNlp, w: Array, rows: Array) -> Array:
    """Transform the rows (rows,) of the defects from tangents at w's references to tangents at its nodes."""
    moved = rows.copy()
    if rows.size:
        turns, defects = nlp.shots(w).turns, nlp.layout.defects
        moved[defects] = np.linalg.solve(turns.transpose(0, 2, 1), rows[defects][:, :, None])[:, :, 0]
    return moved


def barrier_at(nlp: MultipleShootingNlp, lower: Array, upper: Array, w: Array, bounds: Array, rows: Array) -> float:
    """Return the mean product of multipliers and distances from their bounds, clipped for IPOPT's start.

    Bounds (len(z),) are those of z; w (size,) is the iterate, ``bounds`` (size,) and ``rows`` its multipliers.
    """
    products = []
    limits = (nlp.bounds(lower, upper), nlp.row_bounds())
    for at, duals, (low, high) in zip((w, nlp.constraints(w)), (bounds, rows), limits, strict=True):
        bounded = (low < high) & (np.isfinite(low) | np.isfinite(high))
        if duals.size and bounded.any():
            distance = np.minimum((at - low)[bounded], (high - at)[bounded])
            products.append(np.abs(duals[bounded]) * distance.clip(min=0))
    return float(np.clip(np.mean(np.concatenate(products)), 1e-9, 0.1)) if products else 1e-2


class Programs:
    """Makes the program of a stage of smoothing at any references, with the same grid and layout."""

    def __init__(
        self,
        problem: StagedProblem,
        grid: IntervalGrid,
        evaluator: CountingEvaluator,
        z: Array,
        nodes: Array,
        in_stages: bool,
        exact: bool,
    ) -> None:
        """Find the stages that limits depend on, and what all steps share, at lines between the nodes.

        Args:
            problem: the staged problem.
            grid: its intervals.
            evaluator: has the scale of z, and the smoothing.
            z: (n,) of the guess.
            nodes: (M, nx) of the guess.
            in_stages: whether the layout is in stages, for FATROP.
            exact: whether Hessians are exact.
        """
        self.problem, self.grid, self.evaluator, self.exact = problem, grid, evaluator, exact
        corners = np.concatenate([problem.start(z[None]), nodes])
        x = interpolated(problem, corners, np.linspace(0, 1, problem.steps + 1))
        u = np.asarray(problem.weights @ z).reshape(problem.steps, problem.input_size)
        motion = StagedMotion(z, x, u, evaluator.smoothing)
        self.steps, self.curved = IntervalSteps(problem, motion), curved_columns(problem, nodes)
        stages: list[set[int]] = [set() for _ in problem.lower]
        if stages:
            _, by_state, by_input, _ = problem.limit_slopes(motion)
            owner = self.grid.stage_of_state
            for slopes, size in ((by_state, problem.tangent_size), (by_input, problem.input_size)):
                rows, columns = slopes.tocoo().coords
                for row, of in zip(rows.tolist(), owner[columns // size].tolist(), strict=True):
                    stages[row].add(of)
        found = [sorted(each) or [0] for each in stages]
        count = self.grid.intervals + 1
        self.limit_rows = [np.array([r for r, of in enumerate(found) if j in of], np.int64) for j in range(count)]
        variables = evaluator.problem.n
        self.layout = staged(self.grid, variables, found) if in_stages else shared(self.grid, variables, len(stages))

    def at(self, reference: Array) -> MultipleShootingNlp:
        """Return the program with tangents at these states (M, nx)."""
        plan = ShootingPlan(self.problem, self.grid, self.steps, reference, self.evaluator.smoothing, self.curved)
        return MultipleShootingNlp(plan, self.layout, self.limit_rows, self.evaluator.scale, self.exact)
