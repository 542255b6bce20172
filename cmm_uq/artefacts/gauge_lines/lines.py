"""What each line of a step gauge tells by itself: its scale, its linearity, its periodic part, its backlash.

These are descriptions of a recording, line by line, without any model of the machine; the measurement model explains them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from cmm_uq.artefacts.gauge_lines.observe import StepGauge
from cmm_uq.base.points import Floats
from cmm_uq.base.units import PPM

LEAST_FACES = 8
"""Faces on a line from which on a periodic error can be told from scatter."""

SIGNIFICANT = 0.01
"""Probability of a periodic part so large by chance, over all periods looked at, below which it is reported."""

_FINENESS = 4
"""Frequencies looked at for each independent one."""


@dataclass(frozen=True, eq=False)
class Periodic:
    """A periodic error: period and amplitude, mm, and the probability of one so large by chance."""

    period: float
    amplitude: float
    p_value: float


@dataclass(frozen=True, eq=False)
class GaugeLine:
    """One measurement of a gauge.

    Parameters
    ----------
    measurement : its number.
    direction : (3,) unit vector, in the sense of growing distances.
    middle : (3,) in the recorded frame, mm.
    length : from its first to its farthest face, by the certificate, mm.
    faces : different ones.
    scale_ppm : slope of deviation over distance.
    scale_weights : (n,) of all observations, mm, in ``scale_ppm``.
    linearity : largest deviation from that slope, of the mean of each face, mm.
    gap : mean difference of faces reached from both sides, outward minus inward, mm; ``None`` when there are none.
    gap_weights : (n,) of all observations in ``gap``.
    periodic : the periodic part, where there is one.
    """

    measurement: int
    direction: Floats
    middle: Floats
    length: float
    faces: int
    scale_ppm: float
    scale_weights: Floats
    linearity: float
    gap: float | None
    gap_weights: Floats
    periodic: Periodic | None


def lines_of(gauge: StepGauge) -> tuple[GaugeLine, ...]:
    """Every line of a recording, by its measurement."""
    found, deviations, directions = [], gauge.deviations(), gauge.directions()
    reversals = gauge.reversals()
    for number in np.unique(gauge.measurement):
        rows = np.flatnonzero(gauge.measurement == number)
        faces, index = np.unique(np.round(gauge.reference[rows], 6), return_inverse=True)
        means = np.bincount(index, deviations[rows]) / np.bincount(index)
        about = gauge.reference[rows] - gauge.reference[rows].mean()
        slope = float(about @ deviations[rows] / (about @ about))
        rest = means - means.mean() - slope * (faces - faces.mean())
        slope_weights, gap, gap_weights = np.zeros(len(deviations)), None, np.zeros(len(deviations))
        slope_weights[rows] = about / (about @ about)
        if reversals is not None and np.any(own := reversals.measurement == number):
            gap = float(reversals.gap[own].mean())
            gap_weights[rows] = reversals.weights[rows] / own.sum()
        found.append(GaugeLine(
            int(number), directions[rows[0]], gauge.points.xyz[rows].mean(axis=0), float(np.ptp(faces)), len(faces),
            slope / PPM, slope_weights / PPM, float(np.abs(rest).max()), gap, gap_weights,
            periodic_part(faces, means),
        ))  # fmt: skip
    return tuple(found)


def periodic_part(position: Floats, deviation: Floats) -> Periodic | None:
    """The sinusoid that explains most of what a straight line leaves of deviations (n,) at positions (n,), mm.

    Periods from twice the mean distance of the faces to half the line are looked at. The probability of the F test becomes
    that of the largest of all periods by the mean number of upcrossings (Baluev 2008, MNRAS 385, 1279). ``None`` below
    :data:`LEAST_FACES`, or when chance explains it as well.
    """
    n = len(position)
    if n < LEAST_FACES:
        return None
    span = float(np.ptp(position))
    independent = (n - 1) // 2 - 1
    frequencies = np.linspace(2 / span, 0.5 * (n - 1) / span, _FINENESS * independent + 1)
    trend, _ = np.linalg.qr(np.column_stack([np.ones(n), position - position.mean()]))
    rest = deviation - trend @ (trend.T @ deviation)
    angles = 2 * np.pi * np.outer(frequencies, position)
    waves = np.stack([np.cos(angles), np.sin(angles)], axis=2)
    waves = waves - np.einsum("nj,fjk->fnk", trend, np.einsum("nj,fnk->fjk", trend, waves))
    coefficients = np.linalg.pinv(waves) @ rest
    explained = np.sum(np.einsum("fnk,fk->fn", waves, coefficients) ** 2, axis=1)
    best, freedom, total = int(np.argmax(explained)), n - 4, float(rest @ rest)
    left = max(total - float(explained[best]), 0.0)
    if total == 0 or freedom < 1:
        return None
    chance = float(special.fdtrc(2, freedom, explained[best] / 2 / (left / freedom))) if left > 0 else 0.0
    width = float(np.ptp(frequencies)) * np.sqrt(4 * np.pi * np.var(position))
    p_value = float(min(1.0, chance * (1 + width * np.sqrt(-np.log(max(chance, 1e-300))))))
    if p_value >= SIGNIFICANT:
        return None
    return Periodic(float(1 / frequencies[best]), float(np.linalg.norm(coefficients[best])), p_value)
