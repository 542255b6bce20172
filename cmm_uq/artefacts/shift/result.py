"""What every analysis of shifted artefacts gives, along an axis or in a plane, and what certificates show of it.

The largest difference of a drawn curve is never zero and grows with every uncertainty (JCGM 101:2008, 9.4), so an interval
of such draws lies above the truth, and never holds a straight curve. Here the differences c_i − c_j between all pairs of
positions get one factor k, from the draws, that holds them all at once: the largest lies between the largest d_ij − k·u_ij,
no less than 0, and the largest d_ij + k·u_ij. With 99.5 % it says which pairs can be the largest at all, and with 95.5 % of
these alone (Bonferroni).

Errors of a shifted axis, or of the two axes of a plane, are decided against the limits of a laboratory.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.conformity.standards import decidable, statement
from cmm_uq.analysis.conformity.statement import NOT_CONVERGED, Statement, by_standard
from cmm_uq.artefacts.kinds import SHIFT, ShiftFacts
from cmm_uq.artefacts.shift.smooth import Coefficients
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, number, say
from cmm_uq.base.points import AXES, Floats, Machine, Points
from cmm_uq.base.units import ARCSECOND, MICROMETRE, unit
from cmm_uq.base.values import dataclass, replace
from cmm_uq.certificate.clauses import artefact_rows, certificate_rows, traceability_section
from cmm_uq.certificate.document import Block, Facts, Paragraph, Section, section
from cmm_uq.certificate.origin import file_name, quantity_data
from cmm_uq.certificate.result import StatedUncertainty
from cmm_uq.certificate.results.contents import covariance_data, head, statement_data
from cmm_uq.certificate.sections.results import Left, stated_table
from cmm_uq.certificate.wording import SIGN
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.verdicts import Verdicts
from cmm_uq.machine.model.artefact import Artefact, ArtefactFigure
from cmm_uq.machine.physics.error_map import AxisErrors, ErrorMap
from cmm_uq.maths.inference.draws import Draws, by_ensemble
from cmm_uq.maths.inference.ensembles import Chains
from cmm_uq.maths.uncertainty.quantity import Quantity, expanded_of, nominal, significant
from cmm_uq.maths.uncertainty.type_a import Covariance


@dataclass(frozen=True, eq=False)
class Curve:
    """Draws of e at positions, true = indicated + e."""

    position: Floats  # (m,) mm
    draws: Floats  # (N, m) mm

    @cached_property
    def error(self) -> Floats:
        """(m,) posterior means, mm."""
        return np.asarray(self.draws.mean(axis=0))

    @cached_property
    def u(self) -> Floats:
        """(m,) standard uncertainties, mm."""
        return np.asarray(self.draws.std(axis=0, ddof=1))

    @cached_property
    def interval95(self) -> tuple[Floats, Floats]:
        """Ends of the 95 % interval at each position."""
        low, high = np.quantile(self.draws, [0.025, 0.975], axis=0)
        return np.asarray(low), np.asarray(high)

    @cached_property
    def expanded(self) -> Floats:
        """(m,) U: at each position the larger distance from the error to an end of its 95 % interval, mm."""
        return expanded_of(self.draws, self.error)

    @cached_property
    def band(self) -> Floats:
        """(m,) half width of the band that holds the whole curve with 95 % probability, mm."""
        return self.simultaneous_factor * self.u

    @cached_property
    def simultaneous_factor(self) -> float:
        """The k for which error ± k·u holds the whole curve in 95 % of draws."""
        moving = self.u > 1e-9 * max(self.u.max(), 1e-12)
        if not moving.any():
            return 0.0
        away = np.abs(self.draws[:, moving] - self.error[moving]) / self.u[moving]
        return float(np.quantile(away.max(axis=1), 0.95))


_DRAWS = 4000  # for the factor: its quantile is then known to a percent
_CAN_BE, _HOLDS = 0.995, 0.955
_POSITIONS = 200  # more are thinned out: a smooth curve has no more to say


def peak_to_valley(curve: Floats) -> Quantity:
    """Largest difference of a curve between two positions, µm.

    ``curve`` (N, m) draws, mm. Gives that of the mean curve, the standard deviation of that of the draws, and the
    interval of all pairs.
    """
    low, high = _ends(curve)
    sizes, value = np.ptp(curve, axis=1) / MICROMETRE, float(np.ptp(curve.mean(axis=0))) / MICROMETRE
    return Quantity(value, float(sizes.std(ddof=1)), (low / MICROMETRE, high / MICROMETRE), unit("µm"))


def _ends(curve: Floats) -> tuple[float, float]:
    mean, covariance = curve.mean(axis=0), np.atleast_2d(np.cov(curve, rowvar=False))
    spread = np.linspace(0, len(mean) - 1, min(_POSITIONS, len(mean))).astype(int)
    chosen = np.union1d(spread, [mean.argmin(), mean.argmax()])
    mean, variance = mean[chosen], np.diag(covariance)[chosen]
    square = variance[:, None] + variance - 2 * covariance[np.ix_(chosen, chosen)]
    u = np.sqrt(np.where(square > 1e-12 * variance.max(initial=0.0), square, 0.0))
    draws = curve[np.linspace(0, len(curve) - 1, min(_DRAWS, len(curve))).astype(int)][:, chosen] - mean
    difference = mean[:, None] - mean
    within = _factor(draws, u, u > 0, _CAN_BE) * u
    among = difference + within >= np.max(difference - within)
    within = _factor(draws, u, among & (u > 0), _HOLDS) * u
    return float(np.max((difference - within)[among]).clip(0.0)), float(np.max((difference + within)[among]))


def _factor(draws: Floats, u: Floats, among: NDArray[np.bool_], level: float) -> float:
    """The k for which draws (N, m) about their mean keep the differences of some pairs (m, m) within k·u that often."""
    away = np.zeros(len(draws))
    for i in np.flatnonzero(among.any(axis=1)):
        away = np.maximum(away, np.max(np.abs(draws[:, [i]] - draws[:, among[i]]) / u[i, among[i]], axis=1))
    return float(np.quantile(away, level))


Reported = Mapping[str, tuple[Floats, str]]  # draws (N,) of something that is reported, and its unit, by its name


_STILL = 1e-9  # part of the largest spread in a list up to which an item does not move but for rounding


@dataclass(frozen=True, eq=False)
class Estimated(ABC):
    coefficients: Coefficients  # joint draws of everything linear
    chains: Chains  # of the hyper-parameters, and how they converged
    seed: int  # of everything random

    @property
    def sigma(self) -> Floats:
        """(N,) draws of the standard uncertainty of one coordinate of one reading, mm."""
        return self.coefficients.sigma

    @property
    @abstractmethod
    def residuals(self) -> tuple[Floats, Floats]:
        """What does not fit, mm: with no error of the machine but scale and squareness, and with what was estimated."""


@dataclass(frozen=True, eq=False)
class ShiftFound(ABC):
    job: Job  # what was analysed
    estimate: Estimated  # of the machine and the artefact, with its posterior

    @property
    def statements(self) -> tuple[Statement, ...]:
        return ()

    @cached_property
    def verdicts(self) -> Verdicts:
        return Verdicts(map(by_standard, self.statements))

    @cached_property
    def disagreement_um(self) -> tuple[float, float]:
        """Root mean square of what the placings disagree by, without and with the machine's errors, µm."""
        without, with_errors = (float((r**2).mean() ** 0.5) / MICROMETRE for r in self.estimate.residuals)
        return without, with_errors

    @property
    @abstractmethod
    def reported(self) -> Reported:
        """Draws of every estimate, by its name in results.json without ``estimates``."""

    @property
    @abstractmethod
    def listed(self) -> Reported:
        """Draws of what results.json has in lists, by its place there, such as ``curves.linearity_x.error_um[3]``."""

    @cached_property
    def covariance(self) -> Covariance:
        return Covariance.of_draws(self.reported)

    @cached_property
    def draws(self) -> Draws:
        """The posterior of every estimate, of the noise where it is estimated, and of what is listed.

        What is zero by definition, as a curve at its first position, is left out.
        """
        chains, found = self.estimate.chains, dict(self.reported)
        if self.job.facts.recording.u_coordinate_um is None:
            found["noise.coordinate_um"] = self.estimate.sigma / MICROMETRE, unit("µm")
        found |= self.listed
        values = np.column_stack([draws for draws, _ in found.values()])
        return Draws(
            {name: unit for name, (_, unit) in found.items()}, by_ensemble(values, chains.steps, len(chains.draws))
        )

    @cached_property
    def stating(self) -> StatedUncertainty:
        return StatedUncertainty.of(self.job)

    def stated_along(self, curve: Curve, size: float = MICROMETRE, symbol: str = "µm") -> Floats:
        """(m,) U of a curve by position, in its own unit, not below the laboratory's capability of that travel."""
        capability = self.stating.capability
        if capability is None:
            return curve.expanded
        travelled = np.abs(curve.position - curve.position[0])
        least = size * np.array([capability.least(symbol, float(length)) for length in travelled])
        return np.where(
            curve.expanded > _STILL * curve.expanded.max(), np.maximum(curve.expanded, least), curve.expanded
        )

    @property
    def repeatability(self) -> Quantity:
        return Quantity.of_draws(self.estimate.sigma / MICROMETRE, unit("µm"))


def listed_draws(place: str, draws: Floats, unit: str) -> Reported:
    """Draws (N, m) of the items of a list of results.json, but those that do not move: they are zero by definition."""
    spread = np.ptp(draws, axis=0)
    moving = np.flatnonzero(spread > _STILL * spread.max(initial=0.0))
    return {f"{place}[{i}]": (draws[:, i], unit) for i in moving.tolist()}


def shift_facts(job: Job) -> ShiftFacts:
    return cast("ShiftFacts", job.facts.artefact)


OF_AN_AXIS = "linearity"


class ShiftedReadings(Artefact):
    """The recording with what its curves and angles come to, for decisions: no list of effects moves its points."""

    kind = "shift"
    title = Verbatim("shift")

    def __init__(self, points: Points, figures: Mapping[str, ArtefactFigure]) -> None:
        self.points, self._figures, self.rows = points, figures, np.arange(len(points))[:, None]

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        return true_xyz

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        return np.zeros((len(xyz), displacement.shape[2]))

    def figures(self, counts: NDArray[np.bool_]) -> Mapping[str, ArtefactFigure]:
        return self._figures


def figure_of(
    points: Points, each: Sequence[tuple[Quantity, float, Text]], lengths_mm: Sequence[float]
) -> ArtefactFigure:
    """Some quantities, each with its unit in mm and what it is of: u is half the longer side of its interval."""
    size = np.array([mm for _, mm, _ in each])
    value = np.array([found.value for found, _, _ in each])
    ends = np.array([found.interval95 for found, _, _ in each]).reshape(-1, 2)
    u = 0.5 * np.maximum(value - ends[:, 0], ends[:, 1] - value)
    rows = np.tile(np.arange(len(points)), (len(each), 1))
    return ArtefactFigure(size * value, rows, np.array(lengths_mm), size * u, tuple(name for _, _, name in each))


def decided(found: ShiftFound, figures: Mapping[str, ArtefactFigure]) -> tuple[Statement, ...]:
    job, under = found.job, found.job.circumstances
    readings = ShiftedReadings(job.points, figures)
    if not found.estimate.chains.converged:
        under = replace(under, lapsed=(*under.lapsed, (NOT_CONVERGED, "")))
    return tuple(
        statement(wish, readings, {}, f"[[conformity]] {i}", SHIFT.tested, None, under)
        for i, wish in enumerate(job.facts.conformity, 1)
    )


def refuse_undecidable(job: Job) -> None:
    for i, wish in enumerate(job.facts.conformity, 1):
        _, characteristic = decidable(wish, SHIFT.name, f"[[conformity]] {i}", SHIFT.tested, job.circumstances)
        if shift_facts(job).plane is None and characteristic.name != OF_AN_AXIS:
            raise CmmUqError(
                f"the {characteristic.name} is none of an axis by itself",
                where=f"job.toml [[conformity]] {i} characteristic",
                fix=f'Decide "{OF_AN_AXIS}", or shift a plate in a plane',
            )


def table_file(job: Job) -> str:
    return file_name("correction_table.csv", job.origin)


def shared_results(
    result: ShiftFound, estimates: Mapping[str, Any], readings: int, further: Mapping[str, Any]
) -> dict[str, Any]:
    """What results.json says of every shift job, in its order, with the ``further`` keys of an axis or a plane."""
    chains, recording = result.estimate.chains, result.job.facts.recording
    before, after = result.disagreement_um
    return {
        **head(result.job, effects=False),
        "estimates": estimates,
        "covariance": covariance_data(result.covariance),
        "observations": readings,
        "noise": {
            "stated_coordinate_um": recording.u_coordinate_um, "coordinate_um": quantity_data(result.repeatability),
        },
        "sampling": {
            "sampler": chains.sampler, "seed": result.estimate.seed, "draws": len(result.estimate.sigma),
            "ess_min": chains.ess_min, "rhat_max": chains.rhat_max, "steps": chains.steps,
            "autocorrelation_time": chains.autocorrelation_time, "converged": chains.converged,
        },
        **further,
        "improvement": {"rms_before_um": before, "rms_after_um": after},
        "conformity": [statement_data(one) for one in result.statements],
        "verdicts": result.verdicts.data(),
    }  # fmt: skip


def curve_data(curve: Curve, expanded: Floats, unit: float = MICROMETRE, suffix: str = "um") -> dict[str, Any]:
    """A curve with its uncertainty, U as it is stated, in a unit with that suffix."""
    low, high = curve.interval95
    return {
        "position_mm": curve.position.tolist(), f"error_{suffix}": (curve.error / unit).tolist(),
        f"u_{suffix}": (curve.u / unit).tolist(),
        f"interval95_{suffix}": [(low / unit).tolist(), (high / unit).tolist()],
        f"U_{suffix}": (expanded / unit).tolist(), f"band_{suffix}": (curve.band / unit).tolist(),
        "simultaneous_factor95": curve.simultaneous_factor,
    }  # fmt: skip


def figures_section(caption: Text, named: Sequence[Left], meaning: Text) -> Section:
    u = say("U is the expanded uncertainty for a coverage probability of 95 %, from the posterior distribution.")
    rows = [(name, quantity) for _, _, name, quantity in named]
    return Section(say("Figures of performance"), (stated_table(caption, rows, (SIGN, meaning, u)),), first=True)


def artefact_section(
    job: Job, otherwise: Text, points: Text, shifts: tuple[tuple[Text, Text], ...], *further: Block
) -> Section:
    facts = shift_facts(job)
    rows = artefact_rows(job, otherwise)
    if (known := facts.known) is not None:
        told = say(
            "{points} {first} to {last}: {length} mm, U = {U} µm (k = 2)",
            points=points, first=known.from_point, last=known.to_point, length=nominal(known.length_mm),
            U=significant(2 * known.u_um),
        )  # fmt: skip
        rows.append((say("Known length"), told))
    return traceability_section(job, (*rows, *certificate_rows(facts.certificate), *shifts), *further)


def method_section(result: ShiftFound, text: Text, readings: int, *further: Block | None) -> Section:
    chains = result.estimate.chains
    reached = say(
        "{reached}: {ess:.0f} effective samples, R-hat {rhat:.4f}, autocorrelation time {time:.1f} of {steps} steps",
        reached=say("reached") if chains.converged else say("NOT reached"), ess=chains.ess_min, rhat=chains.rhat_max,
        time=chains.autocorrelation_time, steps=chains.steps,
    )  # fmt: skip
    sampler = say("{sampler}, seed {seed}", sampler=Verbatim(chains.sampler), seed=result.estimate.seed)
    rows = ((say("Readings (means)"), number(readings)), (say("Sampler"), sampler), (say("Convergence"), reached))
    return section(say("Method"), Paragraph(text), Facts(rows), *further)


_DECIMALS = 3  # of the table's µm and ″


def correction_table(axis: str, curve: Curve, machine: Machine) -> ErrorMap:
    """Error map with the curve as displacement of one carriage along itself; everything else zero.

    It reaches over the machine's travel where that is known; beyond what was read it holds the last value, uncalibrated.
    """
    column = AXES.index(axis)
    errors = np.zeros((len(curve.position), 6))
    errors[:, column] = curve.error
    return error_map_of({column: (curve.position, errors)}, machine)


def error_map_of(found: Mapping[int, tuple[Floats, Floats]], machine: Machine) -> ErrorMap:
    """Error map of positions and errors (m, 6) of some carriages, rounded as in a table; everything else zero."""
    x, y, z = (_carriage(machine.travel_mm[a], found.get(a)) for a in range(3))
    return ErrorMap((x, y, z))


def _carriage(travel: Floats, found: tuple[Floats, Floats] | None) -> AxisErrors:
    low, high = (float(v) for v in travel)
    if found is None:
        ends = np.array([-1e4, 1e4]) if np.isnan(low) else np.array([low, high])
        return AxisErrors(ends, np.zeros((2, 6)))
    unit = np.repeat([MICROMETRE, ARCSECOND], 3)
    position, errors = found[0], np.round(found[1] / unit, _DECIMALS) * unit
    if not np.isnan(low) and low < position[0]:
        position, errors = np.r_[low, position], np.vstack([errors[:1], errors])
    if not np.isnan(high) and high > position[-1]:
        position, errors = np.r_[position, high], np.vstack([errors, errors[-1:]])
    return AxisErrors(position, errors)
