"""The probabilities of detecting and naming, against what they stand for, drawn."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from cmm_uq.analysis.diagnosis.power import Thresholds

DRAWS = 400_000


def drawn(thresholds: Thresholds, length: float) -> tuple[float, float]:
    """Of an effect's z and a rival's, that sees it with a cosine, over σ as the residuals show it."""
    random = np.random.default_rng(5)
    z = length + random.standard_normal(DRAWS)
    count = thresholds.left - 1
    noise = np.sqrt((thresholds.known + random.chisquare(count, DRAWS)) / (thresholds.known + count))
    detected = np.abs(z) > thresholds.detected * noise
    named = detected
    for at, c in zip(thresholds.named, thresholds.cosines, strict=True):
        rival = c * z + np.sqrt(1 - c**2) * random.standard_normal(DRAWS)
        named = named & (z**2 - rival**2 > (1 - c**2) * (at * noise) ** 2)
    return float(detected.mean()), float(named.mean())


@pytest.mark.parametrize(("length", "cosines", "known", "left"), [
    (5.0, [0.3], 0.0, 200), (6.5, [0.9], 0.0, 13), (6.5, [0.9, 0.5], 25.0, 13), (3.0, [0.0], 0.0, 40),
])  # fmt: skip
def test_probabilities_are_those_of_draws(length: float, cosines: list[float], known: float, left: int) -> None:
    """Within 2 %: the size of the residuals is taken at seven evenly probable values."""
    thresholds = Thresholds(4.2, np.array([4.5, 5.5][: len(cosines)]), np.array(cosines), known, left)
    detected, named = drawn(thresholds, length)
    at = np.array([length])
    assert thresholds.detects(at)[0] == pytest.approx(detected, abs=0.02)
    assert thresholds.names(at)[0] == pytest.approx(named, abs=0.02)


def test_with_known_noise_and_no_rival_it_is_the_noncentral_chi_square() -> None:
    thresholds = Thresholds(4.0, np.array([0.0]), np.array([0.0]), 1e9, 50)
    exact = stats.ncx2.sf(16.0, 1, 5.3**2)
    assert thresholds.detects(np.array([5.3]))[0] == pytest.approx(exact, abs=1e-4)
    length = thresholds.length_detected(0.9)
    assert stats.ncx2.sf(16.0, 1, length**2) == pytest.approx(0.9, abs=1e-4)


def test_with_noise_of_which_nothing_is_known_it_is_the_noncentral_t() -> None:
    """Thirty degrees of freedom; the other side has less than 1e-20."""
    thresholds = Thresholds(4.0, np.array([0.0]), np.array([0.0]), 0.0, 31)
    exact = stats.nct.sf(4.0, 30, 5.5)
    assert thresholds.detects(np.array([5.5]))[0] == pytest.approx(exact, abs=0.01)


def test_a_twin_leaves_no_name_and_a_larger_effect_is_found_more_often() -> None:
    twin = Thresholds(4.0, np.array([np.inf]), np.array([0.99]), 0.0, 50)
    assert twin.length_named(0.9) == np.inf
    assert not twin.names(np.array([50.0])).any()
    assert np.isfinite(twin.length_detected(0.9))
    near = Thresholds(4.0, np.array([6.0]), np.array([0.95]), 0.0, 50)
    curve = near.names(np.linspace(1.0, 20.0, 12))
    assert np.all(np.diff(curve) > -1e-9)
    assert near.length_named(0.9) > near.length_detected(0.9)
