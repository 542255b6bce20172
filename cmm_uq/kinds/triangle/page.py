"""What a certificate shows of a triangle standard: its angles, the sides in every placing, and two ways to the parameters."""

from __future__ import annotations

from typing import cast

import numpy as np

from cmm_uq.documents.document import Block, Column, Paragraph, Plot, Section, Table
from cmm_uq.documents.outcome import Page
from cmm_uq.documents.plots import length_plot
from cmm_uq.documents.result import Result
from cmm_uq.documents.wording import expanded
from cmm_uq.errors import CmmUqError
from cmm_uq.kinds.triangle.equations import PARAMETERS, solve_equations
from cmm_uq.kinds.triangle.observe import Triangle
from cmm_uq.physics.catalogue import every
from cmm_uq.points import Floats
from cmm_uq.uncertainty.rounding import rounded
from cmm_uq.units import ARCSECOND, MICROMETRE

_SIDES = ("1–2", "2–3", "3–1")
_ALIKE = 0.9
"""Correlation from which on two estimates are hardly told apart."""


def sections(result: Result) -> list[Section]:
    """The standard, its sides as found, and the parameters by the fitted model and by the source's equations."""
    triangle = cast("Triangle", result.artefact)
    return [
        Section("The triangle", (_standard(triangle, result.posterior.seed), _sides(result, triangle))),
        Section("Parameters by two ways", (*_two_ways(result, triangle), *_alike(result))),
    ]


def _standard(triangle: Triangle, seed: int) -> Table:
    figures, draws = triangle.standard.figures(), triangle.standard.draws(seed)
    rows = []
    for i, name in enumerate(_SIDES):
        value, U = rounded(float(figures.sides[i]), 2 * float(draws.sides[:, i].std()))
        rows.append((f"Side {name}", value, U, "mm"))
    for i in range(3):
        degrees, spread = float(np.degrees(figures.angles[i])), 2 * float(draws.angles[:, i].std())
        U = rounded(0.0, spread / ARCSECOND)[1]
        rows.append((f"Angle at {i + 1}", rounded(degrees, float(np.degrees(spread)))[0], f"{U}″", "°"))
    value, U = rounded(float(figures.height), 2 * float(draws.height.std()))
    rows.append(("Height over side 1–2", value, U, "mm"))
    columns = (Column("Figure", numeric=False), Column("Value"), Column("U"), Column("Unit", numeric=False))
    note = (
        f"U (k = 2) by Monte Carlo, {len(draws.height)} draws of the dimensions of blocks and cylinders; angles by the cosine "
        "rule."
    )
    return Table("Sides and angles of the standard at 20 °C", columns, tuple(rows), (note,))


def _lengths(triangle: Triangle, xyz: Floats) -> Floats:
    """Sides 1–2, 2–3, 3–1 of every (measurement, repeat) in order, (r, 3) mm at 20 °C."""
    points = triangle.points
    order = np.lexsort((points.point, points.group))
    corner = (xyz / triangle.expansion[:, None])[order].reshape(-1, 3, 3)
    return np.asarray(np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2), dtype=np.float64)


def _sides(result: Result, triangle: Triangle) -> Plot:
    points = triangle.points
    found = _lengths(triangle, points.xyz)
    before = (found - triangle.standard.sides).ravel() / MICROMETRE
    predicted = result.model.predicted(result.posterior.draws.mean(axis=0))
    after = (found - _lengths(triangle, predicted)).ravel() / MICROMETRE
    measurement = points.measurement[np.lexsort((points.point, points.group))].reshape(-1, 3)
    expanded_side = 2 * np.sqrt(2) * result.noise.coordinate.value
    return length_plot(
        measurement.ravel().astype(np.float64), before, after, expanded_before_um=expanded_side,
        expanded_after_um=expanded_side, reference="certified side", position_label="Placing (its three sides side by side)",
        caption="Each side minus its certified length, as recorded and after the fitted model, with U (k = 2).",
        alternative=(
            f"{len(before)} sides: as recorded they deviate by {before.min():.1f} to {before.max():.1f} µm; after the fitted "
            f"model {after.min():.1f} to {after.max():.1f} µm remain."
        ),
    )  # fmt: skip


def _two_ways(result: Result, triangle: Triangle) -> list[Block]:
    try:
        solution = solve_equations(triangle)
    except CmmUqError as refusal:
        return [Paragraph(f"The source's equations have no solution here. {refusal}", tone="note")]
    u = solution.u(result.noise.coordinate.value * MICROMETRE, triangle.standard.u)
    free = {effect for combination in result.undetermined for effect, _ in combination}
    rows = []
    for name, equation, own_u in zip(PARAMETERS, solution.values, u, strict=True):
        value, U = rounded(float(equation), 2 * float(own_u))
        fitted = ("", "")
        if name in result.parameters:
            quantity = next(iter(result.parameters[name].values()))
            fitted = ("not determined", "") if name in free else expanded(quantity)[:2]
        effect = every()[name]
        rows.append((effect.title, value, U, *fitted, effect.reported[0].unit))
    columns = (
        Column("Parameter", numeric=False), Column("Equations"), Column("U"), Column("Fitted model"), Column("U"),
        Column("Unit", numeric=False),
    )  # fmt: skip
    notes = (
        "Equations: one after the other from the sides of aligned placings (Manlay, Fast checking of CMM geometry with a "
        "patented tool), U (k = 2). Fitted model: all observations at once.",
    )
    return [Table("Scale, squareness, pitch, yaw and roll", columns, tuple(rows), notes)]


def _alike(result: Result) -> list[Block]:
    """Pairs of effects that these placings hardly tell apart."""
    draws = result.posterior.draws
    unknowns = [u for u in result.posterior.unknowns if u.key[0] in result.parameters]
    correlation = np.atleast_2d(np.corrcoef(draws[:, : len(unknowns)], rowvar=False))
    titles = [next(e.title for e in result.model.effects if e.name == u.key[0]) for u in unknowns]
    pairs = [
        f"{titles[j]} and {titles[i]} ({correlation[i, j]:+.2f})".replace("-", "−")
        for i in range(len(unknowns))
        for j in range(i)
        if abs(correlation[i, j]) > _ALIKE
    ]
    text = f"Hardly told apart by these placings (correlation): {'; '.join(pairs)}."
    return [Paragraph(text, tone="note")] if pairs else []


PAGE = Page(sections)
