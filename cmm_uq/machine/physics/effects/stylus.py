"""What a stylus does on contact: pre-travel, different stiffness along and across it, bending, a delay of the trigger.

The surface pushes the tip along the outward normal n, so the machine travels too far and true = indicated + amount·n.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.base.messages import say
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.machine.physics.effect import FURTHER, Effect, Parameter
from cmm_uq.machine.physics.effects.probing import normals_of
from cmm_uq.machine.physics.effects.reversal import travel

REFERENCE_LENGTH = 100.0  # mm; the length of stylus that bending is stated for
_TIPS = tuple(f"tip_{a}_mm" for a in AXES)
_MILLISECOND = 1e-3


class PreTravel(Effect):
    """Pre-travel, or a wrong stylus radius, where only the direction of travel is known.

    The same gap on every axis, unlike hysteresis, whose axes differ. Travel is a unit vector against the normal.
    """

    name = "pre_travel"
    title = say("Pre-travel of the probe")
    formula = "e = −amount·travel"
    mechanism = "probe"
    points_to = say(
        "the probe's pre-travel or the stylus radius is wrong by as much in every direction: qualify "
        "the probe again, with the speed and the force of the measurement"
    )
    coefficients = (Parameter("um", unit("µm"), 10.0),)
    columns = tuple(f"approach_{a}" for a in AXES)
    tier = FURTHER

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return -MICROMETRE * travel(points)[:, :, None]


class ProbeAxial(Effect):
    """Deflection along the stylus unlike that across it; t is along the stylus (the ram without tip columns).

    A kinematic probe head triggers at once along its axis and late across it.
    """

    name = "probe_axial"
    title = say("Deflection of the probe along its axis")
    formula = "e = amount·(n·t)·t"
    mechanism = "probe"
    points_to = say(
        "the probe gives way differently along the stylus and across it: qualify it with points "
        "along the stylus too, and check its trigger force"
    )
    coefficients = (Parameter("um", unit("µm"), 5.0),)
    columns = ("nx", "ny", "nz")
    tier = FURTHER

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        axis = _stylus(points)
        part = np.einsum("ni,ni->n", normals_of(points), axis)
        return np.asarray(MICROMETRE * (part[:, None] * axis)[:, :, None], dtype=np.float64)


class StylusBending(Effect):
    """Bending of the stylus t, whose length L follows from the tip columns.

    A cantilever under the probing force gives way by F·L³/(3·E·I).
    """

    name = "stylus_bending"
    title = say("Bending of the stylus")
    formula = "e = amount·(L/100 mm)³·(n − (n·t)t)"
    mechanism = "probe"
    points_to = say(
        "the stylus bends under the probing force: take a shorter or stiffer one, or a lower force, "
        "and qualify each stylus by itself"
    )
    coefficients = (Parameter("um", unit("µm"), 5.0),)
    columns = ("nx", "ny", "nz", *_TIPS)
    tier = FURTHER

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        length = np.linalg.norm([points.column(name) for name in _TIPS], axis=0)
        axis, normals = _stylus(points), normals_of(points)
        across = normals - np.einsum("ni,ni->n", normals, axis)[:, None] * axis
        ratio = (length / REFERENCE_LENGTH) ** 3
        return np.asarray(MICROMETRE * ratio[:, None, None] * across[:, :, None], dtype=np.float64)


class TriggerDelay(Effect):
    """Delay between contact and reading."""

    name = "trigger_delay"
    title = say("Delay of the probe's trigger")
    formula = "e = delay·speed·n"
    mechanism = "controller"
    points_to = say(
        "the trigger reaches the controller late: check the probe's interface and cable, and qualify "
        "the probe at the speed of the measurement"
    )
    coefficients = (Parameter("delay_ms", unit("ms"), 1.0),)
    columns = ("nx", "ny", "nz", "speed_mm_s")
    tier = FURTHER

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return _MILLISECOND * (points.column("speed_mm_s")[:, None] * normals_of(points))[:, :, None]


def _stylus(points: Points) -> Floats:
    """Unit vectors (n, 3) along each stylus; along the ram where no tip is recorded."""
    tip = np.column_stack([points.columns.get(name, np.zeros(len(points))) for name in _TIPS])
    length = np.linalg.norm(tip, axis=1, keepdims=True)
    along_tip = tip / np.where(length > 0, length, 1.0)
    return np.where(length > 0, along_tip, np.array([0.0, 0.0, -1.0]))


EFFECTS: tuple[Effect, ...] = (PreTravel(), ProbeAxial(), StylusBending(), TriggerDelay())
