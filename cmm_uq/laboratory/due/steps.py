"""When a machine made a step, and how large it was: a collision, a move, a part that slipped.

Between two certificates the drift model reckons with a step or without one, in every tale that it keeps; how much weight the
tales with a step have given all certificates, those after it too, is the probability that there was one. Its size is a
component of the state that is nothing until then (fixed-point smoothing: Anderson and Moore 1979, Optimal Filtering, section
7.2), so that it is known with all that came after and with what is not known of rate, wear, settling, season and artefacts.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass
from cmm_uq.laboratory.due import drift
from cmm_uq.laboratory.due.drift_filter import DriftState, filtered

LIKELY = (0.9, 0.5)
"""Probabilities from which on a step is named: dated as closely as the first of them allows, else as the second does."""

LONGEST = 3  # times between certificates that one step is dated to at most


@dataclass(frozen=True)
class DatedStep:
    """A step, or the sum of those that came between the two days."""

    after: int  # ordinal of the last certificate that does not have it, or of an adjustment since
    by: int  # ordinal of the first certificate that has it
    probability: float
    size: float  # and u: with its sign, and its standard uncertainty, in the unit of the values, if there was one
    u: float


@dataclass(frozen=True, eq=False)
class FollowedHistory:
    """The history of one machine with the state that it leaves, and when its tales have steps."""

    machines: drift.Histories
    prior: drift.DriftPrior
    state: DriftState


def followed(known: drift.DriftHistory, limit: float | None, prior: drift.DriftPrior | None = None) -> FollowedHistory:
    prior = prior or drift.default_prior(drift.limit_for(limit, known.u))
    machines = drift.side_by_side([known])
    return FollowedHistory(machines, prior, filtered(machines, prior, dated=True))


def dated_steps(of: FollowedHistory) -> tuple[DatedStep, ...]:
    """The steps that are more probable than not, in turn."""
    weight = of.state.weights(of.prior)[0]
    return tuple(_sized(of, run, probability) for run, probability in sorted(_runs(of.state.steps[:, 0], weight)))


def _runs(steps: Floats, weight: Floats) -> Iterator[tuple[tuple[int, int], float]]:
    """Runs of certificates that a step came before, none of which has one in common, and the probability of a step."""
    free = np.ones(len(steps), dtype=bool)
    for least in LIKELY:
        for length in range(1, min(LONGEST, len(steps)) + 1):
            runs = [(i, i + length) for i in range(len(steps) - length + 1)]
            found = [(float((weight * steps[slice(*run)].any(axis=0)).sum()), run) for run in runs]
            for probability, run in sorted(found, reverse=True):
                if probability >= least and free[slice(*run)].all():
                    free[slice(*run)] = False
                    yield run, probability


def _sized(of: FollowedHistory, run: tuple[int, int], probability: float) -> DatedStep:
    state = filtered(of.machines, of.prior, dated=True, sized=range(*run))
    weight = state.weights(of.prior)[0] * state.steps[slice(*run), 0].any(axis=0)
    weight /= weight.sum()
    each, variance = state.mean[-1, 0], state.covariance[-1, -1, 0]
    size = float((weight * each).sum())
    u = float(np.sqrt((weight * (variance + (each - size) ** 2)).sum()))
    after, by = of.machines.begun[run[0], 0], of.machines.day[run[1] - 1, 0]
    return DatedStep(int(after), int(by), min(probability, 1.0), size, u)
