"""How far an error has probably moved since the last certificate, by the drift model of its history."""

from __future__ import annotations

import numpy as np

from cmm_uq.laboratory.due.drift import YEAR, History, side_by_side
from cmm_uq.laboratory.due.drift_filter import filtered
from cmm_uq.laboratory.due.drift_prior import Prior, default_prior, limit_for

FEWEST = 2
"""Certificates from which on a history says anything of a machine's own drift."""


def change_since(of: History, days: float, *, prior: Prior | None = None, limit: float | None = None) -> float | None:
    """Root mean square change of an error by so many days after its last certificate, in its unit.

    A rate that is known less and less well the farther it is carried on, a wandering and now and then a step:
    √((r² + u²(r))·t² + w²·t + n·s²·t), averaged over the model's parameters given the certificates.

    Parameters
    ----------
    of : the history.
    days : since the last certificate, either way.
    prior : what the machine's fleet taught; else the default one.
    limit : in units of which the default one is.

    Returns
    -------
    ``None`` where there is one certificate only, or the machine was adjusted after the last: then nobody knows.
    """
    if len(of.day) < FEWEST or np.isfinite(of.adjusted_after):
        return None
    known = default_prior(limit_for(limit, of.u)) if prior is None else prior
    state, years = filtered(side_by_side([of]), known), abs(days) / YEAR
    weight = state.weights(known)[0]
    rate = state.mean[1, 0] ** 2 + state.covariance[1, 1, 0]
    wandering = (known.walk**2 + known.steps_per_year * known.step_sd**2)[:, None]
    square = rate * years**2 + wandering * years
    return float(np.sqrt(np.sum(weight * square) / np.sum(weight)))
