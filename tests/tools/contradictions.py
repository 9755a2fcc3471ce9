"""Pairs of sentences on a run's page that cannot both be true, and numbers that mean nothing."""

from __future__ import annotations

import html
import re
from pathlib import Path

from symphys.report.pages.run import write_run_report
from symphys.results.file_names import TRAJECTORY
from symphys.results.run import read_run
from symphys.results.trajectories import read_trajectory

ROUNDING = re.compile("× 10⁻¹[²³⁴⁵⁶⁷⁸⁹] (m|rad|m/s|rad/s)\\b")  # noqa: RUF001
PRECISION = 2e-3
"""Of numbers on a page, together."""
OF_CONTACTS = ("Deepest penetration", "Passing through", "Several impacts", "Energy that contacts add")


def contradictions(folder: Path) -> list[str]:
    """Make the page of a run folder, and return what contradicts itself on it."""
    run, text = read_run(folder, folder), words(write_run_report(folder))
    pairs = []
    if run.solved:
        pairs += [
            f"solved, and {word}" for word in ("do not rely on it", "does not hold", "misleading") if word in text
        ]
        if "raise `" in text and "may lower the costs" not in text:
            pairs.append("solved, and something is to be raised")
    if "still meets every check" in text and re.search("A tolerance is missed by (far|a little)", text):
        pairs.append("every check is met with finer steps, and missed")
    if "There were none; but" in text:
        pairs.append("there were none, but")
    if ROUNDING.search(text):
        pairs.append(f"rounding as data: {ROUNDING.search(text)}")
    parts = parts_of_objective(text) if run.costs else []
    if parts and abs(sum(parts) - run.objective) > PRECISION * max(map(abs, parts)):
        pairs.append(f"parts of the objective add up to {sum(parts)}, it is {run.objective}")
    if (folder / TRAJECTORY).is_file() and not read_trajectory(folder / TRAJECTORY, ()).contact_names:
        pairs += [f"nothing can touch, and {what}" for what in OF_CONTACTS if what in text]
    if "∞" in text:
        pairs.append("an infinite number")
    return pairs


def words(page: Path) -> str:
    """Return the text of a page that people read, without the files that it quotes."""
    text = page.read_text("utf-8").partition('id="provenance"')[0]
    text = re.sub(r"<(script|style)[^>]*>.*?</\1>", " ", text, flags=re.DOTALL)
    return re.sub(r"\s+", " ", html.unescape(re.sub(r"<[^>]+>", " ", text)))


def parts_of_objective(text: str) -> list[float]:
    """Return the numbers of which the page says the objective is made."""
    part = re.search(r"The objective, .*? in its parts(.*?)(Reported quantities|The motion|How far)", text)
    assert part is not None
    numbers = re.findall(r" (−?[\d\u202f.]+(?: × 10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?) ", part.group(1) + " ")  # noqa: RUF001
    return [*map(number, numbers)]


def number(text: str) -> float:
    """Read a number as pages write it."""
    plain = text.replace("−", "-").replace("\u202f", "").replace(" × 10", "e")  # noqa: RUF001
    return float(plain.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")))
