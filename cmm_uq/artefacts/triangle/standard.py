"""Triangle standard of gauge blocks and cylinders (Manlay, *Fast checking of CMM geometry with a patented tool*).

A block touches a cylinder at each end, so a side between two cylinder axes is the block and two radii. Angles follow by the
cosine rule; their uncertainty by Monte Carlo from the dimensions of blocks and cylinders.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cmm_uq.artefacts.triangle.kind import TriangleFacts
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE

DIMENSIONS = ("block_12", "block_23", "block_31", "cylinder_1", "cylinder_2", "cylinder_3")

SIDES_OF_DIMENSIONS = np.array([[1, 0, 0, 0.5, 0.5, 0], [0, 1, 0, 0, 0.5, 0.5], [0, 0, 1, 0.5, 0, 0.5]])
"""Sides 1–2, 2–3, 3–1 for the six dimensions."""

DRAWS = 100_000


@dataclass(frozen=True, eq=False)
class TriangleGeometry:
    """Sides 1–2, 2–3, 3–1 (mm), angles at 1, 2, 3 (rad) and height over the side 1–2 (mm), each (..., ) of a set of draws."""

    sides: Floats
    angles: Floats
    height: Floats


@dataclass(frozen=True, eq=False)
class TriangleStandard:
    """The dimensions of a triangle, mm, each (6,) in the order of :data:`DIMENSIONS`."""

    dimensions: Floats
    u: Floats

    def __post_init__(self) -> None:
        sides = self.sides
        if 2 * sides.max() >= sides.sum():
            said = ", ".join(f"{side:.6g}" for side in sides)
            raise CmmUqError(
                f"sides of {said} mm do not close to a triangle: the longest is not shorter than the other two together",
                where="job.toml [artefact] blocks_mm, cylinders_mm", fix="Mend the dimensions of blocks and cylinders",
            )  # fmt: skip

    @classmethod
    def of(cls, facts: TriangleFacts) -> TriangleStandard:
        dimensions = np.array([*facts.blocks_mm, *facts.cylinders_mm], dtype=np.float64)
        u = MICROMETRE * np.repeat([facts.u_blocks_um, facts.u_cylinders_um], 3)
        return cls(dimensions, u)

    @property
    def sides(self) -> Floats:
        """(3,) between cylinder axes, mm."""
        return np.asarray(SIDES_OF_DIMENSIONS @ self.dimensions, dtype=np.float64)

    def figures(self) -> TriangleGeometry:
        return figures_of(self.sides)

    def draws(self, seed: int, count: int = DRAWS) -> TriangleGeometry:
        """The same of normal draws of the dimensions (JCGM 101:2008, 7)."""
        random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(6,)))
        dimensions = self.dimensions + self.u * random.standard_normal((count, len(DIMENSIONS)))
        return figures_of(dimensions @ SIDES_OF_DIMENSIONS.T)


def figures_of(sides: Floats) -> TriangleGeometry:
    """Angles by the cosine rule, and height, of sides (..., 3)."""
    c, a, b = np.moveaxis(sides, -1, 0)

    def angle(opposite: Floats, one: Floats, other: Floats) -> Floats:
        return np.asarray(np.arccos((one**2 + other**2 - opposite**2) / (2 * one * other)), dtype=np.float64)

    angles = np.stack([angle(a, b, c), angle(b, c, a), angle(c, a, b)], axis=-1)
    return TriangleGeometry(sides, angles, np.asarray(b * np.sin(angles[..., 0]), dtype=np.float64))


def corners(sides: Floats) -> Floats:
    """Corners (3, 3) in the triangle's axes, mm: 1 at the origin, 2 along x, 3 on the side of y."""
    c, a, b = sides
    x = (b**2 + c**2 - a**2) / (2 * c)
    return np.array([[0, 0, 0], [c, 0, 0], [x, np.sqrt(b**2 - x**2), 0]])


def corner_changes(sides: Floats) -> Floats:
    """Change of the corners (3, 3, 6) for one mm of each dimension."""
    c, _, b = sides
    x, y, _ = corners(sides)[2]
    change = np.zeros((3, 3, 3))
    change[1, 0] = [1, 0, 0]
    change[2, 0] = [1 - x / c, -sides[1] / c, b / c]
    change[2, 1] = ([0, 0, b] - x * change[2, 0]) / y
    return np.asarray(change @ SIDES_OF_DIMENSIONS, dtype=np.float64)
