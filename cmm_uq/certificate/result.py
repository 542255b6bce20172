"""What an analysis comes to: estimates, noise, diagnosis, statements of conformity; and what of it is to be written."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.conformity.statement import NOT_CONVERGED, Statement, by_standard, by_tolerance
from cmm_uq.analysis.diagnosis.simulated import SimulatedTwin, SimulationMistakes
from cmm_uq.analysis.machine.state import of_machine
from cmm_uq.analysis.screening.columns import Finding
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, at_key, say
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, field
from cmm_uq.certificate.document import Document, Section
from cmm_uq.certificate.origin import NO_FURTHER, FurtherCertificates
from cmm_uq.certificate.plots.style import lettered_in
from cmm_uq.certificate.wording import Summary
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.tables.identification import Capability, Origin
from cmm_uq.jobs.verdicts import NO_VERDICTS, Verdicts
from cmm_uq.machine.model import Estimate, RecordingModel
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.artefact_doubt import growth, taken_as_exact
from cmm_uq.machine.physics.stated import physics_of
from cmm_uq.maths.inference.draws import Draws
from cmm_uq.maths.inference.linear_model import LeastSquares
from cmm_uq.maths.inference.posterior import Cause, Doubt, NoisyPosterior, gain
from cmm_uq.maths.uncertainty.quantity import Quantity
from cmm_uq.maths.uncertainty.type_a import Covariance, factor_of_noise

if TYPE_CHECKING:
    from cmm_uq.analysis.conformity.accuracy import Consequences, Costs
    from cmm_uq.analysis.diagnosis.diagnosis import Diagnosis
    from cmm_uq.analysis.diagnosis.smallest import SmallestEffect
    from cmm_uq.analysis.machine.regions import FactorRegions
    from cmm_uq.analysis.planning.set_up import NextPlan, Suggestion

AtLeast = Callable[..., tuple[float, float]]  # U and k as a certificate states them; see StatedUncertainty.raised_to


def as_evaluated(name: str, expanded: float, factor: float, *length: Any, **further: Any) -> tuple[float, float]:
    return expanded, factor


CAPABILITY_FACTOR = 2.0  # coverage factor of a calibration and measurement capability (ILAC-P14:09/2020)


@dataclass(frozen=True)
class StatedUncertainty:
    """Quantities with U not below the laboratory's capability, that of lengths taken at ``length_mm``."""

    capability: Capability | None
    length_mm: float
    raised: dict[str, dict[str, float]] = field(default_factory=dict)  # U as evaluated and as stated, by name

    @classmethod
    def of(cls, job: Job, length_mm: float = 0.0) -> StatedUncertainty:
        spans = np.ptp(job.points.machine.travel_mm, axis=1)  # without a length at the longest of them
        longest = float(np.nanmax(spans)) if np.isfinite(spans).any() else 0.0
        return cls(job.facts.laboratory.cmc, length_mm or longest)

    def stated(self, name: str, quantity: Quantity) -> Quantity:
        return quantity.at_least(self._raised(name, quantity.expanded, quantity.unit, self.length_mm))

    def _raised(self, name: str, expanded: float, unit: str, length_mm: float) -> float:
        """The least U of a unit at a length, which is noted where that is more than was evaluated."""
        least = self.capability.least(unit, length_mm) if self.capability else 0.0
        if expanded < least:
            self.raised.setdefault(name, {"evaluated_U": expanded, "U": least})
        return least

    def raised_to(
        self, name: str, expanded: float, factor: float, unit: str, length_mm: float | None = None
    ) -> tuple[float, float]:
        """U and k of a figure that is no :class:`Quantity`, U not below the capability, k = 2 where it is that."""
        least = self._raised(name, expanded, unit, self.length_mm if length_mm is None else length_mm)
        return (expanded, factor) if expanded >= least else (least, CAPABILITY_FACTOR)

    def all(self, group: str, quantities: Mapping[str, Quantity]) -> dict[str, Quantity]:
        return {name: self.stated(f"{group}.{name}", one) for name, one in quantities.items()}

    def warnings(self) -> list[Text]:
        told = say(
            "U is stated as the laboratory's calibration and measurement capability (k = 2){key} where that is larger "
            "than what was evaluated{names}.", names=at_key(", ".join(self.raised)), key=at_key("[laboratory.cmc]"),
        )  # fmt: skip
        return [told] if self.raised else []

    def data(self) -> dict[str, Any]:
        return {"cmc": {"length_mm": self.length_mm, "raised": self.raised}} if self.raised else {}


_LEFT_TO_PRIOR = 0.9  # share of the prior in a parameter's variance from which on the recording does not determine it
LACK_OF_FIT = 0.01  # probability below which the residuals are held to contradict the stated noise


@dataclass(frozen=True)
class NoiseComponent:
    """Standard deviation of a component of the noise, µm, and the probability that it is there at all."""

    size: Quantity
    probability: float


@dataclass(frozen=True, eq=False)
class RecordingNoise:
    """The noise of a recording, and what it does to the uncertainties."""

    coordinate: Quantity  # standard deviation of a reading of one coordinate, root mean square of the axes, µm
    components: Mapping[str, NoiseComponent]  # that could show: ``x``, ``y``, ``z``, ``placing``, ``growth``, ``slow``
    axes_apart: float  # probability that the axes differ
    wider: float  # largest ratio of a parameter's u to what white noise would leave it
    stated_um: float | None  # what the job states, if anything
    p_value: float | None  # of the residuals' sum of squares under the stated noise (χ² test)
    display_um: float = 0.0  # step in which coordinates are displayed, 0 where it is too fine to matter

    @property
    def coverage_factor(self) -> float:
        """K for 95 % of what is uncertain by this noise alone: Student's t, for its size is known so well and no better."""
        return factor_of_noise(self.coordinate)

    @property
    def expanded(self) -> float:
        """U of one reading of one coordinate, µm."""
        return self.coverage_factor * self.coordinate.value

    @property
    def contradicts_stated(self) -> bool:
        """Whether the residuals are larger than the stated noise allows; they were then used instead of it."""
        return self.p_value is not None and self.p_value < LACK_OF_FIT


@dataclass(frozen=True, eq=False)
class JobDiagnosis:
    """A job with its diagnosis: what is missing, what to measure next, and what follows."""

    job: Job
    findings: tuple[Finding, ...]
    diagnosis: Diagnosis
    suggestions: tuple[Suggestion, ...]
    consequences: Consequences | None = None  # of a correction, if anything depends on one
    simulated: SimulatedTwin | None = None
    unseen: tuple[SmallestEffect, ...] = ()  # smallest amplitude of each effect that would have shown
    next_plan: NextPlan | None = None  # the fewest set-ups that part or show more
    mistakes: SimulationMistakes = field(default_factory=SimulationMistakes)  # the simulation's own
    costs: Costs | None = None  # what each explanation that remains makes of figures and decisions


@dataclass(frozen=True)
class ParameterDifference:
    """``second`` minus ``first``, parameters by their keys, which is determined where neither of them is."""

    second: tuple[str, str]
    first: tuple[str, str]
    quantity: Quantity


@dataclass(frozen=True)
class Contradiction:
    """A line along a machine axis that says something else of the axis than an average over explanations does."""

    key: tuple[str, str]  # of the parameter: effect and name
    measurement: int  # number of the line
    alone: Quantity  # by this line alone, all others as they are on average


@dataclass(frozen=True, eq=False)
class Result:
    """All that is known of a job after its analysis."""

    job: Job
    model: RecordingModel
    findings: tuple[Finding, ...]  # of the screening
    estimate: Estimate  # least squares
    posterior: NoisyPosterior  # of the model's own parameters and of its noise
    values: Floats  # (N, k) draws of the model's unknowns, of the mixture where several explanations remain
    draws: Draws  # of all that is reported, by name and chain
    parameters: Mapping[str, Mapping[str, Quantity]]  # reported, by effect and name
    sizes: Mapping[str, Quantity]  # of the artefact, by name
    noise: RecordingNoise  # of a coordinate, about the named model
    accuracy: Mapping[str, Quantity]  # figures of the lengths as recorded, by name; empty without lengths
    statements: tuple[Statement, ...]  # of conformity, in the job's order
    diagnosed: JobDiagnosis  # what the job's model leaves out, if anything
    stating: StatedUncertainty | None = None  # how a certificate states it; ``None`` of a result as evaluated
    returning: Mapping[str, Quantity] = field(default_factory=dict)  # figures if what set-ups leave were there again
    causes: tuple[Cause, ...] = ()  # of what is stated to be in doubt about all observations together
    doubt: Doubt = field(default_factory=lambda: Doubt(()))  # what they make of the unknowns; it is in ``values``
    contradictions: tuple[Contradiction, ...] = ()  # what denies averaged estimates, which are then not given
    all_errors: Callable[[], FactorRegions | Text] = lambda: NOTHING  # say, once asked, of the factors; or why nothing
    further: Callable[[], FurtherCertificates] = lambda: NO_FURTHER  # of the machine, reckoned with in that

    @property
    def at_least(self) -> AtLeast:
        return as_evaluated if self.stating is None else self.stating.raised_to

    def quantities(self) -> Iterator[tuple[str, Quantity]]:
        for effect, values in self.parameters.items():
            yield from ((f"{effect} {name}", quantity) for name, quantity in values.items())
        yield from self.sizes.items()
        yield "u_coordinate_um", self.noise.coordinate
        yield from self.accuracy.items()

    @property
    def regions(self) -> FactorRegions | Text:
        """Where the error factors hold, or why that is not stated; empty where nothing is to be said of it."""
        return self.all_errors() if any(map(of_machine, self.model.effects)) else NOTHING

    @property
    def relative_doubt(self) -> float:
        """Standard uncertainty of the size of the artefact as a whole, over its size, by what is stated beside its sizes."""
        along = growth(self.artefact)
        doubt = 0.0 if along is None else Doubt.of(self.causes, along[None] / (along @ along)).variance(np.ones(1))
        return float(np.sqrt(doubt))

    @property
    def averaged(self) -> int:
        """Over how many explanations that remain the estimates are averaged; 0 where they are those of the named model."""
        return len(self.diagnosed.diagnosis.remaining.rivals)

    @property
    def artefact(self) -> Artefact:
        return self.model.artefact

    @property
    def least_squares(self) -> LeastSquares:
        return self.estimate.least_squares

    @cached_property
    def residuals(self) -> Floats:
        """What the named model at its posterior mean leaves unexplained of every observation, used or not, (m,) mm."""
        return self.model.residuals(self.posterior.draws.mean(axis=0))

    @cached_property
    def undetermined(self) -> tuple[tuple[tuple[str, str], ...], ...]:
        return tuple(tuple(parts) for parts in self.least_squares.free)

    @cached_property
    def not_given(self) -> frozenset[tuple[str, str]]:
        """Keys of parameters without a value: the recording leaves them free, to their prior, or contradicts them."""
        free = (key for combination in self.undetermined for key in combination)
        return frozenset((*free, *self.left_to_prior, *(one.key for one in self.contradictions), *self.denied))

    @cached_property
    def left_to_prior(self) -> tuple[tuple[str, str], ...]:
        """Keys of parameters of which the recording says next to nothing beside what physics allows."""
        physical = {effect.name for effect in self.model.effects if not effect.stated}
        keys = (unknown.key for unknown in self.posterior.unknowns if unknown.key[0] in physical)
        return tuple(key for key in keys if self.prior_share(key) > _LEFT_TO_PRIOR)

    @cached_property
    def denied(self) -> tuple[tuple[str, str], ...]:
        """Keys of parameters that all errors together deny: of the machine all, where they deny what was read of it."""
        found, effects = self.regions, set[str]()
        if not isinstance(found, Text):
            read = [one.name for one in self.model.effects if found.agreement.of_readings and of_machine(one)]
            effects = {*read, *(effect for effect, _ in found.agreement.factors)}
        return tuple((effect, name) for effect, named in self.parameters.items() if effect in effects for name in named)

    @cached_property
    def free(self) -> frozenset[str]:
        """Effects that the recording does not determine by themselves, or contradicts."""
        return frozenset(effect for effect, _ in self.not_given)

    def differences(self, combination: tuple[tuple[str, str], ...]) -> tuple[ParameterDifference, ...]:
        """Of parameters in one unit that change by as much together; U not below the laboratory's capability."""
        part = self.least_squares.free[self.undetermined.index(combination)]
        columns = {unknown.key: (i, unknown.unit) for i, unknown in enumerate(self.posterior.unknowns)}
        unit, stating, each = columns[combination[0]][1], StatedUncertainty.of(self.job), np.eye(len(columns))
        as_much = [key for key in combination if np.isclose(part[key], part[combination[0]], rtol=1e-3)]
        alike, found = [key for key in as_much if columns[key][1] == unit], []
        for first, second in zip(alike, alike[1:] + alike[:1] if len(alike) > 2 else alike[1:], strict=False):
            one, other = columns[second][0], columns[first][0]
            quantity = Quantity.of_draws(self.values[:, one] - self.values[:, other], unit)
            if self.causes:
                quantity = self.doubt.larger(quantity, each[one] - each[other])
            found.append(ParameterDifference(second, first, stating.stated("differences", quantity)))
        return tuple(found)

    @cached_property
    def covariance(self) -> Covariance:
        reported = self.model.reported(self.values)
        return Covariance.of_draws({".".join(key): values for key, values in reported.items()})

    @cached_property
    def verdicts(self) -> Verdicts:
        """All statements of conformity, and the gravest: those of standards, then (first) parameters with a tolerance."""
        tolerances, against = self.job.facts.model.tolerances, [what for what, _ in self.job.circumstances.lapsed]
        if self.job.facts.recording.measurements_aside:
            against.insert(0, say("it is estimated without the measurements that the laboratory set aside"))
        if not self.posterior.converged:
            against.insert(0, NOT_CONVERGED)
        found = [by_standard(statement) for statement in self.statements]
        for effect in self.model.effects:
            if effect.name in tolerances:
                name, quantity = next(iter(self.parameters[effect.name].items()))
                exact = self._taken_as_exact(effect.name) if effect.name not in self.free else ()
                found.append(by_tolerance(f"{effect.name}.{name}", effect.title, quantity, tolerances[effect.name],
                                          determined=effect.name not in self.free, against=[*against, *exact]))  # fmt: skip
        return Verdicts(found)

    def _taken_as_exact(self, effect: str) -> list[Text]:
        if not (self.artefact.exact or any(size.sd == 0 for size in self.artefact.sizes)):
            return []
        weights = gain(self.estimate.linear, float(np.median(self.posterior.sigma)))
        own = [i for i, unknown in enumerate(self.posterior.unknowns) if unknown.key[0] == effect]
        artefact, used, u = self.artefact, self.model.used, self.values.std(axis=0)
        return list(
            dict.fromkeys(text for i in own for text in taken_as_exact(artefact, used, weights[i], float(u[i])))
        )

    @cached_property
    def flagged(self) -> NDArray[np.bool_]:
        """Observations (m,) of measurements that the screening found odd; of one with outliers, those that are not used."""
        found = np.zeros(len(self.artefact.measurement), dtype=bool)
        for finding in self.findings:
            own = np.isin(self.artefact.measurement, finding.measurements)
            found |= own & ~self.model.used if finding.kind == "outlier" else own
        return found

    def prior_share(self, key: tuple[str, str]) -> float:
        """How much of a parameter's variance under the named model is left of the prior's: 0 all recorded, 1 all assumed."""
        i = [u.key for u in self.posterior.unknowns].index(key)
        prior = self.posterior.unknowns[i].prior_sd
        return float(min(1.0, self.posterior.covariance[i, i] / prior**2)) if prior > 0 else 1.0


class AnalysisResult(Protocol):
    """What an analysis found, in the kind's own terms; of most kinds a :class:`~cmm_uq.certificate.result.Result`."""

    @property
    def job(self) -> Job: ...


@dataclass(frozen=True, eq=False)
class Outcome:
    found: AnalysisResult  # in the kind's own terms
    composed: Callable[[], Document]  # makes the certificate or page; its pictures take longer than its figures
    results: Mapping[str, Any]  # contents of results.json
    summary: Summary  # for the end of a command
    warnings: tuple[Text, ...] = ()  # what the reader must know before using a figure
    files: Mapping[str, bytes] = field(default_factory=dict)  # further ones, by name
    verdicts: Verdicts = NO_VERDICTS  # every statement of conformity
    in_order: bool = True  # the recording agrees with the model that the job names, a plan meets its conditions
    draws: Draws | None = None  # of the posterior of all that is reported, where the kind's analysis draws from one

    @property
    def conforming(self) -> bool:
        return self.verdicts.conforming and self.in_order

    @cached_property
    def document(self) -> Document:
        """Certificate, or page of a diagnosis; composed when it is first asked for."""
        with lettered_in(self.found.job.facts.job.language), physics_of(self.found.job):
            return self.composed()

    @property
    def origin(self) -> Origin:
        return self.found.job.origin

    @property
    def provenance(self) -> Mapping[str, Any]:
        """``software`` with plugins, ``job`` with the hashes of its inputs, and ``seed`` where a posterior was sampled."""
        of_results = {key: self.results[key] for key in ("software", "job") if key in self.results}
        return of_results | {key: at for key, at in self.results.get("sampling", {}).items() if key == "seed"}


@dataclass(frozen=True)
class Page:
    sections: Callable[[Result], list[Section]]  # after those that every certificate has
    results: Callable[[Result], Mapping[str, Any]] | None = None  # further keys of results.json

    def with_further(self, result: Result, data: Mapping[str, Any]) -> dict[str, Any]:
        """Contents of results.json that every result has, and the kind's further keys."""
        further = {} if self.results is None else self.results(result)
        if clash := sorted(set(further) & set(data)):
            raise CmmUqError(f"a kind's own results cannot be named {clash[0]!r}, which every result has",
                             fix="Mend the package that the kind comes from")  # fmt: skip
        return {**data, **further}


@dataclass(frozen=True)
class Recipe:
    """A kind's own way from a job to its outcome."""

    analyse: Callable[..., AnalysisResult]  # ``(job, *, seed, progress)``, of a diagnosis also ``alpha``
    outcome: Callable[[Any, int], Outcome]  # of what was found and the seed


@dataclass(frozen=True)
class OwnAnalysis:
    """What a kind does by itself, because its errors are no list of effects."""

    report: Recipe | None = None
    diagnose: Recipe | None = None
