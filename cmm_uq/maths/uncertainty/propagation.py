"""Law of propagation of uncertainty: first order, and second order where the model bends.

First order is JCGM 100:2008 5.1 and 5.2, with the covariance of several outputs (JCGM 102:2011 6.2.1). Second order adds
to the variance the terms of 5.1.2, NOTE, in their general form for correlated inputs (the two agree for independent
ones; both take the inputs as normal), and to the estimate the mean of the quadratic term (JCGM 100:2008/Amd.1:2026).
Everything works at one point or at many: ``...`` is the shape of the points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.maths.uncertainty import measurement_model
from cmm_uq.maths.uncertainty.measurement_model import Derivatives, MeasurementModel
from cmm_uq.maths.uncertainty.type_a import coverage_factor, effective_dof


@dataclass(frozen=True, eq=False)
class Propagated:
    """Outputs of a measurement model by the law of propagation."""

    inputs: Sequence[str]  # m names
    outputs: Sequence[str]  # p names
    value: Floats  # (p, ...)
    covariance: Floats  # (p, p, ...) of the outputs
    dof: Floats  # (p, ...) effective degrees of freedom
    sensitivity: Floats  # (p, m, ...) derivatives at the estimates
    contribution: Floats  # (p, m, ...) sensitivity × standard uncertainty, with its sign
    correlation: Floats  # (m, m) of the inputs
    bending: Floats  # (p, m, m, ...) parts of the variance by second derivatives, pairs of inputs above the diagonal
    cubic: Floats  # (p, ...) part of the variance from third derivatives; zero for first order, as is ``bending``

    @cached_property
    def u(self) -> Floats:
        # correlations can cancel the variance completely, and rounding then leaves less than nothing
        return np.asarray(np.sqrt(np.maximum(_diagonal(self.covariance), 0.0)))

    def interval(self, coverage: float) -> tuple[Floats, Floats]:
        """Ends (p, ...) of the coverage intervals value ± k u."""
        expanded = coverage_factor(self.dof, coverage) * self.u
        return self.value - expanded, self.value + expanded


def first_order(model: MeasurementModel) -> Propagated:
    """Propagate by the first derivatives; :class:`CmmUqError` where they or the model are not finite at the estimates."""
    u = [np.asarray(given.u) for given in model.inputs.values()]
    if model.differentiation == "complex_step":
        found = measurement_model.complex_step(model, model.means, [np.maximum(v, np.finfo(float).tiny) for v in u])
    else:
        found = measurement_model.derivatives(model, model.means)
    return _first_order(model, found, u)


def second_order(model: MeasurementModel) -> Propagated:
    """Propagate by first and second derivatives, with the third ones where they belong to the same order."""
    if model.differentiation == "complex_step":
        fix = "Write the model with NumPy's elementary functions, or use Monte Carlo"
        raise CmmUqError("second derivatives by complex steps are not exact", fix=fix)
    u = [np.asarray(given.u) for given in model.inputs.values()]
    found = measurement_model.derivatives(model, model.means, order=2)
    linear, correlation = _first_order(model, found, u), model.correlation_matrix
    with np.errstate(all="ignore"):  # what is not finite is refused below
        spread = np.stack(np.broadcast_arrays(*u, found.value[0])[:-1])
        scaled = np.asarray(found.hessian) * spread[:, None] * spread[None, :]
        correlated = np.einsum("pij...,jk->pik...", scaled, correlation)
        quadratic = 0.5 * np.einsum("pij...,qji...->pq...", correlated, correlated)
        cubic = np.stack([_cubic(model, linear, spread, row) for row in range(len(linear.value))])
        covariance = linear.covariance + quadratic + 0.5 * (cubic + np.swapaxes(cubic, 0, 1))
        variance = _diagonal(covariance)
        value = linear.value + 0.5 * np.einsum("pii...->p...", correlated)
        bending = 0.5 * correlated * np.swapaxes(correlated, 1, 2)  # of ½ tr(HVHV)
        m = len(correlation)
        both = (np.triu(np.ones((m, m))) + np.triu(np.ones((m, m)), 1)).reshape(1, m, m, *(1,) * (bending.ndim - 3))
        if np.any(variance < 0) or not np.all(np.isfinite(variance)):
            raise CmmUqError(
                "the terms of second order give no variance: the model bends too strongly within the uncertainty of its "
                "inputs",
                fix="Use Monte Carlo",
            )
        dof = effective_dof(linear.contribution, correlation, [given.dof for given in model.inputs.values()], variance)
        both_ways = np.asarray(bending * both)  # entries (i, j) and (j, i) added above the diagonal
        return replace(linear, value=value, covariance=covariance, dof=dof, bending=both_ways, cubic=_diagonal(cubic))


def _cubic(model: MeasurementModel, linear: Propagated, spread: Floats, row: int) -> Floats:
    """Σ (V g)ᵢ ∂ᵢ tr(H V): covariance (p, ...) of the linear term of one output with the cubic terms of all."""
    towards = np.einsum("ij,j...->i...", linear.correlation, linear.contribution[row]) * spread
    turning = measurement_model.hessian_along(model, model.means, list(towards)) * spread[:, None] * spread[None, :]
    return np.asarray(np.einsum("pij...,ij->p...", turning, linear.correlation))


def _first_order(model: MeasurementModel, found: Derivatives, u: Sequence[Any]) -> Propagated:
    for row, output in enumerate(model.outputs):
        _must_be_finite(found.value[row], f"the model gives no finite value of {output} at the estimates")
        for k, name in enumerate(model.names):
            problem = f"the derivative of {output} by {name} is not finite at the estimates"
            _must_be_finite(found.jacobian[row, k], problem)
    contribution = np.stack([found.jacobian[:, k] * v for k, v in enumerate(u)], axis=1)
    correlation = model.correlation_matrix
    if np.count_nonzero(correlation) == len(correlation):
        covariance = np.einsum("pi...,qi...->pq...", contribution, contribution)
    else:
        covariance = np.einsum("pi...,ij,qj...->pq...", contribution, correlation, contribution)
    variance = np.maximum(_diagonal(covariance), 0.0)
    dof = effective_dof(contribution, correlation, [given.dof for given in model.inputs.values()], variance)
    p, m, *shape = contribution.shape
    none, no_cubic = np.zeros((p, m, m, *(1 for _ in shape))), np.zeros((p, *shape))
    figures = found.value, covariance, dof, found.jacobian, contribution, correlation, none, no_cubic
    return Propagated(model.names, list(model.outputs), *figures)


def _diagonal(matrices: Floats) -> Floats:
    return np.asarray(np.einsum("pp...->p...", matrices))


def _must_be_finite(numbers: Floats, problem: str) -> None:
    bad = np.size(numbers) - int(np.count_nonzero(np.isfinite(numbers)))
    if bad:
        points = f" ({bad} of {np.size(numbers)} points)" if np.size(numbers) > 1 else ""
        raise CmmUqError(problem + points, fix="Mend the estimates or the model, or use Monte Carlo")
