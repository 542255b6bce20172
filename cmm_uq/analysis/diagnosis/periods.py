"""Which periods fit a recording: every mode of the posterior, each with its interval and its probability."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import special

from cmm_uq.analysis.diagnosis.comparison.explanations import STEP, effect_of, evenly, unevenly
from cmm_uq.analysis.diagnosis.comparison.search import Found
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import Unit
from cmm_uq.maths.uncertainty.quantity import Quantity

_LIKELY = 1e-4
"""Part of the largest probability below which a trial parts one mode from the next."""

_APART = 0.5
"""Frequencies that are this far apart, over one in the range of the readings, with nothing likely between, are two modes."""

_VALLEY = 0.1
"""Evidence over that of the lower of two peaks below which what lies between parts two modes."""

_TOLD = 1e-3
"""Probability from which a mode is told."""


@dataclass(frozen=True)
class Mode:
    """A period, its interval within this mode, and how probable the mode is among all.

    ``ends`` are the lowest and the highest value that belong to it.
    """

    period: Quantity
    probability: float
    ends: tuple[float, float]

    def holds(self, shape: Floats) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Which values (N,) belong to it."""
        return (shape >= self.ends[0]) & (shape <= self.ends[1])


def modes_of(found: Found, index: int) -> tuple[Mode, ...]:
    """All modes of the period of an effect that was found, the most probable first; none of one without a period.

    Periods shorter than those that are searched count too: where positions repeat at equal distances, they fit as well.

    Parameters
    ----------
    found : by the search.
    index : of the effect, among the candidates.
    """
    explanation = found.first.explanations[index]
    effect = effect_of(explanation)
    if not (effect.shape and effect.shape[0].period_along):
        return ()
    given = [v for v in found.versions if v.explanation != index]
    log, before, shape = [np.zeros(0)], [np.zeros(0)], [np.zeros(0)]
    for group, cube in found.first.comparison.each(None, given, (index,)):
        own = group.explanation == index
        log.append(special.logsumexp(cube[own, :, 0], axis=1))
        before.append(group.weight[own])
        shape.append(np.array([explanation.members[m].shape[0] for m in group.member[own]]))
    evidence = np.concatenate(log)
    total = evidence + np.concatenate(before)
    weight = np.exp(total - special.logsumexp(total))
    frequency = evenly(effect, np.concatenate(shape))
    likely = np.flatnonzero(weight > _LIKELY * weight.max())
    likely = likely[np.argsort(frequency[likely])]
    span = _span(found, effect.shape[0].period_along)
    apart = np.split(likely, np.flatnonzero(np.diff(frequency[likely]) > _APART / span) + 1)
    found_modes = []
    for part in (peak for trials in apart for peak in _peaks(trials, evidence)):
        step = 0.5 * STEP / span
        ends = unevenly(effect, np.array([frequency[part].max() + step, max(frequency[part].min() - step, 1e-9)]))
        period = _within(unevenly(effect, frequency[part]), weight[part], effect.shape[0].unit, ends)
        found_modes.append(Mode(period, float(weight[part].sum()), (float(ends[0]), float(ends[1]))))
    return tuple(sorted((m for m in found_modes if m.probability > _TOLD), key=lambda m: -m.probability))


def whole(found: Found, index: int, mode: Mode) -> bool:
    """Whether the readings hold a whole period of an effect: less is a bow, or any other curve."""
    axis = effect_of(found.first.explanations[index]).shape[0].period_along
    return axis is None or mode.period.interval95[1] <= _span(found, axis)


def _peaks(trials: Ints, evidence: Floats) -> Iterator[Ints]:
    """Trials in order of frequency, parted at the deepest valley between two peaks, and so on."""
    log = evidence[trials]
    lower = np.minimum(np.maximum.accumulate(log), np.maximum.accumulate(log[::-1])[::-1])
    valley = int(np.argmin(log - lower))
    if log[valley] - lower[valley] < np.log(_VALLEY):
        yield from _peaks(trials[:valley], evidence)
        yield from _peaks(trials[valley:], evidence)
    else:
        yield trials


def _span(found: Found, axis: str) -> float:
    return float(np.ptp(found.first.model.artefact.points.readings[axis]))


def _within(periods: Floats, weight: Floats, unit: Unit, ends: Floats) -> Quantity:
    """Mean, standard deviation and interval of periods with weights; of a single trial, as wide as trials are apart."""
    weight = weight / weight.sum()
    value = float(weight @ periods)
    own = float(np.ptp(ends)) / np.sqrt(12) / max(len(periods), 1)
    u = float(np.sqrt(weight @ (periods - value) ** 2 + own**2))
    return Quantity(value, u, (value - 1.96 * u, value + 1.96 * u), unit)
