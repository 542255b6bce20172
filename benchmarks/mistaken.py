"""How often a simulation's own mistake is named, and whether any is where the machine is at fault, or nothing.

    python -m benchmarks.mistaken FILE [SEEDS]

Each outcome is written to FILE as it comes, and what FILE has already is not run again; the table is of all.

A machine has errors by plain equations, which share no code with the package: three scales, a squareness and a bow. A
simulation has the same, predicts each recording by them, and is then falsified in one way; or it is right and the machine
has a squareness or a bow more, or nothing. Bars lie in forty places, or a plate of 5 × 5 balls in seven; or the simulation
is an error map, whose X has a wave besides. The noise is 1 µm. The search for what was left out is that of every diagnosis.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

import cmm_uq
from cmm_uq.analysis.diagnosis.comparison.search import search
from cmm_uq.analysis.diagnosis.diagnosis import FALSE_ALARMS
from cmm_uq.analysis.diagnosis.simulated import SimulationMistakes
from cmm_uq.analysis.diagnosis.simulation import simulation_mistakes
from cmm_uq.app.commands.estimation import without_outliers
from cmm_uq.app.commands.model import against_simulation
from cmm_uq.base.points import Floats
from cmm_uq.jobs.job import Job

ARCSECOND = np.pi / 648000
TRAVEL = np.array([900.0, 550.0, 500.0])
LENGTH = 400.0
Field = Callable[[Floats], Floats]


@dataclass(frozen=True)
class Errors:
    """E (n, 3), mm, of points read at (n, 3): scales ppm, squarenesses ″, bows µm over the travel, roll ″."""

    scale: Floats
    square: Floats
    bow: Floats
    roll: float = 0.0
    wave: float = 0.0  # µm, of the scale of X, every 300 mm

    @classmethod
    def drawn(cls, random: np.random.Generator) -> Errors:
        def sizes(least: float, most: float, count: int) -> Floats:
            return np.asarray(random.uniform(least, most, count) * random.choice([-1, 1], count))

        return cls(sizes(8, 40, 3), sizes(5, 25, 3) * [1, 0, 0], sizes(4, 12, 2) * [1, 0])

    def __call__(self, xyz: Floats) -> Floats:
        x, y, z = xyz.T
        e = 1e-6 * self.scale * xyz
        e[:, 0] -= ARCSECOND * (self.square[0] * y + self.square[2] * z)
        e[:, 1] -= ARCSECOND * self.square[1] * z
        e[:, 1] += 1e-3 * self.bow[0] * (1 - (2 * x / TRAVEL[0] - 1) ** 2)
        e[:, 0] += 1e-3 * self.bow[1] * (1 - (2 * y / TRAVEL[1] - 1) ** 2)
        e[:, 0] += 1e-3 * self.wave * np.sin(2 * np.pi * x / 300)
        turn = ARCSECOND * self.roll * x / TRAVEL[0]
        e[:, 1] -= turn * z
        e[:, 2] += turn * y
        return e


def shown(true: Floats, e: Field) -> Floats:
    """What a machine with these errors indicates of true points."""
    found = true
    for _ in range(20):
        found = true - e(found)
    return found


def bars(random: np.random.Generator, count: int = 40) -> tuple[Floats, Floats, Floats]:
    """Ends of bars in random places, and their measurement and point."""
    way = random.standard_normal((count, 3))
    half = 0.5 * LENGTH * way / np.linalg.norm(way, axis=1, keepdims=True)
    middle = np.abs(half) + (TRAVEL - 2 * np.abs(half)) * random.random((count, 3))
    ends = np.stack([middle - half, middle + half], axis=1).reshape(-1, 3)
    return ends, np.repeat(np.arange(1, count + 1), 2), np.tile([1, 2], count)


OWN = np.array([(80.0 * i, 80.0 * j, 0.0) for j in range(5) for i in range(5)])


def plates(random: np.random.Generator) -> tuple[Floats, Floats, Floats]:
    """A plate of 5 × 5 balls 80 mm apart in seven places: two level, five upright or leaning."""
    found = []
    for tilt, turn in ((0, 10), (0, 100), (90, 0), (90, 90), (90, 45), (45, 20), (60, 110)):
        a, b = np.radians([tilt, turn])
        lean = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
        about = np.array([[np.cos(b), -np.sin(b), 0], [np.sin(b), np.cos(b), 0], [0, 0, 1]])
        placed = OWN @ (about @ lean).T
        low, high = placed.min(axis=0), placed.max(axis=0)
        found.append(placed - low + random.random(3) * (TRAVEL - (high - low)))
    return np.vstack(found), np.repeat(np.arange(1, 8), 25), np.tile(np.arange(1, 26), 7)


def deviations(e: Floats, xyz: Floats) -> Floats:
    """Of errors (n, 3) of the points of one placing what no shift and no turn of it takes away."""
    away = xyz - xyz.mean(axis=0)
    turns = np.stack([np.cross(axis, away) for axis in np.eye(3)], axis=2).reshape(-1, 3)
    freedoms = np.hstack([np.tile(np.eye(3), (len(xyz), 1)), turns])
    left = e.ravel() - freedoms @ np.linalg.lstsq(freedoms, e.ravel(), rcond=None)[0]
    return np.asarray(left.reshape(-1, 3))


def table(xyz: Floats, measurement: Floats, point: Floats) -> pd.DataFrame:
    return pd.DataFrame(
        {"measurement": measurement, "point": point, **{f"{a}_mm": xyz[:, i] for i, a in enumerate("xyz")}}
    )


def exchanged(e: Field, order: list[int], *, components: bool = True, places: bool = True) -> Field:
    """The errors of a simulation that takes one axis for another."""

    def found(xyz: Floats) -> Floats:
        errors = e(xyz[:, order] if places else xyz)
        return errors[:, order] if components else errors

    return found


# What a simulation makes of the errors that it should have, and the names by which that is known
FIELDS: dict[str, tuple[Callable[[Field], Field], set[str]]] = {
    "sign": (lambda e: lambda p: -e(p), {"sign"}),
    "sign of X": (lambda e: lambda p: e(p) * [-1, 1, 1], {"sign_x"}),
    "sign of Y and Z": (lambda e: lambda p: e(p) * [1, -1, -1], {"sign_yz"}),
    "not needed": (lambda e: e, {"not_applied"}),
    "twice": (lambda e: lambda p: 2 * e(p), {"half"}),
    "half": (lambda e: lambda p: 0.5 * e(p), {"twice"}),
    "0.7 times": (lambda e: lambda p: e(p) / 0.7, {"factor"}),
    "inch": (lambda e: lambda p: e(p) / 25.4, {"millimetres"}),
    "X and Y exchanged": (lambda e: exchanged(e, [1, 0, 2]), {"axes_yxz"}),
    "columns Y, Z exchanged": (lambda e: exchanged(e, [0, 2, 1], places=False), {"components_xzy"}),
    "columns turned on": (lambda e: exchanged(e, [1, 2, 0], places=False), {"components_yzx"}),
    "table transposed": (lambda e: exchanged(e, [1, 0, 2], components=False), {"transposed_yxz"}),
    "map shifted": (lambda e: lambda p: e(p + np.array([60.0, 0, 0])), {"shift_x"}),
    "X from the end": (lambda e: lambda p: e(p * [-1, 1, 1] + [TRAVEL[0], 0, 0]), {"from_the_end_x"}),
    "Y reversed": (lambda e: lambda p: e(p * [1, -1, 1] + [0, TRAVEL[1], 0]) * [1, -1, 1], {"reversed_y"}),
}  # fmt: skip
OTHERS = {"not warm": {"expansion_not_applied"}, "set-ups exchanged": {"set_ups_3_7"}, "points exchanged": {"points_3_7"},
          "points reversed": {"points_reversed"}, "rounded": {"rounded"},
          "squareness turned": {"squareness_sign"}}  # fmt: skip
RIGHT: dict[str, set[str]] = {"nothing": set(), "a squareness more": set(), "a bow more": set(), "two more": set()}
NAMES = {**{name: names for name, (_, names) in FIELDS.items()}, **OTHERS, **RIGHT}


_SWAPPED = np.arange(25)
_SWAPPED[[2, 6]] = 6, 2
JOINED = {"points exchanged": _SWAPPED, "points reversed": np.arange(25)[::-1]}  # deviations of a plate joined wrongly
BARS, PLATE, MAP = "bars", "plate", "map"
STUDIED: dict[str, tuple[str, ...]] = {
    BARS: ("sign", "sign of X", "not needed", "half", "X and Y exchanged", "X from the end", "not warm", "set-ups exchanged",
           "rounded", *RIGHT),
    PLATE: ("points exchanged",),
    MAP: ("map shifted", "squareness turned"),
}  # fmt: skip


def recorded(case: str, artefact: str, seed: int) -> Job:
    """A recording with the prediction that one case makes of it."""
    random = np.random.default_rng([seed, sorted(NAMES).index(case), len(artefact)])
    machine = Errors.drawn(random)
    if artefact == MAP:
        machine = replace(machine, roll=0.0, wave=float(random.uniform(4, 8)))
    xyz, measurement, point = plates(random) if artefact == PLATE else bars(random)
    simulated: Field = FIELDS[case][0](machine) if case in FIELDS else machine
    acting = Errors(np.zeros(3), np.zeros(3), np.zeros(2)) if case == "not needed" else machine
    acting = with_more(case, acting, random)
    middle = np.array([xyz[measurement == n].mean(axis=0) for n in measurement])
    excess = 1 + 11.5e-6 * 3.0 if case == "not warm" else 1.0
    noise = 1e-3 * random.standard_normal(xyz.shape)
    points = table(shown(middle + excess * (xyz - middle), acting) + noise, measurement, point)
    taken = xyz + random.uniform(-0.5, 0.5, (measurement.max() + 1, 3))[measurement]
    predicted = shown(taken, simulated)
    if case in JOINED:
        each = [deviations((predicted - taken)[measurement == n], taken[measurement == n]) for n in range(1, 8)]
        predicted = taken + np.vstack([one[JOINED[case]] for one in each])
    prediction = table(predicted, measurement, point)
    if case == "set-ups exchanged":
        prediction = swapped_lengths(predicted)
    if case == "rounded":
        prediction = prediction.round(2)
    kind: dict[str, object] = {"kind": "ballbar", "length_mm": LENGTH, "u_um": 0.3}
    if artefact == PLATE:
        kind = {"kind": "plate", "u_um": 0.3}
        points = points.assign(**{f"reference_{a}_mm": np.tile(OWN[:, i], 7) for i, a in enumerate("xyz")})
    if case == "not warm":
        points["temp_artefact_c"] = 23.0
        kind["cte_per_k"] = 11.5e-6
    simulation: dict[str, object] = {"file": "predicted.csv"}
    if artefact == MAP:
        prediction, square = error_map(machine, case)
        simulation = {"map": {"file": "predicted.csv", "temperature_c": 20.0, "squareness_arcsec": square}}
    return cmm_uq.job(
        points, machine={"name": "M", "travel_mm": {a: [0, t] for a, t in zip("xyz", TRAVEL.tolist(), strict=True)}},
        artefact=kind, effects=[], files={"predicted.csv": prediction}, simulation=simulation,
    )  # fmt: skip


def swapped_lengths(predicted: Floats) -> pd.DataFrame:
    """Lengths of bars, those of the third and the seventh exchanged."""
    ends = predicted.reshape(-1, 2, 3)
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    lengths[[2, 6]] = lengths[[6, 2]]
    return pd.DataFrame({"measurement": np.arange(1, len(lengths) + 1), "length_mm": lengths})


def with_more(case: str, e: Errors, random: np.random.Generator) -> Field:
    """The errors with what the simulation lacks: 15″ of squareness XY, a bow of Z along Y of 12 µm."""
    if case in ("a squareness more", "two more"):
        e = replace(e, square=e.square + np.array([random.choice([-1, 1]) * 15.0, 0, 0]))
    if case not in ("a bow more", "two more"):
        return e
    size = random.choice([-1, 1]) * 12e-3
    return lambda p: e(p) + size * (1 - (2 * p[:, [2]] / TRAVEL[2] - 1) ** 2) * [0, 1, 0]


def error_map(machine: Errors, case: str) -> tuple[pd.DataFrame, dict[str, float]]:
    """The map of a machine, falsified in one way, and its squareness."""
    scale, square, bow, wave = machine.scale, machine.square, machine.bow, machine.wave
    if case == "sign":
        scale, square, bow, wave = -scale, -square, -bow, -wave
    if case == "squareness turned":
        square = -square
    off, back = 60.0 * (case == "map shifted"), case == "X from the end"
    rows = []
    for i, axis in enumerate("xyz"):
        for at in np.arange(-100.0, TRAVEL[i] + 125, 25):
            place = TRAVEL[0] - at if back and i == 0 else at + off * (i == 0)
            own = {f"d{a}_um": 0.0 for a in "xyz"} | {f"r{a}_arcsec": 0.0 for a in "xyz"}
            own[f"d{axis}_um"] = 1e-3 * scale[i] * place + wave * np.sin(2 * np.pi * place / 300) * (i == 0)
            if i < 2:
                own[f"d{'yx'[i]}_um"] = bow[i] * (1 - (2 * place / TRAVEL[i] - 1) ** 2)
            rows.append({"axis": axis, "position_mm": at, **own})
    return pd.DataFrame(rows), dict(zip(("xy", "yz", "zx"), square.tolist(), strict=True))


def mistakes_of(job: Job) -> SimulationMistakes:
    """As a diagnosis of the job finds them."""
    assert job.facts.simulation is not None
    against = against_simulation(job, job.facts.simulation)
    result = search(without_outliers(against.model)[0], None, alpha=FALSE_ALARMS, seed=0)
    return simulation_mistakes(result, against.predicted, against.of, against.model)


def outcome(case: str, found: SimulationMistakes) -> str:
    """What was said, in a word."""
    named = {one.name for one in found.asserted}
    if not named:
        return "withheld" if found.told else "not told"
    if named == NAMES[case]:
        return "named"
    return "in a group" if named & NAMES[case] else "wrong"


def main(file: Path, seeds: int) -> None:
    known = [json.loads(line) for line in file.read_text().splitlines()] if file.is_file() else []
    done = {(one["artefact"], one["case"], one["seed"]) for one in known}
    for seed in range(seeds):
        for artefact, case in ((artefact, case) for artefact, cases in STUDIED.items() for case in cases):
            if (artefact, case, seed) not in done:
                found = mistakes_of(recorded(case, artefact, seed))
                known.append({
                    "artefact": artefact, "case": case, "seed": seed, "outcome": outcome(case, found),
                    "named": [one.name for one in found.asserted], "told": [one.name for one in found.told],
                })  # fmt: skip
                with file.open("a") as lines:
                    lines.write(json.dumps(known[-1]) + "\n")
    print(
        "| simulation | what is wrong | named | in a group | withheld | not told | wrong |\n| --- | --- "
        + "| --- " * 5
        + "|"
    )
    for artefact, cases in STUDIED.items():
        for case in cases:
            each = Counter(one["outcome"] for one in known if (one["artefact"], one["case"]) == (artefact, case))
            counts = (str(each[word]) for word in ("named", "in a group", "withheld", "not told", "wrong"))
            print("|", " | ".join((artefact, case, *counts)), "|")


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 20)
