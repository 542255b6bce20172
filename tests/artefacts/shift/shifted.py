"""Recordings of shifted artefacts on machines whose error is known."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from cmm_uq.artefacts.shift import integration
from cmm_uq.base.points import Floats, Points

Error = Callable[[Floats], Floats]
PITCH_20 = 20.0 * np.arange(23)


def bent(x: Floats) -> Floats:
    """About 27 µm peak to valley over 460 mm; neither a sine of the estimator's basis nor a draw of its prior."""
    return np.asarray(0.006 * np.cos(x / 70) + 0.012 * (x / 230 - 1) ** 3)


def read(
    error: Error, places: Floats, shifts: Sequence[float], noise: float = 0.0, repeats: int = 1, seed: int = 0
) -> Points:
    """Readings r with r + e(r) = place + shift, one row a repeat."""
    random = np.random.default_rng(seed)
    rows = []
    for s, shift in enumerate(shifts, 1):
        ideal = places + shift
        for _ in range(10):
            ideal = places + shift - error(ideal)
        for p, x in enumerate(ideal, 1):
            rows += [(x + random.normal(0, noise), s, p, k) for k in range(1, repeats + 1)]
    x, series, point, repeat = np.array(rows).T
    whole = (values.astype(np.int64) for values in (series, point, repeat))
    return Points(np.column_stack([x, 0 * x, 0 * x]), *whole)


def integrated_by_monte_carlo(
    a: Floats, b: Floats, u: Floats, *, method: integration.Method = "pitch", shift: float | None = None, u_shift: float = 0.0,
    known: integration.KnownSpan | None = None, trials: int = 100_000, seed: int = 0,
) -> integration.IntegratedCurve:  # fmt: skip
    """The curve by propagating distributions (JCGM 102:2011, 7): mean and covariance of Gaussian trials."""
    given = [*([] if shift is None else [(shift, u_shift)]), *([] if known is None else [(known.length, known.u)])]
    more, sd = np.array(given, dtype=np.float64).reshape(-1, 2).T
    random, n = np.random.default_rng(seed), len(a)
    drawn = np.concatenate([a, b, more]) + np.concatenate([*u, sd]) * random.standard_normal(
        (trials, 2 * n + len(more))
    )
    first, second = drawn[:, :n], drawn[:, n : 2 * n]
    curve = integration.calibration_curve(first, second, None if shift is None else drawn[:, 2 * n], method)
    if known is not None:
        curve = integration.with_known_length(curve, known.first, known.last, drawn[:, -1])
    errors = integration.position_error(first, curve)
    return integration.IntegratedCurve(a, errors.mean(axis=0), np.cov(errors, rowvar=False))
