"""What new jobs begin with that no plan makes: a plate that is shifted and turned, error maps, tests of arms and robots."""

from __future__ import annotations

import numpy as np

from cmm_uq.base.points import AXES, Floats, Machine, Points
from cmm_uq.machine.model.kind import Beginning, circumstances
from cmm_uq.machine.physics.error_map import COLUMNS

SIDE, PITCH = 3, 150.0  # balls along a side of the plate, and their distance, mm

# shift of the plate's middle along x and y, mm, and turn, °: enough to part the plate from the machine
PLACINGS = ((0.0, 0.0, 0.0), (150.0, 0.0, 0.0), (0.0, 150.0, 0.0), (0.0, 0.0, 90.0))


def placed_plate(machine: Machine) -> Points:
    """A square plate of balls about the middle of the plane xy, in every placing."""
    steps = PITCH * (np.arange(SIDE) - 0.5 * (SIDE - 1))
    balls = np.column_stack([part.ravel() for part in np.meshgrid(steps, steps)])
    middle = np.array([np.mean(machine.travel(axis)) for axis in AXES]) - machine.origin_mm
    parts = []
    for dx, dy, degrees in PLACINGS:
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        flat = balls @ np.array([[c, s], [-s, c]]) + [dx - 25.0, dy - 25.0]
        parts.append(np.column_stack([flat, np.zeros(len(flat))]) + middle)
    count, n = len(balls), len(balls) * len(PLACINGS)
    measurement, point = np.repeat(np.arange(n // count) + 1, count), np.tile(np.arange(count) + 1, n // count)
    return Points(np.vstack(parts), measurement, point, np.ones(n, dtype=np.int64), machine)


SHIFT_PLATE = Beginning(
    title="Self-calibration of a plane by shifting and turning an uncalibrated plate",
    numbering="One measurement is one placing of the plate; its points are the balls.",
    artefact={
        "name": "Ball plate, uncalibrated but for its diagonal",
        "plane": "xy",
        "known": {"from": 1, "to": SIDE**2, "length_mm": round(PITCH * (SIDE - 1) * 2**0.5, 4), "u_um": 0.5},
    },
    effects=(),
    points=placed_plate,
)

TEMPERATURES = (20.0, 25.0, 30.0)
EXPANSION_UM_PER_M_K = 8.0  # of the scales, so that the maps differ by temperature alone
STEPS, NOISE = 20, 0.2  # steps over each axis, and standard deviation of every figure, µm or ″


def maps(machine: Machine) -> dict[str, bytes]:
    random, files = np.random.default_rng(1), {}
    for temperature in TEMPERATURES:
        lines = ["# simulated by cmm-uq new: put in the maps of your machine", f"axis,position_mm,{','.join(COLUMNS)}"]
        for axis in AXES:
            low, high = machine.travel(axis)
            for position in np.linspace(low, high, STEPS + 1):
                figures = random.normal(0.0, NOISE, len(COLUMNS)) * (position != low)
                grown = EXPANSION_UM_PER_M_K * (temperature - 20.0) * (position - low) / 1000.0
                figures[AXES.index(axis)] += grown
                lines.append(",".join((axis, f"{position:g}", *(f"{figure:.2f}" for figure in figures))))
        files[f"error_map_{temperature:g}C.csv"] = ("\n".join(lines) + "\n").encode()
    return files


BEGINNING = Beginning(
    title="Error maps of a machine at several temperatures",
    numbering="There is no recording: each map is a file under [machine] error_map.",
    effects=("thermal_scale_x", "thermal_scale_y", "thermal_scale_z"),
    files=maps,
    command="diagnose",
    machine={"error_map": [{"file": f"error_map_{t:g}C.csv", "temperature_c": t} for t in TEMPERATURES]},
)


REACH = 1250.0
_ARM = {"name": "Articulated arm", "arm": {"reach_mm": REACH}}
_ISO, _ASME = ({"standard": name, "rule": "ISO 14253-1"} for name in ("ISO 10360-12:2016", "ASME B89.4.22-2004"))
_BALL = {"name": "Test sphere", "length_mm": 25.0, "u_um": 0.2, "form_um": 0.2}
_OF_LENGTHS = circumstances(u_cte_per_k=1e-6, u_temperature_k=0.2, u_alignment_um=0.2, u_fixturing_um=0.5)


def _points(machine: Machine, *, xyz: Floats, of: Floats, **columns: Floats) -> Points:
    """Rows at 20 °C; ``of`` (n, 3) measurement, point and repeat."""
    measurement, point, repeat = np.asarray(of, dtype=np.int64).T
    return Points(xyz, measurement, point, repeat, machine, {"temp_artefact_c": np.full(len(xyz), 20.0), **columns})


def _seats(machine: Machine) -> Points:
    """Ten readings in each of three seats: near the base, in the middle of the reach, and far out."""
    seats = REACH * np.array([[0.1, 0.05, 0.1], [0.4, 0.2, 0.2], [0.7, 0.5, 0.1]])
    of = np.array([(seat, 1, reading) for seat in (1, 2, 3) for reading in range(1, 11)], dtype=np.float64)
    return _points(machine, xyz=np.repeat(seats, 10, axis=0), of=of)


def _ball(machine: Machine, *, orientations: int, rings: tuple[tuple[float, int, float], ...]) -> Points:
    """Rings of a hemisphere (polar angle and first azimuth, °; how many) in two places, in orientations about the pole."""
    places = REACH * np.array([[0.3, 0.2, 0.1], [0.6, -0.4, 0.2]])
    xyz, of, normals = [], [], []
    for place, middle in enumerate(places, 1):
        for turn in range(orientations):
            each = [
                (polar, first + 14.4 * turn + 360 / count * i) for polar, count, first in rings for i in range(count)
            ]
            for point, (polar, azimuth) in enumerate(np.radians(each), 1):
                out = np.array([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)])
                normals.append(out)
                xyz.append(middle + 12.5 * out)
                of.append((place, point, turn + 1))
    named = dict(zip(("nx", "ny", "nz"), np.array(normals).T, strict=True))
    return _points(machine, xyz=np.array(xyz), of=np.array(of, dtype=np.float64), **named)


def _lines(machine: Machine) -> Points:
    """Six faces, met in turn from either side, three times on each of seven lines about the base."""
    faces, xyz, of, reference, senses = np.array([0.0, 330.0, 660.0, 990.0, 1320.0, 1650.0]), [], [], [], []
    for line, along in enumerate(
        np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1], [1, 1, 1.0]]), 1
    ):
        u, across = along / np.linalg.norm(along), np.cross(along, [0.3, 0.5, 0.8])
        start = 400.0 * across / np.linalg.norm(across) - 825.0 * u
        for repeat in (1, 2, 3):
            xyz += [*(start + np.outer(faces, u))]
            of += [(line, face, repeat) for face in range(1, 7)]
            reference += [*faces]
            senses += [np.sign(np.round(u, 9)) * (-1) ** (face > 0) for face in range(6)]
    approach = dict(zip((f"approach_{axis}" for axis in AXES), np.array(senses).T, strict=True))
    whole = np.array(of, dtype=np.float64)
    return _points(machine, xyz=np.array(xyz), of=whole, reference_mm=np.array(reference), **approach)


def _cycles(machine: Machine) -> Points:
    """Five poses of a robot thirty times: the middle and the corners of a plane inside a cube of 500 mm."""
    corners = np.array([[0, 0, 0], [1, 1, 1], [-1, 1, 1], [-1, -1, -1], [1, -1, -1.0]])
    poses = np.array([900.0, 0.0, 700.0]) + 200.0 * corners
    of = np.array([(1, pose, cycle) for cycle in range(1, 31) for pose in range(1, 6)], dtype=np.float64)
    xyz = np.tile(poses, (30, 1))
    seen = dict(zip((f"reference_{axis}_mm" for axis in AXES), xyz.T, strict=True))
    return _points(machine, xyz=xyz, of=of, **seen)


SEATS = Beginning(
    title="Articulated arm, one seat reached again and again (ASME B89.4.22)",
    numbering="One measurement is one seat, point 1; repeat counts the readings, the arm bent otherwise each time.",
    artefact={"name": "Conical seat"},
    effects=(),
    noise_um=10.0,
    points=_seats,
    machine=_ARM,
    conformity={**_ASME, "characteristic": "SPAT", "limit_um": 60.0},
    test=circumstances(u_repeat_um=2.0),
)
_RINGS = ((0.0, 1, 0.0), (22.5, 4, 0.0), (45.0, 8, 22.5), (67.5, 4, 0.0), (90.0, 8, 22.5))
ARM_SPHERE = Beginning(
    title="Articulated arm, twenty-five points on a sphere in two places (ISO 10360-12)",
    numbering="One measurement is one place of the sphere; its points are the points probed.",
    artefact=_BALL,
    effects=("probe_radius",),
    noise_um=10.0,
    machine=_ARM,
    points=lambda machine: _ball(machine, orientations=1, rings=_RINGS),
    test=circumstances(u_form_um=0.02),
    conformity={**_ISO, "characteristic": "P_Form", "limit_um": 80.0},
)
ARM_ORIENTATIONS = Beginning(
    title="Articulated arm, a sphere in five orientations in two places (ISO 10360-12)",
    numbering="One measurement is one place of the sphere; repeat counts the orientations of the arm, of five points each.",
    artefact=_BALL,
    effects=("probe_radius",),
    noise_um=10.0,
    machine=_ARM,
    points=lambda machine: _ball(machine, orientations=5, rings=((0.0, 1, 0.0), (90.0, 4, 0.0))),
    conformity={**_ISO, "characteristic": "L_Dia", "limit_um": 120.0},
    test=circumstances(u_repeat_um=0.5),
)
ARM_LENGTHS = Beginning(
    title="Articulated arm, lengths on seven lines (ISO 10360-12)",
    numbering="One measurement is one line; its points are the faces, the first met one way and the others the other way.",
    artefact={"name": "Step gauge", "u_um": "0.3 + L/1000", "cte_per_k": 11.5e-6},
    effects=(),
    noise_um=10.0,
    machine=_ARM,
    points=_lines,
    conformity={**_ISO, "characteristic": "E_Bi", "limit_um": 80.0},
    test=_OF_LENGTHS,
    columns={"reference_mm": ""},
)
ROBOT_POSES = Beginning(
    title="Robot, five poses commanded thirty times and seen by a laser tracker (ISO 9283)",
    numbering="One measurement is one station of the tracker; its points are the poses, repeat counts the cycles.",
    artefact={"name": "Laser tracker", "u_um": 15.0, "frame": "base"},
    effects=(),
    noise_um=30.0,
    points=_cycles,
    machine={"name": "Robot", "arm": {"reach_mm": 1500.0}},
    test=circumstances(u_repeat_um=10.0),
    conformity={"standard": "ISO 9283:1998", "characteristic": "RP", "limit_um": 250.0, "rule": "ISO 14253-1"},
    columns={
        f"reference_{axis}_mm": f"Place of the reflector along {axis}, by the reference instrument." for axis in AXES
    },
    further={
        f"{of}_{angle}_deg": f"{what} angle {angle} about {axis} of the base; a, b, c turn in this order."
        for of, what in (("commanded", "Commanded"), ("reference", "Measured"))
        for angle, axis in zip("abc", AXES, strict=True)
    },
)
