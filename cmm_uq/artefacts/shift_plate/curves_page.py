"""What a certificate shows of the curves of two axes: with their bands, by position, and what they leave unexplained."""

from __future__ import annotations

from cmm_uq.artefacts.shift_axis.curve import Curve
from cmm_uq.artefacts.shift_plate.analysis import PlaneShiftResult
from cmm_uq.artefacts.shift_plate.undetermined import title
from cmm_uq.artefacts.shifting.page import table_file
from cmm_uq.base.messages import NOTHING, Number, Text, Verbatim, after, number, say, signed
from cmm_uq.base.points import AXES
from cmm_uq.base.units import ARCSECOND, MICROMETRE, Unit, unit
from cmm_uq.certificate.document import Block, Column, Plot, Section, Table
from cmm_uq.certificate.plots.residuals import curve_with_band
from cmm_uq.certificate.plots.vectors import vector_plot
from cmm_uq.certificate.sections.results import SIGN
from cmm_uq.maths.uncertainty.quantity import rounded

EVERY = 4
"""Every so many of the positions stand in the table of a curve."""


def curves_section(result: PlaneShiftResult) -> Section:
    """Every curve with its band, and a table of both axes."""
    blocks: list[Block] = []
    for name, curve in result.curves.items():
        blocks.append(_picture(name, curve, MICROMETRE, unit("µm"), result))
    for name, curve in result.rotations.items():
        blocks.append(_picture(name, curve, ARCSECOND, unit("″"), result))
    blocks += [_table(result, which) for which in range(2)]
    return Section(say("Errors of the axes"), tuple(blocks))


def _picture(name: str, curve: Curve, size: float, text: Unit, result: PlaneShiftResult) -> Plot:
    axis = name.split("_")[1]
    words = title(name)
    free = say("These placings do not determine it.") if name in result.estimate.free.names else NOTHING
    return curve_with_band(
        curve.position,
        curve.error / size,
        curve.band / size,
        x_label=say("Scale reading {axis} / mm", axis=Verbatim(axis)),
        y_label=say("Error / {unit}", unit=text),
        caption=after(
            say("{words:capital}, with the band that holds the whole curve with 95 % probability.", words=words), free
        ),
        alternative=say(
            "{words:capital} runs from {low} to {high} {unit}; the band is at most {band:.1f} {unit} to each side.",
            words=words,
            low=signed(curve.error.min() / size, ".1f"),
            high=signed(curve.error.max() / size, ".1f"),
            unit=text,
            band=curve.band.max() / size,
        ),
    )


_KINDS = {
    "linearity": say("Linearity"),
    "straightness": say("Straightness"),
    "rotation": say("Rotation"),
    "scale": say("Scale"),
}


def _table(result: PlaneShiftResult, which: int) -> Table:
    """All curves of one axis by position."""
    axis = AXES[result.estimate.plate.axes[which]]
    own = [(n, c, MICROMETRE, unit("µm")) for n, c in result.curves.items() if n.split("_")[1] == axis]
    own += [(n, c, ARCSECOND, unit("″")) for n, c in result.rotations.items() if n.split("_")[1] == axis]
    columns = [Column(say("Reading"), unit("mm"))]
    cells: list[list[Text]] = [[number(x, ".1f") for x in own[0][1].position[::EVERY]]]
    for name, curve, size, text in own:
        columns += [Column(_KINDS[name.split("_")[0]], text), Column(say("U"), text)]
        U = result.stated_along(curve, size, text) / size
        pairs = [
            rounded(e, half) if half > 1e-9 else (Number("0"), Number("0"))
            for e, half in zip((curve.error / size)[::EVERY], U[::EVERY], strict=True)
        ]
        cells += [[value for value, _ in pairs], [half for _, half in pairs]]
    notes = (
        SIGN,
        say("U: 95 % at that position."),
        say(
            "{table_file} holds all curves as an error map of the carriages, the squareness as a slope "
            "of the second axis; beyond the readings it repeats the last value, uncalibrated.",
            table_file=Verbatim(table_file(result.job)),
        ),
    )
    return Table(
        say("Errors of axis {axis}", axis=Verbatim(axis.upper())),
        tuple(columns),
        tuple(zip(*cells, strict=True)),
        notes,
    )


def residuals_section(result: PlaneShiftResult) -> Section:
    """What the placings disagree by, without and with the curves."""
    plate = result.estimate.plate
    before, after = (r / MICROMETRE for r in result.estimate.residuals)
    size = result.disagreement_um
    plot = vector_plot(
        plate.flat,
        [(say("Without curves"), before), (say("With the curves"), after)],
        axis_labels=(
            say("{plane} / mm", plane=Verbatim(plate.plane[0])),
            say("{plane} / mm", plane=Verbatim(plate.plane[1])),
        ),
        caption=say("What the placings disagree by, with scales and squareness alone, and with the curves."),
        alternative=say(
            "The placings disagree by {before:.2f} µm rms without and {after:.2f} µm with the curves.",
            before=size[0],
            after=size[1],
        ),
    )
    return Section(say("Residuals"), (plot,))
