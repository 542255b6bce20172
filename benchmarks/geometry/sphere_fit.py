"""Sphere through 17,000 points of a hemisphere, beside plain NumPy and SciPy in one run, one core.

Run:  OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 python benchmarks/geometry/sphere_fit.py
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from scipy.optimize import least_squares

from cmm_uq.maths.geometry import cap_directions, fit_circle, fit_cone, fit_cylinder, fit_line, fit_plane, fit_sphere
from tests.maths.geometry.reference_sets import points_with_known_fit

RADIUS, N, REPEATS = 38.125, 17_000, 15


def numpy_gauss_newton(points: np.ndarray) -> np.ndarray:
    """What one would write in NumPy: linear start, then Gauss–Newton by lstsq."""
    A = np.column_stack([2 * points, np.ones(len(points))])
    x = np.linalg.lstsq(A, (points**2).sum(axis=1), rcond=None)[0]
    x[3] = np.sqrt(x[3] + x[:3] @ x[:3])
    for _ in range(50):
        difference = points - x[:3]
        distance = np.linalg.norm(difference, axis=1)
        J = np.column_stack([-difference / distance[:, None], -np.ones(len(points))])
        step = np.linalg.lstsq(J, x[3] - distance, rcond=None)[0]
        x = x + step
        if np.abs(step).max() < 1e-12:
            break
    return x


def scipy_lm(points: np.ndarray) -> np.ndarray:
    def residual(x: np.ndarray) -> np.ndarray:
        return np.linalg.norm(points - x[:3], axis=1) - x[3]

    def jacobian(x: np.ndarray) -> np.ndarray:
        difference = points - x[:3]
        return np.column_stack([-difference / np.linalg.norm(difference, axis=1)[:, None], -np.ones(len(points))])

    start = np.append(points.mean(axis=0), points.std())
    return least_squares(residual, start, jacobian, method="lm", xtol=1e-15, ftol=1e-15, gtol=1e-15).x


def timed(run: Callable[[], object]) -> float:
    """Median time, ms."""
    times = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        run()
        times.append(time.perf_counter() - begin)
    return float(np.median(times) * 1e3)


def main() -> None:
    n = cap_directions(np.pi / 2, N)
    centre = np.array([412.0, 280.0, -150.0])
    points = points_with_known_fit(RADIUS * n, n[:, None, :], np.ones((N, 1, 1)), 9e-3, seed=1) + centre
    true = np.append(centre, RADIUS)
    methods: dict[str, Callable[[], np.ndarray]] = {
        "cmm_uq": lambda: (lambda s: np.append(s.centre, s.radius))(fit_sphere(points)),
        "NumPy, Gauss–Newton by lstsq": lambda: numpy_gauss_newton(points),
        "SciPy, least_squares lm, analytic Jacobian": lambda: scipy_lm(points),
    }
    print(f"sphere, {N} points of a hemisphere")
    for name, method in methods.items():
        print(f"  {name:45s} {timed(method):7.2f} ms   off by {np.abs(method() - true).max():.1e} mm")
    begin = time.perf_counter()
    for _ in range(40):
        fit_sphere(points)
    print(f"  forty spheres: {time.perf_counter() - begin:.3f} s")
    rng = np.random.default_rng(2)
    turn, height = rng.uniform(0, 2 * np.pi, 1000), rng.uniform(-40, 40, 1000)
    round_ = np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])
    noise = rng.normal(scale=2e-3, size=(1000, 3))
    sets = {
        fit_line: height[:, None] * [0, 0, 1],
        fit_plane: 50 * round_ * rng.uniform(0, 1, (1000, 1)),
        fit_circle: 20 * round_,
        fit_sphere: 20 * cap_directions(1.5, 1000),
        fit_cylinder: 20 * round_ + height[:, None] * [0, 0, 1],
        fit_cone: (20 + 0.3 * height)[:, None] * round_ + height[:, None] * [0, 0, 1],
    }
    print("1000 points")
    for fit, surface in sets.items():
        print(f"  {fit.__name__:14s} {timed(lambda fit=fit, surface=surface: fit(surface + noise)):7.2f} ms")


if __name__ == "__main__":
    main()
