"""The motion as it is played in the page: decimated, rounded, and the element that plays it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symphys.records import dataclass
from symphys.report.charts import palette
from symphys.report.pages.markup import Html, dot, join, packed_json, tag
from symphys.report.robots.branches import colours, keys, linked, traced
from symphys.report.robots.joint_positions import axes_of, drawable
from symphys.report.scene.ghosts import MEASURED
from symphys.report.scene.views import SIDE_YZ, TOP, choose_views, reach, solids_of
from symphys.results.film import FilmMotions
from symphys.results.polytope import Polytope
from symphys.results.scene import Scene, SceneMark, SceneTerrain, Solid
from symphys.trajectory import Trajectory
from symphys.types import Array

NUMBERS = 10_000
"""How many numbers a page carries at most for one motion; the player goes evenly from one pose to the next."""
LEAST_FRAMES, MOST_FRAMES = 40, 600
QUANTA = 4000
"""Steps from the least to the largest number of a film."""
GUESS_POINTS = 120
SPEEDS = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0)
LEAST_PLAY = 3.0
"""[s] a motion plays at least, slowed down if need be."""


def animation(
    trajectory: Trajectory,
    scene: Scene,
    guess: Trajectory | None = None,
    numbers: int = NUMBERS,
    others: Sequence[Html] = (),
    film: Film | None = None,
) -> Html:
    """Return a canvas with play, time and view controls, and its data.

    Args:
        trajectory: that is played.
        scene: around it.
        guess: whose paths are drawn.
        numbers: that the motion takes at most.
        others: motions that links of the page show; see ``other_motion``.
        film: motions along the solve.
    """
    legend = [join([dot(colour), palette.short(name, 24)]) for name, colour in keys(trajectory, scene)]
    return tag(
        "div",
        tag("canvas", tabindex="0", role="img", aria_label="The motion, played; drag to turn"),
        tag("div", *(tag("span", part) for part in legend), class_="legend") if legend else "",
        controls(float(trajectory.time[-1] - trajectory.time[0]), follow_data(trajectory, scene) is not None),
        film_controls(film) if film else "",
        tag("p", STAGED, class_="caption", data_stage="", hidden="") if trajectory.contact_names or scene.marks else "",
        packed_json(motion_data(trajectory, scene, guess, numbers)),
        *([tag("p", "", class_="caption shown", aria_live="polite"), *others] if others else []),
        class_="animation",
    )


@dataclass(frozen=True)
class Film:
    """Motions along a solve, with the ``labels`` (K,) and the ``work`` [rollouts] (K,) of each, nan where unknown."""

    motions: FilmMotions
    labels: tuple[str, ...]
    work: Array


def film_controls(film: Film) -> Html:
    """Return a slider from the guess to the solution, with its motions."""
    last = str(len(film.labels) - 1)
    slider = tag("input", type="range", min="0", max=last, value=last, step="1", aria_label="Iteration of the solve")
    play = tag("button", "▶ solve", type="button", aria_label="Play the solve")
    motions = film.motions
    data = {
        "labels": list(film.labels),
        "work": [None if np.isnan(at) else float(at) for at in film.work],
        "time": [rounded(row, 1e-4) for row in motions.time],
        "frames": motions.time.shape[1],
        **quantised("position", motions.position),
        **quantised("orientation", motions.orientation),
    }
    return tag("div", play, slider, tag("output", ""), packed_json(data, data_film=""), class_="controls film")


def quantised(name: str, values: Array) -> dict[str, object]:
    """Return numbers (K, F, B, c) as whole multiples of a unit, in differences from frame to frame."""
    unit = float(np.ptp(values)) / QUANTA or 1.0
    whole = np.round(values / unit).astype(np.int64)
    whole[:, 1:] = np.diff(whole, axis=1)
    return {name: [row.ravel().tolist() for row in whole], f"{name}_unit": unit}


def other_motion(trajectory: Trajectory, scene: Scene, numbers: int, link: str, title: str) -> Html:
    """Return the data of a motion that is played while the pointer is on a ``link`` of the page."""
    return packed_json(motion_data(trajectory, scene, None, numbers), data_of=link, data_title=title)


def controls(duration: float, follows: bool) -> Html:
    """Play button, slider, time, speed and views, and whether the camera can follow."""
    fitting = [speed for speed in SPEEDS if speed <= 1 and duration / speed >= LEAST_PLAY]
    chosen = max(fitting, default=SPEEDS[0])
    speeds = [tag("option", f"{s:g}×", value=f"{s:g}", selected="" if s == chosen else None) for s in SPEEDS]  # noqa: RUF001
    views = [tag("button", title, type="button", data_view=key) for key, title in VIEW_TITLES]
    return tag(
        "div",
        tag("button", "▶", type="button", class_="play", aria_label="Play or pause"),
        tag("input", type="range", min="0", max="1000", value="0", step="1", aria_label="Time"),
        tag("output", ""),
        tag("select", *speeds, aria_label="Speed"),
        tag("span", *views, class_="views"),
        tag("span", tag("button", "Follow", **FOLLOW), class_="views") if follows else "",
        tag("span", tag("button", "Picture", type="button", data_picture=""), class_="views", data_stage="", hidden=""),
        class_="controls",
    )


STAGED = (
    "Arrows: contact forces, green where surfaces hold, orange where they slip, with the cone "
    "that friction allows. Pink: what a target asks for. Drag to turn, wheel or pinch to zoom, right button to shift."
)
FOLLOW = {"type": "button", "data_follow": "", "aria_pressed": "true"}
VIEW_TITLES = (("space", "3D"), ("side", "Side"), ("top", "Top"))


def motion_data(trajectory: Trajectory, scene: Scene, guess: Trajectory | None, numbers: int) -> dict[str, object]:
    """Return what animation.js and joints.js read; lists are flat, frame after frame, body after body."""
    bodies = len(trajectory.body_names)
    frames = int(np.clip(numbers // (7 * bodies), LEAST_FRAMES, MOST_FRAMES))
    chosen = even(len(trajectory.time), frames)
    views = choose_views(trajectory, scene)
    return {
        "time": rounded(trajectory.time[chosen], 1e-6),
        "bodies": body_data(trajectory, scene),
        "position": rounded(trajectory.position[chosen], 1e-5),
        "orientation": rounded(trajectory.orientation[chosen], 1e-4),
        "guess": [] if guess is None else guess_data(guess, scene),
        "planes": [{"normal": rounded(p.normal, 1e-9), "offset": float(p.offset)} for p in scene.planes],
        "fixtures": [solid_data(fixture.solid) for fixture in scene.fixtures],
        "terrain": [terrain_data(ground) for ground in scene.terrain],
        "flat": views[0] == TOP,
        "along": "y" if views[0] == SIDE_YZ else "x",
        "axes": list(palette.AXES),
        "joints": joint_data(trajectory, scene),
        "follow": follow_data(trajectory, scene),
        "marks": [mark_data(mark) for mark in scene.marks],
        "forces": force_data(trajectory, scene, chosen),
    }


def mark_data(mark: SceneMark) -> dict[str, object]:
    """Return a place that is asked for; null for coordinates that are free."""
    at = [None if np.isnan(x) else x for x in mark.at.tolist()]
    return {"name": palette.short(mark.name, 28), "at": at, "tolerance": mark.tolerance, "limit": mark.limit}


def force_data(trajectory: Trajectory, scene: Scene, chosen: Array) -> dict[str, object] | None:
    """Return the forces of contacts that ever act at the chosen frames, the largest until the next; None without any.

    ``values`` are flat, frame after frame, contact after contact. ``largest``: what all but the highest peaks stay
    below.
    """
    known, index = (
        {contact.name: contact for contact in scene.contacts},
        {n: k for k, n in enumerate(trajectory.body_names)},
    )
    of: dict[str, list[int]] = {}
    for column, name in enumerate(trajectory.contact_names):
        of.setdefault(name.partition(":")[0], []).append(column)
    pairs, columns = [], []
    for name, own in of.items():
        force = trajectory.contact_force[:, own].sum(axis=1)
        if (
            name in known
            and known[name].body in index
            and np.abs(force).max(initial=0.0) > 0
            and np.isfinite(force).all()
        ):
            pairs.append(known[name])
            columns.append(largest_between(force, chosen))
    if not pairs:
        return None
    values = np.stack(columns, axis=1)
    sizes = np.linalg.norm(values, axis=2)
    planes = {plane.name: plane for plane in scene.planes}
    return {
        "pairs": [
            {
                "body": index[pair.body],
                "solid": pair.solid if pair.solid >= 0 else None,
                "normal": rounded(planes[pair.other].normal, 1e-9) if pair.other in planes else None,
                "friction": None if np.isnan(pair.friction) else pair.friction,
            }
            for pair in pairs
        ],
        "values": rounded(values, 1e-4),
        "largest": float(np.quantile(sizes[sizes > 0], ORDINARY)) if (sizes > 0).any() else 1.0,
    }


def largest_between(force: Array, chosen: Array) -> Array:
    """Return, of forces (N, 3) in steps, the largest from each frame until the next one (F, 3)."""
    sizes, found = np.linalg.norm(force, axis=1), np.zeros((len(chosen), 3))
    ends = [*chosen[1:].tolist(), len(force)]
    for k, (start, end) in enumerate(zip(chosen.tolist(), ends, strict=True)):
        if start < min(end, len(force)):
            found[k] = force[start + int(sizes[start:end].argmax())]
    return found


def body_data(trajectory: Trajectory, scene: Scene) -> list[dict[str, object]]:
    """Colour and solids of each body, and whether its path is drawn."""
    names, kept = trajectory.body_names, traced(trajectory, scene)
    return [
        {
            "colour": colour,
            "solids": list(map(solid_data, solids_of(trajectory, scene, body))),
            "path": names[body] in kept,
            "ghost": names[body].endswith(MEASURED),
        }
        for body, colour in enumerate(colours(trajectory, scene))
    ]


def solid_data(solid: Solid) -> dict[str, object]:
    """Radius, centre, and unless it is a ball corners and orientation; of a polytope also ``face_data``."""
    data: dict[str, object] = {"radius": solid.radius, "centre": rounded(solid.centre, 1e-6)}
    if not solid.is_ball:
        data |= {"corners": rounded(solid.corners, 1e-6), "q": rounded(solid.orientation, 1e-7)}
    return data if len(solid.corners) < 3 else data | face_data(solid.polytope)


def face_data(polytope: Polytope) -> dict[str, object]:
    """The corners of each face, counter-clockwise from outside; the face beyond each of its edges that is not drawn.

    The latter, ``smooth``, has -1 for edges that are drawn. It is left out where all of them are.
    """
    faces = [list(face) for face in polytope.faces]
    if polytope.sharp.all():
        return {"faces": faces}
    smooth = [[-1] * len(face) for face in faces]
    for first, second, left, right in polytope.edges[~polytope.sharp].tolist():
        smooth[left][faces[left].index(first)] = right
        smooth[right][faces[right].index(second)] = left
    return {"faces": faces, "smooth": smooth}


def terrain_data(ground: SceneTerrain) -> dict[str, object]:
    """Rising x and y, and heights row after row; null where there is none."""
    z = rounded(np.nan_to_num(ground.z), 1e-5)
    holes = np.isnan(ground.z).ravel()
    heights = [None if hole else height for height, hole in zip(z, holes, strict=True)]
    return {"x": rounded(ground.x, 1e-6), "y": rounded(ground.y, 1e-6), "z": heights}


def guess_data(guess: Trajectory, scene: Scene) -> list[list[float]]:
    """The guess's paths, flat, of the bodies whose path is drawn."""
    kept, shots = traced(guess, scene), even(len(guess.time), GUESS_POINTS)
    return [rounded(guess.position[shots, body], 1e-4) for body, name in enumerate(guess.body_names) if name in kept]


def even(count: int, most: int) -> Array:
    """Return at most ``most`` indices below ``count``, evenly apart, the first and the last among them."""
    return np.linspace(0, count - 1, min(count, most)).round().astype(int)


def rounded(values: Array, share: float) -> list[float]:
    """Flat, rounded to decimals that are ``share`` of the largest number."""
    largest = float(np.abs(values).max(initial=0.0))
    decimals = int(np.ceil(-np.log10(share * largest))) if largest > 0 else 0
    return [entry + 0.0 for entry in np.round(values.ravel(), max(decimals, 0)).tolist()]


ORDINARY = 0.9
"""Share of contact forces that are drawn to scale; higher ones are impacts."""
FOLLOW_DISTANCE = 2.5
"""The camera follows where bodies connected by joints travel farther than so many times their size."""


def joint_data(trajectory: Trajectory, scene: Scene) -> list[dict[str, object]]:
    """Return the sides of each joint, index of the body (-1: the world) and point, and its axes: [side, direction]."""
    index = {name: body for body, name in enumerate(trajectory.body_names)} | {"": -1}
    return [
        {
            "sides": [
                {"body": index[name], "point": frame.point.round(6).tolist()}
                for name, frame in zip((joint.first, joint.second), joint.frames, strict=True)
            ],
            "axes": [[side, direction.round(6).tolist()] for side, direction in axes_of(joint)],
            "square": not joint.rotates,
        }
        for joint in drawable(trajectory, scene)
    ]


def follow_data(trajectory: Trajectory, scene: Scene) -> dict[str, object] | None:
    """The bodies connected by joints, how high they are on average, and how far they reach [m]; None if they stay."""
    bodies = list(linked(trajectory, scene))
    if not bodies:
        return None
    place = trajectory.position[:, bodies]
    middle = place.mean(axis=1)
    middle[:, 2] = middle[:, 2].mean()
    sizes = [reach(trajectory, scene, body) for body in bodies]
    radius = float((np.linalg.norm(place - middle[:, None], axis=2) + sizes).max())
    if np.ptp(middle, axis=0).max() <= FOLLOW_DISTANCE * 2 * radius:
        return None
    return {"bodies": bodies, "height": round(float(middle[0, 2]), 6), "radius": round(radius, 6)}
