"""Quick sums, tables and eigenvalues are those of numpy and scipy.

The precision of what the baseline leaves, against the inverse of its dense covariance.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special

from cmm_uq.analysis.diagnosis.comparison.algebra import (
    eigen,
    interpolated,
    log_sum,
    log_sum_of_powers,
    precisions,
    squared,
    woodbury,
)
from tests.analysis.diagnosis.dense_noise import covariance, some_kinds


def test_a_table_with_equal_steps_is_read_as_numpy_reads_any() -> None:
    nodes = np.linspace(-3.0, 5.0, 41)
    values = np.sin(nodes) - 20 * nodes
    at = np.concatenate([np.random.default_rng(3).uniform(-4, 6, 500), nodes, [-np.inf, np.inf]])
    np.testing.assert_allclose(interpolated(at.copy(), nodes, values), np.interp(at, nodes, values), rtol=1e-12)


def test_two_columns_have_the_principal_axes_of_any_others() -> None:
    """Against LAPACK, of matrices of all conditions: equal, dependent and absent columns too."""
    columns = np.random.default_rng(9).standard_normal((200, 6, 2)) * [1.0, 1e-5]
    blocks = np.concatenate([columns.swapaxes(1, 2) @ columns, np.diag([1.0, 2.0])[None], np.diag([2.0, 1.0])[None],
                             np.ones((1, 2, 2)), 2 * np.eye(2)[None] - 1, np.eye(2)[None], np.zeros((1, 2, 2))])  # fmt: skip
    strengths, axes = eigen(blocks)
    largest = np.abs(blocks).max(axis=(1, 2))
    expected = np.linalg.eigvalsh(blocks)
    assert np.all(np.abs(np.sort(strengths, axis=1) - expected).max(axis=1) <= 1e-15 * 4 * largest)
    np.testing.assert_allclose(axes.swapaxes(1, 2) @ axes, np.broadcast_to(np.eye(2), blocks.shape), atol=1e-14)
    back = axes @ (strengths[:, :, None] * axes.swapaxes(1, 2))
    assert np.all(np.abs(back - blocks).max(axis=(1, 2)) <= 1e-14 * largest)


@pytest.mark.parametrize(("shape", "axis"), [((650, 7, 1), 1), ((133, 7, 20), 1), ((8, 20), 0), ((1, 1), 0)])
def test_sums_of_logarithms_are_scipys_to_the_last_bit(shape: tuple[int, ...], axis: int) -> None:
    random = np.random.default_rng(1)
    log = random.normal(-50, 20, shape)
    for values in (log, np.round(log), np.zeros(shape)):  # the largest once, now and then several times, always
        np.testing.assert_array_equal(log_sum(values, axis), special.logsumexp(values, axis=axis))


@pytest.mark.parametrize("degrees", [1, 2, 3, 18, 19, 310, 4985])
@pytest.mark.parametrize("axis", [0, (0, 2)])
def test_powers_by_multiplications_have_the_sum_that_logarithms_give(degrees: int, axis: int | tuple[int, ...]) -> None:
    """Against scipy; of bases over sixty orders of magnitude, and of one that rounding took below nought."""
    bases = np.exp(np.random.default_rng(4).normal(0, 40 / np.sqrt(degrees), (4, 5, 7, 3)))
    expected = special.logsumexp(-0.5 * degrees * np.log(bases), axis=axis)
    np.testing.assert_allclose(log_sum_of_powers(bases.copy(), degrees, axis), expected, rtol=1e-12, atol=1e-11)
    bases[1, 2, 3, 0] = -1e-17
    assert np.isfinite(log_sum_of_powers(bases, degrees, axis)).all()


def test_columns_beside_others_explain_what_the_whole_covariance_says() -> None:
    """Woodbury's identity against inverse and determinant."""
    random = np.random.default_rng(5)
    columns, given, data = random.standard_normal((40, 9)), random.standard_normal((40, 2)), random.standard_normal(40)
    rows = np.linalg.solve(np.linalg.cholesky(np.eye(2) + given.T @ given), given.T)
    amplitudes = np.array([0.1, 1.0, 20.0])
    strengths, turn = np.linalg.eigh(columns.T @ columns)
    inverse = np.eye(40) - rows.T @ rows
    seen = turn.T @ columns.T @ np.column_stack([inverse @ data, rows.T])
    square = amplitudes[:, None] ** 2
    found = woodbury(square / (1 + square * strengths), seen)
    assert found is not None
    for i, a in enumerate(amplitudes):
        whole = np.linalg.inv(inverse) + a**2 * columns @ columns.T
        explained = data @ inverse @ data - data @ np.linalg.solve(whole, data)
        log = 0.5 * (np.linalg.slogdet(whole)[1] - np.linalg.slogdet(np.linalg.inv(inverse))[1])
        np.testing.assert_allclose(found[0][i], explained, rtol=1e-9)
        np.testing.assert_allclose(found[1][i] + 0.5 * np.log1p(a**2 * strengths).sum(), log, rtol=1e-9)


def test_what_is_given_and_takes_the_columns_themselves_leaves_no_digits() -> None:
    columns = np.random.default_rng(6).standard_normal((40, 9))
    rows = np.linalg.solve(np.linalg.cholesky(np.eye(9) + 1e10 * columns.T @ columns), 1e5 * columns.T)
    strengths, turn = np.linalg.eigh(columns.T @ columns)
    seen = turn.T @ columns.T @ np.column_stack([np.ones(40), rows.T])
    assert woodbury(1e10 / (1 + 1e10 * strengths)[None], seen) is None


@pytest.mark.parametrize("r", [1, 2, 5])
def test_rows_have_their_own_inner_products(r: int) -> None:
    rows = np.random.default_rng(7).standard_normal((4, 30, r, 3))
    np.testing.assert_allclose(squared(rows), np.einsum("kmig,kmjg->kmij", rows, rows), rtol=1e-12, atol=1e-14)


ROWS = 14


def test_the_precision_is_the_inverse_of_the_covariance_of_what_is_left() -> None:
    random = np.random.default_rng(2)
    reached = np.linalg.qr(random.standard_normal((ROWS, 3)))[0]
    certified = random.standard_normal((ROWS, 2))
    free = np.linalg.qr(np.hstack([reached, random.standard_normal((ROWS, ROWS - 3))]))[0][:, 3:]
    columns = random.standard_normal((ROWS, 4))
    found = []
    for kind, precision in zip(
        some_kinds(np.full(ROWS, 1.4)), precisions(some_kinds(np.full(ROWS, 1.4)), reached, certified), strict=True
    ):
        inside = free.T @ (covariance(kind) + certified @ certified.T) @ free
        np.testing.assert_allclose(
            precision(columns), free @ np.linalg.solve(inside, free.T @ columns), rtol=1e-8, atol=1e-9
        )
        found.append(precision.log + 0.5 * np.linalg.slogdet(inside)[1] - np.log(kind.probability) - kind.log_factor)
    np.testing.assert_allclose(found, 0.0, atol=1e-9)
