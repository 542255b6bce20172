"""Rigid-body errors of a three-carriage machine: scale, squareness, straightness, rotation (VDI/VDE 2617-3).

A rotation of a carriage acts on all that it carries, so its lever arm comes from the machine's chain.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.physics.effect import Effect, Parameter, along
from cmm_uq.physics.kinematics import Chain, carried_offset
from cmm_uq.points import AXES, Floats, Points
from cmm_uq.units import ARCSECOND, METRE, MICROMETRE, PPM


class Scale(Effect):
    """Linear scale error: e_a = s · a."""

    coefficients = (Parameter("ppm", "ppm", 300.0),)

    def __init__(self, axis: str) -> None:
        self.axis = axis
        self.name = f"scale_{axis}"
        self.title = f"Scale error of {axis.upper()}"

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        """See :meth:`Effect.basis`."""
        return along(self.axis, PPM * points.readings[:, AXES.index(self.axis)])


class Squareness(Effect):
    """Squareness of two axes: xy: e_x = −S·y; yz: e_y = −S·z; zx: e_x = −S·z."""

    coefficients = (Parameter("angle_arcsec", "″", 500.0),)

    def __init__(self, plane: str, moved: str, lever: str) -> None:
        self.moved, self.lever = moved, lever
        self.name = f"squareness_{plane}"
        self.title = f"Squareness {plane[0].upper()}–{plane[1].upper()}"

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        """See :meth:`Effect.basis`."""
        return along(self.moved, -ARCSECOND * points.readings[:, AXES.index(self.lever)])


class Straightness(Effect):
    """Straightness of carriage a along b as one bow: e_b = bow · (1 − (2(a − a0)/T − 1)²), T the travel from a0."""

    coefficients = (Parameter("bow_um", "µm", 50.0),)

    def __init__(self, axis: str, direction: str) -> None:
        self.axis, self.direction = axis, direction
        self.name = f"straightness_{axis}_{direction}"
        self.title = f"Straightness of {axis.upper()} along {direction.upper()}"

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        """See :meth:`Effect.basis`."""
        low, high = points.machine.travel(self.axis)
        place = 2 * (points.readings[:, AXES.index(self.axis)] - low) / (high - low) - 1
        return along(self.direction, MICROMETRE * (1 - place**2))


class Rotation(Effect):
    """Carriage a turns about b in proportion to its travel, ε = r·(a − a0): roll, pitch or yaw."""

    coefficients = (Parameter("arcsec_per_m", "″/m", 60.0),)

    def __init__(self, axis: str, about: str) -> None:
        self.axis, self.about = axis, about
        self.name = f"rotation_{axis}_{about}"
        self.title = f"Rotation of carriage {axis.upper()} about {about.upper()}"

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        """See :meth:`Effect.basis`."""
        low, _ = points.machine.travel(self.axis)
        angle = ARCSECOND * (points.readings[:, AXES.index(self.axis)] - low) / METRE
        return turned(points, self.axis, self.about, angle)


def turned(points: Points, axis: str, about: str, angle: Floats) -> Floats:
    """Basis (n, 3, 1) of carriage ``axis`` turning about ``about`` by ``angle`` (n,) rad: ε × what it carries."""
    chain = Chain.of(points.machine.chain)
    tip = np.column_stack([points.columns.get(f"tip_{a}_mm", np.zeros(len(points))) for a in AXES])
    acts_on_tip = points.machine.tip_on_every_carriage or axis == AXES[chain.order[-1]]
    carried = carried_offset(axis, points.readings, tip if acts_on_tip else None, chain)
    rotation = np.zeros((len(points), 3))
    rotation[:, AXES.index(about)] = angle
    return np.cross(rotation, carried)[:, :, None]


EFFECTS: tuple[Effect, ...] = (
    *(Scale(a) for a in AXES),
    Squareness("xy", "x", "y"),
    Squareness("yz", "y", "z"),
    Squareness("zx", "x", "z"),
    *(Straightness(a, b) for a in AXES for b in AXES if a != b),
    *(Rotation(a, b) for a in AXES for b in AXES),
)
