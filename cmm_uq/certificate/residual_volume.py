"""The picture that every artefact shares: what the model leaves unexplained, where it lies in the machine's volume."""

from __future__ import annotations

import numpy as np

from cmm_uq.base.messages import Text, say
from cmm_uq.base.units import MICROMETRE
from cmm_uq.certificate.document import Plot
from cmm_uq.certificate.plots import volume_plot
from cmm_uq.certificate.result import Result
from cmm_uq.maths.uncertainty.rounding import alike


def residual_volume(result: Result, what: Text) -> Plot:
    """Residuals of observations of one point each, or of pairs of points (drawn as bars), over the scale readings.

    Parameters
    ----------
    what : the points in words, as ``faces``.
    """
    artefact, residuals = result.artefact, result.residuals / MICROMETRE
    readings, travel = artefact.points.machine_xyz, artefact.points.machine.travel_mm
    ends = readings[artefact.rows]
    low, high = alike(residuals.min(), residuals.max())
    return volume_plot(
        ends[:, 0],
        residuals,
        end_mm=ends[:, -1] if ends.shape[1] > 1 else None,
        travel_mm=travel if np.all(np.isfinite(travel)) else None,
        caption=say("Residuals after the fitted model in the machine's volume (scale readings)."),
        alternative=say(
            "Three projections of the {what}; residuals of {low} to {high} µm.",
            what=what,
            low=low,
            high=high,
        ),
    )
