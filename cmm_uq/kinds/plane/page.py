"""What a certificate shows of a probed plane: flatness, the surface beneath the probe, residuals."""

from __future__ import annotations

from typing import cast

import numpy as np

from cmm_uq.documents.document import Block, Column, Section, Table
from cmm_uq.documents.outcome import Page
from cmm_uq.documents.plots import length_plot
from cmm_uq.documents.residual_volume import flagged, residual_volume
from cmm_uq.documents.result import Result
from cmm_uq.kinds.plane.observe import PlaneSurface, ProbedPlane
from cmm_uq.uncertainty.rounding import rounded
from cmm_uq.units import MICROMETRE


def sections(result: Result) -> list[Section]:
    """Flatness and surface of each plane, deviations by point, residuals in the volume."""
    plane = cast("PlaneSurface", result.artefact)
    probed = plane.probed()
    blocks: list[Block] = [_flatness(result, probed), _by_point(result, plane), residual_volume(result, "points")]
    if any(one.surface is not None for one in probed):
        blocks.insert(1, _surfaces(probed))
    return [Section("The plane", tuple(blocks))]


def _flatness(result: Result, probed: tuple[ProbedPlane, ...]) -> Table:
    noise = result.noise.coordinate.value
    rows = tuple((str(one.measurement), str(one.count), rounded(one.flatness / MICROMETRE, noise)[0]) for one in probed)
    columns = (Column("Measurement", numeric=False), Column("Points"), Column("Flatness", "µm"))
    note = "Flatness: range of the distances from the least-squares plane, of surface, machine and probe together."
    return Table("Flatness as recorded", columns, rows, (note,))


def _surfaces(probed: tuple[ProbedPlane, ...]) -> Table:
    rows = []
    for one in probed:
        if one.surface is None:
            continue
        surface = one.surface
        u = np.sqrt(np.diag(surface.covariance))
        across = float(np.sqrt(surface.normal @ surface.covariance[:3, :3] @ surface.normal))
        place = ", ".join(rounded(float(v), 2 * across)[0] for v in surface.point)
        normal = ", ".join(rounded(float(v), 2 * float(max(u[3:].max(), 1e-9)))[0] for v in surface.normal)
        U = rounded(0.0, 2 * across / MICROMETRE)[1]
        rows.append((str(one.measurement), place, normal, U, f"{np.degrees(surface.angle):.0f}"))
    columns = (
        Column("Measurement", numeric=False), Column("Point of the surface", "mm", numeric=False),
        Column("Outward normal", numeric=False), Column("U across", "µm"), Column("Approach", "°"),
    )  # fmt: skip
    notes = (
        "The plane of the probe's centre, moved by the probe's offset against the normal that points to where the probe came "
        "from (US 4,866,643, claim 1). U (k = 2) of the surface's position along the normal, at its middle.",
    )
    return Table("Surface, compensated for the probe's offset", columns, tuple(rows), notes)


def _by_point(result: Result, plane: PlaneSurface) -> Block:
    xyz = plane.points.xyz
    off = plane.project(xyz, (xyz - plane.fit(xyz, np.zeros(0)))[:, :, None])[:, 0] / MICROMETRE
    residuals, expanded = result.residuals / MICROMETRE, 2 * result.noise.coordinate.value
    return length_plot(
        plane.points.point[plane.rows[:, 0]], off, residuals, expanded_before_um=expanded, expanded_after_um=expanded,
        reference="least-squares plane", flagged=flagged(result), position_label="Point on the plane",
        caption="Distance of each point from its plane, as recorded and after the fitted model, with U (k = 2).",
        alternative=(
            f"{len(off)} points: as recorded they lie {off.min():.1f} to {off.max():.1f} µm from their plane; after the "
            f"fitted model {residuals.min():.1f} to {residuals.max():.1f} µm remain."
        ),
    )  # fmt: skip


PAGE = Page(sections)
