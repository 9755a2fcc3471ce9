"""The entry of all benchmarks: list them, run one, print its rows and store them with the machine and the commit.

    python benchmarks/bench.py                                    # list names and questions
    python benchmarks/bench.py NAME [--quick] [--out FILE] [--OPTION VALUE ...]

A benchmark is a module in this folder with three things: a docstring whose first line is its question, ``COLUMNS``
(what each column means, with its unit), and ``rows``, a generator of rows by column. The keyword parameters of ``rows``
are the options of the command line; each has a default, and ``quick`` makes a run of some seconds that only shows that
the benchmark works. A run with all defaults is stored as ``results/NAME.json``; other runs are stored with ``--out``.
"""

from __future__ import annotations

import argparse
import ast
import inspect
import json
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from datetime import UTC, datetime
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage
from typing import Any

FOLDER = Path(__file__).resolve().parent
RESULTS = FOLDER / "results"
CALL = "--call"
"""First argument of a process that calls one function of a benchmark; see ``in_process``."""
PACKAGES = ("casadi", "numpy", "scipy", "mujoco", "torch")
SHARED_LOAD = 0.25
"""Load average a core above which other work on the machine is assumed."""
INF = float("inf")
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

Row = dict[str, Any]
Call = Callable[[], object]


def names() -> list[str]:
    """Return the names of all benchmarks: modules of this folder that define ``rows``."""
    return [file.stem for file in sorted(FOLDER.glob("*.py")) if "\ndef rows(" in file.read_text(encoding="utf-8")]


def question(name: str) -> str:
    """Return the question of a benchmark without importing it."""
    found = ast.get_docstring(ast.parse((FOLDER / f"{name}.py").read_text(encoding="utf-8"))) or ""
    return found.splitlines()[0]


def options_of(name: str) -> dict[str, Any]:
    """Return the options of a benchmark with their defaults, ``quick`` aside."""
    parameters = inspect.signature(import_module(name).rows).parameters
    return {key: each.default for key, each in parameters.items() if key != "quick"}


def main(arguments: list[str]) -> int:
    """Run the command line and return its exit code."""
    if not arguments:
        for name in names():
            print(f"make bench-{name:<14} {question(name)}")
        return 0
    name, *rest = arguments
    if name not in names():
        print(f"there is no benchmark {name}; there are: {', '.join(names())}", file=sys.stderr)
        return 2
    for variable in THREAD_VARIABLES:  # rollouts are shared out among threads, not matrices
        os.environ.setdefault(variable, "1")
    os.environ.setdefault("SYMPHYS_WAIT", "1")  # kernels are measured, not the interpreter before them
    module, defaults = import_module(name), options_of(name)
    parser = argparse.ArgumentParser(
        prog=f"bench.py {name}", description=module.__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="a run of some seconds, whose numbers mean little")
    parser.add_argument("--out", type=Path, help="where the rows are stored")
    for key, default in defaults.items():
        many = {"nargs": "*"} if isinstance(default, tuple) else {"type": type(default)}
        parser.add_argument(f"--{key}", default=default, **many)  # type: ignore[arg-type]
    given = vars(parser.parse_args(rest))
    quick, out = given.pop("quick"), given.pop("out")
    record = header(name, module.COLUMNS, given | {"quick": quick})
    began = time.perf_counter()
    record["rows"] = list(printed(module.rows(quick=quick, **given), module.COLUMNS))
    record["seconds"] = round(time.perf_counter() - began, 1)
    if out is None and not quick and all(given[key] == default for key, default in defaults.items()):
        out = RESULTS / f"{name}.json"
    if out is not None:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(written(record), encoding="utf-8")
        print(f"\nstored: {out}")
    return 1 if any(row.get("fault") for row in record["rows"]) else 0


def written(record: Mapping[str, Any]) -> str:
    """Return a record as JSON with a line for each row."""
    lines = ",\n".join(f"  {json.dumps(row, allow_nan=False, ensure_ascii=False)}" for row in record["rows"])
    text = json.dumps({**record, "rows": []}, indent=1, ensure_ascii=False)
    return text.replace('"rows": []', f'"rows": [\n{lines}\n ]') + "\n"


def header(name: str, columns: Mapping[str, str], options: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a stored result says besides its rows: question, options, commit, date, machine and versions."""
    load = os.getloadavg()[0]
    machine = {
        "processor": processor(),
        "cores": os.cpu_count(),
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1),
        "load_before": round(load, 2),
        "shared": load > SHARED_LOAD * (os.cpu_count() or 1),
    }
    return {
        "benchmark": name,
        "question": question(name),
        "columns": dict(columns),
        "options": dict(options),
        "commit": commit(),
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": machine,
        "versions": {"python": platform.python_version(), **dict(installed())},
    }


def processor() -> str:
    """Return the name of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def commit() -> str:
    """Return the commit of the working tree, with a plus sign where code differs from it."""
    try:
        short = git("rev-parse", "--short", "HEAD")
        changed = git("status", "--porcelain", "--", ".", ":!benchmarks/results", ":!docs")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return short + ("+" if changed else "")


def git(*arguments: str) -> str:
    """Return what a git command prints."""
    command = ["git", "-C", str(FOLDER.parent), *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def installed() -> Iterator[tuple[str, str]]:
    """Yield the versions of packages that are installed."""
    for package in PACKAGES:
        try:
            yield package, version(package)
        except PackageNotFoundError:
            continue


def printed(rows: Iterable[Row], columns: Mapping[str, str]) -> Iterator[Row]:
    """Print rows as a Markdown table while they come; numbers that are not finite become None."""
    for key, meaning in columns.items():
        print(f"{key}: {meaning}")
    head: list[str] = []
    for row in rows:
        if unknown := row.keys() - columns.keys():
            raise KeyError(f"columns that are not described: {', '.join(sorted(unknown))}")
        row = {key: None if value != value or value in (INF, -INF) else value for key, value in row.items()}
        if list(row) != head:
            head = list(row)
            print(f"\n| {' | '.join(head)} |\n{'|---' * len(head)}|")
        print(f"| {' | '.join(map(cell, row.values()))} |", flush=True)
        yield row


def cell(value: Any) -> str:
    """Return a value as the text of a cell: four digits of a float, a dash for nothing."""
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def fastest(call: Call, repeats: int = 7, clock: Callable[[], float] = time.perf_counter, least: float = 0) -> float:
    """Return the seconds of the fastest of some calls, which are repeated for at least so many seconds."""
    found, began = list[float](), time.perf_counter()
    while len(found) < repeats or time.perf_counter() - began < least:
        found += all_turns({"": call}, 1, clock)[""]
    return min(found)


def in_turns(
    calls: Mapping[str, Call], turns: int = 7, clock: Callable[[], float] = time.perf_counter
) -> dict[str, float]:
    """Return the least seconds of each call; calls take turns, so that other work on the machine disturbs all."""
    return {key: min(times) for key, times in all_turns(calls, turns, clock).items()}


def all_turns(
    calls: Mapping[str, Call], turns: int = 7, clock: Callable[[], float] = time.perf_counter
) -> dict[str, list[float]]:
    """Return the seconds of each call in each turn."""
    found: dict[str, list[float]] = {key: [] for key in calls}
    for _ in range(turns):
        for key, call in calls.items():
            began = clock()
            call()
            found[key].append(clock() - began)
    return found


def spent() -> float:
    """Return the seconds of processors so far, of this process and of those that it waited for, such as compilers."""
    return sum(sum(getrusage(who)[:2]) for who in (RUSAGE_SELF, RUSAGE_CHILDREN))


def peak() -> float:
    """Return the most memory of this process so far [MiB]."""
    return getrusage(RUSAGE_SELF).ru_maxrss / 1024


def in_process(
    function: Callable[..., Any], *arguments: Any, env: Mapping[str, str] | None = None, timeout: float | None = None
) -> Any:
    """Call a function of a benchmark in a process of its own.

    Args:
        function: of a module in this folder; what it returns must be JSON.
        arguments: positional, JSON.
        env: environment variables beside those of this process.
        timeout: seconds after which ``subprocess.TimeoutExpired`` is raised.

    Returns:
        What the function returned.

    Raises:
        RuntimeError: The process failed; the text is the end of what it wrote.
    """
    place = Path(inspect.getfile(function)).stem
    command = [sys.executable, str(Path(__file__)), CALL, place, function.__name__, json.dumps(arguments)]
    environment = os.environ | dict(env or {})
    done = subprocess.run(command, env=environment, timeout=timeout, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{place}.{function.__name__}: exit {done.returncode}: {done.stderr.strip()[-600:]}")
    return json.loads(done.stdout.splitlines()[-1])


def called(module: str, function: str, arguments: str) -> None:
    """Be the process of ``in_process``: print as last line what the function returns."""
    found = getattr(import_module(module), function)(*json.loads(arguments))
    print("\n" + json.dumps(found))


if __name__ == "__main__":
    if sys.argv[1:2] == [CALL]:
        called(*sys.argv[2:])
    else:
        sys.exit(main(sys.argv[1:]))
