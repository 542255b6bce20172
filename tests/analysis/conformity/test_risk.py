"""Risks with a prior, against the standard library's normal distribution, drawn items, and closed forms."""

from __future__ import annotations

from statistics import NormalDist

import numpy as np
import pytest
from hypothesis import given, strategies as st

from cmm_uq.analysis.conformity.decision import PriorKnowledge, acceptance_limit, global_risks

PRIOR = PriorKnowledge(0.0, 5.0)


def test_prior_and_measurement_add_their_precisions() -> None:
    """Prior 0 ± 4, measured 10 ± 3: weight 16/25, 6.4 ± 2.4 (a 3-4-5 triangle)."""
    found = PriorKnowledge(0.0, 4.0).after(10.0, 3.0)
    assert (found.mean, found.sd) == pytest.approx((6.4, 2.4))


@pytest.mark.long
@given(st.floats(-20, 20), st.floats(0.01, 30), st.floats(0.1, 30))
def test_probabilities_within_and_beyond_are_those_of_the_standard_library(
    mean: float, sd: float, limit: float
) -> None:
    known, about = PriorKnowledge(mean, sd), NormalDist(mean, sd)
    inside = about.cdf(limit) - about.cdf(-limit)
    assert known.within(limit, signed=True) == pytest.approx(inside, abs=1e-12)
    assert known.beyond(limit, signed=True) == pytest.approx(1 - inside, abs=1e-12)
    if mean > -3 * sd:  # else what is above zero has no digits left in the reference
        above = 1 - about.cdf(0.0)
        assert known.within(limit, signed=False) == pytest.approx((about.cdf(limit) - about.cdf(0.0)) / above, abs=1e-9)


@pytest.mark.parametrize("signed", [True, False])
@pytest.mark.parametrize(("acceptance", "u", "mean"), [(8.0, 2.0, 0.0), (10.0, 1.0, 3.0), (4.0, 3.0, -1.0)])
def test_global_risks_are_those_of_drawn_items(acceptance: float, u: float, mean: float, signed: bool) -> None:
    """A million items of the prior, each measured once; 0.0005 is three standard deviations of a share of 2.8 %."""
    random = np.random.default_rng(0)
    items = random.normal(mean, 5.0, 3_000_000)
    items = (items if signed else items[items >= 0])[:1_000_000]
    readings = items + random.normal(0.0, u, len(items))
    accepted = (np.abs(readings) if signed else readings) <= acceptance
    conforming = np.abs(items) <= 10.0
    found = global_risks(acceptance, 10.0, u, PriorKnowledge(mean, 5.0), signed=signed)
    assert found.consumer == pytest.approx(float((accepted & ~conforming).mean()), abs=5e-4)
    assert found.producer == pytest.approx(float((~accepted & conforming).mean()), abs=1.5e-3)


def test_a_perfect_measurement_makes_no_mistakes() -> None:
    found = global_risks(10.0, 10.0, 1e-6, PRIOR, signed=True)
    assert (found.consumer, found.producer) == pytest.approx((0.0, 0.0), abs=1e-6)


@pytest.mark.parametrize("signed", [True, False])
def test_the_acceptance_limit_keeps_the_share_that_was_asked_for(signed: bool) -> None:
    found = acceptance_limit(0.002, 10.0, 2.0, PRIOR, signed=signed)
    assert found is not None
    assert 0 < found < 10.0
    assert global_risks(found, 10.0, 2.0, PRIOR, signed=signed).consumer == pytest.approx(0.002, abs=1e-8)


def test_the_acceptance_limit_is_never_beyond_the_limit_and_may_not_exist() -> None:
    assert acceptance_limit(0.5, 10.0, 2.0, PRIOR, signed=True) == 10.0
    assert acceptance_limit(0.01, 10.0, 40.0, PriorKnowledge(30.0, 5.0), signed=False) is None
