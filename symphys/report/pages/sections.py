"""The parts of a run's page."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np

from symphys import json_values as values
from symphys.findings import writing
from symphys.findings.advice import advice, answers, findings, slopes
from symphys.findings.examination import Examination
from symphys.findings.levels import GOOD, MARKS, Judged
from symphys.findings.physics import sliding
from symphys.findings.verdict import ending
from symphys.findings.writing import beside, capital, show, titled, with_unit
from symphys.report.charts import palette
from symphys.report.charts.chart import Chart
from symphys.report.charts.run import component_names, knotted
from symphys.report.making.neighbours import neighbours
from symphys.report.making.stamps import RUN_PAGE, batch_page
from symphys.report.pages import words
from symphys.report.pages.answers import extent
from symphys.report.pages.markup import (
    Html,
    banner,
    card,
    dot,
    facts,
    fold,
    join,
    markdown,
    named_figure,
    pill,
    stats,
    table,
    tag,
)
from symphys.results.config import settings_words
from symphys.results.result import CheckRecord, Result, StageRecord, VariableRecord, smoothed
from symphys.results.run import Run
from symphys.results.trace import OUTPUT
from symphys.types import Array

FOOTER = tag(
    "footer",
    "Made by symphys from the files of the run folder; make it again with ",
    tag("code", "symphys report"),
    ". ",
    tag("code", "symphys report --figures"),
    " writes its figures as SVG, and the numbers in them as CSV.",
)
MOST_ROWS = 60
MOST_COMPONENTS = 8
"""Components of a variable that have a row each, at most; of more there is the range, and a fold with all."""
ROUNDING = 1e-9
"""Share of an objective below which a part of it is rounding."""
MOST_NUMBERS = 200
"""Components of a variable that a page lists, at most; result.json has all."""
LOG_TAIL = 20_000
HOW_JUDGED = (
    "Judged by an exact rollout of the result, without smoothing. The bar ends at the error, the line is the tolerance."
)
HOW_READ = (
    "Each stage starts from the best point of the previous one. “There” is the value at the stage's smoothing; “exact” "
    "is the value in the exact rollout, by which the result is chosen. The result is the last point, unless an earlier "
    "point or the guess is better."
)
NOT_EXAMINED = "This run was not examined; “symphys check --at” its folder examines how far to trust it."
ONLY_MOTION = (
    "Only the motion was examined. “symphys check --at” this folder also examines its gradient, finer time steps and "
    "the growth of changes."
)
ONLY_VALUES = (
    "The solver took no derivatives, and none was examined. “symphys check --at” this folder compares them with "
    "differences, and examines the growth of changes."
)
HOW_FAR = "How far to trust this"
HOW_GROWN = (
    "By how much a small change of the state at time t is magnified until the end: distances in m, velocities in m/s, "
    "turning at the bodies' radius of gyration; estimated from a few directions. Ticks: a contact begins."
)
HOW_BALANCED = (
    "Potential energy is 0 at the origin. Angular momentum is not checked: where surfaces touched is not recorded."
)
HOW_REFINED = "The same variables simulated with other settings: results, and relative changes of the gradients."
CHAPTERS = (
    ("found", "Found"),
    ("checks", "Checks"),
    ("motion", "Motion"),
    ("trust", "Verification"),
    ("stages", "Stages"),
    ("convergence", "Convergence"),
    ("joints", "Joints"),
    ("gait", "Gait"),
    ("states", "States"),
    ("contacts", "Contacts"),
    ("time", "Time"),
    ("provenance", "Provenance"),
)


def header(run: Run, cards: Sequence[Html], alone: bool = False) -> Html:
    """Title, description, verdict, and links to those cards that there are; unless ``alone`` to other pages too."""
    there = [(anchor, title) for anchor, title in CHAPTERS if any(f'id="{anchor}"' in card[:80] for card in cards)]
    links = [tag("a", title, href=f"#{anchor}") for anchor, title in there]
    unread = () if run.readable else run.faults
    why, guess = (values.name(run.provenance.get(key)) for key in ("chosen", "guess"))
    above = "" if alone else batch_page(run.folder)
    every = join([" · ", tag("a", "all runs", href=above)]) if above else ""
    near = [] if alone else neighbours(run.folder, RUN_PAGE)
    beside = [tag("a", title, href=at) for title, at in near]
    kicker = tag("p", f"Run report · {run.problem} · {run.solver} · seed {run.seed}", every, class_="kicker")
    return join(
        [
            kicker,
            tag("p", "Related runs: ", separated(beside), class_="kicker") if beside else "",
            tag("p", f"With {settings_words(run.settings)}.", class_="note") if run.settings else "",
            tag("p", f"No solver was named: {run.solver}, since {why}.", class_="note") if why else "",
            tag("p", f"Initial guess: the result of {guess}.", class_="note") if guess else "",
            tag("h1", run.title),
            tag("div", markdown(run.description), class_="lead") if run.description.strip() else "",
            banner(words.level(run), words.headline(run), words.verdict(run), words.next_step(run), *unread),
            tag("nav", *links, aria_label="Sections") if run.readable else "",
        ]
    )


def separated(parts: Sequence[Html]) -> Html:
    """Return parts with dots between them."""
    return Html(" · ".join(parts))


def key_numbers(run: Run) -> Html:
    """Return the strip of numbers below the verdict."""
    if not run.readable:
        return Html("")
    derivatives = [(kind, run.counts.get(kind, 0.0)) for kind in ("gradients", "jacobians", "hessians")]
    used = [(kind.capitalize(), words.count(number)) for kind, number in derivatives if number > 0]
    return stats(
        [
            ("Objective", show(run.objective)),
            ("Error / tolerance", show(run.worst_ratio)),
            *((capital(name), show(value)) for name, value in run.outputs.items()),
            ("Rollouts", words.count(run.counts.get("rollouts", math.nan))),
            *used,
            *labelled(run),
            ("Time of the solve", words.seconds(run.seconds.get("solve", math.nan))),
        ]
    )


def labelled(run: Run) -> list[tuple[str, str]]:
    """Return the numbers of a result whose definition has a label."""
    found = []
    for each in dataclasses.fields(Result):
        if "label" in each.metadata:
            value, decimals = getattr(run, each.name), each.metadata.get("decimals")
            found.append(
                (each.metadata["label"], show(value) if decimals is None else words.count(round(value, decimals)))
            )
    return found


def checks(run: Run) -> Html:
    """Targets, constraints and goals by name, each with a gauge whose middle is the tolerance."""
    rows = [
        [
            join([check.name, Html(" "), tag("small", check.kind)]),
            with_unit(beside(check.error, check.tolerance), check.unit),
            with_unit(show(check.tolerance), check.unit),
            beside(check.ratio, 1.0),
            gauge(check),
            pill("good", "met") if check.met else pill("bad", "missed"),
        ]
        for check in run.checks
    ]
    costs = facts([(name, show(value, 4)) for name, value in objective_parts(run)])
    return card(
        "Targets and constraints",
        table(["name", "error", "tolerance", "ratio", "", ""], rows, "tnnntt", "Checks") if rows else "",
        tag("h3", f"The objective, {show(run.objective, 4)}, in its parts") if costs else "",
        costs,
        tag("h3", "Reported quantities") if run.outputs else "",
        facts([(name, output_line(run, name)) for name in run.outputs]),
        anchor="checks",
        note=HOW_JUDGED,
    )


def objective_parts(run: Run) -> list[tuple[str, float]]:
    """Return the weighted costs by name, and what targets and penalties add to them, unless it is rounding."""
    parts = list(run.costs.items())
    rest = run.objective - sum(run.costs.values())
    if parts and abs(rest) > ROUNDING * max(map(abs, [run.objective, *run.costs.values()])):
        parts.append(("targets and constraints, weighted", rest))
    return parts


def output_line(run: Run, name: str) -> str:
    """Return a number of the result, and what it was at the guess."""
    return f"{show(run.outputs[name], 4)} (at the guess {show(run.guess.get(OUTPUT + name, math.nan), 4)})"


def gauge(check: CheckRecord) -> Html:
    """Error against tolerance: the middle of the bar is 1, its end 2 and more."""
    share = min(check.ratio / 2, 1.0) if math.isfinite(check.ratio) else 1.0
    bar = tag("span", style=f"width:{100 * max(share, 0):.1f}%")
    return tag("span", bar, class_=f"gauge {'good' if check.met else 'bad'}", aria_hidden="true")


def found(run: Run, charts: Mapping[str, Chart]) -> Html:
    """Variables with one knot as a table, those with many as curves."""
    single = [variable for variable in run.variables if variable.value.shape[1] == 1]
    rows = [row for variable in single for row in variable_rows(variable)]
    more = tag("p", f"and {len(rows) - MOST_ROWS} more, in result.json", class_="note") if len(rows) > MOST_ROWS else ""
    header, kinds = ["variable", "found", "guess", "lower bound", "upper bound", "between bounds"], "tnnnnt"
    if not any(np.isfinite(each).any() for variable in single for each in (variable.lower, variable.upper)):
        header, kinds, rows = header[:3], kinds[:3], [row[:3] for row in rows]
    curves = [
        f"{v.name}: {writing.several(v.value.shape[0], 'component')} at {v.value.shape[1]} instants"
        + (f" (sets {sets_of(v)})" if len(v.sets) > 1 else "")
        for v in knotted(run)
    ]
    return card(
        "What was found",
        table(header, rows[:MOST_ROWS], kinds, "Variables") if rows else "",
        more,
        *(all_components(variable) for variable in single if MOST_COMPONENTS < len(variable.value) <= MOST_NUMBERS),
        named_figure(charts, "variables", "; ".join(curves)),
        anchor="found",
    )


def variable_rows(variable: VariableRecord) -> list[list[str]]:
    """Return a row for each component; one for all of a variable with very many, such as the weights of a net."""
    if len(variable.value) > MOST_COMPONENTS:
        return [many_row(variable)]
    rows: list[list[str]] = []
    for index, name in enumerate(component_names(variable)):
        value, guess = variable.value[index, 0], variable.guess[index, 0]
        low, high = variable.lower[index, 0], variable.upper[index, 0]
        sets = tag("small", sets_of(variable)) if index == 0 else Html("")
        label = join([tag("b", variable.name) if index == 0 else "", f" {name} " if name else " ", sets])
        found, begun, *bounds = (with_unit(show(number, 4), variable.unit) for number in (value, guess, low, high))
        bounds = [bound if math.isfinite(at) else "none" for bound, at in zip(bounds, (low, high), strict=True)]
        rows.append([label, tag("b", found), begun, *bounds, between(value, guess, low, high)])
    return rows


def sets_of(variable: VariableRecord) -> str:
    """Write what a variable sets."""
    *others, last = variable.sets or ("",)
    return f"{', '.join(others)} and {last}, to the same values" if others else last


def many_row(variable: VariableRecord) -> list[str]:
    """Return the range of very many components, and how far they are from the guess."""
    guess, value = variable.guess[:, 0], variable.value[:, 0]
    label = join([tag("b", variable.name), f" {len(value)} numbers ", tag("small", sets_of(variable))])
    guessed, found = (extent(of, variable.unit) for of in (guess, value))
    ends = float(variable.lower[:, 0].min()), float(variable.upper[:, 0].max())
    bounds = [with_unit(show(end), variable.unit) if math.isfinite(end) else "none" for end in ends]
    change = root_mean_square(value / 2 - guess / 2) * 2
    return [label, tag("b", found), guessed, *bounds, f"changed by {with_unit(show(change), variable.unit)} (rms)"]


def all_components(variable: VariableRecord) -> Html:
    """Return all components of a variable with many, behind a line that opens them."""
    numbers = [
        f"{name or index}: {show(value, 4)} (guess {show(guess, 4)})"
        for index, (name, value, guess) in enumerate(
            zip(component_names(variable), variable.value[:, 0], variable.guess[:, 0], strict=True)
        )
    ]
    title = f"All {len(numbers)} numbers of {titled(variable.name, variable.unit)}"
    return folded(title, tag("ul", *(tag("li", number) for number in numbers), class_="numbers"))


def root_mean_square(numbers: Array) -> float:
    """Return the root mean square of numbers whose squares may overflow; nan if a number is nan."""
    size = float(np.max(np.abs(numbers)))
    return size * math.sqrt(float(((numbers / size) ** 2).mean())) if 0 < size < math.inf else size


def between(value: float, guess: float, low: float, high: float) -> Html:
    """Draw where value and guess lie between finite bounds, and say where a bound is active."""
    if not (math.isfinite(low) and math.isfinite(high) and high > low and math.isfinite(value)):
        return Html("")
    value, guess, low, high = (number / 2 for number in (value, guess, low, high))  # differences may overflow else
    spots = [
        tag("i", class_=kind, style=f"left:{100 * np.clip((at - low) / (high - low), 0, 1):.1f}%")
        for at, kind in ((guess, "guess"), (value, "value"))
        if math.isfinite(at)
    ]
    bar = tag("span", *spots, class_="range", aria_hidden="true")
    edge = min(value - low, high - value) <= 1e-6 * (high - low)
    return join([bar, tag("small", "at a bound")]) if edge else bar


def trusted(run: Run, charts: Mapping[str, Chart]) -> Html:
    """Advice, findings, figures, and the refinements as numbers."""
    judged = run.judged
    lines = findings(run.examination, judged)
    if not lines:
        unknown = tag("p", NOT_EXAMINED) if run.readable else ""
        return card(HOW_FAR, unknown, anchor="trust")
    rows, fine = (
        [
            [pill(line.level, MARKS[line.level]), line.what, line.number, line.meaning]
            for line in lines
            if (line.level == GOOD) == good
        ]
        for good in (False, True)
    )
    header = ["", "check", "value", "interpretation"]
    known = run.examination
    unexamined = "" if known.gradient else ONLY_VALUES if known.refined else ONLY_MOTION
    return card(
        HOW_FAR,
        tag("p", advice(run.examination, judged)),
        tag("p", unexamined) if unexamined else "",
        table(header, rows, "tttt", "Verification") if rows else "",
        folded(f"Good: {writing.several(len(fine), 'check')}", table(header, fine, "tttt", "Good")) if fine else "",
        step_note(run.examination),
        named_figure(charts, "growth", HOW_GROWN),
        named_figure(charts, "energy", " ".join(filter(None, [HOW_BALANCED, sliding(run.examination)]))),
        refined(run.examination, judged),
        anchor="trust",
    )


def folded(title: str, content: Html) -> Html:
    """Return content behind a line that opens it."""
    return tag("details", tag("summary", title), content)


def step_note(trust: Examination) -> Html:
    """Say with what step the gradient was compared; empty where it was not."""
    if not math.isfinite(trust.step):
        return Html("")
    return tag(
        "p", f"Central differences with a step of {show(trust.step, 2)} of a variable's scale.", class_="caption"
    )


def refined(trust: Examination, judged: Judged) -> Html:
    """Return the refinements as tables; nothing without any."""
    if not trust.refined:
        return Html("")
    header, rows = answers(trust, judged)
    gradients, changes = slopes(trust)
    content = (
        table(header, rows, "tnnt", "Answers"),
        table(gradients, changes, "tnnt" + "n" * (len(gradients) - 4), "Gradients") if changes else "",
        tag("p", HOW_REFINED, class_="caption"),
    )
    return folded("Refined and smoothed, as numbers", join(content))


def stage_card(run: Run) -> Html:
    """Return the stages in a table; nothing for a run without smoothing."""
    if not smoothed(run.stages):
        return Html("")
    every = ("rollouts", "gradients", "jacobians", "hessians")
    kinds = [kind for kind in every if any(stage.counts.get(kind, 0) > 0 for stage in run.stages)]
    checked = bool(run.checks)
    header = ["smoothing", "ended as", "objective there", "exact objective"]
    header += ["error / tolerance there", "exact error / tolerance", ""] if checked else []
    rows = [stage_row(stage, kinds, checked) for stage in run.stages]
    layout = "ttnn" + "nnt" * checked + "n" * (len(kinds) + 1)
    content = table([*header, *kinds, "time"], rows, layout, "Stages of smoothing")
    return card("Stages of smoothing", content, remark(run), anchor="stages", note=HOW_READ)


def stage_row(stage: StageRecord, kinds: Sequence[str], checked: bool) -> list[Html | str]:
    """Return the cells of one stage."""
    cells: list[Html | str] = [f"{show(stage.smoothing)} m/s" if stage.smoothing else "0, exact"]
    cells += [ending(stage.status).brief_words, show(stage.objective), tag("b", show(stage.exact_objective))]
    if checked:
        cells += [show(stage.worst), tag("b", show(stage.exact_worst))]
        cells.append(pill("good", "met") if stage.solved else pill("bad", "missed"))
    cells += [words.count(stage.counts.get(kind, math.nan)) for kind in kinds]
    return [*cells, words.seconds(stage.seconds)]


def remark(run: Run) -> Html:
    """Say where an earlier stage came closer than the last; its point is the result then, unless means decided."""
    last, best = run.stages[-1], min(run.stages, key=rank)
    if run.status == "interrupted" or rank(best) >= rank(last):
        return Html("")
    text = f"The point of the stage at {show(best.smoothing)} m/s "
    if run.objective == best.exact_objective:
        text += "is the result: it is better in the exact rollout than that of the last stage"
    else:
        text += "is better in the exact rollout than the result"
    return tag("p", f"{text}: the last stages improved the smoothed problem only.", class_="caption")


def rank(stage: StageRecord) -> tuple[bool, float]:
    """Return a key by which the stage that comes closest in the exact rollout is first."""
    return not stage.solved, stage.exact_objective if math.isfinite(stage.exact_objective) else math.inf


def convergence(run: Run, charts: Mapping[str, Chart]) -> Html:
    """Show the convergence, and say what the figure leaves out."""
    caption = f"Pale: the lowest so far{' in its stage' * smoothed(run.stages)}. Work counts one rollout as 1."
    return card("Convergence", named_figure(charts, "convergence", caption), anchor="convergence")


def time_split(run: Run) -> Html:
    """Building, compiling, solving and judging as one bar."""
    colours = {"build": palette.SKY, "compile": palette.ORANGE, "solve": palette.BODIES[0], "judge": palette.GREY}
    parts = [(name, run.seconds.get(name, math.nan), colour) for name, colour in colours.items()]
    known = [(name, took, colour) for name, took, colour in parts if math.isfinite(took) and took >= 0]
    total = sum(took for _, took, _ in known)
    if total <= 0:
        return Html("")
    bars = [
        tag("span", style=f"flex:{took / total:.4f};background:{palette.on_page(c)}")
        for _, took, c in known
        if took > 0
    ]
    keys = [tag("li", dot(c), f"{name} {words.seconds(took)}") for name, took, c in known]
    prices = [f"{name} costs {show(price, 2)}" for name, price in run.price.items() if math.isfinite(price)]
    priced = f"Work is counted in rollouts: a {writing.listed(prices)}." if prices else ""
    return card(
        "Where the time went",
        tag("div", *bars, class_="split", aria_hidden="true"),
        tag("ul", *keys, class_="keys"),
        tag("p", priced, class_="caption") if priced else "",
        anchor="time",
    )


def provenance(run: Run) -> Html:
    """Show when the run was made, with which versions and by which command."""
    versions = ", ".join(f"{name} {version}" for name, version in run.versions.items() if name != "platform")
    memory = values.number(run.provenance.get("peak_memory"))
    return facts(
        [
            ("Command", tag("code", run.command) if run.command else ""),
            ("When", run.when),
            ("Machine", machine(run)),
            ("Commit", commit(run)),
            ("Peak memory", f"{memory / 2**30:.2f} GiB" if np.isfinite(memory) else ""),
            ("Versions", versions),
            ("Evaluated by", str(run.backend)),
            ("Compiler flags", values.name(run.provenance.get("flags"))),
            ("Ended as", ending(run.status).words),
            ("Iterations", words.count(run.iterations) if math.isfinite(run.iterations) else ""),
        ]
    )


def machine(run: Run) -> str:
    """Host, processor and platform, as far as they are known."""
    named = [values.name(run.provenance.get(key)) for key in ("host", "processor", "python_platform")]
    return ", ".join(filter(None, named)) or run.versions.get("platform", "")


def commit(run: Run) -> str:
    """Return the commit of the working folder, and whether there were changes."""
    known = values.name(run.provenance.get("commit"))
    return f"{known}, with changes" if known and run.provenance.get("dirty") is True else known


def source(title: str, text: str) -> Html:
    """Return a file behind a line that opens it; of a long log the end."""
    if len(text) > LOG_TAIL and title.startswith("Log"):
        text = "…\n" + text[-LOG_TAIL:]
    return fold(title, text)
