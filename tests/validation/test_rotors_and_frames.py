"""V30: several joints between two bodies, rotors, dry friction, affine motors and couplings obey their laws."""

from __future__ import annotations

import numpy as np
import pytest

import symphys
from symphys import Problem, SymphysError, simulate
from symphys.model import AffineMotor, Body, Hinge, Slider, Spring, make_world
from symphys.trajectory import Trajectory

FINE = 2e-4
"""[s], at which MuJoCo's Runge-Kutta steps are exact to 1e-10 m here."""
GRAVITY = (3.0, 6.0, -9.81)
HIP, KNEE = (0.08, 0.05, 0.9), (0.1, 0.05, 0.55)
MJCF = f"""<mujoco><option gravity="3 6 -9.81" timestep="{FINE}" integrator="RK4"/>
<compiler angle="radian" inertiafromgeom="false"/><worldbody><body name="torso" pos="0 0 1">
<inertial pos="0 0 0" mass="3" diaginertia="0.05 0.06 0.03"/>
<joint type="slide" axis="1 0 0" armature="0.3"/><joint type="slide" axis="0 0 1" armature="2"/>
<joint type="hinge" axis="0 1 0" armature="0.02"/>
<body name="leg" pos="0.1 0.05 -0.3"><inertial pos="0 0 0" mass="1" diaginertia="0.02 0.03 0.015"/>
<joint axis="1 0 0" pos="-0.02 0 0.2" armature="0.05" damping="0.2" stiffness="3"/>
<joint axis="0 0 1" pos="-0.02 0 0.2"/><joint axis="0 1 0" pos="-0.03 0.01 0.2" armature="0.5" damping="0.1"/>
<body name="foot" pos="0 0 -0.3"><inertial pos="0 0 0" mass="0.2" diaginertia="0.001 0.002 0.003"/>
<joint axis="0 1 0.3" pos="0 0 0.15" armature="0.01" stiffness="1" damping="0.02"/>
</body></body></body></worldbody></mujoco>"""


def leg(dt: float) -> Trajectory:
    """The same robot here, its several joints between frames."""
    bodies = [
        Body.frame("x", position=(0, 0, 1)),
        Body.frame("z", position=(0, 0, 1)),
        Body("torso", 3.0, (0.05, 0.06, 0.03), start={"position": (0, 0, 1)}),
        Body.frame("roll", position=HIP),
        Body.frame("yaw", position=HIP),
        Body("leg", 1.0, (0.02, 0.03, 0.015), start={"position": (0.1, 0.05, 0.7)}),
        Body("foot", 0.2, (0.001, 0.002, 0.003), start={"position": (0.1, 0.05, 0.4)}),
    ]
    joints = [
        Slider("rail_x", ("world", "x"), axis=(1, 0, 0), armature=0.3),
        Slider("rail_z", ("x", "z"), axis=(0, 0, 1), armature=2.0),
        Hinge("pitch", ("z", "torso"), axis=(0, 1, 0), point=(0, 0, 1), armature=0.02),
        Hinge("hip_x", ("torso", "roll"), axis=(1, 0, 0), point=HIP, armature=0.05, spring=Spring(3, 0.2)),
        Hinge("hip_z", ("roll", "yaw"), axis=(0, 0, 1), point=HIP),
        Hinge("hip_y", ("yaw", "leg"), axis=(0, 1, 0), point=(0.07, 0.06, 0.9), armature=0.5, spring=Spring(0, 0.1)),
        Hinge("knee", ("leg", "foot"), axis=(0, 1, 0.3), point=KNEE, armature=0.01, spring=Spring(1, 0.02)),
    ]
    world = make_world(bodies, gravity=GRAVITY, joints=joints)
    return simulate(Problem.from_world(world, duration=0.4, dt=dt))


@pytest.mark.thorough
def test_rotors_and_several_joints_move_as_mujoco_has_them() -> None:
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(MJCF)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, round(0.4 / FINE))
    mujoco.mj_kinematics(model, data)

    def error(dt: float) -> float:
        motion = leg(dt)
        apart = [motion[f"{n}.position"][-1] - data.xipos[model.body(n).id] for n in ("torso", "leg", "foot")]
        return float(np.sqrt(np.square(apart).sum(axis=1).mean()))

    errors = [error(dt) for dt in (0.01, 0.005)]
    assert errors[1] < 3e-5
    assert errors[0] == pytest.approx(4 * errors[1], rel=0.02)


def rotor(
    joint: Hinge, duration: float, *, spin: float = 0.0, command: float | None = None, dt: float = 0.01
) -> np.ndarray:
    """The angle of a wheel of 0.2 kg m^2 without weight on the world, over time."""
    wheel = Body("wheel", 1.0, 0.2, start={"angular_velocity": (0, 0, spin)})
    world = make_world([wheel], gravity=(0, 0, 0), joints=[joint])
    variables = {} if command is None else {"push": {"sets": "axle.command", "guess": [command]}}
    return simulate(Problem.from_world(world, duration=duration, dt=dt, variables=variables))["axle.angle"].ravel()


def axle(**what: object) -> Hinge:
    """Of the wheel."""
    return Hinge("axle", ("world", "wheel"), axis=(0, 0, 1), point=(0, 0, 0), **what)


def test_a_motor_turns_its_rotor_too() -> None:
    angle = rotor(axle(armature=0.3, motor=AffineMotor(gear=2.0)), 1.0, command=0.5)
    assert angle[-1] == pytest.approx(0.5 * 2 * 0.5 / (0.2 + 0.3), abs=1e-12)


@pytest.mark.parametrize("gear", [2.0, -2.0])
def test_ranges_of_an_affine_motor(gear: float) -> None:
    motor = AffineMotor(gain=3.0, gear=gear, command_range=(-1, 1), force_range=(-2.5, 0.5))
    forces = {command: gear * np.clip(3 * np.clip(command, -1, 1), -2.5, 0.5) for command in (5.0, 0.1, -0.4, -9.0)}
    for command, torque in forces.items():
        assert rotor(axle(motor=motor), 0.2, command=command)[-1] == pytest.approx(0.02 * torque / 0.2, abs=1e-12)


def test_a_position_actuator_is_a_spring_about_its_command() -> None:
    joint, w, decay = axle(armature=0.3, motor=AffineMotor(gain=50, kp=50, kv=2.0)), np.sqrt(50 / 0.5 - 2.0**2), 2.0

    def error(dt: float) -> float:
        angle = rotor(joint, 1.0, command=0.4, dt=dt)
        t = dt * np.arange(len(angle))
        exact = 0.4 * (1 - np.exp(-decay * t) * (np.cos(w * t) + decay / w * np.sin(w * t)))
        return float(np.abs(angle - exact).max())

    errors = error(0.01), error(0.005)
    assert errors[1] < 1e-3
    assert errors[0] == pytest.approx(4 * errors[1], rel=0.05)


def test_dry_friction_stops_a_wheel_and_holds_it() -> None:
    angle = rotor(axle(armature=0.3, friction=0.25, motor=AffineMotor()), 3.0, spin=1.0, command=0.0)
    assert angle[-1] == pytest.approx(1.0 / (2 * 0.5), abs=1e-3)
    assert angle[-1] == pytest.approx(angle[-50], abs=1e-12)
    assert np.abs(rotor(axle(friction=0.25, motor=AffineMotor()), 0.5, command=0.249)).max() < 1e-12
    moved = rotor(axle(friction=0.25, motor=AffineMotor()), 0.5, command=0.35)
    assert moved[-1] == pytest.approx(0.1 / 0.2 * 0.125, abs=1e-12)


def test_an_impact_on_a_lever_turns_its_rotor() -> None:
    """About the hinge angular momentum is kept, that of the rotor with it; restitution 1 keeps the energy."""
    arm = Body.box("arm", size=(1.0, 0.1, 0.1), mass=1.2, position=(0.5, 0, 0))
    ball = Body.ball("ball", radius=0.05, mass=0.5, position=(0.9, 0, 0.15), velocity=(0, 0, -2))
    pivot = Hinge("pivot", ("world", "arm"), axis=(0, 1, 0), point=(0, 0, 0), armature=0.7)
    laws = {("arm", "ball"): symphys.model.Law(friction=0.0, restitution=1.0)}
    world = make_world([arm, ball], gravity=(0, 0, 0), joints=[pivot], laws=laws)
    motion = simulate(Problem.from_world(world, duration=0.1))
    inertia = 1.2 * (1 + 0.01) / 12 + 1.2 * 0.25 + 0.7
    spin = 2 * 0.9 * 2 / (0.81 + inertia / 0.5)
    assert motion["pivot.rate"].ravel()[-1] == pytest.approx(spin, rel=1e-9)
    assert motion["ball.velocity"][-1, 2] == pytest.approx(-2 + inertia * spin / 0.9 / 0.5, rel=1e-9)


COUPLED = """
[simulation]
duration = 0.3
dt = 0.01
[[body]]
name = "a"
mass = 1
inertia = 0.01
position = [0.2, 0, 0]
[[body]]
name = "b"
mass = 0.5
inertia = 0.005
position = [0.4, 0, 0]
[[joint]]
name = "one"
between = ["world", "a"]
hinge = { axis = [0, 1, 0] }
point = [0, 0, 0]
[[joint]]
name = "two"
between = ["a", "b"]
hinge = { axis = [0, 1, 0] }
point = [0.3, 0, 0]
[[coupling]]
name = "gear"
joints = ["two", "one"]
polynomial = [0, -0.7, 0.1]
[[site]]
name = "tip"
body = "b"
position = [0.1, 0, 0]
[[output]]
name = "tip_speed"
value = "norm(tip.velocity)"
"""


def coupled(tmp_path: object, text: str = COUPLED) -> Problem:
    """The problem of a file."""
    file = tmp_path / "coupled.toml"  # type: ignore[operator]
    file.write_text(text)
    return symphys.load(file)


def test_a_coupled_joint_follows_and_keeps_the_energy(tmp_path: object) -> None:
    problem, drifts = coupled(tmp_path), []
    for dt in (0.01, 0.005):
        motion = simulate(problem.set("simulation.dt", dt))
        one, two = motion["one.angle"].ravel(), motion["two.angle"].ravel()
        assert np.abs(two - (-0.7 * one + 0.1 * one**2)).max() < 3e-4 * (dt / 0.01) ** 2
        energy = 0.0
        for name, mass, inertia in (("a", 1.0, 0.01), ("b", 0.5, 0.005)):
            v, w = motion[f"{name}.velocity"], motion[f"{name}.angular_velocity"]
            energy = energy + 0.5 * (mass * (v * v).sum(axis=1) + inertia * (w * w).sum(axis=1))
            energy = energy + mass * 9.81 * motion[f"{name}.position"][:, 2]
        drifts.append(np.abs(energy - energy[0]).max())
    assert drifts[1] < 2e-3
    assert drifts[0] == pytest.approx(4 * drifts[1], rel=0.1)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('joints = ["two", "one"]', 'joints = ["tow", "one"]', "no joint is called"),
        ('joints = ["two", "one"]', 'joints = ["two", "two"]', "names the same joint twice"),
        ('body = "b"', 'body = "c"', "no body is called"),
        ("mass = 0.5\ninertia = 0.005", "mass = 0", "must be between two rigid joints"),
        ("mass = 0.5", "mass = 0", "must be greater than 0, not 0"),
        ("polynomial = [0, -0.7, 0.1]", "polynomial = [0, 1, 2, 3, 4, 5]", "polynomial"),
    ],
)
def test_refused(tmp_path: object, old: str, new: str, message: str) -> None:
    assert old in COUPLED
    with pytest.raises(SymphysError, match=message):
        coupled(tmp_path, COUPLED.replace(old, new))
