"""What placings of a plate leave open of the lowest-order errors of two axes, and of periodic ones.

A plate that is only shifted shears and stretches as well as the machine: both scales and the squareness stay free. Turned by
90° it parts them, but for the common scale, which only a known length gives. A straightness that is an arc with the rotation
that belongs to it looks like a turned placing as long as the plate moves along it alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from cmm_uq.artefacts.shift_axis.series import common_period
from cmm_uq.artefacts.shift_plate.model import PlaneModel
from cmm_uq.artefacts.shift_plate.placed_plate import PlacedPlate
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import AXES, Floats
from cmm_uq.machine.physics.effects.rigid_body import ROTATION, SCALE, SQUARENESS, STRAIGHTNESS

_ALIKE = 0.02  # what changes the readings by less than this part of its own size is not determined by them
_SQUARE_DEG = 5.0  # placings turned by less than this against each other are shifts of each other

_TITLES: dict[str, Text] = {
    **{effect.name: say("scale of {axis}", axis=Verbatim(a.upper())) for a, effect in SCALE.items()},
    **{
        effect.name: say("squareness {plane}", plane=Verbatim("–".join(plane.upper())))
        for plane, effect in SQUARENESS.items()
    },
    **{
        effect.name: say(
            "straightness of {axis} along {direction}", axis=Verbatim(a.upper()), direction=Verbatim(b.upper())
        )
        for (a, b), effect in STRAIGHTNESS.items()
    },
    **{
        effect.name: say("rotation of {axis} about {about}", axis=Verbatim(a.upper()), about=Verbatim(b.upper()))
        for (a, b), effect in ROTATION.items()
    },
    **{f"linearity_{a}": say("linearity of {axis}", axis=Verbatim(a.upper())) for a in AXES},
}


@dataclass(frozen=True, eq=False)
class FreeInPlane:
    """What the readings by themselves leave free."""

    # names of what can change together, or alone, without changing any reading
    combinations: tuple[tuple[str, ...], ...]
    # of each axis, mm: functions of this period, and of a half, a third, … of it, show in no reading; ``None``
    # where the turned placings see them
    periods: tuple[float | None, float | None]

    @property
    def names(self) -> frozenset[str]:
        """All that is not determined by itself."""
        return frozenset(name for combination in self.combinations for name in combination)

    @property
    def size_known(self) -> bool:
        """Whether both scales are determined."""
        return self.names.isdisjoint(effect.name for effect in SCALE.values())

    @property
    def square_known(self) -> bool:
        """Whether the squareness is determined."""
        return self.names.isdisjoint(effect.name for effect in SQUARENESS.values())

    @property
    def straight_known(self) -> bool:
        """Whether both straightnesses are determined."""
        return self.names.isdisjoint(effect.name for effect in STRAIGHTNESS.values())


def free_in_plane(plate: PlacedPlate, model: PlaneModel) -> FreeInPlane:
    """By the singular values of what low-order errors change of the readings beyond balls and placings."""
    # names, and change of the readings (2n, ·), of scales, squareness, and a bow or slope of each function
    names = [*(SCALE[AXES[a]].name for a in plate.axes), SQUARENESS[plate.plane].name]
    columns = [*model.smooth.columns.T[:3]]
    for index, f in enumerate(model.smooth.functions):
        place = (2 * f.position - f.low - f.high) / f.range
        names.append(f.name)
        columns.append(f.factor * (place if index >= 4 else place**2))
    effects = np.column_stack(columns)
    effects = effects / np.linalg.norm(effects, axis=0)
    basis = linalg.orth(model.smooth.flat)
    rest = effects - basis @ (basis.T @ effects)
    _, sizes, right = np.linalg.svd(rest, full_matrices=False)
    return FreeInPlane(_combinations(names, right[sizes < _ALIKE]), _periods(plate))


def _combinations(names: list[str], free: Floats) -> tuple[tuple[str, ...], ...]:
    """Sparse basis of the rows of ``free`` by Gaussian elimination, as names."""
    rows, pivot = free.copy(), 0
    for column in range(rows.shape[1]):
        if pivot == len(rows):
            break
        best = pivot + int(np.argmax(np.abs(rows[pivot:, column])))
        if abs(rows[best, column]) < 0.1:
            continue
        rows[[pivot, best]] = rows[[best, pivot]]
        rows[pivot] /= rows[pivot, column]
        others = np.arange(len(rows)) != pivot
        rows[others] -= np.outer(rows[others, column], rows[pivot])
        pivot += 1
    return tuple(
        tuple(n for n, weight in zip(names, row / np.abs(row).max(), strict=True) if abs(weight) > 0.1) for row in rows
    )


def _periods(plate: PlacedPlate) -> tuple[float | None, float | None]:
    """Common period of the shifts along each axis among placings that are not turned against each other."""
    if np.any(np.abs(plate.turned_deg) > _SQUARE_DEG):
        return None, None
    i, j = (_period(np.unique(np.round(shifts, 1))) for shifts in plate.middles.T)
    return i, j


def _period(shifts: Floats) -> float | None:
    apart = shifts[np.r_[True, np.diff(shifts) > 1.0]]
    return common_period(apart) if len(apart) > 1 else None


def title(name: str) -> Text:
    """A name in words, as of an effect: ``straightness_x_y`` is the straightness of X along Y."""
    return _TITLES[name]
