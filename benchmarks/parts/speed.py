"""Speed and memory of virtual measurements: a plate of 100 points, ten least-squares characteristics, every kind of cause.

Beside a plain NumPy loop over least squares (singular values, Gauss–Newton by ``numpy.linalg.lstsq``, one draw at a time) and
the same with ``scipy.optimize.least_squares``, on as many draws as fit into a second; both are given the displaced points for
nothing.

Run: ``OPENBLAS_NUM_THREADS=1 python -m benchmarks.parts.speed``
"""

from __future__ import annotations

import resource
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from scipy.optimize import least_squares

from cmm_uq.analysis.machine.state import StatedNoise, unmodelled_errors
from cmm_uq.analysis.parts.causes.surroundings import Expansion, Surroundings
from cmm_uq.analysis.parts.plan import PartCharacteristic, PartFeature, Plan, Stylus
from cmm_uq.analysis.parts.virtual import MeasurementConditions, Virtual
from cmm_uq.base.points import Floats
from cmm_uq.maths.uncertainty.propagation import simulate, simulate_adaptively
from tests.parts_drawn import POSE, block, circle, machine, plane

NAMES = ["scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx"]


def circumstances() -> MeasurementConditions:
    draws = np.random.default_rng(1).standard_normal((10_000, 6)) * [3, 3, 3, 2, 2, 2]
    state = machine(
        NAMES, draws, unmodelled=unmodelled_errors(NAMES, {}), noise=StatedNoise(np.full(3, 1e-3), 5e-4, 5e-4)
    )
    part = Expansion(11.5e-6, 1e-6, 21.0, 0.3)
    return MeasurementConditions(state, (POSE,), Surroundings(part, u_gradient_k_per_m=np.full(3, 0.5)))


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


@contextmanager
def told(what: str) -> Iterator[None]:
    """Says how long it took: by the clock, and of all cores together."""
    clock, cpu = time.perf_counter(), time.process_time()
    yield
    print(f"{what}: {time.perf_counter() - clock:.1f} s, {time.process_time() - cpu:.1f} s of CPU", flush=True)


def memory() -> None:
    """The most that was used so far."""
    print(f"peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MiB", flush=True)


def by_numpy(plan: Plan, points: Floats) -> list[Floats]:
    """All features of the plate, one measurement: planes by singular values, bores by Gauss and Newton."""
    found = []
    for feature in plan.features:
        own = points[plan.rows[feature.name]]
        if feature.kind == "plane":
            found.append(np.linalg.svd(own - own.mean(axis=0), full_matrices=False)[2][2])
        else:
            found.append(_loop(own, _start(feature)))
    return found


def by_scipy(plan: Plan, points: Floats) -> list[Floats]:
    """The same by ``scipy.optimize.least_squares``, planes as z of the other two coordinates."""
    found = []
    for feature in plan.features:
        own = points[plan.rows[feature.name]]
        if feature.kind == "plane":
            up = int(np.argmax(np.abs(feature.normals[0])))
            flat = np.column_stack([np.delete(own, up, axis=1), np.ones(len(own))])
            found.append(least_squares(lambda x, a=flat, b=own[:, up]: a @ x - b, np.zeros(3)).x)
        else:
            found.append(least_squares(_cylinder, _start(feature), args=(own,), xtol=1e-12).x)
    return found


def _start(feature: PartFeature) -> Floats:
    x, y, _ = feature.nominal.point
    return np.array([x, y, 0.0, 0.0, 0.5 * (feature.nominal.diameter_mm or 0.0)])


def peers(plan: Plan) -> None:
    """All features of the plate, draw by draw; displaced points and characteristics are left to them for nothing."""
    random = np.random.default_rng(2)
    for name, fit, draws in (("NumPy loop", by_numpy, 300), ("scipy", by_scipy, 60)):
        moved = plan.points + 1e-3 * random.standard_normal((draws, *plan.points.shape))
        start = time.process_time()
        for each in moved:
            fit(plan, each)
        each_us = 1e6 * (time.process_time() - start) / draws
        print(f"{name}: {each_us:.0f} µs of CPU a virtual measurement, so 10⁶ in {each_us:.0f} s", flush=True)


def known(virtual: Virtual) -> None:
    """How well u is known: by two independent runs as long as the digits that are asked for need, and of 10⁶."""
    for digits in (1, 2):
        with told(f"as many as {digits} digits of u need (JCGM 101, 7.9)"):
            one = simulate_adaptively(virtual.source, digits=digits, seed=1, fewest_trials=100_000)
        other = simulate_adaptively(virtual.source, digits=digits, seed=2, fewest_trials=100_000)
        print(
            f"  {one.trials} virtual measurements, u of two runs differs by {100 * np.max(np.abs(one.u / other.u - 1)):.2f} %"
        )


def main() -> None:
    features, characteristics = block()
    plan = Plan(features, characteristics, styli(), times_s=3.0 * np.arange(100))
    virtual = Virtual(plan, circumstances())
    coefficients = sum(len(cause.factors) for cause in virtual.places[0].causes)
    print(f"{len(plan.points)} points, {len(characteristics)} characteristics, {coefficients} coefficients")
    print(f"first order is off by {100 * virtual.off.max():.2f} % of u")
    with told("10⁶ virtual measurements"):
        simulate(virtual.source, 1_000_000)
    memory()
    known(virtual)
    virtual.exact = True
    with told("10⁵ of them with every feature on its points"):
        simulate(virtual.source, 100_000)
    flat = Plan(
        (plane("A", [0, 0, 1], [0, 0, 0], [[200, 0, 0], [0, 100, 0]], (10, 10)), circle("c", [100, 50, 0], 20.0, 100)),
        (PartCharacteristic("flat", "flatness", ("A",), association="minimum_zone"),
         PartCharacteristic("round", "roundness", ("c",), association="minimum_zone")),
        styli(), times_s=3.0 * np.arange(200),
    )  # fmt: skip
    zones = Virtual(flat, circumstances())
    with told("10⁴ flatnesses and roundnesses of 100 points by minimum zone"):
        simulate(zones.source, 10_000)
    memory()
    peers(plan)


if __name__ == "__main__":
    main()
