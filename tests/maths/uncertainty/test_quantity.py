"""An estimate with its uncertainty, from draws whose moments and quantiles are known."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.maths.uncertainty.quantity import Quantity


@pytest.mark.parametrize(("value", "expanded"), [(2.0, 4.0), (5.0, 4.0), (3.5, 2.5)])
def test_the_expanded_uncertainty_covers_the_whole_interval(value: float, expanded: float) -> None:
    """From 1 to 6: the farther end counts, so that value ± U holds the interval."""
    found = Quantity(value, 1.25, (1.0, 6.0), "µm")
    assert found.expanded == expanded
    assert found.coverage_factor == pytest.approx(expanded / 1.25)
    assert Quantity(value, 0.5, (1.0, 6.0), "µm").coverage_factor == pytest.approx(expanded / 0.5)


def test_what_is_not_uncertain_has_no_coverage_factor() -> None:
    assert Quantity(2.0, 0.0, (2.0, 2.0), "µm").coverage_factor is None


def test_draws_give_mean_standard_deviation_and_symmetric_interval() -> None:
    """0, 1 … 1000: mean 500, variance n(n + 1)/12 with n = 1001, 2.5 % of the way is 25."""
    found = Quantity.of_draws(np.arange(1001.0)[::-1], "µm")
    assert (found.value, found.unit) == (500.0, "µm")
    assert found.u == pytest.approx(np.sqrt(1001 * 1002 / 12), rel=1e-12)
    assert found.interval95 == pytest.approx((25.0, 975.0))
    assert Quantity.of_draws(np.arange(1001.0), "µm", 0.0).value == 0.0


def test_a_factor_of_either_sign_keeps_the_interval_in_order() -> None:
    found = Quantity(2.0, 0.5, (1.0, 4.0), "mm").times(-3.0, "µm")
    assert found == Quantity(-6.0, 1.5, (-12.0, -3.0), "µm")
