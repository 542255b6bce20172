"""The reference sets are checked against a fit by other software, since the project's own fits are checked by them."""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from cmm_uq.maths.geometry import cap_directions
from cmm_uq.maths.geometry.reference_sets import points_with_known_fit


def test_least_squares_of_scipy_finds_the_sphere_that_a_reference_set_was_built_about():
    n = cap_directions(1.2, 60)
    points = points_with_known_fit(20.0 * n, n[:, None, :], np.ones((60, 1, 1)), 0.05, seed=1)
    fitted = least_squares(
        lambda p: np.linalg.norm(points - p[:3], axis=1) - p[3],
        [0.1, -0.1, 0.1, 19.0],
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
    )
    np.testing.assert_allclose(fitted.x, [0, 0, 0, 20.0], atol=1e-8)


def test_the_largest_deviation_is_the_form_asked_for():
    n = cap_directions(np.pi, 40)
    points = points_with_known_fit(5.0 * n, n[:, None, :], np.ones((40, 1, 1)), 0.02, seed=2)
    assert np.isclose(np.abs(np.linalg.norm(points, axis=1) - 5.0).max(), 0.02, rtol=1e-12)
