"""Tables of any length: rows as compact data, of which ``rows.js`` shows a page at a time, sorted and filtered."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from symphys import files
from symphys.report.pages import words
from symphys.report.pages.markup import Html, card, embedded, tag
from symphys.results.discovery import Study
from symphys.results.run import Run

PER_PAGE = 25
MOST_KEYS = 8
"""Settings that have a column of their own, at most; with more of them all stand in one."""
DIGITS = 6
HOW_SHOWN = (
    "A click on a heading sorts. The filter takes words that a row has, and comparisons such as objective<0.1 or "
    "seed=12; where a heading has several words, they are joined by _."
)


@dataclass(frozen=True)
class NumberColumn:
    """Numbers; nan is shown as a dash."""

    title: str
    values: Sequence[float]

    def to_json(self) -> dict[str, object]:
        """What ``rows.js`` reads."""
        return {"title": self.title, "kind": "number", "of": [short(value) for value in self.values]}


@dataclass(frozen=True)
class WordColumn:
    """Words, most of which recur; ``levels``: of the words that are drawn as a pill."""

    title: str
    values: Sequence[str]
    levels: Mapping[str, str] | None = None

    def to_json(self) -> dict[str, object]:
        """Each word once, and which a row has."""
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
        """What ``rows.js`` reads."""
        return {"title": self.title, "kind": "link", "text": self.text, "of": list(self.links)}


Column = NumberColumn | WordColumn | LinkColumn


def short(value: float) -> float | int | str | None:
    """A number as JSON has it, with ``DIGITS`` digits; infinite ones as words, null for nan."""
    if not math.isfinite(value):
        return None if math.isnan(value) else ("inf" if value > 0 else "-inf")
    if value == int(value) and abs(value) < 2**53:
        return int(value)
    return float(f"{value:.{DIGITS - 1}e}")


def row_table(columns: Sequence[Column], noun: str) -> Html:
    """The place of a table, and its rows; ``noun``: what a row is."""
    data = {"columns": [column.to_json() for column in columns], "noun": noun, "page": PER_PAGE}
    return tag(
        "div",
        tag("p", "The table needs JavaScript; result.json of each run folder has its numbers.", class_="note"),
        embedded(json.dumps(data, separators=(",", ":"), allow_nan=False, ensure_ascii=False)),
        class_="rows",
    )


def run_card(found: Sequence[Study], links: Mapping[str, str]) -> Html:
    """The table of all runs; ``links``: pages by the places of runs."""
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
        NumberColumn("work in rollouts", [run.equivalents for run in runs]),
        NumberColumn("solve [s]", [run.seconds.get("solve", math.nan) for run in runs]),
        LinkColumn("page", "open", [links.get(run.place, "") for run in runs]),
    ]
    return card("All runs", row_table(columns, "run"), anchor="runs", note=HOW_SHOWN)


def output_columns(runs: Sequence[Run]) -> list[Column]:
    """The reported quantities that any run has, if they are few."""
    names = dict.fromkeys(name for run in runs for name in run.outputs)
    if len(names) > MOST_KEYS:
        return []
    return [NumberColumn(name, [run.outputs.get(name, math.nan) for run in runs]) for name in names]


def setting_columns(settings: Sequence[Mapping[str, object]]) -> list[Column]:
    """A column for each setting, or one for all where they are many; none where no run has any."""
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
    """A setting as it is typed."""
    return value if isinstance(value, str) else json.dumps(files.strict(value))


def study_card(found: Sequence[Study], links: Mapping[str, str], most: int) -> Html:
    """The table of problems and settings that are too many for a section each."""
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
        NumberColumn("work in rollouts", [entry.median([r.equivalents for r in entry.runs]) for _, entry in entries]),
        NumberColumn("solve [s]", [entry.median([seconds(run) for run in entry.runs]) for _, entry in entries]),
        LinkColumn("best run", "open", [links.get(run.place, "") for run in best]),
    ]
    note = (
        f"A row for each problem, its settings, and solver; medians over seeds. With more than {most} problems and "
        "settings the page has no figures: “symphys report” of one of their folders makes its own page."
    )
    return card("Problems and settings", row_table(columns, "row"), anchor="studies", note=note)


def seconds(run: Run) -> float:
    """[s] of the solve."""
    return run.seconds.get("solve", math.nan)
