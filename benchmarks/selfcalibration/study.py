"""What shifting leaves of 27 µm: the paper's integrations, the joint estimator, and an oracle that knows the true prior.

Run:  python -m benchmarks.selfcalibration.study [--machines 1000] [--estimated 1000] [--seed 1]

Every method sees the same readings and the same known length (440 mm, exact). Residuals are true minus estimated error at
the positions of the first series, peak to valley. The oracle is the best linear estimator that knows the mean and
covariance of the generator itself (20 000 of its machines) and the true repeatability: no method can be expected below it
by much; the oracle that is told the families knows, besides, which of them this machine was made of. Coverage is of the
joint estimator's 95 % interval at every position and of its simultaneous 95 % band.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import defaultdict

import numpy as np

from benchmarks.selfcalibration.machines import (
    EQUAL_40,
    FULL,
    LENGTH,
    REPEATABILITY,
    REPEATS,
    SHIFT,
    UNEQUAL,
    machine,
    record,
)  # fmt: skip
from cmm_uq.artefacts.shift.axis import estimate_curve
from cmm_uq.artefacts.shift.integration import KnownSpan, calibration_curve, position_error, with_known_length
from cmm_uq.artefacts.shift.series import shifted_series
from cmm_uq.base.points import Floats

DESIGNS = {"23 points": FULL, "12 equal": EQUAL_40, "12 unequal": UNEQUAL}
EVERYWHERE = np.arange(0.0, LENGTH + SHIFT + 1, 20.0)
U_SHIFT = 0.5
"""Standard uncertainty of the shift as the estimator is told it, mm: it was set by eye."""


def many_machines(random: np.random.Generator) -> tuple[Floats, list[frozenset[int]]]:
    """Errors (20 000, m) of machines of the generator at all positions read, and the families each was made of."""
    made = [machine(random) for _ in range(20_000)]
    return np.array([error(EVERYWHERE) for error, _ in made]), [families for _, families in made]


class Oracle:
    """Best linear estimate under the mean and covariance of given machines, shift and points free."""

    def __init__(self, places: Floats, curves: Floats) -> None:
        n = len(places)
        where = np.searchsorted(EVERYWHERE, np.concatenate([places, places + SHIFT]))
        self.mean, covariance = curves[:, where].mean(axis=0), np.cov(curves[:, where], rowvar=False)
        # r + e = X + D·s: points free, except that the last lies 440 mm after the first
        free = np.vstack([np.eye(n), np.eye(n)])
        free = np.column_stack([free[:, 0] + free[:, -1], free[:, 1:-1], np.repeat([0.0, 1.0], n)])
        rest = np.linalg.svd(free)[0][:, free.shape[1] :]
        noise = REPEATABILITY**2 / REPEATS * np.eye(2 * n)
        self.rest, self.known = rest, np.tile(LENGTH * (places == LENGTH), 2)
        gain = covariance @ rest @ np.linalg.inv(rest.T @ (covariance + noise) @ rest)
        self.gain = gain[:n]

    def __call__(self, a: Floats, b: Floats) -> Floats:
        # rest kills what is free: rest·(r + e) = rest·known
        seen = self.rest.T @ (self.known - np.concatenate([a, b]) - self.mean)
        found = self.mean[: len(a)] + self.gain @ seen
        return np.asarray(found - found[0])


def study(machines: int, estimated: int, seed: int) -> dict[str, object]:
    random = np.random.default_rng(seed)
    curves, made_of = many_machines(np.random.default_rng(seed + 1))
    oracles = {name: Oracle(places, curves) for name, places in DESIGNS.items()}
    kinds = {families: np.array([f == families for f in made_of]) for families in set(made_of)}
    told = {
        (name, families): Oracle(places, curves[chosen])
        for name, places in DESIGNS.items() for families, chosen in kinds.items()
    }  # fmt: skip
    left: dict[str, dict[str, list[float]]] = {name: defaultdict(list) for name in DESIGNS}
    inside: dict[str, list[Floats]] = {name: [] for name in DESIGNS}
    whole: dict[str, list[bool]] = {name: [] for name in DESIGNS}
    seconds = []
    for index in range(machines):
        error, families = machine(random)
        for name, places in DESIGNS.items():
            recording = record(error, places, random)
            a, b = recording.readings.mean(axis=2)
            true = error(a) - error(a[:1])
            found = {
                method: position_error(a, with_known_length(calibration_curve(a, b, None, method), 0, -1, LENGTH))
                for method in ("pitch", "improved")
            }
            found["oracle"] = oracles[name](a, b)
            found["oracle told the families"] = told[name, families](a, b)
            if index < estimated:
                begin = time.perf_counter()
                series = shifted_series(recording.points, "x", np.array([0.0, SHIFT]), U_SHIFT)
                curve = estimate_curve(series, KnownSpan(0, len(places) - 1, LENGTH, 0.0), seed=index).at(a)
                seconds.append(time.perf_counter() - begin)
                found["joint"] = curve.error
                low, high = curve.interval95
                inside[name].append((low[1:] <= true[1:]) & (true[1:] <= high[1:]))
                away = np.abs(true - curve.error)[1:]
                whole[name].append(bool(np.all(away <= curve.simultaneous_factor * curve.u[1:])))
            for method, e in found.items():
                left[name][method].append(float(np.ptp(e - true)))
                if index < estimated and method != "joint":
                    left[name][f"{method}, where joint"].append(float(np.ptp(e - true)))
        if (index + 1) % 25 == 0 and index < estimated:
            print(
                json.dumps(summed(index + 1, index + 1, seed, left, inside, whole, seconds)),
                file=sys.stderr,
                flush=True,
            )
    return summed(machines, estimated, seed, left, inside, whole, seconds)


def summed(
    machines: int, estimated: int, seed: int, left: dict[str, dict[str, list[float]]], inside: dict[str, list[Floats]],
    whole: dict[str, list[bool]], seconds: list[float],
) -> dict[str, object]:  # fmt: skip
    """Medians and coverage of what has been done so far."""
    return {
        "machines": machines, "estimated": estimated, "seed": seed,
        "median_residual_um": {
            name: {method: round(1e3 * float(np.median(values)), 2) for method, values in methods.items()}
            for name, methods in left.items()
        },
        "coverage": {
            name: {"pointwise": round(float(np.mean(inside[name])), 3), "whole": round(float(np.mean(whole[name])), 3)}
            for name in DESIGNS if inside[name]
        },
        "median_seconds": round(float(np.median(seconds)), 2) if seconds else None,
    }  # fmt: skip


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", type=int, default=1000)
    parser.add_argument(
        "--estimated", type=int, default=1000, help="machines of which the joint estimator makes curves"
    )
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    print(json.dumps(study(given.machines, given.estimated, given.seed), indent=2))
