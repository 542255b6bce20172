"""What the certificate of a digitizer states beside the estimates: the offset, where it comes from, and a second way to it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np

from cmm_uq.artefacts.digitizer.attitudes import ANGLES, worst_direction
from cmm_uq.artefacts.digitizer.observe import OFFSET, Digitizer
from cmm_uq.artefacts.digitizer.plan import THREE
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.results.plain import quantity_data
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.machine.physics.digitizer import three_alignment_offset
from cmm_uq.maths.uncertainty.quantity import Quantity

_SAME_ATTITUDE = 0.01
"""Degrees within which an attitude is one of the source's three."""


@dataclass(frozen=True, eq=False)
class Pose:
    """One attitude, aligned by itself.

    Parameters
    ----------
    measurement : number.
    angles_deg : (3,) α, β, γ.
    points : recorded in it.
    reading_mm : (3,) [D0 E0 F0].
    off_um : (3,) that reading minus the one that the result gives, µm.
    rms_um : root mean square of its residuals, µm; ``None`` where none of its observations are used.
    """

    measurement: int
    angles_deg: Floats
    points: int
    reading_mm: Floats
    off_um: Floats
    rms_um: float | None


@dataclass(frozen=True, eq=False)
class DigitizerFigures:
    """All of these of a result."""

    result: Result

    @property
    def digitizer(self) -> Digitizer:
        """With its recording."""
        return cast("Digitizer", self.result.artefact)

    @property
    def offset(self) -> tuple[Quantity, ...]:
        """U1, V1, W1, mm."""
        return tuple(self.result.sizes[f"{name}_mm"] for name in OFFSET)

    @cached_property
    def covariance(self) -> Floats:
        """(3, 3) of U1, V1, W1, mm²."""
        columns = [i for i, u in enumerate(self.result.posterior.unknowns) if u.key[0] == ARTEFACT][:3]
        return np.cov(self.result.values[:, columns], rowvar=False)

    @property
    def correlation(self) -> Floats:
        """(3, 3) of U1, V1, W1."""
        u = np.sqrt(np.diag(self.covariance))
        return np.asarray(self.covariance / np.outer(u, u))

    @cached_property
    def sphere(self) -> tuple[float, ...]:
        """Centre of the reference sphere in the recorded frame, mm."""
        values = self.result.values.mean(axis=0)
        model, digitizer = self.result.model, self.digitizer
        count = len(digitizer.sizes)
        return tuple(digitizer.centre(model.placed(values), values[len(values) - count :]).tolist())

    @cached_property
    def times(self) -> tuple[Floats, float]:
        """The direction that the attitudes tell least of, and its uncertainty in those of one centre."""
        return worst_direction(self.digitizer.alignments)

    @cached_property
    def poses(self) -> tuple[Pose, ...]:
        """Every attitude."""
        digitizer, found = self.digitizer, []
        offset = np.array([one.value for one in self.offset])
        used = self.result.model.used
        for i, (number, one) in enumerate(zip(digitizer.poses.numbers.tolist(), digitizer.alignments, strict=True)):
            of_it = (digitizer.measurement == number) & used
            residuals = self.result.residuals[of_it] / MICROMETRE
            rows = digitizer.poses.index == i
            angles = np.array([float(digitizer.points.columns[name][rows][0]) for name in ANGLES])
            off = (one.reading - one.attitude @ offset - self.sphere) / MICROMETRE
            rms = float(np.sqrt(np.mean(residuals**2))) if len(residuals) else None
            found.append(Pose(number, angles, int(rows.sum()), one.reading, off, rms))
        return tuple(found)

    @cached_property
    def closed_form(self) -> Floats | None:
        """(3,) offset by the source's eq. 19–21, mm; ``None`` where the attitudes are not its three."""
        order = []
        for wanted in THREE:
            turned = [np.abs((pose.angles_deg - wanted + 180) % 360 - 180).max() for pose in self.poses]
            if min(turned) > _SAME_ATTITUDE:
                return None
            order.append(int(np.argmin(turned)))
        return three_alignment_offset(np.array([self.poses[i].reading_mm for i in order]), np.zeros(3))[0]


def results(result: Result) -> Mapping[str, Any]:
    """For results.json; ``cmm-uq compensate`` reads offset, covariance and poses back."""
    found = DigitizerFigures(result)
    closed, start = found.closed_form, found.digitizer.start
    direction, times = found.times
    return {
        "digitizer": {
            "offset_mm": {name: quantity_data(one) for name, one in zip(OFFSET, found.offset, strict=True)},
            "covariance_mm2": found.covariance.tolist(),
            "correlation": found.correlation.tolist(),
            "sphere_mm": list(found.sphere),
            "poses": [
                {"pose": pose.measurement, **dict(zip(ANGLES, pose.angles_deg.tolist(), strict=True)),
                 "reading_mm": pose.reading_mm.tolist(), "off_um": pose.off_um.tolist(), "rms_um": pose.rms_um,
                 "points": pose.points}
                for pose in found.poses
            ],
            "by_centres_mm": start.offset.tolist(),
            "closed_form_mm": None if closed is None else closed.tolist(),
            "least_determined": {"direction_uvw": direction.tolist(), "u_over_u_of_a_centre": times},
        }
    }  # fmt: skip
