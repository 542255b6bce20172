"""Figures of performance of a machine alone: what of ranges and largest errors is left without noise.

A standard asks for the range of recorded lengths, or for their largest error, with the noise in it: of many lengths that are
truly alike the largest is too large by two or three standard deviations. That value stands as it was recorded, and is decided.
Beside it stands the same figure of the machine, at the recorded set-ups, without noise and without what the artefact is off:
of draws of all of its errors together (:mod:`cmm_uq.analysis.machine.regions`), those included that nobody named.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.conformity import accuracy
from cmm_uq.analysis.conformity.accuracy import UNITS
from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.measurement import RecordingModel
from cmm_uq.maths.uncertainty.quantity import Quantity

_TAILS = [0.025, 0.5, 0.975]


@dataclass(frozen=True, eq=False)
class MachinePerformance:
    """Errors of the recorded lengths by the machine alone."""

    points: Points
    rows: Ints  # (m, 2) the points between which each length lies
    errors: Floats  # (N, m) draws, µm
    recorded: Floats | None  # (m,) errors of indication as recorded, µm; ``None`` where nobody certified the lengths
    of_bar: bool  # whether the scatter of the lengths is a figure of performance

    @cached_property
    def figures(self) -> Mapping[str, Quantity]:
        """The machine's own, by the names of the recorded ones."""
        if not self.of_bar:
            return {}
        drawn, of_mean = (accuracy.figures(MICROMETRE * errors) for errors in (self.errors, self.errors.mean(axis=0)))
        names = [name for name in UNITS if name != "mean_length_mm"]
        return {name: _quantity(drawn[name], float(of_mean[name]), UNITS[name]) for name in names}

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
    """Of draws (N, m), mm, of the errors of the lengths between :func:`rows_of`; ``None`` of an artefact without lengths."""
    artefact, rows = model.artefact, rows_of(model.artefact)
    if rows is None:
        return None
    found = artefact.indications()
    recorded = None if found is None or not np.array_equal(found.rows, rows) else found.errors / MICROMETRE
    return MachinePerformance(artefact.points, rows, errors / MICROMETRE, recorded, artefact.lengths() is not None)


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
    """(m, 2) points between which the lengths of an artefact lie; ``None`` of one that has none."""
    if artefact.lengths() is not None:
        return artefact.rows if artefact.rows.shape[1] == 2 else None
    found = artefact.indications()
    return None if found is None else found.rows
