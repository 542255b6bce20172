"""What a certificate shows of two axes calibrated by a plate that was shifted and turned."""

from __future__ import annotations

from cmm_uq.documents.document import Block, Column, Facts, Paragraph, Plot, Section, Table
from cmm_uq.documents.plots import curve_with_band
from cmm_uq.documents.vector_plot import vector_plot
from cmm_uq.documents.wording import expanded, listed
from cmm_uq.kinds.shift_axis.curve import Curve
from cmm_uq.kinds.shift_axis.page import SIGN, table_file
from cmm_uq.kinds.shift_plate.analysis import PlaneShiftResult
from cmm_uq.kinds.shift_plate.undetermined import title
from cmm_uq.kinds.shifting.facts import shift_facts
from cmm_uq.points import AXES
from cmm_uq.uncertainty.quantity import Quantity
from cmm_uq.uncertainty.rounding import rounded
from cmm_uq.units import ARCSECOND, MICROMETRE

_ROWS = 4
"""Every so many of the positions stand in the table of a curve."""


def sections(result: PlaneShiftResult) -> list[Section]:
    """Figures, curves, what is not determined, residuals, placings, plate, method."""
    return [
        _figures(result), _curves(result), _open(result), _residuals(result), _placings(result), _plate(result),
        _method(result),
    ]  # fmt: skip


def warnings(result: PlaneShiftResult) -> tuple[str, ...]:
    """What the reader must know before using a figure."""
    found, chains, free = [], result.estimate.chains, result.estimate.free
    if not chains.converged:
        found.append(
            f"The sampling did not converge (least effective sample size {chains.ess_min:.0f}, R-hat "
            f"{chains.rhat_max:.3f}): estimates and uncertainties must not be used."
        )
    if free.combinations:
        found.append(
            f"Not determined by these placings: {listed([' with '.join(map(title, c)) for c in free.combinations])}. "
            "Curves of these names rest on the assumption that they are small and smooth."
        )
    return tuple(found)


def summary(result: PlaneShiftResult) -> list[tuple[str, str, str]]:
    """Rows of what, figure and remark, for the end of a command."""
    plate = result.estimate.plate
    rows = [(
        "Measured", f"{result.job.facts.machine.name}, plane {result.plane}, {len(plate.numbers)} balls in "
        f"{len(plate.placings)} placings", result.job.facts.job.date.isoformat(),
    )]  # fmt: skip
    rows += [(name, f"{value} ± {U} {unit}", f"k = {k}") for name, value, U, k, unit in _quantities(result)]
    return rows + [("Warning", text, "") for text in warnings(result)]


def _quantities(result: PlaneShiftResult) -> list[tuple[str, str, str, str, str]]:
    named: list[tuple[str, Quantity]] = []
    for name, parameters in result.scalars.items():
        for parameter, quantity in parameters.items():
            named.append((_words(name, parameter), quantity))
    named.append(("Repeatability (one coordinate)", result.repeatability))
    return [(name, *expanded(quantity), quantity.unit) for name, quantity in named]


def _words(name: str, parameter: str) -> str:
    if "_minus_" in name:
        one, _, other = name.partition("_minus_")
        return f"Scale of {one[-1].upper()} minus scale of {other.upper()}"
    words = title(name)
    return f"{words[0].upper()}{words[1:]}{', peak to valley' if parameter == 'peak_to_valley_um' else ''}"


def _figures(result: PlaneShiftResult) -> Section:
    columns = (
        Column("Quantity", numeric=False), Column("Value"), Column("U"), Column("k"), Column("Unit", numeric=False),
    )  # fmt: skip
    a, b = (AXES[axis].upper() for axis in result.estimate.plate.axes)
    notes = (
        SIGN,
        f"Scale and linearity: along the line through the middle of what was read, {_middle(result)}. Straightness: about the "
        f"line through its ends. Squareness: of these lines of {a} and {b}, the angle between them less 90°.",
        "U is the expanded uncertainty for a coverage probability of 95 %, from the posterior distribution.",
    )
    return Section("Figures of performance", (Table("Plane figures", columns, tuple(_quantities(result)), notes),))


def _middle(result: PlaneShiftResult) -> str:
    middle = result.estimate.plate.middle
    return ", ".join(f"{AXES[a]} = {middle[a]:.0f} mm" for a in range(3)).replace("-", "−")


def _curves(result: PlaneShiftResult) -> Section:
    blocks: list[Block] = []
    for name, curve in result.curves.items():
        blocks.append(_picture(name, curve, MICROMETRE, "µm", result))
    for name, curve in result.rotations.items():
        blocks.append(_picture(name, curve, ARCSECOND, "″", result))
    blocks += [_table(result, which) for which in range(2)]
    return Section("Errors of the axes", tuple(blocks))


def _picture(name: str, curve: Curve, unit: float, text: str, result: PlaneShiftResult) -> Plot:
    axis = name.split("_")[1]
    words = title(name)
    free = " These placings do not determine it." if name in result.estimate.free.names else ""
    return curve_with_band(
        curve.position, curve.error / unit, curve.band / unit, x_label=f"Scale reading {axis} / mm",
        y_label=f"Error / {text}",
        caption=f"{words[0].upper()}{words[1:]}, with the band that holds the whole curve with 95 % probability.{free}",
        alternative=(
            f"{words[0].upper()}{words[1:]} runs from {curve.error.min() / unit:.1f} to {curve.error.max() / unit:.1f} "
            f"{text}; the band is at most {curve.band.max() / unit:.1f} {text} to each side."
        ),
    )  # fmt: skip


def _table(result: PlaneShiftResult, which: int) -> Table:
    """All curves of one axis by position."""
    axis = AXES[result.estimate.plate.axes[which]]
    own = [(n, c, MICROMETRE, "µm") for n, c in result.curves.items() if n.split("_")[1] == axis]
    own += [(n, c, ARCSECOND, "″") for n, c in result.rotations.items() if n.split("_")[1] == axis]
    columns, cells = [Column("Reading", "mm")], [[f"{x:.1f}" for x in own[0][1].position[::_ROWS]]]
    for name, curve, unit, text in own:
        kind = name.split("_")[0]
        columns += [Column(f"{kind[0].upper()}{kind[1:]}", text), Column("U", text)]
        U = curve.expanded / unit
        pairs = [
            rounded(e, half) if half > 1e-9 else ("0", "0")
            for e, half in zip((curve.error / unit)[::_ROWS], U[::_ROWS], strict=True)
        ]
        cells += [[value for value, _ in pairs], [half for _, half in pairs]]
    notes = (SIGN, "U: 95 % at that position.",
             f"{table_file(result.job)} holds all curves as an error map of the carriages, the squareness as a slope of the "
             "second axis; "
             "beyond the readings it repeats the last value, uncalibrated.")  # fmt: skip
    return Table(f"Errors of axis {axis.upper()}", tuple(columns), tuple(zip(*cells, strict=True)), notes)


def _open(result: PlaneShiftResult) -> Section:
    free, texts = result.estimate.free, []
    for combination in free.combinations:
        words = listed([title(name) for name in combination])
        texts.append(f"{words[0].upper()}{words[1:]} can change {'together ' if len(combination) > 1 else ''}without "
                     "changing any reading.")  # fmt: skip
    if not free.square_known:
        texts.append(
            "A plate that is only shifted shears and stretches as the machine does: a placing turned by 90° parts them."
        )
    if not free.size_known:
        texts.append("The common scale of both axes needs one known length between two balls.")
    if not free.straight_known:
        texts.append(
            "An axis that bends as it turns looks like a placing that is turned: shift along the other axis too, or turn the "
            "plate by 180°."
        )
    periods = [
        f"{period:.2g} mm along {AXES[axis].upper()}"
        for axis, period in zip(result.estimate.plate.axes, free.periods, strict=True) if period
    ]  # fmt: skip
    if periods:
        texts.append(f"Errors of a period of {listed(periods)} are the same in all placings and show in none.")
    if not texts:
        texts.append("Scales, squareness, and the bows of linearity, straightness and rotation are all determined.")
    texts.append("Details shorter than a quarter of what was read of an axis are taken as noise.")
    return Section("What the placings leave open", (Paragraph(" ".join(texts)),))


def _residuals(result: PlaneShiftResult) -> Section:
    plate = result.estimate.plate
    before, after = (r / MICROMETRE for r in result.estimate.residuals)
    size = result.disagreement_um
    plot = vector_plot(
        plate.flat, [("Without curves", before), ("With the curves", after)],
        axis_labels=(f"{plate.plane[0]} / mm", f"{plate.plane[1]} / mm"),
        caption="What the placings disagree by, with scales and squareness alone, and with the curves.",
        alternative=f"The placings disagree by {size[0]:.2f} µm rms without and {size[1]:.2f} µm with the curves.",
    )  # fmt: skip
    return Section("Residuals", (plot,))


def _placings(result: PlaneShiftResult) -> Section:
    plate = result.estimate.plate
    rows = tuple(
        (str(number), f"{turn:.2f}".replace("-", "−"), *(f"{m:.2f}".replace("-", "−") for m in middle), str(int(count)))
        for number, turn, middle, count in zip(
            plate.placings, plate.turned_deg, plate.middles, plate.counts, strict=True
        )
    )
    columns = (Column("Placing"), Column("Turned", "°"), Column(f"Middle {plate.plane[0]}", "mm"),
               Column(f"Middle {plate.plane[1]}", "mm"), Column("Balls"))  # fmt: skip
    return Section("Placings", (Table("Placings, as found from the readings", columns, rows),))


def _plate(result: PlaneShiftResult) -> Section:
    facts, estimate = shift_facts(result.job), result.estimate
    rows = [("Artefact", facts.name or "Uncalibrated plate, shifted and turned"), ("Serial number", facts.serial)]
    if (known := facts.known) is not None:
        rows.append(("Known length", f"balls {known.from_point} to {known.to_point}: {known.length_mm:.10g} mm, "
                                     f"u = {known.u_um:g} µm"))  # fmt: skip
    if facts.certificate is not None:
        rows.append(("Its certificate", f"{facts.certificate.number} {facts.certificate.laboratory}".strip()))
    blocks: list[Block] = [Facts(tuple((label, value) for label, value in rows if value))]
    if estimate.free.square_known:
        mean, u = result.balls
        cells = tuple(
            (str(number), *(text for x, s in zip(place, spread, strict=True) for text in _coordinate(x, s)))
            for number, place, spread in zip(estimate.plate.numbers, mean, u, strict=True)
        )
        columns = (Column("Ball"), Column("First", "mm"), Column("U", "mm"), Column("Second", "mm"), Column("U", "mm"))
        size = "" if estimate.free.size_known else " Their common scale is not determined: it is that of the machine."
        notes = (
            "From the first ball, along the axes as the plate lay in the first placing. U (k = 2) is of the best fit of all "
            f"balls.{size}",
        )
        blocks.append(Table("The plate's own geometry", columns, cells, notes))
    return Section("Artefact and traceability", tuple(blocks))


def _coordinate(x: float, u: float) -> tuple[str, str]:
    return rounded(x, 2 * u) if u > 1e-9 else (f"{x:.4f}", "0")


def _method(result: PlaneShiftResult) -> Section:
    estimate, chains = result.estimate, result.estimate.chains
    text = Paragraph(
        "The errors of both axes, the positions of the balls and all placings are fitted to all readings at once. Linearity, "
        "straightness and rotation are smooth functions (Gaussian processes, Matérn 7/2) whose sizes, correlation length and "
        "growth towards the ends are sampled; all else is drawn from its exact conditional distribution."
    )
    rows = (
        ("Readings (means)", str(len(estimate.plate.ball))),
        ("Sampler", f"{chains.sampler}, seed {estimate.seed}"),
        ("Convergence", f"{'reached' if chains.converged else 'NOT reached'}: {chains.ess_min:.0f} effective samples, R-hat "
                        f"{chains.rhat_max:.4f}, autocorrelation time {chains.autocorrelation_time:.1f} of {chains.steps} "
                        "steps"),
    )  # fmt: skip
    return Section("Method", (text, Facts(rows)))
