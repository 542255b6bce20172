"""What a certificate shows of a probed sphere: form and size of each, and the radial deviations."""

from __future__ import annotations

from typing import cast

from cmm_uq.documents.document import Column, Plot, Section, Table
from cmm_uq.documents.outcome import Page
from cmm_uq.documents.plots import length_plot, volume_plot
from cmm_uq.documents.result import Result
from cmm_uq.kinds.sphere.analysis import about_centre, deviations_um, results
from cmm_uq.kinds.sphere.observe import Sphere
from cmm_uq.uncertainty.rounding import rounded
from cmm_uq.units import MICROMETRE


def sections(result: Result) -> list[Section]:
    """Form and size (ISO 10360-5), radial deviations by point, residuals over the sphere."""
    sphere = cast("Sphere", result.artefact)
    return [
        Section("Probing of the sphere", (_table(result, sphere), _by_point(result, sphere), _over(result, sphere)))
    ]


def _table(result: Result, sphere: Sphere) -> Table:
    probed, size = sphere.probed(), sphere.sizes[0]
    noise = 2 * result.noise.coordinate.value
    repeated = probed.repeat.max() > 1
    rows = []
    for i, number in enumerate(probed.measurement):
        place = f"{number}" + (f" ({probed.repeat[i]})" if repeated else "")
        form = rounded(float(probed.form[i]) / MICROMETRE, max(sphere.form / MICROMETRE, noise / 10))[0]
        row = [place, str(probed.count[i]), form]
        if size.certified:
            row.append(rounded(float(probed.size[i]) / MICROMETRE, noise)[0])
        rows.append(tuple(row))
    columns = [Column("Sphere", numeric=False), Column("Points"), Column("Form error", "µm")]
    notes = ["Form error: range of the radial distances from the least-squares sphere (ISO 10360-5:2010)."]
    if size.certified:
        columns.append(Column("Size error", "µm"))
        u = rounded(0.0, 2 * size.sd / MICROMETRE)[1] if size.sd else "0"
        notes.append(
            f"Size error: diameter of the least-squares sphere minus the certified one, whose U is {u} µm (k = 2)."
        )
    return Table("Probing errors", tuple(columns), tuple(rows), tuple(notes))


def _by_point(result: Result, sphere: Sphere) -> Plot:
    size = sphere.sizes[0]
    deviations = deviations_um(sphere)
    residuals, expanded = result.residuals / MICROMETRE, 2 * result.noise.coordinate.value
    name = "certified radius" if size.certified else "mean radius"
    return length_plot(
        sphere.points.point, deviations, residuals, expanded_before_um=expanded, expanded_after_um=expanded,
        reference=name, reference_expanded_um=size.sd / MICROMETRE if size.certified else 0.0, flagged=result.flagged,
        position_label="Point on the sphere",
        caption=f"Distance from the centre minus {name}, as recorded and after the fitted model, with U (k = 2).",
        alternative=(
            f"{len(deviations)} points: as recorded they deviate by {deviations.min():.1f} to {deviations.max():.1f} µm "
            f"from the {name}; after the fitted model {residuals.min():.1f} to {residuals.max():.1f} µm remain."
        ),
    )  # fmt: skip


def _over(result: Result, sphere: Sphere) -> Plot:
    residuals = result.residuals / MICROMETRE
    return volume_plot(
        about_centre(sphere), residuals,
        caption="Residuals after the fitted model over the sphere (all spheres, about their centres).",
        alternative=f"Three projections of the sphere; residuals of {residuals.min():.1f} to {residuals.max():.1f} µm.",
    )  # fmt: skip


PAGE = Page(sections, results)
