"""Step gauge and gauge blocks: faces at certified distances along one line, in several places.

Every face is an observation: how far along the line it was found, against its certified distance. The line runs from the
first to the farthest face as recorded, so its two directions across cost nothing, and its position is free in each
measurement. Where several lengths are taken together, the certificate's uncertainty is one error of the gauge that all have in
common, since that is the part that no number of faces averages out. Lines follow ISO 10360-2:2009, 6.3.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.planning import candidates
from cmm_uq.analysis.planning.set_up import Pattern, SetUp, attitude_along, direction_words, planned_length
from cmm_uq.analysis.planning.setting import Planning, Setting
from cmm_uq.analysis.screening.shape import ArtefactShape, Screening, line_misfit, rows_by
from cmm_uq.base.messages import say
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.units import unit
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.tables.artefact import ArtefactFacts, ReferencedFacts
from cmm_uq.jobs.tables.plan import PlanFacts
from cmm_uq.machine.model.artefact import Artefact, Indications, Placings, Size
from cmm_uq.machine.model.artefact_doubt import CertifiedPlaces, by_certificate, faults
from cmm_uq.machine.model.recorded import check_length, columns_needed, expansion, refuse
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.effects.own_errors import ALONG_A_LINE, Body
from cmm_uq.maths.inference.linear_model import Freedoms
from cmm_uq.maths.inference.posterior import Cause

PITCH = 20.0  # mm, usual distance of the faces of a step gauge
FIVE = 5  # lengths on a line (ISO 10360-2:2009, 6.3)


def faces_of(facts: ArtefactFacts, plan: PlanFacts) -> Floats:
    """Distances of faces from the first, in ascending order, mm."""
    if plan.lengths_mm:
        return np.unique(np.array(plan.lengths_mm, dtype=np.float64))
    length = planned_length(facts, plan)
    pitch = plan.pitch_mm or PITCH
    faces: Floats = pitch * np.arange(1, int(length / pitch + 1e-9) + 1, dtype=np.float64)
    return faces if len(faces) else np.array([length])


def blocks_of(facts: ArtefactFacts, plan: PlanFacts) -> Floats:
    """Lengths of blocks, in ascending order, mm."""
    if plan.lengths_mm:
        return np.unique(np.array(plan.lengths_mm, dtype=np.float64))
    return np.asarray(planned_length(facts, plan) * np.arange(1, FIVE + 1) / FIVE, dtype=np.float64)


def five_of(lengths: Floats, longest: float) -> Floats:
    """Five lengths, well spread from the shortest to the longest, that are not longer than ``longest``; fewer if there are."""
    fitting = lengths[lengths <= longest + 1e-6]
    if len(fitting) <= FIVE:
        return fitting
    wanted = np.linspace(fitting[0], fitting[-1], FIVE)
    return np.asarray(fitting[np.unique(np.abs(fitting[:, None] - wanted).argmin(axis=0))], dtype=np.float64)


def gauge(lengths: Floats, plan: PlanFacts) -> Pattern:
    """Faces at 0 and at some lengths (k,), met on the way out and, if the plan says so, on the way back."""
    out = np.concatenate([[0.0], lengths])
    faces = np.concatenate([out, out[::-1]]) if plan.both_ways else out
    n = len(faces)
    body, travel = np.zeros((n, 3)), np.zeros((n, 3))
    body[:, 0] = faces - 0.5 * out[-1]
    travel[:, 0] = np.where(np.arange(n) < len(out), 1.0, -1.0)
    one = Pattern(body, np.arange(1, n + 1), np.ones(n, dtype=np.int64), {"reference_mm": faces}, {"approach": travel})
    return one.repeated(plan.repeats)


def block(length: float, plan: PlanFacts) -> Pattern:
    """Two outer faces, each met from outside."""
    along = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    one = Pattern(
        -0.5 * length * along, np.array([1, 2]), np.ones(2, dtype=np.int64), {"reference_mm": np.array([0.0, length])},
        {"approach": along, "normal": -along},
    )  # fmt: skip
    return one.repeated(plan.repeats)


def seven_lines(setting: Setting, lengths: Floats, shapes: Callable[[Floats], list[Pattern]]) -> tuple[SetUp, ...]:
    """Four space diagonals and three axes through the middle of the volume, five lengths on each.

    ``lengths`` (k,) that there are, mm.
    """
    volume = setting.volume
    size = volume.size
    diagonals = [size * signs for signs in ((1, 1, 1), (1, -1, 1), (-1, 1, 1), (-1, -1, 1))]
    found = []
    for direction in (*diagonals, *np.eye(3)):
        candidates.check_allowed(setting, direction)
        fitting = five_of(lengths, volume.chord(direction))
        if not len(fitting):
            raise volume.too_small(
                np.outer([-0.5, 0.5], lengths[0] * attitude_along(direction)[:, 0]), direction_words(direction)
            )
        found += [
            volume.set_up(shape, attitude_along(direction), candidates.MIDDLE, direction_words(direction))
            for shape in shapes(fitting)
        ]
    return tuple(found)


_LAPPED_UM = 5.0  # standard deviation of the faces of a gauge without a certificate from their nominal places, µm
_SAME_FACE = 1e-6  # mm; certified distances closer than this belong to one face


@dataclass(frozen=True, eq=False)
class Reversals:
    measurement: Ints  # (p,) of each such face
    reference: Floats  # (p,) its certified distance, mm
    gap: Floats  # (p,) found when travelling away from the first face minus when travelling towards it, mm
    # (n,) of every observation in the gap of its face; 0 of a face that was not reached from both sides
    weights: Floats


class StepGauge(Artefact):
    """Faces at certified distances along lines: n observations of n points.

    ``facts`` what the job says of the gauge; ``length_mm`` is its longest distance, by default of those recorded;
    ``points`` the recording, with ``reference_mm``.
    """

    kind = "step_gauge"
    title = say("Step gauge")

    def __init__(self, facts: ReferencedFacts, points: Points, *, where: str | None = None) -> None:
        self.points = points
        self._facts = facts
        self.reference = columns_needed(points, ("reference_mm",), self.title.lower(), where)[:, 0]
        self._lines = Placings.of(points.measurement)
        self._ends = _ends(self.reference, self._lines)
        self._refuse_what_is_no_gauge(where)
        self.rows = np.arange(len(points))[:, None]
        self.expansion = expansion(facts, points)
        spans = self._lines.sums(self._ends * self.reference)
        length = facts.length_mm or float(spans.max())
        self.certificate = CertifiedPlaces.of(facts, points, self.reference[:, None])
        longest = np.flatnonzero(self._lines.index == np.argmax(spans))
        first, last = (int(longest[pick(self.reference[longest])]) for pick in (np.argmin, np.argmax))
        self._ends_of_longest = first, last
        title, sd = say("Length of the {title:small}", title=self.title), self.certificate.sd(length, first, last)
        self.sizes = (Size("length_mm", title, unit("mm"), length, sd, say("length")),)
        self._together = self.reference / length
        if not self.certificate.plain and self.sizes[0].certified:
            self._together = self.certificate.together(
                self.reference[:, None], self.sizes[0].sd, *self._ends_of_longest
            )[:, 0]

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        directions = self.directions(true_xyz)
        gap = self._distances(sizes[0]) - np.einsum("ni,ni->n", true_xyz, directions)
        return np.asarray(true_xyz + (gap - self._lines.means(gap))[:, None] * directions, dtype=np.float64)

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        return np.asarray(np.einsum("ni,nik->nk", self.directions(xyz), displacement), dtype=np.float64)

    def own_faults(self) -> Iterable[Effect]:
        places = np.column_stack([self.reference, np.zeros((len(self.reference), 2))])
        body = Body.of(self.points, places, ("reference_mm",))
        known = by_certificate(self.certificate.u_um(self.sizes[0].sd), _LAPPED_UM)
        return faults(self._facts, self.points, body, known, axes=1, geometry=ALONG_A_LINE)

    def size_change(self) -> Floats:
        if self.certificate.plain:
            return np.asarray((self.reference * self.expansion / self.sizes[0].nominal)[:, None], dtype=np.float64)
        return np.asarray((self._together * self.expansion)[:, None], dtype=np.float64)

    def placing(self, xyz: Floats) -> Freedoms:
        return self._lines.columns(np.ones((len(xyz), 1)))

    def calibration(self) -> Cause | None:
        return self.certificate.beyond(self.sizes[0], *self._ends_of_longest, self.size_change()[:, 0], self.expansion)

    def indications(self) -> Indications | None:
        """Distances from the first recorded face of each (measurement, repeat), against the certified ones."""
        if not self.sizes[0].certified:
            return None
        number = self.points.point.astype(np.float64)
        runs = Placings.of(self.points.group)
        order = np.lexsort((number, runs.index))
        first = order[np.cumsum(runs.sizes) - runs.sizes][runs.index]
        lengths = self.reference - self.reference[first]
        found = self.positions() - self.positions()[first]
        certified = self._distances(self.sizes[0].nominal) - self._distances(self.sizes[0].nominal)[first]
        chosen = np.abs(lengths) > _SAME_FACE
        errors = (np.sign(lengths) * (found - certified) / self.expansion)[chosen]
        lengths = np.abs(lengths)[chosen]
        rows = np.column_stack([first, np.arange(len(first))])[chosen]
        return Indications(errors, lengths, self.certificate.u_between(rows[:, 0], rows[:, 1]), rows)

    def lines_of(self, rows: Ints) -> tuple[Floats, Floats]:
        """See :meth:`Artefact.lines_of`.

        The line is that of all faces: where on a face the probe touched would turn a short length by degrees.
        """
        return self._lines.means(self.points.xyz)[rows[:, 1]], self.directions()[rows[:, 1]]

    def bidirectional(self, rows: Ints) -> NDArray[np.bool_] | None:
        sense = self.approach()
        return None if sense is None else np.asarray(sense[rows[:, 0]] * sense[rows[:, 1]] < 0)

    def directions(self, xyz: Floats | None = None) -> Floats:
        """Unit vector of each point's line, (n, 3), in the sense of growing distances."""
        bars = self._lines.sums(self._ends[:, None] * (self.points.xyz if xyz is None else xyz))
        return np.asarray((bars / np.linalg.norm(bars, axis=1, keepdims=True))[self._lines.index], dtype=np.float64)

    def positions(self) -> Floats:
        """Where each face was found along its line, about the middle of the line, (n,) mm."""
        s = np.einsum("ni,ni->n", self.points.xyz, self.directions())
        return np.asarray(s - self._lines.means(s), dtype=np.float64)

    def deviations(self) -> Floats:
        """Found minus certified, about the mean of each line, (n,) mm."""
        gap = self.positions() - self._distances(self.sizes[0].nominal)
        return np.asarray(gap - self._lines.means(gap), dtype=np.float64)

    def approach(self) -> Floats | None:
        """Sense of travel into each face along its line, (n,) −1, 0 or +1; ``None`` when it was not recorded."""
        if not all(f"approach_{a}" in self.points.columns for a in AXES):
            return None
        travel = np.column_stack([self.points.columns[f"approach_{a}"] for a in AXES])
        along = np.einsum("ni,ni->n", travel, self.directions())
        return np.where(np.abs(along) > 1e-3, np.sign(along), 0.0)

    def reversals(self) -> Reversals | None:
        """Faces that were reached from both sides; ``None`` when no approach was recorded."""
        sense = self.approach()
        if sense is None:
            return None
        faces = np.column_stack([self.points.measurement, np.round(self.reference / _SAME_FACE)])
        _, first, index = np.unique(faces, axis=0, return_index=True, return_inverse=True)
        index, deviations = index.ravel(), self.deviations()
        counts, means = [], []
        for side in (1.0, -1.0):
            chosen = sense == side
            count = np.bincount(index[chosen], minlength=len(first))
            means.append(np.bincount(index[chosen], deviations[chosen], len(first)) / np.maximum(count, 1))
            counts.append(count)
        both = (counts[0] > 0) & (counts[1] > 0)
        weights = sense / np.maximum(np.where(sense > 0, counts[0][index], counts[1][index]), 1) * both[index]
        return Reversals(
            self.points.measurement[first[both]], self.reference[first[both]], (means[0] - means[1])[both], weights
        )

    def _distances(self, length: float) -> Floats:
        if self.certificate.plain:
            return np.asarray(self.reference * self.expansion * (length / self.sizes[0].nominal), dtype=np.float64)
        longer = (length - self.sizes[0].nominal) * self._together
        return np.asarray((self.reference + longer) * self.expansion, dtype=np.float64)

    def _refuse_what_is_no_gauge(self, where: str | None) -> None:
        points, lines, what = self.points, self._lines, self.title.lower()
        zero = min(1, int(points.point.min()))  # faces may be numbered from 0
        at = (points.point == zero) & (np.abs(self.reference) > _SAME_FACE)
        first = self.reference[np.argmax(at)]
        problem = f"point {zero} has reference_mm = {first:g}: distances count from point {zero}, so it has 0"
        refuse(points, at, where, problem, "Subtract the first distance from all of the measurement")
        spans = lines.sums(self._ends * self.reference)
        bars = np.linalg.norm(lines.sums(self._ends[:, None] * points.xyz), axis=1)
        together = "the first and the farthest face of measurement {} lie in one place"
        for wrong, problem, fix in (
            (spans <= _SAME_FACE, f"measurement {{}} has a single face, so it tells no length of the {what}",
             "Record at least two faces of different reference_mm in each measurement, or leave it out"),
            (bars == 0, together, "Mend its coordinates or reference_mm"),
        ):  # fmt: skip
            number = lines.numbers[np.argmax(wrong)]
            refuse(points, (points.measurement == number) & wrong.any(), where, problem.format(number), fix)
        check_length(float(bars.mean()), float(spans.mean()), "the recorded lines", where)


class GaugeBlocks(StepGauge):
    """Gauge blocks: the two faces of each, in one or several places."""

    kind = "gauge_blocks"
    title = say("Gauge blocks")

    def bidirectional(self, rows: Ints) -> NDArray[np.bool_]:
        """All, but those that were met from one side by the recording, as of a block that is wrung to a plate."""
        sense = self.approach()
        return np.ones(len(rows), dtype=bool) if sense is None else sense[rows[:, 0]] * sense[rows[:, 1]] <= 0


def _ends(reference: Floats, lines: Placings) -> Floats:
    """Weights (n,) whose sum over a line is its farthest minus its first face, each the mean of its points."""
    order = np.argsort(lines.index, kind="stable")
    starts = np.cumsum(lines.sizes) - lines.sizes

    def mean_of(face: Floats) -> Floats:
        chosen = (np.abs(reference - face[lines.index]) <= _SAME_FACE).astype(np.float64)
        return np.asarray(chosen / lines.sums(chosen)[lines.index], dtype=np.float64)

    first = np.minimum.reduceat(reference[order], starts)
    farthest = np.maximum.reduceat(reference[order], starts)
    return mean_of(farthest) - mean_of(first)


def shape_of(facts: ArtefactFacts, points: Points) -> ArtefactShape | None:
    """Lines of faces; ``None`` without references, or with a line of a single face."""
    if "reference_mm" not in points.columns:
        return None
    reference = points.columns["reference_mm"][:, None]
    rows = rows_by(points.measurement)
    if any(np.ptp(reference[r]) == 0 for r in rows):
        return None
    extent = float(np.median([np.ptp(reference[r]) for r in rows]))
    return ArtefactShape(rows, line_misfit, np.nan, extent, False, ("reference_mm",), reference)


SCREENING = Screening(shape_of)

Lengths = Callable[[ArtefactFacts, PlanFacts], Floats]


def steps(setting: Setting) -> tuple[SetUp, ...]:
    """Seven lines through the middle of the volume (ISO 10360-2:2009, 6.3), bidirectional unless the job says otherwise."""
    both = setting.plan.model_copy(update={"both_ways": setting.plan.both_ways is not False})
    return seven_lines(setting, faces_of(setting.artefact, setting.plan), lambda fitting: [gauge(fitting, both)])


def blocks(setting: Setting) -> tuple[SetUp, ...]:
    """The same, each length by a block of its own."""
    lengths = blocks_of(setting.artefact, setting.plan)
    return seven_lines(setting, lengths, lambda fitting: [block(float(length), setting.plan) for length in fitting])


def _planning(
    lines: Callable[[Setting], tuple[SetUp, ...]], lengths_of: Lengths, pattern: Callable[[Floats, PlanFacts], Pattern]
) -> Planning:
    def shape(setting: Setting) -> candidates.PatternFor:
        lengths = lengths_of(setting.artefact, setting.plan)

        def fitting_pattern(attitude: Floats) -> Pattern | None:
            fitting = five_of(lengths, setting.volume.chord(attitude[:, 0]))
            return pattern(fitting, setting.plan) if len(fitting) else None

        return fitting_pattern

    along = candidates.along_lines
    places = candidates.VolumeCandidates(along, shape, candidates.RelocatedCandidates(along))
    return Planning({"ISO 10360-2": lines}, places.candidates, places.elsewhere)


STEP_GAUGE = _planning(steps, faces_of, gauge)
GAUGE_BLOCKS = _planning(blocks, blocks_of, lambda fitting, plan: block(float(fitting[-1]), plan))
