"""How often a fault of the artefact is called one of the machine: ``python -m benchmarks.artefact_faults.study [--cases 6]``.

Of each cell the script prints how often the machine was blamed alone, how often machine and artefact were named as not told
apart, and how often the artefact was named; of the cells whose fault is the machine's, the same, where the first is right.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.artefact_faults.recordings import (
    LIES,
    OVER,
    STANDS,
    TURNED,
    SetUps,
    bars,
    bowed,
    gauge,
    like_a_yaw,
    plate,
    recorded,
    triangle,
    twisted,
)
from cmm_uq.analysis.diagnosis.diagnosis import Diagnosis, diagnose
from cmm_uq.artefacts import artefact_facts, artefact_of
from cmm_uq.base.points import Points
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import effects

IN_PLANE = ("scale_x", "scale_y", "squareness_xy")
SIX = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")
DRILLED: dict[str, Any] = {"kind": "plate", "nominal": True}
CERTIFIED: dict[str, Any] = {"kind": "plate", "u_um": 0.5}
GAUGE: dict[str, Any] = {"kind": "step_gauge", "u_um": 0.4}
TRIANGLE: dict[str, Any] = {
    "kind": "triangle", "blocks_mm": [280.0, 480.0, 380.0], "cylinders_mm": [20.0, 20.0, 20.0],
    "u_blocks_um": 0.2, "u_cylinders_um": 0.2,
}  # fmt: skip
BAR: dict[str, Any] = {"kind": "ballbar", "length_mm": 400.0, "u_um": 0.5}

Deviations = Callable[[np.random.Generator, SetUps], np.ndarray]
Made = Callable[[np.random.Generator], SetUps]


@dataclass(frozen=True)
class Cell:
    """One artefact, what is wrong with it (µm, in its own axes), and what is wrong with the machine."""

    name: str
    facts: dict[str, Any]
    made: Made
    named: tuple[str, ...]
    deviations: Deviations = lambda random, s: np.zeros_like(s.places)
    machine: str | None = None
    size: float = 0.0


def pattern(sd: float, axes: int = 3) -> Deviations:
    """Every place off by its own."""
    return lambda random, s: random.normal(0, sd, s.places.shape) * (np.arange(3) < axes)


def warm(kelvin: float) -> Deviations:
    """Longer by 11.5 ppm for each kelvin."""
    return lambda random, s: 11.5e-3 * kelvin * s.places


def warm_by_set_up(kelvin: float) -> Deviations:
    """The same, in each set-up another temperature."""
    return lambda random, s: 11.5e-3 * random.normal(0, kelvin, (len(s.turns), 1, 1)) * s.places


def sagging(size: float) -> Deviations:
    """A plate that hangs down in its middle, as it lies."""

    def found(random: np.random.Generator, s: SetUps) -> np.ndarray:
        part = 1 - np.sum(s.places**2, axis=1) / np.sum(s.places**2, axis=1).max()
        up = np.array([turn.apply([0.0, 0.0, 1.0])[2] for turn in s.turns])
        return -size * up[:, None, None] * part[:, None] * np.array([0.0, 0.0, 1.0])

    return found


def clamped(size: float) -> Deviations:
    """A plate that its fixture twists and bends, otherwise in each set-up."""

    def found(random: np.random.Generator, s: SetUps) -> np.ndarray:
        u, v = (s.places / np.abs(s.places).max())[:, :2].T
        a, b, c = random.normal(0, size, (3, len(s.turns), 1))
        return (a * u**2 + b * v**2 + c * u * v)[:, :, None] * np.array([0.0, 0.0, 1.0])

    return found


def one(random: np.random.Generator) -> SetUps:
    return plate(random, (LIES,))


def two(random: np.random.Generator) -> SetUps:
    return plate(random, (LIES, TURNED))


def four(random: np.random.Generator) -> SetUps:
    return plate(random, (LIES, TURNED, STANDS, OVER))


def yaw(_: np.random.Generator, s: SetUps) -> np.ndarray:
    return like_a_yaw(s.places, 35.0)


def bow(_: np.random.Generator, s: SetUps) -> np.ndarray:
    return bowed(s.places, 12.0)


def twist(_: np.random.Generator, s: SetUps) -> np.ndarray:
    return twisted(s.places, 12.0)


CELLS = (
    Cell("drilled plate, one attitude: pattern 8 µm", DRILLED, one, IN_PLANE, pattern(8.0)),
    Cell("drilled plate, one attitude: like a yaw", DRILLED, one, IN_PLANE, yaw),
    Cell("drilled plate, one attitude: bow", DRILLED, one, IN_PLANE, bow),
    Cell("drilled plate, one attitude: twist", DRILLED, one, IN_PLANE, twist),
    Cell("drilled plate, two attitudes: pattern 8 µm", DRILLED, two, IN_PLANE, pattern(8.0)),
    Cell("drilled plate, two attitudes: like a yaw", DRILLED, two, IN_PLANE, yaw),
    Cell("drilled plate, two attitudes: bow", DRILLED, two, IN_PLANE, bow),
    Cell("drilled plate, two attitudes: twist", DRILLED, two, IN_PLANE, twist),
    Cell("certified plate, four set-ups: pattern 1 µm", CERTIFIED, four, SIX, pattern(1.0)),
    Cell("certified plate, four set-ups: sags by 8 µm", CERTIFIED, four, SIX, sagging(8.0)),
    Cell("certified plate, four set-ups: clamped", CERTIFIED, four, SIX, clamped(5.0)),
    Cell("certified plate, four set-ups: 1 K by set-up", CERTIFIED, four, SIX, warm_by_set_up(1.0)),
    Cell("certified plate, four set-ups, nothing named: 0.6 K", CERTIFIED, four, (), warm(0.6)),
    Cell("step gauge: pattern 2 µm", GAUGE, gauge, SIX, pattern(2.0, 1)),
    Cell("step gauge: 1 K by set-up", GAUGE, gauge, SIX, warm_by_set_up(1.0)),
    Cell("step gauge, nothing named: 1 K", GAUGE, gauge, (), warm(1.0)),
    Cell("triangle: one side 4 µm too long", TRIANGLE, lambda r: triangle(r, (LIES, TURNED, STANDS)), (),
         lambda random, s: np.array([[0.0, 0, 0], [4.0, 0, 0], [0, 0, 0]])),
    Cell("ballbar, nothing named: 1 K", BAR, bars, (), warm(1.0)),
    Cell("drilled plate, one attitude: the machine yaws", DRILLED, one, IN_PLANE, machine="rotation_x_z", size=35.0),
    Cell("drilled plate, two attitudes: the machine yaws", DRILLED, two, IN_PLANE, machine="rotation_x_z", size=35.0),
    Cell("certified plate, four set-ups: the machine yaws", CERTIFIED, four, SIX, machine="rotation_x_z", size=15.0),
    Cell("certified plate, one attitude: a machine's bow", CERTIFIED, one, IN_PLANE, machine="straightness_x_y", size=30.0),
    Cell("step gauge: a machine's bow", GAUGE, gauge, SIX, machine="straightness_x_y", size=20.0),
    Cell("triangle: squareness", TRIANGLE, lambda r: triangle(r, (LIES, TURNED, STANDS)), (),
         machine="squareness_yz", size=5.0),
    Cell("ballbar: a machine's bow", BAR, bars, SIX, machine="straightness_x_y", size=15.0),
)  # fmt: skip


def columns_of(cell: Cell, s: SetUps, points: Points) -> Points:
    """The recording with the references that its kind needs."""
    if cell.facts["kind"] == "plate":
        places = s.places[points.point - 1]
        return replace(points, columns={f"reference_{a}_mm": places[:, i] for i, a in enumerate("xyz")})
    if cell.facts["kind"] == "step_gauge":
        return replace(points, columns={"reference_mm": (s.places[:, 0] - s.places[0, 0])[points.point - 1]})
    return points


def told(found: Diagnosis) -> str:
    """Whom a diagnosis names."""
    own = {e.effect for e in found.effects if e.effect.startswith("artefact_") or e.effect == "thermal_artefact"}
    machine = {e.effect for e in found.effects} - own
    with_artefact = {name for group in found.indistinguishable for name in group if any("artefact" in n for n in group)}
    if machine - with_artefact:
        return "machine"
    if machine or (own & with_artefact and any(n for n in with_artefact if "artefact" not in n)):
        return "either"
    return "artefact" if own else found.verdict


def diagnosed(cell: Cell, seed: int) -> Diagnosis:
    """One case."""
    random = np.random.default_rng([seed, CELLS.index(cell)])
    s = cell.made(random)
    points = columns_of(cell, s, recorded(random, s, cell.deviations(random, s), cell.machine, cell.size))
    facts = artefact_facts(**cell.facts)
    model = RecordingModel(artefact_of(facts, points), effects(cell.named))
    return diagnose(model, stated_um=1.0, alpha=0.01, seed=0, observe=lambda some: artefact_of(facts, some))


def main() -> None:
    """Print a line for each cell."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=6)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="")
    chosen = parser.parse_args()
    for cell in CELLS:
        if chosen.only not in cell.name:
            continue
        start, count, names = time.process_time(), Counter[str](), Counter[str]()
        for i in range(chosen.cases):
            found = diagnosed(cell, 1000 * chosen.seed + i)
            count[told(found)] += 1
            names.update(e.effect for e in found.effects)
        seconds = (time.process_time() - start) / chosen.cases
        print(f"{cell.name} | {dict(count)} | {dict(names.most_common(4))} | {seconds:.1f} s", flush=True)


if __name__ == "__main__":
    main()
