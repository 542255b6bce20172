"""What the noise of a recording could be like, whether or not something is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cmm_uq.diagnosis.comparison.explanations import EFFECT, Explanation
from cmm_uq.diagnosis.noise import Kind
from cmm_uq.diagnosis.shapes import kinds
from cmm_uq.model import MeasurementModel
from cmm_uq.model.noise import noise_of

_FEW = 2
"""Columns."""


def noise_kinds(model: MeasurementModel, candidates: Sequence[Explanation]) -> list[Kind]:
    """Kinds of noise of the used observations.

    Parameters
    ----------
    model : what is explained so far.
    candidates : what else could be; the known effects among them may act all at once.
    """
    estimate = model.estimate()
    columns = [e.members[0].columns for e in candidates if e.kind == EFFECT and not e.shaped and not _doubled(e)]
    rivals = np.hstack(columns) if columns else np.zeros((len(estimate.linear.observed), 0))
    components = noise_of(replace(model, sigma=None))
    return kinds(estimate.linear, components, estimate.least_squares, rivals, estimate.least_squares.residuals)


def _doubled(explanation: Explanation) -> bool:
    """Whether it is a fault of the artefact that an error of the machine, or a pattern of the artefact, can be as well."""
    effect = explanation.effect
    return effect is not None and effect.of_artefact and len(effect.coefficients) <= _FEW
