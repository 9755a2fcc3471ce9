"""The same two scenes here and in MuJoCo, on one core: steps per second, and errors against each one's finest run.

One ball that bounces, and sixteen balls in a box. The two engines do not agree on contact (here Newton restitution at
the instant of impact, there a stiff spring and damper over several steps), so each is compared with itself at a 64th of
the step: how far its result depends on the step. Run with ``make bench``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from time import perf_counter

import mujoco
import numpy as np
from measured_worlds import problem_of

from symphys.codegen import compile_program
from symphys.transcription import rollout_program
from symphys.transcription.rollout import symbolic_rollout
from symphys.types import Array

STEPS = (0.01, 0.005, 0.0025)
FINEST = STEPS[0] / 64
REPEATS = 7
RADIUS = 0.1
HALF = 0.6
WALLS = {"left": (1, 0), "right": (-1, 0), "front": (0, 1), "back": (0, -1)}
BODY = 19
"""Numbers of a body in a state."""
SPREAD = 0.3
"""[m/s] between the velocities of a batch: no two of its scenes have the same contacts."""


def starts(scene: str) -> tuple[Array, Array]:
    """Positions and velocities (balls, 3)."""
    if scene == "bounce":
        return np.array([[0.0, 0, 1.0]]), np.array([[0.5, 0, 0]])
    places = np.array([[x, y, z] for z in (0.15, 0.5) for y in (-0.35, 0.35) for x in (-0.45, -0.15, 0.15, 0.45)])
    return places, np.random.default_rng(0).uniform(-1, 1, places.shape)


def duration(scene: str) -> float:
    """[s]."""
    return 2.0 if scene == "bounce" else 0.5


def text(scene: str, dt: float) -> str:
    """The problem file: every start velocity may vary, the targets are places at the end."""
    lines = [f"[simulation]\nduration = {duration(scene)}\ndt = {dt}\nsweeps = 8"]
    lines.append("[ground]\nfriction = 0.3\nrestitution = 0.7\n[contact]\nfriction = 0.3\nrestitution = 0.7")
    if scene != "bounce":
        for name, (x, y) in WALLS.items():
            lines.append(f'[[plane]]\nname = "{name}"\nnormal = [{x}, {y}, 0]\noffset = {-HALF}')
    for i, (p, v) in enumerate(zip(*starts(scene), strict=True)):
        lines.append(
            f'[[body]]\nname = "b{i}"\nshape = {{ sphere = {{ radius = {RADIUS} }} }}\n'
            f"mass = 1.0\nposition = {p.tolist()}\n"
            f'[[variable]]\nname = "v{i}"\nsets = "b{i}.velocity"\nguess = {v.tolist()}\n'
            f'[[target]]\nname = "t{i}"\nvalue = "b{i}.position"\ntolerance = 1'
        )
    return "\n".join(lines)


class Here:
    """This engine."""

    name = "symphys"

    def __init__(self, scene: str, dt: float) -> None:
        """Compile."""
        rollout = symbolic_rollout(problem_of(text(scene, dt)))
        program = rollout_program(rollout, exact=True)
        self.kernel, self.alone = (compile_program(program, threads=1, rows=rows) for rows in (None, 1))
        self.z, self.steps = starts(scene)[1].ravel(), round(duration(scene) / dt)

    def places(self) -> Array:
        """(balls, 3) at the end."""
        return self.alone.forward(self.z, [0.0])["residuals"][0].reshape(-1, 3)

    def rate(self, batch: int) -> float:
        """Steps of the scene in a second; in a batch each begins with other velocities."""
        Z = self.z + (SPREAD if batch > 1 else 0) * np.random.default_rng(1).standard_normal((batch, len(self.z)))
        kernel = self.alone if batch == 1 else self.kernel
        return batch * self.steps / fastest(lambda: kernel.forward(Z, [0.0]))


def there(scene: str, dt: float) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The scene for MuJoCo with its own defaults, and a contact that gives back about 0.7 of the speed."""
    contact = 'friction="0.3 0 0" solref="-20000 -45" priority="0"'
    walls = ""
    if scene != "bounce":
        for pos, euler in ((f"{-HALF} 0 0", "0 90 0"), (f"{HALF} 0 0", "0 -90 0")):
            walls += f'<geom type="plane" size="2 2 .1" pos="{pos}" euler="{euler}" {contact}/>'
        for pos, euler in ((f"0 {-HALF} 0", "-90 0 0"), (f"0 {HALF} 0", "90 0 0")):
            walls += f'<geom type="plane" size="2 2 .1" pos="{pos}" euler="{euler}" {contact}/>'
    balls = "".join(
        f'<body pos="{p[0]} {p[1]} {p[2]}"><freejoint/><geom type="sphere" size="{RADIUS}" mass="1" {contact}/></body>'
        for p in starts(scene)[0]
    )
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler angle="degree"/><option timestep="{dt}"/><worldbody>'
        f'<geom type="plane" size="5 5 .1" {contact}/>{walls}{balls}</worldbody></mujoco>'
    )
    return model, mujoco.MjData(model)


def run(model: mujoco.MjModel, data: mujoco.MjData, scene: str) -> None:
    """From the start to the end."""
    mujoco.mj_resetData(model, data)
    data.qvel.reshape(-1, 6)[:, :3] = starts(scene)[1]
    for _ in range(round(duration(scene) / model.opt.timestep)):
        mujoco.mj_step(model, data)


def fastest(call: Callable[[], object]) -> float:
    """Seconds, the best of REPEATS."""
    times = []
    for _ in range(REPEATS):
        began = perf_counter()
        call()
        times.append(perf_counter() - began)
    return min(times)


def main() -> None:
    """Print the table."""
    print(f"MuJoCo {mujoco.__version__}; errors [m] are the rms over the balls' places at the end")
    for scene in ("bounce", "box"):
        here = Here(scene, FINEST).places()
        model, data = there(scene, FINEST)
        run(model, data, scene)
        fine = data.qpos.reshape(-1, 7)[:, :3].copy()
        for dt in STEPS:
            ours = Here(scene, dt)
            error = np.sqrt(np.mean((ours.places() - here) ** 2))
            model, data = there(scene, dt)
            seconds = fastest(partial(run, model, data, scene))
            other = np.sqrt(np.mean((data.qpos.reshape(-1, 7)[:, :3] - fine) ** 2))
            rate = round(duration(scene) / dt) / seconds
            print(
                f"{scene:7} dt {dt:7}  symphys {ours.rate(1):10.0f}/s one, {ours.rate(128):10.0f}/s in a batch", end=""
            )
            print(f", error {error:8.1e}   MuJoCo {rate:10.0f}/s, error {other:8.1e}", flush=True)


if __name__ == "__main__":
    main()
