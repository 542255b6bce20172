"""What the certificate of a triangle of gauge blocks and cylinders states and shows beside the estimates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import degrees
from typing import Any, cast

import numpy as np

from cmm_uq.artefacts.triangle.equations import PARAMETERS, solve_equations
from cmm_uq.artefacts.triangle.observe import DRAWS, Triangle
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, Verbatim, number, say, semicolons, signed
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import ARCSECOND, MICROMETRE, unit
from cmm_uq.certificate.document import Block, Column, Paragraph, Plot, Section, Table
from cmm_uq.certificate.outcome import Page
from cmm_uq.certificate.plots.residuals import length_plot
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.wording import deviating, expanded, refusal
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.maths.uncertainty.quantity import rounded
from cmm_uq.maths.uncertainty.type_a import factor_of_noise

SIDES = ("1–2", "2–3", "3–1")
ALIKE = 0.9  # correlation from which on two estimates are hardly told apart


@dataclass(frozen=True)
class StandardFigures:
    """Figures of the standard at 20 °C, each with U for 95 % by Monte Carlo: sides and height, mm; angles, rad."""

    sides: tuple[tuple[float, float], ...]
    angles: tuple[tuple[float, float], ...]
    height: tuple[float, float]
    draws: int

    def as_data(self) -> dict[str, Any]:
        return {
            "sides_mm": {name: {"value": value, "U": U} for name, (value, U) in zip(SIDES, self.sides, strict=True)},
            "angles": {
                str(corner): {"value_deg": float(np.degrees(value)), "U_arcsec": U / ARCSECOND}
                for corner, (value, U) in enumerate(self.angles, 1)
            },
            "height_mm": {"value": self.height[0], "U": self.height[1]},
            "draws": self.draws,
        }


@dataclass(frozen=True, eq=False)
class Sides:
    """Sides 1–2, 2–3, 3–1 of every placing against the certified ones, µm."""

    measurement: Ints  # (r,) of each (measurement, repeat)
    before_um: Floats  # before_um, after_um: (r, 3) as recorded, and after the fitted model
    after_um: Floats
    expanded_um: float  # expanded_um, coverage_factor: U of a side for the noise of its ends, and its k
    coverage_factor: float


@dataclass(frozen=True)
class ByEquations:
    """A parameter of an effect by the source's equations, in its unit, with u, U and k for 95 % as stated."""

    effect: Effect
    value: float
    u: float
    expanded: float
    coverage_factor: float


@dataclass(frozen=True, eq=False)
class TriangleFigures:
    """All of these of a result."""

    result: Result

    @property
    def _triangle(self) -> Triangle:
        return cast("Triangle", self.result.artefact)

    @cached_property
    def standard(self) -> StandardFigures:
        standard = self._triangle.standard
        figures, draws = standard.figures(), standard.draws(self.result.posterior.seed)
        sides, angles = (
            tuple((float(values[i]), _expanded(drawn[:, i])) for i in range(3))
            for values, drawn in ((figures.sides, draws.sides), (figures.angles, draws.angles))
        )
        return StandardFigures(sides, angles, (float(figures.height), _expanded(draws.height)), DRAWS)

    @cached_property
    def sides(self) -> Sides:
        triangle, points = self._triangle, self._triangle.points
        found = _lengths(triangle, points.xyz)
        predicted = self.result.model.predicted(self.result.posterior.draws.mean(axis=0))
        before = (found - triangle.standard.sides) / MICROMETRE
        after = (found - _lengths(triangle, predicted)) / MICROMETRE
        measurement = points.measurement[np.lexsort((points.point, points.group))].reshape(-1, 3)[:, 0]
        noise, longest = self.result.noise, float(np.max(triangle.standard.sides))
        return Sides(measurement, before, after, *self.result.at_least(
            "sides.U_um", float(np.sqrt(2)) * noise.expanded, noise.coverage_factor, unit("µm"), longest
        ))  # fmt: skip

    @cached_property
    def equations(self) -> tuple[ByEquations, ...] | Text:
        triangle = self._triangle
        try:
            solution = solve_equations(triangle)
        except CmmUqError as error:
            return refusal(error)
        noise, dimensions = self.result.noise.coordinate, triangle.standard.u
        by_noise, known = solution.u(noise.value * MICROMETRE, 0 * dimensions), solution.u(0.0, dimensions)
        known = np.hypot(known, solution.per_dimension @ triangle.standard.dimensions * self.result.relative_doubt)
        found = []
        for name, value, one, other in zip(PARAMETERS, solution.values, by_noise, known, strict=True):
            effect, u, k = every()[name], float(np.hypot(one, other)), factor_of_noise(noise, one, other)
            stated = self.result.at_least(f"equations.{name}", k * u, k, effect.reported[0].unit)
            found.append(ByEquations(effect, float(value), u, *stated))
        return tuple(found)

    @cached_property
    def alike(self) -> tuple[tuple[str, str, float], ...]:
        """Pairs of effects that these placings hardly tell apart, with the correlation of their estimates."""
        result = self.result
        names = [u.key[0] for u in result.posterior.unknowns if u.key[0] in result.parameters]
        correlation = np.atleast_2d(np.corrcoef(result.values[:, : len(names)], rowvar=False))
        return tuple(
            (names[j], names[i], float(correlation[i, j]))
            for i in range(len(names))
            for j in range(i)
            if abs(correlation[i, j]) > ALIKE
        )


def results(result: Result) -> Mapping[str, Any]:
    found = TriangleFigures(result)
    equations, sides = found.equations, found.sides
    return {
        "standard": found.standard.as_data(),
        "sides": [
            {"measurement": int(number), "before_um": before, "after_um": after}
            for number, before, after in zip(
                sides.measurement, sides.before_um.tolist(), sides.after_um.tolist(), strict=True
            )
        ],
        "equations": {"refused": equations} if isinstance(equations, str) else {
            one.effect.name: {
                one.effect.reported[0].name: {"value": one.value, "u": one.u, "U": one.expanded, "k": one.coverage_factor}
            }
            for one in equations
        },
        **({} if isinstance(equations, str) else {"conditional": {"equations": "white noise, and a few observations each"}}),
        "hardly_told_apart": [
            {"effects": [one, other], "correlation": correlation} for one, other, correlation in found.alike
        ],
    }  # fmt: skip


def _expanded(draws: Floats) -> float:
    """U of draws (N,): half the width of their 95 % interval."""
    low, high = np.quantile(draws, [0.025, 0.975])
    return 0.5 * float(high - low)


def _lengths(triangle: Triangle, xyz: Floats) -> Floats:
    """Sides 1–2, 2–3, 3–1 of every (measurement, repeat) in order, (r, 3) mm at 20 °C."""
    points = triangle.points
    order = np.lexsort((points.point, points.group))
    corner = (xyz / triangle.expansion[:, None])[order].reshape(-1, 3, 3)
    return np.asarray(np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2), dtype=np.float64)


def sections(result: Result) -> list[Section]:
    found = TriangleFigures(result)
    return [
        Section(say("The triangle"), (_standard(found.standard), _sides(found.sides))),
        Section(say("Parameters by two ways"), (*_two_ways(result, found.equations), *_alike(result, found))),
    ]


def _standard(standard: StandardFigures) -> Table:
    rows: list[tuple[Text, ...]] = [
        (say("Side {name}", name=Verbatim(name)), *rounded(*side), unit("mm"))
        for name, side in zip(SIDES, standard.sides, strict=True)
    ]
    for i, (angle, spread) in enumerate(standard.angles, 1):
        shown = rounded(degrees(angle), degrees(spread))[0]
        rows.append((say("Angle at {i}", i=i), shown, say("{U}″", U=rounded(0.0, spread / ARCSECOND)[1]), unit("°")))
    rows.append((say("Height over side 1–2"), *rounded(*standard.height), unit("mm")))
    columns: tuple[Column, ...] = (Column(say("Quantity"), numeric=False), Column(say("Value")), Column(say("U")))
    columns += (Column(say("Unit"), numeric=False),)
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
        if one.effect.name in result.parameters:
            quantity = next(iter(result.parameters[one.effect.name].values()))
            fitted = (say("not determined"), NOTHING) if one.effect.name in result.free else expanded(quantity)[:2]
        rows.append((one.effect.title, value, U, *fitted, one.effect.reported[0].unit))
    columns: tuple[Column, ...] = (Column(say("Parameter"), numeric=False), Column(say("Equations")), Column(say("U")))
    columns += (Column(say("Fitted model")), Column(say("U")), Column(say("Unit"), numeric=False))
    notes = (
        say(
            "Equations: one after the other from the sides of aligned placings (Manlay, Fast checking of "
            "CMM geometry with a patented tool), each from a few of the observations, U for a coverage probability of 95 %, "
            "conditional on white noise. Fitted model: all observations at once, U averaged over what the noise may be."
        ),
    )
    return [Table(say("Scale, squareness, pitch, yaw and roll"), columns, tuple(rows), notes)]


def _alike(result: Result, found: TriangleFigures) -> list[Block]:
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
