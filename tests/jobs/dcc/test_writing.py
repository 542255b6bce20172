"""Nothing is written that the schema, or the reader, would refuse."""

from __future__ import annotations

from decimal import Decimal
from typing import Any

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.dcc import written
from cmm_uq.jobs.dcc.quantities import (
    CovarianceColumn,
    CovarianceElement,
    EllipsoidalRegion,
    Expanded,
    ExpandedList,
    Interval,
    Real,
    RealList,
)
from tests.jobs.dcc.certificates import LENGTH, certificate

TWO = (Decimal(1), Decimal(2))


def elements(*values: str) -> CovarianceColumn:
    return CovarianceColumn(
        covariances=tuple(CovarianceElement(value=Decimal(value), unit=r"\metre") for value in values)
    )


def region(*columns: CovarianceColumn) -> EllipsoidalRegion:
    return EllipsoidalRegion(columns=columns, factor=Decimal("2.45"), probability=Decimal("0.95"))


def lists(**given: Any) -> RealList:
    return RealList(**{"values": TWO, "units": (r"\metre",), **given})


EXPANDED = ExpandedList(uncertainties=TWO * 2, factors=(Decimal(2),), probabilities=(Decimal("0.95"),))


@pytest.mark.parametrize(("value", "told"), [
    (LENGTH.with_changes(value=Decimal("NaN")), "'NaN' is not a number"),
    (LENGTH.with_changes(value=Decimal("Infinity")), "'Infinity' is not a number"),
    (Real(value=Decimal(1), unit="m", uncertainty=Expanded(uncertainty=Decimal(1), factor=Decimal("0.7"), probability=TWO[0])),
     "'0.7' is not a coverage factor"),
    (Real(value=Decimal(1), unit="m", uncertainty=Interval(standard=TWO[0], low=TWO[1], high=TWO[0], probability=TWO[0])),
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
        Real(value=Decimal(1))  # type: ignore[call-arg]
    assert {LENGTH, LENGTH.with_changes(label="L")} == {LENGTH}
