"""What a certificate shows of two axes calibrated by a plate that was shifted and turned."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from cmm_uq.artefacts.shift.axis_page import curve_data, sampling_data
from cmm_uq.artefacts.shift.plane import PlaneShiftResult
from cmm_uq.artefacts.shift.plane_model import title
from cmm_uq.artefacts.shift.result import (
    Curve,
    artefact_section,
    figures_section,
    method_section,
    summary_of,
    table_file,
)
from cmm_uq.base.messages import (
    NOTHING,
    Number,
    Text,
    Verbatim,
    after,
    commas,
    listed,
    number,
    plural,
    say,
    sentences,
    signed,
)
from cmm_uq.base.points import AXES
from cmm_uq.base.units import ARCSECOND, MICROMETRE, Unit, unit
from cmm_uq.certificate.document import Block, Column, Paragraph, Plot, Section, Table
from cmm_uq.certificate.origin import quantity_data
from cmm_uq.certificate.plots.residuals import curve_with_band
from cmm_uq.certificate.plots.vectors import vector_plot
from cmm_uq.certificate.results.contents import covariance_data, head
from cmm_uq.certificate.sections.method import not_converged
from cmm_uq.certificate.sections.results import SIGN, Left
from cmm_uq.certificate.wording import Summary
from cmm_uq.jobs.verdicts import NO_VERDICTS
from cmm_uq.maths.uncertainty.quantity import rounded


def plane_shift_results(result: PlaneShiftResult) -> dict[str, Any]:
    job, estimate = result.job, result.estimate
    plate, free = estimate.plate, estimate.free
    before, after = result.disagreement_um
    balls, u, U = result.balls
    u_um = u / MICROMETRE
    return {
        **head(job, effects=False),
        "estimates": {
            name: {parameter: quantity_data(q) for parameter, q in parameters.items()}
            for name, parameters in result.scalars.items()
        },
        "covariance": covariance_data(result.covariance),
        "observations": len(plate.ball),
        "noise": {
            "stated_coordinate_um": job.facts.recording.u_coordinate_um,
            "coordinate_um": quantity_data(result.repeatability),
        },
        "sampling": sampling_data(estimate.chains, estimate.seed, len(estimate.sigma)),
        "curves": {
            **{name: curve_data(curve, result.stated_along(curve), MICROMETRE, "um") for name, curve in result.curves.items()},
            **{
                name: curve_data(curve, result.stated_along(curve, ARCSECOND, "″"), ARCSECOND, "arcsec")
                for name, curve in result.rotations.items()
            },
        },
        "artefact": {
            "point": plate.numbers.tolist(), "first_mm": balls[:, 0].tolist(), "second_mm": balls[:, 1].tolist(),
            "u_first_um": u_um[:, 0].tolist(), "u_second_um": u_um[:, 1].tolist(), "U_first_mm": U[:, 0].tolist(),
            "U_second_mm": U[:, 1].tolist(), "size_determined": free.size_known,
        },
        "placings": [
            {"measurement": int(number), "turned_deg": float(turn), "middle_mm": middle.tolist(),
             "balls": int(count)}
            for number, turn, middle, count in zip(
                plate.placings, plate.turned_deg, plate.middles, plate.counts, strict=True
            )
        ],
        "identifiability": {
            "not_determined": [list(combination) for combination in free.combinations],
            "period_not_seen_mm": {AXES[axis]: p for axis, p in zip(plate.axes, free.periods, strict=True)},
        },
        "improvement": {"rms_before_um": before, "rms_after_um": after},
        "conformity": [],
        "verdicts": NO_VERDICTS.data(),
    }  # fmt: skip


EVERY = 4  # every so many of the positions stand in the table of a curve


def curves_section(result: PlaneShiftResult) -> Section:
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


def sections(result: PlaneShiftResult) -> list[Section]:
    return [
        _figures(result), _plate(result), curves_section(result), _open(result), residuals_section(result),
        _placings(result), _method(result),
    ]  # fmt: skip


def warnings(result: PlaneShiftResult) -> tuple[Text, ...]:
    found, free = not_converged(result.estimate.chains), result.estimate.free
    if free.combinations:
        found.append(
            say(
                "Not determined by these placings: {names}. Curves of these names rest on the assumption that "
                "they are small and smooth.",
                names=listed([_with_each_other(c) for c in free.combinations]),
            )
        )
    return tuple(found)


def _with_each_other(names: tuple[str, ...]) -> Text:
    together, *others = (title(name) for name in names)
    for other in others:
        together = say("{one} with {other}", one=together, other=other)
    return together


def summary(result: PlaneShiftResult, warnings: Iterable[Text]) -> Summary:
    plate = result.estimate.plate
    measured = say(
        "{name}, plane {plane}, {balls} balls in {placings} placings",
        name=Verbatim(result.job.facts.machine.name),
        plane=Verbatim(result.plane),
        balls=len(plate.numbers),
        placings=len(plate.placings),
    )
    return summary_of(result.job, measured, quantities(result), warnings)


def quantities(result: PlaneShiftResult) -> list[Left]:
    named: list[Left] = []
    for name, parameters in result.scalars.items():
        for parameter, quantity in parameters.items():
            named.append((name, parameter, _words(name, parameter), quantity))
    return [*named, ("noise", "coordinate_um", say("Repeatability (one coordinate)"), result.repeatability)]


def _words(name: str, parameter: str) -> Text:
    if "_minus_" in name:
        one, _, other = name.partition("_minus_")
        return say(
            "Scale of {one} minus scale of {other}", one=Verbatim(one[-1].upper()), other=Verbatim(other.upper())
        )
    words = title(name)
    return (
        say("{words:capital}, peak to valley", words=words)
        if parameter == "peak_to_valley_um"
        else say("{words:capital}", words=words)
    )


def _figures(result: PlaneShiftResult) -> Section:
    a, b = (AXES[axis].upper() for axis in result.estimate.plate.axes)
    meaning = say(
        "Scale and linearity: along the line through the middle of what was read, {middle}. "
        "Straightness: about the line through its ends. Squareness: of these lines of {a} and {b}, "
        "the angle between them less 90°.",
        middle=_middle(result),
        a=Verbatim(a),
        b=Verbatim(b),
    )
    return figures_section(say("Plane figures"), quantities(result), meaning)


def _middle(result: PlaneShiftResult) -> Text:
    middle = result.estimate.plate.middle
    return commas(say("{axis} = {place} mm", axis=Verbatim(AXES[a]), place=signed(middle[a], ".0f")) for a in range(3))


def _open(result: PlaneShiftResult) -> Section:
    free = result.estimate.free
    texts: list[Text] = []
    for combination in free.combinations:
        words = listed([title(name) for name in combination])
        texts.append(plural(
            len(combination),
            one=say("{words:capital} can change without changing any reading.", words=words),
            many=say("{words:capital} can change together without changing any reading.", words=words),
        ))  # fmt: skip
    if not free.square_known:
        texts.append(
            say(
                "A plate that is only shifted shears and stretches as the machine does: a placing turned by "
                "90° parts them."
            )
        )
    if not free.size_known:
        texts.append(say("The common scale of both axes needs one known length between two balls."))
    if not free.straight_known:
        texts.append(
            say(
                "An axis that bends as it turns looks like a placing that is turned: shift along the other "
                "axis too, or turn the plate by 180°."
            )
        )
    periods = [
        say("{period:.2g} mm along {axes}", period=period, axes=Verbatim(AXES[axis].upper()))
        for axis, period in zip(result.estimate.plate.axes, free.periods, strict=True) if period
    ]  # fmt: skip
    if periods:
        texts.append(
            say(
                "Errors of a period of {periods} are the same in all placings and show in none.",
                periods=listed(periods),
            )
        )
    if not texts:
        texts.append(
            say("Scales, squareness, and the bows of linearity, straightness and rotation are all determined.")
        )
    texts.append(say("Details shorter than a quarter of what was read of an axis are taken as noise."))
    return Section(say("What the placings leave open"), (Paragraph(sentences(texts)),))


def _placings(result: PlaneShiftResult) -> Section:
    plate = result.estimate.plate
    rows = tuple(
        (number(placing), signed(turn, ".2f"), *(signed(m, ".2f") for m in middle), number(int(count)))
        for placing, turn, middle, count in zip(
            plate.placings, plate.turned_deg, plate.middles, plate.counts, strict=True
        )
    )
    columns: tuple[Column, ...] = (Column(say("Placing")), Column(say("Turned"), unit("°")))
    columns += (Column(say("Middle {plane}", plane=Verbatim(plate.plane[0])), unit("mm")),)
    columns += (Column(say("Middle {plane}", plane=Verbatim(plate.plane[1])), unit("mm")), Column(say("Balls")))
    return Section(say("Placings"), (Table(say("Placings, as found from the readings"), columns, rows),))


def _plate(result: PlaneShiftResult) -> Section:
    estimate = result.estimate
    blocks: list[Block] = []
    if estimate.free.square_known:
        mean, _, expanded_places = result.balls
        cells = tuple(
            (number(ball), *(text for x, s in zip(place, spread, strict=True) for text in _coordinate(x, s)))
            for ball, place, spread in zip(estimate.plate.numbers, mean, expanded_places, strict=True)
        )
        columns: tuple[Column, ...] = (Column(say("Ball")), Column(say("First"), unit("mm")))
        columns += (Column(say("U"), unit("mm")), Column(say("Second"), unit("mm")), Column(say("U"), unit("mm")))
        note: Text = say(
            "From the first ball, along the axes as the plate lay in the first placing. U, for a coverage probability of "
            "95 %, is of the best fit of all balls."
        )
        if not estimate.free.size_known:
            note = after(note, say("Their common scale is not determined: it is that of the machine."))
        blocks.append(Table(say("The plate's own geometry"), columns, cells, (note,)))
    return artefact_section(result.job, say("Uncalibrated plate, shifted and turned"), say("balls"), (), *blocks)


def _coordinate(x: float, U: float) -> tuple[Text, Text]:
    return rounded(x, U) if U > 2e-9 else (number(x, ".4f"), Number("0"))


def _method(result: PlaneShiftResult) -> Section:
    estimate = result.estimate
    text = say(
        "The errors of both axes, the positions of the balls and all placings are fitted to all "
        "readings at once. Linearity, straightness and rotation are smooth functions (Gaussian "
        "processes, Matérn 7/2) whose sizes, correlation length and growth towards the ends are "
        "sampled; all else is drawn from its exact conditional distribution."
    )
    return method_section(text, len(estimate.plate.ball), estimate.chains, estimate.seed)
