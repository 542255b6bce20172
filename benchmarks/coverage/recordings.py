"""One recording of a cell as a job folder, and the truth beside it; shares no code with the package.

True points t are where the artefact stands; the machine indicates p with p + e(p) = t, and noise is added. True errors, sizes
and noise are drawn anew for every recording; the truth is told in the names and units of results.json.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.concealed.physics import KNOWN, SECOND, TRAVEL
from benchmarks.coverage.artefacts import ARTEFACTS, Placed
from benchmarks.coverage.cells import STATED, Cell
from benchmarks.coverage.noises import IN_TIME, NOISES, RESOLUTION, Readings, displayed

TYPICAL = {
    "scale": 20.0,
    "squareness": 15.0,
    "rotation": 5.0,
    "straightness": 5.0,
    "probe_radius": 1.5,
    "probe_lobing": 1.0,
}
"""Standard deviation of true errors, in their parameters' units: a machine that is due for adjustment."""
PARAMETER = {"scale": "ppm", "squareness": "angle_arcsec", "rotation": "arcsec_per_m", "straightness": "bow_um",
             "probe_radius": "um"}  # fmt: skip
SECONDS = 20.0
"""Between readings, on average."""
REPETITIONS = 400
"""Of a recording, over which a figure of performance is averaged."""


@dataclass(frozen=True, eq=False)
class Recording:
    """A recording and its truth.

    Parameters
    ----------
    files : contents by name.
    truth : every parameter, size and figure, and the noise, by the names of results.json.
    noisy_axis : x, y or z where one reads worse.
    """

    files: dict[str, str]
    truth: dict[str, float]
    noisy_axis: str | None

    def write(self, folder: Path) -> Path:
        """As a job folder."""
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in self.files.items():
            (folder / name).write_text(text, encoding="utf-8")
        return folder


def kind_of(effect: str) -> str:
    """The kind of an effect, as in :data:`TYPICAL`."""
    return next(kind for kind in TYPICAL if effect.startswith(kind))


def recording(cell: Cell, seed: int, number: int) -> Recording:
    """Recording ``number`` of a cell."""
    random = np.random.default_rng([seed, *cell.key, number])
    placed = ARTEFACTS[cell.artefact](random)
    sigma = float(np.exp(random.uniform(np.log(0.7), np.log(2.0)))) * 1e-3
    time = np.cumsum(SECONDS * random.uniform(0.7, 1.3, len(placed.true)))
    readings = Readings(placed, sigma, time, int(random.integers(3)))
    truth, errors = _errors(placed, random)
    p = indicated(placed, errors)
    noise = NOISES[cell.noise]
    truth |= {f"artefact.{name}": value for name, value in placed.sizes.items()}
    if placed.reach is not None:
        truth |= _slopes(placed, p)
    if placed.kind == "ballbar":
        truth |= _figures(cell, p, readings, random)
    if cell.noise == "white":
        truth["noise.coordinate_um"] = 1e3 * sigma
    told = placed.columns | ({"time_s": time} if cell.noise in IN_TIME or number % 2 else {})
    factors = STATED[cell.stated]
    stated = 1e3 * sigma * float(random.choice(factors)) if factors else None
    shown = displayed(cell.noise, p + noise(readings, random))
    return Recording(
        {"job.toml": _job(placed, stated), "recording.csv": _csv(placed, shown, told)}, truth,
        "xyz"[readings.axis] if cell.noise.startswith("axis") else None,
    )  # fmt: skip


def _errors(placed: Placed, random: np.random.Generator) -> tuple[dict[str, float], dict[str, float]]:
    """Truth as reported, and the size of each effect with the phase of the lobes."""
    truth: dict[str, float] = {}
    size: dict[str, float] = {}
    for effect in placed.effects:
        kind = kind_of(effect)
        if kind == "probe_lobing":
            cosine, sine = TYPICAL[kind] * random.standard_normal(2)
            size |= {effect: float(np.hypot(cosine, sine)), "phase": float(np.arctan2(sine, cosine))}
            truth |= {f"{effect}.amplitude_um": size[effect], f"{effect}.phase_rad": size["phase"]}
        else:
            size[effect] = truth[f"{effect}.{PARAMETER[kind]}"] = float(TYPICAL[kind] * random.standard_normal())
    return truth, size


def indicated(placed: Placed, size: dict[str, float]) -> np.ndarray:
    """Readings without noise, (n, 3) mm: p + e(p) = t."""
    p = placed.true.copy()
    for _ in range(30):
        p = placed.true - error(placed, p, size)
    return p


def error(placed: Placed, p: np.ndarray, size: dict[str, float]) -> np.ndarray:
    """e of all effects at readings p, (n, 3) mm."""
    context = dict(placed.columns) | {"phase": size.get("phase", 0.0)}
    total = np.zeros_like(p)
    for effect in placed.effects:
        turns = effect.startswith("rotation") and (placed.chain != "XYZ" or "tip_x_mm" in placed.columns)
        one = _turned(placed, p, effect) if turns else KNOWN[effect](p, context)
        total += size[effect] * one
    return total


def _turned(placed: Placed, p: np.ndarray, effect: str) -> np.ndarray:
    """One arcsecond a metre of a carriage that carries those after it in the chain, and the tip."""
    carriage, about = ("xyz".index(letter) for letter in effect.split("_")[1:])
    angle = np.zeros_like(p)
    angle[:, about] = SECOND * (p[:, carriage] - TRAVEL[carriage, 0]) / 1000
    chain = placed.chain.lower()
    after = [a in chain[chain.index("xyz"[carriage]) + 1 :] for a in "xyz"]
    tip = np.column_stack([placed.columns[f"tip_{a}_mm"] for a in "xyz"])
    return np.cross(angle, p * after + tip)


def _figures(cell: Cell, p: np.ndarray, readings: Readings, random: np.random.Generator) -> dict[str, float]:
    """Figures of a ballbar's lengths, each the mean over repetitions of the recording with all its noise drawn anew.

    The display's steps lie elsewhere each time, since nobody sets a bar up again to the micrometre.
    """
    found: dict[str, list[float]] = {"mean_length_mm": [], "rms_accuracy_error_um": [], "b89_range_um": [],
                                     "b89_max_deviation_um": []}  # fmt: skip
    _, placing = np.unique(readings.placed.measurement, return_inverse=True)
    for _ in range(REPETITIONS):
        again = p + NOISES[cell.noise](readings, random)
        shift = (
            RESOLUTION * random.random((placing.max() + 1, 1, 3)).repeat(2, axis=1)[placing, readings.placed.point - 1]
        )
        ends = (displayed(cell.noise, again + shift) - shift).reshape(-1, 2, 3)
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        about = 1e3 * (lengths - lengths.mean())
        for name, value in zip(
            found, (lengths.mean(), about.std(ddof=1), np.ptp(about), np.abs(about).max()), strict=True
        ):
            found[name].append(float(value))
    return {f"figures.{name}": float(np.mean(values)) for name, values in found.items()}


def _slopes(placed: Placed, p: np.ndarray) -> dict[str, float]:
    """Of each gauge line: indicated over true distance, less one, ppm, without noise."""
    found = {}
    for number in np.unique(placed.measurement):
        own = placed.measurement == number
        true, shown = placed.true[own], p[own]
        direction = true[np.argmax(placed.reach[own])] - true[0]
        x, y = ((each @ direction) / np.linalg.norm(direction) for each in (true, shown))
        found[f"lines.{number}.slope_ppm"] = 1e6 * (float(np.polyfit(x - x.mean(), y - y.mean(), 1)[0]) - 1)
    return found


def _job(placed: Placed, stated_um: float | None) -> str:
    low, high = TRAVEL.T.tolist()
    travel = ", ".join(f"{a} = [{low[i]}, {high[i]}]" for i, a in enumerate("xyz"))
    stated = f"u_coordinate_um = {stated_um:.4f}\n" if stated_um else ""
    return (
        '[job]\nid = "coverage"\ndate = 2026-01-01\norigin = "simulated"\n\n'
        f'[machine]\nname = "simulated"\nchain = "{placed.chain}"\ntravel_mm = {{ {travel} }}\n\n'
        f'[artefact]\nkind = "{placed.kind}"\n{placed.facts}\n'
        f'[recording]\nfile = "recording.csv"\n{stated}\n[model]\neffects = {json.dumps(list(placed.effects))}\n'
    )


def _csv(placed: Placed, xyz: np.ndarray, columns: dict[str, np.ndarray]) -> str:
    rows = [",".join(["measurement", "point", "repeat", "x_mm", "y_mm", "z_mm", *columns])]
    for i in range(len(xyz)):
        numbers = [placed.measurement[i], placed.point[i], placed.repeat[i]]
        cells = [f"{value:.6f}" for value in xyz[i]] + [f"{values[i]:.9g}" for values in columns.values()]
        rows.append(",".join([*map(str, numbers), *cells]))
    return "\n".join(rows) + "\n"
