"""What is said of a point as soon as it is there: live length and deviation, what to expect, what a screening would say.

Every observation is predicted from all others, with the effects that the job names and what physics allows of them before
anything is measured: the deleted residual of least squares and its standard deviation σ/√(1 − h) (Cook & Weisberg 1982,
2.2.1), the priors being observations like others. The noise is what the job states of a coordinate, else what repeats and
residuals show; a set-up offset is not in it, so the interval is that of white noise.

A repeat more is asked for where the repeats of one set-up scatter by more than one set-up in a hundred would: their variance
against that of the stated noise (χ²), or against that of all other set-ups' repeats (F).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy import special

from cmm_uq.analysis.screening.screening import impossible_values, screen_recording
from cmm_uq.analysis.screening.shape import Screening
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, number, say, signed
from cmm_uq.base.points import Floats, Ints, Machine, Points
from cmm_uq.base.units import MICROMETRE
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.laboratory.live.lead import Lead, PlannedPoint, Row, Run
from cmm_uq.laboratory.live.recorder import COORDINATES
from cmm_uq.laboratory.live.story import Place, Point, Story
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.kind import Observe
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.maths.inference.linear_model import LinearModel

LEVEL = 0.95  # of the interval that is shown
RARE = 0.01  # part of sound set-ups whose repeats are asked for once more
FEWEST = 3  # degrees of freedom that the noise is estimated from
_DETERMINED = 1e-9  # 1 − h below which nothing but the observation itself says what it should be


@dataclass(frozen=True, eq=False)
class Predicted:
    """Each observation (m,) as measured, and as all others predict it, µm against the artefact's nominal sizes."""

    measured: Floats  # deviation from what the artefact's nominal sizes would give, the set-up's own freedoms fitted
    expected: Floats  # the same as predicted; ``nan`` where nothing else says anything
    u: Floats  # standard deviation of measured less expected
    factor: float  # of the interval at :data:`LEVEL`
    sigma: float  # standard deviation of a coordinate, µm


def predicted(model: RecordingModel) -> Predicted | None:
    """Every observation as all others predict it; ``None`` where neither the job nor the recording says what the noise is."""
    linear = model.linearised(np.array([unknown.prior_mean for unknown in model.unknowns]))
    sigma, degrees = _sigma(linear)
    if sigma is None:
        return None
    rows, known = linear.priors
    values = linear.prior_mean
    whitened = linear.reduce(linear.observed[:, None] - (linear.design @ values)[:, None])[:, 0]
    place = linear.freedoms.over(linear.noise_scale).dense()
    design = np.hstack([linear.design / linear.noise_scale[:, None], place])
    prior = np.hstack([sigma * rows, np.zeros((len(rows), place.shape[1]))])
    observed = (linear.observed - linear.design @ values) / linear.noise_scale
    fitted, leverage = _fitted(np.vstack([design, prior]), np.concatenate([observed, sigma * (known - rows @ values)]))
    m = len(observed)
    free = 1 - leverage[:m]
    seen = free > _DETERMINED
    left = np.where(seen, (observed - fitted[:m]) / np.where(seen, free, 1.0), np.nan)
    scale = linear.noise_scale / MICROMETRE
    upper = 0.5 + LEVEL / 2
    factor = float(special.stdtrit(degrees, upper) if np.isfinite(degrees) else special.ndtri(upper))
    measured = whitened * scale
    u = np.where(seen, sigma / np.sqrt(np.where(seen, free, 1.0)), np.inf) * scale
    return Predicted(measured, measured - left * scale, u, factor, sigma / MICROMETRE)


def _fitted(rows: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Fitted values and leverages of least squares, whatever the rank."""
    size = np.linalg.norm(rows, axis=0)
    U, s, _ = np.linalg.svd(rows / np.where(size > 0, size, 1.0), full_matrices=False)
    U = U[:, s > 1e-10 * s.max(initial=0.0)]
    return U @ (U.T @ values), np.einsum("ij,ij->i", U, U)


def _sigma(linear: LinearModel) -> tuple[float | None, float]:
    """Standard deviation of a coordinate, mm, as stated or as the residuals show it, and its degrees of freedom."""
    if linear.sigma is not None:
        return linear.sigma, np.inf
    reduced = linear.reduced
    fitted, leverage = _fitted(reduced.design, reduced.observed)
    degrees = reduced.count - round(float(leverage.sum()))
    if degrees < FEWEST:
        return None, 0.0
    return max(float(np.linalg.norm(reduced.observed - fitted)) / float(np.sqrt(degrees)), 1e-3 * MICROMETRE), degrees


@dataclass(frozen=True)
class RepeatScatter:
    measurement: int
    s: float  # standard deviation of a coordinate by its repeats, µm
    usual: float  # the same as stated, or of all others, µm
    limit: float  # what one set-up in a hundred exceeds, µm

    @property
    def words(self) -> Text:
        return say(
            "the repeats of measurement {m} scatter by {s:.2g} µm a coordinate; {usual:.2g} µm is usual, and one set-up in a "
            "hundred goes beyond {limit:.2g} µm: measure it once more",
            m=self.measurement, s=self.s, usual=self.usual, limit=self.limit,
        )  # fmt: skip


def scatter(model: RecordingModel, measurement: int) -> RepeatScatter | None:
    """The scatter of the repeats of a measurement where it asks for another; else, or where it is unknown, ``None``."""
    values = np.array([unknown.prior_mean for unknown in model.unknowns])
    try:
        residuals = model.residuals(values) / model.artefact.noise_scale / MICROMETRE
    except CmmUqError:
        return None
    own, own_dof = _within(model, residuals, model.artefact.measurement == measurement)
    others, dof = _within(model, residuals, model.artefact.measurement != measurement)
    if not own_dof:
        return None
    if model.sigma is not None:
        usual, factor = model.sigma / MICROMETRE, float(special.chdtri(own_dof, RARE)) / own_dof
    elif dof >= FEWEST and others > 0:
        usual, factor = float(np.sqrt(others / dof)), float(special.fdtri(own_dof, dof, 1 - RARE))
    else:
        return None
    s, limit = float(np.sqrt(own / own_dof)), usual * float(np.sqrt(factor))
    return RepeatScatter(measurement, s, usual, limit) if s > limit else None


def _within(model: RecordingModel, residuals: Floats, chosen: Floats) -> tuple[float, int]:
    """Sum of squares about the means of the same observation repeated, and its degrees of freedom."""
    artefact = model.artefact
    point = artefact.points.point[artefact.rows]
    keys = np.column_stack([artefact.measurement[:, None], point])[chosen]
    if not len(keys):
        return 0.0, 0
    _, index, counts = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    index = index.ravel()
    means = np.bincount(index, residuals[chosen]) / counts
    return float(np.sum((residuals[chosen] - means[index]) ** 2)), int(np.sum(counts - 1))


_EXCHANGED, _BETTER = 0.1, 0.25
"""Points of a set-up are exchanged where they miss the plan, moved as a whole, by more than this part of their distance (rms),
and by less than this part of that (squares) once they change places."""


@dataclass(frozen=True)
class PointJudgement:
    shown: tuple[Text, ...] = ()
    warnings: tuple[Text, ...] = ()
    again: Text | None = None  # why the set-up should be measured once more; ``None``: nothing asks for it


@dataclass(frozen=True, eq=False)
class Judge:
    facts: ArtefactFacts
    screening: Screening | None
    observe: Observe | None
    machine: Machine
    effects: tuple[Effect, ...]
    sigma: float | None  # standard uncertainty of a coordinate as stated, mm
    where: str  # the recording's name, for messages

    def point(self, step: PlannedPoint, story: Story, lead: Lead) -> PointJudgement:
        """Of a point that was just accepted."""
        taken = story.by_place
        own = taken[step.place]
        warnings = [finding.why for finding in impossible_values(self.points([Row(own, step)]))]
        figures = [own.columns.get(name) for name in COORDINATES]
        for other in story.points.values():
            if other.place != own.place and [other.columns.get(name) for name in COORDINATES] == figures:
                m, p, r = other.place
                warnings.append(say(
                    "its coordinates are those of measurement {m}, point {p}, repeat {r} to the last digit: a copied reading, "
                    "or the machine did not measure", m=m, p=p, r=r,
                ))  # fmt: skip
                break
        steps = lead.steps(step.run)
        if (exchanged := _exchanged(step, steps, taken)) is not None:
            warnings.append(
                say("points {own} and {other} seem exchanged against the plan", own=step.place[1], other=exchanged)
            )
        first = taken.get(steps[0].place)
        shown: tuple[Text, ...] = ()
        if first is not None and first is not own:
            length = float(np.linalg.norm(_xyz(own) - _xyz(first)))
            nominal = float(np.linalg.norm(step.xyz - steps[0].xyz))
            shown = (say(
                "{length} mm from point {first}; the plan has {nominal} mm: {off} µm",
                length=number(length, ".4f"), first=steps[0].place[1], nominal=number(nominal, ".4f"),
                off=signed((length - nominal) / MICROMETRE, "+.1f"),
            ),)  # fmt: skip
        return PointJudgement(shown, tuple(warnings))

    def run(self, run: Run, rows: Sequence[Row], *, repeats_most: int) -> PointJudgement:
        """Of a set-up that is complete, with all that are."""
        if self.observe is None or not rows:
            return PointJudgement()
        points = self.points(rows)
        needed = {column for effect in self.effects for column in effect.columns}
        try:
            found = screen_recording(
                points, self.facts, self.screening, self.observe, needed=needed & set(points.columns), set_aside=(),
                where=self.where,
            )  # fmt: skip
            warnings = [one.why for one in found.findings if run[0] in one.measurements]
            shown, again = self._expected(run, found.points, repeats_most)
        except CmmUqError as error:
            return PointJudgement((), (Verbatim(f"{error.problem}. {error.fix or ''}".rstrip()),))
        return PointJudgement(shown, tuple(warnings), again)

    def points(self, rows: Sequence[Row]) -> Points:
        """Rows as points, with the columns that all of them have."""
        known = [
            {**row.step.columns, **row.point.columns, **{name: one.value for name, one in row.point.joined.items()},
             **({"time_s": row.point.time_s} if row.point.timed else {})}
            for row in rows
        ]  # fmt: skip
        names = sorted(set(known[0]).intersection(*known) - {*COORDINATES})
        measurement, point, repeat = np.array([row.point.place for row in rows], dtype=np.int64).T.copy()
        return Points(
            np.array([_xyz(row.point) for row in rows]), measurement, point, repeat, self.machine,
            {name: np.array([values[name] for values in known], dtype=np.float64) for name in names}, in_seconds=True,
        )  # fmt: skip

    def _expected(self, run: Run, points: Points, repeats_most: int) -> tuple[tuple[Text, ...], Text | None]:
        """Deviation against expectation, and why to measure again."""
        if self.observe is None or not ((points.measurement == run[0]) & (points.repeat == run[1])).any():
            return (), None
        artefact = self.observe(self.facts, points, where=self.where)
        acting = tuple(one for one in self.effects if set(one.columns) <= set(points.columns) and not one.shape)
        model = RecordingModel(artefact, acting, self.sigma)
        prediction = predicted(model)
        if prediction is None:
            why = say("what to expect is said once repeats show the scatter, or with u_coordinate_um in [recording]")
            return (why,), None
        own = (artefact.measurement == run[0]) & (artefact.repeat == run[1])
        shown, odd = _against(prediction, np.flatnonzero(own))
        if run[1] >= repeats_most:
            return shown, None
        spread = scatter(model, run[0])
        return shown, odd if spread is None else spread.words


def _against(found: Predicted, own: Ints) -> tuple[tuple[Text, ...], Text | None]:
    """The worst observation of a set-up against what is expected of it, and whether it is too far off to be chance."""
    own = own[np.isfinite(found.expected[own])]
    if not len(own):
        return (), None
    off = np.abs(found.measured - found.expected)[own] / found.u[own]
    worst = int(own[int(np.argmax(off))])
    value, expected = found.measured[worst], found.expected[worst]
    half = found.factor * found.u[worst]
    which = say("deviation") if len(own) == 1 else say("worst of {count} deviations", count=len(own))
    shown = say(
        "{which} {value} µm; expected {expected} ± {half} µm ({level:.0f} %)", which=which, value=signed(value, "+.1f"),
        expected=signed(expected, "+.1f"), half=number(half, ".1f"), level=100 * LEVEL,
    )  # fmt: skip
    chance = min(1.0, len(own) * 2 * float(special.ndtr(-off.max() * special.ndtri(0.5 + LEVEL / 2) / found.factor)))
    if chance >= RARE:
        return (shown,), None
    return (shown,), say(
        "it lies {off} µm from what all else says, and chance does that once in {times:.0f} set-ups: measure it once more",
        off=signed(value - expected, "+.1f"),
        times=min(1 / max(chance, 1e-6), 1e6),
    )


def _exchanged(step: PlannedPoint, steps: Sequence[PlannedPoint], taken: Mapping[Place, Point]) -> int | None:
    """Number of the point of its set-up that the newest has changed places with; where the set-up stands is no matter."""
    there = [other for other in steps if other.place in taken]
    planned, found = np.array([other.xyz for other in there]), np.array([_xyz(taken[other.place]) for other in there])
    missed, own = _missed(planned, found), there.index(step)
    for i, other in enumerate(there):
        apart = float(np.linalg.norm(other.xyz - step.xyz))
        if not apart or missed <= len(there) * (_EXCHANGED * apart) ** 2:
            continue
        order = np.arange(len(there))
        order[[own, i]] = order[[i, own]]
        if _missed(planned, found[order]) < _BETTER * missed:
            return other.place[1]
    return None


def _missed(planned: Floats, found: Floats) -> float:
    """Sum of squares by which points miss the plan, their means laid on each other."""
    return float(np.sum((found - found.mean(axis=0) - planned + planned.mean(axis=0)) ** 2))


def _xyz(point: Point) -> Floats:
    return np.array([point.columns[name] for name in COORDINATES])
