"""The measurement model: outputs as a function of inputs, and all that is known of the inputs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.maths.uncertainty.correlation import Correlations, correlation_matrix
from cmm_uq.maths.uncertainty.derivatives import Differentiation
from cmm_uq.maths.uncertainty.distributions import Distribution


@dataclass(frozen=True, eq=False)
class MeasurementModel:
    """Outputs from inputs.

    Parameters
    ----------
    function : called with the inputs by name; gives a mapping from output name to value, or, where there is one output,
        its value. Must take arrays and be written with NumPy's functions.
    inputs : what is known of each input; with arrays for parameters the law of propagation works at all points at once.
    outputs : names of the outputs.
    correlation : coefficients of correlated pairs of inputs.
    differentiation : ``"jets"`` for models of elementary functions, ``"complex_step"`` for other analytic models.
    """

    function: Callable[..., Any]
    inputs: Mapping[str, Distribution]
    outputs: Sequence[str] = ("y",)
    correlation: Correlations = field(default_factory=dict)
    differentiation: Differentiation = "jets"

    @property
    def names(self) -> list[str]:
        """Names of the m inputs."""
        return list(self.inputs)

    @property
    def means(self) -> list[Any]:
        """Estimates of the m inputs, floats or (n,)."""
        return [given.mean for given in self.inputs.values()]

    @cached_property
    def correlation_matrix(self) -> Floats:
        """(m, m) correlation matrix of the inputs, columns of one earlier sample included."""
        return correlation_matrix(self.names, {**self._within_samples(), **self.correlation})

    def _within_samples(self) -> dict[tuple[str, str], float]:
        found = {}
        for a, first in self.inputs.items():
            for b, second in self.inputs.items():
                if a < b and first.together and first.together == second.together:
                    found[a, b] = float(np.corrcoef(np.asarray(first.draws), np.asarray(second.draws))[0, 1])
        return found

    def must_be_at_one_point(self) -> None:
        """Refuse a model whose inputs have several values.

        Raises
        ------
        CmmUqError : names such an input.
        """
        for name, given in self.inputs.items():
            if np.ndim(given.mean) or np.ndim(given.u) or np.ndim(given.dof):
                raise CmmUqError(f"{name} has several values", fix="Evaluate one point at a time, or use first_order")

    def __call__(self, *values: Any) -> tuple[Any, ...]:
        """The p outputs at the m inputs, both in order."""
        result = self.function(**dict(zip(self.inputs, values, strict=True)))
        if not isinstance(result, Mapping):
            result = {self.outputs[0]: result}
        missing = [name for name in self.outputs if name not in result]
        if missing:
            raise CmmUqError(f"the model gives no output {missing[0]!r}", fix=f"It gives {', '.join(result)}")
        return tuple(result[name] for name in self.outputs)
