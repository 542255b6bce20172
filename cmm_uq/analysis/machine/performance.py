"""Figures of performance of a machine alone: what of ranges and largest errors is left without noise.

A standard asks for the range of recorded lengths, or for their largest error, with the noise in it: of many lengths that are
truly alike the largest is too large by two or three standard deviations. That value stands as it was recorded, and is decided.
Beside it stands the same figure of the machine, at the recorded set-ups, without noise and without what the artefact is off:
of draws of all of its errors together (:mod:`cmm_uq.analysis.machine.regions`), those included that nobody named.

How far figures rest on what was taken to be known beforehand.

Sizes of families are half-normal then. With that prior half as wide, or twice, every draw of a machine has another weight,
p′(s)/p(s), so that means and variances of what the machine does follow without drawing anew. Where such weights have no finite
variance, as those of a family that the recording does not show (Pareto tails of k above 0.5: Vehtari, Simpson, Gelman, Yao,
Gabry 2024, J. Mach. Learn. Res. 25(72)), the family's errors are scaled with its prior, which is then what happens, and
elsewhere no less. Errors that are no part of the recording scale with theirs.

Which error makes how much of what was recorded: the errors of a machine ranked by what each did to the observations.

What an artefact deviates by, freed of how it lay, is the sum of what each named error makes of it, of what its sizes differ
from nominal, and of what is left: y = Σ aⱼ + r. The share of a cause is aⱼ·y/(y·y): shares add up to one, and one below zero
takes away from what others make (Pratt, Proc. 2nd Tampere Conf. in Statistics (1987) 245).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.conformity import accuracy
from cmm_uq.analysis.conformity.accuracy import UNITS
from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.base.values import dataclass
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.measurement import RecordingModel
from cmm_uq.maths.uncertainty.quantity import Quantity

_TAILS = [0.025, 0.5, 0.975]
# lengths, each by every coefficient of the machine, that memory holds; and ordered pairs of points that are looked at for them
_LENGTHS, _PAIRS = 20_000, 1_000_000
_AT_ONCE = 2_000_000  # errors of lengths that are copied at once


@dataclass(frozen=True, eq=False)
class MachinePerformance:
    points: Points
    rows: Ints  # (m, 2) the points between which each length lies
    errors: Floats  # (N, m) draws, µm
    recorded: Floats | None  # (m,) errors of indication as recorded, µm; ``None`` where nobody certified the lengths
    of_bar: bool  # whether the scatter of the lengths is a figure of performance

    @cached_property
    def figures(self) -> Mapping[str, Quantity]:
        if not self.of_bar:
            return {}
        parts = np.array_split(self.errors, 1 + self.errors.size // _AT_ONCE)
        drawn = [accuracy.figures(MICROMETRE * some) for some in parts]
        of_mean = accuracy.figures(MICROMETRE * self.errors.mean(axis=0))
        names = [name for name in UNITS if name != "mean_length_mm"]
        each = {name: np.hstack([one[name] for one in drawn]) for name in names}
        return {name: _quantity(each[name], float(of_mean[name]), UNITS[name]) for name in names}

    def of_statement(self, statement: Statement) -> tuple[float, Quantity] | None:
        """The largest of what a statement decides, µm: as recorded, and of the machine, of the same lengths without noise.

        Errors of indication, or the range of a bar's lengths; ``None`` of statements on something else, on lengths to whose
        errors something else was added, or that rest on a reading that was left out of the estimates.
        """
        if statement.outside or any(item.set_aside for item in statement.errors):
            return None
        if not statement.signed and self.of_bar and [item.measurement for item in statement.errors] == [None]:
            return statement.value_um, self.figures["b89_range_um"]
        if self.recorded is None or not statement.signed:
            return None
        first = self.rows[:, 0]
        recorded = zip(self.points.measurement[first].tolist(), self.points.repeat[first].tolist(), strict=True)
        decided = {(item.measurement, item.repeat, round(item.error_um, 6)) for item in statement.errors}
        each = [(*one, round(error, 6)) for one, error in zip(recorded, self.recorded.tolist(), strict=True)]
        chosen = np.array([one in decided for one in each], dtype=bool)
        if len({one for one in each if one in decided}) < len(decided) or not chosen.any():
            return None
        return float(np.abs(self.recorded[chosen]).max()), self.largest(chosen)

    def largest(self, chosen: NDArray[np.bool_]) -> Quantity:
        """The largest error by its size of some lengths (m,)."""
        errors = self.errors[:, chosen]
        of_mean = float(np.abs(errors.mean(axis=0)).max())
        return _quantity(np.abs(errors).max(axis=1), of_mean, unit("µm"))


def performance_of(model: RecordingModel, errors: Floats) -> MachinePerformance | None:
    """Of draws (N, m), mm, of errors of lengths, which become µm; ``None`` of an artefact without lengths."""
    artefact, rows = model.artefact, rows_of(model.artefact)
    if rows is None:
        return None
    found = artefact.indications()
    recorded = None if found is None or not np.array_equal(found.rows, rows) else found.errors / MICROMETRE
    errors /= MICROMETRE
    return MachinePerformance(artefact.points, rows, errors, recorded, artefact.lengths() is not None)


def _quantity(draws: Floats, of_mean: float, of_unit: str) -> Quantity:
    """Of draws (N,) of a figure that doubt makes larger, and of the same figure of the errors' mean.

    As much as the figure of a draw exceeds that of the mean, that of the mean may exceed the true one: the lower end is not
    above that of the basic bootstrap interval (Davison, Hinkley 1997, 5.2), or a machine without errors would never be in it.
    The value is the median, which is between the ends whatever the shape.
    """
    low, middle, high = np.quantile(draws, _TAILS).tolist()
    low = min(low, max(2 * of_mean - high, 0.0))
    return Quantity(middle, float(draws.std(ddof=1)), (low, high), unit(of_unit))


def rows_of(artefact: Artefact) -> Ints | None:
    """(m, 2) points between which the lengths of an artefact lie; ``None`` of one that has none, or far too many."""
    if artefact.lengths() is not None:
        return artefact.rows if artefact.rows.shape[1] == 2 else None
    each = np.bincount(artefact.points.group)
    found = artefact.indications() if each @ (each - 1) < _PAIRS else None
    return None if found is None or len(found.rows) > _LENGTHS else found.rows


ALL = "all"
TIMES = (0.5, 2.0)  # by which a prior is narrower or wider
MATTERS = 0.1  # part of U by which it or the value then changes, from which on a figure rests on the prior
_WORTH, _HEAVY = 50.0, 0.5
_NOTHING = 1e-9  # of u, below which a change is of rounding


@dataclass(frozen=True, eq=False)
class PriorInfluence:
    """What another prior of one family of errors, or of all, would change."""

    family: str
    times: float  # its width, over the one that was taken
    u: Floats  # (c,) over u as stated
    shift: Floats  # (c,) change of the value over u


def influence_of(
    values: Floats, u: Floats, scales: Mapping[str, Floats], own: Callable[[str], Floats], apart: Mapping[str, Floats]
) -> tuple[PriorInfluence, ...]:
    """Of each family, and of all together, on figures whose draws depend on the families' sizes.

    ``values``: draws (N, c). ``u``: (c,) as stated. ``scales``: (N,) sizes of each family. ``own``: (N, c), what of the values
    errors of a family make. ``apart``: (c,) variances, by family or error, of what is no part of the draws.
    """

    def changed(family: str, names: Collection[str]) -> Iterator[PriorInfluence]:
        for times in TIMES:
            logs = {name: 0.5 * scales[name] ** 2 * (1 - times**-2) for name in names if name in scales}
            shown = [name for name, log in logs.items() if _weights(log) is not None]
            weight = _weights(sum((logs[name] for name in shown), np.zeros(len(values))))
            if weight is None:
                shown, weight = [], np.full(len(values), 1 / len(values))
            before, mean = values.var(axis=0), weight @ values
            ratio = np.divide(weight @ (values - mean) ** 2, before, out=np.ones_like(u), where=before > 0)
            # of no more than the whole variance, which other draws have given
            more, shift = np.minimum(before, u**2) * (ratio - 1), mean - values.mean(axis=0)
            for name in (one for one in logs if one not in shown):
                scaled = own(name)
                more, shift = more + (times**2 - 1) * scaled.var(axis=0), shift + (times - 1) * scaled.mean(axis=0)
            more = more + sum((times**2 - 1) * apart[name] for name in names if name in apart)
            scale = np.where(u > 0, u, 1.0)  # nothing changes what is not uncertain at all
            ratio = np.where(u > 0, np.sqrt(np.maximum(u**2 + more, 0.0)) / scale, 1.0)
            moved = np.where(np.abs(shift) > _NOTHING * scale, shift / scale, 0.0)
            yield PriorInfluence(family, times, np.where(np.abs(ratio - 1) > _NOTHING, ratio, 1.0), moved)

    found = [one for name in (*scales, *apart) for one in changed(name, (name,))]
    return (*found, *(changed(ALL, (*scales, *apart)) if len(found) > len(TIMES) else ()))


def _weights(logs: Floats) -> Floats | None:
    """Of draws whose density has another one's ratio (N,), as its logarithm; ``None`` where they say nothing of it."""
    weight = np.exp(logs - logs.max())
    weight /= weight.sum()
    largest = np.sort(weight)[-int(3 * np.sqrt(len(weight))) :]
    tail = float(np.mean(np.log(largest / largest[0])))  # Hill's estimate of k
    return weight if tail < _HEAVY and 1 / np.sum(weight**2) > _WORTH else None


@dataclass(frozen=True)
class Contribution:
    """What one cause does to the observations."""

    owner: str | None  # effect, or the artefact; ``None``: no named one
    rms_um: float  # root mean square over the observations, each in a reading of one coordinate, µm
    share: float  # of the sum of squares of all


def contributions(model: RecordingModel, values: Floats) -> tuple[Contribution, ...]:
    """Of every named error, the artefact's sizes and what no error explains, the largest share first.

    ``values``: (k,) of the unknowns.
    """
    linear = model.linearised(values)
    apart = values - np.array([unknown.prior_mean for unknown in linear.unknowns])
    parts = linear.reduce(linear.design * apart)
    left = linear.reduce((linear.observed - linear.design @ values)[:, None])[:, 0]
    owners = [unknown.key[0] for unknown in linear.unknowns]
    each: dict[str | None, Floats] = {o: parts[:, [s == o for s in owners]].sum(axis=1) for o in dict.fromkeys(owners)}
    each[None] = left
    whole = np.sum(list(each.values()), axis=0)
    square = float(whole @ whole) or 1.0
    found = (
        Contribution(owner, float(np.sqrt(np.mean(part**2))) / MICROMETRE, float(part @ whole) / square)
        for owner, part in each.items()
    )
    return tuple(sorted(found, key=lambda one: -one.share))
