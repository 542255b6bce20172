"""Figures of performance of a set of lengths, each with its uncertainty.

The measurand is the figure on average over repeated recordings. Its error is drawn from the posterior: repetitions
with the model and the noise of each draw, about their own mean (JCGM 101:2008, 9.4).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import MICROMETRE, PRINTED, Unit
from cmm_uq.maths.uncertainty.quantity import Quantity

TITLES: Mapping[str, Text] = {
    "mean_length_mm": say("Mean length"),
    "rms_accuracy_error_um": say("rms accuracy error (standard deviation of the lengths)"),
    "b89_range_um": say("Range of the lengths, on average over repeats"),
    "b89_max_deviation_um": say("Largest deviation from the mean length"),
}
UNITS: Mapping[str, Unit] = {name: PRINTED[name.rpartition("_")[2]] for name in TITLES}
_DRAWS = 1000
_NUMBERS = 3_000_000  # random numbers to spend on repetitions
# repetitions of each draw at least; where so many take more random numbers, fewer of the draws are repeated
_LEAST, _LEAST_DRAWS, _MOST_NUMBERS = 10, 200, 10_000_000
_AT_ONCE = 300_000  # random numbers that are held at once: no more than a processor's cache holds
Repeated = Callable[[Ints, int, np.random.Generator], Floats]  # noise (w, repetitions, m), mm, anew, for w of the draws


def figures(lengths: Floats) -> dict[str, Floats]:
    """Figures of lengths (..., m) in mm: mean, rms accuracy error (n − 1), range, largest deviation from the mean.

    The rms accuracy error is equation 36 of Harris 2004. ASME B89.4.1 reports the range; what that source calls B89 is the
    largest deviation from the mean.
    """
    mean, low, high = lengths.mean(axis=-1), lengths.min(axis=-1), lengths.max(axis=-1)
    squares = lengths - mean[..., None]
    np.square(squares, out=squares)
    return {
        "mean_length_mm": mean,
        "rms_accuracy_error_um": np.sqrt(squares.sum(axis=-1) / max(lengths.shape[-1] - 1, 1)) / MICROMETRE,
        "b89_range_um": (high - low) / MICROMETRE,
        "b89_max_deviation_um": np.maximum(high - mean, mean - low) / MICROMETRE,
    }


def repeated_draws(draws: int, lengths: int) -> Ints:
    """Which of a posterior's draws are repeated for the figures of so many lengths."""
    most = int(np.clip(_MOST_NUMBERS // (_LEAST * lengths), _LEAST_DRAWS, _DRAWS))
    return np.linspace(0, draws - 1, min(most, draws)).astype(np.int64)


def with_uncertainty(
    lengths: Floats, predicted: Floats, noise: Repeated, seed: int, drawn_with: Ints | None = None
) -> dict[str, Quantity]:
    """Figures of recorded lengths (m,), mm, with uncertainty; ``predicted`` (N, m), mm, by draws without noise.

    ``drawn_with``: (m,) equal where lengths share their noise: a copy has that of its original. Each its own by default.
    """
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(1,)))
    shared: Ints | slice = slice(None)
    if drawn_with is not None:
        _, first, which = np.unique(drawn_with, return_index=True, return_inverse=True)
        if len(first) < len(lengths):
            shared = first[which.ravel()]
    chosen = repeated_draws(*predicted.shape)
    repetitions = int(np.clip(_NUMBERS // (len(chosen) * len(lengths)), _LEAST, 100))
    unbiased = np.sqrt(repetitions / (repetitions - 1))
    errors: dict[str, list[Floats]] = {name: [] for name in TITLES}
    parts = min(len(chosen), max(10, repetitions * len(chosen) * len(lengths) // _AT_ONCE))
    for block in np.array_split(chosen, parts):
        repeated = noise(block, repetitions, random)[..., shared]
        repeated += predicted[block, None, :]
        for name, values in figures(repeated).items():
            errors[name].append((unbiased * (values - values.mean(axis=1, keepdims=True))).ravel())
    return {
        name: Quantity.of_draws(float(value) - np.concatenate(errors[name]), UNITS[name], float(value))
        for name, value in figures(lengths).items()
    }
