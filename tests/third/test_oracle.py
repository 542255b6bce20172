"""The oracle of the third study against dense computations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import special, stats

from benchmarks.second.cases import baseline
from benchmarks.third.cases import CYCLE, Hidden, case
from benchmarks.third.oracle import VISIBLE, families, held_out, log_evidence, odds, of_family, places, told, unformed


def outside(seed: int, start: int = 0) -> Hidden:
    return case(seed, next(i for i in range(start, start + 20) if CYCLE[i % len(CYCLE)] == "dictionary"))


def test_the_evidence_of_columns_is_a_ratio_of_normal_densities() -> None:
    random = np.random.default_rng(1)
    A, y = random.standard_normal((12, 3)), 3 * random.standard_normal(12)
    A /= np.linalg.norm(A)
    nothing = stats.multivariate_normal(np.zeros(12), np.eye(12)).logpdf(y)
    each = [stats.multivariate_normal(np.zeros(12), np.eye(12) + s**2 * A @ A.T).logpdf(y) - nothing for s in VISIBLE]
    assert log_evidence(7.0 * A, y) == pytest.approx(special.logsumexp(each) - np.log(len(VISIBLE)))
    assert log_evidence(np.zeros((12, 2)), y) == -np.inf


def test_the_evidence_of_a_form_is_the_mean_of_its_members() -> None:
    random = np.random.default_rng(2)
    columns, y = random.standard_normal((15, 6, 1)), random.standard_normal(15)
    each = [log_evidence(columns[:, i], y) for i in range(6)]
    assert of_family(columns, y) == pytest.approx(special.logsumexp(each) - np.log(6))
    hidden = np.concatenate([columns, np.zeros((15, 1, 1))], axis=1)
    assert of_family(hidden, y) == pytest.approx(of_family(columns, y))


@pytest.mark.long
def test_without_noise_and_large_enough_the_true_form_has_the_best_odds_of_the_dictionary() -> None:
    """A member of a form of the grid, at √λ of 60, against all others; of one that is another's, as far as it is."""
    found = outside(11)
    assert found.outside is not None
    for form, columns in families(found, found.outside):
        sizes = np.linalg.norm(columns, axis=(0, 2))
        member = columns[:, int(sizes.argmax()), 0]
        y = 60 * member / np.linalg.norm(member)
        said = odds(found, y)
        same = {name for name, other in families(found, found.outside) if _leaves(other, y) < 1e-6 * 60} | {form}
        assert max(said, key=said.__getitem__) in same


def _leaves(columns: np.ndarray, y: np.ndarray) -> float:
    rest = [y - c @ np.linalg.lstsq(c, y, rcond=None)[0] for c in np.moveaxis(columns, 1, 0)]
    return min(float(np.linalg.norm(each)) for each in rest)


def test_a_fit_with_the_true_form_predicts_exactly_what_has_no_noise() -> None:
    found = outside(12)
    (name,) = found.errors
    column = found.seen.column(found.errors[name])
    B = baseline(found.seen)
    y = column * 5.0 + (B @ np.ones(B.shape[1]) if B.shape[1] else 0.0)
    before, after = held_out(replace(found, one=replace(found.one, y=y)), column)
    assert after < 1e-6 * before


@pytest.mark.long
def test_noise_alone_is_as_often_surprising_as_is_said() -> None:
    """A rank among draws of its own kind is uniform: the mean of 24 lies within four of its deviations of one half."""
    found = outside(13)
    assert found.outside is not None
    random = np.random.default_rng(5)
    L = np.linalg.cholesky(found.seen.covariance)
    for among in ((found.outside,), tuple(places(found))):
        each = [
            unformed(found, found.seen.rest @ (L @ random.standard_normal(len(L))), random, among)[0] for _ in range(24)
        ]
        assert abs(np.mean(each) - 0.5) < 4 / np.sqrt(12 * 24)
        p, best = unformed(found, 3 * found.signal, random, among)
        assert p == pytest.approx(1 / 200)
        assert set(best.of) & set(found.outside.of)


def test_what_is_hidden_is_among_the_places_that_are_searched() -> None:
    for number in (11, 12, 13, 14):
        found = outside(number)
        where = [(one.of, one.spans, one.along, one.scale) for one in places(found)]
        true = found.outside
        assert len(set(where)) == len(where)
        assert any((set(of), along, scale) == (set(true.of), true.along, true.scale) for of, _, along, scale in where)


def test_who_knows_the_form_tests_its_size() -> None:
    found = outside(20)
    said, (name,) = told(found, 0), found.errors
    column = found.seen.seen(found.errors[name])
    z = column @ (found.seen.rest @ found.one.y) / np.linalg.norm(column)
    assert said["p_form"] == pytest.approx(2 * stats.norm.sf(abs(z)))
    assert set(said["log_odds"]) == set(said["log_evidence"]) - {found.outside.form if found.outside else ""}
