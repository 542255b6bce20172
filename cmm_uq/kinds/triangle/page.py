"""What a certificate shows of a triangle standard: its angles, the sides in every placing, and two ways to the parameters."""

from __future__ import annotations

from math import degrees

from cmm_uq.documents.document import Block, Column, Paragraph, Plot, Section, Table
from cmm_uq.documents.outcome import Page
from cmm_uq.documents.plots import length_plot
from cmm_uq.documents.result import Result
from cmm_uq.documents.wording import expanded
from cmm_uq.kinds.triangle.analysis import SIDES, ByEquations, Sides, Standard, TriangleFigures, results
from cmm_uq.uncertainty.rounding import rounded
from cmm_uq.units import ARCSECOND


def sections(result: Result) -> list[Section]:
    """The standard, its sides as found, and the parameters by the fitted model and by the source's equations."""
    found = TriangleFigures(result)
    return [
        Section("The triangle", (_standard(found.standard), _sides(found.sides))),
        Section("Parameters by two ways", (*_two_ways(result, found.equations), *_alike(result, found))),
    ]


def _standard(standard: Standard) -> Table:
    rows = [(f"Side {name}", *rounded(*side), "mm") for name, side in zip(SIDES, standard.sides, strict=True)]
    for i, (angle, spread) in enumerate(standard.angles, 1):
        shown = rounded(degrees(angle), degrees(spread))[0]
        rows.append((f"Angle at {i}", shown, f"{rounded(0.0, spread / ARCSECOND)[1]}″", "°"))
    rows.append(("Height over side 1–2", *rounded(*standard.height), "mm"))
    columns = (Column("Figure", numeric=False), Column("Value"), Column("U"), Column("Unit", numeric=False))
    note = (
        f"U (k = 2) by Monte Carlo, {standard.draws} draws of the dimensions of blocks and cylinders; angles by the cosine "
        "rule."
    )
    return Table("Sides and angles of the standard at 20 °C", columns, tuple(rows), (note,))


def _sides(sides: Sides) -> Plot:
    before, after = sides.before_um.ravel(), sides.after_um.ravel()
    return length_plot(
        sides.measurement.repeat(3).astype(float), before, after, expanded_before_um=sides.expanded_um,
        expanded_after_um=sides.expanded_um, reference="certified side",
        position_label="Placing (its three sides side by side)",
        caption="Each side minus its certified length, as recorded and after the fitted model, with U (k = 2).",
        alternative=(
            f"{len(before)} sides: as recorded they deviate by {before.min():.1f} to {before.max():.1f} µm; after the fitted "
            f"model {after.min():.1f} to {after.max():.1f} µm remain."
        ),
    )  # fmt: skip


def _two_ways(result: Result, equations: tuple[ByEquations, ...] | str) -> list[Block]:
    if isinstance(equations, str):
        return [Paragraph(f"The source's equations have no solution here. {equations}", tone="note")]
    rows = []
    for one in equations:
        value, U = rounded(one.value, 2 * one.u)
        fitted = ("", "")
        if one.effect in result.parameters:
            quantity = next(iter(result.parameters[one.effect].values()))
            fitted = ("not determined", "") if one.effect in result.free else expanded(quantity)[:2]
        rows.append((one.title, value, U, *fitted, one.unit))
    columns = (
        Column("Parameter", numeric=False), Column("Equations"), Column("U"), Column("Fitted model"), Column("U"),
        Column("Unit", numeric=False),
    )  # fmt: skip
    notes = (
        "Equations: one after the other from the sides of aligned placings (Manlay, Fast checking of CMM geometry with a "
        "patented tool), U (k = 2). Fitted model: all observations at once.",
    )
    return [Table("Scale, squareness, pitch, yaw and roll", columns, tuple(rows), notes)]


def _alike(result: Result, found: TriangleFigures) -> list[Block]:
    """Pairs of effects that these placings hardly tell apart."""
    titles = {effect.name: effect.title for effect in result.model.effects}
    pairs = [
        f"{titles[one]} and {titles[other]} ({correlation:+.2f})".replace("-", "−")
        for one, other, correlation in found.alike
    ]
    text = f"Hardly told apart by these placings (correlation): {'; '.join(pairs)}."
    return [Paragraph(text, tone="note")] if pairs else []


PAGE = Page(sections, results)
