"""Plate: balls or holes at reference positions, placed rigidly and anyhow in each measurement.

All three coordinates of every ball are observations; the six freedoms of each placing are projected out exactly. What the
certificate leaves open is in the length of the plate as far as all positions have it in common, and an error of each ball
where that is more. Nominal positions leave that scale free.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.planning.candidates import (
    ACROSS,
    PatternFor,
    RelocatedCandidates,
    VolumeCandidates,
    across_planes,
    check_allowed,
)
from cmm_uq.analysis.planning.set_up import PRINCIPAL_PLANES, Pattern, SetUp
from cmm_uq.analysis.planning.setting import Planning, Setting
from cmm_uq.analysis.screening.shape import ArtefactShape, Screening, body_misfit, rows_by, spread
from cmm_uq.artefacts.plate.kind import PlateFacts
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.units import unit
from cmm_uq.jobs.recording.references import NOISE_RATIO
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.plan import PlanFacts
from cmm_uq.machine.model.artefact import Indications, Placings, Size
from cmm_uq.machine.model.artefact_doubt import CertifiedPlaces, by_certificate, faults, since_earlier
from cmm_uq.machine.model.placed import Rigid
from cmm_uq.machine.model.recorded import check_length, columns_needed, expansion, place
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.effects.own_errors import Body
from cmm_uq.maths.inference.doubt import Cause

DRILLED_UM = 30.0  # standard deviation of holes from their nominal places, and of balls glued to a plate, µm
CHANGED_UM = 2.0  # by how much a plate may have changed its shape between two dates, µm
REFERENCES = ("reference_x_mm", "reference_y_mm", "reference_z_mm")


class Plate(Rigid):
    """A plate as recorded: 3n observations (x, y, z of each ball in turn) of n points.

    ``facts`` what the job says of the plate; ``length_mm`` is that of the farthest ball from the first by its number
    where it is not stated; ``points`` the recording, with ``reference_x_mm``, ``reference_y_mm``, ``reference_z_mm``.
    An earlier recording in place of references (:mod:`cmm_uq.jobs.recording.references`) adds its own noise.
    """

    kind = "plate"
    title = say("Plate")

    def __init__(self, facts: PlateFacts, points: Points, *, where: str | None = None) -> None:
        super().__init__(points)
        self._facts = facts
        if NOISE_RATIO in points.columns:
            self.noise_scale = points.columns[NOISE_RATIO][self.rows[:, 0]]
        self.reference = columns_needed(points, REFERENCES, self.kind, where)
        self.expansion = expansion(facts, points)
        self.certificate = CertifiedPlaces.of(facts, points, self.reference)
        from_first = int(np.argmin(points.point))
        away = np.linalg.norm(self.reference - self.reference[from_first], axis=1)
        farthest, longest = int(np.argmax(away)), float(away.max())
        self._ends = from_first, farthest
        body = self.reference * self.expansion[:, None]
        self.body = body - self.placings.means(body)
        length = facts.length_mm or longest
        sd = self.certificate.sd(length, from_first, farthest)
        self.sizes = (Size("length_mm", say("Length of the plate"), unit("mm"), length, sd, say("length")),)
        self._together = self.body / self.sizes[0].nominal
        if not self.certificate.plain and self.sizes[0].certified:
            about = self.reference - self.placings.means(self.reference)
            together = self.certificate.together(about, self.sizes[0].sd, *self._ends) * self.expansion[:, None]
            self._together = together - self.placings.means(together)
        self._refuse_another_plate(where)

    def shape(self, sizes: Floats) -> Floats:
        if self.certificate.plain:
            return np.asarray(self.body * (sizes[0] / self.sizes[0].nominal), dtype=np.float64)
        return np.asarray(self.body + (sizes[0] - self.sizes[0].nominal) * self._together, dtype=np.float64)

    def own_faults(self) -> Iterable[Effect]:
        earlier = NOISE_RATIO in self.points.columns
        body = Body.of(self.points, self.reference, () if earlier else REFERENCES)
        known = (
            since_earlier(CHANGED_UM)
            if earlier
            else by_certificate(self.certificate.u_um(self.sizes[0].sd), DRILLED_UM)
        )
        return faults(self._facts, self.points, body, known)

    def size_change(self) -> Floats:
        return self._together.reshape(-1, 1)

    def unread(self) -> NDArray[np.bool_]:
        found = super().unread()
        if NOISE_RATIO in self.points.columns:
            found |= self.placings.still(self.reference).ravel()
        return found

    def calibration(self) -> Cause | None:
        if NOISE_RATIO in self.points.columns:
            return None
        return self.certificate.beyond(self.sizes[0], *self._ends, self.size_change()[:, 0], self.expansion)

    def indications(self) -> Indications | None:
        """Distances between every two balls of a (measurement, repeat), against the certified ones."""
        size = self.sizes[0]
        if not size.certified:
            return None
        runs = Placings.of(self.points.group)
        found, certified, ends = [], [], []
        for rows in runs.rows:
            a, b = rows[np.array(np.triu_indices(len(rows), 1))]
            ends.append(np.column_stack([a, b]))
            ratio = 0.5 * (self.expansion[a] + self.expansion[b])
            found.append(np.linalg.norm(self.points.xyz[b] - self.points.xyz[a], axis=1) / ratio)
            certified.append(np.linalg.norm(self.reference[b] - self.reference[a], axis=1))
        lengths = np.concatenate(certified)
        rows = np.concatenate(ends)
        u = self.certificate.u_between(rows[:, 0], rows[:, 1])
        return Indications(np.concatenate(found) - lengths, lengths, u, rows)

    def bidirectional(self, rows: Ints) -> NDArray[np.bool_]:
        return np.zeros(len(rows), dtype=bool)

    def _refuse_another_plate(self, where: str | None) -> None:
        points, placings = self.points, self.placings
        nominal, found = self.extents()
        if np.any(lost := (nominal == 0) | (found == 0)):
            number = placings.numbers[np.argmax(lost)]
            raise CmmUqError(
                f"measurement {number} has no two different balls, so it tells no length of the plate",
                where=place(points, points.measurement == number, where),
                fix="Record at least three balls of different reference positions in each measurement, or leave it out",
            )
        length = self.sizes[0].nominal
        check_length(float(found.sum() / nominal.sum()) * length, length, "the recorded plates", where)
        self.refuse_another_shape("Check the numbering of the balls and their reference positions", where)


def shape_of(facts: ArtefactFacts, points: Points) -> ArtefactShape | None:
    if any(name not in points.columns for name in REFERENCES):
        return None
    reference = np.column_stack([points.columns[name] for name in REFERENCES])
    return ArtefactShape(
        rows_by(points.measurement), body_misfit, np.nan, spread(reference), False, REFERENCES, reference
    )


SCREENING = Screening(shape_of, balls=True)


def plate(facts: ArtefactFacts, plan: PlanFacts, size: float) -> Pattern:
    """A grid of balls; without a pitch as large as fits ``size`` mm."""
    columns, rows = plan.grid
    longest = max(columns, rows) - 1
    pitch = plan.pitch_mm or (facts.length_mm or plan.length_mm or size) / np.hypot(columns - 1, rows - 1)
    pitch = min(pitch, size / longest) if plan.pitch_mm is None else pitch
    i, j = np.meshgrid(np.arange(columns), np.arange(rows))
    reference = np.asarray(pitch * np.column_stack([i.ravel(), j.ravel(), np.zeros(i.size)]), dtype=np.float64)
    named = {f"reference_{a}_mm": reference[:, k] for k, a in enumerate(AXES)}
    one = Pattern(reference - reference.mean(axis=0), np.arange(1, i.size + 1), np.ones(i.size, dtype=np.int64), named)
    return one.repeated(plan.repeats)


def plate_placings(setting: Setting) -> tuple[SetUp, ...]:
    """Flat at two heights, upright along X front and back, upright along Y left and right."""
    volume = setting.volume
    pattern = plate(setting.artefact, setting.plan, float(volume.size.min()))
    found = []
    for (title, attitude), places in zip(PRINCIPAL_PLANES, (
        ((0.5, 0.5, 0.0), (0.5, 0.5, 1.0)), ((0.5, 0.0, 0.5), (0.5, 1.0, 0.5)), ((0.0, 0.5, 0.5), (1.0, 0.5, 0.5)),
    ), strict=True):  # fmt: skip
        check_allowed(setting, attitude[:, 2], ACROSS)
        found += [volume.set_up(pattern, attitude, place, title) for place in places]
    return tuple(found)


def _shape(setting: Setting) -> PatternFor:
    pattern = plate(setting.artefact, setting.plan, float(setting.volume.size.min()))
    return lambda _: pattern


_PLACES = VolumeCandidates(across_planes, _shape, RelocatedCandidates(across_planes))
PLANNING = Planning({"plate placings": plate_placings}, _PLACES.candidates, _PLACES.elsewhere)
