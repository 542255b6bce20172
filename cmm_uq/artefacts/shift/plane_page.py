"""What a certificate shows of two axes calibrated by a plate that was shifted and turned."""

from __future__ import annotations

from typing import Any

from cmm_uq.artefacts.shift import result as shared
from cmm_uq.artefacts.shift.plane import PlaneShiftResult, PrintedCurve
from cmm_uq.artefacts.shift.plane_model import title
from cmm_uq.base import messages
from cmm_uq.base.messages import NOTHING, Number, Text, Verbatim, after, listed, number, plural, say, signed
from cmm_uq.base.points import AXES
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import Block, Column, Paragraph, Plot, Section, Table, figure_columns, section
from cmm_uq.certificate.origin import quantity_data
from cmm_uq.certificate.plots.residuals import curve_with_band
from cmm_uq.certificate.plots.volume import vector_plot
from cmm_uq.certificate.sections.method import not_converged
from cmm_uq.certificate.sections.results import Left
from cmm_uq.certificate.wording import SIGN
from cmm_uq.machine.physics.effects.rigid_body import SCALE, SQUARENESS, STRAIGHTNESS
from cmm_uq.maths.uncertainty.quantity import rounded


def shift_results(result: PlaneShiftResult) -> dict[str, Any]:
    plate, free = result.estimate.plate, result.estimate.free
    balls, u, U = result.balls
    (first, second), (u_first, u_second), (U_first, U_second) = balls.T, u.T / MICROMETRE, U.T
    estimates = {
        name: {parameter: quantity_data(q) for parameter, q in parameters.items()}
        for name, parameters in result.scalars.items()
    }
    return shared.shared_results(result, estimates, len(plate.ball), {
        "curves": {
            c.name: shared.curve_data(c.curve, result.stated_along(c.curve, c.size, c.unit), c.size, c.suffix)
            for c in result.printed
        },
        "artefact": {
            "point": plate.numbers.tolist(), "first_mm": first.tolist(), "second_mm": second.tolist(),
            "u_first_um": u_first.tolist(), "u_second_um": u_second.tolist(), "U_first_mm": U_first.tolist(),
            "U_second_mm": U_second.tolist(), "size_determined": free.determines(SCALE),
        },
        "placings": [
            {"measurement": number, "turned_deg": turn, "middle_mm": middle, "balls": count}
            for number, turn, middle, count in zip(
                plate.placings.tolist(), plate.turned_deg.tolist(), plate.middles.tolist(), plate.counts.tolist(), strict=True
            )
        ],
        "identifiability": {
            "not_determined": [list(combination) for combination in free.combinations],
            "period_not_seen_mm": {AXES[axis]: p for axis, p in zip(plate.axes, free.periods, strict=True)},
        },
    })  # fmt: skip


EVERY = 4  # every so many of the positions stand in the table of a curve


def _picture(result: PlaneShiftResult, printed: PrintedCurve) -> Plot:
    words, error, band = title(printed.name), printed.curve.error / printed.size, printed.curve.band / printed.size
    free = say("These set-ups do not determine it.") if printed.name in result.estimate.free.names else NOTHING
    caption = say("{words:capital}, with the band that holds the whole curve with 95 % probability.", words=words)
    return curve_with_band(
        printed.curve.position, error, band, x_label=say("Scale reading {axis} / mm", axis=Verbatim(printed.axis)),
        y_label=say("Error / {unit}", unit=printed.unit), caption=after(caption, free),
        alternative=say(
            "{words:capital} runs from {low} to {high} {unit}; the band is at most {band:.1f} {unit} to each side.",
            words=words, low=signed(error.min(), ".1f"), high=signed(error.max(), ".1f"), unit=printed.unit, band=band.max(),
        ),
    )  # fmt: skip


_KINDS = {
    "linearity": say("Linearity"), "straightness": say("Straightness"), "rotation": say("Rotation"), "scale": say("Scale"),
}  # fmt: skip


def _table(result: PlaneShiftResult, axis: str) -> Table:
    own = [printed for printed in result.printed if printed.axis == axis]
    columns = [Column(say("Reading"), unit("mm"))]
    cells: list[list[Text]] = [[number(x, ".1f") for x in own[0].curve.position[::EVERY]]]
    for one in own:
        columns += figure_columns(_KINDS[one.name.split("_")[0]], say("U"), unit=one.unit)
        error, U = one.curve.error / one.size, result.stated_along(one.curve, one.size, one.unit) / one.size
        pairs = [
            rounded(e, half) if half > 1e-9 else (Number("0"), Number("0"))
            for e, half in zip(error[::EVERY], U[::EVERY], strict=True)
        ]
        cells += [list(column) for column in zip(*pairs, strict=True)]
    whole = say(
        "{table_file} holds all curves as an error map of the carriages, the squareness as a slope "
        "of the second axis; beyond the readings it repeats the last value, uncalibrated.",
        table_file=Verbatim(shared.table_file(result.job)),
    )
    caption, notes = (
        say("Errors of axis {axis}", axis=Verbatim(axis.upper())),
        (say("U: 95 % at that position."), whole),
    )
    return Table(caption, tuple(columns), tuple(zip(*cells, strict=True)), (SIGN, *notes))


def _residuals(result: PlaneShiftResult) -> Section:
    plate, (without, with_curves) = result.estimate.plate, result.disagreement_um
    before, after = (r / MICROMETRE for r in result.estimate.residuals)
    first, second = (say("{plane} / mm", plane=Verbatim(axis)) for axis in plate.plane)
    plot = vector_plot(
        plate.flat, [(say("Without curves"), before), (say("With the curves"), after)], axis_labels=(first, second),
        caption=say("What the set-ups disagree by, with scales and squareness alone, and with the curves."),
        alternative=say(
            "The set-ups disagree by {before:.2f} µm rms without and {after:.2f} µm with the curves.",
            before=without, after=with_curves,
        ),
    )  # fmt: skip
    return Section(say("Residuals"), (plot,))


def sections(result: PlaneShiftResult) -> list[Section]:
    pictures = (_picture(result, printed) for printed in result.printed)
    tables = (_table(result, axis) for axis in result.plane)
    curves = section(say("Errors of the axes"), *pictures, *tables)
    parts = (part(result) for part in (_open, _residuals, _placings, _method))
    return [_figures(result), _plate(result), curves, *parts]


def warnings(result: PlaneShiftResult) -> list[Text]:
    found = not_converged(result.estimate.chains)
    together = []
    for names in result.estimate.free.combinations:
        words, *others = (title(name) for name in names)
        for other in others:
            words = say("{one} with {other}", one=words, other=other)
        together.append(words)
    if together:
        undetermined = say(
            "Not determined by these set-ups: {names}. Curves of these names rest on the assumption that "
            "they are small and smooth.",
            names=listed(together),
        )
        found.append(undetermined)
    return found


def measured(result: PlaneShiftResult) -> Text:
    name, plate = Verbatim(result.job.facts.machine.name), result.estimate.plate
    plane, p, s = Verbatim(plate.plane), len(plate.numbers), len(plate.placings)
    return say(
        "{name}, plane {plane}, {balls} balls in {placings} set-ups", name=name, plane=plane, balls=p, placings=s
    )


def quantities(result: PlaneShiftResult) -> list[Left]:
    named: list[Left] = [
        (name, parameter, _words(name, parameter), quantity)
        for name, parameters in result.scalars.items()
        for parameter, quantity in parameters.items()
    ]
    return [*named, ("noise", "coordinate_um", say("Repeatability (one coordinate)"), result.repeatability)]


def _words(name: str, parameter: str) -> Text:
    if "_minus_" in name:
        scale, _, axis = name.partition("_minus_")
        one, other = Verbatim(scale[-1].upper()), Verbatim(axis.upper())
        return say("Scale of {one} minus scale of {other}", one=one, other=other)
    if parameter == "peak_to_valley_um":
        return say("{words:capital}, peak to valley", words=title(name))
    return say("{words:capital}", words=title(name))


def _figures(result: PlaneShiftResult) -> Section:
    plate = result.estimate.plate
    a, b = (Verbatim(axis.upper()) for axis in plate.plane)
    middle = messages.commas(
        say("{axis} = {place} mm", axis=Verbatim(axis), place=signed(place, ".0f"))
        for axis, place in zip(AXES, plate.middle, strict=True)
    )
    meaning = say(
        "Scale and linearity: along the line through the middle of what was read, {middle}. Straightness: about the line "
        "through its ends. Squareness: of these lines of {a} and {b}, the angle between them less 90°.",
        middle=middle,
        a=a,
        b=b,
    )
    return shared.figures_section(say("Plane figures"), quantities(result), meaning)


def _open(result: PlaneShiftResult) -> Section:
    free = result.estimate.free
    texts: list[Text] = []
    for combination in free.combinations:
        words = listed([title(name) for name in combination])
        one = say("{words:capital} can change without changing any reading.", words=words)
        many = say("{words:capital} can change together without changing any reading.", words=words)
        texts.append(plural(len(combination), one=one, many=many))
    shears = say(
        "A plate that is only shifted shears and stretches as the machine does: a set-up turned by 90° parts them."
    )
    size = say("The common scale of both axes needs one known length between two balls.")
    bends = say(
        "An axis that bends as it turns looks like a set-up that is turned: shift along the other "
        "axis too, or turn the plate by 180°."
    )
    for known, what in ((SQUARENESS, shears), (SCALE, size), (STRAIGHTNESS, bends)):
        texts += [] if free.determines(known) else [what]
    periods = [
        say("{period:.2g} mm along {axes}", period=period, axes=Verbatim(axis.upper()))
        for axis, period in zip(result.plane, free.periods, strict=True)
        if period
    ]
    if periods:
        same = say(
            "Errors of a period of {periods} are the same in all set-ups and show in none.", periods=listed(periods)
        )
        texts.append(same)
    if not texts:
        texts.append(
            say("Scales, squareness, and the bows of linearity, straightness and rotation are all determined.")
        )
    texts.append(say("Details shorter than a quarter of what was read of an axis are taken as noise."))
    return Section(say("What the set-ups leave open"), (Paragraph(messages.sentences(texts)),))


def _placings(result: PlaneShiftResult) -> Section:
    plate = result.estimate.plate
    rows = tuple(
        (number(placing), signed(turn, ".2f"), *(signed(m, ".2f") for m in middle), number(int(count)))
        for placing, turn, middle, count in zip(
            plate.placings, plate.turned_deg, plate.middles, plate.counts, strict=True
        )
    )
    middles = (say("Middle {plane}", plane=Verbatim(axis)) for axis in plate.plane)
    columns = (
        *figure_columns(say("Set-up")), Column(say("Turned"), unit("°")), *figure_columns(*middles, unit=unit("mm")),
        Column(say("Balls")),
    )  # fmt: skip
    return Section(say("Set-ups"), (Table(say("Set-ups, as found from the readings"), columns, rows),))


def _plate(result: PlaneShiftResult) -> Section:
    free, tables = result.estimate.free, list[Block]()
    if free.determines(SQUARENESS):
        mean, _, U = result.balls
        cells = tuple(
            (number(ball), *(text for x, s in zip(place, spread, strict=True) for text in _coordinate(x, s)))
            for ball, place, spread in zip(result.estimate.plate.numbers, mean, U, strict=True)
        )
        places = figure_columns(say("First"), say("U"), say("Second"), say("U"), unit=unit("mm"))
        note: Text = say(
            "From the first ball, along the axes as the plate lay in the first set-up. U, for a coverage probability of "
            "95 %, is of the best fit of all balls."
        )
        if not free.determines(SCALE):
            note = after(note, say("Their common scale is not determined: it is that of the machine."))
        tables.append(Table(say("The plate's own geometry"), (Column(say("Ball")), *places), cells, (note,)))
    return shared.artefact_section(result.job, say("Uncalibrated plate, shifted and turned"), say("balls"), (), *tables)


def _coordinate(x: float, U: float) -> tuple[Text, Text]:
    return rounded(x, U) if U > 2e-9 else (number(x, ".4f"), Number("0"))


def _method(result: PlaneShiftResult) -> Section:
    text = say(
        "The errors of both axes, the positions of the balls and all set-ups are fitted to all readings at once. Linearity, "
        "straightness and rotation are smooth functions (Gaussian processes, Matérn 7/2) whose sizes, correlation length and "
        "growth towards the ends are sampled; all else is drawn from its exact conditional distribution."
    )
    return shared.method_section(result, text, len(result.estimate.plate.ball))
