"""What a certificate shows of two axes calibrated by a plate that was shifted and turned."""

from __future__ import annotations

from collections.abc import Iterable

from cmm_uq.artefacts.shift_plate.analysis import PlaneShiftResult
from cmm_uq.artefacts.shift_plate.curves_page import curves_section, residuals_section
from cmm_uq.artefacts.shift_plate.undetermined import title
from cmm_uq.artefacts.shifting.page import artefact_section, figures_section, method_section, summary_of
from cmm_uq.base.messages import Number, Text, Verbatim, after, commas, listed, number, plural, say, sentences, signed
from cmm_uq.base.points import AXES
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import Block, Column, Paragraph, Section, Table
from cmm_uq.certificate.sections.results import Left
from cmm_uq.certificate.sections.warnings import not_converged
from cmm_uq.certificate.wording import Summary
from cmm_uq.maths.uncertainty.quantity import rounded


def sections(result: PlaneShiftResult) -> list[Section]:
    """Figures, plate, curves, what is not determined, residuals, placings, method."""
    return [
        _figures(result), _plate(result), curves_section(result), _open(result), residuals_section(result),
        _placings(result), _method(result),
    ]  # fmt: skip


def warnings(result: PlaneShiftResult) -> tuple[Text, ...]:
    """What the reader must know before using a figure."""
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
    """For the end of a command."""
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
    """Figures of performance, with their places in results.json."""
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
    columns = (
        Column(say("Placing")),
        Column(say("Turned"), unit("°")),
        Column(say("Middle {plane}", plane=Verbatim(plate.plane[0])), unit("mm")),
        Column(say("Middle {plane}", plane=Verbatim(plate.plane[1])), unit("mm")),
        Column(say("Balls")),
    )
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
        columns = (
            Column(say("Ball")),
            Column(say("First"), unit("mm")),
            Column(say("U"), unit("mm")),
            Column(say("Second"), unit("mm")),
            Column(say("U"), unit("mm")),
        )
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
