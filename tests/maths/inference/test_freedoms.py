"""What each placing leaves free, kept by placing, against the same columns with all their zeros."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy import linalg, sparse

from cmm_uq.base.points import Floats
from cmm_uq.maths.inference.least_squares import solve
from cmm_uq.maths.inference.linear_model import Freedoms, LinearModel, Unknown
from cmm_uq.maths.inference.marginal import Marginal
from cmm_uq.maths.inference.noise import AXES, PLACING, Components

OWN = 3
"""Freedoms of a placing."""


@st.composite
def placings(draw: st.DrawFn) -> Freedoms:
    """Up to six placings of up to seven observations in any order, some with fewer observations than freedoms, or none."""
    index = np.array(draw(st.lists(st.integers(0, 5), min_size=1, max_size=40)))
    random = np.random.default_rng(draw(st.integers(0, 10_000)))
    columns = random.standard_normal((len(index), OWN))
    if draw(st.booleans()):
        columns[:, 2] = columns[:, 0] - 2 * columns[:, 1]
    return Freedoms(columns, index, 6)


def complement(columns: Floats) -> Floats:
    """(m, m) the projection onto what columns do not reach, by singular values."""
    basis = linalg.orth(columns, rcond=1e-9)
    return np.asarray(np.eye(len(columns)) - basis @ basis.T)


@given(placings())
def test_what_they_leave_of_columns_is_what_the_whole_matrix_leaves(freedoms: Freedoms) -> None:
    columns = np.random.default_rng(1).standard_normal((len(freedoms.index), 4))
    np.testing.assert_allclose(freedoms.without(columns), complement(freedoms.dense()) @ columns, atol=1e-12)


@given(placings(), st.booleans())
def test_observations_mixed_have_the_columns_of_the_whole_matrix_mixed(freedoms: Freedoms, within: bool) -> None:
    """Among those of one placing, which keeps its columns to itself, or of several."""
    m = len(freedoms.index)
    turn = np.random.default_rng(2).standard_normal((m, m))
    turn = np.where(freedoms.index[:, None] == freedoms.index, turn, 0.0 if within else turn)
    found = freedoms.turned(sparse.csr_array(turn))
    np.testing.assert_allclose(found.dense(), turn @ freedoms.dense(), atol=1e-12)
    assert found.blocks == (6 if within or np.all(freedoms.index == freedoms.index[0]) else 1)


@given(placings())
def test_their_rank_is_that_of_the_whole_matrix(freedoms: Freedoms) -> None:
    assert freedoms.rank == np.linalg.matrix_rank(freedoms.dense(), tol=1e-9)


@given(placings())
def test_those_of_some_observations_are_rows_of_the_whole_matrix(freedoms: Freedoms) -> None:
    some = np.arange(len(freedoms.index)) % 2 == 0
    assert np.array_equal(freedoms.at(some).dense(), freedoms.dense()[some])


def test_columns_without_placings_are_one_block_and_none_are_none() -> None:
    columns = np.arange(12.0).reshape(4, 3)
    assert np.array_equal(Freedoms.of(columns).dense(), columns)
    assert Freedoms.of(np.zeros((4, 0))).count == 0
    assert np.array_equal(Freedoms.of(np.zeros((4, 0))).without(columns), columns)


def model(freedoms: Freedoms | Floats, m: int, seed: int) -> LinearModel:
    random = np.random.default_rng(seed)
    design = random.standard_normal((m, 2))
    unknowns = (Unknown(("a", "a"), "1", 0.0, 3.0, 3.0), Unknown(("b", "b"), "1", 1.0, 0.5, 0.1, known=True))
    return LinearModel(design @ [1.3, 0.8] + random.standard_normal(m), design, unknowns, freedoms, np.ones(m), None)


@settings(max_examples=25)
@given(placings(), st.integers(0, 100))
def test_the_density_of_the_noise_is_that_of_the_whole_matrix_in_its_covariance(freedoms: Freedoms, seed: int) -> None:
    """Differences of log N(Cᵀy; CᵀA·prior mean, Cᵀ(A·P·Aᵀ + Σ)C), C an orthonormal basis of what the placings leave."""
    m = len(freedoms.index)
    linear = model(freedoms, m, seed)
    C = linalg.null_space(freedoms.dense().T, rcond=1e-9)
    if C.shape[1] < 4:
        return
    random = np.random.default_rng(seed)
    parts = random.dirichlet(np.ones(3), m)
    noise = Components(
        sparse.eye_array(m, format="csr"), np.column_stack([parts, parts[:, 0], np.zeros(m), np.ones(m)]),
        np.zeros((m, 0)), np.zeros(0), (AXES, PLACING),
    )  # fmt: skip
    latent = 0.8 * random.standard_normal((5, noise.dimension))
    wanted = []
    for row in latent:
        sizes = noise.sizes(row[None])
        variances = (noise.variances(sizes)[0] @ noise.shares.T)[0]
        whole = C.T @ (np.diag(variances) + (linear.design * linear.prior_sd**2) @ linear.design.T) @ C
        left = C.T @ (linear.observed - linear.design @ linear.prior_mean)
        squares = left @ np.linalg.solve(whole, left)
        wanted.append(-0.5 * (squares + np.linalg.slogdet(whole)[1] + np.sum(row[1:] ** 2)))
    found = Marginal(linear, noise, solve(linear)).log_density(latent)
    np.testing.assert_allclose(np.diff(found), np.diff(wanted), atol=1e-6)


def test_least_squares_of_many_placings_holds_no_more_than_some_columns() -> None:
    """20 000 observations in 4000 placings: the columns with all their zeros are 1.9 GB, a square matrix 3.2 GB."""
    m = 20_000
    freedoms = Freedoms(np.random.default_rng(2).standard_normal((m, OWN)), np.arange(m) // 5, m // 5)
    linear = model(freedoms, m, 3)
    tracemalloc.start()
    found = solve(linear)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert found.degrees_of_freedom == m - OWN * m // 5 - 1  # one of the two parameters is certified
    assert peak < 60 * 8 * m


def test_what_is_free_is_told_apart_by_groups_as_far_as_that_goes() -> None:
    """Offsets along three axes and a turn about the third, mixed at random, in two placings, the second without the turn."""
    random, axis, place = np.random.default_rng(2), np.tile(np.arange(3), 8), np.repeat([0, 1], 12)
    x, y = np.repeat(random.standard_normal((2, 8)), 3, axis=1)
    offsets = np.eye(3)[axis]
    columns = np.column_stack([offsets, np.where(axis == 0, -y, np.where(axis == 1, x, 0.0))])
    columns[place == 1, 3] = 0.0
    freedoms = Freedoms(columns @ random.standard_normal((4, 4)), place, 2).reached
    apart = freedoms.apart(axis)
    assert apart.rank == freedoms.rank == 7
    for number, groups in ((0, [1, 1, 1, 2]), (1, [0, 1, 1, 1])):
        own = apart.columns[place == number]
        was = freedoms.columns[place == number]
        assert own @ own.T == pytest.approx(was @ was.T, abs=1e-12)
        assert own.T @ own == pytest.approx(np.diag(np.any(own, axis=0).astype(float)), abs=1e-12)
        seen = [len(np.unique(axis[place == number][np.abs(column) > 1e-12])) for column in own.T]
        assert sorted(seen) == groups
