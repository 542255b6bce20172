"""Writes the simulated example jobs: each artefact on a machine whose errors are stated in the job's remarks.

Run:  python benchmarks/examples/simulated_jobs.py [FOLDER]

The recordings come from the model that the package fits, with the seed below; two runs write the same bytes.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from cmm_uq.artefacts import artefact_facts, artefact_of
from cmm_uq.artefacts.digitizer import THREE, scan
from cmm_uq.artefacts.triangle import TriangleStandard, placed_triangle
from cmm_uq.base.points import Floats, Ints, Machine, Points
from cmm_uq.base.rotary import RotaryMachine
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.model.artefact import Size
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.machine.physics.digitizer import euler_313

SEED = 20260101
TRAVEL = np.array([[0.0, 900.0], [0.0, 1200.0], [-600.0, 0.0]])
MIDDLE = TRAVEL.mean(axis=1)
MACHINE = Machine("Simulated bridge machine", "XYZ", TRAVEL)

SQUARE = {"squareness_xy": 12.0, "squareness_yz": -7.5, "squareness_zx": 4.0}
SCALE = {"scale_x": 9.0, "scale_y": -6.0, "scale_z": 14.0}


@dataclass(frozen=True, eq=False)
class Simulated:
    """One example.

    Parameters
    ----------
    id, title : of the job, and what was measured.
    artefact : lines of its table in job.toml, and the same as facts.
    points : where the artefact stood.
    truth : the effects that act, each with its parameters in order.
    named : the effects that the job names.
    noise_um : of one coordinate.
    size : true size of the artefact, mm; its certified one by default.
    sizes : true sizes by name, where it has several; others are drawn from what the job states of them.
    extra, model, recording : further lines of job.toml, and of its tables of these names.
    before : effects of an earlier recording, which is written too; then what is told is the change.
    columns : of the CSV beside measurement, point, repeat and coordinates.
    """

    id: str
    title: str
    artefact: Mapping[str, object]
    points: Points
    truth: Mapping[str, float | Sequence[float]]
    named: Sequence[str]
    noise_um: float
    size: float | None = None
    sizes: Mapping[str, float] = field(default_factory=dict)
    extra: str = ""
    model: str = ""
    recording: str = ""
    before: Mapping[str, float | Sequence[float]] | None = None
    columns: Sequence[str] = ()
    machine: str = ""


LENGTH = {"expansion": "at 20 °C", "temperature": "at 20 °C", "alignment": "in line", "fixturing": "undistorted"}
FORM = {"form": "perfectly round"}


def _negligible(artefact: str, lines: Mapping[str, str]) -> str:
    """Tables that declare what of the test uncertainty the simulation leaves out."""
    verb = "were" if artefact.endswith("s") else "was"
    rows = [f'{line} = {{ by = "the simulation", reason = "the {artefact} {verb} simulated {how}" }}'
            for line, how in lines.items()]  # fmt: skip
    rated = 'declared = { by = "the simulation", reason = "the machine was simulated at 20 °C" }'
    return "\n".join(["", "[test_uncertainty.negligible]", *rows, "", "[rated_conditions]", rated, ""])


def recording(xyz: Floats, measurement: Ints, point: Ints, repeat: Ints | None = None, **columns: Floats) -> Points:
    repeats = np.ones(len(xyz), dtype=np.int64) if repeat is None else repeat
    return Points(xyz, measurement, point, repeats, MACHINE, columns)


def step_gauge() -> Simulated:
    """Seven lines of ISO 10360-2, five lengths and the way back, three times."""
    faces, lines = np.array([0.0, 140, 280, 420, 560, 700, 820]), []
    diagonals = [np.array([x, y, 1.0]) * (TRAVEL[:, 1] - TRAVEL[:, 0]) for x in (1, -1) for y in (1, -1)]
    for number, u in enumerate([*diagonals, *np.eye(3)], 1):
        u = u / np.linalg.norm(u)
        own = faces[faces <= 560] if number == 7 else faces
        reference = np.tile(np.concatenate([own, own[::-1]]), 3)
        sense = np.tile(np.repeat([1.0, -1.0], len(own)), 3)
        place = MIDDLE + (reference - own.max() / 2)[:, None] * u
        travel = np.where(np.abs(u) > 0.1, np.sign(u), 0)
        count = 2 * len(own)
        lines.append((place, np.full(3 * count, number), np.tile(np.arange(1, count + 1), 3), np.repeat([1, 2, 3], count),
                      reference, sense[:, None] * travel))  # fmt: skip
    xyz, measurement, point, repeat, reference, approach = (np.concatenate(part) for part in zip(*lines, strict=True))
    points = recording(xyz, measurement, point, repeat, reference_mm=reference,
                       approach_x=approach[:, 0], approach_y=approach[:, 1], approach_z=approach[:, 2])  # fmt: skip
    hysteresis = {"hysteresis_x": 1.8, "hysteresis_y": -0.9, "hysteresis_z": 1.2}
    return Simulated(
        "step-gauge-simulated", "ISO 10360-2, seven positions of a step gauge, faces met outwards and on the way back, "
        "three times", {"kind": "step_gauge", "name": "Step gauge, 820 mm", "u_um": 0.4, "cte_per_k": 11.5e-6}, points,
        {**SCALE, **SQUARE, **hysteresis}, [*SCALE, *SQUARE, *hysteresis], 0.6,
        extra=_negligible("gauge", LENGTH)
        + '\n[[conformity]]\nstandard = "ISO 10360-2:2009"\nmpe = { a_um = 4.0, k = 100.0 }\n',
        columns=("reference_mm", "approach_x", "approach_y", "approach_z"),
    )  # fmt: skip


def gauge_blocks() -> Simulated:
    """Four blocks along X and along Y, each in the middle of the axis, both faces three times."""
    lengths, parts = (100.0, 250.0, 500.0, 800.0), []
    for number, (axis, length) in enumerate([(a, length) for a in (0, 1) for length in lengths], 1):
        u = np.eye(3)[axis]
        reference = np.tile([0.0, length], 3)
        parts.append((MIDDLE + (reference - length / 2)[:, None] * u, np.full(6, number), np.tile([1, 2], 3),
                      np.repeat([1, 2, 3], 2), reference, np.tile([1.0, -1.0], 3)[:, None] * u))  # fmt: skip
    xyz, measurement, point, repeat, reference, approach = (np.concatenate(part) for part in zip(*parts, strict=True))
    points = recording(xyz, measurement, point, repeat, reference_mm=reference, approach_x=approach[:, 0],
                       approach_y=approach[:, 1], approach_z=approach[:, 2],
                       nx=-approach[:, 0], ny=-approach[:, 1], nz=-approach[:, 2])  # fmt: skip
    truth = {"scale_x": 9.0, "scale_y": -6.0, "probe_radius": 0.7}
    return Simulated(
        "gauge-blocks-simulated", "Four gauge blocks along X and along Y, outer faces, three times",
        {"kind": "gauge_blocks", "name": "Gauge blocks, grade K", "u_um": 0.15, "cte_per_k": 11.5e-6}, points, truth,
        list(truth), 0.3,
        extra=_negligible("blocks", LENGTH) + '\n[[conformity]]\nstandard = "VDI/VDE 2617"\nmpe = { a_um = 3.0, k = 80.0 }\n',
        columns=("reference_mm", "approach_x", "approach_y", "approach_z", "nx", "ny", "nz"),
    )  # fmt: skip


def sphere() -> Simulated:
    """Three times twenty-five points over the upper half of a ceramic ball."""
    z = 1 - np.arange(25) / 25
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(25)
    flat = np.sqrt(1 - z**2)
    n = np.tile(np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z]).round(6), (3, 1))
    centres = MIDDLE + np.array([[0, 0, 0], [250, -300, 120], [-250, 300, -120]])
    points = recording(np.repeat(centres, 25, axis=0) + 12.5 * n / np.linalg.norm(n, axis=1, keepdims=True),
                       np.repeat([1, 2, 3], 25), np.tile(np.arange(1, 26), 3),
                       nx=n[:, 0], ny=n[:, 1], nz=n[:, 2])  # fmt: skip
    truth = {"probe_radius": 0.8, "probe_lobing": (0.9, 0.4)}
    return Simulated(
        "sphere-simulated", "ISO 10360-5, 25 points of a sphere in three places",
        {"kind": "sphere", "name": "Ceramic sphere, 25 mm", "length_mm": 25.0012, "u_um": 0.1, "form_um": 0.1}, points,
        truth, list(truth), 0.35,
        extra=_negligible("sphere", FORM)
        + '\n[[conformity]]\nstandard = "ISO 10360-5:2010"\nlimit_um = 5.0\n', columns=("nx", "ny", "nz"),
    )  # fmt: skip


def ring() -> Simulated:
    """A setting ring flat in two places and turned between them, upright in a third; 25 points around, twice each."""
    turn = 2 * np.pi * (np.arange(25) + 0.5) / 25
    out = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(25)])
    ways = (Rotation.identity(), Rotation.identity(), Rotation.from_euler("x", 90, degrees=True))
    places = MIDDLE + np.array([[0, 0, 0], [220, -260, 90], [-200, 240, -80]])
    parts = [(place + 25.0 * way.apply(out), -way.apply(out).round(6)) for place, way in zip(places, ways, strict=True)]
    n = np.vstack([np.tile(each, (2, 1)) for _, each in parts])
    points = recording(
        np.vstack([np.tile(xyz, (2, 1)) for xyz, _ in parts]), np.repeat([1, 2, 3], 50), np.tile(np.arange(1, 26), 6),
        np.tile(np.repeat([1, 2], 25), 3), nx=n[:, 0], ny=n[:, 1], nz=n[:, 2], turned_deg=np.repeat([0.0, 90.0, 0.0], 50),
        temp_artefact_c=np.full(150, 20.0),
    )  # fmt: skip
    truth = {"probe_radius": 0.7, "probe_lobing": (0.5, 0.3), "squareness_xy": 9.0}
    return Simulated(
        "ring-simulated", "Setting ring of 50 mm in three places, 25 points around",
        {"kind": "ring", "name": "Setting ring", "length_mm": 50.0013, "u_um": 0.2, "form_um": 0.2, "cte_per_k": 1.1e-5},
        points, truth, list(truth), 0.35,
        extra=_negligible("ring", FORM)
        + '\n[[conformity]]\nstandard = "laboratory\'s own rule"\ncharacteristic = "roundness"\n'
        "limit_um = 6.0\ncomplete = { measurements = 3, repeats = 2, points = 25 }\n",
        columns=("nx", "ny", "nz", "turned_deg", "temp_artefact_c"),
    )  # fmt: skip


def plate() -> Simulated:
    """A plate of 5 × 5 balls flat on the table, and upright along X."""
    steps = 100.0 * np.arange(5)
    reference = np.array([[x, y, 0.0] for y in steps for x in steps])
    attitudes = (Rotation.identity(), Rotation.from_euler("xz", (90, 0.4), degrees=True))
    xyz = np.vstack([MIDDLE + turn.apply(reference - 200 * np.array([1, 1, 0])) for turn in attitudes])
    x, y, z = np.tile(reference, (2, 1)).T
    points = recording(xyz, np.repeat([1, 2], 25), np.tile(np.arange(1, 26), 2),
                       reference_x_mm=x, reference_y_mm=y, reference_z_mm=z)  # fmt: skip
    truth = {**SCALE, "squareness_xy": 12.0, "squareness_zx": 4.0, "straightness_x_y": 3.5}
    return Simulated(
        "plate-simulated", "Ball plate of 25 balls, flat and upright", {"kind": "plate", "name": "Ball plate, 400 mm × 400 mm",
        "u_um": 0.5, "cte_per_k": 11.5e-6}, points, truth, list(truth), 0.7,
        columns=("reference_x_mm", "reference_y_mm", "reference_z_mm"),
    )  # fmt: skip


def plate_two_dates() -> Simulated:
    """The plate of a year ago and of today, flat and upright; its balls are not where their nominal positions say."""
    points = plate().points
    astray = np.tile(np.random.default_rng(SEED).normal(0, 5e-3, (25, 3)), (2, 1))
    columns = {f"reference_{a}_mm": points.columns[f"reference_{a}_mm"] + astray[:, i] for i, a in enumerate("xyz")}
    before = {"scale_x": 9.0, "scale_y": -6.0, "squareness_xy": 12.0, "straightness_x_y": 30.0}
    return Simulated(
        "plate-two-dates-simulated", "The same ball plate in the same two places at two dates",
        {"kind": "plate", "name": "Ball plate, 400 mm × 400 mm, not certified", "cte_per_k": 11.5e-6},
        replace(points, columns=columns), before | {"scale_x": 14.0, "squareness_xy": 9.0}, list(before), 0.5,
        before=before, recording='earlier = "earlier.csv"\nearlier_date = 2025-01-01\n',
    )  # fmt: skip


def bryan() -> Simulated:
    """A bar swept over the upper half of its sphere; its length is not certified."""
    z = (np.arange(48) + 0.5) / 48
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(48)
    flat = np.sqrt(1 - z**2)
    xyz = MIDDLE - [0, 0, 220] + 400 * np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])
    truth = {**SCALE, **SQUARE}
    return Simulated(
        "bryan-simulated", "Bryan gauge swept over 48 positions; length of the bar not certified",
        {"kind": "bryan", "name": "Swept bar, about 400 mm"}, recording(xyz, np.arange(1, 49), np.ones(48, dtype=np.int64)),
        truth, list(truth), 1.0, size=400.0132,
    )  # fmt: skip


def axis_runs() -> Simulated:
    """Position, straightnesses and rotations along three lines; five runs of position each way, one of all others.

    The roll of Z, which a level cannot show, is not read.
    """
    parts: list[dict[str, Floats]] = []
    for axis in range(3):
        low, high = TRAVEL[axis]
        there = np.linspace(low + 0.05 * (high - low), high - 0.05 * (high - low), 7)
        for sense in range(5 if axis == 2 else 6):
            repeats = 5 if sense == axis else 1
            at, way = np.concatenate([there, there[::-1]]), np.repeat([1.0, -1.0], len(there))
            n = repeats * len(at)
            xyz, columns = np.tile(MIDDLE, (n, 1)), {}
            xyz[:, axis] = np.tile(at, repeats)
            for i, letter in enumerate("xyz"):
                columns[f"approach_{letter}"] = np.tile(way, repeats) * (i == axis)
                columns[f"read_{letter}"] = np.full(n, float(sense == i))
                columns[f"turn_{letter}"] = np.full(n, float(sense == 3 + i))
            numbers = {"measurement": np.full(n, 6 * axis + sense + 1), "point": np.tile(np.arange(1, len(at) + 1), repeats),
                       "repeat": np.repeat(np.arange(1, repeats + 1), len(at))}  # fmt: skip
            parts.append({"xyz": xyz, **numbers, "reading_um": np.zeros(n), "reading_arcsec": np.zeros(n), **columns})
    whole = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    xyz, *numbers = (whole.pop(name) for name in ("xyz", "measurement", "point", "repeat"))
    truth = {
        **SCALE, "hysteresis_x": 3.0, "hysteresis_y": -1.5, "straightness_x_y": 5.0, "straightness_y_z": -4.0,
        "rotation_x_z": 6.0, "rotation_y_x": -4.0, "rotation_z_y": 5.0,
    }  # fmt: skip
    return Simulated(
        "axis-runs-simulated", "Position, straightness and rotation of three axes by laser interferometer, there and back",
        {"kind": "axis_runs", "name": "Laser interferometer", "u_scale_um_per_m": 0.3, "optics_mm": [0.0, 0.0, -120.0]},
        recording(xyz, *numbers, **whole), truth, list(truth), 0.2, columns=tuple(whole),
        extra=CONFORMITY_OF_RUNS,
    )  # fmt: skip


def multilateration() -> Simulated:
    """Four stations, two of them again with the reflector on other arms, which show the roll, pitch and yaw of Z."""
    steps = [np.linspace(low + 45.0, high - 45.0, count) for (low, high), count in zip(TRAVEL, (4, 4, 3), strict=True)]
    targets = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)
    low, beside, behind, raised = ((-150, -150, -700), (1050, -150, -700), (-150, 1350, -700), (1050, 1350, -250))
    down, along_x, along_y = ((0, 0, -120), (150, 0, -300), (0, 150, -300))
    set_ups = ((low, down), (beside, down), (behind, down), (raised, down), (low, along_x), (raised, along_y))
    count, tips = len(targets), np.repeat(np.array([tip for _, tip in set_ups], dtype=np.float64), len(targets), axis=0)
    xyz, measurement = np.tile(targets, (len(set_ups), 1)), np.repeat(np.arange(len(set_ups)) + 1, count)
    away = xyz + tips - np.repeat([place for place, _ in set_ups], count, axis=0)
    distance = np.linalg.norm(away, axis=1)
    zero = distance.reshape(len(set_ups), -1).min(axis=1).round()  # of each station, its dead path
    columns = {f"tip_{a}_mm": tips[:, i] for i, a in enumerate("xyz")} | {
        "reading_mm": distance - np.repeat(zero, count)
    }
    curves = {"straightness_x_y": 5.0, "straightness_x_z": -3.0, "straightness_y_x": 2.0, "straightness_y_z": -4.0,
              "straightness_z_x": 3.0, "straightness_z_y": -2.5}  # fmt: skip
    turns = {"rotation_x_x": 4.0, "rotation_x_y": -3.0, "rotation_x_z": 6.0, "rotation_y_x": -4.0, "rotation_y_y": 2.5,
             "rotation_y_z": 3.0, "rotation_z_x": -5.0, "rotation_z_y": 5.0, "rotation_z_z": 8.0}  # fmt: skip
    truth = {**SCALE, **SQUARE, **curves, **turns}
    return Simulated(
        "multilateration-simulated", "Distances from four places of a tracking interferometer to a reflector on three arms",
        {"kind": "multilateration", "name": "Tracking interferometer", "u_scale_um_per_m": 0.2},
        recording(xyz, measurement, np.tile(np.arange(count) + 1, len(set_ups)), **columns), truth, list(truth), 0.4,
        columns=tuple(columns), model="tolerances = { squareness_xy = 10.0, squareness_yz = 10.0 }\n",
    )  # fmt: skip


def circles() -> Simulated:
    """Circles in three planes, both senses, and runs along both legs of a square in the plane of X and Y."""
    angle = np.radians(np.arange(0, 360, 5))
    angle, way = np.concatenate([angle, angle[::-1]]), np.repeat([1.0, -1.0], len(angle))
    parts: list[tuple[Floats, Floats, Floats]] = []  # places, what is read, travel
    for axis in range(3):
        u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
        outward = np.outer(np.cos(angle), u) + np.outer(np.sin(angle), v)
        tangent = np.outer(np.cos(angle), v) - np.outer(np.sin(angle), u)
        parts.append((MIDDLE + 150 * outward, outward, way[:, None] * tangent))
    there = np.tile(np.concatenate([np.linspace(-250, 250, 6), np.linspace(250, -250, 6)]), 2)
    sense = np.tile(np.repeat([1.0, -1.0], 6), 2)
    for u, v in (np.eye(3)[[0, 1]], np.eye(3)[[1, 0]]):
        parts.append((MIDDLE + np.outer(there, u), np.tile(v, (24, 1)), np.outer(sense, u)))
    xyz, read, travel = (np.vstack(each).round(6) for each in zip(*parts, strict=True))
    count = [len(part[0]) for part in parts]
    numbers = [np.repeat(np.arange(1, 6), count), np.concatenate([*(np.arange(1, 145),) * 3, *(np.arange(1, 13),) * 4])]
    repeats = np.concatenate([np.ones(3 * 144, dtype=np.int64), np.tile(np.repeat([1, 2], 12), 2)])
    columns = {
        f"{name}_{a}": of[:, i] for name, of in (("read", read), ("approach", travel)) for i, a in enumerate("xyz")
    }
    columns = {n: np.sign(c.round(3)) if n.startswith("approach") else c for n, c in columns.items()}
    columns |= {f"turn_{a}": np.zeros(len(xyz)) for a in "xyz"}
    columns |= {"reading_um": np.zeros(len(xyz)), "square": np.repeat([0.0, 1.0], [3 * 144, 48])}
    truth = {**SCALE, **SQUARE, "hysteresis_x": 3.0, "hysteresis_y": -1.5}
    return Simulated(
        "circles-simulated", "Circles in three planes by telescoping ballbar, and runs along the legs of a square",
        {"kind": "axis_runs", "name": "Telescoping ballbar, 150 mm, and granite square", "u_bar_um": 0.4,
         "square_arcsec": 0.8, "u_square_arcsec": 0.3}, recording(xyz, *numbers, repeats, **columns), truth, list(truth), 0.3,
        columns=tuple(columns), extra=CONFORMITY_OF_CIRCLES,
    )  # fmt: skip


CONFORMITY_OF_CIRCLES = """
[test_uncertainty]
u_repeat_um = 0.1

[test_uncertainty.negligible]
temperature = { by = "Laboratory", reason = "simulated at 20 °C" }
alignment = { by = "Laboratory", reason = "the bar turns about its own centre" }

[rated_conditions]
declared = { by = "the simulation", reason = "the machine was simulated at 20 °C" }

[[conformity]]
standard = "ISO 230-4:1996"
characteristic = "G"
limit_um = 20.0
rule = "ISO 14253-1"

[[conformity]]
standard = "ISO 230-4:1996"
characteristic = "H"
limit_um = 4.0
rule = "ISO 14253-1"
"""
CONFORMITY_OF_RUNS = """
[test_uncertainty]
u_alignment_um = 0.2
u_repeat_um = 0.1

[test_uncertainty.negligible]
temperature = { by = "Laboratory", reason = "simulated at 20 °C" }

[[conformity]]
standard = "ISO 230-2:2014"
characteristic = "A"
limit_um = 20.0
rule = "ISO 14253-1"

[[conformity]]
standard = "ISO 230-2:2014"
characteristic = "B"
limit_um = 2.5
rule = "ISO 14253-1"
"""


def triangle() -> Simulated:
    """Seven placings of a triangle with sides of 500, 300 and 400 mm on a machine whose Y carriage carries the others."""
    artefact = {"kind": "triangle", "name": "Triangle of gauge blocks and cylinders", "cte_per_k": 11.5e-6,
                "blocks_mm": [480.0, 280.0, 380.0], "u_blocks_um": 0.1, "cylinders_mm": [20.0, 20.0, 20.0],
                "u_cylinders_um": 0.1}  # fmt: skip
    machine = replace(MACHINE, chain="YXZ")
    standard = TriangleStandard.of(artefact_facts(**artefact))
    rotations = {
        "rotation_x_x": 4.0, "rotation_x_y": -3.0, "rotation_x_z": 2.0, "rotation_y_x": 1.5, "rotation_y_y": -2.5,
        "rotation_y_z": 3.0, "rotation_z_x": -4.0, "rotation_z_y": 2.0, "rotation_z_z": 5.0,
    }  # fmt: skip
    truth = {**SCALE, **SQUARE, **rotations}
    tolerances = ", ".join(f"{name} = {8 if name in SQUARE else 12}" for name in truth)
    return Simulated(
        "triangle-simulated", "Triangle standard in seven placings, three times", artefact,
        placed_triangle(machine, standard.sides, repeats=3), truth, list(truth), 0.3,
        model=f"tolerances = {{ {tolerances} }}\n", columns=("tip_x_mm", "tip_y_mm", "tip_z_mm"),
    )  # fmt: skip


def plane() -> Simulated:
    """A granite surface plate probed at 7 × 5 points from above, twice, with the direction point before each."""
    x, y = np.meshgrid(np.linspace(60, 840, 7), np.linspace(100, 1100, 5))
    touched = np.column_stack([x.ravel(), y.ravel(), np.full(35, -560.0) + 2e-5 * x.ravel()])
    ahead = touched[:1] + np.array([0, 0, 8.0])
    xyz = np.vstack([ahead, touched, ahead, touched])
    truth = {"straightness_x_z": 4.0, "straightness_y_z": -2.5}
    return Simulated(
        "plane-simulated", "Surface plate probed from above at 35 points, twice",
        {"kind": "plane", "name": "Granite surface plate, 1000 mm × 800 mm", "probe_offset_mm": 1.9986,
         "u_probe_offset_um": 0.3},
        recording(xyz, np.repeat([1, 2], 36), np.tile(np.arange(36), 2)), truth, list(truth), 0.4,
    )  # fmt: skip


def digitizer() -> Simulated:
    """A digitizer scans a reference sphere in the source's three attitudes, twice each; the machine moves along w."""
    offset, centre, radius, parts = np.array([1.001, 264.505, 129.575]), MIDDLE + np.array([-150, -120, -180]), 12.7, []
    for number, angles in enumerate(THREE, 1):
        seen, moved = scan(euler_313(*np.radians(angles)), offset, radius)
        count = 2 * len(seen)
        parts.append((np.tile(centre + moved, (2, 1)), np.full(count, number), np.tile(np.arange(1, len(seen) + 1), 2),
                      np.repeat([1, 2], len(seen)), np.tile(angles, (count, 1)), np.tile(seen.round(4), (2, 1))))  # fmt: skip
    xyz, measurement, point, repeat, angles, seen = (np.concatenate(part) for part in zip(*parts, strict=True))
    names = ("alpha_deg", "beta_deg", "gamma_deg", "u_mm", "v_mm")
    columns = dict(zip(names, np.column_stack([angles, seen]).T, strict=True))
    return Simulated(
        "digitizer-simulated", "Reference sphere scanned by a laser digitizer in three attitudes, twice each",
        {"kind": "digitizer", "name": "Laser digitizer on a trunnion", "length_mm": 25.4, "u_um": 0.3,
         "offset_mm": [1.0, 264.5, 129.6], "u_attitude_arcsec": 2.0, "u_centre_um": [1.0, 1.0, 1.0]},
        recording(xyz, measurement, point, repeat, **columns), {}, [], 9.0,
        sizes=dict(zip(("U1_mm", "V1_mm", "W1_mm"), offset.tolist(), strict=True)), columns=names,
    )  # fmt: skip


def table_spheres() -> Simulated:
    """Spheres A and B on a table that turns out over 720° and back, with an encoder beside its axis and play."""
    out = np.linspace(0, 720, 8)
    angle, n = np.concatenate([out, out[-2::-1]]), 15
    sphere = np.array([[180.0, 60.0, 40.0], [-180.0, -60.0, 240.0]])
    axis = np.array([450.0, 600.0, -400.0])
    points = replace(
        recording(np.tile(sphere, (n, 1)), np.ones(2 * n, dtype=np.int64), np.tile([1, 2], n), np.repeat(np.arange(n) + 1, 2),
                  c_deg=np.repeat(angle, 2), c_approach=np.repeat([0.0, 1.0, -1.0], [2, 14, 14])),
        machine=RotaryMachine(MACHINE.name, "XYZ", MACHINE.travel_mm, axis),
    )  # fmt: skip
    truth: dict[str, float | Sequence[float]] = {
        "rotary_location_c_x": 1.5, "rotary_location_c_y": -0.8, "rotary_tilt_c_x": 1.2, "rotary_tilt_c_y": 0.5,
        "rotary_positioning_c_1": (1.6, 0.9), "rotary_play_c": 1.0,
    }  # fmt: skip
    stated = "".join(
        f'\n[[conformity]]\nstandard = "ISO 10360-3:2000"\ncharacteristic = "{figure}"\nlimit_um = {limit}\n'
        for figure, limit in (("FR", 8.0), ("FT", 12.0), ("FA", 5.0))
    )
    return Simulated(
        "table-spheres-simulated", "ISO 10360-3, two spheres on a turning table",
        {"kind": "table_spheres", "name": "Spheres A and B, 25 mm"}, points, truth, list(truth), 0.3,
        extra=_negligible("spheres", {"repeat": "at one place on the table"}) + stated, columns=("c_deg", "c_approach"),
        machine=f"origin_mm = {axis.tolist()}\ntable = {{ travel_deg = [-10.0, 730.0] }}\n",
    )  # fmt: skip


EXAMPLES = (
    step_gauge, gauge_blocks, sphere, ring, plate, plate_two_dates, bryan, axis_runs, circles, multilateration, triangle,
    plane, digitizer, table_spheres,
)  # fmt: skip


def write(example: Simulated, folder: Path) -> None:
    """The job folder of one example."""
    random = np.random.default_rng([SEED, *example.id.encode()])
    place = folder / example.id
    place.mkdir(parents=True, exist_ok=True)
    artefact = artefact_of(artefact_facts(**example.artefact), example.points)
    sizes = np.array([_true_size(example, size, random) for size in artefact.sizes])
    for name, truth in (("recording.csv", example.truth), ("earlier.csv", example.before)):
        if truth is None:
            continue
        model = RecordingModel(artefact, effects(list(truth)))
        xyz = model.simulate(_coefficients(truth), sizes, Noise(coordinate=example.noise_um * 1e-3), random)
        read = artefact.recorded(example.points, xyz)
        (place / name).write_text(_csv(example, read), encoding="utf-8", newline="\n")
    (place / "job.toml").write_text(_toml(example), encoding="utf-8", newline="\n")


def _true_size(example: Simulated, size: Size, random: np.random.Generator) -> float:
    if size.role == "set-up":
        return float(random.normal(size.nominal, size.sd))
    return example.size or example.sizes.get(size.name, size.nominal)


def _coefficients(truth: Mapping[str, float | Sequence[float]]) -> Floats:
    return np.concatenate([np.zeros(0), *(np.atleast_1d(np.asarray(v, dtype=np.float64)) for v in truth.values())])


def _csv(example: Simulated, points: Points) -> str:
    rows = [",".join(["measurement", "point", "repeat", "x_mm", "y_mm", "z_mm", *example.columns])]
    for i in range(len(points)):
        cells = [points.measurement[i], points.point[i], points.repeat[i], *(f"{value:.5f}" for value in points.xyz[i])]
        cells += [f"{points.columns[name][i]:{_DIGITS.get(name, '.10g')}}" for name in example.columns]
        rows.append(",".join(map(str, cells)))
    return "\n".join(rows) + "\n"


_DIGITS = {"reading_um": ".3f", "reading_arcsec": ".3f", "reading_mm": ".5f"}  # an instrument's display


def _toml(example: Simulated) -> str:
    said = []
    for effect in effects(list(example.truth)):
        given = np.atleast_1d(np.asarray(example.truth[effect.name], dtype=np.float64))
        if example.before is not None:
            given = given - example.before[effect.name]
        said += [f"{effect.name} {c.name} = {value:g}" for c, value in zip(effect.coefficients, given, strict=True)]
    what = "True errors" if example.before is None else "True changes between the dates"
    size = f"; true length of the bar {example.size} mm" if example.size else ""
    sought = "; ".join(f"{name.removesuffix('_mm')} = {value:g} mm" for name, value in example.sizes.items())
    artefact = "\n".join(f"{key} = {_value(value)}" for key, value in example.artefact.items())
    names = ", ".join(f'"{name}"' for name in example.named)
    return f"""\
# Simulated with benchmarks/examples/simulated_jobs.py, seed {SEED}: no machine was measured.

[job]
id = "{example.id}"
date = 2026-01-01
origin = "simulated"
procedure = "{example.title}"
remarks = \"\"\"
Simulated, no machine was measured. {f"{what}: {'; '.join(said)}" if said else f"Truth: {sought}"}{size}; \\
noise of a coordinate {example.noise_um:g} µm.\"\"\"

[machine]
name = "{MACHINE.name}"
chain = "{example.points.machine.chain}{"|C" if isinstance(example.points.machine, RotaryMachine) else ""}"
travel_mm = {{ x = [0, 900], y = [0, 1200], z = [-600, 0] }}
{example.machine}
[artefact]
{artefact}

[recording]
file = "recording.csv"
{example.recording}
[model]
effects = [{names}]
{example.model}{example.extra}"""


def _value(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else repr(value)


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[2] / "examples"
    for make in EXAMPLES:
        write(make(), target)
