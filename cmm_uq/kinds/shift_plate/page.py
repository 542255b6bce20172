"""What a certificate shows of two axes calibrated by a plate that was shifted and turned."""

from __future__ import annotations

from cmm_uq.documents.document import Block, Column, Facts, Paragraph, Plot, Section, Table
from cmm_uq.documents.plots import curve_with_band
from cmm_uq.documents.vector_plot import vector_plot
from cmm_uq.documents.wording import expanded
from cmm_uq.kinds.shift_axis.curve import Curve
from cmm_uq.kinds.shift_axis.page import SIGN, certificate_rows, table_file
from cmm_uq.kinds.shift_plate.analysis import PlaneShiftResult
from cmm_uq.kinds.shift_plate.undetermined import title
from cmm_uq.kinds.shifting.facts import shift_facts
from cmm_uq.messages import (
    NOTHING,
    Number,
    Text,
    Verbatim,
    after,
    commas,
    day,
    listed,
    number,
    plural,
    say,
    sentences,
    signed,
)
from cmm_uq.points import AXES
from cmm_uq.uncertainty.quantity import Quantity
from cmm_uq.uncertainty.rounding import rounded
from cmm_uq.units import ARCSECOND, MICROMETRE, Unit, unit

_ROWS = 4
"""Every so many of the positions stand in the table of a curve."""


def sections(result: PlaneShiftResult) -> list[Section]:
    """Figures, curves, what is not determined, residuals, placings, plate, method."""
    return [
        _figures(result), _curves(result), _open(result), _residuals(result), _placings(result), _plate(result),
        _method(result),
    ]  # fmt: skip


def warnings(result: PlaneShiftResult) -> tuple[Text, ...]:
    """What the reader must know before using a figure."""
    found, chains, free = [], result.estimate.chains, result.estimate.free
    if not chains.converged:
        found.append(
            say(
                "The sampling did not converge (least effective sample size {ess_min:.0f}, R-hat "
                "{rhat_max:.3f}): estimates and uncertainties must not be used.",
                ess_min=chains.ess_min,
                rhat_max=chains.rhat_max,
            )
        )
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


def summary(result: PlaneShiftResult) -> list[tuple[Text, Text, Text]]:
    """Rows of what, figure and remark, for the end of a command."""
    plate = result.estimate.plate
    rows: list[tuple[Text, Text, Text]] = [
        (
            say("Measured"),
            say(
                "{name}, plane {plane}, {balls} balls in {placings} placings",
                name=Verbatim(result.job.facts.machine.name),
                plane=Verbatim(result.plane),
                balls=len(plate.numbers),
                placings=len(plate.placings),
            ),
            day(result.job.facts.job.date),
        )
    ]
    rows += [
        (name, say("{value} ± {u} {unit}", value=value, u=U, unit=own), say("k = {k}", k=k))
        for name, value, U, k, own in _quantities(result)
    ]
    return rows + [(say("Warning"), text, NOTHING) for text in warnings(result)]


def _quantities(result: PlaneShiftResult) -> list[tuple[Text, Text, Text, Text, Text]]:
    named: list[tuple[Text, Quantity]] = []
    for name, parameters in result.scalars.items():
        for parameter, quantity in parameters.items():
            named.append((_words(name, parameter), quantity))
    named.append((say("Repeatability (one coordinate)"), result.repeatability))
    return [(name, *expanded(quantity), quantity.unit) for name, quantity in named]


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
    columns = (
        Column(say("Quantity"), numeric=False),
        Column(say("Value")),
        Column(say("U")),
        Column(say("k")),
        Column(say("Unit"), numeric=False),
    )
    a, b = (AXES[axis].upper() for axis in result.estimate.plate.axes)
    notes = (
        SIGN,
        say(
            "Scale and linearity: along the line through the middle of what was read, {middle}. "
            "Straightness: about the line through its ends. Squareness: of these lines of {a} and {b}, "
            "the angle between them less 90°.",
            middle=_middle(result),
            a=Verbatim(a),
            b=Verbatim(b),
        ),
        say("U is the expanded uncertainty for a coverage probability of 95 %, from the posterior distribution."),
    )
    return Section(
        say("Figures of performance"), (Table(say("Plane figures"), columns, tuple(_quantities(result)), notes),)
    )


def _middle(result: PlaneShiftResult) -> Text:
    middle = result.estimate.plate.middle
    return commas(say("{axis} = {place} mm", axis=Verbatim(AXES[a]), place=signed(middle[a], ".0f")) for a in range(3))


def _curves(result: PlaneShiftResult) -> Section:
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
    free = say(" These placings do not determine it.") if name in result.estimate.free.names else NOTHING
    return curve_with_band(
        curve.position,
        curve.error / size,
        curve.band / size,
        x_label=say("Scale reading {axis} / mm", axis=Verbatim(axis)),
        y_label=say("Error / {unit}", unit=text),
        caption=say(
            "{words:capital}, with the band that holds the whole curve with 95 % probability.{free}",
            words=words,
            free=free,
        ),
        alternative=say(
            "{words:capital} runs from {low:.1f} to {high:.1f} {unit}; the band is at most {band:.1f} "
            "{unit} to each side.",
            words=words,
            low=curve.error.min() / size,
            high=curve.error.max() / size,
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
    cells: list[list[Text]] = [[number(x, ".1f") for x in own[0][1].position[::_ROWS]]]
    for name, curve, size, text in own:
        columns += [Column(_KINDS[name.split("_")[0]], text), Column(say("U"), text)]
        U = curve.expanded / size
        pairs = [
            rounded(e, half) if half > 1e-9 else (Number("0"), Number("0"))
            for e, half in zip((curve.error / size)[::_ROWS], U[::_ROWS], strict=True)
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


def _residuals(result: PlaneShiftResult) -> Section:
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
    facts, estimate = shift_facts(result.job), result.estimate
    rows: list[tuple[Text, Text]] = [
        (say("Artefact"), Verbatim(facts.name) if facts.name else say("Uncalibrated plate, shifted and turned")),
        (say("Serial number"), Verbatim(facts.serial)),
    ]
    if (known := facts.known) is not None:
        told = say(
            "balls {first} to {last}: {length:.10g} mm, u = {u:g} µm",
            first=known.from_point, last=known.to_point, length=known.length_mm, u=known.u_um,
        )  # fmt: skip
        rows.append((say("Known length"), told))
    rows += certificate_rows(facts.certificate)
    blocks: list[Block] = [Facts(tuple((label, value) for label, value in rows if value))]
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
    return Section(say("Artefact and traceability"), tuple(blocks))


def _coordinate(x: float, U: float) -> tuple[Text, Text]:
    return rounded(x, U) if U > 2e-9 else (number(x, ".4f"), Number("0"))


def _method(result: PlaneShiftResult) -> Section:
    estimate, chains = result.estimate, result.estimate.chains
    text = Paragraph(
        say(
            "The errors of both axes, the positions of the balls and all placings are fitted to all "
            "readings at once. Linearity, straightness and rotation are smooth functions (Gaussian "
            "processes, Matérn 7/2) whose sizes, correlation length and growth towards the ends are "
            "sampled; all else is drawn from its exact conditional distribution."
        )
    )
    rows = (
        (say("Readings (means)"), number(len(estimate.plate.ball))),
        (say("Sampler"), say("{sampler}, seed {seed}", sampler=Verbatim(chains.sampler), seed=estimate.seed)),
        (
            say("Convergence"),
            say(
                "{reached}: {ess:.0f} effective samples, R-hat {rhat:.4f}, autocorrelation time "
                "{time:.1f} of {steps} steps",
                reached=say("reached") if chains.converged else say("NOT reached"),
                ess=chains.ess_min,
                rhat=chains.rhat_max,
                time=chains.autocorrelation_time,
                steps=chains.steps,
            ),
        ),
    )
    return Section(say("Method"), (text, Facts(rows)))
