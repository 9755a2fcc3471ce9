"""Arguments that several commands share, and how they are read."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click
from click.shell_completion import CompletionItem

from symphys.errors import SymphysError
from symphys.suggest import hint

if TYPE_CHECKING:
    from symphys.problem import Problem
    from symphys.problem.sweeps.sweep import Sweep

F = TypeVar("F", bound=Callable[..., Any])
REPORTS = Path("reports")
INTERRUPTED = 130
"""The exit code after Ctrl-C: 128 + SIGINT."""
MAX_MESSAGES = 100
"""Most progress messages while a sweep is read."""
settings_option = click.option(
    "--set",
    "assignments",
    multiple=True,
    metavar="KEY=VALUE",
    help="Change a value of the problem file, e.g. simulation.dt=0.005 or solver.cma.evaluations=2000. Repeatable.",
)
out_option = click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=REPORTS,
    show_default=True,
    help="Output folder.",
)


class UsageFault(SymphysError):
    """Raised for an argument that cannot be used."""


def complete_problem(_context: click.Context, _argument: click.Parameter, begun: str) -> list[CompletionItem]:
    """Complete shipped problems, robots and tasks, and TOML files; where there are none, any path."""
    from symphys import problems

    folder = Path(begun) if begun.endswith("/") else Path(begun).parent
    entries = sorted(folder.iterdir()) if folder.is_dir() else []
    offered = [each for each in entries if each.suffix == ".toml" or (each.is_dir() and each.name[0] != ".")]
    there = [f"{entry}/" if entry.is_dir() else str(entry) for entry in offered]
    found = [name for name in (*problems.catalogue(), *problems.parts(), *there) if name.startswith(begun)]
    return [CompletionItem(name) for name in found] or [CompletionItem(begun, type="file")]


def complete_solvers(_context: click.Context, _option: click.Parameter, begun: str) -> list[CompletionItem]:
    """Complete the last of the names of solvers, which commas separate."""
    from symphys.solvers import SOLVERS

    before, comma, last = begun.rpartition(",")
    return [CompletionItem(f"{before}{comma}{name}") for name in SOLVERS if name.startswith(last)]


def complete_backend(_context: click.Context, _option: click.Parameter, begun: str) -> list[CompletionItem]:
    """Complete the name of a backend."""
    from symphys.codegen.backends import NAMES

    return [CompletionItem(name) for name in NAMES if name.startswith(begun)]


def sweep_options(command: F) -> F:
    """Add ``--sweep KEY=VALUES``, which is repeatable, and ``--samples KIND:COUNT``."""
    sweep = click.option(
        "--sweep",
        "sweeps",
        multiple=True,
        metavar="KEY=VALUES",
        help="Solve for several values of a key: ball.mass=0.2:2:10 (10 values from 0.2 to 2), ball.mass=0.1:10:5:log, "
        "ground.friction=0.2,0.5,1. Repeatable: every combination. `none` ignores the sweep in the file.",
    )
    samples = click.option(
        "--samples",
        metavar="KIND:COUNT",
        help="Sample the sweep instead of solving every combination: lhs:100 (Latin hypercube), sobol:64, sobol:64:1 "
        "(with a seed), or grid (every combination). Keys may then have a range without a count: ball.mass=0.2:2.",
    )
    return sweep(samples(command))


backend_option = click.option(
    "--backend",
    default="auto",
    show_default=True,
    metavar="auto|casadi|c|simd|simd32|cuda|cuda32",
    shell_complete=complete_backend,
    help="Evaluate with SIMD kernels (simd32: single precision) or casadi's C code, which need a C compiler, with a "
    "GPU (cuda32: single precision; needs the extra cuda), or with casadi's virtual machine (casadi).",
)


def read_backend(name: str) -> str:
    """Return the name of a backend; UsageFault if there is none of that name."""
    from symphys.codegen.backends import NAMES

    if name not in NAMES:
        raise UsageFault(f"--backend: there is no backend {name!r}; {hint(name, NAMES)}")
    return name


def read_settings(assignments: Iterable[str]) -> dict[str, object]:
    """Read ``KEY=VALUE`` pairs; a value is TOML, or plain text if it is not valid TOML."""
    from symphys.problem.reading.messages import read_value

    settings: dict[str, object] = {}
    for assignment in assignments:
        key, equals, text = assignment.partition("=")
        if not key.strip() or not equals:
            raise UsageFault(f"--set {assignment!r}: write KEY=VALUE, for instance simulation.dt=0.005")
        settings[key.strip()] = read_value(text.strip())
    return settings


def read_problems(sources: Sequence[str], settings: dict[str, object]) -> list[Problem]:
    """Read each problem once, from files or under shipped names; two of one name would share run folders."""
    from symphys.problem import load_problem

    paths = list(dict.fromkeys(problem_path(source) for source in sources))
    problems = [load_problem(path, settings) for path in paths]
    seen: dict[str, Path] = {}
    for problem, path in zip(problems, paths, strict=True):
        if problem.name in seen:
            raise UsageFault(f"{seen[problem.name]} and {path} have one name: rename one, or solve them apart")
        seen[problem.name] = path
    return problems


def read_sweeps(
    problems: Iterable[Problem], sweeps: Sequence[str], samples: str | None
) -> list[tuple[Problem, Sweep | None]]:
    """Return each problem with its sweep, from its file, --sweep and --samples; None without a sweep."""
    from symphys.problem.sweeps.points import combined
    from symphys.problem.sweeps.reading import read_axes, read_samples

    axes, alone = read_axes(sweeps)
    chosen = None if samples is None else read_samples(samples)
    found: list[tuple[Problem, Sweep | None]] = []
    for problem in problems:
        own = None if alone else problem.sweep
        asked = axes or chosen is not None or own is not None
        found.append((problem, combined(own, problem, axes, chosen) if asked else None))
    return found


def points_of(
    found: Sequence[tuple[Problem, Sweep | None]], working: Callable[..., AbstractContextManager[Callable[[str], None]]]
) -> Iterator[Problem]:
    """Yield each problem, or each point of its sweep, validated one by one; ``working`` shows the progress."""
    from symphys.problem.sweeps.points import swept

    count = sum(len(sweep) for _, sweep in found if sweep is not None)
    seen = 0
    shown = {f"point {k + 1:,} of {count:,}": 1.0 for k in range(0, count, max(count // MAX_MESSAGES, 1))}
    with working("checking the sweep", shown) if count > MAX_MESSAGES else nullcontext(str) as tell:
        for problem, sweep in found:
            for point in [problem] if sweep is None else swept(problem, sweep):
                yield point
                seen += sweep is not None
                if (words := f"point {seen + 1:,} of {count:,}") in shown:
                    tell(words)


def problem_path(source: str) -> Path:
    """Return the path of a file, or of a shipped problem, which a folder of its name does not hide."""
    from symphys import problems

    shipped = problems.catalogue()
    if source in shipped and not Path(source).is_file():
        return shipped[source]
    return problems.find(source)


def read_solvers(text: str | None) -> tuple[str, ...] | None:
    """Read names separated by commas, each once; None, for the solvers of each problem, if none are given."""
    from symphys.solvers import SOLVERS

    if text is None:
        return None
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",")))
    for name in names:
        if name not in SOLVERS:
            raise UsageFault(f"--solver: there is no solver {name!r}; {hint(name, SOLVERS)}")
    return names
