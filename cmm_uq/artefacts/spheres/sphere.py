"""Sphere: points probed on a ball, whose centre is free in each measurement (ISO 10360-5); observed, planned, stated.

A sphere without a certified diameter cannot tell an error of the effective stylus radius from its own size.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.planning.candidates import MIDDLE, RelocatedCandidates, VolumeCandidates, upright
from cmm_uq.analysis.planning.set_up import Pattern, SetUp, planned_length
from cmm_uq.analysis.planning.setting import Planning, Setting
from cmm_uq.analysis.screening import shape
from cmm_uq.analysis.screening.shape import ArtefactShape, Misfit, Screening
from cmm_uq.artefacts.kinds import SphereFacts
from cmm_uq.base.messages import Number, Text, number, say
from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import Plot, Section, Table, columns, figure_columns
from cmm_uq.certificate.plots.residuals import deviations_plot, volume_plot
from cmm_uq.certificate.result import Page, Result
from cmm_uq.certificate.wording import numbered
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.plan import PlanFacts
from cmm_uq.machine.model.artefact import ArtefactFigure, Forms, Placings, Size
from cmm_uq.machine.model.artefact_doubt import form_faults
from cmm_uq.machine.model.placed import Radial
from cmm_uq.machine.model.recorded import expansion
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.effects.own_states import HARMONICS, NORMAL, harmonics, turned_back
from cmm_uq.maths.geometry import fit_sphere
from cmm_uq.maths.geometry.fits import enclosing_diameter
from cmm_uq.maths.uncertainty.quantity import alike, rounded

_OF_FORM = (*HARMONICS, *((6, order) for order in range(-6, 7)))  # probes have two to six lobes


class SphereArtefact(Radial):
    """A probed sphere: ``length_mm`` is its diameter.

    ``facts`` what the job says of the sphere; ``points`` the recording, with ``nx, ny, nz`` where they are known.
    ``form`` form deviation of the ball by its certificate, mm; 0 when it is not given.
    """

    kind = "sphere"
    title = say("Sphere")
    per_size = 0.5
    size_title = say("Diameter of the sphere")
    size_what = say("diameter")
    plural = "the diameters of the recorded spheres"

    def __init__(self, facts: SphereFacts, points: Points, *, where: str | None = None) -> None:
        super().__init__(facts, points, Placings.of(points.measurement), expansion(facts, points), where)
        self._facts = facts
        self.form = (facts.form_um or 0.0) * MICROMETRE
        self.take_normals(where)
        if not self.form:
            self.exact = ((say("The form of the sphere is not stated"), np.ones(len(points), dtype=bool)),)

    def form_patterns(self) -> Floats:
        return harmonics(self.directions(self.points.xyz), turned_back(self.points), _OF_FORM)

    def own_faults(self) -> Iterable[Effect]:
        return form_faults(self._facts, self._facts.form_um, self.points)

    def forms(self) -> Forms:
        """Of the least-squares sphere of each (measurement, repeat) (ISO 10360-5:2010, P_Form and P_Size)."""
        points, runs, size = self.points, Placings.of(self.points.group), self.sizes[0]
        balls = [fit_sphere(points.xyz[rows], u_point=1.0) for rows in runs.rows]
        expanded = np.array([float(self.expansion[rows].mean()) for rows in runs.rows])
        first = [rows[0] for rows in runs.rows]
        diameter = np.array([2 * ball.radius for ball in balls]) / expanded
        return Forms(
            points.measurement[first], points.repeat[first], runs.sizes, np.array([ball.form_deviation for ball in balls]),
            self.form, self.directions(points.xyz), diameter - size.nominal if size.certified else None,
            np.array([ball.centre for ball in balls]),
        )  # fmt: skip

    def figures(self, counts: NDArray[np.bool_]) -> Mapping[str, ArtefactFigure]:
        """Diameter of the smallest sphere about the centres of all repeats of each place, as orientations of an arm."""
        points, centres = self.points, self.forms().centres
        of = np.array([rows[0] for rows in points.rows_of_groups])
        own = counts[of]
        each = [np.flatnonzero(own & (points.measurement[of] == number)) for number in np.unique(points.measurement)]
        each = [groups for groups in each if len(groups) > 1 and centres is not None]
        if centres is None or not each:
            return {}
        rows = np.array([np.resize(np.flatnonzero(np.isin(points.group, groups)), len(points)) for groups in each])
        values = np.array([enclosing_diameter(centres[groups]) for groups in each])
        return {"L_Dia": ArtefactFigure(values, rows, np.full(len(each), self.sizes[0].nominal))}


_NORMAL = 0.4  # part of the radius by which a recorded normal may miss the point: normals may be nominal, 20° off


def shape_of(facts: ArtefactFacts, points: Points) -> ArtefactShape | None:
    return round_shape(facts, points, (5, 0.5), shape.ball_misfit, ball_with_normals)


def round_shape(
    facts: ArtefactFacts, points: Points, least: tuple[int, float], misfit: Misfit, with_normals: Misfit
) -> ArtefactShape | None:
    """What has a diameter, with normals where they are recorded; ``None`` where one has too few points.

    ``least``: points of one, and its radius over the spread of its points.
    """
    rows, radius, (fewest, part) = shape.rows_by(points.measurement), (facts.length_mm or np.nan) / 2, least
    if any(len(r) < fewest for r in rows):
        return None
    extent = radius if np.isfinite(radius) else part * float(np.median([shape.spread(points.xyz[r]) for r in rows]))
    if not all(name in points.columns for name in NORMAL):
        return ArtefactShape(rows, misfit, radius, extent, False, (), shape.no_references(points))
    normals = np.column_stack([points.columns[name] for name in NORMAL])
    return ArtefactShape(rows, with_normals, radius, extent, False, NORMAL, normals)


def ball_with_normals(xyz: Floats, normals: Floats, radius: float) -> Floats:
    """Each normal says where the centre lies; their median does not follow a few."""
    if np.isnan(radius):
        i, j = shape.samples_of(len(xyz), 2).T
        steps = normals[j] - normals[i]
        squares = np.sum(steps**2, axis=1)
        if not np.any(wide := squares > 0.5 * squares.max()):
            return np.zeros(len(xyz))
        radius = float(np.median(np.sum((xyz[j] - xyz[i]) * steps, axis=1)[wide] / squares[wide]))
    away = xyz - np.median(xyz - radius * normals, axis=0)
    away, radius = shape.recentred(away, radius, free=False)  # nominal normals put it astray
    misses = np.linalg.norm(away - radius * normals, axis=1) - _NORMAL * abs(radius)
    return np.asarray(np.maximum(np.abs(np.linalg.norm(away, axis=1) - radius), misses), dtype=np.float64)


SCREENING = Screening(shape_of)


# points over a hemisphere: degrees from the pole, how many, degrees turned. The usual twenty-five of ISO 10360-5
RINGS = ((0.0, 1, 0.0), (22.5, 4, 0.0), (45.0, 8, 22.5), (67.5, 4, 0.0), (90.0, 8, 22.5))


def sphere(facts: ArtefactFacts, plan: PlanFacts) -> Pattern:
    """Twenty-five points over the upper hemisphere, each probed along its normal."""
    normals = []
    for down, count, turn in RINGS:
        polar = np.radians(down)
        azimuth = np.radians(turn) + 2 * np.pi * np.arange(count) / count
        ring = [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.full(count, np.cos(polar))]
        normals.append(np.column_stack(ring))
    n = np.vstack(normals)
    return probed_along(0.5 * planned_length(facts, plan) * n, n, plan)


def probed_along(places: Floats, normals: Floats, plan: PlanFacts) -> Pattern:
    """Points (n, 3), each probed against its normal."""
    numbers, along = np.arange(1, len(places) + 1), -np.where(np.abs(normals) > 1e-9, normals, 0.0)
    one = Pattern(places, numbers, np.ones(len(places), dtype=np.int64), {}, {"normal": normals, "approach": along})
    return one.repeated(plan.repeats)


def sphere_places(setting: Setting) -> tuple[SetUp, ...]:
    return (setting.volume.set_up(sphere(setting.artefact, setting.plan), np.eye(3), MIDDLE, say("in the middle")),)


_PLACES = VolumeCandidates(
    upright, lambda setting: sphere(setting.artefact, setting.plan), RelocatedCandidates(lambda volume: [])
)
PLANNING = Planning({"ISO 10360-5": sphere_places}, _PLACES.candidates, _PLACES.elsewhere)


def results(result: Result) -> dict[str, Any]:
    return {"spheres": probed_data(cast("SphereArtefact", result.artefact).forms(), "form_error_um", "size_error_um")}


def probed_data(forms: Forms, *errors: str) -> list[dict[str, Any]]:
    """Of everything probed its numbers, how many points, its form and the error of its size, µm, by their names."""
    sizes = [None] * len(forms.form) if forms.size is None else (forms.size / MICROMETRE).tolist()
    each = (forms.measurement.tolist(), forms.repeat.tolist(), forms.count.tolist(), (forms.form / MICROMETRE).tolist())
    names = ("measurement", "repeat", "points", *errors)
    return [dict(zip(names, one, strict=True)) for one in zip(*each, sizes, strict=True)]


def sections(result: Result) -> list[Section]:
    sphere = cast("SphereArtefact", result.artefact)
    blocks = (_table(result, sphere), _by_point(result, sphere), _over(result, sphere))
    return [Section(say("Probing of the sphere"), blocks)]


def _table(result: Result, sphere: SphereArtefact) -> Table:
    note = say("Form error: range of the radial distances from the least-squares sphere (ISO 10360-5:2010).")
    of_size = say(
        "Size error: diameter of the least-squares sphere minus the certified one, whose U is {u} µm (k = 2).",
        u=u_of_size(sphere.sizes[0]),
    )
    heads, notes = (say("Sphere"), say("Form error"), say("Size error")), (note, of_size)
    return probed_table(result, sphere.forms(), say("Probing errors"), heads, notes)


def u_of_size(size: Size) -> Number:
    return rounded(0.0, 2 * size.sd / MICROMETRE)[1] if 0 < size.sd < np.inf else Number("0")


def probed_table(
    result: Result, forms: Forms, caption: Text, headings: tuple[Text, Text, Text], notes: tuple[Text, Text]
) -> Table:
    """Of everything probed its number, how many points, its form and, where it is certified, the error of its size, µm.

    ``headings``: of what is probed, of form and of size; ``notes``: on these two.
    """
    noise, (what, *errors) = result.noise.expanded, headings
    shown = 1 if forms.size is None else 2
    repeated, least = forms.repeat.max() > 1, max(forms.certified / MICROMETRE, noise / 10)
    rows: list[tuple[Text, ...]] = []
    for i, measurement in enumerate(forms.measurement):
        place = numbered(measurement, forms.repeat[i] if repeated else None)
        error = () if forms.size is None else (rounded(float(forms.size[i]) / MICROMETRE, noise)[0],)
        rows.append((place, number(forms.count[i]), rounded(float(forms.form[i]) / MICROMETRE, least)[0], *error))
    figures = figure_columns(*errors[:shown], unit=unit("µm"))
    heads = columns([what, *figure_columns(say("Points")), *figures])
    return Table(caption, heads, tuple(rows), notes[:shown])


def _by_point(result: Result, sphere: SphereArtefact) -> Plot:
    """Distance of each point from its best centre minus the certified or mean radius."""
    caption = say(
        "Distance from the centre minus {name}, as recorded and after the fitted model, with U (k = {k}).",
        name=radius_words(sphere),
        k=number(result.noise.coverage_factor, ".2f"),
    )
    return radial_plot(result, sphere, caption, say("Point on the sphere"), sphere.points.point)


def radius_words(artefact: Radial) -> Text:
    return say("certified radius") if artefact.sizes[0].certified else say("mean radius")


def radial_plot(result: Result, artefact: Radial, caption: Text, label: Text, position: Floats | Ints) -> Plot:
    size, xyz, name = artefact.sizes[0], artefact.points.xyz, radius_words(artefact)
    radius = size.nominal * artefact.per_size * artefact.expansion
    deviations = np.asarray((artefact.distances(xyz, None) - radius) / MICROMETRE, dtype=np.float64)
    what = say("{count} points: as recorded they deviate", count=len(deviations))
    return deviations_plot(
        result,
        deviations,
        what,
        say("from the {name}", name=name),
        position=position,
        reference=name,
        reference_expanded_um=size.sd / MICROMETRE if size.certified else 0.0,
        position_label=label,
        caption=caption,
    )


def _over(result: Result, sphere: SphereArtefact) -> Plot:
    """Residuals at the places of the points about their centres, on the sphere of the nominal size."""
    residuals = result.residuals / MICROMETRE
    places = sphere.size_change() * sphere.sizes[0].nominal * sphere.directions(sphere.points.xyz)
    low, high = alike(residuals.min(), residuals.max())
    caption = say("Residuals after the fitted model over the sphere (all spheres, about their centres).")
    projections = say("Three projections of the sphere; residuals of {low} to {high} µm.", low=low, high=high)
    return volume_plot(places, residuals, caption=caption, alternative=projections)


PAGE = Page(sections, results)
