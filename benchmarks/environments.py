"""What do a step with open commands, an environment and a step in PyTorch cost beside the kernel?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from bench import Row, in_turns

import symphys

NAMES, BATCHES = ("cart_pole", "quadruped_shift"), (1, 128, 1024)
COLUMNS = {
    "problem": "a shipped problem",
    "motions": "in a call",
    "kernel_ms": "the kernel of a step",
    "step_ms": "a call of ``compile_step``",
    "environment_ms": "a step of ``symphys.env.VectorEnv``",
    "steps_s": "steps a second of the environment",
    "adjoint_ms": "the adjoint of a step",
    "torch_ms": "a step and its adjoint in PyTorch",
}


def rows(quick: bool = False, repeats: int = 25) -> Iterator[Row]:
    """Yield a row for each problem and number of motions."""
    for name in NAMES[:1] if quick else NAMES:
        for batch in BATCHES[:1] if quick else BATCHES:
            times = measured(name, batch, 2 if quick else repeats)
            rate = {"steps_s": 1e3 * batch / times["environment_ms"]}
            yield {"problem": name, "motions": batch, **{key: (times | rate)[key] for key in list(COLUMNS)[2:]}}


def measured(name: str, batch: int, repeats: int) -> Row:
    """Return the milliseconds of each way to take a step of so many motions."""
    import torch

    step = symphys.compile_step(name)
    state, _, inputs = step.start(batch)
    action = np.zeros((batch, step.action_size))
    lanes, kernel = step._rows(state, action, inputs[:, 0]), step._evaluated
    env = symphys.env.VectorEnv(name, batch)
    env.reset(seed=0)
    learned = symphys.torch.step(name)
    begin, _, _ = learned.start(batch)
    actions = torch.zeros(batch, learned.action_size, requires_grad=True)
    ones = [np.ones((batch, n)) for n in (learned.state_size, learned.observation_size)]
    calls = {
        "kernel_ms": lambda: kernel.forward(lanes, (0.0,)),
        "step_ms": lambda: step(state, action, inputs[:, 0]),
        "environment_ms": lambda: env.step(action),
        "adjoint_ms": lambda: learned.compiled.pull(begin, actions.detach(), *ones, np.ones(batch)),
        "torch_ms": lambda: learned(begin, actions).cost.sum().backward(),
    }
    for call in calls.values():
        call()  # the first one compiles
    return {key: 1e3 * seconds for key, seconds in in_turns(calls, repeats).items()}
