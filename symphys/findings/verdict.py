"""The statuses with which runs end, and the verdict: solved, done, not solved, not to be trusted, or failed."""

from __future__ import annotations

from collections.abc import Mapping

from symphys.findings.advice import findings
from symphys.findings.examination import Examination
from symphys.findings.levels import FAIR, GOOD, Judged
from symphys.findings.numerics import GROWTH, refined_finding
from symphys.records import dataclass

SOLVED = "solved"
"""Everything is met, or the point is stationary where there is nothing to meet; nothing speaks against it."""
DOUBTED = "doubted"
"""The same, but of a motion that is not to be relied on."""
BEST_FOUND = "best_found"
"""There is nothing to meet, and the solver ended before it converged."""
NOT_SOLVED = "not_solved"
"""Something is missed, or there is no result."""
INTERRUPTED = "interrupted"
ACCEPTED = (SOLVED, BEST_FOUND)
"""What a run was asked for, it did."""


@dataclass(frozen=True)
class Ending:
    """A status of a solve, its meaning and its words.

    Attributes:
        words: what happened.
        brief: the same in a verdict such as "best found, budget ended".
        in_table: the same in two words at most.
        headline: of a run that ended so and is not solved.
        sentence: for a verdict in full; empty where that is worded otherwise.
        stationary: whether the point is one from which the solver would not move.
        usable: whether the point may be an answer where there is nothing to meet.
        faulty: whether something went wrong, rather than that the run is not solved.
    """

    words: str
    brief: str
    in_table: str = ""
    headline: str = "Not solved"
    sentence: str = ""
    stationary: bool = False
    usable: bool = True
    faulty: bool = False

    @property
    def brief_words(self) -> str:
        """Return what happened in few words, for tables."""
        return self.in_table or self.words


ENDINGS = {
    "met": Ending("everything met", "met", in_table="met", stationary=True),
    "converged": Ending("converged", "converged", sentence="The solver converged.", stationary=True),
    "budget": Ending("budget spent", "budget ended", sentence="The solver's budget was spent."),
    "stalled": Ending("no more progress", "no more progress", sentence="The solver could make no more progress."),
    "not_finite": Ending(
        "a number was not finite",
        "not finite",
        in_table="not finite",
        sentence="A number in the simulation was not finite.",
        usable=False,
        faulty=True,
    ),
    "not_applicable": Ending("not applicable", "not applicable", headline="Not applicable", usable=False),
    "failed": Ending("failed", "failed", headline="Failed", sentence="The solver failed.", usable=False, faulty=True),
    "interrupted": Ending(
        "interrupted",
        "interrupted",
        headline="Interrupted",
        sentence="The run was interrupted; the same command goes on from where it stopped.",
    ),
    "unreadable": Ending("no readable result", "unreadable", headline="No result", faulty=True),
}
"""By the status in result.json; the last one is of folders without a result."""


def ending(status: str) -> Ending:
    """Return the ending of a status; an unknown one is worded as it stands."""
    text = status.replace("_", " ")
    return ENDINGS.get(status) or Ending(text or "no status", text, faulty=not status)


@dataclass(frozen=True)
class Verdict:
    """The verdict on a run, and why it is not to be relied on, where it is not."""

    word: str
    doubts: tuple[str, ...]

    @property
    def solved(self) -> bool:
        """Whether the word is "solved"."""
        return self.word == SOLVED


def judge_run(status: str, judged: Judged, trust: Mapping[str, object] | None) -> Verdict:
    """Judge a run that ended with ``status``; ``trust`` as in result.json, None where nothing was measured."""
    measured = Examination.from_json(dict(trust or {}))
    found = doubts(measured, judged)
    return Verdict(verdict_word(status, judged, bool(found), bool(measured.refined)), found)


def doubts(trust: Examination, judged: Judged) -> tuple[str, ...]:
    """List why a result is not to be relied on, one clause for each finding that refutes it; empty if none does.

    That changes grow beyond use spoils gradients. It refutes a result unless finer simulations come to the same: a walk
    may be a walk whatever its last state is.
    """
    found = [line for line in findings(trust, judged) if line.doubt]
    return tuple(line.doubt for line in found if line.about != GROWTH or not holds(trust, judged))


def holds(trust: Examination, judged: Judged) -> bool:
    """Whether finer simulations were done, and none of them is far from the result."""
    return bool(trust.refined) and all(refined_finding(row, judged).level in (GOOD, FAIR) for row in trust.refined)


def verdict_word(status: str, judged: Judged, doubted: bool, examined: bool = True) -> str:
    """Return the word for a run. One that was interrupted is solved if what it had found is.

    Args:
        status: how its solver ended.
        judged: the exact rollout of what it found.
        doubted: whether there are any ``doubts``.
        examined: whether finer simulations were done.
    """
    if status == INTERRUPTED and not (judged.met and judged.checked and examined):
        return INTERRUPTED
    if not judged.met or not (judged.checked or ending(status).usable):
        return NOT_SOLVED
    if doubted:
        return DOUBTED
    return SOLVED if judged.checked or ending(status).stationary else BEST_FOUND


def verdict_words(word: str, status: str, checked: bool) -> str:
    """Return a verdict in a few words, such as "best found, budget ended"."""
    how = ending(status).brief
    return {
        SOLVED: "solved",
        DOUBTED: "met, but not to be trusted" if checked else "found, but not to be trusted",
        BEST_FOUND: f"best found, {how}",
        INTERRUPTED: "interrupted",
    }.get(word, f"not solved ({how})")
