"""Rigid-body errors of a three-carriage machine: scale, squareness, straightness, rotation (VDI/VDE 2617-3).

A rotation of a carriage acts on all that it carries, so its lever arm comes from the machine's chain.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import MappingProxyType

import numpy as np

from cmm_uq.base.messages import Verbatim
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import ARCSECOND, METRE, MICROMETRE, PPM, unit
from cmm_uq.machine.physics.effect import AXIS, OTHER, Effect, Family, Nonparametric, Parameter, along, say
from cmm_uq.machine.physics.effects import Law
from cmm_uq.machine.physics.kinematics import KinematicChain, carried_offset

# of each plane the axis along which a point moves, and the one that leans, by whose reading it moves
LEANING = MappingProxyType({"xy": ("x", "y"), "yz": ("y", "z"), "zx": ("x", "z")})
PLANE, MOVED, LEVER = Verbatim("‹plane›"), Verbatim("‹moved›"), Verbatim("‹lever›")  # blanks in words


class Lean(Family):
    """The angle between two axes less 90°, or what changes it: to first order, one axis leans by it across its reading."""

    mechanism = "frame"

    def __init__(self, plane: str) -> None:
        self.plane, (self.moved, self.lever) = plane, LEANING[plane]
        super().__init__(plane)

    def fill(self, letters: object) -> None:
        first, second = tuple(self.axis)
        super().fill({AXIS: first, OTHER: second, PLANE: f"{first}–{second}", MOVED: self.moved, LEVER: self.lever})

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return along(self.moved, -self.lean(points) * points.readings[self.lever])


class Squareness(Lean):
    """Squareness of two axes: their angle less 90°."""

    family, title = "squareness", say("Squareness {plane}", plane=PLANE)
    formula = "xy: e_x = −S·y; yz: e_y = −S·z; zx: e_x = −S·z"
    points_to = say("the axes are not square: adjust the guideways or the squareness in the compensation")
    means = say("the angle between {one} and {other} is 90° {side} {size}", one=MOVED, other=LEVER)
    everywhere = True
    coefficients = (Parameter("angle_arcsec", unit("″"), 500.0),)

    def __init__(self, plane: str) -> None:
        super().__init__(plane)
        self.imitated_by = (Nonparametric(f"{self.lever}_mm", self.moved),)

    def lean(self, points: Points) -> Floats:
        return np.array(ARCSECOND)


def bow(points: Points, axis: str) -> Floats:
    """(n,) a parabola over the travel of an axis, one in the middle and zero at the ends."""
    low, high = points.machine.travel(axis)
    return np.asarray(1 - (2 * (points.readings[axis] - low) / (high - low) - 1) ** 2, dtype=np.float64)


def turned(points: Points, axis: str, about: str, angle: Floats) -> Floats:
    """Basis (n, 3, 1) of carriage ``axis`` turning about ``about`` by ``angle`` (n,) rad: ε × what it carries."""
    chain = KinematicChain.of(points.machine.chain)
    acts_on_tip = points.machine.tip_on_every_carriage or axis == AXES[chain.order[-1]]
    tip = tip_offsets(points) if acts_on_tip else None
    rotation = np.zeros((len(points), 3))
    rotation[:, AXES.index(about)] = angle
    return np.cross(rotation, carried_offset(axis, points.carriages, tip, chain, points.directions))[:, :, None]


def tip_offsets(points: Points) -> Floats:
    """Of each point from the ram to the stylus tip, (n, 3) mm; zero where none is recorded."""
    return np.column_stack([points.columns.get(f"tip_{a}_mm", np.zeros(len(points))) for a in AXES])


SQUARENESS = MappingProxyType({plane: Squareness(plane) for plane in LEANING})  # by plane


def _turning(points: Points, axis: str, about: str, _: Sequence[float]) -> Floats:
    low, _high = points.machine.travel(axis)
    return turned(points, axis, about, ARCSECOND * (points.readings[axis] - low) / METRE)


SCALES, STRAIGHTNESSES, ROTATIONS = (
    Law("scale", "Linear scale error", say("Scale error of {axis}"), "e_a = s · a", "scale",
        say("the scale or its compensation: check the linear compensation of this axis"),
        (Parameter("ppm", unit("ppm"), 300.0),), lambda p, a, b, s: along(a, PPM * p.readings[a]),
        means=say("lengths along {axis} are indicated {size} too {wrong}"), sense=(say("short"), say("long")),
        everywhere=True, along_motion=True,
        imitated_by=(Nonparametric("{a}_mm", "{a}"), Nonparametric("time_s", "{a}", scale=True))),
    Law("straightness", "Straightness of carriage a along b as one bow over the travel T from a0",
        say("Straightness of {axis} along {direction}"), "e_b = bow · (1 − (2(a − a0)/T − 1)²)", "guideway",
        say("a bowed guideway: check straightness and its compensation"), (Parameter("bow_um", unit("µm"), 50.0),),
        lambda p, a, b, s: along(b, MICROMETRE * bow(p, a)),
        means=say("as {axis} moves, the probe runs in a bow: in the middle of the travel {size} towards {side} {direction}"),
        idealised_over="{a}", imitated_by=(Nonparametric("{a}_mm", "{b}"),)),
    Law("rotation", "Carriage a turns about b in proportion to its travel from a0: roll, pitch or yaw",
        say("Rotation of carriage {axis} about {about}"), "e = ε × what carriage a carries, ε_b = r·(a − a0)", "guideway",
        say("the carriage turns as it moves (roll, pitch or yaw): check bearings, guideway and angular compensation"),
        (Parameter("arcsec_per_m", unit("″/m"), 60.0),), _turning, idealised_over="{a}",
        means=say("as {axis} moves towards plus, the probe turns {sense} by {size}, seen along plus {about}"),
        sense=(say("clockwise"), say("anticlockwise"))),
)  # fmt: skip
SCALE = MappingProxyType({a: SCALES.of(a) for a in AXES})  # by axis
# by carriage and direction, and by carriage and the axis about which it turns
STRAIGHTNESS = MappingProxyType({(a, b): STRAIGHTNESSES.of(a, b) for a in AXES for b in AXES if a != b})
ROTATION = MappingProxyType({(a, b): ROTATIONS.of(a, b) for a in AXES for b in AXES})
EFFECTS: tuple[Effect, ...] = (*SCALE.values(), *SQUARENESS.values(), *STRAIGHTNESS.values(), *ROTATION.values())
