"""Results to and from the package ``uncertainties``, correlations kept. The package is needed only when this is used."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.maths.uncertainty.distributions import constant
from cmm_uq.maths.uncertainty.evaluation import Evaluation
from cmm_uq.maths.uncertainty.type_a import JointInputs, multivariate_normal


def _package() -> Any:
    try:
        import uncertainties
    except ImportError as error:
        raise CmmUqError("the package 'uncertainties' is not installed", fix="pip install uncertainties") from error
    return uncertainties


def to_uncertainties(values: Floats, covariance: Floats) -> list[Any]:
    """Values (p,) with their covariance (p, p) as correlated numbers of ``uncertainties``."""
    return list(_package().correlated_values(np.asarray(values).tolist(), np.asarray(covariance).tolist()))


def evaluation_to_uncertainties(evaluation: Evaluation) -> dict[str, Any]:
    """The outputs of an evaluation as correlated numbers by name."""
    u = np.array([stated.u for stated in evaluation.stated.values()])
    values = np.array([stated.value for stated in evaluation.stated.values()])
    numbers = to_uncertainties(values, np.nan_to_num(evaluation.correlation) * np.outer(u, u))
    return dict(zip(evaluation.stated, numbers, strict=True))


def from_uncertainties(numbers: Mapping[str, Any]) -> JointInputs:
    """Numbers of ``uncertainties`` as inputs of a measurement model, with the correlations that they share."""
    covariance = np.array(_package().covariance_matrix(list(numbers.values())))
    values = {name: float(number.nominal_value) for name, number in numbers.items()}
    uncertain = [k for k, variance in enumerate(np.diagonal(covariance)) if variance > 0]
    names = [list(numbers)[k] for k in uncertain]
    joint = multivariate_normal(names, np.array([values[n] for n in names]), covariance[np.ix_(uncertain, uncertain)])
    exact = {name: constant(value) for name, value in values.items() if name not in names}
    return JointInputs({name: {**exact, **joint.inputs}[name] for name in numbers}, joint.correlation)
