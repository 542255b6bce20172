"""A maximum permissible error as data sheets write it is the table that says the same, or is refused.

The uncertainty of a certificate as it is printed: a number or a formula of the length, or refused with the remedy.
"""

from __future__ import annotations

import math

import pytest
from hypothesis import given, strategies as st

from cmm_uq.jobs.tables.conformity import ConformityFacts
from cmm_uq.jobs.tables.length_formula import Growing, factor_of, growing_of, mpe_of


@pytest.mark.parametrize(
    ("text", "table"),
    [
        ("3 + L/300", {"a_um": 3.0, "k": 300.0}),
        ("3+L/300", {"a_um": 3.0, "k": 300.0}),
        ("± (3 + L/300) µm", {"a_um": 3.0, "k": 300.0}),
        ("2,5 + L/300", {"a_um": 2.5, "k": 300.0}),
        ("3 + 4·L/1000", {"a_um": 3.0, "k": 250.0}),
        ("3.0 + 4L/1000", {"a_um": 3.0, "k": 250.0}),
        ("L/250", {"a_um": 0.0, "k": 250.0}),
        ("min(3 + L/300; 8)", {"a_um": 3.0, "k": 300.0, "b_um": 8.0}),
        ("min(8, 3 + L/300)", {"a_um": 3.0, "k": 300.0, "b_um": 8.0}),
        ("min(2,5 + L/300; 8,5)", {"a_um": 2.5, "k": 300.0, "b_um": 8.5}),
        ("8 µm", {"b_um": 8.0}),
        ("2.5 + 0.004·L", {"a_um": 2.5, "k": 250.0}),
        ("2,5+0,004 L", {"a_um": 2.5, "k": 250.0}),
        ("min(2.5 + 0.004·L; 6)", {"a_um": 2.5, "k": 250.0, "b_um": 6.0}),
        ("0.005·L", {"a_um": 0.0, "k": 200.0}),
    ],
)
def test_a_formula_is_its_table(text: str, table: dict[str, float]) -> None:
    assert mpe_of(text) == table


@pytest.mark.parametrize(
    "text",
    ["3 per 300", "3 L", "L/0", "3 + L/1,000", "3 + L/1.000", "2,500 + L/300", "min(2,5 + L/300, 8)", "min(3; 8)",
     "-3 + L/300", "3 + L²/300", "", "3 + 4·L", "3 + 0.04·L", "3 + 0·L", "3 + L"],
)  # fmt: skip
def test_what_is_no_formula_or_may_mean_two_things_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"L in mm and the error in µm|L/1000"):
        mpe_of(text)


@given(a=st.integers(0, 99), tenths=st.integers(0, 9), k=st.integers(1, 999), length=st.floats(1.0, 5000.0))
def test_point_and_comma_give_the_limit_of_the_formula(a: int, tenths: int, k: int, length: float) -> None:
    """E(L) = A + L/K computed beside it."""
    for decimal in ".,":
        found = mpe_of(f"{a}{decimal}{tenths} + L/{k}")
        assert found["a_um"] + length / found["k"] == pytest.approx(a + tenths / 10 + length / k)


def test_a_statement_takes_the_formula_and_the_rule_as_the_certificate_prints_it() -> None:
    wish = ConformityFacts.model_validate(
        {"standard": "ISO 10360-2:2009", "mpe": "3 + L/300", "rule": "ISO 14253-1:2017"}, context=None
    )
    assert wish.mpe is not None
    assert (wish.mpe.a_um, wish.mpe.k, wish.mpe.b_um) == (3.0, 300.0, None)
    assert wish.rule == "ISO 14253-1:2017"


@pytest.mark.parametrize("standard", ["VDI/VDE 2617", "VDI/VDE 2617-2.1"])
def test_the_k_of_a_guideline_that_writes_k_times_l_is_not_taken_for_l_over_k(standard: str) -> None:
    """A = 3, K = 4 µm per m: at 200 mm 3.8 µm, and not 3 + 200/4 = 53 µm, within which an error of 50 µm would pass."""
    for k in (4.0, 0.004, 31.0):
        with pytest.raises(ValueError, match=r"µm in a metre; the K of A \+ K·L is meant otherwise.*·L/1000"):
            ConformityFacts.model_validate({"standard": standard, "mpe": {"a_um": 3.0, "k": k}})
    for meant in ({"a_um": 3.0, "k": 80.0}, "3 + 4·L/1000", "3 + 0.004·L", "3 + L/20"):
        assert ConformityFacts.model_validate({"standard": standard, "mpe": meant}).mpe is not None


@pytest.mark.parametrize("text", ["2.5 + L/0.3", "2.5 + 4·L/1", "min(2.5 + L/0.3; 60)"])
def test_a_formula_with_l_in_metres_is_none(text: str) -> None:
    """2.5 + L/0.3 of a data sheet that has L in m is 2.5 + L/300; taken in mm 20 mm had a limit of 69 µm."""
    with pytest.raises(ValueError, match=r"µm in a metre: L is in mm; L in m would be L/"):
        ConformityFacts.model_validate({"standard": "ISO 10360-2:2009", "mpe": text})
    assert ConformityFacts.model_validate({"standard": "ISO 10360-2:2009", "mpe": "2.5 + L/1"}).mpe is not None


def test_a_table_of_l_over_k_below_one_is_none() -> None:
    with pytest.raises(ValueError, match=r"2\.5e\+05 µm in a metre"):
        ConformityFacts.model_validate({"standard": "ISO 10360-2:2009", "mpe": {"a_um": 3.0, "k": 0.004}})


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
