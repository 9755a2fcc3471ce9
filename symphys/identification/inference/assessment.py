"""Estimates as the record has them, and why not to rely on them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symphys.identification.fitting.state import FitOutcome, FitStatus
from symphys.identification.inference.bootstrap import Bootstrap
from symphys.identification.inference.uncertainty import Uncertainty
from symphys.identification.interface import RecordedResiduals
from symphys.results.identification import ParameterEstimate, QuantityResiduals

NARROW = 1.5
"""Ratio of residuals to a given noise, or of both intervals, above which those of the Jacobian are doubted."""
BENT = 0.5
"""Difference of a refitted draw from its step, in standard deviations of the draws, above which steps are doubted."""


def estimates(
    problem: RecordedResiduals, outcome: FitOutcome, known: Uncertainty, drawn: Bootstrap
) -> tuple[ParameterEstimate, ...]:
    """The shared numbers with both intervals; at a kink that of the Jacobian reaches to that of its side."""
    parameters, shared = problem.shared, outcome.state.shared
    away = outcome.one_sided if outcome.one_sided.size else np.zeros(len(shared))
    interval = known.interval(shared) + np.stack([np.minimum(away, 0), np.maximum(away, 0)], axis=1)
    units = parameters.units or ("",) * len(parameters.names)
    return tuple(
        ParameterEstimate(
            name=name,
            unit=units[i],
            value=float(shared[i]),
            error=float(known.error[i]),
            lower=float(interval[i, 0]),
            upper=float(interval[i, 1]),
            bootstrap_lower=float(drawn.interval[i, 0]),
            bootstrap_upper=float(drawn.interval[i, 1]),
            at_bound={-1: "lower", 0: "", 1: "upper"}[int(known.at_bound[i])],
            guess=float(parameters.guess[i]),
            least=float(parameters.lower[i]),
            most=float(parameters.upper[i]),
            prior_mean=float(parameters.prior_mean[i]),
            prior_deviation=float(parameters.prior_deviation[i]),
        )
        for i, name in enumerate(parameters.names)
    )


def doubts(
    outcome: FitOutcome,
    parameters: Sequence[ParameterEstimate],
    quantities: Sequence[QuantityResiduals],
    drawn: Bootstrap,
    freedom: int,
) -> tuple[str, ...]:
    """A sentence for each reason not to rely on the estimates or on their intervals.

    ``freedom``: residuals less numbers that were estimated.
    """
    found = [] if outcome.status is FitStatus.CONVERGED else [f"the fit has not converged: {outcome.reason}"]
    found += [f"{each.name} is at its {each.at_bound} bound, {each.value:.6g}" for each in parameters if each.at_bound]
    if freedom < 1:
        found.append(f"numbers are {1 - freedom} too many for the residuals: nothing is left to judge the fit by")
    for quantity in quantities:
        if quantity.verdict == "missing effect":
            found.append(f"the model misses an effect on {quantity.name}: {quantity.text}")
        elif quantity.noise_known and quantity.ratio > NARROW:
            found.append(f"residuals of {quantity.name} are {quantity.ratio:.2g} times the given noise")
    wider = [each.name for each in parameters if bootstrap_share(each) > NARROW]
    if wider:
        found.append(
            "recordings differ by more than the noise explains: rely on the bootstrap's intervals, which are wider, of "
            + ", ".join(wider)
        )
    if drawn.refits.size:
        spread = drawn.draws.std(axis=0)
        away = np.abs(drawn.refits - drawn.draws[: len(drawn.refits)])
        worst = float(np.max(away / np.where(spread > 0, spread, np.inf)))
        if worst > BENT:
            found.append(
                f"draws of the bootstrap that were fitted in full differ from its steps by up to {worst:.2g} standard "
                "deviations: within the intervals the model is not linear"
            )
    return tuple(found)


def bootstrap_share(each: ParameterEstimate) -> float:
    """The bootstrap's interval by that of the Jacobian; nan where either is not known."""
    width = each.upper - each.lower
    return (each.bootstrap_upper - each.bootstrap_lower) / width if width > 0 else np.nan
