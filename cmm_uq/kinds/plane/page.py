"""What a certificate shows of a probed plane: flatness, the surface beneath the probe, residuals."""

from __future__ import annotations

from typing import cast

from cmm_uq.documents.document import Block, Column, Section, Table
from cmm_uq.documents.outcome import Page
from cmm_uq.documents.plots import length_plot
from cmm_uq.documents.residual_volume import residual_volume
from cmm_uq.documents.result import Result
from cmm_uq.kinds.plane.analysis import PlaneFigures, figures, off_plane_um, results
from cmm_uq.kinds.plane.observe import PlaneSurface
from cmm_uq.uncertainty.rounding import rounded
from cmm_uq.units import MICROMETRE


def sections(result: Result) -> list[Section]:
    """Flatness and surface of each plane, deviations by point, residuals in the volume."""
    plane = cast("PlaneSurface", result.artefact)
    probed = figures(result)
    blocks: list[Block] = [_flatness(result, probed), _by_point(result, plane), residual_volume(result, "points")]
    if any(one.surface is not None for one in probed):
        blocks.insert(1, _surfaces(probed))
    return [Section("The plane", tuple(blocks))]


def _flatness(result: Result, probed: tuple[PlaneFigures, ...]) -> Table:
    noise = result.noise.coordinate.value
    rows = tuple(
        (
            str(one.probed.measurement),
            str(one.probed.count),
            "–" if one.flatness_um is None else rounded(one.flatness_um, noise)[0],
        )
        for one in probed
    )
    columns = (Column("Measurement", numeric=False), Column("Points"), Column("Flatness", "µm"))
    note = "Flatness: range of the distances from the least-squares plane, of surface, machine and probe together."
    return Table("Flatness as recorded", columns, rows, (note,))


def _surfaces(probed: tuple[PlaneFigures, ...]) -> Table:
    rows = []
    for one in probed:
        if (found := one.surface) is None:
            continue
        across, surface = found.expanded_across, found.surface
        place = ", ".join(rounded(float(v), across)[0] for v in surface.point)
        normal = ", ".join(rounded(float(v), max(found.expanded_normal, 2e-9))[0] for v in surface.normal)
        U = rounded(0.0, across / MICROMETRE)[1]
        rows.append((str(one.probed.measurement), place, normal, U, f"{found.angle_deg:.0f}"))
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
    off = off_plane_um(plane)
    residuals, expanded = result.residuals / MICROMETRE, 2 * result.noise.coordinate.value
    return length_plot(
        plane.points.point[plane.rows[:, 0]], off, residuals, expanded_before_um=expanded, expanded_after_um=expanded,
        reference="least-squares plane", flagged=result.flagged, position_label="Point on the plane",
        caption="Distance of each point from its plane, as recorded and after the fitted model, with U (k = 2).",
        alternative=(
            f"{len(off)} points: as recorded they lie {off.min():.1f} to {off.max():.1f} µm from their plane; after the "
            f"fitted model {residuals.min():.1f} to {residuals.max():.1f} µm remain."
        ),
    )  # fmt: skip


PAGE = Page(sections, results)
