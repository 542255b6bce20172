"""What is kept of members that are given, against what their rows give directly."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from cmm_uq.analysis.diagnosis.comparison.conditional import ConditionedData, Conditioning, Version
from cmm_uq.base.points import Floats

KINDS, ROWS = 3, 210
WIDTHS = (1, 2, 34, 31)


def _members() -> tuple[Conditioning, Floats, Floats]:
    """Members of these widths, the recording (m, 1), and precisions (k, m, m)."""
    random = np.random.default_rng(4)
    root = random.standard_normal((KINDS, ROWS, ROWS))
    precision = root @ root.swapaxes(1, 2) / ROWS + np.eye(ROWS)
    ends = np.cumsum([0, *WIDTHS]).tolist()
    where = {(i, 0): slice(*ends) for i, ends in enumerate(pairwise(ends))}
    stack = random.standard_normal((ROWS, ends[-1]))
    return Conditioning(stack, where, lambda columns: precision @ columns), random.standard_normal((ROWS, 1)), precision


def _beside(given: Conditioning, left: Floats, precision: Floats, versions: list[Version]) -> ConditionedData:
    return given.beside(versions, left, precision @ left, np.zeros(KINDS), own=True)


@pytest.mark.parametrize("which", [(0,), (1, 0), (2,), (0, 2, 1), (3, 2), (1, 3)])
def test_rows_of_what_is_given_turn_the_noise_into_that_with_it(which: tuple[int, ...]) -> None:
    """Against the inverse, and the determinant, of the whole covariance."""
    given, left, precision = _members()
    versions = [Version(i, 0, 0.3 + i) for i in which]
    known = _beside(given, left, precision, versions)
    seen = known.seen_by.reshape(ROWS, KINDS, -1).transpose(1, 0, 2)
    for k in range(KINDS):
        whole = np.linalg.inv(precision[k])
        before = np.linalg.slogdet(whole)[1]
        for version in versions:
            columns = version.amplitude * given.columns(version)
            whole = whole + columns @ columns.T
        inverse = np.linalg.inv(whole)
        np.testing.assert_allclose(seen[k][:, :1], inverse @ left, rtol=1e-7, atol=1e-8)
        np.testing.assert_allclose(seen[k][:, 1:] @ seen[k][:, 1:].T, precision[k] - inverse, rtol=1e-7, atol=1e-8)
        np.testing.assert_allclose(known.squares[k], left[:, 0] @ inverse @ left, rtol=1e-8)
        np.testing.assert_allclose(known.log[k], -0.5 * (np.linalg.slogdet(whole)[1] - before), rtol=1e-9)


@pytest.mark.parametrize("which", [(0,), (1, 0), (2,), (0, 2, 1), (3, 2), (1, 3)])
def test_inner_products_follow_from_those_that_are_kept_of_each_member(which: tuple[int, ...]) -> None:
    given, left, precision = _members()
    known = _beside(given, left, precision, [Version(i, 0, 0.3 + i) for i in which])
    assert not given.kept(known)
    found = np.zeros((KINDS, sum(WIDTHS), known.seen_by.shape[1] // KINDS))
    found[:, :, :1] = given.with_all(precision @ left)
    for basis, factor in known.made_of or ():
        found += given.products(basis) @ factor
    assert given.kept(known)
    direct = (given.stack.T @ known.seen_by).reshape(sum(WIDTHS), KINDS, -1).transpose(1, 0, 2)
    np.testing.assert_allclose(found, direct, rtol=1e-8, atol=1e-9)
