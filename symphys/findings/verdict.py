"""The verdict on a run, in one word: whether everything is met, by a motion that can be relied on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from symphys.findings.advice import findings
from symphys.findings.endings import ending
from symphys.findings.examination import Examination
from symphys.findings.levels import FAIR, GOOD, Judged
from symphys.findings.numerics import GROWTH, refined_finding

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
    found = doubts(Examination.from_json(dict(trust or {})), judged)
    return Verdict(verdict_word(status, judged, bool(found)), found)


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


def verdict_word(status: str, judged: Judged, doubted: bool) -> str:
    """Return the word for a run.

    Args:
        status: how its solver ended.
        judged: the exact rollout of what it found.
        doubted: whether there are any ``doubts``.
    """
    if status == INTERRUPTED:
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
