"""What the certificate of a test sphere states and shows beside the estimates."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from cmm_uq.artefacts.sphere.observe import SphereArtefact
from cmm_uq.base.messages import Number, Text, number, say
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import Column, Plot, Section, Table
from cmm_uq.certificate.outcome import Page
from cmm_uq.certificate.plots.residuals import length_plot, volume_plot
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.wording import deviating, numbered
from cmm_uq.maths.uncertainty.quantity import alike, rounded


def deviations_um(sphere: SphereArtefact) -> Floats:
    """(n,) distance of each point from its best centre minus the certified or mean radius, µm."""
    radius = sphere.sizes[0].nominal * sphere.per_size * sphere.expansion
    return np.asarray((sphere.distances(sphere.points.xyz, None) - radius) / MICROMETRE, dtype=np.float64)


def about_centre(sphere: SphereArtefact) -> Floats:
    """(n, 3) places of the points about their centres, on the sphere of the nominal size, mm."""
    return np.asarray(
        sphere.size_change() * sphere.sizes[0].nominal * sphere.directions(sphere.points.xyz), dtype=np.float64
    )


def results(result: Result) -> dict[str, Any]:
    """Form and size errors for results.json."""
    sphere = cast("SphereArtefact", result.artefact)
    probed, certified = sphere.probed(), sphere.sizes[0].certified
    return {
        "spheres": [
            {"measurement": int(measurement), "repeat": int(repeat), "points": int(count), "form_error_um": form,
             "size_error_um": size if certified else None}
            for measurement, repeat, count, form, size in zip(
                probed.measurement, probed.repeat, probed.count, (probed.form / MICROMETRE).tolist(),
                (probed.size / MICROMETRE).tolist(), strict=True,
            )
        ]
    }  # fmt: skip


def sections(result: Result) -> list[Section]:
    sphere = cast("SphereArtefact", result.artefact)
    return [
        Section(
            say("Probing of the sphere"), (_table(result, sphere), _by_point(result, sphere), _over(result, sphere))
        )
    ]


def _table(result: Result, sphere: SphereArtefact) -> Table:
    probed, size = sphere.probed(), sphere.sizes[0]
    noise = result.noise.expanded
    repeated = probed.repeat.max() > 1
    rows: list[tuple[Text, ...]] = []
    for i, measurement in enumerate(probed.measurement):
        place = numbered(measurement, probed.repeat[i] if repeated else None)
        form = rounded(float(probed.form[i]) / MICROMETRE, max(sphere.form / MICROMETRE, noise / 10))[0]
        row: list[Text] = [place, number(probed.count[i]), form]
        if size.certified:
            row.append(rounded(float(probed.size[i]) / MICROMETRE, noise)[0])
        rows.append(tuple(row))
    columns = [Column(say("Sphere"), numeric=False), Column(say("Points")), Column(say("Form error"), unit("µm"))]
    notes = [say("Form error: range of the radial distances from the least-squares sphere (ISO 10360-5:2010).")]
    if size.certified:
        columns.append(Column(say("Size error"), unit("µm")))
        u = rounded(0.0, 2 * size.sd / MICROMETRE)[1] if size.sd else Number("0")
        notes.append(
            say(
                "Size error: diameter of the least-squares sphere minus the certified one, whose U is {u} µm (k = 2).",
                u=u,
            )
        )
    return Table(say("Probing errors"), tuple(columns), tuple(rows), tuple(notes))


def _by_point(result: Result, sphere: SphereArtefact) -> Plot:
    size = sphere.sizes[0]
    deviations = deviations_um(sphere)
    residuals, expanded = result.residuals / MICROMETRE, result.noise.expanded
    name = say("certified radius") if size.certified else say("mean radius")
    return length_plot(
        sphere.points.point,
        deviations,
        residuals,
        expanded_before_um=expanded,
        expanded_after_um=expanded,
        reference=name,
        reference_expanded_um=size.sd / MICROMETRE if size.certified else 0.0,
        flagged=result.flagged,
        position_label=say("Point on the sphere"),
        caption=say(
            "Distance from the centre minus {name}, as recorded and after the fitted model, with U (k = {k}).",
            name=name,
            k=number(result.noise.coverage_factor, ".2f"),
        ),
        alternative=deviating(
            say("{count} points: as recorded they deviate", count=len(deviations)),
            say("from the {name}", name=name), deviations, residuals,
        ),
    )  # fmt: skip


def _over(result: Result, sphere: SphereArtefact) -> Plot:
    residuals = result.residuals / MICROMETRE
    low, high = alike(residuals.min(), residuals.max())
    return volume_plot(
        about_centre(sphere),
        residuals,
        caption=say("Residuals after the fitted model over the sphere (all spheres, about their centres)."),
        alternative=say(
            "Three projections of the sphere; residuals of {low} to {high} µm.",
            low=low,
            high=high,
        ),
    )


PAGE = Page(sections, results)
