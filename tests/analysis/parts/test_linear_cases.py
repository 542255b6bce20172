"""Where errors act linearly, virtual measurements are what the law of propagation says (JCGM 102, clause 6), within 2 %.

What the law is given is written by hand: closed forms of least squares on regular points, of levers and of products.
"""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.machine.state import StatedNoise
from cmm_uq.analysis.parts.causes.surroundings import Expansion, Surroundings
from cmm_uq.analysis.parts.plan import PartCharacteristic, Plan, Stylus
from cmm_uq.analysis.parts.virtual import MeasurementConditions, Virtual
from cmm_uq.base.units import ARCSECOND
from cmm_uq.maths.uncertainty.distributions import normal
from cmm_uq.maths.uncertainty.measurement_model import MeasurementModel
from cmm_uq.maths.uncertainty.propagation import first_order, simulate
from tests.parts_drawn import POSE, circle, machine, plane, spot

SIGMA, TRIALS = 1e-3, 40_000
FEATURES = (
    spot("a", [0, 0, 0]),
    spot("b", [300, 0, 0]),
    spot("c", [200, 150, 0]),
    spot("d", [50, 50, 30]),
    circle("k", [100, 60, 0], 20.0),
    plane("top", [0, 0, 1], [0, 0, 0], [[200, 0, 0], [0, 100, 0]]),
    plane("side", [0, -1, 0], [0, 0, 0], [[200, 0, 0], [0, 0, -20]], (4, 3)),
)
ASKED = (
    PartCharacteristic("ab", "distance", ("a", "b")),
    PartCharacteristic("ac", "distance", ("a", "c")),
    PartCharacteristic("k", "size", ("k",)),
    PartCharacteristic("height", "distance", ("top", "d")),
    PartCharacteristic("corner", "angle", ("top", "side")),
)


def squares(values: list[float], times: int) -> float:
    """Sum of squares about the mean of levels that each stand so many times."""
    return times * float(np.sum((np.array(values) - np.mean(values)) ** 2))


def law() -> MeasurementModel:
    """Errors of the characteristics, mm and rad.

    A scale acts on lengths along x, a squareness on those along x by their y, the tip's size on the hole alone, expansion on
    all lengths. A circle of n points has a radius of σ/√n; a plane at a place has the leverage 1/n + Δ²/S, its slope 1/S.
    """
    height = SIGMA * np.sqrt(1 + 1 / 16 + 50**2 / squares([0, 200 / 3, 400 / 3, 200], 4))
    slopes = 1 / squares([0, 100 / 3, 200 / 3, 100], 4) + 1 / squares([0, -10, -20], 4)
    inputs = {
        "s": normal(0, 3e-6), "S": normal(0, 2 * ARCSECOND), "tip": normal(0, 0.8e-3), "cte": normal(11.5e-6, 1e-6),
        "t": normal(2.0, 0.3), **{name: normal(0, SIGMA) for name in ("ax", "ay", "bx", "cx", "cy")},
        "radius": normal(0, SIGMA / np.sqrt(8)), "above": normal(0, height), "slopes": normal(0, SIGMA * np.sqrt(slopes)),
    }  # fmt: skip

    def function(**x: float) -> dict[str, float]:
        grown = x["cte"] * x["t"]
        return {
            "ab": 300 * (grown - x["s"]) + x["bx"] - x["ax"],
            "ac": 250 * grown - 160 * x["s"] + 120 * x["S"] + 0.8 * (x["cx"] - x["ax"]) + 0.6 * (x["cy"] - x["ay"]),
            "k": 40 * grown - 20 * x["s"] - x["tip"] + 2 * x["radius"],
            "height": 30 * grown + x["above"],
            "corner": x["slopes"],
        }

    return MeasurementModel(function, inputs, tuple(one.name for one in ASKED))


def test_virtual_measurements_of_linear_cases_are_what_the_law_of_propagation_says() -> None:
    expected = first_order(law())
    draws = np.random.default_rng(4).standard_normal((20_000, 2)) * [3.0, 2.0]
    state = machine(["scale_x", "squareness_xy"], draws, noise=StatedNoise(np.full(3, SIGMA)))
    warm = Surroundings(Expansion(11.5e-6, 1e-6, 22.0, 0.3))
    plan = Plan(FEATURES, ASKED, (Stylus("stylus", u_diameter_um=0.8),))
    found = simulate(Virtual(plan, MeasurementConditions(state, (POSE,), warm)).source, TRIALS, seed=5)
    u, wanted = found.u, np.sqrt(np.diagonal(expected.covariance))
    np.testing.assert_allclose(u, wanted, rtol=0.02)
    correlation = found.covariance / np.outer(u, u)
    np.testing.assert_allclose(correlation, expected.covariance / np.outer(wanted, wanted), atol=0.02)
