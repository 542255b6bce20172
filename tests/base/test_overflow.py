"""What leaves the range of numbers is refused in one line, and its warnings are not shown."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest
from scipy import linalg

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.overflow import must_be_finite, refusing_overflow


def overflowing() -> None:
    math.exp(1000.0)


def warned_and_overflowing() -> None:
    warnings.warn("overflow encountered", RuntimeWarning, stacklevel=1)
    overflowing()


def divided() -> None:
    _ = 1.0 / math.ldexp(0.0, 1)


def singular() -> None:
    np.linalg.inv(np.zeros((2, 2)))


def not_finite() -> None:
    linalg.svd(np.full((2, 2), np.inf))


@pytest.mark.parametrize("computation", [overflowing, divided, singular, not_finite])
def test_an_overflow_is_an_error_of_the_input(computation) -> None:
    says = r"bar\.csv: the figures leave the range of numbers.*Mend it"
    with pytest.raises(CmmUqError, match=says), refusing_overflow("bar.csv", "Mend it"):
        computation()


def test_warnings_are_dropped_with_a_refusal_and_kept_with_a_result() -> None:
    with warnings.catch_warnings(record=True) as shown:
        warnings.simplefilter("always")
        with pytest.raises(CmmUqError), refusing_overflow("a", "b"):
            warned_and_overflowing()
        assert not shown
        with refusing_overflow("a", "b"):
            warnings.warn("worth knowing", RuntimeWarning, stacklevel=1)
    assert [str(w.message) for w in shown] == ["worth knowing"]


def test_other_errors_pass() -> None:
    with pytest.raises(ValueError, match="of the program"), refusing_overflow("a", "b"):
        raise ValueError("of the program")


@pytest.mark.parametrize("figure", [math.nan, math.inf, -math.inf])
def test_a_figure_that_is_not_finite_is_no_result(figure: float) -> None:
    must_be_finite([1.0, 0.0], "a", "b")
    with pytest.raises(CmmUqError):
        must_be_finite([1.0, figure], "a", "b")
