"""A part measured again and again: 100 points, ten least-squares characteristics, beside plain NumPy and SciPy in one run.

Run:  OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 python -m benchmarks.geometry.virtual_part [DRAWS]
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from scipy.optimize import least_squares, linprog

from cmm_uq.maths.geometry import Repeated, associate, cap_directions
from cmm_uq.maths.geometry.placed import FeatureKind, Placed

CORES, BLOCK, SCATTER = 2, 5000, 2e-3
MINIMUM_ZONES = 10_000
ALONE = 100


def part() -> dict[str, tuple[FeatureKind, np.ndarray]]:
    """Seven features, 100 points."""
    rng = np.random.default_rng(1)

    def ring(n: int, radius: float) -> np.ndarray:
        turn = np.arange(n) * 2 * np.pi / n
        return radius * np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])

    height = np.repeat([0.0, 15, 30, 45], 5)
    barrel = np.vstack([ring(5, 1.0)] * 4)
    taper = np.vstack([ring(5, 1.0)] * 3)
    low = np.repeat([-5.0, 0, 5], 5)
    return {
        "top": ("plane", np.column_stack([rng.uniform(-60, 60, (20, 2)), np.zeros(20)])),
        "edge": ("line", np.linspace(0, 90, 10)[:, None] * [0.8, 0.6, 0.0]),
        "bore": ("circle", ring(12, 15.0) + np.array([40.0, 0, 0])),
        "pin": ("circle", ring(8, 6.0) + np.array([-40.0, 10, 0])),
        "ball": ("sphere", 10 * cap_directions(1.8, 15) + [0, 0, 30]),
        "barrel": ("cylinder", 20 * barrel + height[:, None] * [0, 0, 1]),
        "taper": ("cone", (12 + 0.3 * low)[:, None] * taper + low[:, None] * [0, 0, 1]),
    }


PART = part()
REPEATED = {name: Repeated(kind, points) for name, (kind, points) in PART.items()}


def characteristics(seed: int, draws: int) -> np.ndarray:
    """(10, draws): flatness, straightness, two diameters and their distance, roundness, three sizes, cylindricity."""
    rng = np.random.default_rng(seed)
    drawn = {
        name: of.least_squares(rng.normal(scale=SCATTER, size=(draws, *of.points.shape)))
        for name, of in REPEATED.items()
    }
    bore, pin = drawn["bore"], drawn["pin"]
    return np.array([
        drawn["top"].form, drawn["edge"].form, bore.size, pin.size, np.linalg.norm(bore.position - pin.position, axis=1),
        bore.form, drawn["ball"].size, drawn["barrel"].size, drawn["barrel"].form, drawn["taper"].half_angle,
    ])  # fmt: skip


def numpy_loop(of: Placed, local: np.ndarray) -> np.ndarray:
    """What one would write: Gauss–Newton by lstsq, one measurement after the other, with the same derivatives."""
    state = of.state.copy()
    for _ in range(20):
        d, J = of.shape.distances(state[None], local[:, None])
        step = np.linalg.lstsq(J[:, 0].T, -d[0], rcond=None)[0]
        state = state + step
        if np.abs(step).max() < 1e-9:
            break
    return state


def scipy_fit(of: Placed, local: np.ndarray) -> np.ndarray:
    def residual(state: np.ndarray) -> np.ndarray:
        return of.shape.distances(state[None], local[:, None])[0][0]

    def jacobian(state: np.ndarray) -> np.ndarray:
        return of.shape.distances(state[None], local[:, None])[1][:, 0].T

    return least_squares(residual, of.state, jacobian, method="lm", xtol=1e-15, ftol=1e-15, gtol=1e-15).x


def one_by_one(fit: Callable[[Placed, np.ndarray], np.ndarray], draws: int) -> float:
    """Seconds a part, and the largest difference from the fits of all at once is printed."""
    rng, spent, off = np.random.default_rng(7), 0.0, 0.0
    for name, of in REPEATED.items():
        if name == "edge":
            continue  # a line in space has no such residuals: its fit is a singular value decomposition
        errors = rng.normal(scale=SCATTER, size=(draws, *of.points.shape))
        local = of.placed.local(of.points + errors)
        begin = time.perf_counter()
        states = np.array([fit(of.placed, local[:, i]) for i in range(draws)])
        spent += time.perf_counter() - begin
        off = max(off, float(np.abs(of.placed.position(states) - of.least_squares(errors).position).max()))
    print(f"      positions differ by at most {off:.1e} mm")
    return spent / draws


def flatness_by_linear_programming(points: np.ndarray) -> float:
    """Width of the zone across z, by HiGHS."""
    A = np.column_stack([np.ones(len(points)), points[:, :2]])
    A = np.vstack([np.column_stack([-A, -np.ones(len(points))]), np.column_stack([A, -np.ones(len(points))])])
    found = linprog([0, 0, 0, 1], A, np.append(-points[:, 2], points[:, 2]), bounds=(None, None), method="highs")
    return float(2 * found.fun)


def zones() -> None:
    rng = np.random.default_rng(3)
    turn = np.arange(100) * 2 * np.pi / 100
    sets: dict[FeatureKind, np.ndarray] = {
        "plane": np.column_stack([rng.uniform(-50, 50, (100, 2)), np.zeros(100)]),
        "circle": 20 * np.column_stack([np.cos(turn), np.sin(turn)]),
        "sphere": 20 * cap_directions(2.0, 100),
        "cylinder": np.column_stack([20 * np.cos(7 * turn), 20 * np.sin(7 * turn), np.linspace(0, 60, 100)]),
    }
    print(f"minimum zones of 100 points, {MINIMUM_ZONES} draws, one core")
    for kind, points in sets.items():
        errors = rng.normal(scale=SCATTER, size=(MINIMUM_ZONES, *points.shape))
        of = Repeated(kind, points)
        begin = time.perf_counter()
        drawn = of.minimum_zone(errors)
        spent = time.perf_counter() - begin
        begin = time.perf_counter()
        single = np.array([associate(kind, points + errors[i], "minimum_zone").form for i in range(ALONE)])
        alone = (time.perf_counter() - begin) / ALONE
        off = np.abs(single - drawn.form[:ALONE]).max()
        print(f"  {kind:9s} {spent:6.2f} s   one by one {1e3 * alone:6.1f} ms each, forms differ by {off:.0e} mm")
        if kind == "plane":
            begin = time.perf_counter()
            by_lp = np.array([flatness_by_linear_programming(points + errors[i]) for i in range(ALONE)])
            alone = (time.perf_counter() - begin) / ALONE
            off = np.abs(by_lp - single).max()
            print(f"            linear programming {1e3 * alone:6.1f} ms each, differ by {off:.0e} mm")


def main() -> None:
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    found = np.empty((10, draws))
    begin, used = time.perf_counter(), time.process_time()

    def block(i: int) -> None:
        n = min(BLOCK, draws - i)
        found[:, i : i + n] = characteristics(i, n)

    with ThreadPoolExecutor(CORES) as pool:
        list(pool.map(block, range(0, draws, BLOCK)))
    spent = time.perf_counter() - begin
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{draws} draws of a part with 100 points, ten characteristics, {CORES} threads")
    print(f"  {spent:.1f} s, of it {time.process_time() - used:.1f} s of processor, at most {peak:.0f} MiB")
    print(f"  a part: {1e6 * spent / draws:.1f} µs")
    print("  one by one, without the line:")
    print(f"    NumPy loop {1e6 * one_by_one(numpy_loop, 200):8.0f} µs a part")
    print(f"    SciPy lm   {1e6 * one_by_one(scipy_fit, 200):8.0f} µs a part")
    zones()


if __name__ == "__main__":
    main()
