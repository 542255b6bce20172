"""How often intervals of a rotary table's errors hold, and how often a diagnosis finds what is not there, or names what is.

    python -m benchmarks.artefacts.rotary_table_coverage errors|diagnosis COUNT [FIRST]

The table is simulated here by rotation matrices and shares no code with the package: its axis stands aside and leans, it moves
and tilts as it turns, its encoder errs. Two spheres at 0 and at seven positions over two turns, and back (ISO 10360-3).
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np
from scipy import stats

import cmm_uq
from benchmarks.artefacts.weighed import intervals
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import artefact_of
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import effects

SECOND, MICROMETRE, NOISE_UM = np.pi / 648000, 1e-3, 0.3
OUT = np.linspace(0.0, 720.0, 8)
ANGLES, SENSES = np.concatenate([OUT, OUT[-2::-1]]), np.repeat([0.0, 1.0, -1.0], [1, 7, 7])
SPHERES = np.array([[180.0, 60.0, 40.0], [-180.0, -60.0, 240.0]])
# what a model names, and the standard deviation of each coefficient of the machines that are drawn, µm or ″
SIZES = {
    "rotary_location_c_x": 5.0, "rotary_location_c_y": 5.0, "rotary_tilt_c_x": 5.0, "rotary_tilt_c_y": 5.0,
    "rotary_positioning_c_1": 2.0, "rotary_radial_c_1": 1.0, "rotary_axial_c_1": 1.0, "rotary_wobble_c_1": 1.0,
    "rotary_play_c": 2.0,
}  # fmt: skip
NAMED = [name for name in SIZES if name not in ("rotary_radial_c_1", "rotary_axial_c_1", "rotary_wobble_c_1")]
CONCEALED = {  # by the effect that it is: amplitude, µm or ″
    "rotary_positioning_c_1": 3.0, "rotary_positioning_c_2": 3.0, "rotary_axial_c_2": 2.0, "rotary_radial_c_x_2": 2.0,
    "rotary_play_c": 3.0, "rotary_location_c_x": 2.0, "rotary_tilt_c_y": 2.0,
}  # fmt: skip
JOB = """[job]
id = "table"
date = 2026-01-01
origin = "simulated"
[machine]
name = "of this study"
chain = "XYZ|C"
travel_mm = {{ x = [0, 900], y = [0, 1200], z = [-600, 0] }}
origin_mm = [450, 600, -400]
[artefact]
kind = "table_spheres"
[recording]
file = "recording.csv"
[model]
effects = [{names}]
"""


def turning(vector: np.ndarray) -> np.ndarray:
    """Matrix of a rotation vector (Rodrigues)."""
    angle = np.linalg.norm(vector)
    if angle == 0:
        return np.eye(3)
    x, y, z = vector / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def wave(machine: dict[str, np.ndarray], name: str, c: float, order: int) -> float:
    """A·cos(order·c + φ), from A·cos φ and A·sin φ; of the first order across the axis its part along X, see below."""
    a, b = machine.get(name, np.zeros(2))
    return float(a * np.cos(order * c) - b * np.sin(order * c))


def recorded(
    machine: dict[str, np.ndarray], names: list[str], random: np.random.Generator, folder: Path,
    spheres: np.ndarray = SPHERES, turns: tuple[np.ndarray, np.ndarray] = (ANGLES, SENSES), noise_um: float = NOISE_UM,
) -> Path:  # fmt: skip
    """A job of a machine: coefficients by effect, µm or ″; ``turns``: angles, °, and the senses in which they are reached."""
    offset = MICROMETRE * np.array([*(float(machine.get(f"rotary_location_c_{a}", [0.0])[0]) for a in "xy"), 0.0])
    lean = turning(SECOND * np.array([*(float(machine.get(f"rotary_tilt_c_{a}", [0.0])[0]) for a in "xy"), 0.0]))
    rows = ["measurement,point,repeat,x_mm,y_mm,z_mm,c_deg,c_approach"]
    for visit, (degrees, sense) in enumerate(zip(*turns, strict=True), 1):
        c = np.radians(degrees)
        positioning = sum(wave(machine, f"rotary_positioning_c_{n}", c, n) for n in (1, 2))
        positioning += 0.5 * sense * float(machine.get("rotary_play_c", [0.0])[0])
        a, b = machine.get("rotary_radial_c_1", np.zeros(2))
        radial = [a * np.cos(c) - b * np.sin(c), -a * np.sin(c) - b * np.cos(c)]
        radial[0] += wave(machine, "rotary_radial_c_x_2", c, 2)
        axial = sum(wave(machine, f"rotary_axial_c_{n}", c, n) for n in (1, 2))
        a, b = machine.get("rotary_wobble_c_1", np.zeros(2))
        wobble = [a * np.cos(c) - b * np.sin(c), -a * np.sin(c) - b * np.cos(c)]
        error = turning(SECOND * np.array([*wobble, 0.0])) @ turning(SECOND * np.array([0.0, 0.0, positioning]))
        about = error @ lean @ turning(np.array([0.0, 0.0, c])) @ lean.T
        there = offset + MICROMETRE * np.array([*radial, axial]) + (spheres - offset) @ about.T
        read = (there + random.normal(0, MICROMETRE * noise_um, there.shape)) @ turning(np.array([0.0, 0.0, c]))
        rows += [
            f"1,{i},{visit},{','.join(f'{v:.7f}' for v in p)},{degrees:.10g},{sense:g}" for i, p in enumerate(read, 1)
        ]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "recording.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    quoted = ", ".join(f'"{name}"' for name in names)
    (folder / "job.toml").write_text(JOB.format(names=quoted), encoding="utf-8")
    return folder


def drawn(random: np.random.Generator, names: list[str]) -> dict[str, np.ndarray]:
    return {name: random.normal(0, SIZES[name], len(effects([name])[0].coefficients)) for name in names}


def shares(counts: Counter[str], total: int) -> None:
    for name, held in counts.items():
        low, high = stats.binomtest(held, total).proportion_ci(0.95)
        print(f"{name:45s} {held:5d} of {total} = {100 * held / total:.1f} % ({100 * low:.1f} to {100 * high:.1f} %)")


def errors(count: int, first: int) -> None:
    """95 % intervals of all coefficients together."""
    held: Counter[str] = Counter()
    for seed in range(first, first + count):
        random = np.random.default_rng([2307, seed])
        machine = drawn(random, list(SIZES))
        with tempfile.TemporaryDirectory() as place:
            job = read_job(recorded(machine, list(SIZES), random, Path(place) / "job"))
        model = RecordingModel(artefact_of(job.facts.artefact, job.points), effects(list(SIZES)))
        true = np.concatenate([machine[name] for name in SIZES])
        low, high = intervals(model, seed, len(true))
        for unknown, inside in zip(model.unknowns, (low <= true) & (true <= high), strict=False):
            held[f"{unknown.key[0]} {unknown.key[1]}"] += int(inside)
    shares(held, count)
    total = sum(held.values())
    print(f"together {100 * total / (count * len(held)):.2f} % of {count * len(held)}")


def diagnosis(count: int, first: int) -> None:
    """A machine that has only what the model names; and machines with one error more, or without naming it."""
    for concealed, size in {"": 0.0, **CONCEALED}.items():
        found: Counter[str] = Counter()
        for seed in range(first, first + count):
            random = np.random.default_rng([10360, seed])
            names = [name for name in NAMED if name != concealed]
            machine = drawn(random, names)
            if concealed:
                phase, parts = random.uniform(0, 2 * np.pi), len(effects([concealed])[0].coefficients)
                machine[concealed] = size * np.array([np.cos(phase), np.sin(phase)]) if parts == 2 else np.array([size])
            with tempfile.TemporaryDirectory() as place:
                told = cmm_uq.diagnose(recorded(machine, names, random, Path(place) / "job"), seed=1).diagnosis
            by_name = {each["effect"] for each in told["effects"]}
            found[told["verdict"]] += 1
            found["named" if concealed in by_name else "other named" if by_name else "nothing named"] += 1
        print(f"{concealed or 'nothing concealed'} {size:g}: {dict(found)}", flush=True)


if __name__ == "__main__":
    what, many, *rest = sys.argv[1:]
    {"errors": errors, "diagnosis": diagnosis}[what](int(many), int(rest[0]) if rest else 0)
