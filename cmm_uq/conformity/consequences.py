"""What it would change to correct for the effects that a diagnosis found: figures of performance, statements of conformity."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from cmm_uq.conformity.accuracy import repeated_draws, with_uncertainty
from cmm_uq.conformity.standards import statement
from cmm_uq.conformity.statement import Statement
from cmm_uq.diagnosis.diagnosis import Diagnosis
from cmm_uq.inference.noise import Sizes
from cmm_uq.jobs.job import Job
from cmm_uq.model import MeasurementModel
from cmm_uq.model.kind import Observed
from cmm_uq.model.noise import noise_of
from cmm_uq.points import Floats, Ints
from cmm_uq.screening.copies import counted_with
from cmm_uq.uncertainty.mixture import averaged
from cmm_uq.uncertainty.quantity import Quantity


@dataclass(frozen=True, eq=False)
class Consequences:
    """Figures and statements of a recording, as it stands and corrected for what was left out.

    Parameters
    ----------
    figures : by name, before and after.
    statements : as the job asks for, before and after.
    """

    figures: Mapping[str, tuple[Quantity, Quantity]]
    statements: tuple[tuple[Statement, Statement], ...]


@dataclass(frozen=True, eq=False)
class Cost:
    """What the recording comes to if one explanation that remains is the right one, and is corrected for.

    Parameters
    ----------
    probability : of the explanation.
    figures : by name.
    statements : as the job asks for.
    """

    probability: float
    figures: Mapping[str, Quantity]
    statements: tuple[Statement, ...]


@dataclass(frozen=True, eq=False)
class Costs:
    """Of every explanation that remains, the most probable first, and of all together.

    Parameters
    ----------
    each : in the order of the explanations.
    figures : averaged, by name.
    decisions : of each statement, the probability of every outcome.
    """

    each: tuple[Cost, ...]
    figures: Mapping[str, Quantity]
    decisions: tuple[Mapping[str, float], ...]


def consequences(
    job: Job, diagnosis: Diagnosis, observe: Observed, tested: Collection[str], seed: int
) -> Consequences | None:
    """Of a diagnosis that asserts effects; ``None`` for others, and for artefacts without lengths and statements.

    The uncertainty of a corrected figure is that of repeated recordings with this correction.

    Parameters
    ----------
    observe : makes the artefact of points.
    tested : what of its kind a standard may be decided on.
    seed : of the figures' repetitions.
    """
    found = {item.effect for item in diagnosis.effects}
    if not found or not _depends(job, diagnosis):
        return None
    posterior = diagnosis.posterior
    return _corrected(job, diagnosis.after, found, posterior.draws, posterior.sizes, observe, tested, seed)


def costs(job: Job, diagnosis: Diagnosis, observe: Observed, tested: Collection[str], seed: int) -> Costs | None:
    """Of the explanations that remain; ``None`` where none do, and for artefacts without lengths and statements.

    What is unknown, or nothing, is not corrected for. Parameters as those of :func:`consequences`.
    """
    rivals = diagnosis.remaining.rivals
    if not rivals or not _depends(job, diagnosis):
        return None
    each = []
    for rival in rivals:
        sizes = diagnosis.posterior.sizes.at(np.resize(np.arange(len(diagnosis.posterior.draws)), len(rival.draws)))
        found = _corrected(job, rival.model, set(rival.effects), rival.draws, sizes, observe, tested, seed)
        figures = {name: after for name, (_, after) in found.figures.items()}
        each.append(Cost(rival.probability, figures, tuple(after for _, after in found.statements)))
    weights = diagnosis.remaining.weights
    decisions: tuple[dict[str, float], ...] = tuple({} for _ in each[0].statements)
    for cost, weight in zip(each, weights, strict=True):
        for decided, one in zip(decisions, cost.statements, strict=True):
            decided[one.outcome] = decided.get(one.outcome, 0.0) + weight / sum(weights)
    figures = {name: averaged([cost.figures[name] for cost in each], weights) for name in each[0].figures}
    return Costs(tuple(each), figures, decisions)


def _depends(job: Job, diagnosis: Diagnosis) -> bool:
    return diagnosis.after.artefact.lengths() is not None or bool(job.facts.conformity)


def _corrected(
    job: Job, fitted: MeasurementModel, found: Collection[str], drawn: Floats, noise_sizes: Sizes, observe: Observed,
    tested: Collection[str], seed: int,
) -> Consequences:  # fmt: skip
    """Figures and statements as recorded, and corrected for some effects of a model.

    Parameters
    ----------
    fitted : model with these effects.
    found : their names.
    drawn, noise_sizes : from its posterior.
    """
    model = replace(fitted, used=np.ones_like(fitted.used))
    artefact = model.artefact
    lengths = artefact.lengths()
    estimate = fitted.estimate()
    linear, value = estimate.linear, estimate.about
    ours = np.array([unknown.key[0] in found for unknown in linear.unknowns])
    coefficients = np.where(ours, value, 0.0)[: len(value) - len(artefact.sizes)]
    points = artefact.points.at(artefact.points.xyz + model.errors(artefact.points.xyz, coefficients))
    corrected = observe(points)
    before: dict[str, Quantity] = {}
    after: dict[str, Quantity] = {}
    late = corrected.lengths()
    if lengths is not None and late is not None:
        some = repeated_draws(len(drawn), len(lengths))
        draws, sizes, components = drawn[some], noise_sizes.at(some), noise_of(model)
        whole = model.linearised(value)
        predicted = lengths - whole.observed + draws @ whole.design.T

        def noise(chosen: Ints, times: int, random: np.random.Generator) -> Floats:
            return components.repeated(sizes.at(chosen), times, random)

        same = counted_with(artefact.points)[artefact.rows[:, 0]]
        before = with_uncertainty(lengths, predicted, noise, seed, same)
        # corrected by the estimate, as the points were; a draw corrects by something else
        remaining = predicted + (late - lengths) - (draws - value)[:, ours] @ whole.design[:, ours].T
        after = with_uncertainty(late, remaining, noise, seed, same)
    under = job.circumstances
    return Consequences(
        {name: (before[name], after[name]) for name in before},
        tuple(
            (
                statement(wish, artefact, before, key, tested, None, under),
                statement(wish, corrected, after, key, tested, artefact, under),
            )
            for i, wish in enumerate(job.facts.conformity, 1)
            for key in [f"[[conformity]] {i}"]
        ),
    )
