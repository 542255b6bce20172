"""How well effects are told apart, from the information on them and on all that must be fitted besides.

Two effects whose columns are parallel after everything else has been projected out cannot be told apart by any method; the
sine of the angle between them is the part of one that the other cannot imitate. (Baarda 1968; Teunissen 2018, *Distributional
theory for the DIA method*: minimal detectable and identifiable bias.)
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.points import Floats

SEEN = 1e-6
"""Part of an effect's information, of what it would be if nothing else were fitted, below which rounding hides it."""

FAINT = 1.0
"""Information, for an effect of its prior standard deviation, below which it does not stand out of the noise."""

_RIDGE = 1e-13
_PART = 0.1
"""Share from which on a column counts as part of what looks like another."""


def left_of(information: Floats, rivals: Sequence[int], base: Sequence[int]) -> Floats:
    """Information (..., r, r) on rivals once the base (rows) is fitted: the Schur complement.

    Parameters
    ----------
    information : (..., k, k).
    """
    rival, fitted = list(rivals), list(base)
    own = information[..., rival, :][..., :, rival]
    if not fitted:
        return np.asarray(own)
    cross = information[..., fitted, :][..., :, rival]
    within = information[..., fitted, :][..., :, fitted]
    scale = np.sqrt(np.maximum(np.einsum("...ii->...i", within), 1e-300))
    scaled = within / scale[..., :, None] / scale[..., None, :]
    scaled = scaled + _RIDGE * np.eye(len(fitted))
    solved = np.linalg.solve(scaled, cross / scale[..., :, None]) / scale[..., :, None]
    return np.asarray(own - np.swapaxes(cross, -1, -2) @ solved)


def cosines(left: Floats, alone: Floats) -> Floats:
    """Absolute cosines (..., r, r) between effects; 1 on the diagonal, and with an effect that is not seen.

    Parameters
    ----------
    left : (..., r, r) information on them, see :func:`left_of`.
    alone : (..., r) information on each if nothing else were fitted.
    """
    size = np.einsum("...ii->...i", left)
    seen = visible(left, alone)
    root = np.sqrt(np.where(seen, size, 1.0))
    cosine = np.abs(left) / root[..., :, None] / root[..., None, :]
    cosine = np.where(seen[..., :, None] & seen[..., None, :], np.minimum(cosine, 1.0), 1.0)
    return np.asarray(np.where(np.eye(left.shape[-1], dtype=bool), 1.0, cosine))


def visible(left: Floats, alone: Floats) -> NDArray[np.bool_]:
    """(..., r) whether anything of each effect is left."""
    return np.asarray(np.einsum("...ii->...i", left) > np.maximum(SEEN * alone, FAINT))


def imitators(information: Floats, row: int, base: Sequence[int]) -> list[int]:
    """Rows of the base that together look like an effect that they hide, those that matter.

    By least squares of the effect's column on those of the base; of many solutions the smallest.
    """
    fitted = list(base)
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    scaled = information / scale[:, None] / scale[None, :]
    parts = np.linalg.lstsq(scaled[np.ix_(fitted, fitted)], scaled[fitted, row], rcond=_RIDGE**0.5)[0]
    return [i for i, part in zip(fitted, parts, strict=True) if abs(part) > _PART]
