"""The features of problem files, each in a problem of a dozen steps at a point where every derivative counts.

A new feature of problem files gets a row here; tests/transcription/test_agreement.py tries it in every way to evaluate.
"""

from __future__ import annotations

import re
from typing import Any

Tables = dict[str, Any]
BALL: Tables = {
    "name": "ball",
    "shape": {"sphere": {"radius": 0.1}},
    "mass": 0.5,
    "position": [0, 0, 0.13],
    "angular_velocity": [1, 2, 8],
}
DUMBBELL: Tables = {
    **BALL,
    "shape": {"spheres": [{"radius": 0.1, "centre": [x, 0, 0]} for x in (-0.06, 0.05)]},
    "inertia": [4e-3, 6e-3, 5e-3],
}
THROW: Tables = {"name": "throw", "sets": "ball.velocity", "guess": [4, 1, -1]}
PUSH: Tables = {"name": "push", "sets": "ball.force[0]", "knots": 3, "guess": [1, -2, 3]}
WHERE: Tables = {
    "name": "where",
    "value": "sumsqr(ball.position - [0.3, 0.2, 0.4]) + 0.01 * sumsqr(ball.velocity + 0.1 * ball.angular_velocity)",
}
ARM: Tables = {"name": "arm", "mass": 1.0, "inertia": [0.02, 0.03, 0.01], "position": [0, 2, 1], "collides_with": []}
HINGE: Tables = {"name": "hinge", "between": ["world", "arm"], "hinge": {"axis": [0, 1, 0]}, "point": [0, 2, 1.3]}
SERVO: Tables = {"servo": {"gain": 4, "torque": 300, "velocity": 20}}
AIM: Tables = {"name": "aim", "sets": "hinge.command", "knots": 3, "guess": [0.6, -0.2, 0.9]}
TURNED: Tables = {"name": "turned", "value": "exp(hinge.angle) + 0.1 * hinge.rate**2"}
FLIGHT: Tables = {**BALL, "position": [0, 0, 2]}


def thrown(*variables: Tables, **tables: Any) -> Tables:
    """A ball that lands on rough ground within a dozen steps."""
    ground = {} if "terrain" in tables else {"ground": {"friction": 0.4, "restitution": 0.3}}
    return {
        "simulation": {"duration": 0.12, "dt": 0.01, **tables.pop("simulation", {})},
        **ground,
        "body": [BALL],
        "variable": [THROW, *variables],
        "cost": [WHERE, *tables.pop("more", [])],
        **tables,
    }


def swung(*variables: Tables, hinge: Tables | None = None, **tables: Any) -> Tables:
    """An arm on a hinge, with a motor."""
    return {
        "simulation": {"duration": 0.12, "dt": 0.01},
        "body": [ARM],
        "joint": [{**HINGE, "motor": SERVO, **(hinge or {})}],
        "variable": [AIM, *variables],
        "cost": [TURNED, *tables.pop("more", [])],
        **tables,
    }


def varied(name: str, guess: Any = None) -> Tables:
    """A variable that sets what it is called after."""
    return {"name": re.sub(r"\W", "_", name), "sets": name, **({} if guess is None else {"guess": guess})}


BOARDS: Tables = {
    "simulation": {"duration": 0.05, "dt": 0.01, "sweeps": 6, "cuts": 0},
    "block": [
        {"name": side, "shape": {"box": {"size": [0.2, 0.6, 0.1]}}, "position": [x, 0, -0.05], "friction": 0.5}
        for side, x in (("left", -0.3), ("right", 0.3))
    ],
    "body": [{"name": "box", "shape": {"box": {"size": [0.8, 0.3, 0.2]}}, "mass": 2, "position": [0, 0, 0.1]}],
    "variable": [{"name": "pull", "sets": "box.force", "guess": [3, 15, -2]}],
    "cost": [{"name": "where", "value": "sumsqr(box.position - [1, 2, 0.5]) + sumsqr(box.velocity)"}],
}
LOOP: Tables = {
    "simulation": {"duration": 0.06, "dt": 0.01, "sweeps": 12},
    "body": [
        {"name": name, "mass": 1, "inertia": [0.01, 0.02, 0.015], "position": at, "collides_with": []}
        for name, at in (("crank", [0.15, 0, 1]), ("rod", [0.45, 0, 1]), ("rocker", [0.6, 0, 0.85]))
    ],
    "joint": [
        {**HINGE, "between": ["world", "crank"], "point": [0, 0, 1], "motor": {"torque": {"torque": 20}}},
        {"name": "two", "between": ["crank", "rod"], "ball": {}, "point": [0.3, 0, 1]},
        {
            "name": "three",
            "between": ["rod", "rocker"],
            "universal": {"axes": [[0, 1, 0], [1, 0, 0]]},
            "point": [0.6, 0, 1],
            "spring": {"stiffness": 2, "damping": 0.1},
        },
        {**HINGE, "name": "four", "between": ["world", "rocker"], "point": [0.6, 0, 0.7], "friction": 0.1},
    ],
    "variable": [{**AIM, "guess": [3, -2, 4]}],
    "cost": [{"name": "far", "value": "rod.position[2] + 0.1 * rocker.velocity[0]"}],
}
MOUNT: Tables = {
    "name": "mount",
    "between": ["ball", "mast"],
    "fixed": {},
    "point": [0, 0, 0.2],
    "frequency": 5,
    "damping": 0.3,
}
LEG: Tables = {
    "simulation": {"duration": 0.12, "dt": 0.01, "sweeps": 3, "cuts": 0, "smoothing": 1e-3},
    "ground": {"friction": 0.6},
    "body": [
        {"name": "hull", "mass": 2.0, "inertia": [0.01, 0.02, 0.02], "position": [0, 0, 0.55]},
        {"name": "thigh", "mass": 1.0, "inertia": [0.01, 0.01, 0.002], "position": [0, 0, 0.4]},
        {
            "name": "shin",
            "shape": {"spheres": [{"radius": 0.03, "centre": [0, 0, -0.1]}]},
            "mass": 0.5,
            "inertia": [5e-3, 5e-3, 1e-3],
            "position": [0, 0, 0.14],
        },
    ],
    "joint": [
        {"name": "rail", "between": ["world", "hull"], "slider": {"axis": [0, 0, 1]}},
        {
            "name": "hip",
            "between": ["hull", "thigh"],
            "universal": {"axes": [[0, 1, 0], [1, 0, 0]]},
            "point": [0, 0, 0.52],
            "motor": {"velocity": {"torque": 5, "velocity": 6}},
            "limits_deg": [-40, 60],
        },
        {
            "name": "knee",
            "between": ["thigh", "shin"],
            "hinge": {"axis": [0, 1, 0]},
            "point": [0, 0, 0.27],
            "motor": SERVO,
            "spring": {"stiffness": 5, "damping": 0.1},
        },
    ],
    "variable": [
        {"name": "bend", "sets": "knee.command", "knots": 3, "guess": [-0.2, -0.5, 0.1]},
        {"name": "swing", "sets": "hip.command", "guess": [0.5, 0.3]},
        {"name": "fall", "sets": ["hull.velocity[2]", "thigh.velocity[2]", "shin.velocity[2]"], "guess": -1.5},
        {"name": "stiff", "sets": "knee.stiffness"},
    ],
    "cost": [
        {"name": "place", "value": "sumsqr([hull.position[2] - 0.4, hip.angle, 0.1 * knee.rate])"},
        {"name": "effort", "at": "always", "squares": "knee.torque", "weight": 0.01},
    ],
}
FEEDBACK: Tables = {
    "sensor": [
        {"name": "state", "reads": ["hinge.angle", "hinge.rate", "sin(9 * time)"]},
        {"name": "imu", "reads": ["arm.accelerometer[0]", "arm.gyro[1]", "hinge.command", "hinge.torque"]},
    ],
    "controller": [
        {
            "name": "hold",
            "drives": "hinge.command",
            "senses": ["state", "imu"],
            "scale": 0.5,
            "linear": {"gains": [[0.5, 0.02, 0.1, 1e-3, 0.01, 0.02, 1e-4]], "offsets": 0.3},
        },
        {
            "name": "brain",
            "drives": "hinge.command",
            "senses": ["state"],
            "scale": 0.1,
            "net": {"hidden": [4, 3], "skip": True},
        },
        {
            "name": "shake",
            "drives": "hinge.command",
            "periodic": {"frequency": 2.0, "harmonics": 2, "sines": [0.5, 0.1]},
        },
    ],
}
PATH: Tables = {
    "name": "path",
    "table": {"time": [0, 0.03, 0.07, 0.12], "x": [0, 0.2, 0.1, 0.4]},
    "interpolation": "cubic",
    "delay": 0.01,
}
FEATURES: dict[str, Tables] = {
    "impacts with friction": thrown(*map(varied, ("ground.friction", "ground.restitution"))),
    "smoothed contact": thrown(simulation={"smoothing": 0.05}),
    "soft contact": thrown(contact={"frequency": 10, "damping": 0.3}, ground={"friction": 0.4}),
    "rolling and torsion": thrown(
        *map(varied, ("contact.torsion", "contact.rolling")),
        contact={"torsion": 2e-3, "rolling": 0.01},
        ground={"friction": 0.4},
    ),
    "terrain": thrown(terrain=[{"name": "hill", "height": "0.02 * sin(6 * x)", "friction": 0.3}]),
    "steps that are not cut": thrown(simulation={"cuts": 0, "time_of_impact": False}),
    "load on two boards": BOARDS,
    "a leg that lands": LEG,
    "forces over time": thrown(
        varied("ball.mass"), PUSH, {**PUSH, "name": "lean", "sets": "ball.torque[1]", "interpolation": "linear"}
    ),
    "servo, spring, limits and dry friction": swung(
        *map(varied, ("hinge.stiffness", "hinge.gain", "hinge.armature", "arm.mass")),
        hinge={
            "spring": {"stiffness": 3, "damping": 0.05, "rest": 0.2},
            "limits": [-0.2, 0.25],
            "friction": 0.05,
            "armature": 0.02,
            "start": 0.1,
        },
    ),
    "velocity motor": swung(hinge={"motor": {"velocity": {"torque": 300, "velocity": 8}}}),
    "affine motor": swung(hinge={"motor": {"affine": {"gain": 2, "kp": -3, "kv": -0.1, "gear": 4}}}),
    "motor of a site": thrown(
        {"name": "jet", "sets": "nozzle.command", "knots": 3, "guess": [2, -1, 3]},
        varied("ball.mass"),
        site=[
            {
                "name": "nozzle",
                "body": "ball",
                "position": [0.05, 0.02, -0.03],
                "orientation": {"pitch_deg": 30},
                "motor": {"force": [1, 0.5, 2], "torque": [0.01, 0, 0.03], "command_range": [-2, 5]},
            }
        ],
        more=[{"name": "effort", "at": "always", "squares": "0.1 * nozzle.command"}],
    ),
    "universal joint": {
        "simulation": {"duration": 0.12, "dt": 0.01},
        "body": [{**ARM, "name": "base", "position": [0, 2, 1.6], "angular_velocity": [0.3, -0.2, 0.5]}, ARM],
        "joint": [
            {
                **{key: value for key, value in HINGE.items() if key != "hinge"},
                "between": ["base", "arm"],
                "universal": {"axes": [[0, 1, 0], [1, 0, 0]]},
                "motor": SERVO,
            }
        ],
        "variable": [{**AIM, "knots": 2, "guess": [[0.6, -0.4], [0.2, 0.5]]}],
        "cost": [{"name": "turned", "value": "sumsqr(hinge.angle - [1, 0.5]) + sumsqr(0.1 * hinge.rate)"}],
    },
    "loop of joints": LOOP,
    "soft joint": thrown(
        body=[BALL, {**ARM, "name": "mast", "position": [0, 0, 0.4]}],
        joint=[MOUNT],
        variable=[THROW, {"name": "shove", "sets": "mast.velocity", "guess": [0.5, 0, 0.2]}],
    ),
    "coupling": swung(
        body=[ARM, {**ARM, "name": "nut", "position": [0, 2, 0.8]}],
        joint=[
            {**HINGE, "motor": SERVO},
            {"name": "screw", "between": ["arm", "nut"], "slider": {"axis": [0, 0, 1]}},
        ],
        coupling=[{"name": "thread", "joints": ["screw", "hinge"], "polynomial": [0, 0.05, 0.01]}],
        more=[{"name": "lifted", "value": "sumsqr(nut.position[2] - 1.5)"}],
    ),
    "screw": swung(
        varied("screw.pitch"),
        {"name": "drive", "sets": "screw.command", "knots": 2, "guess": [0.3, -0.2]},
        body=[ARM, {**ARM, "name": "nut", "position": [0.1, 2, 0.8]}],
        joint=[
            {**HINGE, "motor": SERVO},
            {
                "name": "screw",
                "between": ["arm", "nut"],
                "helical": {"axis": [0.2, 0.1, 1], "pitch": 0.3},
                "point": [0.05, 2, 0.9],
                "start": 0.4,
                "motor": {"torque": {"torque": 2}},
                "spring": {"stiffness": 0.5, "damping": 0.01},
                "limits": [-9, 9],
            },
        ],
        more=[{"name": "lifted", "value": "sumsqr(nut.position - [0, 2, 1.5]) + 0.01 * sumsqr(nut.velocity)"}],
    ),
    "anchor and start of a joint": swung(varied("hinge.anchor[2]", 0.3), varied("hinge.start", 0.4)),
    "orientation": thrown(
        body=[{**DUMBBELL, "position": [0, 0, 0.22]}],
        variable=[
            THROW,
            {"name": "held", "sets": "ball.orientation", "guess": [0.9, 0.2, -0.3, 0.4]},
        ],
        more=[{"name": "upright", "value": "sumsqr(rotate(ball.orientation, [1, 0, 0]) - [0, 1, 0])"}],
    ),
    "inertia and centre of mass": thrown(
        *map(varied, ("ball.second_moments", "ball.correlations", "ball.centre_of_mass", "ground.tilt")),
        body=[DUMBBELL],
    ),
    "numbers that phases set": swung(
        varied("late.gravity[2]"),
        varied("early.hinge.gain"),
        phase=[
            {"name": "early", "share": 0.4, "sets": {"hinge.gain": 5.0}},
            {"name": "late", "sets": {"gravity": [0.5, 0.0, -3.0], "hinge.torque": 200.0}},
        ],
        more=[{"name": "then", "during": "late", "squares": "hinge.rate"}],
    ),
    "contact that phases set": thrown(
        *map(varied, ("early.ground.friction", "late.ground.restitution", "ground.friction")),
        phase=[
            {"name": "early", "share": 0.4, "sets": {"ground.friction": 0.1}},
            {"name": "late", "sets": {"ground.restitution": 0.8, "gravity": [0.5, 0, -30]}},
        ],
        constraint=[{"name": "cone", "at": "always", "value": "ground.friction * ball.position[2]", "upper": 0.03}],
    ),
    "friction along and across a direction": thrown(
        varied("ball.friction", [0.7, 0.2]),
        body=[
            {**BALL, "friction": [0.6, 0.3], "friction_direction": [1, 0.5, 0.2], "orientation": [0.9, 0.2, -0.3, 0.1]}
        ],
    ),
    "free duration": thrown({"name": "T", "sets": "simulation.duration", "guess": 0.15}),
    "force laws": thrown(
        varied("drag.c"),
        body=[FLIGHT],
        force=[
            {
                "name": "drag",
                "on": "ball.force",
                "value": "-drag.c * norm(ball.velocity) * ball.velocity",
                "numbers": {"c": 0.05},
            },
            {"name": "gust", "on": "ball.force[0]", "during": "windy", "value": "sin(5 * time) - ball.position[2]"},
        ],
        phase=[{"name": "calm", "share": 0.3}, {"name": "windy"}],
    ),
    "references": thrown(
        varied("path.delay", 0.013),
        reference=[PATH],
        force=[{"name": "pull", "on": "ball.force[0]", "value": "path.x - ball.position[0]"}],
        more=[{"name": "off", "at": "always", "squares": "ball.position[0] - path.x"}],
    ),
    "sensors and controllers": swung(*map(varied, ("hold.gains", "brain.weights", "shake.frequency")), **FEEDBACK),
    "reactions of joints": {
        **LEG,
        "sensor": [{"name": "strain", "reads": ["knee.reaction_force", "hip.reaction_torque"]}],
        "controller": [
            {
                "name": "comply",
                "drives": "knee.command",
                "senses": ["strain"],
                "linear": {"gains": [[1e-3, 2e-3, -3e-3, 0.01, 0.02, -0.01]]},
            }
        ],
        "variable": [*LEG["variable"], {"name": "shove", "sets": "thigh.force", "guess": [2, -1, 3]}],
        "cost": [*LEG["cost"], {"name": "load", "at": "always", "squares": "0.01 * rail.reaction_force"}],
    },
    "start, end and integrals": thrown(
        PUSH,
        cost=[
            {
                "name": "of transport",
                "value": "integral(ball.force[0]**2) / norm(end.ball.position - start.ball.position)",
            }
        ],
        target=[
            {"name": "periodic", "value": "end.ball.velocity[0:2] - start.ball.velocity[0:2]", "tolerance": 0.1},
            {"name": "half way", "at": 0.06, "value": "ball.position - start.ball.position", "tolerance": 0.1},
        ],
    ),
    "constraints": thrown(
        PUSH,
        constraint=[
            {"name": "low", "at": "always", "value": "ball.position[2]", "upper": 0.12, "penalty": 3},
            {"name": "on average", "value": "average(ball.position[0])", "lower": 0.1},
        ],
    ),
    "termination": thrown(
        body=[FLIGHT],
        termination={"margin": "ball.position[2] - 1.9", "cost": 2},
        more=[{**WHERE, "name": "way", "at": "always"}],
    ),
    "scenarios": thrown(
        scenario=[
            {"name": "slippery", "sets": "ground.friction", "factor": 0.3},
            {"name": "heavy", "sets": "ball.mass", "factor": 0.1},
        ]
    ),
}
