"""Derivatives of a measurement model, exact to rounding: for many outputs and many points at once.

Jets give the first and second derivatives of whatever is written with NumPy's elementary functions. A model that they
cannot follow (linear algebra, a foreign library) but that is analytic is differentiated by complex steps (Squire and
Trapp, SIAM Review 40, 1998), checked against a coarse real step, since a model that is not analytic would go wrong
there without a word.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.maths.uncertainty.jets import Jet

Function = Callable[..., Sequence[Any]]
"""m quantities in, p quantities out; each a float, an array (n,) or a jet."""

Differentiation = Literal["jets", "complex_step"]

_IMAGINARY_STEP = 1e-40
_COARSE_STEP = 1e-2


@dataclass(frozen=True, eq=False)
class Derivatives:
    """What a model does near its estimates; ``...`` is the shape of the points, empty for a single one.

    Parameters
    ----------
    value : (p, ...) outputs.
    jacobian : (p, m, ...) first derivatives by the inputs.
    hessian : (p, m, m, ...) second derivatives; None when only first ones were asked for.
    """

    value: Floats
    jacobian: Floats
    hessian: Floats | None = None


def derivatives(function: Function, at: Sequence[Any], order: Literal[1, 2] = 1) -> Derivatives:
    """Derivatives by jets.

    Parameters
    ----------
    function : the model.
    at : m estimates, floats or arrays that broadcast.
    order : highest derivative.

    Raises
    ------
    CmmUqError : the model uses a function of which no exact derivative is known here.
    """
    outputs, shape = _jets(function, at, order), _shape(at)
    value, jacobian = _value_and_jacobian(outputs, len(at), shape)
    return Derivatives(value, jacobian, _hessian(outputs, len(at), shape) if order > 1 else None)


def hessian_along(function: Function, at: Sequence[Any], direction: Sequence[Any]) -> Floats:
    """Rate of change (p, m, m, ...) of the second derivatives when the m inputs move along a direction."""
    moved = [x + _IMAGINARY_STEP * 1j * np.asarray(d) for x, d in zip(at, direction, strict=True)]
    hessian = _hessian(_jets(function, moved, 2), len(at), _shape(moved), np.complex128)
    return np.asarray(hessian.imag / _IMAGINARY_STEP)


def complex_step(function: Function, at: Sequence[Any], scale: Sequence[Any]) -> Derivatives:
    """First derivatives of an analytic model by complex steps.

    Parameters
    ----------
    function : the model; must take complex numbers.
    at : m estimates, floats or arrays that broadcast.
    scale : m positive lengths over which the model changes smoothly, such as the standard uncertainties.

    Raises
    ------
    CmmUqError : the model is not analytic (it takes absolute values, real parts or compares).
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
        below = _stack(function(*moved), shape)
        _must_agree(jacobian[:, k] * step, (above - below) / 2, 1e-12 * np.abs(value))
    return Derivatives(value, jacobian)


def _must_agree(exact: Floats, coarse: Floats, rounding: Floats) -> None:
    allowed = 1e-2 * np.maximum(np.abs(exact), np.abs(coarse)) + rounding
    if np.any(np.abs(exact - coarse) > allowed):
        raise CmmUqError(
            "complex steps and real steps give different derivatives: the model is not analytic near the estimate",
            fix="Write it with NumPy's elementary functions and differentiate it by jets",
        )


def _jets(function: Function, at: Sequence[Any], order: int) -> Sequence[Any]:
    with np.errstate(all="ignore"):
        return function(*(Jet.variable(np.asarray(x)[()], k, order) for k, x in enumerate(at)))


def _shape(at: Sequence[Any]) -> tuple[int, ...]:
    return np.broadcast_shapes(*(np.shape(x) for x in at))


def _stack(outputs: Sequence[Any], shape: tuple[int, ...]) -> Floats:
    return np.stack([np.broadcast_to(np.asarray(y, dtype=np.float64), shape) for y in outputs])


def _value_and_jacobian(outputs: Sequence[Any], m: int, shape: tuple[int, ...]) -> tuple[Floats, Floats]:
    jacobian = np.zeros((len(outputs), m, *shape))
    for row, output in enumerate(outputs):
        for k, slope in output.first.items() if isinstance(output, Jet) else ():
            jacobian[row, k] = slope
    return _stack([output.value if isinstance(output, Jet) else output for output in outputs], shape), jacobian


def _hessian(outputs: Sequence[Any], m: int, shape: tuple[int, ...], kind: type[np.generic] = np.float64) -> Any:
    hessian: NDArray[Any] = np.zeros((len(outputs), m, m, *shape), dtype=kind)
    for row, output in enumerate(outputs):
        for (j, k), bend in (output.second or {}).items() if isinstance(output, Jet) else ():
            hessian[row, j, k] = hessian[row, k, j] = bend
    return hessian
