"""What got slower since another commit?

Two versions run in turns on this machine: the working tree and ``--old``, a commit. Each measurement is a process of
its own with the code of this file and the worlds of this folder, so both versions do the same work; other work on the
machine disturbs both. A number is slower where the median over the turns of new / old is beyond its limit. Where
kernels are the same files, to the byte, their rollouts differ by noise alone. The values that both versions compute
are compared too.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from bench import Row, commit, fastest, git, in_process, peak, spent

ROOT = Path(__file__).resolve().parents[1]
FARMS = ROOT / "build" / "versions"
COLUMNS = {
    "measurement": "the problem and what is done with it",
    "number": "seconds of a call, seconds of processors of a cold start, memory [MiB], or a value that both compute",
    "old": "least of the old version, or its value",
    "new": "least of the new version, or its value",
    "ratio": "median over the turns of new / old",
    "limit": "ratio above which a number got slower",
    "slower": "whether it did",
    "apart": "relative difference of values",
}
LIMITS = {
    "values": 1 / 0.97,
    "gradient": 1 / 0.97,
    "cold start": 1.05,
    "jacobians": 1.03,
    "iterations": 1.03,
    "memory": 1.05,
}
LEAST = 1.0
"""A measurement repeats its call for so many seconds, and at least three times."""
ROLLOUTS = ("ball_throw", "table_robot", "quadruped_walk", "16 spheres")
STAGED = ("cart_pole", "planar_hopper", "half_cheetah_run")


def rows(quick: bool = False, old: str = "HEAD", turns: int = 5, only: str = "") -> Iterator[Row]:
    """Yield a row for each number of each measurement, and at last one that says what got slower.

    Args:
        quick: one turn of the first measurement.
        old: the commit to compare with.
        turns: runs of each measurement by each version.
        only: measurements whose name contains this.
    """
    farms, found = (farm_of(old), farm_of("")), list[Row]()
    chosen = [name for name in MEASUREMENTS if only in name]
    for name in chosen[:1] if quick else chosen:
        for row in compared(name, farms, 1 if quick else turns):
            found.append(row)
            yield row
    built, rebuilt = ({path.name for path in (farm / "kernels").glob("*.so")} for farm in farms)
    print(f"\n{git('rev-parse', '--short', old)} -> {commit()}")
    print(f"kernels: {len(built & rebuilt)} the same, {len(built - rebuilt)} old, {len(rebuilt - built)} new")
    slower = [f"{row['measurement']}: {row['number']} ({row['ratio']:.3f})" for row in found if row["slower"]]
    print("slower: " + ("; ".join(slower) or "nothing"))


def compared(name: str, farms: tuple[Path, Path], turns: int) -> Iterator[Row]:
    """Yield the rows of one measurement; a first turn fills the caches."""
    for farm in farms:
        measured_by(farm, name)
    found = [[measured_by(farm, name) for farm in farms] for _ in range(turns)]
    for key in found[0][0]:
        old, new = ([turn[k][key] for turn in found] for k in (0, 1))
        row = dict.fromkeys(COLUMNS) | {"measurement": name, "number": key.removeprefix("= "), "slower": False}
        if key.startswith("= "):
            yield row | {"old": old[0], "new": new[0], "apart": abs(new[0] - old[0]) / max(abs(old[0]), 1e-300)}
            continue
        ratio = float(np.median(np.array(new) / np.array(old)))
        limit = next(limit for start, limit in LIMITS.items() if key.startswith(start))
        yield row | {"old": min(old), "new": min(new), "ratio": ratio, "limit": limit, "slower": ratio > limit}


def farm_of(commit: str) -> Path:
    """Return a folder from which a version can be imported; "" is the working tree."""
    tree = ROOT
    if commit:
        commit = git("rev-parse", "--short", commit)
        tree = FARMS / commit
        if not tree.exists():
            git("worktree", "add", "--detach", str(tree), commit)
    farm = FARMS / f"farm-{commit or 'here'}" / "symphys"
    farm.mkdir(parents=True, exist_ok=True)
    for path in (*(tree / "symphys").iterdir(), tree / "solvers", tree / "problems"):
        link = farm / path.name
        if not link.is_symlink() and path.name != "__pycache__":
            link.symlink_to(path)
    return farm.parent


def measured_by(farm: Path, name: str) -> dict[str, float]:
    """Return the numbers of one measurement by one version; those that begin with "= " are values to compare."""
    environment = {"PYTHONPATH": str(farm), "SYMPHYS_CACHE": str(farm / "kernels"), "OMP_NUM_THREADS": "1"}
    return dict(in_process(measure, name, env=environment))


def measure(name: str) -> dict[str, float]:
    """Take one measurement in this process."""
    return MEASUREMENTS[name]()


def problem(name: str) -> Any:
    """Return a shipped problem, the table robot or the 16 spheres."""
    import symphys

    if name == "table_robot":
        from measured_worlds import table_problem

        return table_problem([8], 100)
    if name == "16 spheres":
        from measured_worlds import balls_in_a_box

        return balls_in_a_box()
    return symphys.load(name)


def warm(name: str) -> dict[str, float]:
    """Measure values and gradients of one rollout and of 128 with compiled kernels."""
    from symphys.transcription import transcribe

    shooting = transcribe(problem(name), threads=1).shooting
    z = shooting.start(0)
    many = z + 1e-3 * np.random.default_rng(0).standard_normal((128, z.size))
    evaluator = shooting.evaluator
    found = evaluator.gradient(many[:2], 0.0)
    numbers = {"= merit": float(found.merit.sum()), "= slopes": float(np.abs(found.gradient).sum())}
    times = {}
    for count, batch in (("one", many[:1]), ("128", many)):
        times[f"values, {count}"] = fastest(partial(evaluator.value, batch, 0.0), 3, least=LEAST)
        times[f"gradient, {count}"] = fastest(partial(evaluator.gradient, batch, 0.0), 3, least=LEAST)
    return times | {"memory": peak()} | numbers


def cold(name: str) -> dict[str, float]:
    """Measure the seconds of processors until the first gradient, with nothing built or compiled."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["SYMPHYS_CACHE"] = folder
        from symphys.transcription import transcribe

        shooting = transcribe(problem(name), threads=1).shooting
        shooting.evaluator.gradient(shooting.start(0)[None], 0.0)
        whole = spent()
    return {"cold start": whole, "memory": peak()}


def stages(name: str) -> dict[str, float]:
    """Measure the Jacobians of all steps, and eight iterations of iLQR."""
    from symphys.solvers import solver
    from symphys.transcription import transcribe

    shooting = transcribe(replace(problem(name), scenarios=None), threads=1).shooting  # samples have no stages
    staged, chosen = shooting.staged(), solver("ilqr")
    motion = staged.roll_out(shooting.start(0), 0.0)
    slopes = staged.linearize(motion)
    options = chosen.Options(iterations=8)
    times = {
        "jacobians": fastest(lambda: staged.linearize(motion), 3, least=LEAST),
        "iterations": fastest(lambda: chosen.solve(shooting, shooting.start(0), options, 0), 3, least=LEAST),
    }
    return times | {"memory": peak(), "= a": float(np.abs(slopes.a).sum()), "= b": float(np.abs(slopes.b).sum())}


MEASUREMENTS: dict[str, Callable[[], dict[str, float]]] = {
    **{name: partial(warm, name) for name in ROLLOUTS},
    **{f"{name}, cold": partial(cold, name) for name in ROLLOUTS},
    **{f"{name}, stages": partial(stages, name) for name in STAGED},
}
