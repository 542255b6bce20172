"""Errors of guideways, scales and rams beyond a rigid body's straight lines: surfaces, twist, wear, joints, and forces.

Schwenke et al. 2008 (CIRP Annals 57, 660–675) and ISO/TR 16907 count them among what numerical compensation meets; flatness
and its local deviations are those of ISO 230-1, reversal spikes those of ISO 230-4.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import ARCSECOND, MICROMETRE, unit
from cmm_uq.machine.physics.effect import (
    AXIS,
    FURTHER,
    OTHER,
    Effect,
    Family,
    Nonparametric,
    Parameter,
    Shape,
    along,
    say,
)
from cmm_uq.machine.physics.effects import Law
from cmm_uq.machine.physics.effects.rigid_body import bow, turned

_WEAR = 1 / 12  # of the travel, standard deviation of the place where a guideway is worn


def place(points: Points, axis: str) -> Floats:
    """(n,) where a carriage stands in its travel, 0 to 1."""
    low, high = points.machine.travel(axis)
    return np.asarray((points.readings[axis] - low) / (high - low), dtype=np.float64)


class Bowl(Family):
    """A surface that two carriages run on, dished: most in the middle of both travels, nothing at their ends."""

    family, title = "bowl", say("Dished surface below {axis} and {other}")
    formula = "xy: e_z, yz: e_x, zx: e_y = bow·(1 − (2(a − a0)/T_a − 1)²)·(1 − (2(b − b0)/T_b − 1)²)"
    mechanism = "guideway"
    points_to = say(
        "the surface that carries {axis} and {other} is dished: check its flatness and its supports; tables of single axes "
        "cannot correct it, a grid over both can"
    )
    coefficients = (Parameter("bow_um", unit("µm"), 20.0),)
    tier = FURTHER

    def fill(self, letters: object) -> None:
        super().fill(dict(zip((AXIS, OTHER), self.axis, strict=True)))

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        (across,), (one, other) = set(AXES) - set(self.axis), (bow(points, axis) for axis in self.axis)
        return along(across, MICROMETRE * one * other)


def _worn(points: Points, axis: str, other: str, shape: Sequence[float]) -> Floats:
    away = (place(points, axis) - shape[0]) / _WEAR
    return along(other, MICROMETRE * np.exp(-0.5 * away**2))


def _spike(points: Points, axis: str, _: str, shape: Sequence[float]) -> Floats:
    decay = np.exp(-points.column(f"since_reversal_{axis}_mm") / shape[0])
    return along(axis, MICROMETRE * points.column(f"approach_{axis}") * decay)


# of what is at one place of the travel
_AT = (Shape("at_part", unit("1"), 0.05, 0.95, what=say("place in the travel"), even=True),)
TWIST, RAM_SAG, WEAR, SCALE_JOINT, INERTIA, REVERSAL_SPIKE = (
    Law("twist", "What a carriage runs on, held at both ends, twists: the carriage rolls most in the middle of its travel",
        say("Twist of the beam or bed of {axis}"), "e = ε × what carriage a carries, ε_a = twist·(1 − (2(a − a0)/T − 1)²)",
        "guideway",
        say("what carriage {axis} runs on twists: check the supports of the bed, how the beam is held, and the ram's "
            "counterbalance"), (Parameter("twist_arcsec", unit("″"), 10.0),),
        lambda p, a, b, s: turned(p, a, a, ARCSECOND * bow(p, a)), tier=FURTHER),
    Law("ram_sag", "A ram that reaches out along a sags under the load at its end: a cantilever, F·L³/(3·E·I)",
        say("Sag of the ram along {axis} under load"), "e_z = −s·load·((a − a0)/T)³", "frame",
        say("the ram sags under what it carries, the more the farther {axis} reaches out: take a lighter head or stylus, or "
            "compensate by reach and load"), (Parameter("um_per_kg", unit("µm/kg"), 5.0),),
        lambda p, a, b, s: along("z", -MICROMETRE * p.column("load_kg") * place(p, a) ** 3), ("load_kg",), FURTHER),
    Law("wear", "A guideway worn or dented at one place, where the machine works most",
        say("Local wear of the guideway of {axis} along {direction}"), "e_b = depth·exp(−½((a − at)/(T/12))²)", "guideway",
        say("the guideway of {axis} is worn or dented at one place: clean it, look at it and at the bearings there, and "
            "compensate straightness along {direction} by a fine table until it is mended"),
        (Parameter("depth_um", unit("µm"), 10.0, say("depth")),), _worn, tier=FURTHER, shape=_AT,
        means=say("as {axis} passes {where} of its travel, the probe stands {size} further towards {side} {direction}"),
        imitated_by=(Nonparametric("{a}_mm", "{b}"),)),
    Law("scale_joint", "Two pieces of a scale, or of a rack, that do not meet", say("Joint in the scale of {axis}"),
        "e_a = step where a > at", "scale",
        say("two pieces of the scale of {axis} do not meet: align them again there, or compensate position by a table with "
            "a step"), (Parameter("step_um", unit("µm"), 10.0, say("step")),),
        lambda p, a, b, s: along(a, np.where(place(p, a) > s[0], MICROMETRE, 0.0)), tier=FURTHER, shape=_AT,
        means=say("beyond {where} of its travel {axis} stands {size} further towards {side} than it reads"),
        imitated_by=(Nonparametric("{a}_mm", "{a}"),), along_motion=True),
    Law("inertia", "What the machine bends by while it accelerates: in proportion, as long as nothing swings",
        say("Bending of the machine as {axis} accelerates"), "e_a = k·acceleration_a", "frame",
        say("the machine bends while {axis} accelerates: lower the acceleration, or let it come to rest before a point is "
            "taken"), (Parameter("um_s2_per_m", unit("µm·s²/m"), 10.0),),
        lambda p, a, b, s: along(a, MICROMETRE * p.column(f"acceleration_{a}_m_s2")), ("acceleration_{a}_m_s2",), FURTHER,
        along_motion=True),
    Law("reversal_spike", "After it turned round an axis sticks, and catches up within a short way",
        say("Reversal spike of {axis}"), "e_a = spike·approach_a·exp(−way since the reversal/decay)", "drive",
        say("{axis} sticks when it turns round and catches up late: check friction and preload of its guideway, and the "
            "controller's compensation of friction"), (Parameter("spike_um", unit("µm"), 10.0, say("spike")),), _spike,
        ("approach_{a}", "since_reversal_{a}_mm"), FURTHER, along_motion=True,
        shape=(Shape("decay_mm", unit("mm"), 0.05, 20.0, what=say("way")),)),
)  # fmt: skip
EFFECTS: tuple[Effect, ...] = (
    *(Bowl(plane) for plane in ("xy", "yz", "zx")), *TWIST.each("xy"), *RAM_SAG.each("xy"),
    *WEAR.each(f"{a} {b}" for a in AXES for b in AXES if a != b), *SCALE_JOINT.each(AXES), *INERTIA.each(AXES),
    *REVERSAL_SPIKE.each(AXES),
)  # fmt: skip
