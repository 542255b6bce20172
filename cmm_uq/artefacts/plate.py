"""Plate: balls or holes at reference positions, placed rigidly and anyhow in each measurement.

All three coordinates of every ball are observations; the six freedoms of each placing are projected out exactly. What the
certificate leaves open is in the length of the plate as far as all positions have it in common, and an error of each ball
where that is more. Nominal positions leave that scale free.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import hypot
from typing import Any, ClassVar, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.planning import candidates
from cmm_uq.analysis.planning.set_up import PRINCIPAL_PLANES, Pattern, SetUp
from cmm_uq.analysis.planning.setting import Planning, Setting
from cmm_uq.analysis.screening.shape import ArtefactShape, Screening, body_misfit, rows_by, spread
from cmm_uq.artefacts.kinds import PlateFacts
from cmm_uq.base.messages import Text, Verbatim, day, number, say, sentences
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.units import MICROMETRE, PPM, unit
from cmm_uq.certificate.document import Block, Column, Paragraph, Section, Table, figure_columns, section, table
from cmm_uq.certificate.origin import quantity_data
from cmm_uq.certificate.plots.volume import vector_plot
from cmm_uq.certificate.result import Page, Result
from cmm_uq.certificate.wording import expanded
from cmm_uq.jobs.recording.compared import NOISE_RATIO
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.plan import PlanFacts
from cmm_uq.machine.model.artefact import Indications, Placings, Size
from cmm_uq.machine.model.artefact_doubt import CertifiedPlaces, by_certificate, faults, since_earlier
from cmm_uq.machine.model.placed import Rigid
from cmm_uq.machine.model.recorded import check_length, columns_needed, expansion, refuse
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.effects.own_errors import Body
from cmm_uq.machine.physics.effects.rigid_body import SCALE
from cmm_uq.maths.inference.posterior import Cause
from cmm_uq.maths.uncertainty.quantity import Quantity, alike, rounded

DRILLED_UM = 30.0  # standard deviation of holes from their nominal places, and of balls glued to a plate, µm
CHANGED_UM = 2.0  # by how much a plate may have changed its shape between two dates, µm
REFERENCES = ("reference_x_mm", "reference_y_mm", "reference_z_mm")


class Plate(Rigid):
    """A plate as recorded: 3n observations (x, y, z of each ball in turn) of n points.

    ``facts`` what the job says of the plate; ``length_mm`` is that of the farthest ball from the first by its number
    where it is not stated; ``points`` the recording, with ``reference_x_mm``, ``reference_y_mm``, ``reference_z_mm``.
    An earlier recording in place of references (:mod:`cmm_uq.jobs.recording.compared`) adds its own noise.
    """

    kind = "plate"
    title = say("Plate")
    size_title: ClassVar[Text] = say("Length of the plate")
    size_what: ClassVar[Text] = say("length")
    plural: ClassVar[str] = "the recorded plates"  # what is measured, for messages
    mend: ClassVar[str] = "Check the numbering of the balls and their reference positions"

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
        self.sizes = (Size("length_mm", self.size_title, unit("mm"), length, sd, self.size_what),)
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

    @property
    def _since_earlier(self) -> bool:
        return NOISE_RATIO in self.points.columns

    def own_faults(self) -> Iterable[Effect]:
        body = Body.of(self.points, self.reference, () if self._since_earlier else REFERENCES)
        certified = by_certificate(self.certificate.u_um(self.sizes[0].sd), DRILLED_UM)
        known = since_earlier(CHANGED_UM) if self._since_earlier else certified
        return faults(self._facts, self.points, body, known)

    def size_change(self) -> Floats:
        return self._together.reshape(-1, 1)

    def unread(self) -> NDArray[np.bool_]:
        found = super().unread()
        if self._since_earlier:
            found |= self.placings.still(self.reference).ravel()
        return found

    def calibration(self) -> Cause | None:
        own = self.certificate.beyond(self.sizes[0], *self._ends, self.size_change()[:, 0], self.expansion)
        return None if self._since_earlier else own

    def indications(self) -> Indications | None:
        """Distances between every two balls of a (measurement, repeat), against the certified ones."""
        if not self.sizes[0].certified:
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
        points, numbers, (nominal, found) = self.points, self.placings.numbers, self.extents()
        lost = (nominal == 0) | (found == 0)
        number = numbers[np.argmax(lost)]
        problem = f"measurement {number} has no two different balls, so it tells no length of the plate"
        fix = "Record at least three balls of different reference positions in each measurement, or leave it out"
        refuse(points, (points.measurement == number) & lost.any(), where, problem, fix)
        length = self.sizes[0].nominal
        check_length(float(found.sum() / nominal.sum()) * length, length, self.plural, where)
        self.refuse_another_shape(self.mend, where)


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


def _pattern(setting: Setting) -> Pattern:
    return plate(setting.artefact, setting.plan, float(setting.volume.size.min()))


def plate_placings(setting: Setting) -> tuple[SetUp, ...]:
    """Flat at two heights, upright along X front and back, upright along Y left and right."""
    pattern, found = _pattern(setting), []
    for (title, attitude), places in zip(PRINCIPAL_PLANES, (
        ((0.5, 0.5, 0.0), (0.5, 0.5, 1.0)), ((0.5, 0.0, 0.5), (0.5, 1.0, 0.5)), ((0.0, 0.5, 0.5), (1.0, 0.5, 0.5)),
    ), strict=True):  # fmt: skip
        candidates.check_allowed(setting, attitude[:, 2], candidates.ACROSS)
        found += [setting.volume.set_up(pattern, attitude, place, title) for place in places]
    return tuple(found)


_PLANES = candidates.across_planes
_PLACES = candidates.VolumeCandidates(_PLANES, _pattern, candidates.RelocatedCandidates(_PLANES))
PLANNING = Planning({"plate placings": plate_placings}, _PLACES.candidates, _PLACES.elsewhere)

STEEL = 11.5e-6  # expansion of a plate whose own is not stated, 1/K


class CommonScale(NamedTuple):
    """The common part of the scales between two dates, and the change of temperature of the plate that looks the same."""

    change: Quantity
    cte_per_k: float
    warmer: Quantity


class PlateFigures(NamedTuple):
    """Displacements of all balls before the fitted model, in the plate's own axes, and after it, µm."""

    before_um: Floats  # before_um, after_um: (n, 3)
    after_um: Floats
    placings: list[dict[str, float]]  # of each the number of balls, root mean square and largest coordinate, µm
    common: CommonScale | None  # of a comparison of two dates


def figures(result: Result) -> PlateFigures:
    plate = cast("Plate", result.artefact)
    before = np.einsum("nij,ni->nj", plate.attitudes(plate.points.xyz), plate.deviations()) / MICROMETRE
    after = result.residuals.reshape(-1, 3) / MICROMETRE
    placings = []
    for measurement in plate.placings.numbers.tolist():
        chosen = plate.points.measurement == measurement
        placing: dict[str, float] = {"measurement": measurement, "balls": int(chosen.sum())}
        for when, values in (("before", before[chosen]), ("after", after[chosen])):
            placing[f"rms_{when}_um"] = float(np.sqrt(np.mean(values**2)))
            placing[f"largest_{when}_um"] = float(np.abs(values).max())
        placings.append(placing)
    return PlateFigures(before, after, placings, _common(result) if compared(result) else None)


def compared(result: Result) -> bool:
    """Whether the references are an earlier recording of the plate itself."""
    return result.job.facts.recording.earlier is not None


def _common(result: Result) -> CommonScale | None:
    scales = [effect.name for effect in SCALE.values() if effect.name in result.parameters]
    if not scales:
        return None
    columns = {unknown.key[0]: i for i, unknown in enumerate(result.posterior.unknowns)}
    cte = result.job.facts.artefact.cte_per_k or STEEL
    change = Quantity.of_draws(result.values[:, [columns[name] for name in scales]].mean(axis=1), unit("ppm"))
    return CommonScale(change, cte, change.times(-PPM / cte, unit("K")))


def results(result: Result) -> dict[str, Any]:
    found = figures(result)
    data: dict[str, Any] = {"placings": found.placings}
    if (common := found.common) is not None:
        data["common_scale"] = {
            "ppm": quantity_data(common.change),
            "cte_per_k": common.cte_per_k,
            "plate_warmer_by_k": quantity_data(common.warmer),
        }
    return data


_PLATES_SHOWN = 6
_CERTIFIED = (say("Positions on the plate"), say("Found minus certified"), say("After the fitted model"))
_COMPARED = (say("What changed between the two dates"), say("Now minus then"), say("After the fitted change"))


def sections(result: Result) -> list[Section]:
    plate, found = cast("Plate", result.artefact), figures(result)
    title, *titles = _COMPARED if compared(result) else _CERTIFIED
    arrows = (_arrows(plate, found, one, titles) for one in plate.placings.numbers[:_PLATES_SHOWN].tolist())
    return [section(title, _table(result, found), _confounded(result, found.common), *arrows)]


def _confounded(result: Result, common: CommonScale | None) -> Paragraph | None:
    if not compared(result):
        return None
    earlier = result.job.facts.recording.earlier_date
    recording = say("the earlier recording of {date}", date=day(earlier)) if earlier else say("the earlier recording")
    texts: list[Text] = [
        say(
            "References are the positions found by {recording}; the error factors of "
            "this certificate are what changed since. Errors of machine and plate that were there on "
            "both dates cancel, as long as the plate stood in the same places.",
            recording=recording,
        )
    ]
    if common is not None:
        value, U, _ = expanded(common.change)
        kelvin, cte = rounded(abs(common.warmer.value), 2 * common.warmer.u)[0], common.cte_per_k / PPM
        colder = say(
            "A plate that was colder by {kelvin} K (at {cte:.3g} ppm/K) than its recorded temperatures account for "
            "looks the same, and so does one that has shrunk by as much.", kelvin=kelvin, cte=cte,
        )  # fmt: skip
        warmer = say(
            "A plate that was warmer by {kelvin} K (at {cte:.3g} ppm/K) than its recorded temperatures account for "
            "looks the same, and so does one that has grown by as much.", kelvin=kelvin, cte=cte,
        )  # fmt: skip
        texts.append(say("The common part of the scales changed by {value} ppm, U = {U} ppm.", value=value, U=U))
        texts.append(colder if common.change.value > 0 else warmer)
    texts.append(say("A plate that has sheared or bent since looks like squareness or straightness of its plane."))
    return Paragraph(sentences(texts))


def _arrows(plate: Plate, found: PlateFigures, number: int, titles: Sequence[Text]) -> Block:
    """One placing as arrows, repeats averaged; the two largest extents of the references span the plane."""
    rows = plate.points.measurement == number
    axes = np.sort(np.argsort(np.ptp(plate.reference, axis=0))[1:])
    balls, index = np.unique(plate.points.point[rows], return_inverse=True)

    def mean(values: Floats) -> Floats:
        sums = np.zeros((len(balls), 2))
        np.add.at(sums, index, values[rows][:, axes])
        return sums / np.bincount(index)[:, None]

    arrows = mean(found.before_um), mean(found.after_um)
    before, after = alike(*(max(hypot(*arrow) for arrow in some.tolist()) for some in arrows))
    first, second = (Verbatim(AXES[axis]) for axis in axes)
    return vector_plot(
        mean(plate.reference), tuple(zip(titles, arrows, strict=True)),
        axis_labels=(say("Plate {first} / mm", first=first), say("Plate {second} / mm", second=second)),
        caption=say(
            "Measurement {measurement}: displacement of each ball in the plane of the plate, placed by least squares.",
            measurement=number,
        ),
        alternative=say(
            "Arrows at {count} balls: up to {before} µm as recorded, up to {after} µm after the fitted model.",
            count=len(balls), before=before, after=after,
        ),
    )  # fmt: skip


def _table(result: Result, found: PlateFigures) -> Table | None:
    rows = (
        (number(placing), number(balls), *(rounded(size, result.noise.coordinate.value)[0] for size in sizes))
        for placing, balls, *sizes in (one.values() for one in found.placings)
    )
    sizes = (say("rms before"), say("Largest before"), say("rms after"), say("Largest after"))
    note = say(
        "Coordinates of every ball minus its reference position, before and after the fitted model; the set-up is fitted."
    )
    return table(
        say("Deviation of a coordinate"),
        (say("Set-up"), Column(say("Balls")), *figure_columns(*sizes, unit=unit("µm"))),
        rows,
        note,
    )


PAGE = Page(sections, results)
