"""What a certificate shows of a probed plane: flatness, the surface beneath the probe, residuals."""

from __future__ import annotations

from typing import cast

from cmm_uq.artefacts.plane.analysis import PlaneFigures, figures, off_plane_um, results
from cmm_uq.artefacts.plane.observe import PlaneSurface
from cmm_uq.base.messages import Text, in_a_row, number, say
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import Block, Column, Section, Table
from cmm_uq.certificate.outcome import Page
from cmm_uq.certificate.plots.residuals import length_plot, residual_volume
from cmm_uq.certificate.result import Result
from cmm_uq.maths.uncertainty.quantity import alike, rounded


def sections(result: Result) -> list[Section]:
    """Flatness and surface of each plane, deviations by point, residuals in the volume."""
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
