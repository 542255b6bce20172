"""Components of random fields on many points, without the covariance of each with each.

A pivoted Cholesky decomposition (Harbrecht, Peters, Schneider 2012, Appl. Numer. Math. 62, 428) asks for one column of the
covariance after the other, always that of the point of which most is left, and ends when nothing is. A smooth field has
far fewer components than points.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cmm_uq.analysis.parts.causes import components
from cmm_uq.base.points import Floats

MANY = 1000
"""Points up to which the eigenvectors of the whole covariance are quickly found."""

_LEFT = 1e-8
"""Of the largest variance that may be left of a point's: a ten-thousandth of a standard deviation."""

Covariance = Callable[[slice], Floats]
"""Covariance (m, n) of some points with all n."""


def field_components(covariance: Covariance, variances: Floats) -> Floats:
    """(K, n) of a random field on n points: times independent standard normal numbers they add up to it.

    Parameters
    ----------
    covariance : of some points with all.
    variances : (n,) of each point.
    """
    n = len(variances)
    if n <= MANY:
        return components(covariance(slice(None)))
    left, least = variances.copy(), _LEFT * float(variances.max())
    found, count = np.empty((64, n)), 0
    while count < n and left.max() > least:
        if count == len(found):
            found = np.concatenate([found, np.empty_like(found)])
        pivot = int(np.argmax(left))
        column = covariance(slice(pivot, pivot + 1))[0] - found[:count, pivot] @ found[:count]
        found[count] = column / np.sqrt(left[pivot])
        left -= found[count] ** 2
        left[pivot] = 0.0
        count += 1
    return found[:count].copy()
