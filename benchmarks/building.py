"""What it buys to choose legs and motors together with the controller.

    python benchmarks/building.py [SEEDS]

``gait_robot_build`` as it is shipped, and with thighs and motors held as they are in the file of the robot; as many
gradients each. Then both walk in 500 samples that neither has seen.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
from walking import SEED, UNSEEN, Walks, learnt

from symphys.problem import Problem, Variable, load_problem
from symphys.problems import find

HARDWARE = ("thighs", "hips", "knees")


def main() -> None:
    """A line for each seed and way."""
    problem = load_problem(find("gait_robot_build"))
    for what, asked in {"controller alone": held(problem), "with legs and motors": problem}.items():
        walks = Walks(asked)
        for seed in range(int(sys.argv[1]) if len(sys.argv) > 1 else 3):
            z = learnt(walks.made, seed)
            drawn = walks.scenario.draw(np.random.default_rng(SEED), UNSEEN)
            speed, upright = walks(z, drawn)
            merit = walks.scenario.value(z[None], drawn, 0.0).objective
            built = {name: round(float(part[0, 0]), 3) for name, part in walks.made.shooting.by_block(z).items()
                     if name.endswith(HARDWARE)}  # fmt: skip
            print(f"  {what}: nominal {speed[0]:.2f} m/s; {UNSEEN} unseen: {speed[upright].mean():.2f} m/s, "
                  f"{upright.mean():.3f} upright, objective {merit.mean():.3f}; {built}", flush=True)  # fmt: skip


def held(problem: Problem) -> Problem:
    """With all that is hardware held."""
    return replace(problem, variables=tuple(map(fixed, problem.variables)))


def fixed(variable: Variable) -> Variable:
    """Held at its guess where it is hardware."""
    if not variable.name.endswith(HARDWARE):
        return variable
    return replace(variable, lower=variable.guess, upper=variable.guess)


if __name__ == "__main__":
    main()
