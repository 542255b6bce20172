"""Bumps that an oracle searches have the dent of the study among them, as nearly as its grid goes."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.second.bumps import bumps, p_values
from benchmarks.second.cases import case, outside


def test_the_nearest_bump_has_the_form_of_a_dent() -> None:
    """Two normal densities of the same width, centres within half a width along each axis: cos ≥ exp(−3/16) = 0.83."""
    placed = case(21, "outside", 0).placed
    dent = -placed.D @ outside(placed)["dent at one place"](placed.true, {}).ravel()
    columns = bumps(placed).columns[:, :, 0]
    cosine = np.abs(columns.T @ dent) / np.linalg.norm(columns, axis=0) / np.linalg.norm(dent)
    assert cosine.max() > np.exp(-3 / 16)


@pytest.mark.long
def test_what_is_told_less_sees_no_more() -> None:
    """A dent of √λ = 9.2 in twenty bars whose Z reads worse: told its form it is seen, told the family it is not."""
    told, family = p_values(case(20261122, "outside", 57), 57)
    assert told <= 0.01 < family
