"""Ballbar: two balls a fixed distance apart, in many places; observed, planned, stated.

The observation is the distance of the two ball centres; placing and direction cancel, and a bar without a certificate
leaves one scale common to all axes undetermined. The twenty positions follow figure 26 of ASME B89.4.1-1997 as the
recording of Harris (2004, figures C 1 and C 2) carries them out; its position 18, which repeats 14 there, is taken between
14 and 11.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import product
from math import hypot
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.conformity.plans import B89
from cmm_uq.analysis.planning import candidates
from cmm_uq.analysis.planning.set_up import Pattern, SetUp, attitude_along, direction_words, planned_length
from cmm_uq.analysis.planning.setting import Planning, Setting, Volume
from cmm_uq.analysis.screening.shape import ArtefactShape, Screening, bar_misfit, common_length, no_references, rows_by
from cmm_uq.artefacts import adjustment
from cmm_uq.artefacts.adjustment import Lengths, lengths_of
from cmm_uq.artefacts.distance_equations import DistanceSolution, solve_distances
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, Verbatim, number, say
from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import Column, Section, Table, columns, figure_columns
from cmm_uq.certificate.pages.budget import budget_blocks
from cmm_uq.certificate.plots.residuals import deviations_plot, residual_volume
from cmm_uq.certificate.result import Page, Result
from cmm_uq.certificate.wording import numbered, refusal
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.plan import PlanFacts
from cmm_uq.machine.model.artefact import Artefact, Indications, Size
from cmm_uq.machine.model.artefact_doubt import temperature_of
from cmm_uq.machine.model.recorded import expansion, length_of
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.maths.uncertainty.budget import Budget, BudgetLine
from cmm_uq.maths.uncertainty.budget_results import budget_data
from cmm_uq.maths.uncertainty.quantity import rounded, significant


class Ballbar(Artefact):
    """A ballbar as recorded: m lengths of 2m points.

    ``facts`` what the job says of the bar; ``points`` the recording; points 1 and 2 of every (measurement, repeat).
    """

    kind = "ballbar"
    title = say("Ballbar")

    def __init__(self, facts: ArtefactFacts, points: Points, *, where: str | None = None) -> None:
        self.points = points
        self._facts = facts
        self.rows = _ends(points, where)
        self.noise_scale = np.full(len(self.rows), np.sqrt(2.0))
        self.expansion = expansion(facts, points)[self.rows].mean(axis=1)
        self._known = (np.zeros((0, 3)), np.zeros((0, 3)))
        lengths = self.lengths()
        if np.any(lengths == 0):
            line = points.lines[self.rows[np.argmin(lengths), 0]] if len(points.lines) else 0
            raise CmmUqError("both ends of the bar lie in one place", where=f"{where or 'recording'} line {line}",
                             fix="Record the centres of two different balls")  # fmt: skip
        length, sd = length_of(facts, float(lengths.mean()), "the recorded bars", where)
        self.sizes = (Size("length_mm", say("Length of the bar"), unit("mm"), length, sd, say("length")),)

    @property
    def set_up(self) -> Text:
        return say("Position of the bar")

    def further_sections(self, result: Result) -> list[Section]:
        """Of how the ends were found."""
        return []

    def further_results(self, result: Result) -> dict[str, Any]:
        return {}

    def own_faults(self) -> Iterable[Effect]:
        return (temperature_of(self._facts, self.points),)

    def lengths(self) -> Floats:
        return np.asarray(np.linalg.norm(self._bars(self.points.xyz), axis=1) / self.expansion, dtype=np.float64)

    def indications(self) -> Indications | None:
        size = self.sizes[0]
        if not size.certified:
            return None
        every = np.full(len(self.rows), 1.0)
        return Indications(self.lengths() - size.nominal, size.nominal * every, size.sd * every, self.rows)

    def ends(self) -> Floats:
        return np.asarray(self.points.xyz[self.rows], dtype=np.float64)

    def bidirectional(self, rows: Ints) -> NDArray[np.bool_]:
        return np.zeros(len(rows), dtype=bool)

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        bars = self._bars(true_xyz)
        half = 0.5 * bars / np.linalg.norm(bars, axis=1, keepdims=True) * (sizes[0] * self.expansion)[:, None]
        middle = true_xyz[self.rows].mean(axis=1)
        placed = true_xyz.copy()
        placed[self.rows[:, 0]], placed[self.rows[:, 1]] = middle - half, middle + half
        return placed

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        relative = displacement[self.rows[:, 1]] - displacement[self.rows[:, 0]]
        return np.asarray(np.einsum("mi,mik->mk", self._directions(xyz), relative), dtype=np.float64)

    def project_along(self, xyz: Floats, direction: Floats, moved: Floats) -> Floats:
        if type(self).project is not Ballbar.project:  # of a bar whose ends are found otherwise
            return super().project_along(xyz, direction, moved)
        relative = moved[self.rows[:, 1]] - moved[self.rows[:, 0]]
        relative *= (self._directions(xyz) @ direction)[:, None]
        return relative

    def _directions(self, xyz: Floats) -> Floats:
        """From one end to the other, (m, 3), kept for points that nobody can change: a diagnosis asks thousands of times."""
        if self._known[0] is not xyz:
            bars = self._bars(xyz)
            bars /= np.linalg.norm(bars, axis=1, keepdims=True)
            if xyz.flags.writeable:
                return bars
            self._known = xyz, bars
        return self._known[1]

    def size_change(self) -> Floats:
        return np.asarray(self.expansion[:, None], dtype=np.float64)

    def _bars(self, xyz: Floats) -> Floats:
        return np.asarray(xyz[self.rows[:, 1]] - xyz[self.rows[:, 0]], dtype=np.float64)


def _ends(points: Points, where: str | None) -> Ints:
    """Rows of points 1 and 2 of every bar, (m, 2)."""
    ends = []
    for rows in points.rows_of_groups:
        numbers = points.point[rows]
        if sorted(numbers.tolist()) != [1, 2]:
            missing, has = (
                sorted({1, 2} - set(numbers.tolist())),
                f"has points {sorted(numbers.tolist())}, a bar has 1 and 2",
            )
            what = f"has no point {missing[0]}: a bar with one end" if missing else has
            problem = f"measurement {points.measurement[rows[0]]}, repeat {points.repeat[rows[0]]} {what}"
            line = points.lines[rows[0]] if len(points.lines) else 0
            fix = "Record both balls, as points 1 and 2, or leave out the measurement"
            raise CmmUqError(problem, where=f"{where or 'recording'} line {line}", fix=fix)
        ends.append(rows[np.argsort(numbers)])
    return np.array(ends, dtype=np.int64)


def shape_of(facts: ArtefactFacts, points: Points) -> ArtefactShape | None:
    """Bars of one length; ``None`` where one has not two ends."""
    rows, length = rows_by(points.group), facts.length_mm
    if any(sorted(points.point[r]) != [1, 2] for r in rows):
        return None
    extent = length or common_length(points.xyz, rows)
    return ArtefactShape(rows, bar_misfit, length or np.nan, extent, True, (), no_references(points))


SCREENING = Screening(shape_of, balls=True)


_DIAGONALS = (
    (1, 1, 0), (1, -1, 0), (0, 1, -1), (0, 1, 1), (1, 0, -1), (1, 0, 1),
    (1, 1, 1), (1, 1, -1), (1, -1, -1), (1, -1, 1),
)  # fmt: skip
_PARALLELS = (
    ((0, 1, 0), (0.6, 0.5, 0.5)), ((1, 0, 0), (0.5, 0.85, 0.5)), ((1, 0, 0), (0.5, 0.25, 0.5)),
    ((0, 1, 0), (0.3, 0.5, 0.5)), ((0, 1, 0), (0.7, 0.5, 0.5)), ((1, 0, 0), (0.65, 0.1, 0.5)),
    ((1, 0, 0), (0.5, 0.5, 0.5)), ((0, 1, 0), (0.4, 0.5, 0.5)), ((0, 0, 1), (0.65, 0.55, 0.5)),
    ((0, 0, 1), (0.45, 0.3, 0.5)),
)  # fmt: skip


def ballbar(facts: ArtefactFacts, plan: PlanFacts) -> Pattern:
    half = 0.5 * planned_length(facts, plan)
    one = Pattern(np.array([[-half, 0.0, 0.0], [half, 0.0, 0.0]]), np.array([1, 2]), np.ones(2, dtype=np.int64))
    return one.repeated(plan.repeats)


def ballbar_positions(setting: Setting) -> tuple[SetUp, ...]:
    """Twenty positions for a nearly cubic volume; in a longer one ten diagonals more for each further cube along it."""
    pattern, sections = ballbar(setting.artefact, setting.plan), _sections(setting.volume)
    wanted = [(d, candidates.MIDDLE) for d in _DIAGONALS] + list(_PARALLELS)
    placings = _lines(setting, sections[0], pattern, wanted)
    for section in sections[1:]:
        placings += _lines(setting, section, pattern, wanted[: len(_DIAGONALS)])
    return tuple(placings)


def _lines(
    setting: Setting,
    volume: Volume,
    pattern: Pattern,
    wanted: list[tuple[tuple[int, int, int], tuple[float, float, float]]],
) -> list[SetUp]:
    found = []
    for direction, place in wanted:
        u = np.array(direction, dtype=np.float64)
        candidates.check_allowed(setting, u)
        found.append(volume.set_up(pattern, attitude_along(u), place, direction_words(u)))
    return found


def _sections(volume: Volume) -> list[Volume]:
    """Nearly cubic parts of the volume, overlapping by no more than they must."""
    size = volume.size
    counts = B89.cubes(size)
    edge = B89.nearly_cubic * size.min()
    found = []
    for at in product(*(range(count) for count in counts)):
        length = np.minimum(size, np.where(np.array(counts) > 1, edge, size))
        share = [i / (count - 1) if count > 1 else 0.0 for i, count in zip(at, counts, strict=True)]
        start = volume.box[:, 0] + (size - length) * np.array(share)
        found.append(replace(volume, box=np.column_stack([start, start + length])))
    return found


_LINES = candidates.along_lines
_PLACES = candidates.VolumeCandidates(
    _LINES, lambda setting: ballbar(setting.artefact, setting.plan), candidates.RelocatedCandidates(_LINES)
)
PLANNING = Planning({"ASME B89.4.1": ballbar_positions}, _PLACES.candidates, _PLACES.elsewhere)


def _lengths(result: Result, bar: Ballbar) -> Lengths:
    """Lengths against the certified one, or their mean."""
    lengths = bar.lengths()
    return lengths_of(result, lengths, bar.sizes[0].nominal if bar.sizes[0].certified else float(lengths.mean()))


def results(result: Result) -> dict[str, Any]:
    bar = cast("Ballbar", result.artefact)
    budget, second_way = budget_data(_budget(result, bar)), _second_way(result, bar)
    data = adjustment.distances_data(result, _lengths(result, bar), second_way, length_budget=budget)
    return {**data, **bar.further_results(result)}


def _budget(result: Result, bar: Ballbar) -> Budget:
    """What one length's deviation from the reference is uncertain by: the readings, and the certified length."""
    coordinate, size, um = result.noise.coordinate, bar.sizes[0], unit("µm")
    origin = say("residuals of this recording") if coordinate.u > 0 else say("stated in the job")
    what, twice = say("Coordinate of a ball, along the bar, twice"), float(bar.noise_scale[0])
    dof = coordinate.degrees_of_freedom
    lines = [BudgetLine(what, coordinate.value, origin, unit=um, dof=dof, sensitivity=twice)]
    if size.certified and size.sd > 0:
        chain = result.job.facts.artefact.certificate
        number = chain.number if chain else ""
        source = say("certificate {number}", number=Verbatim(number)) if number else say("certificate")
        lines.append(BudgetLine(say("Certified length"), size.sd / MICROMETRE, source, unit=um, sensitivity=-1.0))
    return Budget(say("deviation of one length"), lines, unit=um)


def _second_way(result: Result, bar: Ballbar) -> DistanceSolution | Text:
    size, ends, used = bar.sizes[0], bar.ends(), result.model.used
    if not size.certified:
        return say("The length of the bar is not certified.")
    if any(one.role == "sought" for one in bar.sizes):
        return say("The distance equations have no digitizer: they would take its offset in two attitudes for lengths.")
    try:
        found = solve_distances((ends[:, 1] - ends[:, 0])[used], (size.nominal * bar.expansion)[used])
        return replace(found, relative_length_u=hypot(size.sd / size.nominal, result.relative_doubt))
    except CmmUqError as error:
        return refusal(error)


_ROWS_SHOWN = 60


def sections(result: Result) -> list[Section]:
    bar = cast("Ballbar", result.artefact)
    size, lengths, budget = bar.sizes[0], _lengths(result, bar), _budget(result, bar)
    name = say("certified length") if size.certified else say("mean length")
    caption = say(
        "Deviation of each length from the {name}, as recorded and after the fitted model, with U (k = {k}).",
        name=name,
        k=number(lengths.coverage_factor, ".2f"),
    )
    plot = deviations_plot(
        result, lengths.deviation_um, say("{count} lengths: as recorded they deviate", count=len(lengths.length)),
        say("from the {name}", name=name), expanded_um=lengths.expanded_um, caption=caption, spec=".0f",
        reference=say("{name} {length:.4f}\u00a0mm", name=name, length=lengths.reference),
        reference_expanded_um=2 * size.sd / MICROMETRE if size.certified else 0.0,
    )  # fmt: skip
    combined = say("Combined: u = {u} µm.", u=significant(budget.u))
    return [
        Section(say("Lengths"), (plot, residual_volume(result, say("bars")), _table(lengths, name))),
        Section(
            say("Budget of one length"), tuple(budget_blocks(say("the deviation of one length"), budget, combined))
        ),
        *bar.further_sections(result),
        adjustment.section(result, _second_way(result, bar)),
    ]


def _table(lengths: Lengths, name: Text) -> Table:
    U, repeated = lengths.expanded_um, lengths.repeat.max() > 1
    figures = np.column_stack([lengths.length, lengths.deviation_um, lengths.residual_um])[:_ROWS_SHOWN]
    rows = []
    for i, row in enumerate(figures.tolist()):
        shown = [rounded(x, each)[0] for x, each in zip(row, (U * MICROMETRE, U, U), strict=True)]
        place = numbered(lengths.measurement[i], lengths.repeat[i] if repeated else None)
        mark = say("set aside") if not lengths.used[i] else say("see warnings") if lengths.flagged[i] else NOTHING
        rows.append((place, *shown, mark))
    from_reference = figure_columns(say("From the {name}", name=name), say("Residual"), unit=unit("µm"))
    heads = columns([say("Position"), Column(say("Length"), unit("mm")), *from_reference, say("Remark")])
    notes = [
        say(
            "U = {U} µm (k = {k}) for each length, from the standard uncertainty of a coordinate and how well that is known.",
            U=rounded(0.0, U)[1],
            k=number(lengths.coverage_factor, ".2f"),
        )
    ]
    if (left := len(lengths.length) - len(rows)) > 0:
        notes.append(say("{left} more lengths are in the attached recording.", left=left))
    return Table(say("Lengths brought to 20 °C"), heads, tuple(rows), tuple(notes))


PAGE = Page(sections, results)
