"""Errors of an arm of joints: its Denavit–Hartenberg rows, its encoders, gears and play, how it sags, where its tool is.

Each changes parameters of the rows, or the offset of the tool, at every pose, and e is what that does to the place of the
tool: to first order the arm's Jacobian times the change, all changes together by the rows themselves
(:mod:`cmm_uq.machine.physics.superposition`). Identification of rows: Mooring, Roth, Driels, Fundamentals of Manipulator
Calibration (1991); priors beside what was identified of an IRB 1600 (Nubiola, Bonev, Robot. Comput.-Integr. Manuf. 29 (2013)
236): zeros of some tenths of a degree, lengths of some tenths of a millimetre. Sag by joint stiffness: Judd, Knasinski, IEEE
Trans. Robot. Autom. 6 (1990) 20, who also found encoder eccentricity and gear errors as harmonics of the joints' angles.

What poses cannot tell apart (the zero of the first joint from where the base stands, rows of parallel axes from each other) a
recording leaves open, and the certificate says so.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import ClassVar

import numpy as np

from cmm_uq.base.arm import ALPHA, BETA, PARALLEL, THETA, A, Arm, ArmPose, D
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import ARCSECOND, METRE, MICROMETRE, PPM, unit
from cmm_uq.machine.physics.effect import FURTHER, Effect, Family, Harmonic, Parameter, Shape, say
from cmm_uq.machine.physics.effects import probing


class OfRows(Effect):
    """An effect that changes rows or tool of an arm."""

    @abstractmethod
    def change(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        """(n, 5 j + 3, k) of the parameters, in mm and rad, for one unit of each coefficient."""

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return np.asarray(arm_of(points).posed(points.columns).jacobian @ self.change(points, shape))


def arm_of(points: Points) -> Arm:
    if not isinstance(points.machine, Arm):
        raise CmmUqError("the machine has no joints", where="job.toml [machine]", fix="Give [[machine.joint]] rows")
    return points.machine


class OfJoint(Family, OfRows):
    """A change of one parameter of one joint's row."""

    row: ClassVar[int] = THETA
    mechanism = "joint"

    def __init__(self, joint: str) -> None:
        super().__init__(joint)
        self.index = int(joint[1:]) - 1

    def amount(self, points: Points, shape: Sequence[float]) -> Floats:
        """Change (n,) or (n, k) of the parameter for one unit of each coefficient: constant where nothing else is said."""
        return np.full(len(points), MICROMETRE if self.row in (A, D) else ARCSECOND)

    def change(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        found = np.zeros((len(points), 5 * len(arm_of(points).rows) + 3, len(self.coefficients)))
        found[:, 5 * self.index + self.row] = self.amount(points, shape).reshape(len(points), -1)
        return found


class Zero(OfJoint):
    """The joint's reading is not zero where its row has it: mastering, or how the encoder is mounted."""

    family, title, formula = "zero", say("Zero of joint {axis}"), "θ = reading + θ₀ + zero"
    points_to = say("the zero of joint {axis} is off: master it again, or enter the zero that was found")
    means = say("joint {axis} stands {size} {sense} than it reads")
    sense = (say("farther"), say("less far"))
    coefficients = (Parameter("arcsec", unit("″"), 1000.0),)


class Length(OfJoint):
    """The common normal of two joint axes is longer, a."""

    row, family, mechanism = A, "length", "link"
    title, formula = say("Link length of {axis}"), "a = a₀ + length"
    points_to = say("the link behind joint {axis} has another length than its row: enter the length found")
    coefficients = (Parameter("um", unit("µm"), 500.0),)


class Twist(OfJoint):
    """The next axis is twisted against this one about their common normal, α."""

    row, family, mechanism = ALPHA, "twist", "link"
    title, formula = say("Link twist of {axis}"), "α = α₀ + twist"
    points_to = say("the axes at either end of the link behind joint {axis} are twisted against each other")
    coefficients = (Parameter("arcsec", unit("″"), 400.0),)


class Offset(OfJoint):
    """The next axis lies farther along this one, d; of a prismatic joint its zero."""

    row, family, mechanism = D, "offset", "link"
    title, formula = say("Link offset of {axis}"), "d = d₀ + offset"
    points_to = say("the offset along axis {axis} is another than its row has: enter the one found")
    coefficients = (Parameter("um", unit("µm"), 500.0),)


class Parallelism(OfJoint):
    """Two nominally parallel axes enclose an angle about the direction that no twist has (Hayati's β)."""

    row, family, mechanism = BETA, "parallelism", "link"
    title, formula = say("Parallelism of {axis} and the next axis"), "β = β₀ + parallelism"
    points_to = say("axis {axis} and the next are not parallel: enter β, or check the bearings' seats")
    coefficients = (Parameter("arcsec", unit("″"), 400.0),)

    def shown_in(self, points: Points) -> bool:
        """Of axes that are nearly parallel: of others zero, twist, length and offset say the same, and what to do about it."""
        return bool(abs(np.cos(arm_of(points).rows[self.index, ALPHA])) > PARALLEL)


class Gain(OfJoint):
    """A prismatic joint that goes farther than it reads, in proportion."""

    row, family = D, "gain"
    title, formula = say("Gain of joint {axis}"), "d = reading·(1 + gain) + d₀"
    points_to = say("joint {axis} goes another way than it reads: check the lead or the scale of its drive")
    coefficients = (Parameter("ppm", unit("ppm"), 300.0),)

    def amount(self, points: Points, shape: Sequence[float]) -> Floats:
        return PPM * points.readings[self.axis]


def _wave(sd: float) -> tuple[Parameter, tuple[Parameter, ...]]:
    """An amplitude, and the sine and cosine that it is of."""
    parts = (Parameter(f"{part}_arcsec", unit("″"), sd) for part in ("sine", "cosine"))
    return Parameter("amplitude_arcsec", unit("″"), sd, say("amplitude")), tuple(parts)


class Eccentricity(Harmonic, OfJoint):
    """An encoder's disc turns about another point than its middle."""

    family, title = "eccentricity", say("Eccentric encoder of joint {axis}")
    formula = "θ = reading + θ₀ + A·sin(q + φ)"
    points_to = say("the disc of the encoder of joint {axis} is eccentric: centre it, or read it from two sides")
    amplitude, coefficients = _wave(60.0)
    order: ClassVar[int] = 1

    def turns(self, points: Points, shape: Sequence[float]) -> Floats:
        return self.order * np.radians(points.readings[self.axis])

    def amount(self, points: Points, shape: Sequence[float]) -> Floats:
        turns = self.turns(points, shape)
        return ARCSECOND * np.column_stack([np.sin(turns), np.cos(turns)])


class Ovality(Eccentricity):
    """A second harmonic: an oval or tilted disc of an encoder, or a bent shaft."""

    family, title = "ovality", say("Second harmonic of the encoder of joint {axis}")
    formula = "θ = reading + θ₀ + A·sin(2q + φ)"
    points_to = say("the encoder of joint {axis} errs twice a turn: its disc is tilted or oval, or its shaft bent")
    amplitude, coefficients = _wave(30.0)
    order = 2


class GearError(Eccentricity):
    """An error that repeats with the period λ of a gear: the wave generator of a strain wave gear, the pinion of another."""

    family, title, tier = "gear", say("Transmission error of joint {axis}"), FURTHER
    formula = "θ = reading + θ₀ + A·sin(360°·q/λ + φ)"
    points_to = say("the gear of joint {axis} errs with its own period: check its mounting and wear")
    amplitude, coefficients = _wave(30.0)
    shape = (Shape("period_deg", unit("°"), 1.0, 90.0, "{a}", say("period")),)

    def turns(self, points: Points, shape: Sequence[float]) -> Floats:
        return 2 * np.pi * points.readings[self.axis] / shape[0]


class Slack(OfJoint):
    """The joint stands behind its reading by half the play of its gear, on the side that it came from."""

    family, title = "slack", say("Play of joint {axis}")
    formula = "θ = reading + θ₀ + ½·gap·approach"
    points_to = say("the gear of joint {axis} has play: check its preload and wear, and approach from one side")
    coefficients = (Parameter("gap_arcsec", unit("″"), 100.0),)
    columns = ("approach_{a}",)

    def amount(self, points: Points, shape: Sequence[float]) -> Floats:
        return 0.5 * ARCSECOND * points.column(self.columns[0])


class Sag(OfJoint):
    """A joint yields to the load at the tool, whose lever about the joint's axis u is u·((tool − origin) × down)."""

    family, title = "sag", say("Sag of joint {axis} under the load")
    formula = "θ = reading + θ₀ + c·u·((tool − origin) × down)"
    points_to = say(
        "joint {axis} yields to the weight that it carries: check its bearings and gear, or compensate by pose"
    )
    coefficients = (Parameter("arcsec_per_m", unit("″/m"), 1000.0),)

    def place(self, pose: ArmPose) -> Floats:
        """(n, 3) where the weight is."""
        return pose.tool

    def amount(self, points: Points, shape: Sequence[float]) -> Floats:
        pose = arm_of(points).posed(points.columns)
        origin, axis = pose.origins[:, self.index, THETA], pose.axes[:, self.index, THETA]
        lever = np.einsum("ni,ni->n", axis, np.cross(self.place(pose) - origin, -arm_of(points).up))
        return np.asarray(ARCSECOND / METRE * lever)


class SagOfLinks(Sag):
    """A joint yields to the weight of the links beyond it, taken where the origins of the joints beyond are on average."""

    family, title = "sag_links", say("Sag of joint {axis} under the links beyond")
    formula = "θ = reading + θ₀ + c·u·((mean of the joints beyond − origin) × down)"

    def place(self, pose: ArmPose) -> Floats:
        beyond = pose.origins[:, self.index + 1 :, THETA]
        return beyond.mean(axis=1) if beyond.shape[1] else pose.tool


class Compliance(Sag):
    """A joint yields to what is added at the tool, in proportion to its recorded mass: the weight over its stiffness."""

    family, title = "compliance", say("Compliance of joint {axis} under a payload")
    formula = "θ = reading + θ₀ + c·payload·u·((tool − origin) × down)"
    points_to = say("joint {axis} yields to the payload: compensate by load and pose, or check its gear and bearings")
    coefficients = (Parameter("arcsec_per_m_kg", unit("″/(m·kg)"), 200.0),)
    columns = ("payload_kg",)

    def amount(self, points: Points, shape: Sequence[float]) -> Floats:
        return super().amount(points, shape) * points.column(self.columns[0])


class ToolOffset(OfRows):
    """Where the tool's point, or each reflector, is on the flange: along the axes of the last frame."""

    name, mechanism, title = "tool_offset", "tool", say("Offset of the tool")
    formula = "tool = tool₀ + (x, y, z), of each reflector"
    points_to = say("the tool's point is elsewhere on the flange than stated: enter the offset found")

    def __init__(self, tips: Floats | None = None) -> None:
        """``tips``: (r, 3) offsets beyond that of the tool, mm, by which recorded reflectors differ."""
        self.tips = np.zeros((1, 3)) if tips is None or len(tips) < 2 else tips
        ends = [""] if len(self.tips) == 1 else [f"_{i}" for i in range(1, len(self.tips) + 1)]
        self.coefficients = tuple(Parameter(f"{axis}{end}_um", unit("µm"), 10_000.0) for end in ends for axis in "xyz")

    def change(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        found = np.zeros((len(points), 5 * len(arm_of(points).rows) + 3, len(self.coefficients)))
        which = np.zeros(len(points), dtype=np.int64)
        if len(self.tips) > 1:
            which = np.argmin(np.linalg.norm(tips_of(points)[:, None] - self.tips, axis=2), axis=1)
        for i in range(3):
            found[np.arange(len(points)), i - 3, 3 * which + i] = MICROMETRE
        return found


def tips_of(points: Points) -> Floats:
    """(n, 3) offsets of reflectors beyond that of the tool, mm."""
    return np.column_stack([points.columns.get(f"tip_{axis}_mm", np.zeros(len(points))) for axis in "xyz"])


_EVERY: tuple[Callable[[str], OfJoint], ...] = (Zero, Length, Twist, Offset, Parallelism)
_REVOLUTE: tuple[Callable[[str], OfJoint], ...] = (Eccentricity, Ovality, GearError, Slack, Sag, SagOfLinks, Compliance)


def effects_of_arm(points: Points) -> dict[str, Effect]:
    """Of its joints and its tool, where joints are read, and of what it probes with."""
    arm, found = arm_of(points), list(probing.OF_ANY_TIP)
    if not arm.joints:
        return {effect.name: effect for effect in found}
    for joint, turns in zip(arm.joints, arm.revolute, strict=True):
        found += [kind(joint) for kind in (*_EVERY, *(_REVOLUTE if turns else (Gain,)))]
    tips = np.unique(tips_of(points), axis=0) if len(points) else None
    return {effect.name: effect for effect in (*found, ToolOffset(tips))}
