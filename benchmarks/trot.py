"""What the speed of the journal's hand-tuned trot hangs on: one thing changed at a time.

python benchmarks/trot.py
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from symphys.problem import load_problem
from symphys.problems import find
from symphys.transcription import transcribe

NOTHING: Mapping[str, object] = {}
FEET = "frequency = 20                  # Hz\ndamping = 1\n"
SERVOS = [f"{leg}_{joint}" for leg in ("fl", "fr", "hl", "hr") for joint in ("hip", "knee")]
TORQUES = (4, 20, 40, 60, 100, 160)


def main() -> None:
    """A line for each."""
    told("as it is")
    for torque in TORQUES:
        told(f"{torque} N m", torque=torque)
    told("half the step", settings={"simulation.dt": 0.005})
    told("twice the sweeps", settings={"simulation.sweeps": 40})
    told("no instants of touch", settings={"simulation.time_of_impact": False, "simulation.cuts": 0})
    told("friction 0.3", settings={"ground.friction": 0.6})
    told("friction 0.7", settings={"ground.friction": 1.4})
    for hertz in (10, 15, 30, 50):
        told(f"feet of {hertz} Hz", FEET, f"frequency = {hertz}\ndamping = 1\n")
    told("feet with half the damping", FEET, "frequency = 20\ndamping = 0.5\n")
    told("rigid feet", FEET, "friction = 0.5\n")
    told("targets beyond 45 degrees", settings={f"joint.{name}.motor.servo.range": 9 for name in SERVOS})


def told(what: str, old: str = "", new: str = "", torque: float = 80, settings: Mapping[str, object] = NOTHING) -> None:
    """Speed ahead [m/s], largest lean [degrees] and drift to the side [m] in 10 s."""
    text = Path(find("gait_robot_trot")).read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "trot.toml"
        path.write_text(text.replace(old, new) if old else text, encoding="utf-8")
        problem = load_problem(path, settings)
    motion = transcribe(problem, backend="casadi").simulate(np.array([float(torque)]))
    (x, y, _), q = motion.position[-1, 0], motion.orientation[:, 0]
    up = (1 - 2 * (q[:, 1] ** 2 + q[:, 2] ** 2)).min()
    lean = np.degrees(np.arccos(np.clip(up, -1, 1)))
    print(
        f"{what:<28} {x / problem.simulation.duration:5.2f} m/s, leans {lean:3.0f} degrees, {y:5.2f} m aside",
        flush=True,
    )


if __name__ == "__main__":
    main()
