"""Results as rounded text, from draws, and averaged over models."""

from __future__ import annotations

from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy import optimize, stats

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.units import unit
from cmm_uq.maths.uncertainty.quantity import Quantity, alike, averaged, figure, mixed, rounded, significant


@pytest.mark.parametrize(
    ("value", "u", "digits", "text"),
    [
        (10.05762, 0.02712, 2, ("10.058", "0.027")),  # the example of JCGM 100:2008 7.2.6: 10.058 Ω with 27 mΩ
        (
            100.021471,
            0.000349,
            2,
            ("100.02147", "0.00035"),
        ),  # the 100 g mass of JCGM 100:2008 7.2.2: 100.02147 g, 0.35 mg
        (100.021471, 0.00079, 2, ("100.02147", "0.00079")),  # its expanded uncertainty, 7.2.4
        (50.000838, 93e-6, 2, ("50.000838", "0.000093")),  # end gauge of annex H.1, mm
        (12345.6, 123.0, 2, ("12350", "120")),
        (-4.0049, 0.31, 2, ("−4.00", "0.31")),
        (-0.0004, 0.31, 2, ("0.00", "0.31")),  # no sign before nothing
        (7.0, 9.96, 2, ("7", "10")),  # the carry adds no digit
        (7.0, 0.996, 1, ("7", "1")),
        (2.5, 1.0, 1, ("3", "1")),  # ties away from zero
        (-2.5, 1.0, 1, ("−3", "1")),
        (1.0, 0.15, 1, ("1.0", "0.2")),
        (1.0, 0.14, 1, ("1.0", "0.2")),  # 0.1 would lose 29 %
        (1.0, 0.104, 1, ("1.0", "0.1")),  # 0.1 loses 4 %
    ],
)
def test_value_and_uncertainty_end_at_the_same_decimal_place(
    value: float, u: float, digits: int, text: tuple[str, str]
) -> None:
    assert rounded(value, u, digits) == text


def test_an_exact_value_stays_as_it_is() -> None:
    assert rounded(404.238, 0.0) == ("404.238", "0")
    assert rounded(-0.0, 0.0) == ("0", "0")


def test_of_a_value_with_infinite_uncertainty_little_is_shown() -> None:
    assert rounded(404.238, float("inf")) == ("400", "∞")
    assert rounded(447.0, float("inf")) == ("450", "∞")
    assert rounded(0.0, float("inf")) == ("0", "∞")


def test_unusual_magnitudes_share_a_power_of_ten() -> None:
    assert rounded(4.5e-17, 1.23e-18) == ("4.50×10⁻¹⁷", "0.12×10⁻¹⁷")
    assert rounded(-1.0, 2.5e20) == ("0.0×10²⁰", "2.5×10²⁰")
    assert rounded(0.0, 2.5e20) == ("0.0×10²⁰", "2.5×10²⁰")


def test_twelve_decimals_and_fifteen_digits_are_written_out() -> None:
    """One more of either, and the power of ten is split off."""
    assert rounded(1.5e-9, 1.2e-11) == ("0.000000001500", "0.000000000012")
    assert rounded(1.5e-9, 1.2e-12) == ("1.5000×10⁻⁹", "0.0012×10⁻⁹")
    assert rounded(123456789012345.0, 12.0) == ("123456789012300", "12")
    assert rounded(1.2e15, 1.3e14) == ("1.20×10¹⁵", "0.13×10¹⁵")


def test_a_loss_of_five_percent_is_still_rounded_down() -> None:
    """EA-4/02 M:2022 6.3: more than 5 % is too much; from 2.1053 to 2 it is 5.0 %, from 2.11 on 5.2 %."""
    assert significant(2.0 / 0.95 - 1e-4, 1) == "2"
    assert significant(2.0 / 0.95 + 1e-4, 1) == "3"


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (1.23449, "1.234"),
        (-0.5, "−0.5"),
        (2.0, "2"),
        (0.0, "0"),
        (0.001, "0.001"),
        (0.0012346, "0.001235"),
        (0.00099999, "0.001"),  # rounds to 0.001, and that is written out
        (0.00099994, "9.999×10⁻⁴"),
        (123456.0, "123500"),
        (999960.0, "1×10⁶"),
        (1234567.0, "1.235×10⁶"),
    ],
)
def test_a_number_without_uncertainty_has_four_digits(number: float, text: str) -> None:
    assert figure(number) == text


def test_as_many_digits_as_asked_for() -> None:
    assert (figure(1.23456, 2), figure(1234567.0, 2), rounded(1.23456, 0.0104, 1)) == (
        "1.2",
        "1.2×10⁶",
        ("1.23", "0.01"),
    )
    with pytest.raises(CmmUqError, match="0 significant digits"):
        rounded(1.0, 0.1, 0)
    with pytest.raises(CmmUqError, match="cannot be stated"):
        figure(float("nan"))


def test_binary_noise_does_not_decide_a_tie() -> None:
    assert significant(0.1 + 0.2, 1) == "0.3"
    assert significant(1.23e-18) == "1.2×10⁻¹⁸"
    assert significant(1.25 - 1e-15) == "1.3"


@pytest.mark.parametrize(("value", "u"), [(1.0, -0.1), (1.0, float("nan")), (float("nan"), 1.0), (float("inf"), 1.0)])
def test_what_cannot_be_stated_is_refused(value: float, u: float) -> None:
    with pytest.raises(CmmUqError, match="cannot be stated"):
        rounded(value, u)


@given(value=st.floats(-1e9, 1e9), u=st.floats(1e-9, 1e9), digits=st.integers(1, 2))
def test_rounding_moves_the_value_by_half_a_unit_and_never_lowers_u_by_more_than_five_percent(
    value: float, u: float, digits: int
) -> None:
    value_text, u_text = (Decimal(text.replace("−", "-")) for text in rounded(value, u, digits))
    unit = Decimal(1).scaleb(u_text.adjusted() - digits + 1)
    assert value_text % unit == 0
    assert abs(value_text - Decimal(value)) <= unit / 2 + abs(Decimal(value)) * Decimal("1e-12")
    assert u_text >= Decimal(u) * Decimal("0.95") * (1 - Decimal("1e-12"))
    assert u_text <= Decimal(u) * 2


@given(st.lists(st.floats(-1e6, 1e6).filter(lambda x: abs(x) > 1e-9 or x == 0), min_size=1, max_size=4))
def test_numbers_side_by_side_are_no_coarser_than_a_third_of_the_largest(values: list[float]) -> None:
    told = alike(*values)
    places = {len(one.partition(".")[2]) for one in told}
    assert len(places) == 1
    (place,) = places
    largest = max(map(abs, values))
    assert place >= 1
    assert largest == 0 or 10.0**-place <= largest / 3 * (1 + 1e-12)
    assert place == 1 or 10.0 ** (1 - place) > largest / 3 * (1 - 1e-12)
    assert all(abs(float(one) - value) <= 0.5000001 * 10.0**-place for one, value in zip(told, values, strict=True))


def test_numbers_side_by_side_that_are_large_enough_keep_the_decimals_that_are_asked_for() -> None:
    assert alike(78.61, 18.04) == ("78.6", "18.0")
    assert alike(1.5, -0.04) == ("1.5", "-0.0")
    assert alike(0.0474, 0.0208, decimals=2) == ("0.05", "0.02")
    assert alike(0.0) == ("0.0",)


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


K = float(stats.norm.ppf(0.975))


def normal(value: float, u: float) -> Quantity:
    return Quantity(value, u, (value - K * u, value + K * u), unit("ppm"))


def test_of_two_values_far_apart_it_holds_both() -> None:
    """The twins of a scale, −35.1 ± 1.3 and 0.3 ± 5.1, at 63 and 37 %: ends by scipy's root finder, moments by hand."""
    found = averaged([normal(-35.1, 1.3), normal(0.3, 5.1)], [0.63, 0.37])
    mean = 0.63 * -35.1 + 0.37 * 0.3
    variance = 0.63 * (1.3**2 + 35.1**2) + 0.37 * (5.1**2 + 0.3**2) - mean**2
    assert (found.value, found.u) == pytest.approx((mean, np.sqrt(variance)))
    for tail, end in zip((0.025, 0.975), found.interval95, strict=True):
        wanted = optimize.brentq(
            lambda x, p=tail: 0.63 * stats.norm.cdf(x, -35.1, 1.3) + 0.37 * stats.norm.cdf(x, 0.3, 5.1) - p, -60, 40
        )
        assert end == pytest.approx(wanted, abs=1e-6)


@settings(max_examples=30, deadline=None)
@given(
    st.floats(-50, 50), st.floats(0.01, 20), st.floats(0.01, 20), st.lists(st.floats(0.01, 1), min_size=1, max_size=5)
)
def test_where_all_models_agree_it_is_what_they_say(
    value: float, below: float, above: float, weights: list[float]
) -> None:
    one = Quantity(value, 0.5 * (below + above) / K, (value - below, value + above), unit("µm"))
    found = averaged([one] * len(weights), weights)
    assert (found.value, found.u) == pytest.approx((one.value, one.u), abs=1e-5)
    assert found.interval95 == pytest.approx(one.interval95, abs=1e-6)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(0.01, 1), min_size=1, max_size=5), st.integers(0, 2**31))
def test_every_draw_of_a_mixture_is_one_of_a_model_and_each_model_has_its_share(
    weights: list[float], seed: int
) -> None:
    """Row i is row i of one model, so that none comes twice; shares to less than one draw."""
    count = 200
    draws = [np.column_stack([np.full(count, model), np.arange(count)]) for model in range(len(weights))]
    found = mixed(draws, weights, np.random.default_rng(seed))
    assert np.array_equal(found[:, 1], np.arange(count))
    share = np.bincount(found[:, 0].astype(int), minlength=len(weights))
    assert np.all(np.abs(share - count * np.array(weights) / sum(weights)) < 1)
    assert np.array_equal(found, mixed(draws, weights, np.random.default_rng(seed)))


def test_where_models_disagree_on_two_quantities_the_mixture_has_them_vary_together() -> None:
    """Three models without any uncertainty of their own: Σ w (m − m̄)(m − m̄)ᵀ by hand, weights 1 : 2 : 5 of 800 draws."""
    means = np.array([[1.0, -2.0], [3.0, 4.0], [-5.0, 0.5]])
    found = mixed([np.tile(mean, (800, 1)) for mean in means], [1, 2, 5], np.random.default_rng(3))
    p = np.array([0.125, 0.25, 0.625])
    off = means - p @ means
    assert np.cov(found, rowvar=False, ddof=0) == pytest.approx((p[:, None] * off).T @ off)
    first = np.cov(found[:400], rowvar=False, ddof=0)  # in any order: the first half is like the whole
    assert first == pytest.approx((p[:, None] * off).T @ off, rel=0.25)


def test_what_nothing_makes_uncertain_stays_so() -> None:
    exact = Quantity(3.0, 0.0, (3.0, 3.0), unit("mm"))
    assert averaged([exact, exact], [1, 2]) == exact


SIDES = {"as long": (1.0, 1.0, False), "a tenth shorter": (1.0, 0.9, False), "more": (1.0, 0.8999, True),
         "below": (0.5, 1.0, True)}  # fmt: skip


@pytest.mark.parametrize(("above", "below", "skewed"), SIDES.values(), ids=SIDES)
def test_a_quantity_is_skewed_whose_sides_differ_by_more_than_a_tenth(
    above: float, below: float, *, skewed: bool
) -> None:
    """Of the longer: two digits of U are worth a tenth of it at most (10 to within 1)."""
    assert Quantity(5.0, 0.5, (5.0 - below, 5.0 + above), unit("µm")).skewed is skewed
    assert Quantity(-5.0, 0.5, (-5.0 - above, -5.0 + below), unit("µm")).skewed is skewed


def test_an_exponential_distribution_is_skewed_and_draws_of_a_normal_one_are_not() -> None:
    """By its quantiles about the mean one: 2.5 % at 0.0253, 97.5 % at 3.689. Of 10 000 normal draws they differ by 2 %."""
    exponential = Quantity(1.0, 1.0, (0.0253, 3.689), unit("µm"))
    assert exponential.skewed
    assert exponential.times(-2.0, unit("µm")).skewed
    random = np.random.default_rng(0)
    assert not any(Quantity.of_draws(random.standard_normal(10_000), unit("µm")).skewed for _ in range(200))


def test_what_is_not_uncertain_is_not_skewed() -> None:
    assert not Quantity(2.5, 0.0, (2.5, 2.5), unit("µm")).skewed
    assert not Quantity(2.5, 0.1, (2.2, 2.6), unit("µm")).at_least(1.0).skewed
