"""Speed and memory of virtual measurements: a plate of 100 points, ten least-squares characteristics, every kind of cause.

Beside a plain NumPy loop over least squares (Gauss–Newton by ``numpy.linalg.lstsq``, one draw at a time) and the same with
``scipy.optimize.least_squares``, on as many draws as fit into a few seconds; both are given the displaced points for nothing.

Run: ``OPENBLAS_NUM_THREADS=2 python -m benchmarks.parts.speed``
"""

from __future__ import annotations

import resource
import time

import numpy as np
from scipy.optimize import least_squares

from cmm_uq.parts.machine import StatedNoise, unmodelled_errors
from cmm_uq.parts.of_temperature import Expansion, Surroundings
from cmm_uq.parts.plan import Characteristic, Plan, Stylus
from cmm_uq.parts.virtual import Circumstances, Virtual
from tests.parts_drawn import POSE, block, circle, machine, plane

NAMES = ["scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx"]


def circumstances() -> Circumstances:
    draws = np.random.default_rng(1).standard_normal((10_000, 6)) * [3, 3, 3, 2, 2, 2]
    state = machine(
        NAMES, draws, unmodelled=unmodelled_errors(NAMES, {}), noise=StatedNoise(np.full(3, 1e-3), 5e-4, 5e-4)
    )
    part = Expansion(11.5e-6, 1e-6, 21.0, 0.3)
    return Circumstances(state, (POSE,), Surroundings(part, u_gradient_k_per_m=np.full(3, 0.5)))


def styli() -> tuple[Stylus, ...]:
    return (Stylus("stylus", np.array([0, 0, -100.0]), 4.0, 0.5, np.zeros(3), 0.8, np.array([100.0, 100.0, -400.0])),)


def _cylinder(state: np.ndarray, points: np.ndarray) -> np.ndarray:
    x, y, a, b, r = state
    w = np.array([a, b, 1.0]) / np.sqrt(1 + a * a + b * b)
    apart = points - [x, y, 0.0]
    return np.linalg.norm(apart - np.outer(apart @ w, w), axis=1) - r


def _loop(points: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Gauss–Newton by differences."""
    state = start.copy()
    for _ in range(4):
        d = _cylinder(state, points)
        J = np.column_stack([(_cylinder(state + 1e-6 * e, points) - d) / 1e-6 for e in np.eye(5)])
        state = state - np.linalg.lstsq(J, d, rcond=None)[0]
    return state


def timed(virtual: Virtual, draws: int) -> float:
    start = time.perf_counter()
    virtual.simulated(draws)
    return time.perf_counter() - start


def peers(plan: Plan) -> None:
    """Two bores of 24 points; the rest of the characteristics are left to them for nothing."""
    points, random = plan.points[plan.rows["h1"]], np.random.default_rng(2)
    start, moved = np.array([30.0, 40.0, 0, 0, 10.0]), points + 1e-3 * random.standard_normal((300, *points.shape))
    begin = time.perf_counter()
    ours = np.array([_loop(each, start) for each in moved])
    loop = (time.perf_counter() - begin) / len(moved)
    begin = time.perf_counter()
    theirs = np.array([least_squares(_cylinder, start, args=(each,), xtol=1e-12).x for each in moved[:100]])
    scipy = (time.perf_counter() - begin) / 100
    print(f"one cylinder, one draw: NumPy loop {1e6 * loop:.0f} µs, scipy {1e6 * scipy:.0f} µs; "
          f"they differ by {1e6 * np.abs(ours[:100] - theirs).max():.2g} nm")  # fmt: skip


def main() -> None:
    features, characteristics = block()
    plan = Plan(features, characteristics, styli(), times_s=3.0 * np.arange(100))
    virtual = Virtual(plan, circumstances())
    coefficients = sum(len(cause.factors) for cause in virtual.places[0].causes)
    print(f"{len(plan.points)} points, {len(characteristics)} characteristics, {coefficients} coefficients")
    print(f"first order is off by {100 * virtual.off.max():.2f} % of u")
    print(f"10⁶ virtual measurements: {timed(virtual, 1_000_000):.1f} s")
    print(f"peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MiB")
    virtual.exact = True
    print(f"10⁵ of them with every feature on its points: {timed(virtual, 100_000):.1f} s")
    flat = Plan(
        (plane("A", [0, 0, 1], [0, 0, 0], [[200, 0, 0], [0, 100, 0]], (10, 10)), circle("c", [100, 50, 0], 20.0, 100)),
        (Characteristic("flat", "flatness", ("A",), association="minimum_zone"),
         Characteristic("round", "roundness", ("c",), association="minimum_zone")),
        styli(), times_s=3.0 * np.arange(200),
    )  # fmt: skip
    zones = Virtual(flat, circumstances())
    print(f"10⁴ flatnesses and roundnesses of 100 points by minimum zone: {timed(zones, 10_000):.1f} s")
    print(f"peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MiB")
    peers(plan)


if __name__ == "__main__":
    main()
