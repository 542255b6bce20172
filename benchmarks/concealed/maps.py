"""Diagnose sets of error maps with a hidden cause and count: ``python benchmarks/concealed/maps.py [--sets 100] [--seed 0]``.

Three or four maps of nine errors, 25 mm apart, written from scratch: a course of waves that all maps share, white noise or
noise that follows itself along the travel, and nothing, an expansion of one scale, one map that is off in one error, or both.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from rich.progress import track

from cmm_uq.artefacts.error_maps.columns import columns_of
from cmm_uq.artefacts.error_maps.diagnosis import MapsDiagnosis, diagnose_maps
from cmm_uq.machine.physics.error_map import AxisErrors, ErrorMap

TRAVEL = ((0, 900), (0, 550), (-500, 0))
ARCSECOND = np.pi / 648000
MEASURED = ((0, 0), (0, 4), (0, 5), (1, 1), (1, 3), (1, 5), (2, 2), (2, 3), (2, 4))
"""Carriage and column of the errors that the maps have."""

KINDS = ("nothing", "expansion", "one map", "both")


def course(random: np.random.Generator, place: np.ndarray) -> np.ndarray:
    """A smooth function that no Gaussian process made: waves, a kink or a step that is rounded off."""
    u = (place - place[0]) / np.ptp(place)
    waves = sum(random.normal(0, 1 / k) * np.sin(np.pi * k * u + random.uniform(0, 6)) for k in range(1, 4))
    return np.asarray(waves + random.normal() * u)


def off(random: np.random.Generator, place: np.ndarray) -> np.ndarray:
    """How a map is off: a wrong slope, a bow, a bump, or a step."""
    u = (place - place[0]) / np.ptp(place)
    return np.asarray([u, u**2, np.exp(-(((u - 0.6) / 0.12) ** 2)), 1.0 * (u > 0.55)][int(random.integers(4))])


def noise(random: np.random.Generator, n: int, phi: float) -> np.ndarray:
    e = random.standard_normal(n)
    for i in range(1, n):
        e[i] = phi * e[i - 1] + np.sqrt(1 - phi**2) * e[i]
    return e


def maps_of(random: np.random.Generator, kind: str) -> tuple[list[ErrorMap], dict]:
    """Maps and what is hidden in them."""
    temperatures = [20.0, 25.0, 30.0] if random.random() < 0.6 else [18.0, 20.0, 22.0, 24.0]
    phi = float(random.choice([0.0, 0.0, 0.5, 0.8]))
    alpha = float(random.choice([-1, 1]) * random.uniform(3e-6, 15e-6))
    scale, odd, which = int(random.integers(3)), int(random.integers(9)), int(random.integers(len(temperatures)))
    carriages = [[] for _ in temperatures]
    for axis, (low, high) in enumerate(TRAVEL):
        place = np.arange(low, high + 1, 25.0)
        tables = np.zeros((len(temperatures), len(place), 6))
        for number, (carriage, column) in enumerate(MEASURED):
            if carriage != axis:
                continue
            unit = 1e-3 if column < 3 else ARCSECOND
            sigma = unit * (0.5 if column < 3 else 0.2) * random.uniform(0.7, 1.5)
            shared = 10 * unit * course(random, place)
            for k, temperature in enumerate(temperatures):
                tables[k, :, column] = shared + sigma * noise(random, len(place), phi)
                if kind in ("expansion", "both") and column == axis == scale:
                    tables[k, :, column] += alpha * (temperature - 20) * place
            if kind in ("one map", "both") and number == odd:
                wrong = off(random, place)
                tables[which, :, column] += random.choice([-1, 1]) * random.uniform(10, 40) * sigma * wrong
            tables[:, :, column] -= tables[:, :1, column]
        for k, table in enumerate(tables):
            carriages[k].append(AxisErrors(place, np.round(table / 1e-9) * 1e-9))
    found = [ErrorMap(tuple(c), temperature=t) for c, t in zip(carriages, temperatures, strict=True)]
    title = MEASURED[odd]
    return found, {"alpha": alpha, "scale": "xyz"[scale], "odd": title, "which": which}


def right(kind: str, hidden: dict, d: MapsDiagnosis) -> bool:
    """Whether the verdict is, what is asserted, and the map that is off is named first among its rivals."""
    if (
        d.verdict
        != {"nothing": "consistent", "expansion": "explained", "one map": "unexplained", "both": "partial"}[kind]
    ):
        return False
    effects = [e.effect for e in d.effects]
    if effects != ([f"thermal_scale_{hidden['scale']}"] if kind in ("expansion", "both") else []):
        return False
    if kind in ("nothing", "expansion"):
        return not d.differences
    carriage, column = hidden["odd"]
    return all(e.column.axis == "xyz"[carriage] and e.column.component == column for e in d.differences) and any(
        e.rival.map == hidden["which"] for e in d.differences
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=100, help="of each kind")
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    for number, kind in enumerate(KINDS):
        good, held, named, seconds = 0, 0, 0, []
        verdicts: dict[str, int] = {}
        for i in track(range(chosen.sets), kind):
            random = np.random.default_rng([chosen.seed, number, i])
            maps, hidden = maps_of(random, kind)
            start = time.perf_counter()
            d = diagnose_maps(columns_of(maps)[0], (), alpha=0.01, seed=0)
            seconds.append(time.perf_counter() - start)
            good += right(kind, hidden, d)
            verdicts[d.verdict] = verdicts.get(d.verdict, 0) + 1
            for effect in d.effects:
                if kind in ("expansion", "both") and effect.effect == f"thermal_scale_{hidden['scale']}":
                    low, high = effect.parameters["cte_per_k"].interval95
                    named, held = named + 1, held + (low <= hidden["alpha"] <= high)
        print(f"{kind}: right {good} of {chosen.sets}, {verdicts}; intervals hold {held} of {named}; "
              f"median {np.median(seconds):.2f} s")  # fmt: skip


if __name__ == "__main__":
    main()
