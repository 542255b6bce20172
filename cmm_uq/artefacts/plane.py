"""Plane: points probed on a flat surface, whose place and tilt are free in each measurement; observed, planned, stated.

The observation is the distance of each point of contact from the plane. A point 0, where there is one, is the direction
point just before contact: it tells on which side the probe was (US 4,866,643 claim 1) and is no observation.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from cmm_uq.analysis.planning.candidates import RelocatedCandidates, VolumeCandidates, across_planes
from cmm_uq.analysis.planning.set_up import Pattern, SetUp
from cmm_uq.analysis.planning.setting import Planning, Setting
from cmm_uq.analysis.screening.shape import ArtefactShape, Screening, flat_misfit, no_references, spread
from cmm_uq.artefacts.kinds import PlaneFacts
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, in_a_row, number, say
from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.base.values import dataclass
from cmm_uq.certificate.document import Block, Column, Section, Table, section, table
from cmm_uq.certificate.plots.residuals import length_plot, residual_volume
from cmm_uq.certificate.result import Page, Result
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.plan import PlanFacts
from cmm_uq.machine.model.artefact import Artefact, ArtefactFigure, Placings
from cmm_uq.machine.model.recorded import place, refuse
from cmm_uq.machine.physics.compensation import DirectionPointError, OffsetPlane, offset_plane
from cmm_uq.maths.inference.linear_model import Freedoms
from cmm_uq.maths.uncertainty.quantity import alike, rounded

DIRECTION_POINT = 0
# points of contact in a measurement: three make a plane (US 4,866,643 claim 1 b), a fourth says something of it
LEAST_POINTS = 3

# extent across over extent along below which points lie on one line and leave the plane free to turn about it
_ON_A_LINE = 1e-3
_DEGREE = 6  # of a surface's form, as of a sphere's


@dataclass(frozen=True, eq=False)
class ProbedPlane:
    measurement: int  # its number
    count: int  # points of contact
    flatness: float | None  # range of the distances from the plane, mm; ``None`` of three points, which have none
    surface: OffsetPlane | None  # the plane moved by the probe's offset; ``None`` without offset


class PlaneSurface(Artefact):
    """A probed plane: an observation for every point of contact.

    ``facts`` what the job says; ``probe_offset_mm`` moves the plane from the probe's centre to the surface, where every
    measurement has a direction point and all of them are believed; ``points`` the recording.
    """

    kind = "plane"
    title = say("Plane")

    def __init__(self, facts: PlaneFacts, points: Points, *, where: str | None = None) -> None:
        self.points = points
        contact = np.flatnonzero(points.point != DIRECTION_POINT)
        self.rows = contact[:, None]
        self.placings = Placings.of(points.measurement[contact])
        self.offset = facts.probe_offset_mm
        self.u_offset = facts.u_probe_offset_um * MICROMETRE
        self.form = (facts.form_um or 0.0) * MICROMETRE
        self.acceptance = float(np.radians(facts.acceptance_deg))
        self._refuse_no_plane(where)
        if self.offset is not None:
            self._refuse_no_side(self.offset, where)
        if not self.form:
            self.exact = ((say("The form of the surface is not stated"), np.ones(len(contact), dtype=bool)),)

    def form_patterns(self) -> Floats:
        """Products of Legendre polynomials of both directions in each plane, of degrees 2 to 6 together."""
        touched = self.points.xyz[self.rows[:, 0]]
        across = np.einsum("ni,nij->nj", touched - self.placings.means(touched), self._axes(touched)[:, :, 1:])
        reach = np.array([np.abs(across[own]).max(axis=0) for own in self.placings.rows])[self.placings.index]
        powers = legendre.legvander(across / reach, _DEGREE)
        chosen = [(i, j) for i in range(_DEGREE + 1) for j in range(_DEGREE + 1) if 2 <= i + j <= _DEGREE]
        return np.column_stack([powers[:, 0, i] * powers[:, 1, j] for i, j in chosen])

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        contact = self.rows[:, 0]
        touched = true_xyz[contact]
        normals = self._axes(touched)[:, :, 0]
        off = np.einsum("ni,ni->n", touched - self.placings.means(touched), normals)
        placed = true_xyz.copy()
        placed[contact] = touched - off[:, None] * normals
        return placed

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        contact = self.rows[:, 0]
        normals = self._axes(xyz[contact])[:, :, 0]
        return np.asarray(np.einsum("ni,nik->nk", normals, displacement[contact]), dtype=np.float64)

    def placing(self, xyz: Floats) -> Freedoms:
        touched = xyz[self.rows[:, 0]]
        about = touched - self.placings.means(touched)
        across = np.einsum("ni,nij->nj", about, self._axes(touched)[:, :, 1:])
        return self.placings.columns(np.column_stack([np.ones(len(touched)), across]))

    def unread(self) -> NDArray[np.bool_]:
        touched = self.points.xyz[self.rows[:, 0]]
        return self.placings.unread(touched, self._axes(touched)[:, :, :1])[:, 0]

    def figures(self, counts: NDArray[np.bool_]) -> Mapping[str, ArtefactFigure]:
        """Flatness of each measurement of four points of contact or more, over all of its repeats."""
        off, contact = self.off_plane(), self.rows[:, 0]
        each = [own for rows in self.placings.rows if len(own := rows[counts[contact[rows]]]) > LEAST_POINTS]
        if not each:
            return {}
        rows = np.array([np.resize(contact[own], len(contact)) for own in each])
        extents = np.array([spread(self.points.xyz[contact[own]]) for own in each])
        return {"flatness": ArtefactFigure(np.array([np.ptp(off[own]) for own in each]), rows, extents)}

    def probed(self, u_point: float) -> tuple[ProbedPlane, ...]:
        """Flatness of each plane, and the surface where the probe's offset is known.

        ``u_point`` standard uncertainty of a point of contact along the normal, mm; it counts where there are just
        three, whose scatter nothing shows.
        """
        found, off = [], self.off_plane()
        for measurement, rows in zip(self.placings.numbers.tolist(), self.placings.rows, strict=True):
            more = len(rows) > LEAST_POINTS
            given = None if more else u_point
            surface = None if self.offset is None else self._surface(measurement, self.offset, given)
            found.append(ProbedPlane(measurement, len(rows), float(np.ptp(off[rows])) if more else None, surface))
        return tuple(found)

    def _surface(self, measurement: int, offset: float, u_point: float | None) -> OffsetPlane:
        """The surface of one measurement; the C1 of a direction point is the lowest point of contact of its own repeat."""
        points, contact = self.points, self.rows[self.measurement == measurement, 0]
        ahead = self._ahead(measurement)
        other = points.repeat[contact] != points.repeat[ahead][:, None]
        first = np.array([np.lexsort((points.repeat[contact], points.point[contact], row))[0] for row in other])
        return offset_plane(
            points.xyz[ahead], points.xyz[contact], offset, first=first, acceptance=self.acceptance,
            u_offset=self.u_offset, u_point=u_point,
        )  # fmt: skip

    def _ahead(self, measurement: int) -> Ints:
        points = self.points
        return np.flatnonzero((points.measurement == measurement) & (points.point == DIRECTION_POINT))

    def _refuse_no_side(self, offset: float, where: str | None) -> None:
        points = self.points
        for measurement in self.placings.numbers:
            ahead = self._ahead(measurement)
            refuse(
                points, (points.measurement == measurement) & (len(ahead) == 0), where,
                f"measurement {measurement} has no direction point (point 0), so that nothing says to which side the "
                "probe's offset goes", "Record a point 0 just before contact, or leave out probe_offset_mm",
            )  # fmt: skip
            try:
                self._surface(measurement, offset, 1.0)  # an angle depends on no uncertainty
            except DirectionPointError as rejected:
                row = np.arange(len(points)) == ahead[rejected.index]
                raise CmmUqError(
                    f"measurement {measurement}: {rejected.problem}", where=place(points, row, where), fix=rejected.fix
                ) from rejected

    def off_plane(self) -> Floats:
        """(n,) distance of each point of contact from its least-squares plane, mm."""
        xyz = self.points.xyz
        return self.project(xyz, (xyz - self.fit(xyz, np.zeros(0)))[:, :, None])[:, 0]

    def _axes(self, touched: Floats) -> Floats:
        """Normal and two directions in the plane, as columns, of each point's placing, (n, 3, 3)."""
        about = touched - self.placings.means(touched)
        _, axes = np.linalg.eigh(self.placings.sums(np.einsum("ni,nj->nij", about, about)))
        normal = axes[:, :, 0]
        largest = np.take_along_axis(normal, np.argmax(np.abs(normal), axis=1)[:, None], axis=1)
        axes[:, :, 0] = normal * np.sign(largest)
        return np.asarray(axes[self.placings.index], dtype=np.float64)

    def _refuse_no_plane(self, where: str | None) -> None:
        points, numbers = self.points, self.placings.numbers
        for measurement in np.setdiff1d(points.measurement, self.measurement):
            fix = "Points of contact are numbered 1, 2, …; point 0 is the direction point"
            refuse(
                points,
                points.measurement == measurement,
                where,
                f"measurement {measurement} has no points of contact",
                fix,
            )
        touched = points.xyz[self.rows[:, 0]]
        about = touched - self.placings.means(touched)
        extents = np.linalg.eigvalsh(self.placings.sums(np.einsum("ni,nj->nij", about, about)))
        few = self.placings.sizes < LEAST_POINTS
        which = int(np.argmax(poor := few | (extents[:, 1] <= _ON_A_LINE**2 * extents[:, 2])))
        count = f"{self.placings.sizes[which]} points of contact are too few"
        problem = f"measurement {numbers[which]}: {count if few[which] else 'all points of contact lie on one line'}"
        rows = (points.measurement == numbers[which]) & poor.any()
        refuse(points, rows, where, problem, f"Record at least {LEAST_POINTS} points spread over the plane")


def shape_of(facts: ArtefactFacts, points: Points) -> ArtefactShape | None:
    """Planes of four points of contact or more, since three always lie in one; ``None`` where there are none."""
    touched = points.point != DIRECTION_POINT
    rows = tuple(np.flatnonzero(touched & (points.measurement == m)) for m in np.unique(points.measurement[touched]))
    rows = tuple(r for r in rows if len(r) > LEAST_POINTS)
    if not rows:
        return None
    extent = float(np.median([spread(points.xyz[r]) for r in rows]))
    return ArtefactShape(rows, flat_misfit, np.nan, extent, False, (), no_references(points))


SCREENING = Screening(shape_of)


def surface(facts: ArtefactFacts, plan: PlanFacts, size: Floats) -> Pattern:
    """A grid of points of contact over ``size`` (2,) mm; with a probe offset also the point just before the first contact."""
    columns, rows = plan.grid
    offset = cast("PlaneFacts", facts).probe_offset_mm
    i, j = np.meshgrid(np.linspace(-0.5, 0.5, columns), np.linspace(-0.5, 0.5, rows))
    touched = np.column_stack([i.ravel() * size[0], j.ravel() * size[1], np.zeros(i.size)])
    number = np.arange(1, len(touched) + 1)
    if offset is not None:
        before = touched[:1] + np.array([0.0, 0.0, 4 * offset])
        touched = np.vstack([before, touched])
        number = np.concatenate([[0], number])
    return Pattern(touched, number, np.ones(len(touched), dtype=np.int64)).repeated(plan.repeats)


def surface_places(setting: Setting) -> tuple[SetUp, ...]:
    """A grid over the lower face of the volume."""
    pattern = surface(setting.artefact, setting.plan, setting.volume.size[:2])
    return (setting.volume.set_up(pattern, np.eye(3), (0.5, 0.5, 0.0), say("flat")),)


def _pattern(setting: Setting) -> Pattern:
    return surface(setting.artefact, setting.plan, np.full(2, 0.5 * setting.volume.size.min()))


_PLACES = VolumeCandidates(across_planes, _pattern, RelocatedCandidates(across_planes))
PLANNING = Planning({"surface plate": surface_places}, _PLACES.candidates, _PLACES.elsewhere)


def _planes(result: Result) -> tuple[ProbedPlane, ...]:
    return cast("PlaneSurface", result.artefact).probed(result.noise.coordinate.value * MICROMETRE)


def _expanded(surface: OffsetPlane, factor: float) -> tuple[float, float]:
    """U of a surface's position along the normal, mm, and of the least certain component of the normal."""
    across = factor * float(np.sqrt(surface.normal @ surface.covariance[:3, :3] @ surface.normal))
    return across, factor * float(np.sqrt(np.diag(surface.covariance)[3:].max()))


def _surface_data(surface: OffsetPlane | None, factor: float) -> dict[str, Any] | None:
    if surface is None:
        return None
    across, of_normal = _expanded(surface, factor)
    return {
        "point_mm": surface.point.tolist(), "normal": surface.normal.tolist(),
        "normal_reversed": surface.reversed, "approach_deg": float(np.degrees(surface.angle)),
        "U_across_um": across / MICROMETRE, "U_normal": of_normal, "k": factor,
        "covariance": {
            "parameters": ["x_mm", "y_mm", "z_mm", "nx", "ny", "nz"], "units": ["mm"] * 3 + ["1"] * 3,
            "matrix": surface.covariance.tolist(),
        },
    }  # fmt: skip


def results(result: Result) -> dict[str, Any]:
    planes = []
    for plane in _planes(result):
        flatness = None if plane.flatness is None else plane.flatness / MICROMETRE
        surface = _surface_data(plane.surface, result.noise.coverage_factor)
        planes.append(
            {"measurement": plane.measurement, "points": plane.count, "flatness_um": flatness, "surface": surface}
        )
    return {"planes": planes}


def sections(result: Result) -> list[Section]:
    plane, probed = cast("PlaneSurface", result.artefact), _planes(result)
    volume = residual_volume(result, say("points"))
    return [
        section(
            say("The plane"), _flatness(result, probed), _surfaces(result, probed), _by_point(result, plane), volume
        )
    ]


def _flatness(result: Result, probed: tuple[ProbedPlane, ...]) -> Table | None:
    noise = result.noise.coordinate.value
    rows = (
        (
            number(one.measurement),
            number(one.count),
            say("–") if one.flatness is None else rounded(one.flatness / MICROMETRE, noise)[0],
        )
        for one in probed
    )
    note = say("Flatness: range of the distances from the least-squares plane, of surface, machine and probe together.")
    heads = (say("Measurement"), Column(say("Points")), Column(say("Flatness"), unit("µm")))
    return table(say("Flatness as recorded"), heads, rows, note)


def _surfaces(result: Result, probed: tuple[ProbedPlane, ...]) -> Table | None:
    rows: list[tuple[Text, ...]] = []
    for one in probed:
        if (surface := one.surface) is None:
            continue
        across, of_normal = _expanded(surface, result.noise.coverage_factor)
        place = in_a_row(rounded(float(v), across)[0] for v in surface.point)
        normal = in_a_row(rounded(float(v), max(of_normal, 2e-9))[0] for v in surface.normal)
        U = rounded(0.0, across / MICROMETRE)[1]
        rows.append((number(one.measurement), place, normal, U, number(float(np.degrees(surface.angle)), ".0f")))
    columns = (
        say("Measurement"), Column(say("Point of the surface"), unit("mm"), numeric=False), say("Outward normal"),
        Column(say("U across"), unit("µm")), Column(say("Approach"), unit("°")),
    )  # fmt: skip
    note = say(
        "The plane of the probe's centre, moved by the probe's offset against the normal that points to where the probe came "
        "from (US 4,866,643, claim 1). U (k = {k}) of the surface's position along the normal, at its middle.",
        k=number(result.noise.coverage_factor, ".2f"),
    )
    return table(say("Surface, compensated for the probe's offset"), columns, rows, note)


def _by_point(result: Result, plane: PlaneSurface) -> Block:
    off, residuals = plane.off_plane() / MICROMETRE, result.residuals / MICROMETRE
    low, high, low_after, high_after = alike(off.min(), off.max(), residuals.min(), residuals.max())
    return length_plot(
        plane.points.point[plane.rows[:, 0]], off, residuals, expanded_before_um=result.noise.expanded,
        reference=say("least-squares plane"), flagged=result.flagged, position_label=say("Point on the plane"),
        caption=say(
            "Distance of each point from its plane, as recorded and after the fitted model, with U (k = {k}).",
            k=number(result.noise.coverage_factor, ".2f"),
        ),
        alternative=say(
            "{count} points: as recorded they lie {low} to {high} µm from their plane; after the "
            "fitted model {low_after} to {high_after} µm remain.",
            count=len(off), low=low, high=high, low_after=low_after, high_after=high_after,
        ),
    )  # fmt: skip


PAGE = Page(sections, results)
