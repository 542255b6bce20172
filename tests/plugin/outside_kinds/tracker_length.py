"""Distances by a laser tracker: a kind of measurement for cmm_uq from a package of its own.

A reflector on the ram is read at two places; a tracker in line with both says how far it moved, in the column ``tracker_mm``.
"""

import numpy as np

from cmm_uq.kind import (
    METRE, MICROMETRE, MIDDLE, Artefact, ArtefactShape, Beginning, Column, Floats, Kind, Page, Pattern, Planning,
    Points, ReferencedFacts, RelocatedCandidates, Result, Screening, Section, SetUp, Setting, Size, Table, Uncertainty,
    VolumeCandidates, along_lines, attitude_along, check_allowed, columns_needed, direction_words, number,
    planned_length, rows_by, say, unit,
)  # fmt: skip

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
        sd = np.inf if facts.nominal else u
        self.sizes = (Size("length_mm", say("Longest distance of the tracker"), unit("mm"), longest, sd),)

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        """Same middle, same direction, the tracker's distance."""
        distance = self.reference * sizes[0] / self.sizes[0].nominal
        half, middle = 0.5 * distance[:, None] * self._directions(true_xyz), true_xyz[self.rows].mean(axis=1)
        placed = true_xyz.copy()
        placed[self.rows[:, 0]], placed[self.rows[:, 1]] = middle - half, middle + half
        return placed

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        """Relative displacement along the beam."""
        relative = displacement[self.rows[:, 1]] - displacement[self.rows[:, 0]]
        return np.asarray(np.einsum("mi,mik->mk", self._directions(xyz), relative))

    def size_change(self) -> Floats:
        return np.asarray((self.reference / self.sizes[0].nominal)[:, None])

    def deviations(self) -> Floats:
        """Indicated minus the tracker's distance, (m,) mm."""
        return np.asarray(np.linalg.norm(np.diff(self.points.xyz[self.rows], axis=1)[:, 0], axis=1) - self.reference)

    def _directions(self, xyz: Floats) -> Floats:
        steps = xyz[self.rows[:, 1]] - xyz[self.rows[:, 0]]
        return np.asarray(steps / np.linalg.norm(steps, axis=1, keepdims=True))


def shape_of(facts: TrackerFacts, points: Points) -> ArtefactShape | None:
    """Pairs of points as far apart as the tracker says."""
    rows = rows_by(points.group)
    if COLUMN not in points.columns or any(sorted(points.point[pair]) != [1, 2] for pair in rows):
        return None
    reference = points.columns[COLUMN][:, None]
    return ArtefactShape(rows, misfit, np.nan, float(reference.max()), True, (COLUMN,), reference)


def misfit(xyz: Floats, reference: Floats, _: float) -> Floats:
    return np.full(2, abs(float(np.linalg.norm(xyz[1] - xyz[0]) - reference[0, 0])))


def pattern(setting: Setting) -> Pattern:
    """Both ends of one distance."""
    length = planned_length(setting.artefact, setting.plan)
    ends = np.array([[-0.5 * length, 0.0, 0.0], [0.5 * length, 0.0, 0.0]])
    one = Pattern(ends, np.array([1, 2]), np.ones(2, dtype=np.int64), {COLUMN: np.full(2, length)})
    return one.repeated(setting.plan.repeats)


def tracker_lines(setting: Setting) -> tuple[SetUp, ...]:
    """Three axes, six face diagonals and four space diagonals through the middle of the volume."""
    signs = [(x, y, z) for x in (0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) > (0, 0, 0)]
    set_ups = []
    for direction in np.array(signs, dtype=np.float64):
        check_allowed(setting, direction)
        attitude = attitude_along(direction)
        set_ups.append(setting.volume.set_up(pattern(setting), attitude, MIDDLE, direction_words(direction)))
    return tuple(set_ups)


def sections(result: Result) -> list[Section]:
    """Every distance, as recorded and after the fitted model."""
    artefact, residuals = result.artefact, result.residuals / MICROMETRE
    deviations = artefact.deviations() / MICROMETRE
    rows = tuple(
        (number(measurement), number(distance, ".4f"), number(deviation, ".1f"), number(residual, ".1f"))
        for measurement, distance, deviation, residual in zip(
            artefact.measurement, artefact.reference, deviations, residuals, strict=True
        )
    )
    columns = (
        Column(say("Measurement")), Column(say("Tracker"), unit("mm")), Column(say("Deviation"), unit("µm")),
        Column(say("Residual"), unit("µm")),
    )  # fmt: skip
    return [Section(say("Distances by laser tracker"), (Table(say("Distances"), columns, rows),))]


places = VolumeCandidates(
    along_lines, lambda setting: lambda attitude: pattern(setting), RelocatedCandidates(along_lines)
)

KIND = Kind(
    name="tracker_length",
    table=TrackerFacts,
    observe=TrackerLength,
    screen=Screening(shape_of),
    plan=Planning({"tracker lines": tracker_lines}, places.candidates, places.elsewhere),
    page=Page(sections, lambda result: {"tracker": {"distances": len(result.residuals)}}),
    begin=Beginning(
        "Distances by laser tracker", "One measurement is one distance; points 1 and 2 are its ends.",
        artefact={"name": "Laser tracker", "u_um": 0.2, "u_um_per_m": 0.5}, plan={"length_mm": 400.0},
        columns={COLUMN: "Distance between both points by the tracker, mm."},
    ),
)  # fmt: skip
