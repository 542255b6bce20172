"""What the certificate of a probed plane states beside the estimates: flatness, and the surface beneath the probe."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from cmm_uq.artefacts.plane.observe import PlaneSurface, ProbedPlane
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE
from cmm_uq.certificate.result import Result
from cmm_uq.machine.physics.compensation import OffsetPlane


@dataclass(frozen=True, eq=False)
class PlaneFigures:
    """One plane with what is uncertain of its surface."""

    probed: ProbedPlane
    coverage_factor: float

    @property
    def flatness_um(self) -> float | None:
        """Range of the distances from the least-squares plane, µm; ``None`` of three points, which have none."""
        return None if self.probed.flatness is None else self.probed.flatness / MICROMETRE

    @property
    def surface(self) -> SurfaceFigures | None:
        """Of the compensated surface, where there is one."""
        return None if self.probed.surface is None else SurfaceFigures(self.probed.surface, self.coverage_factor)

    def as_data(self) -> dict[str, Any]:
        """For results.json."""
        surface = self.surface
        return {
            "measurement": self.probed.measurement, "points": self.probed.count, "flatness_um": self.flatness_um,
            "surface": None if surface is None else surface.as_data(),
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class SurfaceFigures:
    """A compensated surface with its uncertainty; k is that of the noise."""

    surface: OffsetPlane
    coverage_factor: float

    @property
    def expanded_across(self) -> float:
        """U of its position along the normal, mm."""
        normal = self.surface.normal
        return self.coverage_factor * float(np.sqrt(normal @ self.surface.covariance[:3, :3] @ normal))

    @property
    def expanded_normal(self) -> float:
        """U of the least certain component of the normal."""
        return self.coverage_factor * float(np.sqrt(np.diag(self.surface.covariance)[3:].max()))

    @property
    def angle_deg(self) -> float:
        """Between the normal and the direction of approach, degrees."""
        return float(np.degrees(self.surface.angle))

    def as_data(self) -> dict[str, Any]:
        """For results.json."""
        surface = self.surface
        return {
            "point_mm": surface.point.tolist(), "normal": surface.normal.tolist(),
            "normal_reversed": surface.reversed, "approach_deg": self.angle_deg,
            "U_across_um": self.expanded_across / MICROMETRE, "U_normal": self.expanded_normal, "k": self.coverage_factor,
            "covariance": {
                "parameters": ["x_mm", "y_mm", "z_mm", "nx", "ny", "nz"], "units": ["mm"] * 3 + ["1"] * 3,
                "matrix": surface.covariance.tolist(),
            },
        }  # fmt: skip


def figures(result: Result) -> tuple[PlaneFigures, ...]:
    """Of each plane of a result."""
    plane, noise = cast("PlaneSurface", result.artefact), result.noise.coordinate.value * MICROMETRE
    return tuple(PlaneFigures(one, result.noise.coverage_factor) for one in plane.probed(noise))


def results(result: Result) -> dict[str, Any]:
    """The same for results.json."""
    return {"planes": [one.as_data() for one in figures(result)]}


def off_plane_um(plane: PlaneSurface) -> Floats:
    """(n,) distance of each point of contact from its least-squares plane, µm."""
    return plane.off_plane() / MICROMETRE
