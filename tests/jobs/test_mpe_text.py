"""A maximum permissible error as data sheets write it is the table that says the same, or is refused."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cmm_uq.jobs.tables.conformity import ConformityFacts
from cmm_uq.jobs.tables.length_formula import mpe_of


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


def test_a_table_of_l_over_k_below_one_is_none() -> None:
    with pytest.raises(ValueError, match=r"2\.5e\+05 µm in a metre"):
        ConformityFacts.model_validate({"standard": "ISO 10360-2:2009", "mpe": {"a_um": 3.0, "k": 0.004}})
