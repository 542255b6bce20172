"""What is left of effects once others are fitted: the same by projection of their columns."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cmm_uq.analysis.planning.information import cosines, imitators, left_of, visible


@given(seed=st.integers(0, 10_000), base=st.integers(0, 4))
def test_the_schur_complement_is_the_projection_of_the_columns(seed: int, base: int) -> None:
    random = np.random.default_rng(seed)
    columns = random.normal(size=(20, base + 3)) * random.uniform(1, 100, base + 3)
    Q, _ = np.linalg.qr(columns[:, :base])
    rest = columns[:, base:] - Q @ (Q.T @ columns[:, base:])
    found = left_of(columns.T @ columns, range(base, base + 3), range(base))
    np.testing.assert_allclose(found, rest.T @ rest, rtol=1e-7, atol=1e-7 * np.abs(rest.T @ rest).max())
    unit = rest / np.linalg.norm(rest, axis=0)
    wanted = np.abs(unit.T @ unit)
    np.fill_diagonal(wanted, 1.0)
    np.testing.assert_allclose(cosines(found, np.einsum("ij,ij->j", columns, columns)[base:]), wanted, atol=1e-7)


def test_a_base_without_full_rank_takes_what_it_reaches_and_no_more() -> None:
    """Two equal columns in the base take their direction once."""
    columns = np.array([[1.0, 1.0, 1.0], [0.0, 0.0, 2.0], [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(left_of(columns.T @ columns, [2], [0, 1]), [[4.0]], rtol=1e-9)


def test_an_effect_that_the_base_imitates_is_not_seen_and_apart_from_nothing() -> None:
    columns = 100 * np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 1.0]])
    left = left_of(columns.T @ columns, [1, 2], [0])
    alone = np.einsum("ij,ij->j", columns, columns)[1:]
    assert visible(left, alone).tolist() == [False, True]
    assert cosines(left, alone)[0, 1] == 1.0


@pytest.mark.parametrize(
    ("left", "alone", "seen"),
    [
        (1.001, 2.0, True),  # an effect of its prior standard deviation has to be larger than its noise
        (1.0, 2.0, False),
        (0.999, 2.0, False),
        (1001.0, 1e9, True),  # and a millionth of what it is alone has to be left
        (1000.0, 1e9, False),
        (999.0, 1e9, False),
    ],
)
def test_an_effect_is_seen_above_the_noise_and_above_rounding(left: float, alone: float, seen: bool) -> None:
    assert visible(np.array([[left]]), np.array([alone])).tolist() == [seen]
    other = np.array([[left, left], [left, 4 * left]])
    assert cosines(other, np.array([alone, 1.0]))[0, 1] == pytest.approx(0.5 if seen else 1.0)


def test_cosines_of_several_informations_at_once() -> None:
    """4, 9 and −3: a half; parallel columns of rounding beyond one are parallel."""
    left = np.array([[[4.0, -3.0], [-3.0, 9.0]], [[4.0, 6.0 * (1 + 1e-12)], [6.0 * (1 + 1e-12), 9.0]]])
    found = cosines(left, np.array([[4.0, 9.0], [4.0, 9.0]]))
    np.testing.assert_allclose(found[:, 0, 1], [0.5, 1.0], rtol=1e-15)
    assert found[:, [0, 1], [0, 1]].tolist() == [[1.0, 1.0], [1.0, 1.0]]


def test_what_an_effect_looks_like_are_the_columns_of_more_than_a_tenth_of_it() -> None:
    """Orthogonal columns of different lengths, in parts 0.1003, 0.0997, −0.3 and what is left for a length of one."""
    parts = np.array([0.1003, 0.0997, -0.3, 0.0])
    parts[3] = np.sqrt(1 - parts @ parts)
    lengths = np.array([5.0, 1.0, 100.0, 0.01])
    columns = np.column_stack([np.diag(lengths), 7.0 * parts])
    information = columns.T @ columns
    assert imitators(information, 4, [0, 1, 2, 3]) == [0, 2, 3]
    assert imitators(information, 4, [3, 1]) == [3]
