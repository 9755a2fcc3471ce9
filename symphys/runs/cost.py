"""The work of a solve in rollouts."""

from __future__ import annotations

from collections.abc import Mapping

from symphys.solvers import Counts, TraceRow


def used(counts: Counts) -> list[str]:
    """The kinds of evaluation whose price matters here."""
    return ["gradient", *(kind for kind, count in priced(counts).items() if count and kind != "gradient")]


def priced(counts: Counts | TraceRow) -> dict[str, int]:
    """How often each kind of evaluation that is dearer than a rollout was done."""
    return {"gradient": counts.gradients, "jacobian": counts.jacobians, "hessian": counts.hessians}


def equivalents(counts: Counts | TraceRow, price: Mapping[str, float]) -> float:
    """Work in rollouts: every evaluation times its measured price."""
    return float(counts.rollouts + sum(count * price[kind] for kind, count in priced(counts).items() if count))
