"""Indicated lengths of a bar at 20 °C, and what a technician turns to correct them (US 4,437,151, claim 1 e).

X stays where it is; Y is turned square to it, then Z square to both: about X first, from where it stands once Y is turned. The
turns are those of the unit vectors along the axes. The signs follow from *true = indicated + e*: with e_x = −S·y the Y axis
leans towards −X by S, and turning its guide by −S about Z sets it upright; Z has −Syz about X, but for a product of angles.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmm_uq.artefacts.distance_equations import FACTORS, DistanceSolution, second_way_data
from cmm_uq.base.messages import NOTHING, Text, Verbatim, commas, number, say, signed
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import ARCSECOND, MICROMETRE, PPM, unit
from cmm_uq.certificate.document import Block, Paragraph, Section, Table, figure_columns, text_columns
from cmm_uq.certificate.origin import quantity_data
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.wording import expanded
from cmm_uq.machine.physics.effects.rigid_body import SCALE, SQUARENESS
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
        return {
            "reference_mm": self.reference,
            "U_um": self.expanded_um,
            "k": self.coverage_factor,
            "each": [
                {"measurement": int(m), "repeat": int(r), "length_mm": length, "deviation_um": deviation,
                 "residual_um": residual, "used": bool(used), "flagged": bool(flagged)}
                for m, r, length, deviation, residual, used, flagged in zip(
                    self.measurement, self.repeat, self.length.tolist(), self.deviation_um.tolist(),
                    self.residual_um.tolist(), self.used, self.flagged, strict=True,
                )
            ],
        }  # fmt: skip


def lengths_of(result: Result, length: Floats, reference: float) -> Lengths:
    """``length`` (m,) of every observation at 20 °C, mm; ``reference`` that it is compared with, mm."""
    artefact, noise = result.artefact, result.noise
    U = noise.expanded * float(artefact.noise_scale[0])
    stated = result.at_least("lengths.U_um", U, noise.coverage_factor, unit("µm"), reference)
    return Lengths(
        artefact.measurement, artefact.repeat, length, reference, result.residuals / MICROMETRE, *stated,
        result.model.used, result.flagged,
    )  # fmt: skip


# what takes away each of the six factors: what is turned (right-handed) or entered, and the axis whose guide or scale it is
ADJUSTMENTS: Mapping[str, tuple[Text, str]] = MappingProxyType({
    SCALE["x"].name: (say("Scale of X: lengthen what it reads by"), "x"),
    SCALE["y"].name: (say("Scale of Y: lengthen what it reads by"), "y"),
    SCALE["z"].name: (say("Scale of Z: lengthen what it reads by"), "z"),
    SQUARENESS["xy"].name: (say("Guide of Y: turn about +Z by"), "y"),
    SQUARENESS["yz"].name: (say("Guide of Z: turn about +X by"), "z"),
    SQUARENESS["zx"].name: (say("Guide of Z: turn about +Y by"), "z"),
})  # fmt: skip

# angle between two axes that is 90° plus the squareness error
ANGLES: Mapping[str, str] = MappingProxyType({e.name: "–".join(plane.upper()) for plane, e in SQUARENESS.items()})


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


def turns(squareness: Floats, z_rides_on_y: bool) -> Floats:
    """Right-handed turns that make the axes square: of Y about +Z, then of Z about +X and about +Y.

    ``squareness`` (..., 3) Sxy, Syz, Szx, rad. Gives (..., 3) rad.
    """
    axes = axis_directions(squareness)
    y, z = axes[..., 1, :], axes[..., 2, :]
    upright = np.arctan2(y[..., 0], y[..., 1])
    across, along = z[..., 0], z[..., 1]
    if z_rides_on_y:
        c, s = np.cos(upright), np.sin(upright)
        across, along = c * across - s * along, s * across + c * along
    about_x = np.arctan2(along, z[..., 2])
    about_y = -np.arctan2(across, np.hypot(along, z[..., 2]))
    return np.stack([upright, about_x, about_y], axis=-1)


def settings(result: Result) -> tuple[AdjustmentSetting, ...]:
    """What takes away each of the six factors that the recording determines."""
    machine, turned = result.artefact.points.machine, _turns(result)
    found = []
    for effect, (what, axis) in ADJUSTMENTS.items():
        if effect not in result.parameters or effect in result.free:
            continue
        name, quantity = next(iter(result.parameters[effect].items()))
        figure = turned.get(effect, quantity)
        low, high = machine.travel_mm["xyz".index(axis)]
        per_unit = (PPM if quantity.unit == "ppm" else ARCSECOND) * float(high - low) / MICROMETRE
        over = figure.times(per_unit, unit("µm")) if np.isfinite(per_unit) else None
        found.append(AdjustmentSetting(effect, what, name, figure, over))
    return tuple(found)


def _turns(result: Result) -> dict[str, Quantity]:
    """The three turns of the draws' axes, by the squareness that they take away; one that the job does not name is 0."""
    draws = {name: values for (name, _), (values, _) in result.model.reported(result.values).items()}
    none, names = np.zeros(len(result.values)), [effect.name for effect in SQUARENESS.values()]
    squareness = np.column_stack([draws.get(name, none) for name in names])
    rides = KinematicChain.of(result.artefact.points.machine.chain).rides("z", on="y")
    each = turns(ARCSECOND * squareness, rides).T / ARCSECOND
    return {name: Quantity.of_draws(values, unit("″")) for name, values in zip(names, each, strict=True)}


SecondWay = DistanceSolution | Text  # by the distance equations, or why they have no solution


def distances_data(result: Result, lengths: Lengths, second_way: SecondWay, **further: Any) -> dict[str, Any]:
    """What results.json says of distances between two balls."""
    adjustments = [setting.as_data() for setting in settings(result)]
    both = {"lengths": lengths.as_data(), **further, "adjustments": adjustments}
    return both | second_way_data(second_way, result.at_least)


def section(result: Result, second_way: SecondWay, *remarks: Text) -> Section:
    blocks = (*_adjustments(settings(result)), _second_way(result, second_way, remarks))
    return Section(say("The adjustment that the machine needs"), blocks, opinion=True)


def _adjustments(settings: tuple[AdjustmentSetting, ...]) -> tuple[Table, ...]:
    rows: list[tuple[Text, ...]] = []
    for setting in settings:
        over, (value, U, _) = setting.over_travel, expanded(setting.figure)
        moved = NOTHING if over is None else rounded(over.value, max(over.u, 1e-3))[0]
        rows.append(
            (setting.what, value, U, setting.figure.unit, moved, say("yes") if setting.beyond_doubt else NOTHING)
        )
    if not rows:
        return ()
    columns = (
        *text_columns(say("Adjustment")), *figure_columns(say("Value"), say("U")), *text_columns(say("Unit")),
        *figure_columns(say("Over the travel"), unit=unit("µm")), *text_columns(say("Beyond doubt")),
    )  # fmt: skip
    turning = say(
        "X stays; Y is turned square to X, then Z to both, about X first. Turns are right-handed about the named axis."
    )
    doubt = say(
        "Beyond doubt: the 95 % interval does not contain zero. Over the travel: what the adjustment moves at its far end."
    )
    return (Table(say("What to turn and what to enter"), columns, tuple(rows), (turning, doubt)),)


def _second_way(result: Result, solution: SecondWay, remarks: tuple[Text, ...]) -> Block:
    if isinstance(solution, str):
        text = say("The distance equations (US 4,437,151) have no solution here. {solution}", solution=solution)
        return Paragraph(text, tone="note")
    values, stated = [*solution.scales_ppm, *solution.squareness_arcsec], solution.expanded(result.at_least)
    rows: list[tuple[Text, ...]] = []
    for i, (effect, _) in enumerate(FACTORS):
        first: tuple[Text, ...] = (number(values[i], ".4g"), NOTHING, NOTHING)
        if stated is not None:
            first = (*rounded(float(values[i]), stated[i][0]), number(stated[i][1], ".2f"))
        if solution.open_scales and i < 3:
            first = (say("not determined"), NOTHING, NOTHING)
        name = (
            say("Scale error of {axis}", axis=Verbatim(effect[-1].upper()))
            if i < 3
            else say("Angle {plane} − 90°", plane=Verbatim(ANGLES[effect]))
        )
        beside: tuple[Text, ...] = (NOTHING, NOTHING)
        if effect in result.free:
            beside = (say("not determined"), NOTHING)
        elif (model := result.parameters.get(effect)) is not None:
            beside = expanded(next(iter(model.values())))[:2]
        rows.append((name, *first, *beside, unit("ppm") if i < 3 else unit("″")))
    figures = (say("Distance equations"), say("U"), say("k"), say("Fitted model"), say("U"))
    columns = (*text_columns(say("Factor")), *figure_columns(*figures), *text_columns(say("Unit")))
    e = commas(say("e{i} = {e}", i=i, e=signed(v, ".3e")) for i, v in enumerate(solution.e, 1))
    how = say(
        "US 4,437,151, equations 100 and 102 to 107, solved by QR: {factors}; residual standard deviation {sd}.",
        factors=e,
        sd=say("{residual_sd:.3g} µm", residual_sd=solution.residual_sd / MICROMETRE),
    )
    differ = (
        say(
            "Distance equations: U from their residuals and from the certified length, conditional on white noise; k of "
            "Student's t. Fitted model: U averaged over what the noise may be."
        )
        if solution.relative_length_u
        else say(
            "Distance equations: U from their residuals, conditional on white noise and on the artefact's length as known; "
            "k of Student's t. Fitted model: U averaged over what the noise may be, and over the length."
        )
    )
    title = say("The six factors by the distance equations, a second way")
    return Table(title, columns, tuple(rows), (how, differ, *remarks))
