"""Two versions side by side: what each takes for the same work, in turns, and how far their numbers differ.

``python benchmarks/versions.py COMMIT`` compares the working tree with a commit. Each measurement is a process of its
own, with the code of this file; versions take turns, so that other work on the machine is in both. Printed is the
median over the turns of new / old, with its bar where there is one. Where kernels are the same files, to the byte, what
runs them differs by noise alone. ``--out FILE`` keeps the seconds as JSON, with the
machine and both commits.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
FARMS = ROOT / "build" / "versions"
BARS = {
    "values": 1 / 0.97,
    "gradient": 1 / 0.97,
    "cold start": 1.05,
    "jacobians": 1.03,
    "iterations": 1.03,
    "memory": 1.05,
}
"""Of new / old."""
SECONDS = 1.0
"""That a measurement repeats its call for, at least three times."""


def problem(name: str) -> Any:
    """A shipped problem, or one of those below."""
    import symphys

    if name == "table_robot":
        from table_robot import table_problem

        return table_problem([8], 100)
    if name == "16 spheres":
        from against_mujoco import text
        from measured_worlds import problem_of

        return problem_of(text("box", 0.01))
    return symphys.load(name)


def fastest(call: Callable[[], object]) -> float:
    """Seconds, the best of several."""
    found, began = list[float](), time.perf_counter()
    while len(found) < 3 or time.perf_counter() - began < SECONDS:
        start = time.perf_counter()
        call()
        found.append(time.perf_counter() - start)
    return min(found)


def peak() -> float:
    """[MiB] of this process."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def warm(name: str) -> dict[str, float]:
    """Values and gradients of one rollout and of 128, with the kernels there; numbers to compare."""
    from symphys.transcription import transcribe

    shooting = transcribe(problem(name), threads=1).shooting
    z = shooting.start(0)
    many = z + 1e-3 * np.random.default_rng(0).standard_normal((128, z.size))
    evaluator, found = shooting.evaluator, evaluated(shooting.evaluator.gradient(many[:2], 0.0))
    times = {}
    for count, rows in (("one", many[:1]), ("128", many)):
        times[f"values, {count}"] = fastest(lambda rows=rows: evaluator.value(rows, 0.0))  # type: ignore[misc]
        times[f"gradient, {count}"] = fastest(lambda rows=rows: evaluator.gradient(rows, 0.0))  # type: ignore[misc]
    return times | {"memory": peak()} | found


def evaluated(found: Any) -> dict[str, float]:
    """Numbers that two versions should agree in."""
    return {"= merit": float(found.merit.sum()), "= slopes": float(np.abs(found.gradient).sum())}


def cold(name: str) -> dict[str, float]:
    """Seconds of processors until the first gradient, with nothing built or compiled."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["SYMPHYS_CACHE"] = folder
        from symphys.transcription import transcribe

        shooting = transcribe(problem(name), threads=1).shooting
        shooting.evaluator.gradient(shooting.start(0)[None], 0.0)
        whole = sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return {"cold start": whole, "memory": peak()}


def stages(name: str) -> dict[str, float]:
    """Slopes of all steps, and an iteration of iLQR."""
    from symphys.solvers import solver
    from symphys.transcription import transcribe

    shooting = transcribe(problem(name), threads=1).shooting
    staged = shooting.staged()
    motion = staged.roll_out(shooting.start(0), 0.0)
    chosen, found = solver("ilqr"), {"jacobians": fastest(lambda: staged.linearize(motion))}
    slopes = staged.linearize(motion)
    numbers = {"= a": float(np.abs(slopes.a).sum()), "= b": float(np.abs(slopes.b).sum())}

    def solve(iterations: int) -> Callable[[], object]:
        return lambda: chosen.solve(shooting, shooting.start(0), chosen.Options(iterations=iterations), 0)

    found["iterations"] = fastest(solve(8))
    return found | {"memory": peak()} | numbers


MEASUREMENTS: dict[str, tuple[Callable[[str], dict[str, float]], str]] = {
    **{f"{name}": (warm, name) for name in ("ball_throw", "table_robot", "quadruped_walk", "16 spheres")},
    **{f"{name}, cold": (cold, name) for name in ("ball_throw", "table_robot", "quadruped_walk", "16 spheres")},
    **{f"{name}, stages": (stages, name) for name in ("cart_pole", "planar_hopper", "half_cheetah_run")},
}


def version(commit: str) -> tuple[Path, str]:
    """(where a version can be imported from, its commit); "" is the working tree."""
    tree = ROOT
    if commit:
        commit = git("rev-parse", "--short", commit)
        tree = FARMS / commit
        if not tree.exists():
            git("worktree", "add", "--detach", str(tree), commit)
    farm = FARMS / f"farm-{commit or 'here'}" / "symphys"
    farm.mkdir(parents=True, exist_ok=True)
    for path in (*(tree / "symphys").iterdir(), tree / "solvers", tree / "problems", tree / "benchmarks"):
        link = farm / path.name
        if not link.is_symlink() and path.name != "__pycache__":
            link.symlink_to(path)
    return farm.parent, commit or git("rev-parse", "--short", "HEAD") + " and changes"


def git(*arguments: str) -> str:
    """What git says."""
    return subprocess.run(
        ["git", "-C", str(ROOT), *arguments], check=True, capture_output=True, text=True
    ).stdout.strip()


def measure(name: str, farm: Path) -> dict[str, float]:
    """In a process of its own."""
    environment = os.environ | {"PYTHONPATH": str(farm), "SYMPHYS_CACHE": str(farm / "kernels"), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, __file__, "--measure", name]
    done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    return dict(json.loads(done.stdout.splitlines()[-1]))


def compared(name: str, farms: tuple[Path, Path], turns: int) -> Iterator[tuple[str, list[float], list[float]]]:
    """For each number: those of the old version and of the new, one a turn; a first turn fills the caches."""
    for farm in farms:
        measure(name, farm)
    found = [[measure(name, farm) for farm in farms] for _ in range(turns)]
    for key in found[0][0]:
        yield key, [old[key] for old, _ in found], [new[key] for _, new in found]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commit", nargs="?", default="HEAD")
    parser.add_argument("--turns", type=int, default=5)
    parser.add_argument("--only", default="", help="measurements whose name contains this")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--measure", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.measure:
        make, name = MEASUREMENTS[given.measure]
        sys.path[0] = str(Path(os.environ["PYTHONPATH"]) / "symphys" / "benchmarks")  # worlds of the same version
        print(json.dumps(make(name)))
        return
    (old, before), (new, now) = version(given.commit), version("")
    kept = dict[str, Any](machine=platform.processor() or platform.machine(), old=before, new=now, measured={})
    print(f"{before} -> {now}: median of new / old over {given.turns} turns\n")
    for name in MEASUREMENTS:
        if given.only not in name:
            continue
        for key, one, other in compared(name, (old, new), given.turns):
            kept["measured"][f"{name}: {key}"] = [one, other]
            if key.startswith("="):
                apart = abs(other[0] - one[0]) / max(abs(one[0]), 1e-300)
                print(f"{name:28} {key[2:]:14} {one[0]:12.6g} {'':12} apart by {apart:.1e}", flush=True)
                continue
            ratio = float(np.median(np.array(other) / np.array(one)))
            bar = next((bar for start, bar in BARS.items() if key.startswith(start)), np.inf)
            verdict = "" if ratio <= bar else f"  beyond {bar:.3f}"
            print(f"{name:28} {key:14} {min(one):12.6g} {min(other):12.6g} {ratio:8.3f}{verdict}", flush=True)
    built, rebuilt = ({path.name for path in (farm / "kernels").glob("*.so")} for farm in (old, new))
    print(f"\nkernels: {len(built & rebuilt)} the same, {len(built - rebuilt)} old, {len(rebuilt - built)} new")
    if given.out:
        given.out.write_text(json.dumps(kept, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
