"""A machine with many errors against a model that is told of none: ``python -m benchmarks.told_nothing [--cases 40]``.

So it is where an ideal machine was simulated. Sixty places of a bar of 500 mm, 1 µm of noise; of twenty errors, written out
here, three to eight act. With ``--gauge``: a step gauge of twelve faces on seven lines, measured twice, on a machine out of
adjustment, which has all three scales and all three squarenesses and up to two errors more. The script prints how many of
them are found, how many others are named, and the verdicts.
"""

from __future__ import annotations

import argparse
from collections import Counter
from functools import partial
from multiprocessing import Pool

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.diagnosis.diagnosis import diagnose
from cmm_uq.artefacts import artefact_facts, artefact_of
from cmm_uq.base.points import Machine, Points
from cmm_uq.machine.model import RecordingModel

TRAVEL = np.array([[0.0, 1200.0], [0.0, 900.0], [-700.0, 0.0]])
LENGTH, BARS, NOISE_UM, SEED = 500.0, 60, 1.0, 2026
FACES = np.arange(12) * 50.0
ARCSEC = np.pi / 648000

Floats = NDArray[np.float64]


def errors(xyz: Floats) -> dict[str, Floats]:
    """By name, what is to be added to readings (n, 3), mm, of errors of ordinary size."""
    x, y, z = xyz.T
    none = np.zeros_like(x)
    found = {
        "scale_x": np.stack([20e-6 * x, none, none]), "scale_y": np.stack([none, -20e-6 * y, none]),
        "scale_z": np.stack([none, none, 20e-6 * z]),
        "squareness_xy": np.stack([-15 * ARCSEC * y, none, none]), "squareness_yz": np.stack([none, 15 * ARCSEC * z, none]),
        "squareness_zx": np.stack([-15 * ARCSEC * z, none, none]),
    }  # fmt: skip
    for i, a in enumerate("xyz"):
        t = 2 * (xyz[:, i] - TRAVEL[i, 0]) / (TRAVEL[i, 1] - TRAVEL[i, 0]) - 1
        for j, b in enumerate("xyz"):
            if j != i:
                found[f"straightness_{a}_{b}"] = 0.025 * (1 - t**2) * np.eye(3)[:, [j]]
    carried = {"x": np.stack([none, y, z], axis=1), "y": np.stack([none, none, z], axis=1)}
    for a, turns in (("x", "xyz"), ("y", "xy")):
        i = "xyz".index(a)
        angle = 40 * ARCSEC * 1e-3 * (xyz[:, i] - TRAVEL[i, 0])
        for b in turns:
            found[f"rotation_{a}_{b}"] = np.cross(angle[:, None] * np.eye(3)["xyz".index(b)], carried[a]).T
    return {name: e.T for name, e in found.items()}


def bars(random: np.random.Generator) -> tuple[Floats, NDArray[np.int64], NDArray[np.int64]]:
    """True ends (n, 3) of bars anywhere, measurement and point of each."""
    ends = list[Floats]()
    while len(ends) < BARS:
        direction = random.standard_normal(3)
        half = 0.5 * LENGTH * direction / np.linalg.norm(direction)
        both = random.uniform(*TRAVEL.T) + np.stack([-half, half])
        if np.all((both >= TRAVEL[:, 0]) & (both <= TRAVEL[:, 1])):
            ends.append(both)
    return np.concatenate(ends), np.repeat(np.arange(1, BARS + 1), 2), np.tile([1, 2], BARS)


def gauge(random: np.random.Generator) -> tuple[Floats, NDArray[np.int64], NDArray[np.int64]]:
    """True faces (n, 3) of a gauge along the axes, two diagonals of faces and two of the volume."""
    lines = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [1, 1, 1], [1, -1, 1]], dtype=np.float64)
    lines /= np.linalg.norm(lines, axis=1)[:, None]
    found = list[Floats]()
    for line in lines:
        low = TRAVEL[:, 0] + np.maximum(-line * FACES[-1], 0.0)
        high = TRAVEL[:, 1] - np.maximum(line * FACES[-1], 0.0)
        found.append(random.uniform(low, high) + FACES[:, None] * line)
    count = len(FACES)
    return (
        np.concatenate(found),
        np.repeat(np.arange(1, len(lines) + 1), count),
        np.tile(np.arange(1, count + 1), len(lines)),
    )


def case(seed: int, *, of_gauge: bool = False) -> tuple[list[str], list[tuple[str, float]], str]:
    """What acts, what is named with its probability, and the verdict."""
    random = np.random.default_rng([SEED, seed])
    true, number, point = gauge(random) if of_gauge else bars(random)
    repeat = np.ones_like(number)
    if of_gauge:
        true, number, point = (np.concatenate([each, each]) for each in (true, number, point))
        repeat = np.repeat([1, 2], len(repeat))
    possible = errors(true)
    linear = [name for name in possible if name.startswith(("scale", "squareness"))]
    if of_gauge:
        others = [name for name in possible if name not in linear]
        hidden = linear + random.choice(others, random.integers(0, 3), replace=False).tolist()
    else:
        hidden = random.choice(list(possible), random.integers(3, 9), replace=False).tolist()
    read = true - sum(random.choice([-1, 1]) * random.uniform(0.5, 1.5) * possible[name] for name in hidden)
    read = read + random.normal(0, 1e-3 * NOISE_UM, read.shape)
    columns = {"reference_mm": FACES[point - 1]} if of_gauge else {}
    points = Points(read, number, point, repeat, Machine("m", "XYZ", TRAVEL), columns, np.arange(2, len(read) + 2))
    facts = (
        artefact_facts(kind="step_gauge", u_um=0.5)
        if of_gauge
        else artefact_facts(kind="ballbar", length_mm=LENGTH, u_um=0.5)
    )
    found = diagnose(RecordingModel(artefact_of(facts, points), ()), stated_um=None, alpha=0.01, seed=0)
    return hidden, [(item.effect, item.probability) for item in found.effects], found.verdict


def main() -> None:
    """Draw the cases and print what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=40)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--gauge", action="store_true")
    asked = parser.parse_args()
    acting, right, wrong, sure, verdicts = Counter[int](), Counter[int](), 0, 0, Counter[str]()
    with Pool(asked.processes) as pool:
        for hidden, named, verdict in pool.imap(partial(case, of_gauge=asked.gauge), range(asked.cases)):
            acting[len(hidden)] += len(hidden)
            right[len(hidden)] += len(set(hidden) & {name for name, _ in named})
            others = [(name, p) for name, p in named if name not in hidden]
            wrong, sure = wrong + len(others), sure + sum(p > 0.9 for _, p in others)
            verdicts[verdict] += 1
            missed = sorted(set(hidden) - {name for name, _ in named})
            print(f"{len(hidden)} acting, missed {missed}, besides {others}, {verdict}", flush=True)
    for count in sorted(acting):
        print(f"{count} acting: {right[count]} of {acting[count]} found")
    print(f"together {sum(right.values())} of {sum(acting.values())}; {dict(verdicts)}")
    print(f"others named {wrong}, with more than 90 % {sure}")


if __name__ == "__main__":
    main()
