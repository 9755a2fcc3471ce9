"""How a solve may end: every status, what it means for a verdict, and its words in reports and on the terminal."""

from __future__ import annotations

from dataclasses import dataclass


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
    "interrupted": Ending("interrupted", "interrupted", headline="Interrupted"),
    "unreadable": Ending("no readable result", "unreadable", headline="No result", faulty=True),
}
"""By the status in result.json; the last one is of folders without a result."""


def ending(status: str) -> Ending:
    """Return the ending of a status; an unknown one is worded as it stands."""
    text = status.replace("_", " ")
    return ENDINGS.get(status) or Ending(text or "no status", text, faulty=not status)
