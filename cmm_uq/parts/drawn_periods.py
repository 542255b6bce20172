"""Errors with one period a draw: their displacements at readings, and where a calibration shows them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cmm_uq.model.measurement import MeasurementModel
from cmm_uq.physics.drives import PeriodicScale
from cmm_uq.physics.effect import Effect
from cmm_uq.physics.superposition import About
from cmm_uq.points import Floats, Ints, Points


@dataclass(frozen=True, eq=False)
class DrawnPeriod:
    """Draws of a periodic error of an axis, each with a period of its own.

    Parameters
    ----------
    effect : that it is.
    frequency : (M,) 1/mm.
    coefficients : (M, 2) of the sine and the cosine of 2π·frequency·reading, mm.
    """

    effect: Effect
    frequency: Floats
    coefficients: Floats

    @property
    def axis(self) -> str:
        """Whose scale reads what it is a function of."""
        return str(self.effect.along_motion)

    def at(self, reading: Floats, rows: slice | Ints = slice(None)) -> Floats:
        """(M, n) of readings (n,), mm."""
        angle = 2 * np.pi * self.frequency[rows, None] * reading
        found = np.cos(angle)
        found *= self.coefficients[rows, 1:]
        np.sin(angle, out=angle)
        angle *= self.coefficients[rows, :1]
        found += angle
        return np.asarray(found)


def drawable(effect: Effect) -> bool:
    """Whether its periods are drawn; another one with a shape is a sum of trials."""
    return isinstance(effect, PeriodicScale)


class AtEach(Effect):
    """One millimetre of an error along the motion of an axis at each point by itself."""

    def __init__(self, effect: Effect) -> None:
        self.name, self.along_motion = effect.name, effect.along_motion

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        """See :meth:`Effect.basis`; (n, 3, n)."""
        found = np.zeros((len(points), 3, len(points)))
        each = np.arange(len(points))
        found[each, "xyz".index(str(self.along_motion)), each] = 1.0
        return found


def shown(model: MeasurementModel, effect: Effect) -> Floats:
    """(m, n) of the model's used observations, of a millimetre of error at each of its points."""
    about = model.estimate().about
    return model.seen(model.columns(AtEach(effect), (), about), about)


def columns_at_each(about: About, effect: Effect) -> Floats:
    """(n, 3, n) displacement e of points by a millimetre of error at each."""
    return about.columns(AtEach(effect))
