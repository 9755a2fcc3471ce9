"""The motion as it is played in the page: decimated, rounded, and the element that plays it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symphys.report.charts import palette
from symphys.report.pages.markup import Html, dot, join, packed_json, tag
from symphys.report.robots.branches import colours, keys, linked, traced
from symphys.report.robots.joint_positions import axes_of, drawable
from symphys.report.scene.ghosts import MEASURED
from symphys.report.scene.views import SIDE_YZ, TOP, choose_views, reach, solids_of
from symphys.results.polytope import Polytope
from symphys.results.scene import Scene, SceneTerrain, Solid
from symphys.trajectory import Trajectory
from symphys.types import Array

NUMBERS = 10_000
"""How many numbers a page carries at most for one motion; the player goes evenly from one pose to the next."""
LEAST_FRAMES, MOST_FRAMES = 40, 600
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
) -> Html:
    """Return a canvas with play, time and view controls, and its data of at most ``numbers`` numbers.

    ``others`` are motions that links of the page show; see ``other_motion``.
    """
    legend = [join([dot(colour), palette.short(name, 24)]) for name, colour in keys(trajectory, scene)]
    return tag(
        "div",
        tag("canvas", tabindex="0", role="img", aria_label="The motion, played; drag to turn"),
        tag("div", *(tag("span", part) for part in legend), class_="legend") if legend else "",
        controls(float(trajectory.time[-1] - trajectory.time[0]), follow_data(trajectory, scene) is not None),
        packed_json(motion_data(trajectory, scene, guess, numbers)),
        *([tag("p", "", class_="caption shown", aria_live="polite"), *others] if others else []),
        class_="animation",
    )


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
        class_="controls",
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
    }


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
