"""What the noise of a recording could be like, whether or not something is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, UNKNOWN, Explanation
from cmm_uq.analysis.diagnosis.noise import Kind
from cmm_uq.analysis.diagnosis.shapes import kinds, unreached
from cmm_uq.base.points import Floats
from cmm_uq.machine.model import MeasurementModel
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.maths.inference.linear_model import LinearModel

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
    # without a degree of freedom the recording says nothing of its noise, and what is stated holds
    components = noise_of(replace(model, sigma=None) if estimate.least_squares.degrees_of_freedom else model)
    jumps = _jumps(estimate.linear, estimate.least_squares.residuals, candidates)
    return kinds(estimate.linear, components, estimate.least_squares, rivals, estimate.least_squares.residuals, jumps)


def _jumps(linear: LinearModel, residuals: Floats, candidates: Sequence[Explanation]) -> Floats:
    """Columns (m, j), mm: of each function of time with a jump, the one that takes most of the residuals (m,), mm."""
    functions = [each for each in candidates if each.kind == UNKNOWN and each.covariate_name == "time_s"]
    found = [np.zeros((len(residuals), 0))]
    left = linear.reduce(residuals[:, None])[:, 0]
    for function in functions:
        steps = [member.columns for member in function.members if member.columns.shape[1] == 1]
        if steps:
            rest = unreached(linear, np.hstack(steps))
            squares = np.sum(rest**2, axis=0)
            taken = (left @ rest) ** 2 / np.where(squares > 0, squares, np.inf)
            found.append(steps[int(taken.argmax())])
    return np.hstack(found)


def _doubled(explanation: Explanation) -> bool:
    """Whether it is a fault of the artefact that an error of the machine, or a pattern of the artefact, can be as well."""
    effect = explanation.effect
    return effect is not None and effect.of_artefact and len(effect.coefficients) <= _FEW
