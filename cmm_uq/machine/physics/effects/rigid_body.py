"""Rigid-body errors of a three-carriage machine: scale, squareness, straightness, rotation (VDI/VDE 2617-3).

A rotation of a carriage acts on all that it carries, so its lever arm comes from the machine's chain.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import ARCSECOND, METRE, MICROMETRE, PPM, unit
from cmm_uq.machine.physics.effect import Amount, Effect, Nonparametric, Parameter, along
from cmm_uq.machine.physics.kinematics import KinematicChain, carried_offset

# of each plane the axis along which a point moves, and the one that leans, by whose reading it moves
LEANING = MappingProxyType({"xy": ("x", "y"), "yz": ("y", "z"), "zx": ("x", "z")})


class Scale(Effect):
    """Linear scale error."""

    formula = "e_a = s · a"
    mechanism = "scale"
    points_to = say("the scale or its compensation: check the linear compensation of this axis")
    everywhere = True

    coefficients = (Parameter("ppm", unit("ppm"), 300.0),)

    def __init__(self, axis: str) -> None:
        self.axis = self.along_motion = axis
        self.name = f"scale_{axis}"
        self.title = say("Scale error of {axis}", axis=Verbatim(axis.upper()))
        self.imitated_by = (Nonparametric(f"{axis}_mm", axis), Nonparametric("time_s", axis, scale=True))

    def meaning(self, amounts: Mapping[str, Amount]) -> Text:
        amount = amounts[self.coefficients[0].name]
        return say(
            "lengths along {axis} are indicated {size} too {wrong}",
            axis=Verbatim(self.axis.upper()), size=amount.size, wrong=amount.more(say("short"), say("long")),
        )  # fmt: skip

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return along(self.axis, PPM * points.readings[self.axis])


class Lean(Effect):
    """The angle between two axes less 90°, or what changes it: to first order, one axis leans by it across its reading."""

    mechanism = "frame"

    def __init__(self, plane: str) -> None:
        self.plane = plane
        self.moved, self.lever = LEANING[plane]

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return along(self.moved, -self.lean(points) * points.readings[self.lever])


class Squareness(Lean):
    """Squareness of two axes: their angle less 90°."""

    formula = "xy: e_x = −S·y; yz: e_y = −S·z; zx: e_x = −S·z"
    points_to = say("the axes are not square: adjust the guideways or the squareness in the compensation")
    everywhere = True

    coefficients = (Parameter("angle_arcsec", unit("″"), 500.0),)

    def __init__(self, plane: str) -> None:
        super().__init__(plane)
        self.name = f"squareness_{plane}"
        self.title = say("Squareness {plane}", plane=Verbatim("–".join(plane.upper())))
        self.imitated_by = (Nonparametric(f"{self.lever}_mm", self.moved),)

    def meaning(self, amounts: Mapping[str, Amount]) -> Text:
        amount = amounts[self.coefficients[0].name]
        return say(
            "the angle between {one} and {other} is 90° {side} {size}",
            one=Verbatim(self.moved.upper()), other=Verbatim(self.lever.upper()), side=amount.side, size=amount.size,
        )  # fmt: skip

    def lean(self, points: Points) -> Floats:
        return np.array(ARCSECOND)


class Straightness(Effect):
    """Straightness of carriage a along b as one bow over the travel T from a0."""

    formula = "e_b = bow · (1 − (2(a − a0)/T − 1)²)"
    mechanism = "guideway"
    points_to = say("a bowed guideway: check straightness and its compensation")

    coefficients = (Parameter("bow_um", unit("µm"), 50.0),)

    def __init__(self, axis: str, direction: str) -> None:
        self.axis, self.direction = axis, direction
        self.name = f"straightness_{axis}_{direction}"
        self.title = say(
            "Straightness of {axis} along {direction}",
            axis=Verbatim(axis.upper()),
            direction=Verbatim(direction.upper()),
        )
        self.idealised_over = axis
        self.imitated_by = (Nonparametric(f"{axis}_mm", direction),)

    def meaning(self, amounts: Mapping[str, Amount]) -> Text:
        amount = amounts[self.coefficients[0].name]
        return say(
            "as {axis} moves, the probe runs in a bow: in the middle of the travel {size} towards {side} "
            "{direction}",
            axis=Verbatim(self.axis.upper()), size=amount.size, side=amount.side, direction=Verbatim(self.direction.upper()),
        )  # fmt: skip

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        low, high = points.machine.travel(self.axis)
        place = 2 * (points.readings[self.axis] - low) / (high - low) - 1
        return along(self.direction, MICROMETRE * (1 - place**2))


class Rotation(Effect):
    """Carriage a turns about b in proportion to its travel from a0: roll, pitch or yaw."""

    formula = "e = ε × what carriage a carries, ε_b = r·(a − a0)"
    mechanism = "guideway"
    points_to = say(
        "the carriage turns as it moves (roll, pitch or yaw): check bearings, guideway and angular compensation"
    )

    coefficients = (Parameter("arcsec_per_m", unit("″/m"), 60.0),)

    def __init__(self, axis: str, about: str) -> None:
        self.axis, self.about = axis, about
        self.name = f"rotation_{axis}_{about}"
        self.title = say(
            "Rotation of carriage {axis} about {about}", axis=Verbatim(axis.upper()), about=Verbatim(about.upper())
        )
        self.idealised_over = axis

    def meaning(self, amounts: Mapping[str, Amount]) -> Text:
        amount = amounts[self.coefficients[0].name]
        return say(
            "as {axis} moves towards plus, the probe turns {sense} by {size}, seen along plus {about}",
            axis=Verbatim(self.axis.upper()), size=amount.size,
            sense=amount.more(say("clockwise"), say("anticlockwise")), about=Verbatim(self.about.upper()),
        )  # fmt: skip

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        low, _ = points.machine.travel(self.axis)
        angle = ARCSECOND * (points.readings[self.axis] - low) / METRE
        return turned(points, self.axis, self.about, angle)


def turned(points: Points, axis: str, about: str, angle: Floats) -> Floats:
    """Basis (n, 3, 1) of carriage ``axis`` turning about ``about`` by ``angle`` (n,) rad: ε × what it carries."""
    chain = KinematicChain.of(points.machine.chain)
    acts_on_tip = points.machine.tip_on_every_carriage or axis == AXES[chain.order[-1]]
    carried = carried_offset(
        axis, points.carriages, tip_offsets(points) if acts_on_tip else None, chain, points.directions
    )
    rotation = np.zeros((len(points), 3))
    rotation[:, AXES.index(about)] = angle
    return np.cross(rotation, carried)[:, :, None]


def tip_offsets(points: Points) -> Floats:
    """Of each point from the ram to the stylus tip, (n, 3) mm; zero where none is recorded."""
    return np.column_stack([points.columns.get(f"tip_{a}_mm", np.zeros(len(points))) for a in AXES])


SCALE = MappingProxyType({a: Scale(a) for a in AXES})  # by axis
SQUARENESS = MappingProxyType({plane: Squareness(plane) for plane in LEANING})  # by plane
# by carriage and direction
STRAIGHTNESS = MappingProxyType({(a, b): Straightness(a, b) for a in AXES for b in AXES if a != b})
# by carriage and the axis about which it turns
ROTATION = MappingProxyType({(a, b): Rotation(a, b) for a in AXES for b in AXES})

EFFECTS: tuple[Effect, ...] = (
    *SCALE.values(),
    *SQUARENESS.values(),
    *STRAIGHTNESS.values(),
    *ROTATION.values(),
)
