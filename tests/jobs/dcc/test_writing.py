"""A certificate that is written is read as the same one; nothing is written that the schema, or the reader, would refuse."""

from __future__ import annotations

from decimal import Decimal
from typing import Any

import pytest
from hypothesis import given, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.dcc import certificate as dcc, read, written
from cmm_uq.jobs.dcc.certificate import Expanded, Interval, Real
from tests.jobs.dcc.certificates import LENGTH, certificate

NUMBERS = st.decimals(allow_nan=False, allow_infinity=False, min_value=-(10**12), max_value=10**12)
SIZES = st.decimals(allow_nan=False, allow_infinity=False, min_value=0, max_value=10**6).map(abs)
TEXTS = st.text(st.characters(codec="utf-8", exclude_categories=("Cc", "Cs"), exclude_characters="\ufffe\uffff"))


def test_a_certificate_is_read_as_it_was_written() -> None:
    made = certificate()
    assert read(written(made), "certificate.xml") == made


def test_the_digits_of_a_printed_number_stay() -> None:
    text = written(certificate()).decode()
    assert "<si:value>404.23570</si:value>" in text
    assert "<si:coverageFactor>2.00</si:coverageFactor>" in text


@given(NUMBERS, SIZES, NUMBERS, NUMBERS, TEXTS)
def test_any_quantity_is_read_as_it_was_written(
    value: Decimal, u: Decimal, low: Decimal, high: Decimal, label: str
) -> None:
    low, high = sorted((low, high))
    ways = (
        Expanded(uncertainty=u, factor=Decimal(2), probability=Decimal("0.95")),
        Interval(standard=u, low=low, high=high, probability=Decimal("0.95"), distribution="t"),
    )
    for uncertainty in ways:
        made = certificate(Real(label=label or None, value=value, unit=r"\metre", uncertainty=uncertainty))
        assert read(written(made), "certificate.xml") == made


TWO = (Decimal(1), Decimal(2))


def elements(*values: str) -> dcc.CovarianceColumn:
    return dcc.CovarianceColumn(
        covariances=tuple(dcc.CovarianceElement(value=Decimal(value), unit=r"\metre") for value in values)
    )


def region(*columns: dcc.CovarianceColumn) -> dcc.EllipsoidalRegion:
    return dcc.EllipsoidalRegion(columns=columns, factor=Decimal("2.45"), probability=Decimal("0.95"))


def lists(**given: Any) -> dcc.RealList:
    return dcc.RealList(**{"values": TWO, "units": (r"\metre",), **given})


EXPANDED = dcc.ExpandedList(uncertainties=TWO * 2, factors=(Decimal(2),), probabilities=(Decimal("0.95"),))


@pytest.mark.parametrize(("value", "told"), [
    (LENGTH.with_changes(value=Decimal("NaN")), "'NaN' is not a number"),
    (LENGTH.with_changes(value=Decimal("Infinity")), "'Infinity' is not a number"),
    (dcc.Real(value=TWO[0], unit="m", uncertainty=dcc.Expanded(uncertainty=TWO[0], factor=Decimal("0.7"), probability=TWO[0])),
     "'0.7' is not a coverage factor"),
    (dcc.Real(value=TWO[0], unit="m", uncertainty=dcc.Interval(standard=TWO[0], low=TWO[1], high=TWO[0], probability=TWO[0])),
     "the interval 2 to 1 is empty"),
    (lists(units=(r"\metre",) * 3), "2 values have 3 units"), (lists(labels=("a", "b", "c")), "2 values have 3 labels"),
    (lists(labels=("a b", "c")), "'a b c' is not a list of words"),
    (lists(uncertainty=EXPANDED), "2 values have 4 uncertainties"),
    (lists(region=region(elements("1"))), "2 values have a covariance matrix of 1"),
    (lists(region=region(elements("1", "0"), elements("1"))), "the covariance matrix is not square"),
    (lists(region=region(elements("1", "0"), elements("3", "1"))), "the covariance matrix is not symmetric"),
    (LENGTH.with_changes(label="a\x01"), r"'\x01' is a character that XML cannot hold"),
    ("words", "str is no value"),
])  # fmt: skip
def test_what_no_certificate_can_say_is_refused(value: Any, told: str) -> None:
    with pytest.raises(CmmUqError) as caught:
        written(certificate(value))
    assert told in str(caught.value)


def test_the_same_certificate_gives_the_same_bytes() -> None:
    assert written(certificate()) == written(certificate())


def test_a_part_is_frozen_and_takes_its_own_fields_only() -> None:
    with pytest.raises(AttributeError):
        LENGTH.unit = r"\metre"  # type: ignore[misc]
    with pytest.raises(TypeError, match=r"takes no .*'colour'"):
        LENGTH.with_changes(colour="red")
    with pytest.raises(TypeError, match=r"needs .*'unit'"):
        dcc.Real(value=Decimal(1))  # type: ignore[call-arg]
    assert {LENGTH, LENGTH.with_changes(label="L")} == {LENGTH}
