"""The contenders, each a function of a size that gives back figures by which they can be compared.

First order: u(length) at the first point, mm. Monte Carlo: u and the ends of a 95 % interval, mm. Whoever is slow
gets fewer points and says so; the time is then scaled.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import numpy as np
from length_model import INPUTS, NAMES, expression, model, points, statements

Result = tuple[float, list[float], str]
"""Seconds for the full size, figures, remark."""

POINTS, TRIALS = 10_000, 1_000_000


def _timed(work: Callable[[], list[float]], repeats: int = 3) -> tuple[float, list[float]]:
    best, figures = np.inf, [0.0]
    for _ in range(repeats):
        start = time.perf_counter()
        figures = work()
        best = min(best, time.perf_counter() - start)
    return best, figures


def ours_first_order() -> Result:
    from cmm_uq.maths.uncertainty.distributions import normal
    from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
    from cmm_uq.maths.uncertainty.propagation import first_order

    function, (x, u) = model({"sqrt": np.sqrt, "cos": np.cos}), points(POINTS)
    inputs = {name: normal(x[k], u[k]) for k, name in enumerate(NAMES)}
    return *_timed(lambda: [float(first_order(MeasurementModel(function, inputs)).u[0][0])], 5), ""


def numpy_first_order() -> Result:
    function, (x, u) = model({"sqrt": np.sqrt, "cos": np.cos}), points(POINTS)

    def work() -> list[float]:
        variance = np.zeros(POINTS)
        for k in range(len(x)):
            above, below = list(x), list(x)
            above[k], below[k] = x[k] + u[k], x[k] - u[k]
            variance += ((function(*above) - function(*below)) / 2) ** 2
        return [float(np.sqrt(variance)[0])]

    return *_timed(work, 5), "central differences, inexact: twenty evaluations"


def uncertainties_first_order() -> Result:
    from uncertainties import ufloat, umath

    function, (x, u) = model({"sqrt": umath.sqrt, "cos": umath.cos}), points(1000)

    def work() -> list[float]:
        return [function(*map(ufloat, point, u)).std_dev for point in zip(*x, strict=True)][:1]

    seconds, figures = _timed(work, 1)
    return seconds * POINTS / 1000, figures, "1000 points, scaled"


def gtc_first_order() -> Result:
    from GTC import cos, sqrt, ureal

    function, (x, u) = model({"sqrt": sqrt, "cos": cos}), points(1000)

    def work() -> list[float]:
        return [function(*map(ureal, point, u)).u for point in zip(*x, strict=True)][:1]

    seconds, figures = _timed(work, 1)
    return seconds * POINTS / 1000, figures, "1000 points, scaled"


def metrolopy_first_order() -> Result:
    from metrolopy import cos, gummy, sqrt

    function, (x, u) = model({"sqrt": sqrt, "cos": cos}), points(100)

    def work() -> list[float]:
        return [function(*map(gummy, point, u)).u for point in zip(*x, strict=True)][:1]

    seconds, figures = _timed(work, 1)
    return seconds * POINTS / 100, figures, "100 points, scaled"


def openturns_first_order() -> Result:
    import openturns as ot

    ot.Log.Show(ot.Log.NONE)

    function, (x, u) = ot.SymbolicFunction(NAMES, ["length"], statements()), points(1000)

    def work() -> list[float]:
        found = []
        for point in zip(*x, strict=True):
            slopes = np.asarray(function.gradient(point)).ravel()
            found.append(float(np.sqrt(np.sum((slopes * u) ** 2))))
        return found[:1]

    seconds, figures = _timed(work, 1)
    return seconds * POINTS / 1000, figures, "1000 points, scaled; falls back to finite differences"


def suncal_first_order() -> Result:
    from suncal import Model

    x, u = points(3)
    one = Model("f=" + expression())
    for name, spread in zip(NAMES, u, strict=True):
        one.var(name).measure(0.0).typeb(std=spread)

    def at(point: tuple[float, ...]) -> float:
        for name, value in zip(NAMES, point, strict=True):
            one.var(name).measure(float(value))
        return float(one.calculate_gum().uncertainty["f"])

    first, *others = zip(*x, strict=True)
    figure = at(first)  # the derivatives are found once
    seconds, _ = _timed(lambda: [at(point) for point in others], 1)
    return seconds * POINTS / len(others), [figure], "2 points after the first, scaled"


def ours_monte_carlo() -> Result:
    from cmm_uq.maths.uncertainty.distributions import normal
    from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
    from cmm_uq.maths.uncertainty.propagation import simulate

    function = model({"sqrt": np.sqrt, "cos": np.cos})
    length = MeasurementModel(function, {name: normal(mean, u) for name, (mean, u) in INPUTS.items()})

    def work() -> list[float]:
        found = simulate(length, TRIALS, seed=1)
        return [float(found.u[0]), *found.symmetric_interval[0].tolist()]

    return *_timed(work), "shortest interval too"


def numpy_monte_carlo() -> Result:
    function = model({"sqrt": np.sqrt, "cos": np.cos})

    def work() -> list[float]:
        rng = np.random.default_rng(1)
        y = function(*(mean + u * rng.standard_normal(TRIALS) for mean, u in INPUTS.values()))
        return [float(y.std(ddof=1)), *np.quantile(y, [0.025, 0.975]).tolist()]

    return *_timed(work), "one block, symmetric interval only"


def openturns_monte_carlo() -> Result:
    import openturns as ot

    ot.Log.Show(ot.Log.NONE)

    function = ot.SymbolicFunction(NAMES, ["length"], statements())
    inputs = ot.JointDistribution([ot.Normal(mean, u) for mean, u in INPUTS.values()])

    def work() -> list[float]:
        y = function(inputs.getSample(TRIALS))
        ends = [float(y.computeQuantile(p)[0]) for p in (0.025, 0.975)]
        return [float(y.computeStandardDeviation()[0]), *ends]

    return *_timed(work, 1), ""


def suncal_monte_carlo() -> Result:
    from suncal import Model

    one = Model("f=" + expression())
    for name, (mean, u) in INPUTS.items():
        one.var(name).measure(mean).typeb(std=u)

    def work() -> list[float]:
        found = one.monte_carlo(samples=TRIALS)
        low, high, _ = found.expand("f", conf=0.95)[:3] if hasattr(found, "expand") else (np.nan, np.nan, 0)
        return [float(found.uncertainty["f"]), float(low), float(high)]

    return *_timed(work, 1), ""


def ours_gauge_block() -> Result:
    from cmm_uq.maths.uncertainty.propagation import simulate_adaptively
    from cmm_uq.maths.uncertainty.reference.jcgm import gauge_block

    def work() -> list[float]:
        found = simulate_adaptively(gauge_block(), coverage=0.99, digits=2, seed=1)
        return [float(found.u[0]), *found.interval[0].tolist(), float(found.trials)]

    return *_timed(work), "u, shortest 99 % interval, trials"


CONTENDERS: Mapping[str, Mapping[str, Callable[[], Result]]] = {
    f"First order, ten inputs, {POINTS} points": {
        "NumPy": numpy_first_order,
        "cmm_uq": ours_first_order,
        "OpenTURNS": openturns_first_order,
        "GTC": gtc_first_order,
        "uncertainties": uncertainties_first_order,
        "metrolopy": metrolopy_first_order,
        "suncal": suncal_first_order,
    },
    f"Monte Carlo, ten inputs, {TRIALS} trials with interval": {
        "NumPy": numpy_monte_carlo,
        "cmm_uq": ours_monte_carlo,
        "OpenTURNS": openturns_monte_carlo,
        "suncal": suncal_monte_carlo,
    },
    "Adaptive Monte Carlo, two digits, gauge block of JCGM 101 9.5": {"cmm_uq": ours_gauge_block},
}
