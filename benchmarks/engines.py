"""Rollouts without a problem file: of any world under any scheme here, and of the same scenes in MuJoCo.

``Rolling`` and ``Walk`` compile this engine's steps; ``Runs`` is MuJoCo's own C loop. All use one thread.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from robots import JointedScene
from scenes import Scene

from symphys.codegen import FunctionCall, Kernel, MemoryLayout, Place, Program, compile_program
from symphys.dynamics.functions import trace_step
from symphys.export import mjcf
from symphys.model.state_layout import Layout as Columns
from symphys.model.world import Scheme, World
from symphys.types import Array, Expr

try:
    import mujoco
    from mujoco import rollout
except ImportError:  # benchmarks of this engine alone go without
    mujoco = rollout = None

WORDS = 2_000_000
"""Most words of memory a lane for the states of one call; longer rollouts are several calls."""


class Rolling:
    """Rollouts of one world under one scheme."""

    def __init__(
        self,
        world: World,
        scheme: Scheme,
        steps: int,
        start: tuple[int, Callable[[Expr], Expr]] | None = None,
        end: Callable[[Expr], Expr] | None = None,
        seeded: Sequence[str] | None = None,
        rows: int | None = None,
    ) -> None:
        """Describe the rollout; it is compiled when it is first used.

        Args:
            world: bodies and what they touch.
            scheme: time step and switches.
            steps: of one call.
            start: the size of z, and the state at the start as an expression of z; None: z is that state.
            end: the outputs as expressions of the state at the end; None: the state.
            seeded: ("end",) or None: it can be differentiated; (): it cannot, which compiles faster.
            rows: see ``compile_program``.
        """
        self.columns = Columns(world)
        self.world, self.scheme, self.steps = world, scheme, steps
        self.size, self.start = start or (self.columns.size, lambda z: z)
        self.end, self.seeded, self.rows = end or (lambda x: x), seeded, rows

    @cached_property
    def kernel(self) -> Kernel:
        """Return the compiled rollout."""
        return compile_program(self._program(), seeded=self.seeded, threads=1, rows=self.rows)

    def ends(self, Z: Array) -> Array:
        """Return the outputs (batch, m) at the ends of rollouts from (batch, n)."""
        return self.kernel.forward(Z, [0.0])["end"]

    def _program(self) -> Program:
        layout, columns = MemoryLayout(), self.columns
        z, parameters = layout.take(self.size), layout.take(1)
        x = layout.series(columns.size, self.steps + 1)
        body = step_calls(self.world, self.scheme, layout, x, parameters)
        (symbols, state) = ca.SX.sym("z", self.size), ca.SX.sym("x", columns.size)
        first = ca.Function("first", [symbols], [ca.densify(self.start(symbols))])
        asked = ca.densify(self.end(state))
        last = ca.Function("last", [state], [asked])
        end = layout.take(int(asked.shape[0]))
        return Program(
            size=layout.size,
            z=z,
            parameters=parameters,
            steps=self.steps,
            outputs={"end": end},
            prologue=(FunctionCall(first, (z,), (x.still(),)),),
            body=tuple(body),
            epilogue=(FunctionCall(last, (x.later(self.steps).still(),), (end,)),),
        )


def step_calls(world: World, scheme: Scheme, layout: MemoryLayout, x: Place, parameters: Place) -> list[FunctionCall]:
    """Return the calls of one exact time step from the states ``x`` to the next ones."""
    columns, recording = Columns(world), trace_step(world, scheme, exact=True)
    after, empty = x.later(), Place(0, 0)
    places = {slot: Place(after.offset + s.start, s.stop - s.start, x.stride) for slot, s in recording.results.items()}
    calls = []
    for piece in recording.calls:
        for slot in piece.inputs:
            if slot.name in columns:
                part = columns[slot.name]
                places[slot] = Place(x.offset + part.start, part.stop - part.start, x.stride)
            elif slot.name:
                places[slot] = parameters if slot.name == "smoothing" else empty
        for slot in piece.outputs:
            places.setdefault(slot, layout.take(slot.size))
        inputs, outputs = (tuple(places[slot] for slot in slots) for slots in (piece.inputs, piece.outputs))
        calls.append(FunctionCall(piece.function, inputs, outputs))
    return calls


class Walk:
    """Long rollouts, cut into calls that fit into memory."""

    def __init__(self, world: World, scheme: Scheme, interval: int) -> None:
        """Take states after every ``interval`` steps."""
        most = max(1, WORDS // Columns(world).size)
        lengths = (interval // k for k in range(1, interval + 1) if interval % k == 0)
        self.rolling = Rolling(world, scheme, next(length for length in lengths if length <= most), seeded=())
        self.calls = interval // self.rolling.steps

    def along(self, X: Array, count: int) -> Array:
        """Return the states (count, batch, nx) after each interval, from (batch, nx)."""
        states = []
        for _ in range(count):
            for _ in range(self.calls):
                X = self.rolling.ends(X)
            states.append(X)
        return np.array(states)


@dataclass(frozen=True)
class Contact:
    """How hard MuJoCo's contact is.

    Attributes:
        name: of the row.
        solref: (time constant [s], damping ratio), or (-stiffness, -damping) [1/s^2, 1/s].
        solimp: impedance; close to 1 is close to a hard constraint.
        integrator: "Euler" is MuJoCo's default.
    """

    name: str
    solref: tuple[float, float] = (0.02, 1.0)
    solimp: tuple[float, ...] = (0.9, 0.95, 0.001)
    integrator: str = "Euler"

    def attributes(self, friction: float) -> str:
        """Return the attributes of a geom."""
        ref, imp = (" ".join(f"{number:.12g}" for number in numbers) for numbers in (self.solref, self.solimp))
        return f'friction="{friction} 0 0" condim="3" solref="{ref}" solimp="{imp}"'


def solids_model(scene: Scene, contact: Contact, dt: float, tolerance: float = 1e-8) -> mujoco.MjModel:
    """Return MuJoCo's model of a scene of solids; its friction cones are elliptic."""
    attributes = contact.attributes(scene.friction)
    bodies = "".join(solid.xml(attributes) for solid in scene.solids)
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><size memory="64M"/><option timestep="{dt!r}" gravity="0 0 {-scene.gravity}" cone="elliptic" '
        f'integrator="{contact.integrator}" tolerance="{tolerance}"/><worldbody>'
        f'<geom type="plane" size="50 50 1" {attributes}/>{bodies}</worldbody></mujoco>'
    )


def solids_states(scene: Scene) -> Array:
    """Return states (batch, nstate) of solids; MuJoCo's angular velocities are in the frame of the body."""
    rows = []
    for start in scene.start:
        velocity = [np.concatenate([body[7:10], rotated_back(body[3:7], body[10:])]) for body in start]
        rows.append(np.concatenate([[0.0], start[:, :7].ravel(), *velocity]))
    return np.array(rows)


def rotated_back(q: Array, v: Array) -> Array:
    """Return a vector of the world in the frame of a body."""
    result, inverse = np.zeros(3), np.zeros(4)
    mujoco.mju_negQuat(inverse, q)
    mujoco.mju_rotVecQuat(result, v, inverse)
    return result


def robot_model(
    scene: JointedScene, dt: float, integrator: str, cone: str = "elliptic", index: int = 0
) -> mujoco.MjModel:
    """Return MuJoCo's model of a robot as exported; its keyframe is one initial state of the scene."""
    text = mjcf(scene.robot, scene.start[index], dt, scene.name)
    return mujoco.MjModel.from_xml_string(text.replace("implicitfast", integrator).replace("elliptic", cone))


def robot_states(scene: JointedScene) -> Array:
    """Return states (batch, nstate) of a robot: time, coordinates and rates of the keyframes."""
    models = [robot_model(scene, 0.01, "Euler", index=k) for k in range(len(scene.start))]
    return np.array([np.concatenate([[0.0], model.key_qpos[0], model.key_qvel[0]]) for model in models])


class Runs:
    """Rollouts of one MuJoCo model."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """Make data for the model."""
        self.model, self.data = model, mujoco.MjData(model)

    def after(self, states: Array, steps: int) -> Array:
        """Return the states (batch, steps, nstate) after each step."""
        return np.array(rollout.rollout(self.model, self.data, np.ascontiguousarray(states), nstep=steps)[0])

    def last(self, states: Array, steps: int, most: int = 5000) -> Array:
        """Return the states (batch, nstate) after all steps, with at most ``most`` steps in memory."""
        while steps:
            some = min(steps, most)
            states, steps = self.after(states, some)[:, -1], steps - some
        return states

    def along(self, states: Array, interval: int, count: int) -> Array:
        """Return the states (count, batch, nstate) after every ``interval`` steps of one rollout."""
        return np.moveaxis(self.after(states, interval * count)[:, interval - 1 :: interval], 0, 1)
