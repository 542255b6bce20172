"""A shifted artefact as points of an artefact: for what simulates its readings, and for what searches them for effects.

    reading + e(reading) = shift_s + R_s · X_p + noise,    R_s a turn of the plate, or the cosine of the gauge's angle

Its dimensions X are free but for a known length, and its placings where the job does not know them exactly: only what those
cannot take up is an observation.

Shifted artefacts: their analysis along an axis or in a plane, the series of an axis as a plan, what they leave open.
"""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from cmm_uq import __version__
from cmm_uq.analysis.planning.set_up import Pattern, SetUp
from cmm_uq.analysis.planning.setting import Planning, Setting, Start
from cmm_uq.artefacts.gauge_lines import faces_of
from cmm_uq.artefacts.kinds import ShiftFacts
from cmm_uq.artefacts.shift import axis_page, plane_page
from cmm_uq.artefacts.shift.axis import ShiftResult, analyse_shift, checked_series, known_points, recorded_series
from cmm_uq.artefacts.shift.placed_plate import placed_plate, rotations
from cmm_uq.artefacts.shift.plane import PlaneShiftResult, analyse_plane, checked_plate
from cmm_uq.artefacts.shift.result import shift_facts, table_file
from cmm_uq.artefacts.shift.series import undetermined
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, day, names, say
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.certificate import certificate_of
from cmm_uq.certificate.clauses import clauses_data, formal_warnings
from cmm_uq.certificate.document import Document
from cmm_uq.certificate.origin import posterior_file
from cmm_uq.certificate.result import Outcome, OwnAnalysis, Recipe
from cmm_uq.certificate.sections.conformity import conformity_section
from cmm_uq.certificate.sections.results import as_found_data, as_found_section, headlines, overview_of
from cmm_uq.certificate.wording import Summary, figure_row
from cmm_uq.jobs.job import Job
from cmm_uq.machine.model.artefact import Artefact, Size
from cmm_uq.machine.physics.error_map import error_map_csv
from cmm_uq.maths.inference.ensembles import Progress

_ROUNDS = 8


class ShiftedArtefact(Artefact):
    """One observation of each reading of a gauge along its axis, two of each of a plate in its plane."""

    kind = "shift"
    title = say("Uncalibrated artefact, shifted")
    curves = True
    _known: tuple[int, int] | None = None

    def __init__(self, facts: ShiftFacts, points: Points, *, where: str | None = None) -> None:
        self.points, file = points, where or "recording"
        numbers, self._point = np.unique(points.point, return_inverse=True)
        placings, self._placing = np.unique(points.measurement, return_inverse=True)
        self._turns = facts.plane is not None
        self._axes: tuple[int, ...]
        self._start: tuple[Floats, Floats, Floats]
        if facts.plane is not None:
            plate = placed_plate(points, facts.plane, file)
            self._axes, free, self._start = plate.axes, True, (plate.balls, plate.moved, plate.turned)
        else:
            series = recorded_series(facts, points, file)
            self._axes, free = (AXES.index(series.axis),), series.u_shift > 0
            self._start = np.zeros((len(numbers), 1)), series.shifts[:, None], series.cosine
        n, d = len(points), len(self._axes)
        self._free = np.arange(1, len(placings)) if free else np.zeros(0, dtype=np.int64)
        self.rows = np.repeat(np.arange(n), d)[:, None]
        self.noise_scale = np.repeat(points.columns.get("noise_ratio", np.ones(n)), d)
        self._start = self._laid(points.carriages, None)
        if (known := facts.known) is not None:
            self._known = known_points(known, numbers)
            title, sd = say("Known length"), known.u_um * MICROMETRE
            self.sizes = (Size("known_mm", title, unit("mm"), known.length_mm, sd, say("length")),)

    @property
    def set_up(self) -> Text:
        return say("Set-up of the artefact")

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        placed = true_xyz.copy()
        readings = true_xyz + self.points.machine.origin_mm
        laid = self._predicted(*self._laid(readings, float(sizes[0]) if len(sizes) else None))
        placed[:, self._axes] += laid - readings[:, self._axes]
        return placed

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        return np.asarray(displacement[:, self._axes].reshape(len(self.rows), -1))

    def size_change(self) -> Floats:
        columns = self._columns(*self._start)
        return columns @ np.linalg.pinv(self._tie(self._start[0], columns.shape[1]))[:, : len(self.sizes)]

    def placing(self, xyz: Floats) -> Floats:
        columns = self._columns(*self._start)
        return np.asarray(columns @ self._untied(self._tie(self._start[0], columns.shape[1])))

    def _laid(self, readings: Floats, known: float | None) -> tuple[Floats, Floats, Floats]:
        """Dimensions (p, d), places (s, d) and turns, or cosines, (s,) nearest to readings (n, 3), with the known length."""
        body, moved, turned = self._start
        read, p, d = readings[:, self._axes], *body.shape
        for _ in range(_ROUNDS if self._turns else 1):
            columns = self._columns(body, moved, turned)
            tie = self._tie(body, columns.shape[1])
            step: Floats = np.zeros(columns.shape[1])
            if known is not None and self._known is not None:
                one, other = self._known
                length = float(np.linalg.norm(body[other] - body[one]))
                step += np.linalg.pinv(tie)[:, 0] * (known - length)
            missing = (read - self._predicted(body, moved, turned)).ravel() - columns @ step
            untied = self._untied(tie)
            step += np.asarray(untied @ np.linalg.lstsq(columns @ untied, missing, rcond=None)[0], dtype=np.float64)
            body = body + step[: p * d].reshape(p, d)
            change = step[p * d :].reshape(len(self._free), -1)
            moved, turned = moved.copy(), turned.copy()
            moved[self._free] += change[:, :d]
            if self._turns:
                turned[self._free] += change[:, d]
        return body, moved, turned

    def _turn(self, turned: Floats) -> Floats:
        """(n, d, d) of the artefact's axes at each reading."""
        return (rotations(turned) if self._turns else turned[:, None, None])[self._placing]

    def _predicted(self, body: Floats, moved: Floats, turned: Floats) -> Floats:
        return np.asarray(moved[self._placing] + np.einsum("nij,nj->ni", self._turn(turned), body[self._point]))

    def _columns(self, body: Floats, moved: Floats, turned: Floats) -> Floats:
        """(n·d, q) change of the readings for the dimensions, then for place and turn of each placing that is free."""
        (p, d), n, turn, each = body.shape, len(self.points), self._turn(turned), body.shape[1] + self._turns
        found, rows = np.zeros((n, d, p * d + each * len(self._free))), np.arange(n)
        for k in range(d):
            found[rows, :, d * self._point + k] = turn[:, :, k]
        about = np.einsum("nij,nj->ni", turn, body[self._point])
        for i, s in enumerate(self._free.tolist()):
            own, first = self._placing == s, p * d + each * i
            found[own, :, first : first + d] = np.eye(d)
            if self._turns:
                found[own, :, first + d] = about[own][:, ::-1] * [-1.0, 1.0]
        return found.reshape(n * d, -1)

    def _tie(self, body: Floats, count: int) -> Floats:
        """(1, q) change of the known length; (0, q) without one."""
        if self._known is None:
            return np.zeros((0, count))
        one, other = self._known
        d, step = body.shape[1], body[other] - body[one]
        row = np.zeros((1, count))
        row[0, d * other : d * other + d] = step / np.linalg.norm(step)
        row[0, d * one : d * one + d] = -step / np.linalg.norm(step)
        return row

    @staticmethod
    def _untied(tie: Floats) -> Floats:
        """(q, r) changes that leave the known length as it is."""
        return np.asarray(np.linalg.svd(tie)[2][1:].T) if len(tie) else np.eye(tie.shape[1])


def refuse_unfit(job: Job) -> None:
    if shift_facts(job).plane is not None:
        checked_plate(job)
    else:
        checked_series(job)


def analyse(job: Job, *, seed: int = 0, progress: Progress | None = None) -> ShiftResult | PlaneShiftResult:
    if shift_facts(job).plane is not None:
        return analyse_plane(job, seed=seed, progress=progress)
    return analyse_shift(job, seed=seed, progress=progress)


def outcome(found: ShiftResult | PlaneShiftResult, seed: int) -> Outcome:
    page: Any = axis_page if isinstance(found, ShiftResult) else plane_page
    job, left = found.job, page.quantities(found)
    told = [*page.warnings(found), *found.stating.warnings()]
    if job.circumstances.uncertainty.of_artefact:
        told.append(
            say(
                "What is stated of the artefact's temperature, expansion, alignment and fixturing is in no figure here."
            )
        )
    warned, measured = (*told, *formal_warnings(job)), day(job.facts.job.date)
    figures = tuple(figure_row(name, quantity) for _, _, name, quantity in left)
    short = Summary(page.measured(found), measured, headlines(found), figures, warnings=warned)
    draws, table = posterior_file(found.draws, job.origin), table_file(job)
    results = page.shift_results(found) | as_found_data(job) | clauses_data(job) | found.stating.data()
    results["posterior"] = draws.entry
    files = {table: error_map_csv(found.table).encode(), draws.name: draws.content}

    def certificate() -> Document:
        first, *others = page.sections(found)
        sections = [first, conformity_section(found.statements), as_found_section(job, left), *others]
        sampler, version = Verbatim(found.estimate.chains.sampler), Verbatim(__version__)
        produced_by = say(
            "cmm-uq {version}, {sampler}, seed {seed}", version=version, sampler=sampler, seed=found.estimate.seed
        )
        return certificate_of(job, sections, tuple(told), produced_by, tuple(names(files)), overview_of(found))

    return Outcome(found, certificate, results, short, warned, files, draws=found.draws, verdicts=found.verdicts)


OWN = OwnAnalysis(report=Recipe(analyse, outcome))


def shift_series(setting: Setting) -> tuple[SetUp, ...]:
    """The artefact's points along its axis, once for each shift."""
    facts, plan, volume = _facts(setting), setting.plan, setting.volume
    if facts.axis is None or not facts.shifts_mm:
        raise CmmUqError("axis and shifts_mm are needed", where="job.toml [artefact]",
                         fix='Give axis = "x" and shifts_mm = [0.0, 20.0], one shift a series')  # fmt: skip
    known = facts.known.length_mm if facts.known else plan.length_mm
    if known is None and not plan.lengths_mm:
        raise CmmUqError("the length of the artefact is needed", where="job.toml [plan] length_mm",
                         fix="Give it, with pitch_mm, or all distances as lengths_mm")  # fmt: skip
    places = np.concatenate([[0.0], faces_of(facts, plan.model_copy(update={"length_mm": known}))])
    i, start = AXES.index(facts.axis), volume.box.mean(axis=1)
    along, reach = np.eye(3)[i], float(places[-1] + np.ptp(facts.shifts_mm))
    if reach > volume.size[i]:
        raise volume.too_small(np.outer([0.0, reach], along), say("with its farthest shift"))
    start[i] = volume.box[i, 0] - min(facts.shifts_mm)
    numbers = np.arange(1, len(places) + 1)
    pattern = Pattern(np.outer(places, along), numbers, np.ones_like(numbers)).repeated(plan.repeats)
    titles = [(shift, say("shifted by {shift:g} mm", shift=shift)) for shift in facts.shifts_mm]
    return tuple(pattern.placed(setting.machine, np.eye(3), start + shift * along, words) for shift, words in titles)


def candidates(setting: Setting, start: Start | None) -> tuple[SetUp, ...]:
    _facts(setting)
    raise CmmUqError("a shift job has its series, and no other placings to choose from",
                     where="job.toml [plan] criterion", fix="Leave it out; shifts_mm says what is measured")  # fmt: skip


def free(setting: Setting, points: Points, where: str) -> tuple[Text, ...]:
    facts = _facts(setting)
    left = undetermined(recorded_series(facts, points, where), scale_known=facts.known is not None)
    found: list[Text] = [
        say("errors that repeat every {period:.4g} mm, or a half, a third … of it: every shift is a multiple of it",
            period=left.period)
    ]  # fmt: skip
    if facts.known is None:
        found.append(say("the mean scale of the axis: no length of the artefact is known"))
    if (shape := left.patterns.shape[1]) > 0:
        found.append(
            say("{shape} independent patterns of error at the places read, unless errors are smooth", shape=shape)
        )
    return tuple(found)


def _facts(setting: Setting) -> ShiftFacts:
    facts = cast("ShiftFacts", setting.artefact)
    if facts.plane is not None:
        problem = "the placings of a plate shifted in a plane are not planned"
        fix = "cmm-uq report says what those of a recording leave open"
        raise CmmUqError(problem, where="job.toml [artefact] plane", fix=fix)
    return facts


PLANNING = Planning({"shift series": shift_series}, candidates, free=free)
