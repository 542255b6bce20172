"""Recordings of artefacts that are wrong themselves, or of machines that are, from equations written out here.

Nothing but the container of points comes from the package. Noise of 1 µm, every set-up measured twice.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from cmm_uq.base.points import Machine, Points

TRAVEL = np.array([[0.0, 900.0], [0.0, 600.0], [-500.0, 0.0]])
MACHINE = Machine("simulated", "XYZ", TRAVEL)
SECOND = np.pi / 648000
SIGMA = 1e-3
"""mm."""

LIES, TURNED, STANDS, OVER = (0, 0, 0), (0, 0, 90), (90, 0, 0), (180, 0, 0)
LINES = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 0, 1), (1, 1, 1), (1, -1, 1))


@dataclass(frozen=True)
class SetUps:
    """Set-ups of a rigid artefact: places (N, 3), mm, its rotations and where its middle stands."""

    places: np.ndarray
    turns: tuple[Rotation, ...]
    middles: np.ndarray

    def true(self, deviations: np.ndarray) -> np.ndarray:
        """Where the points truly are, set-up by set-up, (q·N, 3), mm; deviations (q, N, 3) or (N, 3) in own axes, µm."""
        each = np.broadcast_to(deviations, (len(self.turns), *self.places.shape))
        shapes = self.places + 1e-3 * each
        return np.vstack([m + t.apply(s) for m, t, s in zip(self.middles, self.turns, shapes, strict=True)])


def plate(random: np.random.Generator, attitudes: tuple[tuple[int, int, int], ...], side: int = 4) -> SetUps:
    """A square plate of holes 110 mm apart, within 40 mm of the middle of the volume."""
    steps = 110.0 * (np.arange(side) - 0.5 * (side - 1))
    places = np.array([[x, y, 0.0] for x in steps for y in steps])
    turns = tuple(Rotation.from_euler("xyz", angles, degrees=True) for angles in attitudes)
    return SetUps(places, turns, TRAVEL.mean(axis=1) + random.uniform(-40, 40, (len(attitudes), 3)))


def triangle(random: np.random.Generator, attitudes: tuple[tuple[int, int, int], ...]) -> SetUps:
    """Three cylinders 300, 400 and 500 mm apart."""
    places = np.array([[0.0, 0.0, 0.0], [300.0, 0.0, 0.0], [0.0, 400.0, 0.0]])
    places -= places.mean(axis=0)
    turns = tuple(Rotation.from_euler("xyz", angles, degrees=True) for angles in attitudes)
    return SetUps(places, turns, TRAVEL.mean(axis=1) + random.uniform(-40, 40, (len(attitudes), 3)))


def gauge(random: np.random.Generator) -> SetUps:
    """Eight faces up to 420 mm on seven lines."""
    faces = np.concatenate([[0.0], np.sort(random.choice(np.arange(1, 21) * 20.0, 6, replace=False)), [420.0]])
    turns = tuple(Rotation.align_vectors([np.array(line) / np.linalg.norm(line)], [[1.0, 0, 0]])[0] for line in LINES)
    places = np.column_stack([faces - faces.mean(), np.zeros((len(faces), 2))])
    return SetUps(places, turns, TRAVEL.mean(axis=1) + random.uniform(-60, 60, (len(LINES), 3)))


def bars(random: np.random.Generator, count: int = 30, length: float = 400.0) -> SetUps:
    """A bar in random places and directions."""
    places = np.array([[-0.5 * length, 0.0, 0.0], [0.5 * length, 0.0, 0.0]])
    directions = random.standard_normal((count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    half = 0.5 * length * np.abs(directions)
    low, high = TRAVEL[:, 0] + half, TRAVEL[:, 1] - half
    middles = low + random.random((count, 3)) * (high - low)
    turns = tuple(Rotation.align_vectors([d], [[1.0, 0, 0]])[0] for d in directions)
    return SetUps(places, turns, middles)


def recorded(
    random: np.random.Generator, set_ups: SetUps, deviations: np.ndarray, machine: str | None = None, size: float = 0.0
) -> Points:
    """Indicated points of two repeats, with one error of the machine, if any, of this size."""
    true, (count, n) = set_ups.true(deviations), (len(set_ups.turns), len(set_ups.places))
    one = true - error(true, machine, size)
    xyz = np.vstack([one, one]) + random.normal(0, SIGMA, (2 * len(one), 3))
    measurement = np.tile(np.repeat(np.arange(1, count + 1), n), 2)
    point = np.tile(np.arange(1, n + 1), 2 * count)
    repeat = np.repeat([1, 2], count * n)
    return Points(xyz, measurement, point, repeat, MACHINE, {}, np.arange(2, len(xyz) + 2))


def error(true: np.ndarray, machine: str | None, size: float) -> np.ndarray:
    """e (n, 3), mm, of the machine: true = indicated + e."""
    e, (x, y, z) = np.zeros_like(true), true.T
    if machine == "rotation_x_z":
        e[:, 0] = -y * size * SECOND * x / 1000
    elif machine == "straightness_x_y":
        e[:, 1] = 1e-3 * size * (1 - (2 * x / 900 - 1) ** 2)
    elif machine == "squareness_yz":
        e[:, 1] = -size * SECOND * z
    return e


def like_a_yaw(places: np.ndarray, size: float) -> np.ndarray:
    """Holes (N, 3), µm, drilled by a machine whose carriage X yaws by ``size`` ″/m."""
    d = np.zeros_like(places)
    d[:, 0] = -1e3 * (places[:, 1] + 300) * size * SECOND * (places[:, 0] + 450) / 1000
    return d


def bowed(places: np.ndarray, size: float) -> np.ndarray:
    """A plate (N, 3), µm, whose own Y is bowed by ``size`` over its length along X."""
    d, half = np.zeros_like(places), np.abs(places[:, 0]).max()
    d[:, 1] = size * (1 - (places[:, 0] / half) ** 2)
    return d


def twisted(places: np.ndarray, size: float) -> np.ndarray:
    """A plate (N, 3), µm, one corner of which is ``size`` too high, and its neighbours too low."""
    d, half = np.zeros_like(places), np.abs(places).max()
    d[:, 2] = size * places[:, 0] * places[:, 1] / half**2
    return d
