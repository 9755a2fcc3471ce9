"""Joints of a file: what they become, what can be wrong with them, and what formulas and variables see of them."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from symphys.dynamics.observation.joint_coordinates import readings
from symphys.errors import ProblemError
from symphys.model.joints import Joint, Limits, Servo, Spring, TorqueMotor, VelocityMotor
from symphys.model.state_layout import initial_state, input_size
from symphys.problem import Problem

Load = Callable[..., Problem]
Refused = Callable[..., ProblemError]
Names = Callable[[ProblemError, str, str], None]

LEG = """
[simulation]
duration = 1.0
dt = 0.01

[[body]]
name = "thigh"
shape = { capsule = { radius = 0.05, length = 0.4 } }
mass = 2.0
position = [0.1, 0.2, 1.2]
orientation = { roll_deg = 10, pitch_deg = 20, yaw_deg = 30 }

[[body]]
name = "shin"
shape = { capsule = { radius = 0.04, length = 0.4 } }
mass = 1.0
position = [0.1, 0.2, 0.7]
orientation = { pitch_deg = -40 }

[ground]

[[joint]]
name = "knee"
between = ["thigh", "shin"]
hinge = { axis = [0, 2, 0] }
point = [0.1, 0.2, 0.95]
motor = { servo = { gain = 20, torque = 30, velocity = 8 } }
limits_deg = [-90, 45]
spring = { stiffness = 5, damping = 0.1, rest = 0.2 }

[[variable]]
name = "bend"
sets = "knee.command"
knots = 4
"""
HINGE = "hinge = { axis = [0, 2, 0] }"
BETWEEN = 'between = ["thigh", "shin"]'
POINT = "point = [0.1, 0.2, 0.95]"
MOTOR = "motor = { servo = { gain = 20, torque = 30, velocity = 8 } }"
LIMITS = "limits_deg = [-90, 45]"
SPRING = "spring = { stiffness = 5, damping = 0.1, rest = 0.2 }"
SETS = 'sets = "knee.command"\nknots = 4'
SCREW = "helical = { axis = [1, 2, 3], pitch = -0.1 }"
UNIVERSAL = "universal = { axes = [[0, 1, 0], [1, 0, 0]] }"
BARE = ((MOTOR, ""), (LIMITS, ""), (SPRING, ""), (SETS, 'sets = "shin.velocity"'))
"""Leaves nothing that acts."""
SECOND = f'\n[[joint]]\nname = "weld"\n{BETWEEN}\nfixed = {{}}\n'
ANCHORS = "anchors = [[0, 0, 0.2], [0, 0, 0.2]]"

CASES = [
    (BETWEEN, 'between = ["thigh", "shn"]', 'joint "knee".between', '"shin"'),
    (BETWEEN, 'between = ["ground", "shin"]', 'joint "knee".between', "no body .* valid: world, thigh, shin"),
    (BETWEEN, 'between = ["shin", "shin"]', 'joint "knee".between', "same body twice"),
    (BETWEEN, 'between = ["world", "world"]', 'joint "knee".between', "needs a body"),
    (BETWEEN, 'between = ["shin", "world"]', 'joint "knee".between', '"shin"'),
    (BETWEEN, 'between = ["shin"]', 'joint "knee".between', "2 or more entries"),
    ('name = "thigh"', 'name = "world"', 'joint "knee".between', "stands still; give it another name"),
    (HINGE, "", 'joint "knee"', r"give one of ball = {}, hinge = { axis = \[0, 1, 0\] }, .* fixed = {}"),
    (HINGE, f"{HINGE}\nball = {{}}", 'joint "knee"', "has ball and hinge; give only one of"),
    (HINGE, "hinge = { axis = [0, 0, 0] }", 'joint "knee".hinge.axis', "axis must not be zero"),
    (HINGE, "hinge = {}", 'joint "knee".hinge.axis', "required"),
    (HINGE, "hinge = { axs = [0, 1, 0] }", 'joint "knee".hinge.axs', '"axis"'),
    (HINGE, "ball = { axis = [0, 1, 0] }", 'joint "knee".ball.axis', "unknown key"),
    (
        HINGE,
        "universal = { axes = [[0, 1, 0], [1, 1, 0]] }",
        'joint "knee".universal.axes',
        "perpendicular; the angle between them is 45 degrees",
    ),
    (HINGE, "universal = { axes = [[0, 1, 0], [0, 0, 0]] }", 'joint "knee".universal.axes', "must not be zero"),
    (HINGE, "universal = { axes = [[0, 1, 0]] }", 'joint "knee".universal.axes', "2 or more"),
    (HINGE, "helical = { axis = [0, 0, 1], pitch = 0 }", 'joint "knee".helical.pitch', "a number but 0"),
    (HINGE, "helical = { axis = [0, 0, 1], pitch = inf }", 'joint "knee".helical.pitch', "a number but 0"),
    (HINGE, "helical = { axis = [0, 0, 1] }", 'joint "knee".helical.pitch', "required"),
    (HINGE, "helical = { axis = [0, 0, 0], pitch = 0.1 }", 'joint "knee".helical.axis', "must not be zero"),
    (HINGE, "ball = {}", 'joint "knee".motor', "ball joint has no coordinate .* take a hinge"),
    (HINGE, "ball = {}", 'joint "knee".limits_deg', "no coordinate"),
    (HINGE, "fixed = {}", 'joint "knee".spring', "fixed joint has no coordinate"),
    (HINGE, "slider = { axis = [0, 0, 1] }", 'joint "knee".limits_deg', r"slider has no angle; give limits \[m\]"),
    (LIMITS, "limits_deg = [90, -90]", 'joint "knee".limits_deg', "lower end, 90, must not be above the upper, -90"),
    (LIMITS, "limits = [-1, 4]\ncentre = 0", 'joint "knee".centre', r"count whole turns; .* wrap_to_pi\(knee.angle\)"),
    (LIMITS, "limits = [inf, inf]", 'joint "knee".limits', "lower end, inf"),
    (LIMITS, "limits = [nan, 1]", 'joint "knee".limits', r"\[lower, upper\]; one is nan"),
    (LIMITS, "limits = 3", 'joint "knee".limits', r"two numbers, \[lower, upper\], not 3"),
    (LIMITS, f"{LIMITS}\nlimits = [-1, 1]", 'joint "knee".limits_deg', "limits are given too"),
    (LIMITS, "limits = [0.1, 1]", 'joint "knee".limits', "leave out where thigh and shin are at the start, at 0;"),
    (LIMITS, "limits_deg = [-90, -10]", 'joint "knee".limits_deg', "leave out where thigh and shin are"),
    (MOTOR, "motor = {}", 'joint "knee".motor', "give one of servo = "),
    (
        MOTOR,
        "motor = { torque = { torque = 3 }, velocity = { torque = 3, velocity = 2 } }",
        'joint "knee".motor',
        "has velocity and torque; give only one of servo",
    ),
    (MOTOR, "motor = { servo = { gain = 20, torque = 30 } }", 'joint "knee".motor.servo.velocity', "required"),
    (MOTOR, "motor = { torque = { torque = 0 } }", 'joint "knee".motor.torque.torque', "greater than 0"),
    (SPRING, "spring = { stiffness = -5 }", 'joint "knee".spring.stiffness', "at least 0"),
    (SPRING, f"{SPRING}\ndamping = 0.5", 'joint "knee".damping', "no effect on a rigid joint"),
    (POINT, "", 'joint "knee".point', "required: where"),
    (POINT, f"{POINT}\n{ANCHORS}", 'joint "knee".point', "anchors are given too"),
    (POINT, ANCHORS, 'joint "knee".anchors', r"are 0.\d+ m apart at the start, at \[.*\] and \[.*\] .* must meet"),
    ('name = "knee"', 'name = "thigh"', 'joint "thigh".name', '"thigh"'),
    ('name = "bend"', 'name = "knee"', 'variable "knee".name', "already the name"),
    ('name = "knee"', 'name = "my knee"', 'joint "my knee".name', "is no name"),
    (SETS, 'sets = "knee.comand"', 'variable "bend".sets', '"knee.command"'),
    (SETS, 'sets = "knee.command[1]"', 'variable "bend".sets', "reaches beyond knee.command, which has 1 components"),
    (SETS, 'sets = "knee.stiffness"\nlower = -1', 'variable "bend".lower', "knee.stiffness must be at least 0"),
    (SETS, 'sets = "knee.gain"\nknots = 4', 'variable "bend".knots', "the command of a motor, varies"),
    (MOTOR, "", 'variable "bend".sets', '"knee.command"'),
    (
        SETS,
        'sets = "shin.position"\nguess = [0.2, 0.2, 0.7]',
        'joint "knee".between',
        "guess of a variable puts thigh and shin 0.1 m and 0 rad from where the joint holds them",
    ),
]


@pytest.mark.parametrize(("old", "new", "where", "message"), CASES)
def test_faults_are_named(refused: Refused, names: Names, old: str, new: str, where: str, message: str) -> None:
    names(refused((old, new), text=LEG), where, message)


@pytest.mark.parametrize(
    ("first", "second", "fault"),
    [
        ("fixed = {}", "", True),
        ("fixed = {}\nfrequency = 3", "", False),
        ("fixed = {}", "frequency = 3", False),
        (HINGE, "", False),
    ],
)
def test_a_loop_of_rigid_fixed_joints_alone(
    load: Load, refused: Refused, names: Names, first: str, second: str, fault: bool
) -> None:
    text = LEG + SECOND + second
    changes = (*BARE, (HINGE, first))
    if not fault:
        assert len(load(*changes, text=text).world().joints) == 2
        return
    names(refused(*changes, text=text), 'joint "weld".fixed', "thigh and shin are held together by other fixed joints")


def test_a_loop_through_the_world(refused: Refused, names: Names) -> None:
    ends = "".join(
        f'\n[[joint]]\nname = "{name}_end"\nbetween = ["world", "{name}"]\nfixed = {{}}\n' for name in ("thigh", "shin")
    )
    names(refused(*BARE, (HINGE, "fixed = {}"), text=LEG + ends), 'joint "shin_end".fixed', "world and shin are held")


def knee(problem: Problem) -> Joint:
    (joint,) = problem.world().joints
    return joint


def test_a_joint_of_the_world(load: Load) -> None:
    joint = knee(load(text=LEG))
    assert (joint.name, joint.kind.name, joint.first, joint.second) == ("knee", "hinge", 1, 0)
    assert joint.motor == Servo(20, 30, 8)
    assert joint.limits == Limits(pytest.approx(-np.pi / 2), pytest.approx(np.pi / 4))
    assert joint.spring == Spring(5, 0.1, 0.2)
    assert (joint.frequency, joint.damping) == (0, 1)


@pytest.mark.parametrize(
    ("text", "motor"),
    [
        ("motor = { velocity = { torque = 3, velocity = 2 } }", VelocityMotor(3, 2)),
        ("motor = { torque = { torque = 3 } }", TorqueMotor(3)),
    ],
)
def test_motors(load: Load, text: str, motor: object) -> None:
    assert knee(load((MOTOR, text), text=LEG)).motor == motor


def test_settings_go_by_names(load: Load) -> None:
    joint = knee(load(text=LEG, settings={"joint.knee.motor.servo.gain": 3.0, "joint.knee.limits_deg": [-10, 10]}))
    assert joint.motor == Servo(3, 30, 8)
    assert joint.limits.upper == pytest.approx(np.pi / 18)


def test_limits_at_one_end(load: Load) -> None:
    assert knee(load((LIMITS, "limits = [-inf, 1]"), text=LEG)).limits == Limits(None, 1.0)
    assert knee(load((LIMITS, "limits_deg = [0, inf]"), text=LEG)).limits == Limits(0.0, None)
    assert knee(load((LIMITS, ""), text=LEG)).limits == Limits()


@pytest.mark.parametrize(
    ("kind", "x", "y"),
    [
        (HINGE, [0, 1, 0], None),
        ("slider = { axis = [1, 0, 1] }", [1, 0, 1], None),
        (SCREW, [1, 2, 3], None),
        (UNIVERSAL, [1, 0, 0], [0, 1, 0]),
    ],
)
def test_frames_coincide_at_the_start_along_the_axes(load: Load, kind: str, x: list[float], y: object) -> None:
    problem = load((LIMITS, ""), (SETS, 'sets = "shin.velocity"'), (HINGE, kind), text=LEG)
    joint = knee(problem)
    for name, frame in zip(("shin", "thigh"), joint.frames, strict=True):
        turn = Rotation.from_quat(problem.initial[f"{name}.orientation"], scalar_first=True)
        assert problem.initial[f"{name}.position"] + turn.apply(frame.point) == pytest.approx([0.1, 0.2, 0.95])
        axes = (turn * Rotation.from_quat(frame.orientation, scalar_first=True)).as_matrix()
        assert axes[:, 0] == pytest.approx(np.array(x) / np.linalg.norm(x))
        assert y is None or axes[:, 1] == pytest.approx(y)


def test_anchors_stand_for_the_point(load: Load) -> None:
    """The thigh hangs from the world by one end; the world's anchor is in world coordinates."""
    turn = Rotation.from_euler("xyz", [10, 20, 30], degrees=True)
    end = np.array([0.1, 0.2, 1.2]) + turn.apply([0, 0, 0.25])
    anchors = f"anchors = [{end.tolist()}, [0, 0, 0.25]]"
    joint = knee(load((BETWEEN, 'between = ["world", "thigh"]'), (POINT, anchors), text=LEG))
    assert (joint.first, joint.second) == (0, None)
    assert joint.frames[0].point == (0, 0, 0.25)
    assert joint.frames[1].point == pytest.approx(end)


@pytest.mark.parametrize("kind", ["slider = { axis = [1, 0, 0] }", "fixed = {}"])
def test_what_does_not_turn_needs_no_point(load: Load, kind: str) -> None:
    joint = knee(load(*BARE, (HINGE, kind), (POINT, ""), text=LEG))
    assert joint.frames[0].point == (0, 0, 0)


def test_the_bodies_of_a_joint_touch_only_if_they_are_told_to(load: Load, refused: Refused, names: Names) -> None:
    pairs = {pair.name.partition(":")[0] for pair in load(text=LEG).world().pairs}
    assert pairs == {"thigh-ground", "shin-ground"}
    apart = (("position = [0.1, 0.2, 0.7]", "position = [0.1, 0.2, 0.6]"), (LIMITS, "collide = true"))
    assert "thigh-shin" in {pair.name.partition(":")[0] for pair in load(*apart, text=LEG).world().pairs}
    law = '[[pair]]\nbetween = ["thigh", "shin"]\nfriction = 0.1\n[ground]'
    assert load(*apart, ("[ground]", law), text=LEG)
    names(refused(("[ground]", law), text=LEG), "pair[0].between", "a joint holds these two.* collide = true")


def test_variables_set_what_motors_and_springs_are(load: Load) -> None:
    problem = load(text=LEG)
    stated = {"gain": 20, "torque": 30, "velocity": 8, "stiffness": 5, "damping": 0.1, "rest": 0.2}
    for key, value in stated.items():
        assert problem.parameters[f"knee.{key}"] == pytest.approx([value])
        changed = load((SETS, f'sets = "knee.{key}"'), text=LEG)
        assert changed.variables[0].kind == "parameter"
        (joint,) = changed.world({f"knee.{key}": 7.5}).joints
        assert 7.5 in (*vars(joint.motor).values(), *vars(joint.spring).values())
    assert load((SETS, 'sets = "knee.rest"'), text=LEG).variables[0].lower == -np.inf
    assert load((SETS, 'sets = "knee.velocity"'), text=LEG).variables[0].lower == 0


def test_a_command_has_a_number_for_each_coordinate(load: Load) -> None:
    for changes, count in (((), 1), (((HINGE, UNIVERSAL),), 2)):
        problem = load(*changes, text=LEG)
        (variable,) = problem.variables
        assert (variable.kind, variable.components, variable.guess.size) == ("control", count, 4 * count)
        assert input_size(problem.world(), "knee.command") == count


def test_coordinates_are_zero_at_the_start(load: Load) -> None:
    for kind in (HINGE, UNIVERSAL, "slider = { axis = [1, 2, 3] }", SCREW):
        problem = load((HINGE, kind), (LIMITS, ""), text=LEG)
        world = problem.world()
        reading = readings(world, initial_state(world, problem.initial))["knee"]
        for part in (reading.value, reading.rate, reading.separation, reading.tilt):
            assert np.array(ca.evalf(ca.SX(part))) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(
    ("kind", "formula"),
    [
        (HINGE, "[knee.angle, knee.rate, knee.torque, knee.command, knee.gain, knee.stiffness]"),
        (UNIVERSAL, "knee.angle[1] + knee.rate[1] + knee.torque[1] + knee.command[1]"),
        ("slider = { axis = [1, 0, 0] }", "[knee.position, knee.rate, knee.torque]"),
        (SCREW, "[knee.angle, knee.rate, knee.torque, knee.pitch]"),
    ],
)
def test_formulas_know_what_joints_do(load: Load, kind: str, formula: str) -> None:
    target = f'\n[[target]]\nname = "there"\nvalue = "{formula}"\ntolerance = 1\n'
    assert load((HINGE, kind), (LIMITS, ""), text=LEG + target).targets


@pytest.mark.parametrize(
    ("formula", "message"),
    [("knee.angl", '"knee.angle"'), ("knee.position", "unknown name"), ("knee.angle[1]", "1")],
)
def test_formulas_with_names_that_are_none(refused: Refused, names: Names, formula: str, message: str) -> None:
    target = f'\n[[target]]\nname = "there"\nvalue = "{formula}"\ntolerance = 1\n'
    names(refused(text=LEG + target), 'target "there".value', message)
