"""The measurement model: outputs as a function of inputs, what is known of them, and its exact derivatives.

Jets give the first and second derivatives of whatever is written with NumPy's elementary functions. A model that they
cannot follow (linear algebra, a foreign library) but that is analytic is differentiated by complex steps (Squire and
Trapp, SIAM Review 40, 1998), checked against a coarse real step, since a model that is not analytic would go wrong
there without a word.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.maths.uncertainty.correlation import Correlations, correlation_matrix
from cmm_uq.maths.uncertainty.distributions import Distribution
from cmm_uq.maths.uncertainty.jets import Jet

Function = Callable[..., Sequence[Any]]  # m quantities in, p out; each a float, an array (n,) or a jet
_IMAGINARY_STEP = 1e-40
_COARSE_STEP = 1e-2


@dataclass(frozen=True, eq=False)
class Derivatives:
    """What a model does near its estimates; ``...`` is the shape of the points, empty for a single one."""

    value: Floats  # (p, ...)
    jacobian: Floats  # (p, m, ...)
    hessian: Floats | None = None  # (p, m, m, ...) second derivatives, where they were asked for


def derivatives(function: Function, at: Sequence[Any], order: Literal[1, 2] = 1) -> Derivatives:
    """Derivatives by jets at m estimates, floats or arrays that broadcast, up to an order.

    Raises :class:`CmmUqError` where the model uses a function of which no exact derivative is known here.
    """
    outputs, shape = _jets(function, at, order), _shape(at)
    jacobian = np.zeros((len(outputs), len(at), *shape))
    for row, output in enumerate(outputs):
        for k, slope in output.first.items() if isinstance(output, Jet) else ():
            jacobian[row, k] = slope
    value = _stack([output.value if isinstance(output, Jet) else output for output in outputs], shape)
    return Derivatives(value, jacobian, _hessian(outputs, len(at), shape) if order > 1 else None)


def hessian_along(function: Function, at: Sequence[Any], direction: Sequence[Any]) -> Floats:
    """Rate of change (p, m, m, ...) of the second derivatives when the m inputs move along a direction."""
    moved = [x + _IMAGINARY_STEP * 1j * np.asarray(d) for x, d in zip(at, direction, strict=True)]
    hessian = _hessian(_jets(function, moved, 2), len(at), _shape(moved), np.complex128)
    return np.asarray(hessian.imag / _IMAGINARY_STEP)


def complex_step(function: Function, at: Sequence[Any], scale: Sequence[Any]) -> Derivatives:
    """First derivatives of an analytic model, which takes complex numbers, by complex steps.

    ``at``: m estimates, floats or arrays that broadcast. ``scale``: m positive lengths over which the model changes smoothly,
    such as the standard uncertainties. Raises :class:`CmmUqError` where the model is not analytic.
    """
    shape = _shape(at)
    value = _stack(function(*at), shape)
    jacobian = np.empty((len(value), len(at), *shape))
    for k, x in enumerate(at):
        moved = list(at)
        moved[k] = np.asarray(x) + 1j * _IMAGINARY_STEP
        outputs = np.stack([np.broadcast_to(np.asarray(y, np.complex128), shape) for y in function(*moved)])
        jacobian[:, k] = outputs.imag / _IMAGINARY_STEP
        step = _COARSE_STEP * np.asarray(scale[k])
        moved[k] = x + step
        above = _stack(function(*moved), shape)
        moved[k] = x - step
        exact, coarse = jacobian[:, k] * step, (above - _stack(function(*moved), shape)) / 2
        allowed = 1e-2 * np.maximum(np.abs(exact), np.abs(coarse)) + 1e-12 * np.abs(value)
        if np.any(np.abs(exact - coarse) > allowed):
            raise CmmUqError(
                "complex steps and real steps give different derivatives: the model is not analytic near the estimate",
                fix="Write it with NumPy's elementary functions and differentiate it by jets",
            )
    return Derivatives(value, jacobian)


def _jets(function: Function, at: Sequence[Any], order: int) -> Sequence[Any]:
    with np.errstate(all="ignore"):
        return function(*(Jet.variable(np.asarray(x)[()], k, order) for k, x in enumerate(at)))


def _shape(at: Sequence[Any]) -> tuple[int, ...]:
    return np.broadcast_shapes(*(np.shape(x) for x in at))


def _stack(outputs: Sequence[Any], shape: tuple[int, ...]) -> Floats:
    return np.stack([np.broadcast_to(np.asarray(y, dtype=np.float64), shape) for y in outputs])


def _hessian(outputs: Sequence[Any], m: int, shape: tuple[int, ...], kind: type[np.generic] = np.float64) -> Any:
    hessian: NDArray[Any] = np.zeros((len(outputs), m, m, *shape), dtype=kind)
    for row, output in enumerate(outputs):
        for (j, k), bend in (output.second or {}).items() if isinstance(output, Jet) else ():
            hessian[row, j, k] = hessian[row, k, j] = bend
    return hessian


@dataclass(frozen=True, eq=False)
class MeasurementModel:
    """Outputs from inputs.

    ``function`` is called with the inputs by name and gives a mapping from output name to value, or, where there is one
    output, its value; it must take arrays and be written with NumPy's functions. With arrays for parameters of ``inputs`` the
    law of propagation works at all points at once. ``correlation``: coefficients of correlated pairs of inputs.
    ``differentiation``: ``"jets"`` for models of elementary functions, ``"complex_step"`` for other analytic models.
    """

    function: Callable[..., Any]
    inputs: Mapping[str, Distribution]
    outputs: Sequence[str] = ("y",)
    correlation: Correlations = field(default_factory=dict)
    differentiation: Literal["jets", "complex_step"] = "jets"

    @property
    def names(self) -> list[str]:
        return list(self.inputs)

    @property
    def means(self) -> list[Any]:
        """Of the m inputs, floats or (n,)."""
        return [given.mean for given in self.inputs.values()]

    @cached_property
    def correlation_matrix(self) -> Floats:
        """(m, m) correlation matrix of the inputs, columns of one earlier sample included."""
        within = {
            (a, b): float(np.corrcoef(np.asarray(first.draws), np.asarray(second.draws))[0, 1])
            for a, first in self.inputs.items()
            for b, second in self.inputs.items()
            if a < b and first.together and first.together == second.together
        }
        return correlation_matrix(self.names, {**within, **self.correlation})

    def must_be_at_one_point(self) -> None:
        """Refuse inputs of several values."""
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
