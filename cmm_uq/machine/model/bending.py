"""The posterior of a model whose axes lean so far, or may, that it is not linear within its own uncertainty."""

from __future__ import annotations

from cmm_uq.base.points import Floats
from cmm_uq.machine.model.measurement import SMALL_LEAN, MeasurementModel
from cmm_uq.maths.inference.curvature import bend, bent
from cmm_uq.maths.inference.noise import Components
from cmm_uq.maths.inference.posterior import NoisyPosterior


def with_curvature(model: MeasurementModel, components: Components, posterior: NoisyPosterior) -> NoisyPosterior:
    """The posterior of the model itself, from that of the linear model about its estimate; the same where it bends too little.

    Parameters
    ----------
    model : with the estimate that the linear model is about.
    components : of its noise.
    posterior : drawn from the linear model.
    """
    estimate = model.estimate()
    if not model.leans_beyond(estimate.about, posterior.draws.std(axis=0), SMALL_LEAN):
        return posterior
    typical = posterior.sizes.typical
    white = components.white(typical)

    def remainder(values: Floats) -> Floats:
        return white(model.remainder(estimate, values)[:, None])[:, 0]

    return bent(
        posterior, bend(estimate.linear.uncorrelated(white), estimate.about, float(typical.coordinate[0]), remainder)
    )
