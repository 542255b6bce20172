"""A certificate that is written is read as the same certificate."""

from __future__ import annotations

from decimal import Decimal

from hypothesis import given, strategies as st

from cmm_uq.jobs.dcc import read, written
from cmm_uq.jobs.dcc.quantities import Expanded, Interval, Real
from tests.jobs.dcc.certificates import certificate

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
