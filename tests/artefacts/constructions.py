"""Recordings of artefacts without any error, built from their definition alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from cmm_uq.artefacts import artefact_of
from cmm_uq.base.points import Floats, Ints, Machine, Points
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.maths.inference.linear_model import LeastSquares
from tests.recordings import TRAVEL

MACHINE = Machine("test machine", "XYZ", TRAVEL)
MIDDLE = TRAVEL.mean(axis=1)

DIAGONALS = ((1, 1, 1), (-1, 1, 1), (1, -1, 1), (-1, -1, 1))
SEVEN_LINES = ((1, 0, 0), (0, 1, 0), (0, 0, 1), *DIAGONALS)
SEVEN_PLACES = ((0, 90, -80), (80, 0, -60), (-120, 70, 0), (60, -40, 30), (-50, 30, 20), (30, 60, -40), (-20, -50, 60))
"""Middles of the seven lines about the middle of the volume, mm: through one point, rotations would look like bows."""

GAUGE_FACES = np.arange(0.0, 421.0, 20.0)


def recording(xyz: Floats, measurement: Ints, point: Ints, **columns: Floats) -> Points:
    n = len(xyz)
    return Points(xyz, measurement, point, np.ones(n, dtype=np.int64), MACHINE, columns, np.arange(2, n + 2))


def step_gauge(
    lines: Sequence[Sequence[float]] = SEVEN_LINES, faces: Floats = GAUGE_FACES, *, both_sides: bool = False
) -> Points:
    """Faces along lines through the volume, met travelling outwards, and where wanted again on the way back."""
    sense = np.repeat([1.0, -1.0] if both_sides else [1.0], len(faces))
    reference = np.tile(faces, 2 if both_sides else 1)
    xyz, approach = [], []
    for line, place in zip(lines, SEVEN_PLACES, strict=False):
        u = np.array(line) / np.linalg.norm(line)
        xyz.append(MIDDLE + np.array(place) + (reference - faces.mean())[:, None] * u)
        approach.append(sense[:, None] * np.sign(np.round(u, 9)))
    count, travel = len(reference), np.vstack(approach)
    return recording(
        np.vstack(xyz), np.repeat(np.arange(1, len(lines) + 1), count),
        np.tile(np.arange(1, count + 1), len(lines)), reference_mm=np.tile(reference, len(lines)),
        approach_x=travel[:, 0], approach_y=travel[:, 1], approach_z=travel[:, 2],
    )  # fmt: skip


def hemisphere(count: int = 25) -> Floats:
    """Directions spread evenly over the upper half of a sphere (spiral), pole included."""
    z = 1 - np.arange(count) / count
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    flat = np.sqrt(1 - z**2)
    return np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])


def spheres(places: int = 4, diameter: float = 25.0, *, normals: bool = True) -> Points:
    """Twenty-five points of a ball in several places."""
    n = np.tile(hemisphere(), (places, 1))
    centres = MIDDLE + np.random.default_rng(places).uniform(-200, 200, (places, 3))
    xyz = np.repeat(centres, 25, axis=0) + 0.5 * diameter * n
    columns = {"nx": n[:, 0], "ny": n[:, 1], "nz": n[:, 2]} if normals else {}
    return recording(xyz, np.repeat(np.arange(1, places + 1), 25), np.tile(np.arange(1, 26), places), **columns)


TILTS = ((0.0, 0.0, 0.0), (90.0, 0.0, 20.0), (35.0, -50.0, 10.0))


def rings(heights: tuple[float, ...] = (0.0,), *, count: int = 24, normals: bool = True, places: int = 3) -> Points:
    """Rings of 50 mm that lie flat, stand, and stand askew, with points around at some heights."""
    turn = 2 * np.pi * (np.arange(count) + 0.3) / count
    out = np.tile(np.column_stack([np.cos(turn), np.sin(turn), np.zeros(count)]), (len(heights), 1))
    body = 25.0 * out + np.repeat(heights, count)[:, None] * [0.0, 0.0, 1.0]
    ways = [Rotation.from_euler("xyz", angles, degrees=True) for angles in TILTS[:places]]
    xyz = np.vstack([MIDDLE + np.array([30.0, -80.0, 20.0]) * i + way.apply(body) for i, way in enumerate(ways)])
    n = -np.vstack([way.apply(out) for way in ways])
    columns = {f"n{a}": n[:, i] for i, a in enumerate("xyz")} if normals else {}
    return recording(
        xyz, np.repeat(np.arange(places) + 1, len(out)), np.tile(np.arange(len(out)) + 1, places), **columns
    )


FLAT = (0.0, 0.0, 0.0)
FOUR_ATTITUDES = (FLAT, (90.0, 0.0, 0.0), (0.0, -90.0, 0.0), (45.0, 10.0, 5.0))


def plate(attitudes: Sequence[Sequence[float]] = FOUR_ATTITUDES, pitch: float = 100.0, side: int = 5) -> Points:
    """A square plate of balls in several attitudes (turned about x, y, z in degrees) near the middle of the volume."""
    steps = pitch * np.arange(side)
    reference = np.array([[x, y, 0.0] for x in steps for y in steps])
    xyz = [
        MIDDLE + 10.0 * i + Rotation.from_euler("xyz", angles, degrees=True).apply(reference - reference.mean(axis=0))
        for i, angles in enumerate(attitudes)
    ]
    count, places = side**2, len(attitudes)
    x, y, z = np.tile(reference, (places, 1)).T
    return recording(
        np.vstack(xyz), np.repeat(np.arange(1, places + 1), count), np.tile(np.arange(1, count + 1), places),
        reference_x_mm=x, reference_y_mm=y, reference_z_mm=z,
    )  # fmt: skip


def leaning(arcsec: Sequence[float]) -> Floats:
    """Unit vectors of the axes as rows that enclose 90° plus these: their scalar products are minus the sines."""
    xy, yz, zx = -np.sin(np.radians(np.array(arcsec) / 3600))
    return np.linalg.cholesky(np.array([[1, xy, zx], [xy, 1, yz], [zx, yz, 1]]))


def model(facts: ArtefactFacts, points: Points, names: Sequence[str], sigma: float | None = 1e-3) -> RecordingModel:
    return RecordingModel(artefact_of(facts, points), effects(names), sigma)


def indicated(
    facts: ArtefactFacts, points: Points, names: Sequence[str], values: Sequence[float], *, size: float | None = None,
    sigma: float = 0.0, seed: int = 0,
) -> Points:  # fmt: skip
    """The same places as a machine with these errors indicates them."""
    truth = model(facts, points, names)
    sizes = np.array([s.nominal if size is None else size for s in truth.artefact.sizes])
    random = np.random.default_rng(seed)
    return points.at(truth.simulate(np.array(values), sizes, Noise(coordinate=sigma), random))


def estimated(facts: ArtefactFacts, points: Points, names: Sequence[str], sigma: float | None = 1e-3) -> LeastSquares:
    return model(facts, points, names, sigma).estimate().least_squares


def free(found: LeastSquares) -> list[dict[str, float]]:
    """The combinations that a recording leaves open, as ``{effect: part}`` with only what takes part."""
    return [
        {unknown.key[0]: float(part) for unknown, part in zip(found.unknowns, column, strict=True) if part}
        for column in found.null_space.T
    ]


def swept(count: int = 60, length: float = 400.0, *, everywhere: bool = False, seed: int = 3) -> Points:
    """The free ball of a swept bar: over the upper half of its sphere, or where wanted all around the fixed ball."""
    direction = np.random.default_rng(seed).standard_normal((count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    if not everywhere:
        direction[:, 2] = np.abs(direction[:, 2])
    fixed = MIDDLE - [0, 0, 0 if everywhere else 230]
    return recording(fixed + length * direction, np.arange(1, count + 1), np.ones(count, dtype=np.int64))
