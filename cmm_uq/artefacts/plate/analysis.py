"""What the certificate of a plate states beside the estimates: how far balls lie off, what looks like a common scale."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from cmm_uq.artefacts.plate.observe import Plate
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE, PPM, unit
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.results.plain import quantity_data
from cmm_uq.machine.physics.effects.rigid_body import SCALE
from cmm_uq.maths.uncertainty.quantity import Quantity

STEEL = 11.5e-6
"""Expansion of a plate whose own is not stated, 1/K."""


@dataclass(frozen=True)
class Spread:
    """Coordinates of one placing, before and after the fitted model, µm: root mean square, and largest."""

    measurement: int
    count: int
    rms_before_um: float
    largest_before_um: float
    rms_after_um: float
    largest_after_um: float


@dataclass(frozen=True, eq=False)
class Arrows:
    """Balls of one placing in the plane of the plate, repeats averaged.

    Parameters
    ----------
    measurement : its number.
    axes : (2,) of the plate, that the plane is spanned by.
    place : (b, 2) reference positions, mm.
    before, after : (b, 2) displacements, µm.
    """

    measurement: int
    axes: tuple[int, int]
    place: Floats
    before: Floats
    after: Floats


@dataclass(frozen=True)
class CommonScale:
    """The common part of the scales between two dates, and the change of temperature of the plate that looks the same."""

    change: Quantity
    cte_per_k: float
    warmer: Quantity

    @property
    def colder(self) -> bool:
        """Whether it is a plate that was colder, or has shrunk, that looks so."""
        return self.change.value > 0


@dataclass(frozen=True, eq=False)
class PlateFigures:
    """Every placing in numbers, as arrows where that is asked for, and the common scale between two dates."""

    spread: tuple[Spread, ...]
    before_um: Floats
    after_um: Floats
    common: CommonScale | None


def figures(result: Result) -> PlateFigures:
    """Of a result; ``before_um`` and ``after_um`` are (n, 3) in the plate's own axes and the machine's."""
    plate = cast("Plate", result.artefact)
    before = np.einsum("nij,ni->nj", plate.attitudes(plate.points.xyz), plate.deviations()) / MICROMETRE
    after = result.residuals.reshape(-1, 3) / MICROMETRE
    spread = []
    for number in plate.placings.numbers:
        chosen = plate.points.measurement == number
        sizes = [
            float(value)
            for values in (before[chosen], after[chosen])
            for value in (np.sqrt(np.mean(values**2)), np.abs(values).max())
        ]
        spread.append(Spread(int(number), int(chosen.sum()), *sizes))
    return PlateFigures(tuple(spread), before, after, _common(result) if compared(result) else None)


def compared(result: Result) -> bool:
    """Whether the references are an earlier recording of the plate itself."""
    return result.job.facts.recording.earlier is not None


def arrows(plate: Plate, found: PlateFigures, number: int) -> Arrows:
    """One placing as arrows; the two largest extents of the references span the plane."""
    rows = plate.points.measurement == number
    axes = np.sort(np.argsort(np.ptp(plate.reference, axis=0))[1:])
    balls, index = np.unique(plate.points.point[rows], return_inverse=True)
    counts = np.bincount(index)[:, None]

    def mean(values: Floats) -> Floats:
        sums = np.zeros((len(balls), 2))
        np.add.at(sums, index, values[rows][:, axes])
        return sums / counts

    i, j = (int(axis) for axis in axes)
    return Arrows(int(number), (i, j), mean(plate.reference), mean(found.before_um), mean(found.after_um))


def results(result: Result) -> dict[str, Any]:
    """The same for results.json."""
    found = figures(result)
    data: dict[str, Any] = {
        "placings": [
            {"measurement": one.measurement, "balls": one.count, "rms_before_um": one.rms_before_um,
             "largest_before_um": one.largest_before_um, "rms_after_um": one.rms_after_um,
             "largest_after_um": one.largest_after_um}
            for one in found.spread
        ]
    }  # fmt: skip
    if found.common is not None:
        common = found.common
        data["common_scale"] = {
            "ppm": quantity_data(common.change), "cte_per_k": common.cte_per_k,
            "plate_warmer_by_k": quantity_data(common.warmer),
        }  # fmt: skip
    return data


def _common(result: Result) -> CommonScale | None:
    scales = [effect.name for effect in SCALE.values() if effect.name in result.parameters]
    if not scales:
        return None
    columns = {unknown.key[0]: i for i, unknown in enumerate(result.posterior.unknowns)}
    draws = result.values[:, [columns[name] for name in scales]].mean(axis=1)
    cte = result.job.facts.artefact.cte_per_k or STEEL
    change = Quantity.of_draws(draws, unit("ppm"))
    return CommonScale(change, cte, change.times(-PPM / cte, unit("K")))
