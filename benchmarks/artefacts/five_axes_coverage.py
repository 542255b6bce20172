"""How often intervals of the errors of two tables, or of a head, hold; and whether a diagnosis finds what is concealed.

    python -m benchmarks.artefacts.five_axes_coverage errors|diagnosis CHAIN COUNT [FIRST]

CHAIN is ``XYZ|AC``, two spheres on C, which stands on A; or ``XYZ-CA``, a sphere in the machine, and A on C with the stylus.
The machines are products of 4 × 4 matrices and share no code with the package. Runs of each axis there and back while the
other stands low and high, then both at once.
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

import cmm_uq
from benchmarks.artefacts.rotary_table_coverage import shares, turning
from benchmarks.artefacts.weighed import intervals
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import artefact_of
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import effects

SECOND, MICROMETRE, NOISE_UM = np.pi / 648000, 1e-3, 0.4
Vector = np.ndarray
Amounts = dict[str, Vector]
# by chain: the axes, the one that carries the other first; a point on each, from the recording's origin or the end of the ram
POINTS = {
    "XYZ|AC": {"a": np.array([0.0, 5.0, 60.0]), "c": np.array([2.0, -3.0, 0.0])},
    "XYZ-CA": {"c": np.array([1.0, -2.0, 0.0]), "a": np.array([0.0, 3.0, -40.0])},
}
OUT = {"a": np.linspace(-40.0, 110.0, 13), "c": np.linspace(0.0, 360.0, 13)}
SPHERES, PLACE = np.array([[150.0, 40.0, 60.0], [-130.0, -70.0, 190.0]]), np.array([[30.0, -20.0, 10.0]])
STYLUS = np.array([15.0, 10.0, -200.0])
# standard deviation of each coefficient of the machines that are drawn, µm or ″
SIZES = {"location": 10.0, "tilt": 8.0, "positioning_1": 3.0, "radial_1": 1.0, "axial_1": 1.0, "play": 2.0}
NAMED = ("location", "tilt", "positioning_1", "play")
AXES = {"a": "yzx", "c": "xyz"}  # the two across each, and its own
CONCEALED = (("location", 15.0), ("tilt", 12.0), ("positioning_1", 12.0), ("positioning_2", 6.0), ("play", 6.0))
JOB = """[job]
id = "five-axes"
date = 2026-01-01
origin = "simulated"
[machine]
name = "of this study"
chain = "{chain}"
travel_mm = {{ x = [0, 1500], y = [0, 1500], z = [-1500, 0] }}
origin_mm = [750, 750, -750]
{axes}
[artefact]
kind = "table_spheres"
stay = true
[recording]
file = "recording.csv"
[model]
effects = [{names}]
"""


def names_of(chain: str, families: tuple[str, ...]) -> list[str]:
    """Effects of both axes, of these families."""
    begin = "rotary" if "|" in chain else "head"
    found = []
    for letter in POINTS[chain]:
        for family in families:
            name, _, order = family.partition("_")
            if name in ("location", "tilt"):
                found += [f"{begin}_{name}_{letter}_{axis}" for axis in sorted(AXES[letter][:2])]
            else:
                found.append("_".join(filter(None, (begin, name, letter, order))))
    return found


def matrix(rotation: Vector, shift: Vector) -> Vector:
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = turning(rotation), shift
    return found


def unit(axis: str) -> Vector:
    return np.eye(3)["xyz".index(axis)]


def erring(amounts: Amounts, letter: str, begin: str, degrees: float, sense: float, point: Vector) -> Vector:
    """(4, 4) of what an axis does to what it carries, with its errors."""
    t, one, other, own = np.radians(degrees), *(unit(axis) for axis in AXES[letter])

    def of(family: str, end: str) -> Vector:
        return amounts.get("_".join(filter(None, (begin, family, letter, end))), np.zeros(2))

    def wave(pair: Vector, order: int) -> float:
        return float(pair[0] * np.cos(order * t) - pair[1] * np.sin(order * t))

    place, lean = (
        sum((of(family, axis)[0] * unit(axis) for axis in AXES[letter][:2]), np.zeros(3))
        for family in ("location", "tilt")
    )
    angle = sum(wave(of("positioning", str(n)), n) for n in (1, 2)) + 0.5 * sense * float(of("play", "")[0])
    a, b = of("radial", "1")
    shift = (
        (a * np.cos(t) - b * np.sin(t)) * one
        - (a * np.sin(t) + b * np.cos(t)) * other
        + wave(of("axial", "1"), 1) * own
    )
    true = matrix(np.zeros(3), point + MICROMETRE * place) @ matrix(SECOND * lean, np.zeros(3))
    about = true @ matrix(t * own, np.zeros(3)) @ np.linalg.inv(true)
    turned = matrix(np.zeros(3), point) @ matrix(SECOND * angle * own, np.zeros(3)) @ matrix(np.zeros(3), -point)
    return matrix(np.zeros(3), MICROMETRE * shift) @ turned @ about


def positions(chain: str) -> list[tuple[int, dict[str, float], dict[str, float]]]:
    """Run, readings and senses of turning."""
    found = []
    letters = list(POINTS[chain])
    plans = [((letter,), {o: part}) for letter in letters for o in letters if o != letter for part in (0.25, 0.75)]
    for run, (turning_axes, stands) in enumerate([*plans, (tuple(letters), {})], 1):
        for sense in (1.0, -1.0):
            for i in range(13)[:: int(sense)]:
                read = {letter: float(OUT[letter][i]) for letter in turning_axes}
                read |= {letter: float(np.quantile(OUT[letter], part)) for letter, part in stands.items()}
                found.append((run, read, {letter: sense if letter in turning_axes else 0.0 for letter in letters}))
    return found


def recorded(chain: str, amounts: Amounts, names: list[str], random: np.random.Generator, folder: Path) -> Path:
    """A job of a machine with these errors, by effect, µm or ″."""
    begin, points = ("rotary" if "|" in chain else "head"), POINTS[chain]
    rows = ["measurement,point,repeat,x_mm,y_mm,z_mm,a_deg,c_deg,a_approach,c_approach"]
    for visit, (run, read, senses) in enumerate(positions(chain), 1):
        right, wrong = np.eye(4), np.eye(4)
        for letter, point in points.items():
            right = right @ erring({}, letter, begin, read[letter], 0.0, point)
            wrong = wrong @ erring(amounts, letter, begin, read[letter], senses[letter], point)
        noise = random.normal(0, MICROMETRE * NOISE_UM, (2, 3))
        if begin == "rotary":  # where the spheres are, turned back by a controller that knows of no error
            there = [np.append((wrong @ np.append(p, 1.0))[:3] + e, 1.0) for p, e in zip(SPHERES, noise, strict=True)]
            xyz = [np.linalg.solve(right, p)[:3] for p in there]
        else:  # the true tip is at the sphere; the controller takes it to be where it thinks
            tips = [(m @ np.append(STYLUS, 1.0))[:3] for m in (right, wrong)]
            xyz = [PLACE[0] + tips[0] - tips[1] + noise[0]]
        turned = ",".join(f"{read[k]:.6f}" for k in "ac") + "," + ",".join(f"{senses[k]:g}" for k in "ac")
        rows += [f"{run},{i},{visit},{','.join(f'{v:.7f}' for v in p)},{turned}" for i, p in enumerate(xyz, 1)]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "recording.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    origin = np.array([750.0, 750.0, -750.0]) if begin == "rotary" else np.zeros(3)
    axes = "".join(
        f'[[machine.rotary]]\nname = "{k.upper()}"\naxis_mm = {(p + origin).tolist()}\n' for k, p in points.items()
    )
    head = "" if begin == "rotary" else f"head = {{ stylus_mm = {STYLUS.tolist()} }}\n"
    quoted = ", ".join(f'"{name}"' for name in names)
    (folder / "job.toml").write_text(JOB.format(chain=chain, axes=head + axes, names=quoted), encoding="utf-8")
    return folder


def drawn(random: np.random.Generator, names: list[str]) -> Amounts:
    def size(name: str) -> float:
        return next(sd for family, sd in SIZES.items() if family.split("_")[0] == name.split("_")[1])

    return {name: random.normal(0, size(name), len(effects([name])[0].coefficients)) for name in names}


def errors(chain: str, count: int, first: int) -> None:
    """95 % intervals of all coefficients together."""
    held: Counter[str] = Counter()
    names = names_of(chain, tuple(SIZES))
    for seed in range(first, first + count):
        random = np.random.default_rng([10791, seed])
        machine = drawn(random, names)
        with tempfile.TemporaryDirectory() as place:
            job = read_job(recorded(chain, machine, names, random, Path(place) / "job"))
        model = RecordingModel(artefact_of(job.facts.artefact, job.points), effects(names))
        true = np.concatenate([machine[name] for name in names])
        low, high = intervals(model, seed, len(true))
        for unknown, inside in zip(model.unknowns, (low <= true) & (true <= high), strict=False):
            held[f"{unknown.key[0]} {unknown.key[1]}"] += int(inside)
    shares(held, count)
    total = sum(held.values())
    print(f"together {100 * total / (count * len(held)):.2f} % of {count * len(held)}", flush=True)


def diagnosis(chain: str, count: int, first: int) -> None:
    """Machines with what the model names and nothing else; and those in which one error is left out of it, on either axis."""
    whole = names_of(chain, NAMED)
    concealed = [("", 0.0), *((name, size) for family, size in CONCEALED for name in names_of(chain, (family,)))]
    for name, size in concealed:
        found: Counter[str] = Counter()
        for seed in range(first, first + count):
            random = np.random.default_rng([230, seed])
            names = [each for each in whole if each != name]
            machine = drawn(random, names)
            if name:
                phase, parts = random.uniform(0, 2 * np.pi), len(effects([name])[0].coefficients)
                machine[name] = size * np.array([np.cos(phase), np.sin(phase)]) if parts == 2 else np.array([size])
            with tempfile.TemporaryDirectory() as place:
                told = cmm_uq.diagnose(recorded(chain, machine, names, random, Path(place) / "job"), seed=1).diagnosis
            by_name = {each["effect"] for each in told["effects"]}
            found[told["verdict"]] += 1
            found["named" if name in by_name else "other named" if by_name else "nothing named"] += 1
        print(f"{name or 'nothing concealed'} {size:g}: {dict(found)}", flush=True)


if __name__ == "__main__":
    what, of, many, *rest = sys.argv[1:]
    {"errors": errors, "diagnosis": diagnosis}[what](of, int(many), int(rest[0]) if rest else 0)
