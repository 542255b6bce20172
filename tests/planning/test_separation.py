"""What is left of effects once others are fitted: the same by projection of their columns."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cmm_uq.planning.separation import cosines, left_of, visible


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
