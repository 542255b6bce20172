"""What the certificate of a probed plane states and shows beside the estimates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from cmm_uq.artefacts.plane.observe import PlaneSurface, ProbedPlane
from cmm_uq.base.messages import Text, in_a_row, number, say
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import Block, Column, Section, Table
from cmm_uq.certificate.outcome import Page
from cmm_uq.certificate.plots.residuals import length_plot, residual_volume
from cmm_uq.certificate.result import Result
from cmm_uq.machine.physics.compensation import OffsetPlane
from cmm_uq.maths.uncertainty.quantity import alike, rounded


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
        return None if self.probed.surface is None else SurfaceFigures(self.probed.surface, self.coverage_factor)

    def as_data(self) -> dict[str, Any]:
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
        return float(np.degrees(self.surface.angle))

    def as_data(self) -> dict[str, Any]:
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
    plane, noise = cast("PlaneSurface", result.artefact), result.noise.coordinate.value * MICROMETRE
    return tuple(PlaneFigures(one, result.noise.coverage_factor) for one in plane.probed(noise))


def results(result: Result) -> dict[str, Any]:
    return {"planes": [one.as_data() for one in figures(result)]}


def off_plane_um(plane: PlaneSurface) -> Floats:
    """(n,) distance of each point of contact from its least-squares plane, µm."""
    return plane.off_plane() / MICROMETRE


def sections(result: Result) -> list[Section]:
    plane = cast("PlaneSurface", result.artefact)
    probed = figures(result)
    blocks: list[Block] = [_flatness(result, probed), _by_point(result, plane), residual_volume(result, say("points"))]
    if any(one.surface is not None for one in probed):
        blocks.insert(1, _surfaces(result, probed))
    return [Section(say("The plane"), tuple(blocks))]


def _flatness(result: Result, probed: tuple[PlaneFigures, ...]) -> Table:
    noise = result.noise.coordinate.value
    rows = tuple(
        (
            number(one.probed.measurement),
            number(one.probed.count),
            (say("–") if one.flatness_um is None else rounded(one.flatness_um, noise)[0]),
        )
        for one in probed
    )
    columns = (Column(say("Measurement"), numeric=False), Column(say("Points")), Column(say("Flatness"), unit("µm")))
    note = say("Flatness: range of the distances from the least-squares plane, of surface, machine and probe together.")
    return Table(say("Flatness as recorded"), columns, rows, (note,))


def _surfaces(result: Result, probed: tuple[PlaneFigures, ...]) -> Table:
    rows: list[tuple[Text, ...]] = []
    for one in probed:
        if (found := one.surface) is None:
            continue
        across, surface = found.expanded_across, found.surface
        place = in_a_row(rounded(float(v), across)[0] for v in surface.point)
        normal = in_a_row(rounded(float(v), max(found.expanded_normal, 2e-9))[0] for v in surface.normal)
        U = rounded(0.0, across / MICROMETRE)[1]
        rows.append((number(one.probed.measurement), place, normal, U, number(found.angle_deg, ".0f")))
    columns = (
        Column(say("Measurement"), numeric=False),
        Column(say("Point of the surface"), unit("mm"), numeric=False),
        Column(say("Outward normal"), numeric=False),
        Column(say("U across"), unit("µm")),
        Column(say("Approach"), unit("°")),
    )
    notes = (
        say(
            "The plane of the probe's centre, moved by the probe's offset against the normal that points "
            "to where the probe came from (US 4,866,643, claim 1). U (k = {k}) of the surface's position "
            "along the normal, at its middle.",
            k=number(result.noise.coverage_factor, ".2f"),
        ),
    )
    return Table(say("Surface, compensated for the probe's offset"), columns, tuple(rows), notes)


def _by_point(result: Result, plane: PlaneSurface) -> Block:
    off = off_plane_um(plane)
    residuals, expanded = result.residuals / MICROMETRE, result.noise.expanded
    low, high, low_after, high_after = alike(off.min(), off.max(), residuals.min(), residuals.max())
    return length_plot(
        plane.points.point[plane.rows[:, 0]],
        off,
        residuals,
        expanded_before_um=expanded,
        expanded_after_um=expanded,
        reference=say("least-squares plane"),
        flagged=result.flagged,
        position_label=say("Point on the plane"),
        caption=say(
            "Distance of each point from its plane, as recorded and after the fitted model, with U (k = {k}).",
            k=number(result.noise.coverage_factor, ".2f"),
        ),
        alternative=say(
            "{count} points: as recorded they lie {low} to {high} µm from their plane; after the "
            "fitted model {low_after} to {high_after} µm remain.",
            count=len(off),
            low=low,
            high=high,
            low_after=low_after,
            high_after=high_after,
        ),
    )


PAGE = Page(sections, results)
