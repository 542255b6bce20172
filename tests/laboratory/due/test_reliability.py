"""Method S2: the table of NCSLI RP-1, appendix D (NASA-HDBK-8739.19-5, table 5-1), suncal on it, and exact constructions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import norm

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.due.reliability import MODELS, ReliabilityData, grouped, reliability_regression

WEEKS = np.array([4.0, 7, 10, 13, 21, 28, 40, 48])
TESTED = np.array([4.0, 6, 14, 13, 22, 49, 18, 6])
PASSED = np.array([4.0, 5, 9, 8, 12, 20, 9, 2])
TRUNCATED = np.array([4.0, 4, 9, 8, 12, 20, 9, 1])
"""What suncal 1.7.1 makes of the printed ratios .83333·6 and .3333·6: whole numbers below them."""

SUNCAL = {
    "random walk": (0.0, 0.10348677), "mixed exponential": (0.07417804, 0.71712729), "log-normal": (0.04519554, 1.7248022),
    "Weibull": (0.02564223, 0.68152871), "exponential": (0.0295212,), "modified gamma": (0.15086427,),
    "mortality drift": (0.0295212, 0.0), "warranty": (0.04277583, 25.03199591),
}  # fmt: skip
"""Parameters that suncal 1.7.1 finds, per week; of the restricted walk and the drift the likelihood has no single maximum."""

POWERS = {
    "random walk": (0, 1), "mixed exponential": (1, 0), "log-normal": (1, 0), "Weibull": (1, 0), "exponential": (1,),
    "modified gamma": (1,), "mortality drift": (1, 2), "warranty": (1, -1),
}  # fmt: skip
"""Of the week in the unit of each parameter."""


def test_suncals_parameters_follow_from_the_counts_that_it_takes() -> None:
    found = {one.name: one for one in reliability_regression(ReliabilityData(WEEKS, TESTED, TRUNCATED), 0.75).models}
    for name, theirs in SUNCAL.items():
        ours = found[name].parameters * 48.0 ** -np.array(POWERS[name], dtype=float)
        assert ours == pytest.approx(theirs, rel=2e-4, abs=1e-6), name


def test_rp1s_example_gives_the_printed_seven_weeks() -> None:
    """Suncal prints 7 (rounded to whole weeks), of the random walk, as here."""
    found = reliability_regression(ReliabilityData(WEEKS, TESTED, TRUNCATED), 0.75)
    assert (found.best.name, round(found.interval)) == ("random walk", 7)


def test_the_counts_that_were_observed_give_eight() -> None:
    found = reliability_regression(ReliabilityData(WEEKS, TESTED, PASSED), 0.75)
    assert (found.best.name, found.interval) == ("random walk", pytest.approx(7.92, abs=0.005))
    assert found.low < found.interval < found.high


def test_the_random_walks_interval_by_hand() -> None:
    """With its first parameter at its bound 0: R = 2Φ(1/√(θt)) − 1, so t = 1/(θ·Φ⁻¹((1 + R)/2)²)."""
    best = reliability_regression(ReliabilityData(WEEKS, TESTED, PASSED), 0.75).best
    theta = best.parameters[1] / 48
    assert best.interval == pytest.approx(1 / (theta * norm.ppf(0.875) ** 2), rel=1e-6)


def test_the_exponentials_maximum_by_its_equation() -> None:
    """Σ (x − (n − x)·R/(1 − R))·t = 0 where the likelihood of R = exp(−λt) is largest."""
    found = {one.name: one for one in reliability_regression(ReliabilityData(WEEKS, TESTED, PASSED), 0.75).models}[
        "exponential"
    ]
    r = found.reliability(WEEKS)
    assert (WEEKS * (PASSED - (TESTED - PASSED) * r / (1 - r))).sum() == pytest.approx(0, abs=1e-3)
    assert found.interval == pytest.approx(-math.log(0.75) / (found.parameters[0] / 48))


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of its searches that do not converge
def test_suncal_fits_the_same_to_the_counts_as_they_are() -> None:
    suncal = pytest.importorskip("suncal.intervals")
    theirs = suncal.s2_binom_interval(suncal.S2Params(target=0.75, ti=WEEKS, ni=TESTED, ri=PASSED / TESTED + 1e-12))
    ours = {one.name: one for one in reliability_regression(ReliabilityData(WEEKS, TESTED, PASSED), 0.75).models}
    for name, them in (("Weibull", "Weibull"), ("log-normal", "Log Normal"), ("mixed exponential", "Mixed Exponential"),
                       ("exponential", "Exponential"), ("modified gamma", "Modified Gamma")):  # fmt: skip
        assert ours[name].rejection == pytest.approx(theirs.models[them].C / 100, abs=2e-4), name
        assert ours[name].interval == pytest.approx(theirs.models[them].interval, abs=0.51), name  # whole weeks


@pytest.mark.parametrize("name", sorted(MODELS))
def test_every_model_is_a_reliability_that_falls(name: str) -> None:
    model = MODELS[name]
    for start in model.starts:
        r = model.reliability(np.linspace(0.01, 3, 200), np.array(start))
        assert ((r >= 0) & (r <= 1)).all()
        assert r[0] > r[-1]


def test_groups_have_the_mean_of_their_intervals_and_all_calibrations() -> None:
    data = grouped([10, 12, 30, 31, 90], [True, False, True, True, True], groups=4)
    assert data.days == pytest.approx([11, 30.5, 90])
    assert (data.tested.tolist(), data.in_tolerance.tolist()) == ([2, 2, 1], [1, 2, 1])


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (ReliabilityData(WEEKS, TESTED, TESTED), "ever out of tolerance"),
        (ReliabilityData(WEEKS[:3], TESTED[:3], PASSED[:3]), "four lengths"),
        (ReliabilityData(WEEKS, np.ones(8), np.array([1.0, 1, 1, 1, 0, 1, 0, 0])), "four lengths"),
    ],
)
def test_what_bears_no_regression_is_refused(data: ReliabilityData, words: str) -> None:
    with pytest.raises(CmmUqError, match=words):
        reliability_regression(data, 0.9)
