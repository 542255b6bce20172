"""The oracles of the second study find what is there, and no more often what is not than they say."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.second.cases import Seen, baseline, case
from benchmarks.second.noises import of_coordinates, of_observations
from benchmarks.second.oracle import Forms, Likelihood, Search, Shape, forms, searched


@pytest.mark.long(but="False-0")
@pytest.mark.parametrize("number", range(4))
@pytest.mark.parametrize("knows", [True, False])
def test_one_effect_of_known_size_without_noise_is_found_alone(number: int, knows: bool) -> None:
    """Its observations are a unit of its column; what is left when it is taken off is nothing."""
    made = case(21, "nothing, white", number)
    names, all_forms = forms(made)
    columns = np.hstack([f.columns[:, :, 0] for f in all_forms])
    owner = np.concatenate([f.owner for f in all_forms])
    seen = Seen(made.placed, made.named, made.certified, np.eye(len(made.y)), made.context, 1.0)
    strength = np.linalg.norm(seen.rest @ columns, axis=0)
    hidden = int(np.argmax(np.where(owner < 3, 0, strength / np.maximum(np.abs(columns).max(axis=0), 1e-300))))
    tiny = 1e-9 * np.random.default_rng(0).standard_normal(len(made.y))
    object.__setattr__(made, "y", made.noise.sigma * (50 * columns[:, hidden] / strength[hidden] + tiny))
    assert names[owner[hidden]] == searched(made, knows_noise=knows).effects[0]


def test_the_rise_of_the_likelihood_is_the_fall_of_chi_squared_under_a_known_covariance() -> None:
    """By generalised least squares, written out, for one column."""
    random = np.random.default_rng(4)
    made = case(21, "nothing, slow", 1)
    V = of_observations(of_coordinates(made.noise, made.placed), made.placed)
    B = baseline(Seen(made.placed, made.named, made.certified, V, made.context, made.noise.sigma))
    column, y = random.standard_normal(len(V)), random.standard_normal((len(V), 1)) * np.sqrt(V[0, 0])

    def chi_squared(A: np.ndarray) -> float:
        P = np.linalg.inv(V)
        left = y - A @ np.linalg.pinv(A.T @ P @ A, rcond=1e-12, hermitian=True) @ (A.T @ P @ y)
        return float((left.T @ P @ left)[0, 0])

    U, s, _ = np.linalg.svd(B / np.linalg.norm(B, axis=0), full_matrices=False)
    B = U[:, s > 1e-10 * s[0]]
    fall = chi_squared(B) - chi_squared(np.column_stack([B, column]))
    search = Search(B, [Shape(V)], [Forms(column[:, None, None], np.zeros(1, dtype=int))], None, known=True)
    _, surprise, _ = search.of(y)
    from scipy.stats import chi2

    assert surprise[0, 0] == pytest.approx(-chi2.logsf(fall, 1), rel=1e-6)


def test_a_stated_noise_holds_the_size_and_a_wrong_one_lets_go() -> None:
    """Of 100 squares that sum to 100 σ², σ stated: the likelihood falls faster about it than without; far off, both alike."""
    squares = np.array([100.0, 400.0])
    free, held = Likelihood(100, None).of(squares), Likelihood(100, 1.0).of(squares)
    assert held[0] - held[1] > free[0] - free[1]
    wrong = Likelihood(100, 10.0).of(squares)
    assert wrong[0] - wrong[1] == pytest.approx(free[0] - free[1], rel=0.05)
