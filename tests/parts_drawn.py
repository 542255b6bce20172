"""Features, parts and machines that the tests of virtual measurements have in common."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from cmm_uq.analysis.machine.state import MachineState, StatedNoise
from cmm_uq.analysis.parts.causes.cause import CommonCause, normal
from cmm_uq.analysis.parts.causes.surroundings import FIXTURE, elapsed
from cmm_uq.analysis.parts.plan import Nominal, PartCharacteristic, PartFeature, PartPose, Plan
from cmm_uq.base.points import Floats, Machine
from cmm_uq.base.units import ARCSECOND, MICROMETRE
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.maths.geometry.association import Association

UP = np.array([0.0, 0.0, 1.0])
MACHINE = Machine("m", travel_mm=np.array([[0.0, 900.0], [0.0, 550.0], [-500.0, 0.0]]))
POSE = PartPose(np.eye(3), np.array([300.0, 200.0, -300.0]))


def machine(
    names: Sequence[str] = (), draws: ArrayLike = ((),), noise_um: float = 0.0, **changes: object
) -> MachineState:
    """A machine with draws (M, k) of the errors named."""
    noise = StatedNoise(np.full(3, 1e-3 * noise_um))
    given = np.atleast_2d(np.asarray(draws, dtype=np.float64))
    return MachineState(MACHINE, effects(names), given, **{"noise": noise, **changes})  # type: ignore[arg-type]


def ring(centre: ArrayLike, radius: float, z: float, count: int, start: float = 0.0) -> tuple[Floats, Floats]:
    """Points of a circle level in the part, and directions away from its centre."""
    angles = start + 2 * np.pi * np.arange(count) / count
    out = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(count)])
    return np.asarray(centre, dtype=np.float64) + radius * out + z * UP, out


def circle(
    name: str, centre: ArrayLike, radius: float, count: int = 8, *, hole: bool = True, **more: object
) -> PartFeature:
    points, out = ring(centre, radius, 0.0, count)
    nominal = Nominal(np.asarray(centre, dtype=np.float64), UP, 2 * radius)
    return PartFeature(name, "circle", points, -out if hole else out, nominal=nominal, **{"stylus": "stylus", **more})  # type: ignore[arg-type]


def bore(
    name: str, centre: ArrayLike, radius: float, depths: Sequence[float] = (-3.0, -12.0, -20.0), count: int = 8,
    *, hole: bool = True, stylus: str = "stylus",
) -> PartFeature:  # fmt: skip
    rings = [ring(centre, radius, z, count, 0.3 * k) for k, z in enumerate(depths)]
    points, out = np.vstack([r[0] for r in rings]), np.vstack([r[1] for r in rings])
    nominal = Nominal(np.asarray(centre, dtype=np.float64), UP, 2 * radius)
    return PartFeature(name, "cylinder", points, -out if hole else out, stylus, nominal)


def plane(
    name: str, normal: ArrayLike, origin: ArrayLike, sides: ArrayLike, counts: tuple[int, int] = (4, 4),
    *, stylus: str = "stylus", association: Association = "least_squares",
) -> PartFeature:  # fmt: skip
    """A grid on a rectangle from ``origin`` over two ``sides`` (2, 3), mm."""
    one, other = np.asarray(sides, dtype=np.float64)
    start = np.asarray(origin, dtype=np.float64)
    grid = [start + a * one + b * other for a in np.linspace(0, 1, counts[0]) for b in np.linspace(0, 1, counts[1])]
    out = np.asarray(normal, dtype=np.float64)
    return PartFeature(
        name, "plane", np.array(grid), np.tile(out, (len(grid), 1)), stylus, Nominal(start, out), association
    )


def ball(name: str, centre: ArrayLike, radius: float, toward: Floats) -> PartFeature:
    middle = np.asarray(centre, dtype=np.float64)
    return PartFeature(name, "sphere", middle + radius * toward, toward, "stylus", Nominal(middle, None, 2 * radius))


def spot(name: str, place: ArrayLike, normal: ArrayLike = (0.0, 0.0, 1.0), stylus: str = "stylus") -> PartFeature:
    at = np.asarray(place, dtype=np.float64)
    return PartFeature(name, "point", at[None], np.asarray(normal, dtype=np.float64)[None], stylus, Nominal(at))


def block() -> tuple[tuple[PartFeature, ...], tuple[PartCharacteristic, ...]]:
    """A plate of 200 × 100 mm with two bores: 100 points, ten characteristics of features alone."""
    features = (
        plane("A", UP, [0, 0, 0], [[200, 0, 0], [0, 100, 0]]),
        plane("B", [0, -1, 0], [0, 0, -5], [[200, 0, 0], [0, 0, -20]], (4, 3)),
        plane("C", [-1, 0, 0], [0, 0, -5], [[0, 100, 0], [0, 0, -20]], (4, 3)),
        plane("D", [1, 0, 0], [200, 0, -5], [[0, 100, 0], [0, 0, -20]], (4, 3)),
        bore("h1", [30, 40, 0], 10.0),
        bore("h2", [170, 60, 0], 15.0),
    )
    abc = ("A", "B", "C")
    return features, (
        PartCharacteristic("d1", "size", ("h1",)),
        PartCharacteristic("d2", "size", ("h2",)),
        PartCharacteristic("apart", "distance", ("h1", "h2")),
        PartCharacteristic("x1", "x", ("h1",), abc),
        PartCharacteristic("y2", "y", ("h2",), abc),
        PartCharacteristic("position 1", "position", ("h1",), abc),
        PartCharacteristic("position 2", "position", ("h2",), abc),
        PartCharacteristic("length", "distance", ("C", "D")),
        PartCharacteristic("upright", "perpendicularity", ("h1",), ("A",)),
        PartCharacteristic("corner", "angle", ("B", "C")),
    )


def moving_part(plan: Plan, u_shift_um: float, u_turn_arcsec: float = 0.0) -> CommonCause:
    """A part that has shifted and turned evenly by the end of its measurement."""
    about = plan.points - plan.points.mean(axis=0)
    done = elapsed(plan)[:, None]
    shifts = [MICROMETRE * done * axis for axis in np.eye(3)]
    turns = [ARCSECOND * done * np.cross(axis, about) for axis in np.eye(3)]
    sd = np.repeat([u_shift_um, u_turn_arcsec], 3)
    return CommonCause(name=FIXTURE, factors=("fixture",) * 6, draw=normal(sd), basis=np.array([*shifts, *turns]))
