"""The ant of SHAC (Xu et al., ICLR 2022, arXiv 2204.07137): its reward after as many steps as it was given.

``python benchmarks/shac_ant.py`` (``make bench-gaits``). Gymnasium's ant with commands times 200 N m, steps of 1/60 s,
the reward of a step v_x + 0.1 up + heading + (height - 0.27), an end below 0.27 m. Theirs: 64 actors x windows of 32
steps x 2,000 updates = 4.1 million steps; a net of 128-64-32. Here: a gait of sines with linear feedback, learned by
``evolution`` from rollouts of 240 steps. The return is that of 1,000 steps from the start of the model.

Their returns are in figures only, so this prints ours. Each seed is solved twice, to compare the numbers bit for bit.
"""

from __future__ import annotations

import sys
import tomllib
from time import perf_counter
from typing import Any

import numpy as np

import symphys
from symphys.problems import find

DT, WINDOW, EPISODE = 1 / 60, 240, 1000
STEPS = 64 * 32 * 2000
"""That SHAC was given."""
REWARD = (
    "torso.velocity[0] + 0.1 * rotate(torso.orientation, [0, 0, 1])[2]"
    " + rotate(torso.orientation, [1, 0, 0])[0] + torso.position[2] - 0.27"
)
ROLLOUTS = 74
"""Of an iteration: a pair for each of 32 samples, and what validates; the table has the steps that were taken."""


def problem(steps: int) -> symphys.Problem:
    """The shipped gait with SHAC's motors, steps and reward, whose mean over ``steps`` is maximised."""
    tables: dict[str, Any] = tomllib.loads(find("ant_walk").read_text(encoding="utf-8"))
    tables["title"] = "SHAC's ant"
    tables["simulation"] |= {"dt": DT, "duration": steps * DT}
    joints = [f"{part}_{k}" for part in ("hip", "ankle") for k in range(1, 5)]
    tables["set"] = {f"joint.{joint}.motor.affine.gear": 200 for joint in joints}
    tables["cost"] = [{"name": "reward", "at": "always", "value": f"-({REWARD})", "weight": 1 / (steps * DT)}]
    tables["termination"] = {"margin": "torso.position[2] - 0.27", "cost": 0.0}
    tables["output"] = []
    return symphys.load(tables)


def returned(values: dict[str, Any]) -> float:
    """The sum of the rewards of an episode."""
    motion = symphys.simulate(problem(EPISODE), values)
    q, height = motion["torso.orientation"][1:], motion["torso.position"][1:, 2]
    _w, x, y, z = q.T
    up, ahead = 1 - 2 * (x * x + y * y), 1 - 2 * (y * y + z * z)
    rewards = motion["torso.velocity"][1:, 0] + 0.1 * up + ahead + height - 0.27
    alive = np.cumprod(height >= 0.27)
    return float((rewards * alive).sum())


def main() -> None:
    """A line for each seed."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    learned = problem(WINDOW)
    print("| seed | steps | seconds | return of 1,000 steps | the same again |")
    print("|---|---|---|---|---|")
    iterations = STEPS // (ROLLOUTS * WINDOW)
    for seed in range(seeds):
        began = perf_counter()
        found = symphys.solve(learned, "evolution", seed=seed, iterations=iterations)
        seconds = perf_counter() - began
        again = symphys.solve(learned, "evolution", seed=seed, iterations=iterations)
        same = all(np.array_equal(found.value[name], again.value[name]) for name in found.value)
        steps = found.run.counts["rollouts"] * WINDOW
        words = f"{steps / 1e6:.2f} M | {seconds:.0f} | {returned(dict(found.value)):.0f} | {'yes' if same else 'no'}"
        print(f"| {seed} | {words} |", flush=True)


if __name__ == "__main__":
    main()
