"""When bodies of a robot stand on the ground, and the gait diagram: a bar for each foot while it carries load."""

from __future__ import annotations

import numpy as np

from symphys.findings.writing import percent
from symphys.records import dataclass
from symphys.report.charts.chart import Bars, Chart, Panel
from symphys.report.charts.contacts import labels, pair_of
from symphys.report.charts.tables import TIME
from symphys.report.robots.branches import colours, linked
from symphys.results.scene import Scene
from symphys.trajectory import Trajectory
from symphys.types import Array, Bools

LOADED_SHARE = 0.02
"""A body stands where it carries more than this share of the weight of all that joints hold."""
MOST_ROWS = 24
"""Bodies in a gait diagram, at most: those that come down most often."""


@dataclass(frozen=True)
class Stance:
    """A body that stands at times: ``stands`` (N,), whether it does in each step."""

    body: int
    stands: Bools

    @property
    def duty(self) -> float:
        """Return the share of the time in which it stands."""
        return float(self.stands.mean())


def spans(holds: Bools) -> list[tuple[int, int]]:
    """Return (start, stop) of every run of True in a mask (N,): it holds in the steps from start to stop - 1."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(int)))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]


def weight(trajectory: Trajectory, scene: Scene) -> float:
    """Return the weight [N] of all bodies that joints hold; nan where a mass or gravity is not known."""
    names = {trajectory.body_names[body] for body in linked(trajectory, scene)}
    return scene.weight_per_mass * sum(body.mass for body in scene.bodies if body.name in names)


def stances(trajectory: Trajectory, scene: Scene) -> list[Stance]:
    """Return the bodies that ever stand; none where no weight is known."""
    least = LOADED_SHARE * weight(trajectory, scene)
    if not least > 0:
        return []
    ground = [static.name for kind in (scene.planes, scene.fixtures, scene.terrain) for static in kind]
    held = set(linked(trajectory, scene))
    standing = [(label, body) for label, body, _ in labels(trajectory, scene) if body in held]
    owners = {f"{label}-{name}": body for label, body in standing for name in ground}
    loads: dict[int, Array] = {}
    for index, name in enumerate(trajectory.contact_names):
        body = owners.get(pair_of(name))
        if body is not None:
            loads[body] = loads.get(body, 0) + trajectory.contact_force[:, index]
    found = [Stance(body, np.linalg.norm(load, axis=1) > least) for body, load in sorted(loads.items())]
    return [stance for stance in found if stance.stands.any()]


def gait_chart(trajectory: Trajectory, scene: Scene) -> Chart | None:
    """Chart when each body stands; None where no body comes down or leaves the ground."""
    found = stances(trajectory, scene)
    if all(stance.stands.all() for stance in found):
        return None
    colour, time, names = colours(trajectory, scene), trajectory.time, trajectory.body_names
    often = sorted(found, key=lambda stance: len(spans(stance.stands)), reverse=True)[:MOST_ROWS]
    bars, tables = list[Bars](), []
    for stance in sorted(often, key=lambda stance: stance.body):
        name, ends = names[stance.body], time[np.array(spans(stance.stands))]
        parts = tuple((round(float(a), 6), round(float(b), 6)) for a, b in ends)
        bars.append(Bars(name, colour[stance.body], parts, percent(stance.duty)))
        tables.append({f"{name}.stands from [s]": ends[:, 0], f"{name}.stands until [s]": ends[:, 1]})
    whole = float(time[0]), float(time[-1])
    panel = Panel("On the ground, and the duty factor", along=TIME, bars=tuple(bars), least=whole)
    alt, tall = "Which feet stand on the ground, over time", 0.25 + 0.3 * len(bars)
    return Chart("gait", alt, (panel,), tables=tuple(tables), height=tall)
