"""Distances by a laser tracker: a kind of measurement for cmm_uq from a package of its own.

A reflector on the ram is read at two places; a tracker in line with both says how far it moved, in the column ``tracker_mm``.
"""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.planning.candidates import (
    MIDDLE,
    PatternFor,
    RelocatedCandidates,
    VolumeCandidates,
    along_lines,
    check_allowed,
)
from cmm_uq.analysis.planning.set_up import Pattern, SetUp, attitude_along, direction_words, planned_length
from cmm_uq.analysis.planning.setting import Planning, Setting
from cmm_uq.analysis.screening import shape as screening
from cmm_uq.base.files.table import Uncertainty
from cmm_uq.base.messages import number, say
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import METRE, MICROMETRE, unit
from cmm_uq.certificate.document import Column, Section, Table
from cmm_uq.certificate.outcome import Page
from cmm_uq.certificate.result import Result
from cmm_uq.jobs.tables.artefact import ReferencedFacts
from cmm_uq.machine.model.artefact import Artefact, Size
from cmm_uq.machine.model.kind import Kind
from cmm_uq.machine.model.recorded import columns_needed

COLUMN = "tracker_mm"


class TrackerFacts(ReferencedFacts):
    """The tracker's wavelength adds to ``u_um``; editors and pages show the sentence below the key."""

    u_um_per_m: Uncertainty = 0.0
    """Standard uncertainty of the tracker's wavelength."""


class TrackerLength(Artefact):
    """m distances of 2m points; their direction and place cancel, the tracker's scale is common to all."""

    kind = "tracker_length"
    title = say("Laser tracker")

    def __init__(self, facts: TrackerFacts, points: Points, *, where: str | None = None) -> None:
        self.points = points
        self.rows = np.lexsort((points.point, points.group)).reshape(-1, 2)
        first = self.rows[:, 0]
        self.measurement, self.repeat = points.measurement[first], points.repeat[first]
        self.reference = columns_needed(points, (COLUMN,), "laser tracker", where)[first, 0]
        self.noise_scale = np.full(len(first), np.sqrt(2.0))
        longest = facts.length_mm or float(self.reference.max())
        u = MICROMETRE * float(np.hypot(facts.u_um or 0.0, facts.u_um_per_m * longest / METRE))
        self.sizes = (
            Size(
                "length_mm", say("Longest distance of the tracker"), unit("mm"), longest, np.inf if facts.nominal else u
            ),
        )

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        """See :meth:`Artefact.fit`: same middle, same direction, the tracker's distance."""
        wanted = self.reference * sizes[0] / self.sizes[0].nominal
        half, middle = 0.5 * wanted[:, None] * self._directions(true_xyz), true_xyz[self.rows].mean(axis=1)
        placed = true_xyz.copy()
        placed[self.rows[:, 0]], placed[self.rows[:, 1]] = middle - half, middle + half
        return placed

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        """See :meth:`Artefact.project`: relative displacement along the beam."""
        relative = displacement[self.rows[:, 1]] - displacement[self.rows[:, 0]]
        return np.asarray(np.einsum("mi,mik->mk", self._directions(xyz), relative))

    def size_change(self) -> Floats:
        """See :meth:`Artefact.size_change`."""
        return np.asarray((self.reference / self.sizes[0].nominal)[:, None])

    def deviations(self) -> Floats:
        """Indicated minus the tracker's distance, (m,) mm."""
        return np.asarray(np.linalg.norm(np.diff(self.points.xyz[self.rows], axis=1)[:, 0], axis=1) - self.reference)

    def _directions(self, xyz: Floats) -> Floats:
        steps = xyz[self.rows[:, 1]] - xyz[self.rows[:, 0]]
        return np.asarray(steps / np.linalg.norm(steps, axis=1, keepdims=True))


def shape_of(facts: TrackerFacts, points: Points) -> screening.ArtefactShape | None:
    """Pairs of points as far apart as the tracker says."""
    rows = screening.rows_by(points.group)
    if COLUMN not in points.columns or any(sorted(points.point[pair]) != [1, 2] for pair in rows):
        return None
    reference = points.columns[COLUMN][:, None]
    return screening.ArtefactShape(rows, _misfit, np.nan, float(reference.max()), True, (COLUMN,), reference)


def _misfit(xyz: Floats, reference: Floats, _: float) -> Floats:
    return np.full(2, abs(float(np.linalg.norm(xyz[1] - xyz[0]) - reference[0, 0])))


def pattern(length: float, repeats: int) -> Pattern:
    """Both ends of one distance."""
    ends = np.array([[-0.5 * length, 0.0, 0.0], [0.5 * length, 0.0, 0.0]])
    one = Pattern(ends, np.array([1, 2]), np.ones(2, dtype=np.int64), {COLUMN: np.full(2, length)})
    return one.repeated(repeats)


def tracker_lines(setting: Setting) -> tuple[SetUp, ...]:
    """Three axes, six face diagonals and four space diagonals through the middle of the volume."""
    length, repeats, found = planned_length(setting.artefact, setting.plan), setting.plan.repeats, []
    signs = [(x, y, z) for x in (0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) > (0, 0, 0)]
    for direction in np.array(signs, dtype=np.float64):
        check_allowed(setting, direction)
        attitude = attitude_along(direction)
        found.append(setting.volume.set_up(pattern(length, repeats), attitude, MIDDLE, direction_words(direction)))
    return tuple(found)


def _shape(setting: Setting) -> PatternFor:
    return lambda attitude: pattern(planned_length(setting.artefact, setting.plan), setting.plan.repeats)


def sections(result: Result) -> list[Section]:
    """Every distance, as recorded and after the fitted model."""
    found, residuals = result.artefact, result.residuals / MICROMETRE
    assert isinstance(found, TrackerLength)
    rows = tuple(
        (number(measurement), number(distance, ".4f"), number(deviation / MICROMETRE, ".1f"), number(residual, ".1f"))
        for measurement, distance, deviation, residual in zip(
            found.measurement, found.reference, found.deviations(), residuals, strict=True
        )
    )
    columns = (
        Column(say("Measurement")), Column(say("Tracker"), unit("mm")), Column(say("Deviation"), unit("µm")),
        Column(say("Residual"), unit("µm")),
    )  # fmt: skip
    return [Section(say("Distances by laser tracker"), (Table(say("Distances"), columns, rows),))]


_PLACES = VolumeCandidates(along_lines, _shape, RelocatedCandidates(along_lines))

KIND = Kind(
    name="tracker_length",
    table=TrackerFacts,
    observe=TrackerLength,
    screen=screening.Screening(shape_of),
    plan=Planning({"tracker lines": tracker_lines}, _PLACES.candidates, _PLACES.elsewhere),
    page=Page(sections, lambda result: {"tracker": {"distances": len(result.residuals)}}),
)
