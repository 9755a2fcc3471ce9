"""The table after the runs: one row per problem and solver, its seeds together."""

from __future__ import annotations

import math
import statistics
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from symphys.cli.wording import first_line, measured, number, timed, verdict, whole
from symphys.files import FileError
from symphys.findings.examination import Examination, HeldBound
from symphys.findings.obstacles import MAX_BOUNDS, bound_words, holding
from symphys.findings.verdict import BEST_FOUND, DOUBTED, NOT_SOLVED
from symphys.results.file_names import RESULT
from symphys.results.result import CheckRecord, VariableRecord, read_result

if TYPE_CHECKING:
    from symphys.batches import BatchResult
    from symphys.runs import Job, Result

Groups = Mapping[tuple[str, str], list["Result"]]
"""Results by (problem with its settings, solver)."""
MIN_WIDTH = 120
"""Least width of the table where the output is no terminal."""
NUMBERS = ("solved", "objective", "worst", "iterations", "work", "time", "ended")
OPTIONAL = ("work", "iterations", "time", "objective", "ended")
"""Columns that are left out on narrow terminals, in this order; no number is cut."""
NOTES = {"worst": "worst: largest error / tolerance, met at 1", "work": "work in rollouts", "time": "time of the solve"}
"""What is said below the table of columns that are there."""
MAX_ROWS = 30
"""Rows of the table; if there are more, the best and the worst are shown."""
MAX_ADVICE = 10
"""Lines of advice below a table of the best and the worst."""
MAX_ANSWERS, MAX_VARIABLES, MAX_COMPONENTS = 4, 6, 8
"""Runs whose answers are printed, variables of each, and components of a variable; of more the range is."""
MAX_MISSED = 3
"""Missed checks of a run that are named."""


def print_summary(jobs: list[Job], batch: BatchResult) -> None:
    """Print the table, and advice for runs that are not solved."""
    groups: dict[tuple[str, str], list[Result]] = {}
    for job, result in zip(jobs, batch.results, strict=True):
        group = groups.setdefault((job.case, job.config.solver), [])
        if result is not None:
            group.append(result)
    console = Console()
    if not console.is_terminal:
        console = Console(width=max(console.width, MIN_WIDTH))
    shown = best_and_worst(groups)
    console.print(fitting_table(shown, console.width, len(groups) - len(shown)))
    for line in answers(jobs, batch.results):
        console.print(Text(line), soft_wrap=True)
    if len(shown) < len(groups):
        console.print(Text(counts(batch, len(groups))), soft_wrap=True)
    for line in advice(shown) if len(shown) == len(groups) else advice_together(shown):
        console.print(Text(line), soft_wrap=True)


def answers(jobs: Sequence[Job], results: Sequence[Result | None]) -> list[str]:
    """Return what was found, a line for each variable, from the run folders; nothing of many runs."""
    if len(jobs) > MAX_ANSWERS:
        return []
    lines = []
    for job, result in zip(jobs, results, strict=True):
        if result is None or not result.accepted:
            continue
        try:
            found = read_result(job.folder.path / RESULT)
        except FileError:  # a page says what is wrong with the folder
            continue
        whose, variables = f"{job.name.removesuffix(' seed 0')}: " if len(jobs) > 1 else "", list(found.z.values())
        lines += [whose + answer(variable) for variable in variables[:MAX_VARIABLES]]
        if len(variables) > MAX_VARIABLES:
            lines.append(f"{whose}and {len(variables) - MAX_VARIABLES} more, in result.json")
        if found.checks:
            lines.append(whose + met(found.checks))
    return lines


def met(checks: Sequence[CheckRecord]) -> str:
    """Write ``met: lies at 10 m by 0.002 of 0.01 m, ...``: each check with its error, tolerance and unit."""
    named = [f'"{each.name}" by {number(each.error)} of {measured(each.tolerance, each.unit)}' for each in checks]
    more = f" and {len(checks) - MAX_VARIABLES} more" if len(checks) > MAX_VARIABLES else ""
    return f"met: {', '.join(named[:MAX_VARIABLES])}{more}"


def answer(variable: VariableRecord) -> str:
    """Write ``found throw = 12.1 0 1.21 m/s, guess 10 0 4 (ball.velocity)``; of many numbers the range."""
    unit = f" {variable.unit}" * bool(variable.unit)
    sets = " and ".join(variable.sets)
    if variable.value.size > MAX_COMPONENTS:
        low, high = (number(float(end)) for end in (variable.value.min(), variable.value.max()))
        knots = variable.value.shape[1]
        many = f"{knots} knots" if knots > 1 else f"{variable.value.size:,} numbers"
        return f"found {variable.name}: {many} from {low} to {high}{unit} ({sets})"
    parts = (part.T.ravel().tolist() for part in (variable.value, variable.guess))
    value, guess = (" ".join(number(each, 4) for each in part) for part in parts)
    return f"found {variable.name} = {value}{unit}, guess {guess} ({sets})"


def best_and_worst(groups: Groups) -> Groups:
    """Return all groups, or, if they do not fit into a table, the best and the worst ones, sorted."""
    if len(groups) <= MAX_ROWS:
        return groups
    ranked = sorted(groups, key=lambda name: rank(groups[name]))
    half = MAX_ROWS // 2
    return {name: groups[name] for name in (*ranked[:half], *ranked[-half:])}


def rank(group: list[Result]) -> tuple[float, float, float]:
    """Return a sort key, lower for better groups: share of failures, largest error, objective."""
    missed = sum(not result.accepted for result in group) / len(group) if group else math.inf
    worst = median(result.worst_ratio for result in group if not result.accepted)
    objective = median(known(result, "objective") for result in group)
    worst, objective = (math.inf if each is None or math.isnan(each) else each for each in (worst, objective))
    return missed, worst, objective


def counts(batch: BatchResult, groups: int) -> str:
    """Return how many runs ended in which way."""
    ends = Counter("not begun" if result is None else verdict(result) for result in batch.results)
    listed = ", ".join(f"{count:,} {words}" for words, count in ends.most_common())
    return f"{len(batch.results):,} runs: {listed}. The best and the worst of {groups:,} rows are shown."


def fitting_table(groups: Groups, width: int, left_out: int = 0) -> Table:
    """Return the table with as many columns as fit the width; names are wrapped if too few do."""
    for count in range(len(OPTIONAL) + 1):
        columns = [name for name in NUMBERS if name not in OPTIONAL[:count]]
        shown = table(groups, columns, left_out)
        if Console(width=1000).measure(shown).maximum <= width:
            break
    return shown


def table(groups: Groups, columns: Sequence[str] = NUMBERS, left_out: int = 0) -> Table:
    """Return the table of groups with these columns; a row in its middle says how many are left out."""
    several = any(len(group) > 1 for group in groups.values())
    notes = [note for column, note in NOTES.items() if column in columns] + ["medians over the seeds"] * several
    caption = "; ".join(notes)
    shown = Table(box=SIMPLE_HEAD, caption=caption, caption_justify="left")
    for name in ("problem", "solver"):
        shown.add_column(name, overflow="fold")
    for name in columns:
        shown.add_column(name, justify="left" if name == "ended" else "right", no_wrap=name != "ended")
    for row, ((problem, solver), group) in enumerate(groups.items()):
        if left_out and 2 * row == len(groups):
            shown.add_row(Text(f"... {left_out:,} more ...", style="dim"))
        found = cells(group)
        shown.add_row(Text(problem), Text(solver), *(found[name] for name in columns))
    return shown


def cells(group: list[Result]) -> dict[str, Text]:
    """Return the cells of one row, by column."""
    solved = sum(result.solved for result in group)
    ends = Counter(ended(result) for result in group)
    texts = [
        number(median(known(result, "objective") for result in group)),
        number(median(result.worst for result in group)),
        whole(median(known(result, "iterations") for result in group)),
        whole(median(known(result, "equivalents") for result in group)),
        timed(median(result.seconds.get("solve") for result in group)),
        ", ".join(status if count == len(group) else f"{status} {count}" for status, count in ends.items()),
    ]
    fine = group and all(result.accepted for result in group)
    style = "red" if not fine else "green" if solved == len(group) else "yellow"
    first = Text(f"{solved}/{len(group)}", style=style)
    return dict(zip(NUMBERS, [first, *map(Text, texts)], strict=True))


def known(result: Result, name: str) -> float | None:
    """Return a number of a result; None if the run did not reach it."""
    return None if name in result.absent else getattr(result, name)


def ended(result: Result) -> str:
    """Return how a run ended: the status of its solver, or the verdict where that says more."""
    return verdict(result) if result.verdict in (DOUBTED, BEST_FOUND) else result.status.replace("_", " ")


def median(values: Iterable[float | None]) -> float | None:
    """Return the median of the known values; None if there are none."""
    found = [value for value in values if value is not None]
    return statistics.median(found) if found else None


def advice(groups: Groups) -> list[str]:
    """Return why runs are doubted, and what to try for unsolved ones, each once per problem and solver."""
    lines = [
        f"{problem} {solver}: {line}"
        for (problem, solver), group in groups.items()
        for result in group
        for line in said(result)
        if line
    ]
    held = [f"{problem} {solver}: {line}" for (problem, solver), group in groups.items() for line in held_back(group)]
    return list(dict.fromkeys(lines + held))


def advice_together(groups: Groups) -> list[str]:
    """Return the advice for many groups: each line once, with the first group as an example."""
    examples: dict[str, list[str]] = {}
    for (problem, solver), group in groups.items():
        for line in advice({("", ""): group}):
            examples.setdefault(line.removeprefix(" : "), []).append(f"{problem} {solver}")
    lines = [
        f"{names[0]}{f' and {len(names) - 1} more' if len(names) > 1 else ''}: {line}"
        for line, names in sorted(examples.items(), key=lambda item: -len(item[1]))
    ]
    more = [f"and {len(lines) - MAX_ADVICE} more such lines"] if len(lines) > MAX_ADVICE else []
    return lines[:MAX_ADVICE] + more


def held_back(group: list[Result]) -> list[str]:
    """Return how many of several seeds end at the same bound, where a bound holds one of them back."""
    if len(group) < 2:
        return []
    bounds = [bound for result in group if not result.solved for bound in held_bounds(result)]
    counts = Counter(bound_words(bound, knots=False) for bound in bounds)
    total = f"of {len(group)} seeds"
    return [
        f"{count} {total} {'ends' if count == 1 else 'end'} at {words}"
        for words, count in counts.most_common(MAX_BOUNDS)
    ]


def held_bounds(result: Result) -> tuple[HeldBound, ...]:
    """Return the bounds that hold a run back."""
    return holding(Examination.from_json(dict(result.trust)), result.judge(result.verdict != NOT_SOLVED))


def said(result: Result) -> list[str]:
    """Return the lines on one run."""
    if result.verdict == DOUBTED:
        return [f"not to be trusted: {'; '.join(result.doubts)}"]
    return [] if result.solved else [missed(result), first_line(result.advice)]


def missed(result: Result) -> str:
    """Return the missed checks with their errors, the worst first; empty if there are none."""
    found = sorted((check for check in result.checks if not check.met), key=lambda check: -check.ratio)
    if not found:
        return ""
    named = [
        f'"{each.name}" by {measured(each.error, each.unit)} (tolerance {measured(each.tolerance, each.unit)})'
        for each in found
    ]
    more = f" and {len(found) - MAX_MISSED} more" if len(found) > MAX_MISSED else ""
    return f"missed: {', '.join(named[:MAX_MISSED])}{more}"
