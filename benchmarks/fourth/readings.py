"""Noise as it comes reading after reading, by other code than what an oracle knows of its covariance."""

from __future__ import annotations

import numpy as np

from benchmarks.second.artefacts import Placed
from benchmarks.second.noises import IN_TIME, Noise


def noise(random: np.random.Generator, of: Noise, placed: Placed) -> np.ndarray:
    """(n, 3) mm of readings of coordinates; of a real recording shared out evenly among those of an observation."""
    n = len(placed.true)
    if of.kind == "real":
        return np.asarray((placed.D.T @ placed.residuals).reshape(n, 3) / np.sum(placed.D[0] ** 2))
    found = random.standard_normal((n, 3))
    if of.kind == "tails":
        found *= np.sqrt((of.dof - 2) / random.chisquare(of.dof, (n, 3)))
    elif of.kind == "axis":
        found[:, of.axis] *= of.times
    elif of.kind == "set-up":
        key = 1000 * placed.measurement + placed.point
        for k in np.unique(key):
            found[key == k] += of.ratio * random.standard_normal(3)
    elif of.kind == "growing":
        firsts = dict(zip(placed.measurement[placed.point == 1], placed.true[placed.point == 1], strict=True))
        way = np.linalg.norm(placed.true - [firsts[k] for k in placed.measurement], axis=1)
        found += of.ratio * (way / way.max())[:, None] * random.standard_normal((n, 3))
    elif of.kind in IN_TIME:
        found += of.ratio * _in_time(random, of, placed.recorded["time_s"])
    return of.sigma * found


def _in_time(random: np.random.Generator, of: Noise, time: np.ndarray) -> np.ndarray:
    """From reading to reading: what is kept of the last, and what is new."""
    found, state, last = np.zeros((len(time), 3)), random.standard_normal(3) * (of.kind == "slow"), float(time.min())
    for i in np.argsort(time):
        kept = np.exp(-(time[i] - last) / of.forgets) if of.kind == "slow" else 1.0
        new = 1 - kept**2 if of.kind == "slow" else (time[i] - last) / np.ptp(time)
        state, last = kept * state + np.sqrt(new) * random.standard_normal(3), float(time[i])
        found[i] = state
    return found
