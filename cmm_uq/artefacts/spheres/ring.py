"""Ring: points probed around a cylinder, whose axis is free in each measurement; a setting ring, or a plug gauge.

A point observes its distance from the axis. Free are the place of the axis across itself and, where points lie at several
heights, its tilt; of a section at one height the axis is across that. With the certified diameter all points together show
the effective size of the tip; two lobes are the machine's axes in the plane of the ring, more are the probe's.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cached_property, partial
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.planning.candidates import (
    MIDDLE,
    RelocatedCandidates,
    VolumeCandidates,
    across_planes,
    check_allowed,
)
from cmm_uq.analysis.planning.set_up import PRINCIPAL_PLANES, Pattern, SetUp, planned_length
from cmm_uq.analysis.planning.setting import Planning, Setting
from cmm_uq.analysis.screening import shape
from cmm_uq.analysis.screening.shape import ArtefactShape, Screening
from cmm_uq.artefacts.spheres.kind import RingFacts
from cmm_uq.artefacts.spheres.sphere import (
    ball_with_normals,
    probed_along,
    probed_data,
    probed_table,
    radial_plot,
    radius_words,
    round_shape,
    u_of_size,
)
from cmm_uq.base.messages import Text, number, say
from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.base.units import ARCSECOND, MICROMETRE, PPM, unit
from cmm_uq.certificate.document import Section, Table, columns, figure_columns
from cmm_uq.certificate.result import Page, Result
from cmm_uq.certificate.wording import numbered
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.plan import PlanFacts
from cmm_uq.machine.model.artefact import ArtefactFigure, Forms, Indications, Placings, figures_of_errors
from cmm_uq.machine.model.artefact_doubt import form_faults
from cmm_uq.machine.model.placed import Radial
from cmm_uq.machine.model.recorded import expansion, refuse
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.effects.own_states import OUT_OF_ROUND, ROUNDNESS, about_axis, lobes_about, turned_back
from cmm_uq.maths.geometry.axial import axis_minimum
from cmm_uq.maths.geometry.feature import centred, frame_about, upward
from cmm_uq.maths.inference.linear_model import Freedoms
from cmm_uq.maths.uncertainty.quantity import rounded

LEAST_POINTS, LEAST_OF_HEIGHTS = 4, 6  # of a section, and where the tilt of the axis is free too
# extent along the axis over that across it below which points are a section: their normal is across it within a mrad, by
# which a ring of 50 mm seems larger by 25 nm; heights as small show a tilt no better
SECTION = 5e-3
_LINE = 0.02  # extent across a line over that along it below which no arc shows its centre
_NO_RING = 0.02  # part of the radius by which half of the points of no ring are off
_STEPS, _SETTLED = 30, 1e-12


class RingGauge(Radial):
    """A probed ring: ``length_mm`` is its diameter.

    ``points`` the recording, with ``nx, ny, nz`` where they are known, towards the axis of a ring, away from that of a plug.
    """

    kind = "ring"
    title = say("Ring gauge")
    per_size = 0.5
    size_title = say("Diameter of the ring")
    size_what = say("diameter")
    plural = "the diameters of the recorded rings"
    normal_words = ("the material", "across the axis", ", or say with plug whether it is probed from outside")

    def __init__(self, facts: RingFacts, points: Points, *, where: str | None = None) -> None:
        self._facts, self.outward = facts, 1.0 if facts.plug else -1.0
        super().__init__(facts, points, Placings.of(points.measurement), expansion(facts, points), where)
        self.form = (facts.form_um or 0.0) * MICROMETRE
        distance = self.distances(points.xyz, None)
        for measurement, rows in zip(self.centred.numbers, self.centred.rows, strict=True):
            off = np.abs(distance[rows] / np.median(distance[rows]) - 1)
            own, fix = (
                points.measurement == measurement,
                "Record points all around it, or mend [artefact] kind in job.toml",
            )
            problem = f"measurement {measurement}: its points do not lie around one cylinder"
            refuse(points, own & (np.median(off) > _NO_RING), where, problem, fix)
        self.take_normals(where)
        size = self.sizes[0]
        if facts.one_direction and size.certified:
            # of even lobes alone a diameter swings by the form deviation, of unknown phase (JCGM 101:2008, 6.4.6.4)
            self.sizes = (replace(size, sd=float(np.hypot(size.sd, self.form / np.sqrt(2.0)))),)
        if not self.form:
            self.exact = ((say("The form of the ring is not stated"), np.ones(len(points), dtype=bool)),)

    def away(self, xyz: Floats, size: float | None) -> Floats:
        """Of every point from its axis, across it, by least squares; without a size each axis has a distance of its own.

        Gauss–Newton on place, tilt and distance of all axes at once; the inverse leaves out what moves an axis along itself.
        """
        of, tilts = self.centred.index, self._tilts[self.centred.index]
        point, about = self.centred.sums(xyz) / self.centred.sizes[:, None], xyz - self.centred.means(xyz)
        flat = np.linalg.eigh(self.centred.sums(np.einsum("ni,nj->nij", about, about)))[1][:, :, 0]
        axis = np.where(self._tilts[:, None] > 0, self._frames[:, 2], flat)
        radii = self.expansion * self._start if size is None else self._radii(size)
        for _ in range(_STEPS):
            about = xyz - point[of]
            along = np.einsum("ni,ni->n", about, axis[of])
            away = about - along[:, None] * axis[of]
            distance = np.linalg.norm(away, axis=1)
            out = away / np.maximum(distance, 1e-9)[:, None]
            parts = [
                out,
                (tilts * along / self._start)[:, None] * out,
                *([self.expansion[:, None]] if size is None else []),
            ]
            rows = np.hstack(parts)
            normal = np.linalg.pinv(self.centred.sums(np.einsum("ni,nj->nij", rows, rows)), 1e-10, hermitian=True)
            step = np.einsum("qij,qj->qi", normal, self.centred.sums((distance - radii)[:, None] * rows))
            point, axis = point + step[:, :3], axis + step[:, 3:6] / self._start
            axis /= np.linalg.norm(axis, axis=1, keepdims=True)
            if size is None:
                radii = radii + self.expansion * step[of, 6]
            if np.abs(step).max() < _SETTLED * self._start:
                break
        return np.asarray(away)

    def placing(self, xyz: Floats) -> Freedoms:
        across = np.einsum("ni,nji->nj", self.directions(xyz), self._frames[self.centred.index, :2])
        along = np.einsum("ni,ni->n", xyz - self.centred.means(xyz), self._frames[self.centred.index, 2])
        return self.centred.columns(np.hstack([across, (self._tilts[self.centred.index] * along)[:, None] * across]))

    def form_patterns(self) -> Floats:
        directions = self.directions(self.points.xyz)
        return lobes_about(about_axis(directions, self.measurement) - turned_back(self.points))

    def own_faults(self) -> Iterable[Effect]:
        return form_faults(self._facts, self._facts.form_um, self.points, None, OUT_OF_ROUND)

    @cached_property
    def probed(self) -> tuple[Forms, Floats]:
        """Of the least-squares circle or cylinder of each (measurement, repeat), and lobes (q, 10) of its distances.

        Cosine and sine of each number of lobes, mm; nan where there are too few points for them.
        """
        points, size, of = self.points, self.sizes[0], self._runs
        runs, free = Placings.of(of), self._facts.model_copy(update={"length_mm": None, "u_um": None})
        each = RingGauge(free, replace(points, measurement=of))
        distance, angle = each.distances(points.xyz, None) / self.expansion, about_axis(each.directions(points.xyz), of)
        lobes = np.full((len(runs.rows), 2 * len(ROUNDNESS)), np.nan)
        for found, rows in zip(lobes, runs.rows, strict=True):
            shown = 2 * max(0, min(len(ROUNDNESS), (len(rows) - 4) // 2))
            waves = np.column_stack([np.ones(len(rows)), np.cos(angle[rows]), np.sin(angle[rows])])
            waves = np.hstack([waves, lobes_about(angle[rows])[:, :shown] / np.sqrt(2.0)])
            found[:shown] = np.linalg.lstsq(waves, distance[rows], rcond=None)[0][3:]
        first = [rows[0] for rows in runs.rows]
        form, mean = np.array([[np.ptp(distance[rows]), distance[rows].mean()] for rows in runs.rows]).T
        error = 2 * mean - size.nominal if size.certified else None
        out = self.outward * self.directions(points.xyz)
        return Forms(points.measurement[first], points.repeat[first], runs.sizes, form, self.form, out, error), lobes

    @property
    def _runs(self) -> Ints:
        """(n,) numbers of repeats, each probed all around; of measurements where one is too short for that."""
        least = LEAST_OF_HEIGHTS if self._tilts.any() else LEAST_POINTS
        return self.points.group if min(map(len, self.points.rows_of_groups)) >= least else self.points.measurement

    def figures(self, counts: NDArray[np.bool_]) -> Mapping[str, ArtefactFigure]:
        """Error of the diameter and roundness of every ring."""
        forms, size = self.probed[0], self.sizes[0]
        rings = Placings.of(self._runs).rows
        each = [i for i, rows in enumerate(rings) if counts[rows].all()]
        if not each:
            return {}
        rows = np.array([np.resize(rings[i], int(forms.count[each].max())) for i in each])
        length, u = np.full(len(each), size.nominal), np.full(len(each), size.sd)
        figures = {"roundness": ArtefactFigure(forms.form[each], rows, length)}
        if forms.size is not None:
            figures |= figures_of_errors(Indications(forms.size[each], length, u, rows))
        return figures

    def _refuse_flat(self, where: str | None) -> None:
        """Refuse points that determine no axis; where each lies, and whether its tilt is free."""
        points, placings = self.points, self.centred
        self._frames, self._tilts = np.empty((len(placings.numbers), 3, 3)), np.zeros(len(placings.numbers))
        for i, rows in enumerate(placings.rows):
            about, _, _ = centred(points.xyz[rows])
            extents, axes = np.linalg.svd(about.T, full_matrices=True)[1:]
            own, whose = np.isin(np.arange(len(points)), rows), f"measurement {placings.numbers[i]}: {len(rows)} points"
            fix = f"Record at least {LEAST_POINTS} all around the ring, at several heights {LEAST_OF_HEIGHTS}"
            refuse(points, own & (len(rows) < LEAST_POINTS), where, f"{whose} are too few for a ring", fix)
            refuse(
                points, own & (extents[1] <= _LINE * extents[0]), where, f"{whose} lie on one line or in one place", fix
            )
            axis = axes[2]
            if extents[2] > SECTION * extents[0]:
                refuse(
                    points, own & (len(rows) < LEAST_OF_HEIGHTS), where, f"{whose} at several heights are too few", fix
                )
                self._tilts[i] = 1.0
                axis = axis_minimum(about, "cylinder", tapered=False).state.frame[2]
            self._frames[i] = frame_about(upward(axis))
        across = np.einsum("ni,nji->nj", points.xyz - placings.means(points.xyz), self._frames[placings.index, :2])
        self._start = float(np.sqrt(np.mean(np.sum(across**2, axis=1))))


def shape_of(facts: RingFacts, points: Points) -> ArtefactShape | None:
    with_normals = partial(_ring_with_normals, sense=1.0 if facts.plug else -1.0)
    return round_shape(facts, points, (LEAST_OF_HEIGHTS, 0.4), _section_misfit, with_normals)


def _ring_with_normals(xyz: Floats, normals: Floats, radius: float, sense: float) -> Floats:
    """Each normal says where the axis lies, and all of them how: heights along it count for nothing."""
    across = np.linalg.svd(normals.T @ normals)[2].T * [1, 1, 0]
    return ball_with_normals(xyz @ across, sense * normals @ across, radius)


def _section_misfit(xyz: Floats, _: Floats, radius: float) -> Floats:
    """From the circle of most points; nothing where they do not lie in one plane."""
    flat = shape.flat_misfit(xyz, _, radius)
    near = flat <= shape.TOLERANCE_MM
    if np.mean(near) < 0.5:
        return np.zeros(len(xyz))
    about = xyz - xyz[near].mean(axis=0)
    local = about @ np.linalg.svd(about[near], full_matrices=False)[2].T * [1, 1, 0]
    sides = np.column_stack([2 * local[:, :2], np.ones(len(local))])
    centre = np.linalg.lstsq(sides[near], np.sum(local[near] ** 2, axis=1), rcond=None)[0] * [1, 1, 0]
    distance, free = np.linalg.norm(local - centre, axis=1), bool(np.isnan(radius))
    away, nearest = shape.recentred(local - centre, float(np.median(distance)) if free else radius, free=free)
    return np.asarray(np.maximum(np.abs(np.linalg.norm(away, axis=1) - nearest), flat))


SCREENING = Screening(shape_of)
POINTS = 25  # around, as many as of a test sphere; an odd number tells all lobes below twelve from each other


def around() -> Floats:
    """(n, 2) directions evenly around."""
    turn = 2 * np.pi * (np.arange(POINTS) + 0.5) / POINTS
    return np.column_stack([np.cos(turn), np.sin(turn)])


def ring(facts: ArtefactFacts, plan: PlanFacts) -> Pattern:
    """Points around at one height, each probed along its normal."""
    out = np.column_stack([around(), np.zeros(POINTS)])
    return probed_along(0.5 * planned_length(facts, plan) * out, out if cast("RingFacts", facts).plug else -out, plan)


def _placed(setting: Setting, ways: tuple[tuple[Text, Floats], ...]) -> tuple[SetUp, ...]:
    pattern = ring(setting.artefact, setting.plan)
    for _, way in ways:
        check_allowed(setting, way[:, 2])
    return tuple(setting.volume.set_up(pattern, way, MIDDLE, title) for title, way in ways)


_PLACES = VolumeCandidates(
    across_planes, lambda setting: ring(setting.artefact, setting.plan), RelocatedCandidates(across_planes)
)
_READY = {
    "ring": lambda setting: _placed(setting, PRINCIPAL_PLANES[:1]),
    "ring in three planes": lambda setting: _placed(setting, PRINCIPAL_PLANES),
}
PLANNING = Planning(_READY, _PLACES.candidates, _PLACES.elsewhere)


def results(result: Result) -> dict[str, Any]:
    forms, lobes = cast("RingGauge", result.artefact).probed
    rings = probed_data(forms, "roundness_um", "diameter_error_um")
    for one, own in zip(rings, lobes / MICROMETRE, strict=True):
        pairs = zip(ROUNDNESS, own.reshape(-1, 2).tolist(), strict=True)
        one["lobes"] = [
            {"lobes": k, "amplitude_um": float(np.hypot(a, b)), "cosine_um": a, "sine_um": b}
            for k, (a, b) in pairs
            if a == a
        ]
    return {"rings": rings}


def sections(result: Result) -> list[Section]:
    ring = cast("RingGauge", result.artefact)
    caption = say(
        "Distance from the axis minus {name}, as recorded and after the fitted model, with U (k = {k}).",
        name=radius_words(ring),
        k=number(result.noise.coverage_factor, ".2f"),
    )
    plot = radial_plot(result, ring, caption, say("Point around the ring"), ring.points.point)
    return [Section(say("Probing of the ring"), (_table(result, ring), _lobes(result, ring), plot))]


def _table(result: Result, ring: RingGauge) -> Table:
    note = say("Roundness: range of the distances from the least-squares axis, of ring, machine and probe together.")
    of_size = say(
        "Error of the diameter: of the least-squares ring minus the certified one, whose U is {u} µm (k = 2).",
        u=u_of_size(ring.sizes[0]),
    )
    heads, notes = (say("Ring"), say("Roundness"), say("Error of the diameter")), (note, of_size)
    return probed_table(result, ring.probed[0], say("Diameter and roundness"), heads, notes)


def _lobes(result: Result, ring: RingGauge) -> Table:
    forms, lobes = ring.probed
    noise, repeated = result.noise.expanded / 10, forms.repeat.max() > 1
    amplitudes = np.hypot(*np.moveaxis(lobes.reshape(len(lobes), -1, 2), 2, 0)) / MICROMETRE
    rows = [
        (
            numbered(measurement, repeat if repeated else None),
            *(rounded(float(one), noise)[0] if np.isfinite(one) else say("–") for one in own),
        )
        for measurement, repeat, own in zip(forms.measurement, forms.repeat, amplitudes, strict=True)
    ]
    radius = 0.5 * ring.sizes[0].nominal
    note = say(
        "Amplitudes of the waves around the ring. Of the machine two lobes of 1 µm are scales of the two axes in its plane "
        "that differ by {ppm} ppm, an angle between them that is off by {seconds}″, or play; three are mostly the probe's. "
        "The ring's own form is in all of them, and turns with it.",
        ppm=number(2 * MICROMETRE / radius / PPM, ".3g"),
        seconds=number(2 * MICROMETRE / radius / ARCSECOND, ".3g"),
    )
    titles = [say("{count} lobes", count=k) for k in ROUNDNESS]
    heads = columns([say("Ring"), *figure_columns(*titles, unit=unit("µm"))])
    return Table(say("Roundness by lobes"), heads, tuple(rows), (note,))


PAGE = Page(sections, results)
