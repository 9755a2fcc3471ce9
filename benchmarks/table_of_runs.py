"""How long it takes to find one run among many.

    python benchmarks/table_of_runs.py [RUNS]

One examined solve of ``ball_throw`` is copied into so many run folders, a hundred seeds a case. Each command runs in a
process of its own, as from a shell: first without the rows that are kept beside the folders, then with them.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import symphys
from symphys.results.case_name import case_name
from symphys.results.file_names import CONFIG, RESULT
from symphys.results.table import Journal, write_table

RUNS, SEEDS = 10_000, 100
COMMAND = """
import sys
from symphys.cli import main
from symphys.runs.provenance import peak_memory
main(sys.argv[1:])
print(peak_memory(), file=sys.stderr)
"""
COMMANDS: dict[str, Sequence[str]] = {
    "ls, nothing kept": ("ls",),
    "ls": ("ls",),
    "ls --where objective<1e-6": ("ls", "--where", "objective<1e-6"),
    "ls --csv": ("ls", "--csv"),
    "best --overall": ("best", "--overall"),
}


def main() -> None:
    """A line for each command, and two for what a batch does itself."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else RUNS
    with TemporaryDirectory() as place:
        solution = symphys.solve("ball_throw", "gradient", folder=Path(place, "one"), backend="casadi", examine=True)
        out = Path(place, "many")
        folders = copies(solution.folder, out, count)
        size = (solution.folder / RESULT).stat().st_size / 1e3
        print(f"{count:,} runs, {size:.0f} kB of result.json each")
        for name, arguments in COMMANDS.items():
            seconds, work, peak = measured([*arguments, str(out)])
            print(f"  {name:<28} {seconds:5.2f} s, {work:5.2f} s of a processor, {peak:4.0f} MB", flush=True)
        journal, some = Journal(out), folders[:1000]
        print(f"  a run that ends: its row     {timed(lambda: [journal.add(each) for each in some]) / len(some):.5f} s")
        print(f"  runs.csv and runs.parquet    {timed(lambda: write_table(out)):5.2f} s")


def copies(folder: Path, out: Path, count: int) -> list[Path]:
    """Run folders with what commands on many runs look at: all files but figures and motions."""
    config, result = (json.loads((folder / name).read_text(encoding="utf-8")) for name in (CONFIG, RESULT))
    found = []
    for number in range(count):
        case, seed = divmod(number, SEEDS)
        settings = {"ground.friction": round(0.2 + 0.001 * case, 3)}
        copy = out / case_name(config["problem"], settings) / f"{config['solver']}-seed{seed}"
        copy.mkdir(parents=True)
        for name in ("problem.toml", "trace.csv", "log.txt"):
            (copy / name).write_bytes((folder / name).read_bytes())
        (copy / CONFIG).write_text(json.dumps({**config, "seed": seed, "settings": settings}, indent=1))
        changed = {**result, "seed": seed, "objective": result["objective"] * (1 + number)}
        (copy / RESULT).write_text(json.dumps(changed, indent=1), encoding="utf-8")
        found.append(copy)
    return found


def measured(arguments: Sequence[str]) -> tuple[float, float, float]:
    """Of a command line: seconds, those of the processor, and the most memory that it held [MB]."""
    began, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    call = [sys.executable, "-P", "-c", COMMAND, *arguments]
    done = subprocess.run(call, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    work = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return time.perf_counter() - began, work, int(done.stderr.split()[-1]) / 1e6


def timed(call: Callable[[], object]) -> float:
    """Seconds of a call."""
    began = time.perf_counter()
    call()
    return time.perf_counter() - began


if __name__ == "__main__":
    main()
