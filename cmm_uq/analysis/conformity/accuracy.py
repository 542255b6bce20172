"""Figures of performance of a set of lengths with their uncertainty, and what it would change to correct for effects found.

The measurand is the figure on average over repeated recordings. Its error is drawn from the posterior: repetitions
with the model and the noise of each draw, about their own mean (JCGM 101:2008, 9.4).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.conformity.as_recorded import OutsideReadings
from cmm_uq.analysis.conformity.standards import statement
from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.analysis.screening.screening import counted_with
from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import MICROMETRE, PRINTED, Unit
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.job import Job
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.kind import Observed
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.maths.inference.linear_model import LinearModel
from cmm_uq.maths.inference.noise import Components, Sizes
from cmm_uq.maths.uncertainty.quantity import Quantity, averaged

if TYPE_CHECKING:
    from cmm_uq.analysis.diagnosis.diagnosis import Diagnosis

TITLES: Mapping[str, Text] = {
    "mean_length_mm": say("Mean length"),
    "rms_accuracy_error_um": say("rms accuracy error (standard deviation of the lengths)"),
    "b89_range_um": say("Range of the lengths, on average over repeats"),
    "b89_max_deviation_um": say("Largest deviation from the mean length"),
}
UNITS: Mapping[str, Unit] = {name: PRINTED[name.rpartition("_")[2]] for name in TITLES}
_DRAWS = 1000
_NUMBERS = 3_000_000  # random numbers to spend on repetitions
# repetitions of each draw at least; where so many take more random numbers, fewer of the draws are repeated
_LEAST, _LEAST_DRAWS, _MOST_NUMBERS = 10, 200, 10_000_000
_AT_ONCE = 300_000  # random numbers that are held at once: no more than a processor's cache holds
Repeated = Callable[[Ints, int, np.random.Generator], Floats]  # noise (w, repetitions, m), mm, anew, for w of the draws


def figures(lengths: Floats) -> dict[str, Floats]:
    """Figures of lengths (..., m) in mm: mean, rms accuracy error (n − 1), range, largest deviation from the mean.

    The rms accuracy error is equation 36 of Harris 2004. ASME B89.4.1 reports the range; what that source calls B89 is the
    largest deviation from the mean.
    """
    mean, low, high = lengths.mean(axis=-1), lengths.min(axis=-1), lengths.max(axis=-1)
    squares = lengths - mean[..., None]
    np.square(squares, out=squares)
    return {
        "mean_length_mm": mean,
        "rms_accuracy_error_um": np.sqrt(squares.sum(axis=-1) / max(lengths.shape[-1] - 1, 1)) / MICROMETRE,
        "b89_range_um": (high - low) / MICROMETRE,
        "b89_max_deviation_um": np.maximum(high - mean, mean - low) / MICROMETRE,
    }


def repeated_draws(draws: int, lengths: int) -> Ints:
    """Which of a posterior's draws are repeated for the figures of so many lengths."""
    most = int(np.clip(_MOST_NUMBERS // (_LEAST * lengths), _LEAST_DRAWS, _DRAWS))
    return np.linspace(0, draws - 1, min(most, draws)).astype(np.int64)


def with_uncertainty(
    lengths: Floats, predicted: Floats, noise: Repeated, seed: int, drawn_with: Ints | None = None
) -> dict[str, Quantity]:
    """Figures of recorded lengths (m,), mm, with uncertainty; ``predicted`` (N, m), mm, by draws without noise.

    ``drawn_with``: (m,) equal where lengths share their noise: a copy has that of its original. Each its own by default.
    """
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(1,)))
    shared: Ints | slice = slice(None)
    if drawn_with is not None:
        _, first, which = np.unique(drawn_with, return_index=True, return_inverse=True)
        shared = first[which.ravel()] if len(first) < len(lengths) else shared
    chosen = repeated_draws(*predicted.shape)
    repetitions = int(np.clip(_NUMBERS // (len(chosen) * len(lengths)), _LEAST, 100))
    unbiased = np.sqrt(repetitions / (repetitions - 1))
    errors: dict[str, list[Floats]] = {name: [] for name in TITLES}
    parts = min(len(chosen), max(10, repetitions * len(chosen) * len(lengths) // _AT_ONCE))
    for block in np.array_split(chosen, parts):
        repeated = noise(block, repetitions, random)[..., shared]
        repeated += predicted[block, None, :]
        for name, values in figures(repeated).items():
            errors[name].append((unbiased * (values - values.mean(axis=1, keepdims=True))).ravel())
    drawn = {name: float(value) - np.concatenate(errors[name]) for name, value in figures(lengths).items()}
    return {name: Quantity.of_draws(drawn[name], UNITS[name], float(v)) for name, v in figures(lengths).items()}


_FEW = 400  # Draws of each explanation that remains: enough for two digits of U


@dataclass(frozen=True, eq=False)
class Consequences:
    """Figures and statements of a recording, as it stands and corrected for what was left out."""

    figures: Mapping[str, tuple[Quantity, Quantity]]
    statements: tuple[tuple[Statement, Statement], ...]  # as the job asks for, before and after


@dataclass(frozen=True, eq=False)
class Cost:
    """What the recording comes to if one explanation that remains is the right one, and is corrected for."""

    probability: float
    figures: Mapping[str, Quantity]
    statements: tuple[Statement, ...]


@dataclass(frozen=True, eq=False)
class Costs:
    """Of every explanation that remains, the most probable first, and of all together."""

    each: tuple[Cost, ...]  # in the order of the explanations
    figures: Mapping[str, Quantity]
    decisions: tuple[Mapping[str, float], ...]  # of each statement, the probability of every outcome


def consequences(
    job: Job, diagnosis: Diagnosis, observe: Observed, tested: Collection[str], seed: int,
    left_out: OutsideReadings | None = None,
) -> Consequences | None:  # fmt: skip
    """Of a diagnosis that asserts effects; ``None`` for others, and for artefacts without lengths and statements."""
    asserted, model = {item.effect for item in diagnosis.effects}, diagnosis.after
    if not asserted or not _depends(job, diagnosis):
        return None
    drawn = _Drawn(diagnosis.posterior.draws, diagnosis.posterior.sizes, _noise(diagnosis))
    correction = _Correction.of(model, asserted, model.estimate().about, drawn, observe)
    before, after = correction.before(seed), correction.after(seed)
    recorded = correction.statements(job, tested, correction.model.artefact, before, left_out)
    corrected = correction.statements(job, tested, correction.corrected, after, left_out)
    figures = {name: (before[name], after[name]) for name in before}
    return Consequences(figures, tuple(zip(recorded, corrected, strict=True)))


def costs(
    job: Job, diagnosis: Diagnosis, observe: Observed, tested: Collection[str], seed: int,
    left_out: OutsideReadings | None = None
) -> Costs | None:  # fmt: skip
    """Of the explanations that remain; ``None`` where none do. What is unknown, or nothing, is not corrected for."""
    rivals, weights = diagnosis.remaining.rivals, diagnosis.remaining.weights
    if not rivals or not _depends(job, diagnosis):
        return None
    some = np.linspace(0, len(diagnosis.posterior.draws) - 1, _FEW).astype(np.int64)
    each, components = [], _noise(diagnosis)
    for rival in rivals:
        posterior = _Drawn(rival.draws[:_FEW], diagnosis.posterior.sizes.at(some), components)
        correction = _Correction.of(rival.model, set(rival.effects), rival.draws.mean(axis=0), posterior, observe)
        figures = correction.after(seed)
        statements = correction.statements(job, tested, correction.corrected, figures, left_out)
        each.append(Cost(rival.probability, figures, statements))
    decisions: tuple[dict[str, float], ...] = tuple({} for _ in each[0].statements)
    for cost, weight in zip(each, weights, strict=True):
        for decided, one in zip(decisions, cost.statements, strict=True):
            decided[one.outcome] = decided.get(one.outcome, 0.0) + weight / sum(weights)
    figures = {name: averaged([cost.figures[name] for cost in each], weights) for name in each[0].figures}
    return Costs(tuple(each), figures, decisions)


def _noise(diagnosis: Diagnosis) -> Components:
    return noise_of(diagnosis.after.using())


def _depends(job: Job, diagnosis: Diagnosis) -> bool:
    return diagnosis.after.artefact.lengths() is not None or bool(job.facts.conformity)


@dataclass(frozen=True, eq=False)
class _Drawn:
    """Draws (N, k) of a model's unknowns, and the sizes of the noise of all observations that go with them."""

    values: Floats
    sizes: Sizes
    components: Components


@dataclass(frozen=True, eq=False)
class _Correction:
    """A recording, whole, and the same corrected for some effects of a model that was fitted to it."""

    model: RecordingModel
    ours: NDArray[np.bool_]  # (k,) which of its unknowns are corrected for
    value: Floats  # (k,) by which values
    drawn: _Drawn
    corrected: Artefact

    @classmethod
    def of(
        cls, fitted: RecordingModel, found: Collection[str], value: Floats, drawn: _Drawn, observe: Observed
    ) -> _Correction:
        """For the effects of these names, by what a model estimates of them (k,)."""
        model = fitted.using()
        artefact = model.artefact
        ours = np.array([unknown.key[0] in found for unknown in model.unknowns], dtype=bool)
        coefficients = np.where(ours, value, 0.0)[: len(value) - len(artefact.sizes)]
        points = artefact.points.at(artefact.points.xyz + model.errors(artefact.points.xyz, coefficients))
        return cls(model, ours, value, drawn, observe(points))

    def before(self, seed: int) -> dict[str, Quantity]:
        """Figures as recorded; none of an artefact without lengths."""
        lengths = self.model.artefact.lengths()
        return {} if lengths is None else self._figures(lengths, self._predicted(lengths), seed)

    def after(self, seed: int) -> dict[str, Quantity]:
        """Figures corrected by the estimate, as the points were; a draw corrects by something else."""
        lengths, late = self.model.artefact.lengths(), self.corrected.lengths()
        if lengths is None or late is None:
            return {}
        own = (self.drawn.values[self._some] - self.value)[:, self.ours] @ self._whole.design[:, self.ours].T
        return self._figures(late, self._predicted(lengths) + (late - lengths) - own, seed)

    def statements(
        self, job: Job, tested: Collection[str], artefact: Artefact, figures: Mapping[str, Quantity],
        left_out: OutsideReadings | None,
    ) -> tuple[Statement, ...]:  # fmt: skip
        """What the job asks for, of figures of this recording, or of it corrected."""
        recorded = None if artefact is self.model.artefact else self.model.artefact
        return tuple(
            statement(wish, artefact, figures, f"[[conformity]] {i}", tested, recorded, job.circumstances, left_out)
            for i, wish in enumerate(job.facts.conformity, 1)
        )

    @cached_property
    def _some(self) -> Ints:
        lengths = self.model.artefact.lengths()
        return repeated_draws(len(self.drawn.values), 1 if lengths is None else len(lengths))

    @cached_property
    def _whole(self) -> LinearModel:
        return self.model.linearised(self.value)

    def _predicted(self, lengths: Floats) -> Floats:
        """Lengths (N, m) that draws predict."""
        return lengths - self._whole.observed + self.drawn.values[self._some] @ self._whole.design.T

    def _figures(self, lengths: Floats, predicted: Floats, seed: int) -> dict[str, Quantity]:
        artefact, sizes = self.model.artefact, self.drawn.sizes.at(self._some)

        def noise(chosen: Ints, times: int, random: np.random.Generator) -> Floats:
            return self.drawn.components.repeated(sizes.at(chosen), times, random)

        return with_uncertainty(lengths, predicted, noise, seed, counted_with(artefact.points)[artefact.rows[:, 0]])
