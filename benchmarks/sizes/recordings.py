"""Recordings of any size, as jobs: bars, points on spheres, plates; drawn from known errors with white noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from cmm_uq.artefacts import artefact_facts, artefact_of
from cmm_uq.base.points import Floats, Ints, Machine, Points
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.physics.catalogue import effects

TRAVEL = np.array([[0.0, 900.0], [0.0, 1200.0], [-600.0, 0.0]])
MIDDLE = TRAVEL.mean(axis=1)
MACHINE = Machine("Simulated bridge machine", "XYZ", TRAVEL)
SCALES = {"scale_x": 9.0, "scale_y": -6.0, "scale_z": 14.0}
SQUARE = {"squareness_xy": 12.0, "squareness_yz": -7.5, "squareness_zx": 4.0}
PROBE = {"probe_radius": 0.8}
NOISE_UM = 0.5


@dataclass(frozen=True, eq=False)
class Recorded:
    """What stands in a job: lines of ``[artefact]``, nominal points, and the errors that act, all but some of them named."""

    artefact: dict[str, object]
    points: Points
    truth: dict[str, float]
    left_out: tuple[str, ...] = ()


def bars(count: int, repeats: int = 1, *, timed: bool = False) -> Recorded:
    """A ballbar of 300 mm in ``count`` places of all directions, each measured ``repeats`` times."""
    random = np.random.default_rng(count)
    middle = random.uniform(TRAVEL[:, 0] + 160, TRAVEL[:, 1] - 160, (count, 3))
    half = 150 * _directions(count, random)
    ends = np.stack([middle - half, middle + half], axis=1)
    xyz = np.repeat(ends, repeats, axis=0).reshape(-1, 3)
    columns = {"time_s": 10.0 * np.repeat(np.arange(count * repeats), 2)} if timed else {}
    return Recorded(
        {"kind": "ballbar", "length_mm": 300.0, "u_um": 0.5},
        _points(xyz, np.repeat(np.arange(1, count + 1), 2 * repeats), np.tile([1, 2], count * repeats),
                np.tile(np.repeat(np.arange(1, repeats + 1), 2), count), columns),
        SCALES | SQUARE,
    )  # fmt: skip


def spheres(placings: int, count: int) -> Recorded:
    """``count`` points over the upper half of a sphere of 25 mm in each of several placings."""
    z = 1 - np.arange(count) / count
    turn, flat = np.pi * (3 - np.sqrt(5)) * np.arange(count), np.sqrt(1 - z**2)
    normals = np.tile(np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z]), (placings, 1))
    random = np.random.default_rng(placings)
    centres = random.uniform(TRAVEL[:, 0] + 50, TRAVEL[:, 1] - 50, (placings, 3))
    columns = {f"n{axis}": normals[:, i] for i, axis in enumerate("xyz")}
    return Recorded(
        {"kind": "sphere", "length_mm": 25.0012, "u_um": 0.1},
        _points(np.repeat(centres, count, axis=0) + 12.5 * normals, np.repeat(np.arange(1, placings + 1), count),
                np.tile(np.arange(1, count + 1), placings), None, columns),
        PROBE,
    )  # fmt: skip


def plates(placings: int, side: int, repeats: int = 1) -> Recorded:
    """A plate of ``side`` × ``side`` balls, 400 mm, in each of several placings."""
    steps = np.linspace(-200, 200, side)
    body = np.array([[x, y, 0.0] for y in steps for x in steps])
    random = np.random.default_rng(placings)
    attitudes = [Rotation.from_euler("xz", angles, degrees=True) for angles in ((0, 0), (90, 0.4), (90, 90.4))]
    centres = random.uniform(-60, 60, (placings, 3)) + MIDDLE
    each = [np.tile(centre + attitudes[i % 3].apply(body), (repeats, 1)) for i, centre in enumerate(centres)]
    n = len(body) * repeats
    reference = np.tile(body, (placings * repeats, 1))
    return Recorded(
        {"kind": "plate", "u_um": 0.5},
        _points(np.vstack(each), np.repeat(np.arange(1, placings + 1), n),
                np.tile(np.arange(1, len(body) + 1), placings * repeats),
                np.tile(np.repeat(np.arange(1, repeats + 1), len(body)), placings),
                {f"reference_{axis}_mm": reference[:, i] for i, axis in enumerate("xyz")}),
        SCALES | SQUARE,
    )  # fmt: skip


CASES: dict[str, Callable[[], Recorded]] = {
    "20 bars": lambda: bars(20),
    "5 000 bars": lambda: bars(5000),
    "5 000 bars with their times": lambda: bars(5000, timed=True),
    "50 000 bars, 100 000 rows": lambda: bars(50_000),
    "5 000 bars, a squareness left out": lambda: replace(bars(5000), left_out=("squareness_xy",)),
    "1 000 bars, 5 times": lambda: bars(1000, 5),
    "2 bars, 10 000 times": lambda: bars(2, 10_000),
    "sphere, 3 × 4 000 points": lambda: spheres(3, 4000),
    "sphere, 4 × 25 000 points": lambda: spheres(4, 25_000),
    "sphere, 4 × 25 000 points, a straightness left out": lambda: replace(
        spheres(4, 25_000), truth=PROBE | {"straightness_x_y": 3.0}, left_out=("straightness_x_y",)
    ),
    "sphere, 500 × 25 points": lambda: spheres(500, 25),
    "plate, 6 × 400 balls": lambda: plates(6, 20),
    "plate, 3 × 11 025 balls": lambda: plates(3, 105),
    "plate, 99 × 25 balls": lambda: plates(99, 5),
    "plate, 4 000 × 25 balls": lambda: plates(4000, 5),
}
"""By name."""


def write(recorded: Recorded, folder: Path, seed: int = 1) -> Path:
    """A job folder, its recording drawn with a white noise of :data:`NOISE_UM`."""
    artefact = artefact_of(artefact_facts(**recorded.artefact), recorded.points)
    model = RecordingModel(artefact, effects(list(recorded.truth)))
    sizes = np.array([size.nominal for size in artefact.sizes])
    coefficients = np.array(list(recorded.truth.values()))
    xyz = model.simulate(coefficients, sizes, Noise(NOISE_UM * 1e-3), np.random.default_rng(seed))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "recording.csv").write_text(_csv(recorded.points, xyz), encoding="utf-8")
    (folder / "job.toml").write_text(_toml(recorded, folder.name), encoding="utf-8")
    return folder


def _directions(count: int, random: np.random.Generator) -> Floats:
    some = random.standard_normal((count, 3))
    return np.asarray(some / np.linalg.norm(some, axis=1, keepdims=True))


def _points(
    xyz: Floats, measurement: Ints, point: Ints, repeat: Ints | None, columns: dict[str, Floats]
) -> Points:  # fmt: skip
    return Points(xyz, measurement, point, np.ones_like(point) if repeat is None else repeat, MACHINE, columns)


def _csv(points: Points, xyz: Floats) -> str:
    names = ["measurement", "point", "repeat", "x_mm", "y_mm", "z_mm", *points.columns]
    whole = zip(points.measurement.tolist(), points.point.tolist(), points.repeat.tolist(), strict=True)
    others = np.column_stack([xyz, *points.columns.values()]).tolist()
    rows = (f"{m},{p},{r}," + ",".join(f"{v:.7g}" if i > 2 else f"{v:.5f}" for i, v in enumerate(other))
            for (m, p, r), other in zip(whole, others, strict=True))  # fmt: skip
    return "\n".join([",".join(names), *rows]) + "\n"


def _toml(recorded: Recorded, name: str) -> str:
    table = "\n".join(f"{key} = {_value(value)}" for key, value in recorded.artefact.items())
    named = ", ".join(f'"{effect}"' for effect in recorded.truth if effect not in recorded.left_out)
    return f"""[job]
id = "{name}"
date = 2026-01-01
origin = "simulated"

[machine]
name = "{MACHINE.name}"
chain = "XYZ"
travel_mm = {{ x = [0, 900], y = [0, 1200], z = [-600, 0] }}

[artefact]
{table}

[recording]
file = "recording.csv"

[model]
effects = [{named}]
"""


def _value(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else repr(value)
