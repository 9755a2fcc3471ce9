"""What a step with open commands costs beside its kernel: alone, as an environment, in PyTorch with its gradient."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

import symphys

NAMES, BATCHES, REPEATS = ("cart_pole", "quadruped_shift"), (1, 128, 1024), 25


def fastest(call: Callable[[], object], repeats: int = REPEATS) -> float:
    """Seconds of the fastest of some calls."""
    call()
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        call()
        times.append(time.perf_counter() - began)
    return min(times)


def measured(name: str, batch: int, repeats: int = REPEATS) -> dict[str, float]:
    """Seconds of each way to take a step of so many motions."""
    step = symphys.compile_step(name)
    state, _, inputs = step.start(batch)
    action = np.zeros((batch, step.action_size))
    rows, kernel = step._rows(state, action, inputs[:, 0]), step._evaluated
    times = {
        "kernel": fastest(lambda: kernel.forward(rows, (0.0,)), repeats),
        "step": fastest(lambda: step(state, action, inputs[:, 0]), repeats),
    }
    env = symphys.env.VectorEnv(name, batch)
    env.reset(seed=0)
    times["environment"] = fastest(lambda: env.step(action), repeats)
    return times | with_gradient(name, batch, repeats)


def with_gradient(name: str, batch: int, repeats: int) -> dict[str, float]:
    """Seconds of a step and its adjoint in PyTorch, and of the kernel's part in it."""
    import torch

    step = symphys.torch.step(name)
    state, _, _ = step.start(batch)
    action = torch.zeros(batch, step.action_size, requires_grad=True)
    compiled, ones = step.compiled, [np.ones((batch, n)) for n in (step.state_size, step.observation_size)]
    pull = fastest(lambda: compiled.pull(state, action.detach(), *ones, np.ones(batch)), repeats)
    return {"adjoint": pull, "torch": fastest(lambda: step(state, action).cost.sum().backward(), repeats)}


def main() -> None:
    """Print the table."""
    print("| problem | motions | kernel [ms] | step | environment | steps a second | adjoint | PyTorch, both |")
    print("|---|---|---|---|---|---|---|---|")
    for name in NAMES:
        for batch in BATCHES:
            times = measured(name, batch)
            rate = batch / times["environment"]
            parts = [f"{1e3 * times[key]:.2f}" for key in ("kernel", "step", "environment")]
            parts += [f"{rate:,.0f}", *(f"{1e3 * times[key]:.2f}" for key in ("adjoint", "torch"))]
            print(f"| {' | '.join([name, f'{batch:,}', *parts])} |")


if __name__ == "__main__":
    main()
