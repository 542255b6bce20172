"""The uncertainty of a certificate as it is printed: a number or a formula of the length, or refused with the remedy."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cmm_uq.jobs.tables.length_formula import Growing, factor_of, growing_of


@pytest.mark.parametrize(
    "text",
    [
        "0.2 + 0.5·L/1000", "0.2 + L/2000", "0,2 + 0,5*L/1000", "0,200 + 0,500 × L/1000", "0.2+0.5 L/1000",
        "(0.2 + L/2000) µm", "0.2 µm + 0.5·10⁻⁶·L",
        "0.2 µm + 0,5·10^-6·L", "0.2 + 0.5·10^(-6) L", "0.2 + 0.5e-6·L", "0.2 µm + 0.5 µm/m · L",
        "U(L) = 0.2 µm + 0.5·10⁻⁶·L", "U = 0.2 + 0.5 · L / 1000", "0.2 um + 0.5 × 10−6 × L",
    ],
)  # fmt: skip
def test_a_length_of_1020_mm_has_0_71_and_one_of_20_mm_0_21_micrometres(text: str) -> None:
    """0.2 + 0.5 · 1.02 and 0.2 + 0.5 · 0.02, by hand."""
    found = growing_of(text)
    assert isinstance(found, Growing)
    assert found.at(1020.0) == pytest.approx(0.71, rel=1e-12)
    assert found.at(20.0) == pytest.approx(0.21, rel=1e-12)


@pytest.mark.parametrize(
    "text",
    [
        "Q[0.2; 0.5·L/1000]",
        "Q[0,2; 0,5·L/1000]",
        "Q[0.2, 0.5L/1000] µm",
        "Q(0.2 µm; 0.5·10⁻⁶·L)",
        "U = Q[0.5·L/1000; 0.2]",
    ],
)
def test_q_is_the_root_of_the_sum_of_the_squares(text: str) -> None:
    found = growing_of(text)
    assert isinstance(found, Growing)
    assert found.at(400.0) == pytest.approx(math.sqrt(0.2**2 + 0.2**2), rel=1e-12)


def test_a_number_in_quotes_is_a_number() -> None:
    assert growing_of("0.2 µm") == 0.2
    assert growing_of("0,125") == 0.125


@pytest.mark.parametrize(
    ("text", "remedy"),
    [
        ("0.2 + 0.5·L", "0.5·L/1000"), ("0.2 + 0.0005·L", "in which unit"), ("0.2 + 0.5·10^-3·L", "in which unit"),
        ("0.2 + 0.5·L/1,000", "thousand"), ("0.2 + L/2.000", "thousand"), ("2,500 + L/2000", "thousand"),
        ("Q[0.2; 0.5]", "0.2 [+] 0.5·L/1000"), ("Q[0.2 + L/1000; L/1000]", "0.2 [+] 0.5·L/1000"),
        ("min(0.2 + L/1000; 2)", "0.2 [+] 0.5·L/1000"), ("about 0.2", "0.2 [+] 0.5·L/1000"), ("", "0.2 [+] 0.5·L/1000"),
        ("0", "0.2 [+] 0.5·L/1000"), ("-0.2 + L/1000", "0.2 [+] 0.5·L/1000"), ("Q[0,2, 0,5·L/1000]", "0.2 [+] 0.5·L/1000"),
    ],
)  # fmt: skip
def test_what_may_mean_two_things_is_refused_with_the_remedy(text: str, remedy: str) -> None:
    with pytest.raises(ValueError, match=remedy):
        growing_of(text)


@given(st.floats(0.01, 10), st.floats(0.01, 10), st.floats(1, 1e4), st.floats(1, 3))
def test_over_k_is_the_standard_uncertainty_of_every_length(a: float, b: float, length: float, k: float) -> None:
    for squares, whole in ((False, a + b * length / 1000), (True, math.hypot(a, b * length / 1000))):
        assert Growing(a, b / 1000, squares).over(k).at(length) == pytest.approx(whole / k, rel=1e-12)


def test_the_factor_of_degrees_of_freedom_is_students_for_95_percent() -> None:
    """JCGM 100:2008, table G.2: 2.23 for 10, 2.00 for 60 (3 figures); as stated where k is."""
    assert factor_of(None, 10) == pytest.approx(2.23, abs=0.005)
    assert factor_of(None, 60) == pytest.approx(2.00, abs=0.005)
    assert factor_of(2.0, 10) == 2.0
    assert factor_of(None, None) is None
