"""A shift job carried from data to result: read, check, integrate, fit all readings at once, make the correction table."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cmm_uq.artefacts.shift_axis.curve import Curve, CurveEstimate, estimate_curve
from cmm_uq.artefacts.shift_axis.integration import IntegratedCurve, KnownSpan, Method, integrated
from cmm_uq.artefacts.shift_axis.series import ShiftedSeries, Undetermined, shifted_series, undetermined
from cmm_uq.artefacts.shifting.correction_table import correction_table
from cmm_uq.artefacts.shifting.found import Reported, ShiftFound, listed_draws, peak_to_valley
from cmm_uq.artefacts.shifting.kind import KnownLength, ShiftFacts, shift_facts
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.base.units import MICROMETRE, PPM, unit
from cmm_uq.jobs.job import Job
from cmm_uq.machine.physics.effects.rigid_body import SCALE
from cmm_uq.machine.physics.error_map import ErrorMap
from cmm_uq.maths.inference.ensembles import Progress
from cmm_uq.maths.uncertainty.quantity import Quantity, expanded_of

KNOWN = "job.toml [artefact] known"
_FINE = 101
_MISREAD = 0.02  # part of a known length by which the readings may differ from it


@dataclass(frozen=True, eq=False)
class ShiftResult(ShiftFound):
    """All that is known of a shift job after its analysis; see also :class:`~cmm_uq.artefacts.shifting.found.ShiftFound`."""

    estimate: CurveEstimate
    undetermined: Undetermined  # what no reading shows
    # the paper's integrations of two complete series, by method; empty otherwise
    integrated: dict[Method, IntegratedCurve]

    @property
    def axis(self) -> str:
        return self.estimate.series.axis

    @cached_property
    def fine(self) -> Curve:
        """The curve at evenly spaced positions over what was read."""
        return self.estimate.at(np.linspace(*self.estimate.series.span, _FINE))

    @cached_property
    def table(self) -> ErrorMap:
        return correction_table(self.axis, self.fine, self.job.points.machine)

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
        found = peak_to_valley(self.estimate.about_the_ends)
        return self.stating.stated(f"linearity_{self.axis}.peak_to_valley_um", found)

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
            **listed_draws(f"curves.linearity_{self.axis}.error_um", estimate.curve.draws / MICROMETRE, "µm"),
            **(listed_draws("artefact.distance_mm", estimate.artefact, "mm") if estimate.scale_known else {}),
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
    return ShiftResult(
        job, estimate, undetermined(series, scale_known=estimate.scale_known), _integrated(series, estimate, known)
    )


def checked_series(job: Job) -> tuple[ShiftedSeries, KnownSpan | None]:
    check_facts(job)
    facts = shift_facts(job)
    series = recorded_series(facts, job.points, job.recording_path)
    return series, None if facts.known is None else _known(facts.known, series)


def recorded_series(facts: ShiftFacts, points: Points, where: str) -> ShiftedSeries:
    if facts.axis is None:
        raise CmmUqError("neither axis nor plane", where="job.toml [artefact]",
                         fix='Name the axis shifted along, axis = "x", or a plate\'s plane, plane = "xy"')  # fmt: skip
    if not facts.shifts_mm:
        raise CmmUqError("is missing", where="job.toml [artefact] shifts_mm",
                         fix="Give one shift a series, 0.0 for the first")  # fmt: skip
    return shifted_series(
        points, facts.axis, np.array(facts.shifts_mm, dtype=np.float64), facts.u_shift_um * MICROMETRE, where
    )


def check_facts(job: Job) -> None:
    facts, aside = job.facts, job.facts.recording.measurements_aside
    if facts.model.effects:
        raise CmmUqError("a shift job estimates errors as free functions, not by effects",
                         where="job.toml [model] effects", fix="Write effects = []")  # fmt: skip
    if facts.conformity:
        raise CmmUqError("no standard here decides on curves of errors", where="job.toml [[conformity]]",
                         fix="Leave it out; the certificate states the errors with their uncertainty")  # fmt: skip

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
            raise CmmUqError(
                f"there is no point {number}", where=KNOWN, fix=f"Points are {numbers[0]} to {numbers[-1]}"
            )
    if given.from_point == given.to_point:
        raise CmmUqError(f"from and to are both point {given.from_point}", where=KNOWN, fix="Name two points")
    return index[given.from_point], index[given.to_point]


def check_known(given: KnownLength, measured: float) -> None:
    """Refuse a known length that the readings contradict grossly."""
    if abs(measured - given.length_mm) > _MISREAD * given.length_mm:
        raise CmmUqError(f"points {given.from_point} and {given.to_point} read {measured:.6g} mm apart, not "
                         f"{given.length_mm:g} mm", where=KNOWN, fix="Mend the length or the points")  # fmt: skip


def _known(given: KnownLength, series: ShiftedSeries) -> KnownSpan:
    first, last = known_points(given, series.numbers)
    mean = [float(np.mean((series.reading - series.shifts[series.series])[series.point == i])) for i in (first, last)]
    measured = mean[1] - mean[0]
    check_known(given, abs(measured))
    return KnownSpan(first, last, float(np.copysign(given.length_mm, measured)), given.u_um * MICROMETRE)


def _integrated(
    series: ShiftedSeries, estimate: CurveEstimate, known: KnownSpan | None
) -> dict[Method, IntegratedCurve]:
    if series.pair is None:
        return {}
    a, b = series.pair
    scatter = float(estimate.sigma.mean()) * series.noise_scale
    u = np.stack([scatter[series.series == 0], scatter[series.series == 1]])
    shift = float(series.shifts[1] - series.shifts[0]) if series.u_shift == 0 else None
    methods: tuple[Method, ...] = ("pitch", "improved")
    return {method: integrated(a, b, u, method=method, shift=shift, known=known) for method in methods}
