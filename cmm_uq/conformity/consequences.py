"""What it would change to correct for the effects that a diagnosis found: figures of performance, statements of conformity."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from cmm_uq.conformity.accuracy import repeated_draws, with_uncertainty
from cmm_uq.conformity.standards import statement
from cmm_uq.conformity.statement import Statement
from cmm_uq.diagnosis.diagnosis import Diagnosis
from cmm_uq.jobs.job import Job
from cmm_uq.model.kind import Observed
from cmm_uq.model.noise import noise_of
from cmm_uq.points import Floats, Ints
from cmm_uq.screening.copies import counted_with
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
    model = replace(diagnosis.after, used=np.ones_like(diagnosis.after.used))
    artefact = model.artefact
    lengths = artefact.lengths()
    if not found or (lengths is None and not job.facts.conformity):
        return None
    estimate = diagnosis.after.estimate()
    linear, value = estimate.linear, estimate.about
    ours = np.array([unknown.key[0] in found for unknown in linear.unknowns])
    coefficients = np.where(ours, value, 0.0)[: len(value) - len(artefact.sizes)]
    points = artefact.points.at(artefact.points.xyz + model.errors(artefact.points.xyz, coefficients))
    corrected = observe(points)
    before: dict[str, Quantity] = {}
    after: dict[str, Quantity] = {}
    late = corrected.lengths()
    if lengths is not None and late is not None:
        some = repeated_draws(len(diagnosis.posterior.draws), len(lengths))
        draws, sizes, components = diagnosis.posterior.draws[some], diagnosis.posterior.sizes.at(some), noise_of(model)
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
