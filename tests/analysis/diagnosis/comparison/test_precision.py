"""The precision of what the baseline leaves, against the inverse of its dense covariance."""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.diagnosis.comparison.algebra import precisions
from tests.analysis.diagnosis.dense_noise import covariance, some_kinds

ROWS = 14


def test_the_precision_is_the_inverse_of_the_covariance_of_what_is_left() -> None:
    random = np.random.default_rng(2)
    reached = np.linalg.qr(random.standard_normal((ROWS, 3)))[0]
    certified = random.standard_normal((ROWS, 2))
    free = np.linalg.qr(np.hstack([reached, random.standard_normal((ROWS, ROWS - 3))]))[0][:, 3:]
    columns = random.standard_normal((ROWS, 4))
    found = []
    for kind, precision in zip(
        some_kinds(np.full(ROWS, 1.4)), precisions(some_kinds(np.full(ROWS, 1.4)), reached, certified), strict=True
    ):
        inside = free.T @ (covariance(kind) + certified @ certified.T) @ free
        np.testing.assert_allclose(
            precision(columns), free @ np.linalg.solve(inside, free.T @ columns), rtol=1e-8, atol=1e-9
        )
        found.append(precision.log + 0.5 * np.linalg.slogdet(inside)[1] - np.log(kind.probability) - kind.log_factor)
    np.testing.assert_allclose(found, 0.0, atol=1e-9)
