"""Positions a known distance apart: their lengths, and what a technician turns.

By claim 1 e the machine is adjusted. Who turns a guide turns what rides on it too, so a guide is turned after that which it
rides on: in the chain XYZ X stays where it is, Y is turned square to it, then Z square to both, about X first, from where it
stands once Y is turned. The turns are those of the unit vectors along the axes. The signs follow from *true = indicated + e*:
with e_x = −S·y the Y axis leans towards −X by S, and turning its guide by −S about Z sets it upright; Z has −Syz about X, but
for a product of angles. Where the order is another the same holds of the axes in that order, mirrored if it is odd.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmm_uq.artefacts.distance_equations import FACTORS, DistanceSolution
from cmm_uq.base.messages import NOTHING, Text, Verbatim, commas, number, say, signed
from cmm_uq.base.points import AXES, Floats, Ints
from cmm_uq.base.units import ARCSECOND, MICROMETRE, PPM, unit
from cmm_uq.base.values import dataclass, replace
from cmm_uq.certificate.document import (
    Block,
    Column,
    Paragraph,
    Section,
    Table,
    columns,
    figure_columns,
    section as sectioned,
    table,
)
from cmm_uq.certificate.origin import quantity_data
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.wording import expanded
from cmm_uq.machine.physics.effects.rigid_body import SCALE, SQUARENESS, Squareness
from cmm_uq.machine.physics.kinematics import KinematicChain, axis_directions
from cmm_uq.maths.uncertainty.quantity import Quantity, rounded


@dataclass(frozen=True, eq=False)
class Lengths:
    """Every recorded length, used or not."""

    measurement: Ints  # measurement, repeat: (m,)
    repeat: Ints
    length: Floats  # (m,) as indicated, at 20 °C, mm
    reference: float  # that it is compared with, mm
    residual_um: Floats  # (m,) what the fitted model leaves, µm
    expanded_um: float  # expanded_um, coverage_factor: U of each for the noise of its points, µm, and its k
    coverage_factor: float
    used: NDArray[np.bool_]  # used, flagged: (m,) whether the error factors rest on it, and the screening found it odd
    flagged: NDArray[np.bool_]

    @property
    def deviation_um(self) -> Floats:
        """(m,) from the reference, µm."""
        return np.asarray((self.length - self.reference) / MICROMETRE, dtype=np.float64)

    def as_data(self) -> dict[str, Any]:
        columns = {
            "measurement": self.measurement, "repeat": self.repeat, "length_mm": self.length,
            "deviation_um": self.deviation_um, "residual_um": self.residual_um, "used": self.used, "flagged": self.flagged,
        }  # fmt: skip
        rows = zip(*(column.tolist() for column in columns.values()), strict=True)
        stated = {"reference_mm": self.reference, "U_um": self.expanded_um, "k": self.coverage_factor}
        return {**stated, "each": [dict(zip(columns, row, strict=True)) for row in rows]}


def lengths_of(result: Result, length: Floats, reference: float) -> Lengths:
    """``length`` (m,) of every observation at 20 °C, mm; ``reference`` that it is compared with, mm."""
    artefact, noise = result.artefact, result.noise
    U = noise.expanded * float(artefact.noise_scale[0])
    stated = result.at_least("lengths.U_um", U, noise.coverage_factor, unit("µm"), reference)
    return Lengths(
        artefact.measurement, artefact.repeat, length, reference, result.residuals / MICROMETRE, *stated,
        result.model.used, result.flagged,
    )  # fmt: skip


def adjustments(chain: KinematicChain) -> dict[str, tuple[Text, str]]:
    """What takes away each factor, in order: what is turned (right-handed) or entered, and the axis that it belongs to."""
    names = {axis: Verbatim(axis.upper()) for axis in AXES}
    entered: dict[str, tuple[Text, str]] = {
        SCALE[a].name: (say("Scale of {axis}: lengthen what it reads by", axis=names[a]), a) for a in AXES
    }
    first, second, third = chain.from_frame
    for still, guide, about in ((first, second, third), (second, third, first), (first, third, second)):
        what = say("Guide of {axis}: turn about +{about} by", axis=names[guide], about=names[about])
        entered[_between(still, guide).name] = what, guide
    return entered


def _between(a: str, b: str) -> Squareness:
    return SQUARENESS[a + b if a + b in SQUARENESS else b + a]


_NAMES = {effect.name: say("Scale error of {axis}", axis=Verbatim(axis.upper())) for axis, effect in SCALE.items()} | {
    effect.name: say("Angle {plane} − 90°", plane=Verbatim("–".join(plane.upper())))
    for plane, effect in SQUARENESS.items()
}


@dataclass(frozen=True)
class AdjustmentSetting:
    """What to turn or enter on a machine."""

    effect: str  # error factor that it takes away
    what: Text  # what is turned or entered, and the sense of a positive figure
    parameter: str  # of the effect, a key with its unit
    figure: Quantity  # to set, ppm or ″
    over_travel: Quantity | None  # what it moves at the far end of its axis, µm; ``None`` where no travel is stated

    @property
    def beyond_doubt(self) -> bool:
        low, high = self.figure.interval95
        return not low <= 0 <= high

    def as_data(self) -> dict[str, Any]:
        over = None if self.over_travel is None else quantity_data(self.over_travel)
        return {
            "effect": self.effect, "what": self.what, self.parameter: quantity_data(self.figure), "over_travel_um": over,
            "beyond_doubt": self.beyond_doubt,
        }  # fmt: skip


def turns(squareness: Floats, chain: KinematicChain) -> Floats:
    """Right-handed turns that make the axes square, in the order of :func:`adjustments`; in the chain XYZ about +Z, +X, +Y.

    ``squareness`` (..., 3) Sxy, Syz, Szx, rad. Gives (..., 3) rad.
    """
    first, second, third = chain.from_frame
    planes = (_between(first, second), _between(second, third), _between(third, first))
    axes = axis_directions(squareness[..., [list(SQUARENESS.values()).index(plane) for plane in planes]])
    y, z = axes[..., 1, :], axes[..., 2, :]
    upright = np.arctan2(y[..., 0], y[..., 1])
    across, along = z[..., 0], z[..., 1]
    if chain.rides(third, on=second):
        c, s = np.cos(upright), np.sin(upright)
        across, along = c * across - s * along, s * across + c * along
    about_x = np.arctan2(along, z[..., 2])
    about_y = -np.arctan2(across, np.hypot(along, z[..., 2]))
    hand = 1 if first + second + third in "xyzxy" else -1
    return hand * np.stack([upright, about_x, about_y], axis=-1)


def settings(result: Result) -> tuple[AdjustmentSetting, ...]:
    """What takes away each of the six factors that the recording determines."""
    machine = result.artefact.points.machine
    chain, found = KinematicChain.of(machine.chain), []
    turned = _turns(result, chain)
    for effect, (what, axis) in adjustments(chain).items():
        if effect not in result.parameters or effect in result.free:
            continue
        name, quantity = next(iter(result.parameters[effect].items()))
        figure = turned.get(effect, quantity)
        low, high = machine.travel_mm["xyz".index(axis)]
        per_unit = (PPM if quantity.unit == "ppm" else ARCSECOND) * float(high - low) / MICROMETRE
        over = figure.times(per_unit, unit("µm")) if np.isfinite(per_unit) else None
        found.append(AdjustmentSetting(effect, what, name, figure, over))
    return tuple(found)


def _turns(result: Result, chain: KinematicChain) -> dict[str, Quantity]:
    """The three turns of the draws' axes, by the squareness that they take away; one that the job does not name is 0."""
    draws = {name: values for (name, _), (values, _) in result.model.reported(result.values).items()}
    none = np.zeros(len(result.values))
    squareness = np.column_stack([draws.get(effect.name, none) for effect in SQUARENESS.values()])
    each = turns(ARCSECOND * squareness, chain).T / ARCSECOND
    names = list(adjustments(chain))[3:]
    return {name: Quantity.of_draws(values, unit("″")) for name, values in zip(names, each, strict=True)}


SecondWay = DistanceSolution | Text  # by the distance equations, or why they have no solution


def distances_data(result: Result, lengths: Lengths, second_way: SecondWay, **further: Any) -> dict[str, Any]:
    adjustments = [setting.as_data() for setting in settings(result)]
    data = {"lengths": lengths.as_data(), **further, "adjustments": adjustments}
    if isinstance(second_way, str):
        return {**data, "distance_equations": {"refused": second_way}}
    # what its uncertainties are conditional on, and those of the fitted model are not
    given = "white noise" if second_way.relative_length_u else "white noise, and the distance as known"
    equations = second_way.as_data(result.at_least)
    return {**data, "distance_equations": equations, "conditional": {"distance_equations": given}}


def section(result: Result, second_way: SecondWay, *remarks: Text) -> Section:
    order = KinematicChain.of(result.artefact.points.machine.chain).from_frame
    blocks = _adjustments(settings(result), order), _second_way(result, second_way, remarks)
    return replace(sectioned(say("The adjustment that the machine needs"), *blocks), opinion=True)


def _adjustments(settings: tuple[AdjustmentSetting, ...], order: Iterable[str]) -> Table | None:
    rows: list[tuple[Text, ...]] = []
    for setting in settings:
        over, sure = setting.over_travel, say("yes") if setting.beyond_doubt else NOTHING
        moved = NOTHING if over is None else rounded(over.value, max(over.u, 1e-3))[0]
        rows.append((setting.what, *expanded(setting.figure)[:2], setting.figure.unit, moved, sure))
    first, second, third = (Verbatim(axis.upper()) for axis in order)
    turning = say(
        "{first} stays; {second} is turned square to {first}, then {third} to both, about {first} first. Turns are "
        "right-handed about the named axis.", first=first, second=second, third=third,
    )  # fmt: skip
    doubt = say(
        "Significant: the 95 % interval, which holds for the recorded set-ups, does not contain zero; elsewhere in the "
        "measuring range the factors may differ. Over the travel: what the adjustment moves at its far end."
    )
    stated, over_travel = figure_columns(say("Value"), say("U")), Column(say("Over the travel"), unit("µm"))
    return table(
        say("What to turn and what to enter"),
        [say("Adjustment"), *stated, say("Unit"), over_travel, say("Significant")], rows, turning, doubt,
    )  # fmt: skip


def _second_way(result: Result, solution: SecondWay, remarks: tuple[Text, ...]) -> Block:
    if isinstance(solution, str):
        text = say("The distance equations (US 4,437,151) have no solution here. {solution}", solution=solution)
        return Paragraph(text, tone="note")
    values, stated = solution.factors, solution.expanded(result.at_least)
    rows: list[tuple[Text, ...]] = []
    for i, (effect, _) in enumerate(FACTORS):
        first: tuple[Text, ...] = (number(values[i], ".4g"), NOTHING, NOTHING)
        if solution.open_scales and i < 3:
            first = (say("not determined"), NOTHING, NOTHING)
        elif stated is not None:
            first = (*rounded(float(values[i]), stated[i][0]), number(stated[i][1], ".2f"))
        beside: tuple[Text, ...] = (NOTHING, NOTHING)
        if effect in result.free:
            beside = (say("not determined"), NOTHING)
        elif (model := result.parameters.get(effect)) is not None:
            beside = expanded(next(iter(model.values())))[:2]
        rows.append((_NAMES[effect], *first, *beside, unit("ppm") if i < 3 else unit("″")))
    figures = figure_columns(say("Distance equations"), say("U"), say("k"), say("Fitted model"), say("U"))
    e = commas(say("e{i} = {e}", i=i, e=signed(v, ".3e")) for i, v in enumerate(solution.e, 1))
    sd = say("{residual_sd:.3g} µm", residual_sd=solution.residual_sd / MICROMETRE)
    how = say(
        "US 4,437,151, equations 100 and 102 to 107, solved by QR: {factors}; residual standard deviation {sd}.",
        factors=e,
        sd=sd,
    )
    certified = say(
        "Distance equations: U from their residuals and from the certified length, conditional on white noise; k of "
        "Student's t. Fitted model: U averaged over what the noise may be."
    )
    known = say(
        "Distance equations: U from their residuals, conditional on white noise and on the artefact's length as known; "
        "k of Student's t. Fitted model: U averaged over what the noise may be, and over the length."
    )
    title, notes = say("The six factors by the distance equations, a second way"), (how, certified, *remarks)
    if not solution.relative_length_u:
        notes = (how, known, *remarks)
    return Table(title, columns([say("Factor"), *figures, say("Unit")]), tuple(rows), notes)
