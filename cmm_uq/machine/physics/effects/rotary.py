"""Errors of rotary axes, with the names of ISO 230-7:2015: location and tilt of the axis, and how it moves as it turns.

What an axis carries goes by E + ε × r, r from the point p of the axis that the job states, along the axes of what carries
it. What stands on a table goes so while the probe stays: true = indicated − (E + ε × r). The probe on a head goes so itself:
true = indicated + (E + ε × r). C is the angle by which the axis has turned, R that turn; coordinates on a table are those of
the machine at C = 0. Of two axes the one turns the other with its location and tilt, which are those with both at 0. What no
recording can show is no effect:

- an angle that is the same everywhere is how the artefact was laid on the table;
- a constant radial error is the location of the axis, a constant tilt its tilt;
- of the first order of radial and of tilt errors the half that turns with the table is a place, or a tilt, of what stands on
  it; what is left turns the other way: EXC = A·cos(C + φ), EYC = −A·sin(C + φ);
- the same holds of an axis that carries another, whose location and tilt take the place of those of what stands on it.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, Verbatim
from cmm_uq.base.points import AXES, Floats, Points
from cmm_uq.base.rotary import ROTARY, RotaryAxis, RotaryMachine
from cmm_uq.base.units import ARCSECOND, MICROMETRE, unit
from cmm_uq.machine.physics.effect import (
    AXIS,
    FURTHER,
    OTHER,
    CommonSize,
    Effect,
    Family,
    Harmonic,
    Nonparametric,
    Parameter,
    filled,
    say,
)

_MANY, _HIGHER = "n", np.arange(3, 13)  # orders of errors of which only the common size is known beforehand


class OfRotary(Family):
    """An effect of a rotary axis; ``axis`` is its letter."""

    mechanism = "rotary axis"
    columns: tuple[str, ...] = ("{a}_deg",)
    head = False  # whether the axis turns the probe, and not a table

    def machine(self, points: Points) -> tuple[RotaryMachine, RotaryAxis]:
        if isinstance(points.machine, RotaryMachine) and (own := points.machine.named(self.axis, head=self.head)):
            return points.machine, own
        letter = self.axis.upper()
        what, mark, sign = ("head's axis", "hyphen", "-") if self.head else ("rotary table", "bar", "|")
        fix = f'Give it behind a {mark}, as chain = "XYZ{sign}{letter}", or leave the effect out'
        raise CmmUqError(f"{self.name} is of a {what} {letter}", where="job.toml [machine] chain", fix=fix)

    def unfit(self, points: Points) -> CmmUqError | None:
        try:
            self.machine(points)
        except CmmUqError as error:
            return error
        return None

    @abstractmethod
    def motion(self, points: Points, shape: Sequence[float]) -> Floats:
        """(n, 3, k) mm by which what the axis carries goes, along the axes of what carries it, of one unit of each."""

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        machine, own = self.machine(points)
        moved = machine.carried(own, self.motion(points, shape), points.columns)
        return moved if self.head else -moved

    def angle(self, points: Points) -> Floats:
        """(n,) rad by which it has turned."""
        points.column(self.columns[0])
        return np.asarray(self.machine(points)[1].angle(points.columns))

    def about(self, points: Points, rotation: Floats) -> Floats:
        """(n, 3) what rotations (n, 3) about the stated point of the axis do to what it carries, mm."""
        machine, own = self.machine(points)
        return np.cross(rotation, machine.arm(own, points.xyz, points.columns))


def along_axis(points: Points, index: int) -> Floats:
    """(n, 3) unit vectors of an axis of the machine."""
    return np.tile(np.eye(3)[index], (len(points), 1))


class OfItsAxis(OfRotary):
    """A constant vector of the axis: what of it does not turn with it is seen."""

    turns = False

    def __init__(self, axis: str, other: str) -> None:
        super().__init__(axis, other)
        self.index = AXES.index(other)
        self.imitated_by = tuple(Nonparametric(self.columns[0], a) for a in AXES if a != ROTARY[axis])

    @property
    def symbol(self) -> str:
        """Name by ISO 230-7:2015, such as EX0C, EA0C; axes of a head are named alike."""
        about = {axis: letter for letter, axis in ROTARY.items()}
        return f"E{(about[self.other] if self.turns else self.other).upper()}0{self.axis.upper()}"

    def change(self, points: Points) -> Floats:
        """(n, 3) of a unit vector along the axis, (1 − R) of it."""
        self.angle(points)
        vectors = along_axis(points, self.index)
        return np.asarray(vectors - self.machine(points)[1].turned(vectors[:, :, None], points.columns)[:, :, 0])


class TableLocation(OfItsAxis):
    """The axis of the table stands beside where it is taken to stand."""

    family, title = "rotary_location", say("Location of axis {axis} along {direction}")
    formula = "e = −(1 − R)·o; c_x: o = EX0C along X"
    points_to = say("the axis of table {axis} is not where the controller takes it to be: calibrate its location")
    means = say("the axis of the table stands {size} further towards {side} {direction} than it is taken to")
    coefficients = (Parameter("um", unit("µm"), 50.0),)

    def motion(self, points: Points, shape: Sequence[float]) -> Floats:
        return MICROMETRE * self.change(points)[:, :, None]


class HeadLocation(TableLocation):
    """The axis of the head stands beside where it is taken to stand."""

    family, title, head = "head_location", say("Location of head axis {axis} along {direction}"), True
    formula = "e = (1 − R)·o; c_x: o along X"
    points_to = say("axis {axis} of the head is not where the controller takes it to be: calibrate the head")
    means = say("the axis of the head stands {size} further towards {side} {direction} than it is taken to")


class TableTilt(OfItsAxis):
    """The axis of the table is not parallel to that of the machine."""

    family, turns = "rotary_tilt", True
    title = say("Tilt of axis {axis} about {about}")
    formula = "e = −((1 − R)·a) × r; c_x: a = EA0C about X"
    points_to = say("the axis of table {axis} is tilted: level the table, or calibrate its direction")
    means = say("the axis of the table is turned {sense} about {about} by {size}, seen along plus")
    sense = (say("clockwise"), say("anticlockwise"))
    coefficients = (Parameter("angle_arcsec", unit("″"), 100.0),)

    def motion(self, points: Points, shape: Sequence[float]) -> Floats:
        return ARCSECOND * self.about(points, self.change(points))[:, :, None]


class HeadTilt(TableTilt):
    """The axis of the head is not parallel to that of the machine."""

    family, title, head = "head_tilt", say("Tilt of head axis {axis} about {about}"), True
    formula = "e = ((1 − R)·a) × r; c_x: a about X"
    points_to = say("axis {axis} of the head is tilted: check how the head is mounted, and calibrate it")
    means = say("the axis of the head is turned {sense} about {about} by {size}, seen along plus")


class Motion(NamedTuple):
    """How an axis errs as it turns: along axes of the machine, or about them."""

    family: str
    error: Text  # its name, without direction and order
    remedy: Text
    of_order: tuple[str, str]  # in words, and formula, of one order of the angle
    of_all: tuple[str, str] = ("", "")  # of all higher ones
    across: bool = False  # of its own axis, whether it moves across that
    turns: bool = False
    head: bool = False


class RotaryMotion(OfRotary):
    tier = FURTHER

    def __init__(self, law: Motion, axis: str, *others: str) -> None:
        own, direction = AXES.index(ROTARY[axis]), others[0]
        self.law, self.family, self.order, self.head = law, law.family, others[-1], law.head
        self.__doc__, self.formula = law.of_all if self.order == _MANY else law.of_order
        each = [(own + 1) % 3, (own + 2) % 3] if law.across else [own]
        self.parts = tuple(i for i in each if direction not in ROTARY.values() or direction == AXES[i])
        super().__init__(axis, *others)
        if not law.turns:
            self.imitated_by = tuple(Nonparametric(self.columns[0], AXES[i]) for i in self.parts)

    def fill(self, letters: Mapping[Text, str]) -> None:
        error = filled(self.law.error, {AXIS: Verbatim(letters[AXIS].upper())})
        if self.law.across and len(self.parts) == 1:
            direction = Verbatim(letters[OTHER].upper())
            along = say("{error} along {direction}", error=error, direction=direction)
            error = say("{error} about {direction}", error=error, direction=direction) if self.law.turns else along
        order = Verbatim(f"{_HIGHER[0]}–{_HIGHER[-1]}" if self.order == _MANY else self.order)
        self.title = say("{error}, order {order}", error=error, order=order)
        remedy = self.law.remedy
        self.points_to = say("{error:small}, order {order}: {remedy}", error=error, order=order, remedy=remedy)

    def moved(self, points: Points, part: int) -> Floats:
        """(n, 3) mm by which one of its parts moves what the axis carries, of 1 µm or 1″."""
        vectors = along_axis(points, part)
        return ARCSECOND * self.about(points, vectors) if self.law.turns else MICROMETRE * vectors

    def parameter(self, name: str, size: float) -> Parameter:
        of, own = ("arcsec", unit("″")) if self.law.turns else ("um", unit("µm"))
        return Parameter(f"{name}_{of}", own, size, say("amplitude") if name == "amplitude" else NOTHING)


class RotaryHarmonic(RotaryMotion, Harmonic):
    """A motion of one order of the angle; of the first order across the axis in a circle against the turn."""

    def __init__(self, law: Motion, axis: str, *others: str) -> None:
        super().__init__(law, axis, *others)
        self.amplitude = self.parameter("amplitude", 5.0)
        self.coefficients = tuple(self.parameter(name, 5.0) for name in ("cosine", "sine"))

    def motion(self, points: Points, shape: Sequence[float]) -> Floats:
        angle = int(self.order) * self.angle(points)[:, None]
        c, s = np.cos(angle), np.sin(angle)
        one, *others = (self.moved(points, part) for part in self.parts)
        other = others[0] if others else np.zeros_like(one)
        return np.stack([c * one - s * other, -s * one - c * other], axis=2)


class RotaryFunction(RotaryMotion, CommonSize):
    """A motion of all higher orders of the angle, each smaller by its order: a function of no particular form."""

    def __init__(self, law: Motion, axis: str) -> None:
        super().__init__(law, axis, _MANY)
        self.size = self.parameter("rms", 3.0)
        share = self.size.prior_sd / np.sqrt(np.sum(1.0 / _HIGHER**2))
        self.coefficients = tuple(
            self.parameter(f"{name}_{AXES[part]}_{order}", float(share / order))
            for part in self.parts
            for order in _HIGHER
            for name in ("cosine", "sine")
        )

    def errors(self, coefficients: Floats) -> Floats:
        waves = _waves(np.linspace(0, 2 * np.pi, 4 * _HIGHER[-1], endpoint=False))
        parts = np.reshape(coefficients, (*coefficients.shape[:-1], len(self.parts), waves.shape[1]))
        return np.reshape(parts @ waves.T, (*coefficients.shape[:-1], -1))

    def motion(self, points: Points, shape: Sequence[float]) -> Floats:
        waves = _waves(self.angle(points))[:, None, :]
        return np.concatenate([self.moved(points, part)[:, :, None] * waves for part in self.parts], axis=2)


def _waves(angle: Floats) -> Floats:
    """(n, 2k) cosine and sine of each higher order."""
    each = angle[:, None] * _HIGHER
    return np.stack([np.cos(each), np.sin(each)], axis=2).reshape(len(angle), -1)


RADIAL = Motion(
    "rotary_radial", say("Radial error of table {axis}"), say("its bearing runs out: check bearing and preload"),
    ("The table moves across its axis as it turns: in a circle against its turn (1), or along one axis of the machine",
     "e = −E; c_1: EXC = A·cos(C + φ), EYC = −A·sin(C + φ); c_x_2: EXC = A·cos(2C + φ)"),
    ("The table moves across its axis as any function of its angle, of the orders 3 to 12",
     "e = −E, EXC and EYC = Σ cosine_k·cos(kC) + sine_k·sin(kC)"), across=True,
)  # fmt: skip
AXIAL = Motion(
    "rotary_axial", say("Axial error of table {axis}"),
    say("its axial bearing runs out: check its races and their seat"),
    ("The table moves along its axis as it turns", "e = −E; c_2: EZC = A·cos(2C + φ)"),
    ("The table moves along its axis as any function of its angle, of the orders 3 to 12",
     "e = −E, EZC = Σ cosine_k·cos(kC) + sine_k·sin(kC)"),
)  # fmt: skip
TILT = Motion(
    "rotary_wobble", say("Tilt error of table {axis}"),
    say("it wobbles: check the axial bearing, and how evenly the table is loaded"),
    ("The table tilts as it turns: in a circle against its turn (1), or about one axis of the machine",
     "e = −ε × r; c_1: EAC = A·cos(C + φ), EBC = −A·sin(C + φ); c_x_2: EAC = A·cos(2C + φ)"), across=True, turns=True,
)  # fmt: skip
ANGULAR = Motion(
    "rotary_positioning", say("Angular positioning error of table {axis}"),
    say("its encoder is beside its axis (order 1) or out of round: centre it, or compensate its positions"),
    ("The table stands at another angle than it reads; of the first order as of an encoder beside the axis",
     "e = −ε × r; c_1: ECC = A·cos(C + φ)"),
    ("The table stands at another angle than it reads, by any function of it, of the orders 3 to 12",
     "e = −ε × r, ECC = Σ cosine_k·cos(kC) + sine_k·sin(kC)"), turns=True,
)  # fmt: skip


_CALIBRATE = say("calibrate the head, and check bearing and encoder of the axis")


def _of_head(law: Motion, error: Text) -> Motion:
    """The same of an axis that carries the probe."""
    order, every = (
        (words.replace("table", "head"), e.replace("e = −", "e = ")) for words, e in (law.of_order, law.of_all)
    )
    family = law.family.replace("rotary", "head")
    return law._replace(family=family, error=error, remedy=_CALIBRATE, of_order=order, of_all=every, head=True)


_HEAD = (
    _of_head(ANGULAR, say("Angular positioning error of head axis {axis}")),
    _of_head(RADIAL, say("Radial error of head axis {axis}")),
    _of_head(AXIAL, say("Axial error of head axis {axis}")),
    _of_head(TILT, say("Tilt error of head axis {axis}")),
)


class TablePlay(OfRotary):
    """The table stands at another angle when it comes from the other side."""

    family, title = "rotary_play", say("Play of table {axis}")
    formula = "e = −ε × r, ECC = ½·gap·c_approach"
    points_to = say("the drive of table {axis} has play, or its encoder sits on the drive: check worm, belt and brake")
    means = say(
        "at the same reading the table is turned {size} further towards {side} when it comes from minus than when it comes "
        "from plus"
    )
    coefficients = (Parameter("gap_arcsec", unit("″"), 10.0),)
    columns, tier = ("{a}_deg", "{a}_approach"), FURTHER

    def motion(self, points: Points, shape: Sequence[float]) -> Floats:
        self.angle(points)
        sense = -1.0 if self.machine(points)[1].clockwise else 1.0
        turn = self.about(points, along_axis(points, AXES.index(ROTARY[self.axis])))
        return 0.5 * ARCSECOND * sense * (points.column(f"{self.axis}_approach")[:, None] * turn)[:, :, None]


class HeadPlay(TablePlay):
    """The head stands at another angle when it comes from the other side."""

    family, title, head = "head_play", say("Play of head axis {axis}"), True
    formula = "e = ε × r, ECC = ½·gap·c_approach"
    points_to = say("axis {axis} of the head has play: check its drive and its clamping")
    means = say(
        "at the same reading the head is turned {size} further towards {side} when it comes from minus than when it comes "
        "from plus"
    )


def _of(axis: str, *, head: bool) -> Iterator[Effect]:
    """Of the rotary axis with this letter, in the order of ISO 230-7."""
    across = [a for a in AXES if a != ROTARY[axis]]
    yield from ((HeadLocation if head else TableLocation)(axis, a) for a in across)
    yield from ((HeadTilt if head else TableTilt)(axis, a) for a in across)
    in_each = (("1",), *((a, "2") for a in across))
    angular, radial, axial, _ = laws = _HEAD if head else (ANGULAR, RADIAL, AXIAL, TILT)
    for law in laws:
        yield from (RotaryHarmonic(law, axis, *each) for each in (in_each if law.across else "12"))
    yield from (RotaryFunction(law, axis) for law in (angular, radial, axial))
    yield (HeadPlay if head else TablePlay)(axis)


EFFECTS: tuple[Effect, ...] = tuple(
    effect for head in (False, True) for axis in "cab" for effect in _of(axis, head=head)
)
