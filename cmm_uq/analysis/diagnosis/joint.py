"""The joint posterior of what the job names and what it left out, under the noise that was found."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from scipy import special

from cmm_uq.analysis.diagnosis.comparison.explanations import evenly, unevenly
from cmm_uq.analysis.diagnosis.comparison.search import Found
from cmm_uq.base.points import Floats
from cmm_uq.machine.model import MeasurementModel
from cmm_uq.machine.model.bending import with_curvature
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.maths.inference.noise import Components
from cmm_uq.maths.inference.posterior import NoisyPosterior, Progress
from cmm_uq.maths.inference.sampling import sample_with_noise
from cmm_uq.maths.inference.shaped import Shaped, sample_shaped

_FINER = 12
"""Nodes of a shape between two of the search's."""

_IMPROBABLE = 12.0
"""Shapes less probable than the best by this, in logarithm, are not followed."""


@dataclass(frozen=True, eq=False)
class Joint:
    """A posterior, the components of its noise, and the draws (N, s) of each effect's shape, by its name."""

    posterior: NoisyPosterior
    components: Components
    shapes: dict[str, Floats]


def joint_posterior(
    found: Found, seed: int, progress: Progress | None = None, known: NoisyPosterior | None = None
) -> Joint:
    """Sample everything at once.

    Parameters
    ----------
    found : by the search.
    seed : of the draws.
    progress : told the part done.
    known : posterior of the job's own model, which it stays where nothing is found.
    """
    model = found.model
    components = replace(noise_of(model), known=model.least_noise)
    if known is not None and not found.effects:
        return Joint(known, components, {})
    estimate = model.estimate()
    new = [e for e in model.effects if e.shape and e.name in found.effects]
    posterior = sample_with_noise(estimate.linear, components, estimate.least_squares, seed, None if new else progress)
    if not new:
        return Joint(with_curvature(model, components, posterior), components, {})
    # what shapes columns is sampled under the noise that is typical with the shapes held
    white = components.white(posterior.sizes.typical)
    linear, values = estimate.linear.uncorrelated(white), estimate.about
    shaped = [_shaped(found, model, effect, values) for effect in new]
    shaped = [replace(some, table=np.stack([white(columns) for columns in some.table])) for some in shaped]
    drawn = sample_shaped(replace(linear, sigma=None), shaped, seed, progress)
    sizes = posterior.sizes.at(np.resize(np.arange(len(posterior.draws)), len(drawn.draws)))
    shapes = {e.name: drawn.shapes[:, j : j + 1] for j, e in enumerate(new)}
    return Joint(
        NoisyPosterior(**{f.name: getattr(drawn, f.name) for f in fields(drawn)}, sizes=sizes), components, shapes
    )


def _shaped(found: Found, model: MeasurementModel, effect: Effect, values: Floats) -> Shaped:
    """An effect's columns on a fine grid of its shape, wherever the search found some probability."""
    nodes = _nodes(found, effect)
    table = np.stack([model.seen(model.columns(effect, (float(shape),), values), values) for shape in nodes])
    keys = [unknown.key for unknown in model.unknowns]
    return Shaped([keys.index((effect.name, c.name)) for c in effect.coefficients], nodes, table)


def _nodes(found: Found, effect: Effect) -> Floats:
    comparison = found.first.comparison
    index = next(i for i in found.chosen if found.first.explanations[i].name == effect.name)
    given = [v for v in found.versions if v.explanation != index]
    ((group, cube),) = comparison.each(None, given, (index,))
    even = evenly(effect, np.array([found.first.explanations[index].members[m].shape[0] for m in group.member]))
    evidence = special.logsumexp(cube[:, :, 0], axis=1)
    step = float(np.median(np.diff(np.sort(even)))) if len(even) > 1 else 0.1 * abs(float(even[0]))
    likely = even[evidence > evidence.max() - _IMPROBABLE]
    offsets = np.arange(-_FINER, _FINER + 1) / _FINER
    fine = np.unique(np.round((likely[:, None] + step * offsets).ravel() / step * _FINER)) * step / _FINER
    (shape,) = effect.shape
    low, high = np.sort(evenly(effect, np.array([shape.low, shape.high])))
    return np.sort(unevenly(effect, np.unique(np.clip(fine, low, high))))
