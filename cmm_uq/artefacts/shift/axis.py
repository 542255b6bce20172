"""The error of an axis from all shifted readings at once, with its posterior.

    reading + e(reading) = X_point · cos + D_series + drift · time + noise,    e(x) = slope · x + smooth function

The artefact's dimensions X and the slope are free; D is known, or known within its uncertainty; a known length ties two X.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.artefacts.kinds import KnownLength, ShiftFacts
from cmm_uq.artefacts.shift import result as shared
from cmm_uq.artefacts.shift.integration import IntegratedCurve, KnownSpan, Method, integrated
from cmm_uq.artefacts.shift.result import Curve, Reported, ShiftFound
from cmm_uq.artefacts.shift.series import RepeatedDrift, ShiftedSeries, Undetermined, shifted_series, undetermined
from cmm_uq.artefacts.shift.smooth import FINEST, SmoothFunction, SmoothModel, sampled
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING
from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.base.units import HOUR, MICROMETRE, PPM, unit
from cmm_uq.base.values import dataclass, replace
from cmm_uq.jobs.job import Job
from cmm_uq.machine.physics.effects.rigid_body import SCALE
from cmm_uq.machine.physics.error_map import ErrorMap
from cmm_uq.maths.inference.ensembles import Progress
from cmm_uq.maths.uncertainty.quantity import Quantity, expanded_of

_TYPICAL = 5 * MICROMETRE
_DRIFT = 10 * MICROMETRE  # standard deviation of the drift, mm per hour


@dataclass(frozen=True, eq=False)
class CurveEstimate(shared.Estimated):
    series: ShiftedSeries  # series, known: what it was made from
    known: KnownSpan | None
    scale_known: bool  # whether the mean sensitivity is determined: by a known length, or by shifts known exactly

    @cached_property
    def _ends(self) -> Floats:
        a = self.series.reading[self.series.series == 0]
        return np.array([a[0], a[-1]])

    def _raw(self, position: Floats) -> Floats:
        slope = self.coefficients.flat[:, -1:]
        return np.asarray(slope * (position - self._ends[0]) + self.coefficients.function(0, position))

    def at(self, position: Floats) -> Curve:
        """The curve, zero at the first reading of the first series; at its last one too unless the scale is known."""
        values, ends = self._raw(position), self._raw(self._ends)
        values -= ends[:, :1]
        if not self.scale_known:
            part = (position - self._ends[0]) / (self._ends[1] - self._ends[0])
            values -= (ends[:, 1:] - ends[:, :1]) * part
        return Curve(position, values)

    @cached_property
    def curve(self) -> Curve:
        return self.at(self.series.positions)

    @cached_property
    def scale(self) -> Floats:
        """(N,) draws of the mean of e' between the first and last reading of the first series."""
        ends = self._raw(self._ends)
        return np.asarray((ends[:, 1] - ends[:, 0]) / (self._ends[1] - self._ends[0]))

    @cached_property
    def about_the_ends(self) -> Floats:
        """(N, m) draws of the curve about the line through its ends at the first series, mm."""
        draws = self.curve.draws
        return draws - self.scale[:, None] * (self.curve.position - self._ends[0]) if self.scale_known else draws

    @cached_property
    def shifts(self) -> Floats:
        """(N, s) draws of the shift of each series against the first, mm; the nominal ones where they are known exactly."""
        nominal = np.tile(self.series.shifts, (len(self.sigma), 1))
        if self.series.u_shift > 0:
            nominal[:, 1:] += self.coefficients.columns[:, : len(self.series.shifts) - 1]
        return nominal

    @cached_property
    def artefact(self) -> Floats:
        """(N, p) draws of the distances of the points from the first along the artefact, mm."""
        flat, columns = self.coefficients.flat, self.coefficients.columns
        places = flat @ _point_columns(self.series, self.known).T
        if self.known is not None:
            places[:, self.known.last] += self.known.length
            if self.known.u > 0:
                places[:, self.known.last] += columns[:, -1]
        return np.asarray(places - places[:, :1])

    @cached_property
    def residuals(self) -> tuple[Floats, Floats]:
        """(n,) what does not fit, mm: with no error of the machine but its scale, and with the curve."""
        count = len(self.series.reading)
        before = self.coefficients.model.without_functions(float(self.sigma.mean()))
        return before[:count], self.coefficients.left[:count]


def estimate_curve(
    series: ShiftedSeries, known: KnownSpan | None = None, *, sigma: float | None = None, seed: int = 0,
    progress: Progress | None = None,
) -> CurveEstimate:  # fmt: skip
    """Fit all readings at once.

    ``sigma`` standard uncertainty of one reading, mm; from repeats and residuals when left out.
    """
    model = _model(series, known, sigma)
    if len(series.reading) - model.flat.shape[1] < 1:
        raise CmmUqError(f"{len(series.reading)} readings of {len(series.numbers)} points leave nothing to compare",
                         fix="Read more points in both placings, or a third placing")  # fmt: skip
    return CurveEstimate(*sampled(model, seed, progress), seed, series, known, known is not None or series.u_shift == 0)


def _point_columns(series: ShiftedSeries, known: KnownSpan | None) -> Floats:
    """(p, q) which flat coefficient, the slope last, is the place of each point: a known length lends two points one."""
    count = len(series.numbers)
    same = np.arange(count)
    if known is not None:
        same[known.last] = known.first
    own, index = np.unique(same, return_inverse=True)
    columns = np.zeros((count, len(own) + 1))
    columns[np.arange(count), index] = 1.0
    return columns


def _model(series: ShiftedSeries, known: KnownSpan | None, sigma: float | None) -> SmoothModel:
    low, high = series.span
    cosine = series.cosine[series.series]
    flat = cosine[:, None] * _point_columns(series, known)[series.point]
    flat[:, -1] = series.reading[series.series == 0][0] - series.reading
    observed = series.reading - series.shifts[series.series]
    columns, sd = [], []
    if series.u_shift > 0:
        columns += [(series.series == s).astype(np.float64) for s in range(1, len(series.shifts))]
        sd += [series.u_shift] * (len(series.shifts) - 1)
    if series.time is not None:
        columns.append((series.time - series.time[series.series == 0].mean()) / HOUR)
        sd.append(_DRIFT)
    if known is not None:
        ends = cosine * (series.point == known.last)
        observed = observed - known.length * ends
        if known.u > 0:
            columns.append(ends)
            sd.append(known.u)
    shortest = max(FINEST * (high - low), 0.5 * series.pitch)
    smooth = SmoothFunction(
        f"linearity_{series.axis}", low, high, shortest, series.reading, -np.ones(len(series.reading)), _TYPICAL
    )
    model = SmoothModel(
        observed, series.noise_scale, flat, np.column_stack(columns) if columns else np.zeros((len(observed), 0)),
        np.array(sd, dtype=np.float64), (smooth,), None if sigma is not None else series.scatter, sigma,
    )  # fmt: skip
    return (
        model if series.drift is None else _with_drift_seen(model, series.drift, series.u_shift > 0, len(series.shifts))
    )


def _with_drift_seen(model: SmoothModel, seen: RepeatedDrift, shifts_free: bool, count: int) -> SmoothModel:
    """One observation more: the drift that repeats show, of the column that stands after those of the shifts."""
    row = np.zeros((1, model.columns.shape[1]))
    row[0, count - 1 if shifts_free else 0] = 1.0
    smooth = model.functions[0]
    nowhere = replace(smooth, position=np.r_[smooth.position, smooth.low], factor=np.r_[smooth.factor, 0.0])
    return replace(
        model, observed=np.r_[model.observed, seen.rate], noise_scale=np.r_[model.noise_scale, seen.noise_scale],
        flat=np.vstack([model.flat, np.zeros((1, model.flat.shape[1]))]), columns=np.vstack([model.columns, row]),
        functions=(nowhere,),
    )  # fmt: skip


KNOWN = "job.toml [artefact] known"
_FINE = 101
_MISREAD = 0.02  # part of a known length by which the readings may differ from it


@dataclass(frozen=True, eq=False)
class SelectedPoints:
    """The integrations from some points alone, beside the joint fit of all."""

    numbers: Ints  # of the points, ascending
    integrated: dict[Method, IntegratedCurve]
    joint: Floats  # (n,) error by the joint fit at the positions of the integrations, mm

    @classmethod
    def of(
        cls, series: ShiftedSeries, estimate: CurveEstimate, known: KnownSpan | None, numbers: Ints
    ) -> SelectedPoints:
        points, where = np.flatnonzero(np.isin(series.numbers, numbers)), "job.toml [artefact] integrated_points"
        if series.pair is None:
            raise CmmUqError("a point was not read in both series", where=where, fix="Leave integrated_points out")
        ends = [] if known is None else series.numbers[[known.first, known.last]].tolist()
        if unknown := set(numbers.tolist()) - set(series.numbers.tolist()):
            raise CmmUqError(f"there is no point {min(unknown)}", where=where, fix="Name points that both series have")
        if len(points) < 3 or not set(ends) <= set(numbers.tolist()):
            with_ends = f", among them {ends[0]} and {ends[1]}, between which the length is known" if ends else ""
            raise CmmUqError("too few points for an integration", where=where, fix=f"Name three or more{with_ends}")
        found = _integrated(series, estimate, known, points)
        return cls(series.numbers[points], found, estimate.at(next(iter(found.values())).position).error)

    def left(self, method: Method) -> Floats:
        """(n,) what a method leaves of the error by the joint fit, mm, about zero at the first point."""
        return np.asarray(self.integrated[method].error - (self.joint - self.joint[0]))

    def peak_to_valley(self, method: Method) -> tuple[float, float]:
        """Of what it leaves, mm, with the standard uncertainty that the integration has of that difference."""
        left, C = self.left(method), self.integrated[method].covariance
        i, j = int(left.argmax()), int(left.argmin())
        return float(left[i] - left[j]), float(np.sqrt(max(C[i, i] + C[j, j] - 2 * C[i, j], 0.0)))


@dataclass(frozen=True, eq=False)
class ShiftResult(ShiftFound):
    """All that is known of a shift job after its analysis; see also :class:`~cmm_uq.artefacts.shift.result.ShiftFound`."""

    estimate: CurveEstimate
    undetermined: Undetermined  # what no reading shows
    # the paper's integrations of two complete series, by method; empty otherwise
    integrated: dict[Method, IntegratedCurve]
    selected: tuple[SelectedPoints, ...] = ()  # the same from some points alone

    @property
    def axis(self) -> str:
        return self.estimate.series.axis

    @cached_property
    def fine(self) -> Curve:
        """The curve at evenly spaced positions over what was read."""
        return self.estimate.at(np.linspace(*self.estimate.series.span, _FINE))

    @cached_property
    def table(self) -> ErrorMap:
        return shared.correction_table(self.axis, self.fine, self.job.points.machine)

    @cached_property
    def scale(self) -> Quantity | None:
        """Mean sensitivity error, ppm; ``None`` where nothing determines it."""
        if not self.estimate.scale_known:
            return None
        scale = Quantity.of_draws(self.estimate.scale / PPM, unit("ppm"))
        return self.stating.stated(f"{SCALE[self.axis].name}.ppm", scale)

    @cached_property
    def linearity(self) -> Quantity:
        """Linearity error: peak to valley of the curve about the line through its ends at the first series, µm."""
        found = shared.peak_to_valley(self.estimate.about_the_ends)
        return self.stating.stated(f"linearity_{self.axis}.peak_to_valley_um", found)

    @cached_property
    def statements(self) -> tuple[Statement, ...]:
        found = [(self.linearity, MICROMETRE, NOTHING)]
        figure = shared.figure_of(self.job.points, found, [float(np.ptp(self.estimate.series.span))])
        return shared.decided(self, {shared.OF_AN_AXIS: figure})

    @cached_property
    def reported(self) -> Reported:
        sizes = np.ptp(self.estimate.about_the_ends, axis=1) / MICROMETRE
        found = {f"linearity_{self.axis}.peak_to_valley_um": (sizes, "µm")}
        if self.estimate.scale_known:
            found[f"{SCALE[self.axis].name}.ppm"] = self.estimate.scale / PPM, "ppm"
        return found

    @cached_property
    def listed(self) -> Reported:
        estimate = self.estimate
        shifts = estimate.shifts.T if estimate.series.u_shift > 0 else ()
        return {
            **{f"shifts[{i}].mm": (draws, "mm") for i, draws in enumerate(shifts) if i > 0},
            **shared.listed_draws(f"curves.linearity_{self.axis}.error_um", estimate.curve.draws / MICROMETRE, "µm"),
            **(shared.listed_draws("artefact.distance_mm", estimate.artefact, "mm") if estimate.scale_known else {}),
        }

    @cached_property
    def shifts(self) -> tuple[Quantity, ...]:
        return tuple(Quantity.of_draws(draws, unit("mm")) for draws in self.estimate.shifts.T)

    @cached_property
    def distances(self) -> tuple[Floats, Floats, Floats] | None:
        """Of the artefact's points from the first, (p,) mm, with u and U of each; ``None`` without a scale."""
        draws = self.estimate.artefact
        mean, u = draws.mean(axis=0), draws.std(axis=0, ddof=1)
        return (mean, u, expanded_of(draws, mean)) if self.estimate.scale_known else None

    @cached_property
    def beside_integrations(self) -> Curve | None:
        """The curve at the positions of the integrations; ``None`` where there are none."""
        first = next(iter(self.integrated.values()), None)
        return None if first is None else self.estimate.at(first.position)


def analyse_shift(job: Job, *, seed: int = 0, progress: Progress | None = None) -> ShiftResult:
    stated = job.facts.recording.u_coordinate_um
    series, known = checked_series(job)
    estimate = estimate_curve(
        series, known, sigma=None if stated is None else stated * MICROMETRE, seed=seed, progress=progress
    )
    every = _integrated(series, estimate, known, np.arange(len(series.numbers)))
    chosen = [np.array(sorted(each), dtype=np.int64) for each in shared.shift_facts(job).integrated_points]
    selected = tuple(SelectedPoints.of(series, estimate, known, each) for each in (series.numbers, *chosen) if chosen)
    return ShiftResult(job, estimate, undetermined(series, scale_known=estimate.scale_known), every, selected)


def checked_series(job: Job) -> tuple[ShiftedSeries, KnownSpan | None]:
    check_facts(job)
    facts = shared.shift_facts(job)
    series = recorded_series(facts, job.points, job.recording_path)
    unshifted = series.reading - series.shifts[series.series]

    def apart(first: int, last: int) -> float:
        one, other = (float(np.mean(unshifted[series.point == i])) for i in (first, last))
        return other - one

    return series, None if facts.known is None else known_span(facts.known, series.numbers, apart)


def recorded_series(facts: ShiftFacts, points: Points, where: str) -> ShiftedSeries:
    if facts.axis is None:
        raise CmmUqError("neither axis nor plane", where="job.toml [artefact]",
                         fix='Name the axis shifted along, axis = "x", or a plate\'s plane, plane = "xy"')  # fmt: skip
    if not facts.shifts_mm:
        raise CmmUqError(
            "is missing", where="job.toml [artefact] shifts_mm", fix="Give one shift a series, 0.0 for the first"
        )
    return shifted_series(
        points, facts.axis, np.array(facts.shifts_mm, dtype=np.float64), facts.sd_shift_um * MICROMETRE, where
    )


def check_facts(job: Job) -> None:
    facts, aside = job.facts, job.facts.recording.measurements_aside
    if facts.model.effects:
        raise CmmUqError("a shift job estimates errors as free functions, not by effects",
                         where="job.toml [model] effects", fix="Write effects = []")  # fmt: skip
    shared.refuse_undecidable(job)
    if unknown := set(aside) - set(job.points.measurement.tolist()):
        raise CmmUqError(f"there is no measurement {min(unknown)}", where="job.toml [recording] set_aside",
                         fix="Name measurements that the recording has")  # fmt: skip
    if aside:
        raise CmmUqError("a series cannot be set aside", where="job.toml [recording] set_aside",
                         fix="Take the series out of the recording and its shift out of shifts_mm")  # fmt: skip


def known_points(given: KnownLength, numbers: Ints) -> tuple[int, int]:
    """Indices into ``numbers`` of the two points of a known length."""
    index = {int(number): i for i, number in enumerate(numbers)}
    for number in (given.from_point, given.to_point):
        if number not in index:
            problem = f"there is no point {number}"
            raise CmmUqError(problem, where=KNOWN, fix=f"Points are {numbers[0]} to {numbers[-1]}")
    if given.from_point == given.to_point:
        raise CmmUqError(f"from and to are both point {given.from_point}", where=KNOWN, fix="Name two points")
    return index[given.from_point], index[given.to_point]


def known_span(given: KnownLength, numbers: Ints, apart: Callable[[int, int], float]) -> KnownSpan:
    """A known length, along as ``apart`` measures it from point to point, mm; refused where that is grossly another."""
    first, last = known_points(given, numbers)
    measured = apart(first, last)
    if abs(abs(measured) - given.length_mm) > _MISREAD * given.length_mm:
        raise CmmUqError(f"points {given.from_point} and {given.to_point} read {abs(measured):.6g} mm apart, not "
                         f"{given.length_mm:g} mm", where=KNOWN, fix="Mend the length or the points")  # fmt: skip
    return KnownSpan(first, last, float(np.copysign(given.length_mm, measured)), given.u_um * MICROMETRE)


def _integrated(
    series: ShiftedSeries, estimate: CurveEstimate, known: KnownSpan | None, points: Ints
) -> dict[Method, IntegratedCurve]:
    """From the points of these indices alone, in ascending order."""
    if series.pair is None:
        return {}
    a, b = (readings[points] for readings in series.pair)
    if known is not None:
        first, last = np.searchsorted(points, [known.first, known.last]).tolist()
        known = replace(known, first=first, last=last)
    scatter = float(estimate.sigma.mean()) * series.noise_scale
    u = np.stack([scatter[series.series == 0][points], scatter[series.series == 1][points]])
    shift = float(series.shifts[1] - series.shifts[0]) if series.u_shift == 0 else None
    methods: tuple[Method, ...] = ("pitch", "improved")
    return {method: integrated(a, b, u, method=method, shift=shift, known=known) for method in methods}
