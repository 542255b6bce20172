"""What a certificate shows of a triangle standard: its angles, the sides in every placing, and two ways to the parameters."""

from __future__ import annotations

from math import degrees

from cmm_uq.artefacts.triangle.analysis import SIDES, ByEquations, Sides, Standard, TriangleFigures, results
from cmm_uq.base.messages import NOTHING, Text, Verbatim, number, say, semicolons, signed
from cmm_uq.base.units import ARCSECOND, unit
from cmm_uq.certificate.document import Block, Column, Paragraph, Plot, Section, Table
from cmm_uq.certificate.outcome import Page
from cmm_uq.certificate.plots.residuals import length_plot
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.wording import deviating, expanded
from cmm_uq.maths.uncertainty.quantity import rounded


def sections(result: Result) -> list[Section]:
    """The standard, its sides as found, and the parameters by the fitted model and by the source's equations."""
    found = TriangleFigures(result)
    return [
        Section(say("The triangle"), (_standard(found.standard), _sides(found.sides))),
        Section(say("Parameters by two ways"), (*_two_ways(result, found.equations), *_alike(result, found))),
    ]


def _standard(standard: Standard) -> Table:
    rows: list[tuple[Text, ...]] = [
        (say("Side {name}", name=Verbatim(name)), *rounded(*side), unit("mm"))
        for name, side in zip(SIDES, standard.sides, strict=True)
    ]
    for i, (angle, spread) in enumerate(standard.angles, 1):
        shown = rounded(degrees(angle), degrees(spread))[0]
        rows.append((say("Angle at {i}", i=i), shown, say("{U}″", U=rounded(0.0, spread / ARCSECOND)[1]), unit("°")))
    rows.append((say("Height over side 1–2"), *rounded(*standard.height), unit("mm")))
    columns = (
        Column(say("Quantity"), numeric=False),
        Column(say("Value")),
        Column(say("U")),
        Column(say("Unit"), numeric=False),
    )
    note = say(
        "U for a coverage probability of 95 % by Monte Carlo, {draws} draws of the dimensions of blocks and cylinders; "
        "angles by the cosine rule.",
        draws=standard.draws,
    )
    return Table(say("Sides and angles of the standard at 20 °C"), columns, tuple(rows), (note,))


def _sides(sides: Sides) -> Plot:
    before, after = sides.before_um.ravel(), sides.after_um.ravel()
    return length_plot(
        sides.measurement.repeat(3).astype(float),
        before,
        after,
        expanded_before_um=sides.expanded_um,
        expanded_after_um=sides.expanded_um,
        reference=say("certified side"),
        position_label=say("Placing (its three sides side by side)"),
        caption=say(
            "Each side minus its certified length, as recorded and after the fitted model, with U (k = {k}).",
            k=number(sides.coverage_factor, ".2f"),
        ),
        alternative=deviating(
            say("{count} sides: as recorded they deviate", count=len(before)), NOTHING, before, after
        ),
    )


def _two_ways(result: Result, equations: tuple[ByEquations, ...] | Text) -> list[Block]:
    if isinstance(equations, str):
        return [
            Paragraph(
                say("The source's equations have no solution here. {equations}", equations=equations), tone="note"
            )
        ]
    rows = []
    for one in equations:
        value, U = rounded(one.value, one.expanded)
        fitted: tuple[Text, ...] = (NOTHING, NOTHING)
        if one.effect in result.parameters:
            quantity = next(iter(result.parameters[one.effect].values()))
            fitted = (say("not determined"), NOTHING) if one.effect in result.free else expanded(quantity)[:2]
        rows.append((one.title, value, U, *fitted, one.unit))
    columns = (
        Column(say("Parameter"), numeric=False),
        Column(say("Equations")),
        Column(say("U")),
        Column(say("Fitted model")),
        Column(say("U")),
        Column(say("Unit"), numeric=False),
    )
    notes = (
        say(
            "Equations: one after the other from the sides of aligned placings (Manlay, Fast checking of "
            "CMM geometry with a patented tool), each from a few of the observations, U for a coverage probability of 95 %, "
            "conditional on white noise. Fitted model: all observations at once, U averaged over what the noise may be."
        ),
    )
    return [Table(say("Scale, squareness, pitch, yaw and roll"), columns, tuple(rows), notes)]


def _alike(result: Result, found: TriangleFigures) -> list[Block]:
    """Pairs of effects that these placings hardly tell apart."""
    titles = {effect.name: effect.title for effect in result.model.effects}
    pairs = [
        say(
            "{one} and {other} ({correlation})",
            one=titles[one],
            other=titles[other],
            correlation=signed(correlation, "+.2f"),
        )
        for one, other, correlation in found.alike
    ]
    text = say("Hardly told apart by these placings (correlation): {pairs}.", pairs=semicolons(pairs))
    return [Paragraph(text, tone="note")] if pairs else []


PAGE = Page(sections, results)
