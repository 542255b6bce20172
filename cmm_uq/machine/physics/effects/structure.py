"""Errors of guideways, scales and rams beyond a rigid body's straight lines: surfaces, twist, wear, joints, and forces.

Schwenke et al. 2008 (CIRP Annals 57, 660–675) and ISO/TR 16907 count them among what numerical compensation meets; flatness
and its local deviations are those of ISO 230-1, reversal spikes those of ISO 230-4.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.units import ARCSECOND, MICROMETRE, unit
from cmm_uq.machine.physics.effect import (
    AXIS,
    FURTHER,
    OTHER,
    Family,
    Nonparametric,
    OfAxis,
    Parameter,
    Shape,
    along,
    say,
)
from cmm_uq.machine.physics.effects.rigid_body import bow, turned

_WEAR = 1 / 12  # of the travel, standard deviation of the place where a guideway is worn
_TRIED = 19  # places that are tried


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


class GuidewayTwist(Family):
    """What a carriage runs on, held at both ends, twists: the carriage rolls most in the middle of its travel."""

    family, title = "twist", say("Twist of the beam or bed of {axis}")
    formula = "e = ε × what carriage a carries, ε_a = twist·(1 − (2(a − a0)/T − 1)²)"
    mechanism = "guideway"
    points_to = say(
        "what carriage {axis} runs on twists: check the supports of the bed, how the beam is held, and the ram's "
        "counterbalance"
    )
    coefficients = (Parameter("twist_arcsec", unit("″"), 10.0),)
    tier = FURTHER

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return turned(points, self.axis, self.axis, ARCSECOND * bow(points, self.axis))


class RamSag(Family):
    """A ram that reaches out along a sags under the load at its end: a cantilever, F·L³/(3·E·I)."""

    family, title = "ram_sag", say("Sag of the ram along {axis} under load")
    formula, mechanism = "e_z = −s·load·((a − a0)/T)³", "frame"
    points_to = say(
        "the ram sags under what it carries, the more the farther {axis} reaches out: take a lighter head or stylus, or "
        "compensate by reach and load"
    )
    coefficients = (Parameter("um_per_kg", unit("µm/kg"), 5.0),)
    columns, tier = ("load_kg",), FURTHER

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return along("z", -MICROMETRE * points.column("load_kg") * place(points, self.axis) ** 3)


class _AtOnePlace(Family):
    """What is at one place of the travel."""

    tier = FURTHER
    shape = (Shape("at_part", unit("1"), 0.05, 0.95, what=say("place in the travel"), even=True),)

    def trials(self) -> Iterator[tuple[float, ...]]:
        yield from ((float(at),) for at in np.linspace(0.05, 0.95, _TRIED))


class Wear(_AtOnePlace):
    """A guideway worn or dented at one place, where the machine works most."""

    family, title = "wear", say("Local wear of the guideway of {axis} along {direction}")
    formula, mechanism = "e_b = depth·exp(−½((a − at)/(T/12))²)", "guideway"
    points_to = say(
        "the guideway of {axis} is worn or dented at one place: clean it, look at it and at the bearings there, and "
        "compensate straightness along {direction} by a fine table until it is mended"
    )
    means = say("as {axis} passes {where} of its travel, the probe stands {size} further towards {side} {direction}")
    coefficients = (Parameter("depth_um", unit("µm"), 10.0, say("depth")),)
    imitated_by = (Nonparametric("{a}_mm", "{b}"),)

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        away = (place(points, self.axis) - shape[0]) / _WEAR
        return along(self.other, MICROMETRE * np.exp(-0.5 * away**2))


class ScaleJoint(_AtOnePlace, OfAxis):
    """Two pieces of a scale, or of a rack, that do not meet."""

    family, title = "scale_joint", say("Joint in the scale of {axis}")
    formula, mechanism = "e_a = step where a > at", "scale"
    points_to = say(
        "two pieces of the scale of {axis} do not meet: align them again there, or compensate position by a table with a "
        "step"
    )
    means = say("beyond {where} of its travel {axis} stands {size} further towards {side} than it reads")
    coefficients = (Parameter("step_um", unit("µm"), 10.0, say("step")),)
    imitated_by = (Nonparametric("{a}_mm", "{a}"),)

    def component(self, points: Points, shape: Sequence[float]) -> Floats:
        return np.where(place(points, self.axis) > shape[0], MICROMETRE, 0.0)


class Inertia(OfAxis):
    """What the machine bends by while it accelerates: in proportion, as long as nothing swings."""

    family, title = "inertia", say("Bending of the machine as {axis} accelerates")
    formula, mechanism = "e_a = k·acceleration_a", "frame"
    points_to = say(
        "the machine bends while {axis} accelerates: lower the acceleration, or let it come to rest before a point is taken"
    )
    coefficients = (Parameter("um_s2_per_m", unit("µm·s²/m"), 10.0),)
    columns, tier = ("acceleration_{a}_m_s2",), FURTHER

    def component(self, points: Points, shape: Sequence[float]) -> Floats:
        return MICROMETRE * points.column(self.columns[0])


class ReversalSpike(OfAxis):
    """After it turned round an axis sticks, and catches up within a short way."""

    family, title = "reversal_spike", say("Reversal spike of {axis}")
    formula, mechanism = "e_a = spike·approach_a·exp(−way since the reversal/decay)", "drive"
    points_to = say(
        "{axis} sticks when it turns round and catches up late: check friction and preload of its guideway, and the "
        "controller's compensation of friction"
    )
    coefficients = (Parameter("spike_um", unit("µm"), 10.0, say("spike")),)
    columns, tier = ("approach_{a}", "since_reversal_{a}_mm"), FURTHER
    shape = (Shape("decay_mm", unit("mm"), 0.05, 20.0, what=say("way")),)

    def component(self, points: Points, shape: Sequence[float]) -> Floats:
        return MICROMETRE * points.column(self.columns[0]) * np.exp(-points.column(self.columns[1]) / shape[0])


EFFECTS = (
    *(Bowl(plane) for plane in ("xy", "yz", "zx")),
    *(GuidewayTwist(a) for a in "xy"),
    *(RamSag(a) for a in "xy"),
    *(Wear(a, b) for a in AXES for b in AXES if a != b),
    *(family(a) for family in (ScaleJoint, Inertia, ReversalSpike) for a in AXES),
)
