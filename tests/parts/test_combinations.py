"""Which of many weights are followed, and what they stand for."""

from __future__ import annotations

import numpy as np

from cmm_uq.parts.combinations import chosen


def test_the_heaviest_are_kept_and_the_others_stand_for_the_rest() -> None:
    """Each chosen one stands for its weight over its probability: their mean over many choices is the sum of all (Horvitz,
    Thompson 1952); scatter of 4000 choices is below a hundredth."""
    random = np.random.default_rng(0)
    log = 3 * random.standard_normal(300)
    weight, sums, first = np.exp(log), [], 0
    for _ in range(4000):
        at, p = chosen(log, 30, random)
        assert len(at) <= 30
        first += int(log.argmax() in at)
        sums.append((weight[at] / p).sum())
    assert first == 4000
    np.testing.assert_allclose(np.mean(sums), weight.sum(), rtol=0.01)


def test_few_are_all_kept() -> None:
    at, p = chosen(np.zeros(5), 30, np.random.default_rng(0))
    np.testing.assert_array_equal(at, np.arange(5))
    np.testing.assert_array_equal(p, 1.0)
