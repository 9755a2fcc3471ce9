"""Words and tables that compare solvers and runs on the page of a batch."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from urllib.parse import quote

from symphys import files
from symphys.findings import writing
from symphys.findings.verdict import BEST_FOUND, DOUBTED
from symphys.findings.writing import show
from symphys.records import dataclass
from symphys.report.charts import palette
from symphys.report.making.stamps import RUN_PAGE
from symphys.report.pages import words
from symphys.report.pages.answers import found_numbers
from symphys.report.pages.markup import ICONS, Html, banner, card, dot, join, packed_json, pill, table, tag
from symphys.results.discovery import Entry, Study, middle
from symphys.results.result import CheckRecord, smoothed
from symphys.results.run import Run

MOST_BROKEN = 50
MOST_NAMED = 4
MOST_CHIPS = 40
"""Runs of a solver that have a chip each, at most; of more the page has a table."""
NOTHING_TO_MEET = "The problem has no targets or constraints, and no solver converged. The best point found is shown."

Measure = tuple[str, Callable[[Run], float], Callable[[float], str]]
"""A numeric column of the table of solvers: its title, how a run has it, and how it is written."""


def summary(found: Sequence[Study], broken: Sequence[Run]) -> str:
    """Say how many runs are solved."""
    runs = [run for study in found for run in study.runs]
    solved = sum(run.solved for run in runs)
    text = f"{solved} of {writing.several(len(runs), 'run')} solved"
    for word, meaning in ((DOUBTED, "met, but not to be trusted"), (BEST_FOUND, "the best found with nothing to meet")):
        number = sum(run.verdict == word for run in runs)
        text += f"; {number} {meaning}" if number else ""
    if len({study.problem for study in found}) > 1:
        whole = sum(all(entry.solved for entry in study.entries) for study in found)
        text += f"; {whole} of {len(found)} problems by every solver that was tried"
    if broken:
        text += f"; {writing.several(len(broken), 'folder')} without a readable result"
    return text + "."


def study_verdict(study: Study) -> Html:
    """Return a banner: which solvers solved it, and which with the least work and time."""
    entries = [entry for entry in study.entries if any(run.status != "not_applicable" for run in entry.runs)]
    full = [entry for entry in entries if entry.solved == len(entry.runs)]
    none = [entry for entry in entries if entry.solved == 0]
    if study.runs and all(run.verdict == BEST_FOUND for run in study.runs):
        return banner("fair", "Best found", NOTHING_TO_MEET)
    level = "good" if entries and len(full) == len(entries) else "bad" if len(none) == len(entries) else "fair"
    title = {"good": "Solved", "fair": "Solved in part", "bad": "Not solved"}[level]
    doubtful = [run for run in study.runs if run.verdict == DOUBTED]
    if level == "bad" and doubtful:
        title = "Met, but not to be trusted" if any(run.checks for run in doubtful) else "Found, but not to be trusted"
    return banner(level, title, tally(entries, full, none), doubted(doubtful), thrift(study))


def doubted(runs: Sequence[Run]) -> str:
    """Name the runs that met everything by a motion that is not to be relied on, with the reasons of the first."""
    if not runs:
        return ""
    why = "; ".join(runs[0].doubts)
    if len(runs) == 1:
        return f"{runs[0].solver}, seed {runs[0].seed}, is not to be relied on: {why}."
    named = writing.listed([f"{run.solver} seed {run.seed}" for run in runs[:MOST_NAMED]])
    more = f" and {len(runs) - MOST_NAMED} more" if len(runs) > MOST_NAMED else ""
    return f"Not to be relied on: {named}{more}. Of the first: {why}."


def tally(entries: Sequence[Entry], full: Sequence[Entry], none: Sequence[Entry]) -> str:
    """Name the solvers by how many of their seeds are solved."""
    seeds = max((len(entry.runs) for entry in entries), default=0)
    if len(entries) == len(full):
        some = {1: entries[0].solver if entries else "", 2: "Both solvers"}
        everyone = some.get(len(full), f"All {len(full)} solvers")
        return f"{everyone} solved it" + (" from every seed." if seeds > 1 else ".")
    partial = [entry for entry in entries if entry not in full and entry not in none]
    parts = [f"{writing.listed([entry.solver for entry in full])} solved it"] if full else []
    parts += [f"{entry.solver} solved it in {entry.solved} of {len(entry.runs)} runs" for entry in partial]
    if none:
        names = writing.listed([entry.solver for entry in none])
        parts.append(f"{names} never did" if parts else f"{names} did not solve it")
    return "; ".join(parts) + "."


def thrift(study: Study) -> str:
    """Return the solver with the least work and the one with the least time, among those that solved every run."""
    full = [entry for entry in study.entries if entry.solved == len(entry.runs)]
    work = {e.solver: e.median([run.equivalents for run in e.runs]) for e in full}
    time = {e.solver: e.median([solve_time(run) for run in e.runs]) for e in full}
    work, time = ({k: v for k, v in numbers.items() if math.isfinite(v)} for numbers in (work, time))
    if len(full) < 2 or not work or not time:
        return ""
    thrifty, quick = min(work, key=lambda k: work[k]), min(time, key=lambda k: time[k])
    least = f"Least work: {thrifty}, worth {words.count(round(work[thrifty], 1))} rollouts"
    return f"{least}; fastest: {quick}, {words.seconds(time[quick])}."


def columns(study: Study) -> list[Measure]:
    """Return the numeric columns; those that no run uses are left out."""
    fixed: list[Measure] = [
        ("objective", lambda run: run.objective, lambda v: show(v, 4)),
        ("largest error / tolerance", lambda run: run.worst_ratio, lambda v: show(v, 3)),
        ("rollouts", lambda run: run.counts.get("rollouts", math.nan), words.count),
        ("gradients", lambda run: run.counts.get("gradients", math.nan), words.count),
    ]
    for kind in ("jacobians", "hessians"):
        if any(run.counts.get(kind, 0) > 0 for run in study.runs):
            fixed.append((kind, lambda run, kind=kind: run.counts.get(kind, math.nan), words.count))  # type: ignore[misc]
    return [
        *fixed,
        ("work [rollouts]", lambda run: run.equivalents, lambda v: words.count(round(v, 1))),
        ("time of the solve", solve_time, words.seconds),
        ("time to build", build_time, words.seconds),
    ]


def solve_time(run: Run) -> float:
    """Return the time [s] of the solve."""
    return run.seconds.get("solve", math.nan)


def build_time(run: Run) -> float:
    """Return the time [s] before the solve: build and compile."""
    return run.seconds.get("build", math.nan) + run.seconds.get("compile", 0.0)


LEAST_IS_BEST = ("work [rollouts]", "time of the solve")


def solver_table(study: Study) -> Html:
    """Return a row for each solver, medians over its seeds."""
    marks = palette.solver_marks(entry.solver for entry in study.entries)
    shown = columns(study)
    medians = [[entry.median([read(run) for run in entry.runs]) for _, read, _ in shown] for entry in study.entries]
    leasts = [least(study, [row[i] for row in medians]) for i in range(len(shown))]
    rows = []
    for entry, numbers in zip(study.entries, medians, strict=True):
        cells: list[Html | str] = []
        for (title, _, write), number, best in zip(shown, numbers, leasts, strict=True):
            text = write(number)
            cells.append(tag("b", text, class_="best") if title in LEAST_IS_BEST and number == best else text)
        name = tag("span", dot(marks[entry.solver][0]), entry.solver, class_="nowrap")
        rows.append([name, seeds(entry), f"{entry.solved} of {len(entry.runs)}", statuses(entry), *cells])
    header = ["solver", "runs by seed", "solved", "ended as", *(title for title, _, _ in shown)]
    return table(header, rows, "ttnt" + "n" * len(shown), "Solvers")


def least(study: Study, numbers: Sequence[float]) -> float:
    """Return the smallest number among solvers that solved every run, if there are two to compare."""
    full = [n for entry, n in zip(study.entries, numbers, strict=True) if entry.solved == len(entry.runs)]
    known = [n for n in full if math.isfinite(n)]
    return min(known) if len(known) > 1 else math.nan


def seeds(entry: Entry) -> Html:
    """Return a chip for each run, linked to its page if there is one; of many runs how many ended in which way."""
    if len(entry.runs) > MOST_CHIPS:
        counted = Counter(map(words.level, entry.runs))
        chips = [pill(level, str(counted[level])) for level in ICONS if counted[level]]
        return tag("span", *chips, tag("a", "all runs", href="#runs"), class_="seeds")
    return tag("span", *map(seed_chip, entry.runs), class_="seeds", style=f"min-width:{42 * min(len(entry.runs), 5)}px")


def seed_chip(run: Run) -> Html:
    """Return a seed with the sign of how its run ended."""
    level = words.level(run)
    content = join([tag("i", ICONS[level], aria_hidden="true"), str(run.seed)])
    label = f"{run.solver}, seed {run.seed}: {words.headline(run).lower()}"
    link = page_link(run)
    if not link:
        return tag("span", content, class_=f"pill {level}", title=label)
    return tag("a", content, class_=f"pill {level}", href=link, title=label)


def page_link(run: Run) -> str:
    """Return the address of a run's page, seen from that of the batch; empty if there is none."""
    if not (run.folder / RUN_PAGE).is_file():
        return ""
    place = f"{run.place}/{RUN_PAGE}" if run.place not in ("", ".") else RUN_PAGE
    return quote(f"./{place}", errors="surrogateescape")


def page_links(runs: Sequence[Run]) -> dict[str, str]:
    """Return the addresses of the pages of runs, by their places."""
    return {run.place: page_link(run) for run in runs}


def statuses(entry: Entry) -> Html:
    """Say how the runs ended, with counts where they differ."""
    counted = Counter(words.came_to(run) for run in entry.runs)
    if len(counted) == 1:
        return join(list(counted))
    return join([writing.listed([f"{text} ({number})" for text, number in counted.most_common()])])


def table_note(study: Study) -> str:
    """Explain the table of solvers."""
    text = "Work counts a rollout as 1 and each derivative by its measured price. The time to build includes compiling."
    if any(len(entry.runs) > 1 for entry in study.entries):
        text = "Medians over seeds that gave a number. " + text
    return f"{text} {smoothing_note(study)}".rstrip()


def smoothing_note(study: Study) -> str:
    """Name the runs that used stages of smoothing, and the stages; empty where none did."""
    used: dict[str, list[str]] = {}
    for entry in study.entries:
        for widths in dict.fromkeys(stages_of(run) for run in entry.runs if smoothed(run.stages)):
            used.setdefault(widths, []).append(entry.solver)
    stages = [f"{widths} m/s: {writing.listed(list(dict.fromkeys(names)))}" for widths, names in used.items()]
    return (
        f"Solved in stages of smoothing, {'; '.join(stages)}. All numbers here are of the exact rollout."
        if stages
        else ""
    )


def stages_of(run: Run) -> str:
    """Return the smoothing of its stages."""
    return writing.listed([show(stage.smoothing) for stage in run.stages])


def convergence_note(study: Study, curves: int) -> str:
    """Return the caption: what the figure does not show; ``curves``: runs of a solver that it shows at most."""
    most = max(len(entry.runs) for entry in study.entries)
    some = f"Drawn are {curves} of up to {most} runs of a solver, evenly among the seeds. " if most > curves else ""
    marked = any(len(entry.runs) > 1 for entry in study.entries)
    text = "Strong: the median over seeds; a run that has ended keeps its last value. " if marked else ""
    text = f"{some}{text}Errors below a thousandth of the tolerance are drawn there."
    if any(smoothed(run.stages) for run in study.runs):
        text += " Of a stage with smoothing only start and end are drawn, where they stand exactly."
    return text


def checks_by_solver(study: Study) -> dict[tuple[str, str], list[CheckRecord]]:
    """Return the checks of all seeds, by their name and the solver."""
    found: dict[tuple[str, str], list[CheckRecord]] = {}
    for run in study.runs:
        for check in run.checks:
            found.setdefault((check.name, run.solver), []).append(check)
    return found


def check_cell(found: Sequence[CheckRecord]) -> Html:
    """Return the median error of one check for one solver, and how many seeds met it."""
    if not found:
        return Html(writing.DASH)
    met = sum(check.met for check in found)
    level = "good" if met == len(found) else "fair" if met else "bad"
    text = {"good": "met", "bad": "missed"}.get(level, f"{met} of {len(found)}")
    errors = [check.error for check in found if math.isfinite(check.error)]
    median = middle(errors) if errors else math.nan
    return tag("span", f"{show(median, 2)} ", pill(level, text), class_="nowrap")


def broken_card(broken: Sequence[Run]) -> Html:
    """Folders that look like run folders but hold no result."""
    rows = [[tag("code", run.place), "; ".join(run.faults) or "no result"] for run in broken[:MOST_BROKEN]]
    if not rows:
        return Html("")
    more = f" The first {MOST_BROKEN} of {len(broken)}." if len(broken) > MOST_BROKEN else ""
    return card(
        "Folders without a readable result",
        table(["folder", "why"], rows, "tt", "Broken folders"),
        note=f"Started and not finished, half written, or made by something else.{more}",
    )


PER_PAGE = 25
MOST_KEYS = 8
"""Settings that have a column of their own, at most; with more of them all stand in one."""
MOST_COMPARED, MOST_NUMBERS = 600, 60
"""Runs whose numbers can be compared two by two, and numbers of each, at most."""
DIGITS = 6
HOW_COMPARED = "Two that are ticked are compared."
HOW_SHOWN = (
    "A click on a heading sorts. The filter takes words that a row has, and comparisons such as objective<0.1 or "
    "seed=12; where a heading has several words, they are joined by _."
)


@dataclass(frozen=True)
class NumberColumn:
    """Numbers; nan is shown as a dash. What is ``hidden`` appears only where two rows are compared."""

    title: str
    values: Sequence[float]
    hidden: bool = False

    def to_json(self) -> dict[str, object]:
        """Return the column as ``rows.js`` reads it."""
        hidden = {"hidden": True} if self.hidden else {}
        return {"title": self.title, "kind": "number", "of": [short(value) for value in self.values], **hidden}


@dataclass(frozen=True)
class WordColumn:
    """Words, most of which recur; ``levels``: of the words that are drawn as a pill."""

    title: str
    values: Sequence[str]
    levels: Mapping[str, str] | None = None

    def to_json(self) -> dict[str, object]:
        """Return each word once, and the index of the word of each row."""
        known = {word: place for place, word in enumerate(dict.fromkeys(self.values))}
        data: dict[str, object] = {"title": self.title, "kind": "word", "words": list(known)}
        data["of"] = [known[word] for word in self.values]
        return data if self.levels is None else data | {"levels": [self.levels[word] for word in known]}


@dataclass(frozen=True)
class LinkColumn:
    """Links to pages, all called the same; empty where there is none."""

    title: str
    text: str
    links: Sequence[str]

    def to_json(self) -> dict[str, object]:
        """Return the column as ``rows.js`` reads it."""
        return {"title": self.title, "kind": "link", "text": self.text, "of": list(self.links)}


Column = NumberColumn | WordColumn | LinkColumn


def short(value: float) -> float | int | str | None:
    """Return a number as JSON has it, with ``DIGITS`` digits; infinite ones as words, null for nan."""
    if not math.isfinite(value):
        return None if math.isnan(value) else ("inf" if value > 0 else "-inf")
    if value == int(value) and abs(value) < 2**53:
        return int(value)
    return float(f"{value:.{DIGITS - 1}e}")


def row_table(columns: Sequence[Column], noun: str, names: Sequence[str] = ()) -> Html:
    """Return the place of a table, and its rows.

    Args:
        columns: of the table.
        noun: what a row is.
        names: of the rows, any two of which can be compared; empty for none.
    """
    data: dict[str, object] = {"columns": [each.to_json() for each in columns], "noun": noun, "page": PER_PAGE}
    if names:
        data["names"] = list(names)
    return tag(
        "div",
        tag("p", "The table needs JavaScript; result.json of each run folder has its numbers.", class_="note"),
        packed_json(data),
        class_="rows",
    )


def run_card(found: Sequence[Study], links: Mapping[str, str]) -> Html:
    """Return the table of all runs; ``links``: pages by the places of runs."""
    pairs = [(study, run) for study in found for run in study.runs]
    runs = [run for _, run in pairs]
    status = [words.headline(run) for run in runs]
    levels = {text: words.level(run) for text, run in zip(status, runs, strict=True)}
    columns: list[Column] = []
    if len({study.problem for study in found}) > 1:
        columns.append(WordColumn("problem", [study.problem for study, _ in pairs]))
    columns += setting_columns([run.settings for run in runs])
    columns += [
        WordColumn("solver", [run.solver for run in runs]),
        NumberColumn("seed", [run.seed for run in runs]),
        WordColumn("verdict", status, levels),
        NumberColumn("objective", [run.objective for run in runs]),
        NumberColumn("error / tolerance", [run.worst_ratio for run in runs]),
        *output_columns(runs),
        NumberColumn("rollouts", [run.counts.get("rollouts", math.nan) for run in runs]),
        NumberColumn("work [rollouts]", [run.equivalents for run in runs]),
        NumberColumn("time of the solve [s]", [solve_time(run) for run in runs]),
        LinkColumn("page", "open", [links.get(run.place, "") for run in runs]),
    ]
    if len(runs) <= MOST_COMPARED:
        columns += compared_columns(runs)
    names = [run.place or f"{run.solver}, seed {run.seed}" for run in runs]
    note = f"{HOW_SHOWN} {HOW_COMPARED}"
    return card("All runs", row_table(columns, "run", names), anchor="runs", note=note)


def compared_columns(runs: Sequence[Run]) -> list[Column]:
    """Return what is seen where two runs are compared: what was found, errors, parts of the objective."""
    numbers = [
        found_numbers(run)
        | {f"error of {c.name}": c.error for c in run.checks}
        | {f"cost {k}": v for k, v in run.costs.items()}
        for run in runs
    ]
    titles = dict.fromkeys(title for each in numbers for title in each)
    return [
        NumberColumn(title, [each.get(title, math.nan) for each in numbers], True)
        for title in list(titles)[:MOST_NUMBERS]
    ]


def output_columns(runs: Sequence[Run]) -> list[Column]:
    """Return the reported quantities that any run has, if they are few."""
    names = dict.fromkeys(name for run in runs for name in run.outputs)
    if len(names) > MOST_KEYS:
        return []
    return [NumberColumn(name, [run.outputs.get(name, math.nan) for run in runs]) for name in names]


def setting_columns(settings: Sequence[Mapping[str, object]]) -> list[Column]:
    """Return a column for each setting, or one for all where they are many; none where no run has any."""
    keys = sorted({key for each in settings for key in each})
    if len(keys) > MOST_KEYS:
        return [WordColumn("settings", [", ".join(f"{k}={written(v)}" for k, v in each.items()) for each in settings])]
    found: list[Column] = []
    for key in keys:
        values = [each.get(key) for each in settings]
        numeric = all(value is None or type(value) in (int, float) for value in values)
        if numeric:
            found.append(NumberColumn(key, [math.nan if value is None else float(value) for value in values]))  # type: ignore[arg-type]
        else:
            found.append(WordColumn(key, ["" if value is None else written(value) for value in values]))
    return found


def written(value: object) -> str:
    """Return a setting as it is typed."""
    return value if isinstance(value, str) else json.dumps(files.strict(value))


def study_card(found: Sequence[Study], links: Mapping[str, str], most: int) -> Html:
    """Return the table of problems and settings that are too many for a section each."""
    entries = [(study, entry) for study in found for entry in study.entries]
    studies = [study for study, _ in entries]
    best = [Study(study.problem, study.place, (entry,)).best for study, entry in entries]
    columns: list[Column] = [
        WordColumn("problem", [study.problem for study in studies]),
        *setting_columns([study.runs[0].settings for study in studies]),
        WordColumn("solver", [entry.solver for _, entry in entries]),
        NumberColumn("runs", [len(entry.runs) for _, entry in entries]),
        NumberColumn("solved", [entry.solved for _, entry in entries]),
        NumberColumn("objective", [entry.median([run.objective for run in entry.runs]) for _, entry in entries]),
        NumberColumn("lowest objective", [run.objective for run in best]),
        NumberColumn("work [rollouts]", [entry.median([r.equivalents for r in entry.runs]) for _, entry in entries]),
        NumberColumn(
            "time of the solve [s]", [entry.median(list(map(solve_time, entry.runs))) for _, entry in entries]
        ),
        LinkColumn("best run", "open", [links.get(run.place, "") for run in best]),
    ]
    note = (
        f"A row for each problem, its settings, and solver; medians over seeds. With more than {most} problems and "
        "settings the page has no figures: “symphys report” of one of their folders makes its own page."
    )
    return card("Problems and settings", row_table(columns, "row"), anchor="studies", note=note)
