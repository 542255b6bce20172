"""Other methods beside the virtual measurement of a part: figures, why they differ, what each sees, conditions, budgets.

Other methods on a part, as ``results.json`` has them: values in mm or °, uncertainties likewise, shares from 0 to 1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import degrees, isfinite, log, radians
from typing import Any

from cmm_uq.analysis.parts.in_words import FAMILIES
from cmm_uq.analysis.parts.methods.comparison import METHODS
from cmm_uq.analysis.parts.methods.method import (
    ComparedCharacteristic,
    Method,
    MethodComparison,
    MethodFigure,
    MethodResult,
    Seen,
)
from cmm_uq.base.messages import DASH, NOTHING, Number, Text, Verbatim, number, plural, say, sentences, signed
from cmm_uq.base.units import ARCSECOND, MICROMETRE, Unit, unit
from cmm_uq.certificate.document import Block, Column, Paragraph, Section, Table
from cmm_uq.maths.uncertainty.budget import BudgetLine
from cmm_uq.maths.uncertainty.quantity import figure, rounded, significant

_NOTHING = 5e-4  # share of a variance that is printed as none
# characteristics for which is told why methods differ, and whose budgets are listed: those that differ most
EXPLAINED = 6

FOLLOWED: Mapping[Method, Text] = {
    "calibrated_part": say(
        "Calibrated part: by public descriptions of ISO 15530-3:2011, U = k √(u_cal² + u_p² + u_b² + u_w²) with k = 2; an "
        "error that is not corrected is added (ISO/TS 15530-3:2004). The text of the standard was not at hand. The "
        "uncertainty of the mean of the repeats is not in that formula."
    ),
    "orientations": say(
        "Several orientations: by the public summary of ISO/DTS 15530-2 (multiple orientations and repetitions, analysis of "
        "variance, standards of length and of the probe's qualification), which was not published when this was written. Its "
        "formulas were not at hand: the mean is corrected by the standards, and k is of the 95 % interval at the effective "
        "degrees of freedom."
    ),
}

SEEN: Mapping[Seen, Text] = {
    "drawn": say("as known of it"), "varied": say("as scatter"), "systematic": say("as a systematic error"),
    "corrected": say("corrected by a standard"), "stated": say("as stated"), "unseen": say("not"),
}  # fmt: skip


def methods_section(comparison: MethodComparison | None) -> Section:
    """All of it; a section of no blocks where the job has no other method."""
    title = say("Other methods beside it")
    if comparison is None or not comparison.characteristics:
        return Section(title, ())
    told = _most_apart(comparison)
    blocks: list[Block] = [Paragraph(_APART)]
    for angle in (False, True):
        own = [one for one in comparison.characteristics if _angle(comparison, one) == angle]
        if own:
            blocks.append(_figures(own, angle=angle))
    blocks += [
        Paragraph(say("Characteristic {name}: {why}", name=Verbatim(one.name), why=sentences(one.why)))
        for one in told
        if one.why
    ]
    if len(told) < len(comparison.characteristics):
        count = len(told)
        blocks.append(Paragraph(plural(count, one=say("Told is of the characteristic whose methods differ most."), many=say(
            "Told is of the {count} characteristics whose methods differ most.", count=count)), "note"))  # fmt: skip
    blocks += [_seen(comparison.methods), _conditions(comparison.methods)]
    blocks += [_budgets(method, [one.name for one in told]) for method in comparison.methods]
    blocks += [Paragraph(FOLLOWED[method.method], "note") for method in comparison.methods]
    return Section(title, tuple(blocks))


_APART = say(
    "The same characteristics by other methods, from recordings of their own. They ask different questions: virtual "
    "measurements draw all that the machine's certificate leaves open; the others see what varied while they measured, and "
    "what their standards tell."
)


def _angle(comparison: MethodComparison, one: ComparedCharacteristic) -> bool:
    return any(found.angle for method in comparison.methods if (found := method.of(one.name)) is not None)


def _most_apart(comparison: MethodComparison) -> list[ComparedCharacteristic]:
    """Those whose uncertainties differ by the largest factor, in the order of the plan."""

    def factor(one: ComparedCharacteristic) -> float:
        positive = [stated.u for stated in one.stated if stated.u > 0]
        return log(max(positive) / min(positive)) if positive else 0.0

    every = list(comparison.characteristics)
    kept = sorted(every, key=factor, reverse=True)[:EXPLAINED]
    return [one for one in every if one in kept]


def _units(*, angle: bool) -> tuple[Unit, Unit, float, float]:
    """Units of values and of uncertainties, and how large each is, mm or rad."""
    return (unit("°"), unit("″"), radians(1.0), ARCSECOND) if angle else (unit("mm"), unit("µm"), 1.0, MICROMETRE)


def _figures(own: Sequence[ComparedCharacteristic], *, angle: bool) -> Table:
    large, small, per_large, per_small = _units(angle=angle)
    columns = (
        Column(say("Characteristic"), numeric=False), Column(say("Method"), numeric=False), Column(say("Value"), large),
        Column(say("u"), small), Column(say("U"), small), Column(say("Eₙ")),
    )  # fmt: skip
    rows = []
    for one in own:
        normalised = {pair.other: pair.normalised for pair in one.pairs if pair.one == "virtual"}
        for stated in one.stated:
            value: Text = DASH
            if stated.value is not None:
                value = rounded(stated.value / per_large, stated.U / per_large)[0]
            apart = signed(normalised[stated.method], ".2f") if stated.method in normalised else DASH
            name = say("{method:capital}", method=METHODS[stated.method])
            rows.append((Verbatim(one.name), name, value, significant(stated.u / per_small),
                         significant(stated.U / per_small), apart))  # fmt: skip
    note = say(
        "Eₙ: difference of the virtual measurement's value from this one over √(U₁² + U₂²) (ISO/IEC 17043); beyond 1 the "
        "methods contradict each other. Values that come from the same measured points have most of their error in "
        "common, so that theirs is small."
    )
    return Table(
        say("Angles by each method") if angle else say("Lengths by each method"), columns, tuple(rows), (note,)
    )


def _seen(methods: Sequence[MethodResult]) -> Table:
    columns = (
        Column(say("Cause"), numeric=False), Column(say("{method:capital}", method=METHODS["virtual"]), numeric=False),
        *(Column(say("{method:capital}", method=METHODS[one.method]), numeric=False) for one in methods),
    )  # fmt: skip
    rows = tuple(
        (words, SEEN["drawn"], *(SEEN[one.seen.get(family, "unseen")] for one in methods))
        for family, words in FAMILIES.items()
    )
    return Table(say("How each method takes hold of a cause"), columns, rows)


def _conditions(methods: Sequence[MethodResult]) -> Table:
    met = {True: say("met"), False: say("not met"), None: say("not stated")}
    columns = (
        Column(say("Method"), numeric=False),
        Column(say("What it asks for"), numeric=False),
        Column(say("This test"), numeric=False),
    )
    rows = tuple(
        (say("{method:capital}", method=METHODS[one.method]), condition.text, met[condition.met])
        for one in methods
        for condition in one.conditions
    )
    return Table(say("Conditions of the tests"), columns, rows)


def _budgets(method: MethodResult, told: Sequence[str]) -> Table:
    """Budgets of some characteristics line by line."""
    columns = (
        Column(say("Characteristic"), numeric=False), Column(say("Contribution"), numeric=False),
        Column(say("u, its part"), numeric=False), Column(say("ν")), Column(say("Share"), unit("%")),
    )  # fmt: skip
    rows = [row for name in told if (one := method.of(name)) is not None for row in _lines(one)]
    caption = say("Budgets by {method}", method=METHODS[method.method])
    return Table(caption, columns, tuple(rows), tuple(_notes(method, told)))


def _lines(one: MethodFigure) -> list[tuple[Text, ...]]:
    _, small, _, per_small = _units(angle=one.angle)
    rows: list[tuple[Text, ...]] = []
    for depth, line, share in one.budget.flat():
        if not line.u or share < _NOTHING:
            continue
        part = say("{value} {unit}", value=significant(one.u * share**0.5 / per_small), unit=small)
        name = say("{indent}{name}", indent=Verbatim("\u2003" * depth), name=line.name)
        rows.append((Verbatim(one.name), name, part, _freedom(line), number(100 * share, ".1f")))
    told = say("{value} {unit}", value=significant(one.u / per_small), unit=small)
    whole = say("together, k = {k}", k=number(one.budget.k, ".2f"))
    dof = figure(one.budget.dof, 3) if isfinite(one.budget.dof) else Number("∞")
    return [*rows, (Verbatim(one.name), whole, told, dof, number(100.0, ".1f"))]


def _freedom(line: BudgetLine) -> Text:
    return figure(line.dof, 3) if isfinite(line.dof) else Number("∞")


def _notes(method: MethodResult, told: Sequence[str]) -> list[Text]:
    """Systematic errors that were found, and what became of them."""
    notes: list[Text] = []
    for one in (found for name in told if (found := method.of(name)) is not None):
        if one.systematic is None or (method.method == "orientations" and not one.systematic):
            continue
        _, small, _, per_small = _units(angle=one.angle)
        U = one.U / per_small
        error = rounded(one.systematic / per_small, U)[0] if U else NOTHING
        words = (
            say("{name}: systematic error {error} {unit}, taken off.", name=Verbatim(one.name), error=error, unit=small)
            if one.corrected
            else say("{name}: systematic error {error} {unit}, not taken off; its size is added to U.",
                     name=Verbatim(one.name), error=error, unit=small)
        )  # fmt: skip
        notes.append(words)
    return notes


def methods_data(comparison: MethodComparison | None) -> dict[str, Any] | None:
    """All of it; ``None`` where the job has no other method."""
    if comparison is None:
        return None
    return {
        "methods": [_method(one) for one in comparison.methods],
        "compared": [_compared(one) for one in comparison.characteristics],
    }


def _method(one: MethodResult) -> dict[str, Any]:
    return {
        "method": one.method,
        "characteristics": [_figure(each) for each in one.figures],
        "conditions": [{"asked": str.__str__(each.text), "met": each.met} for each in one.conditions],
        "seen": dict(one.seen),
    }


def _figure(one: MethodFigure) -> dict[str, Any]:
    def given(value: float | None) -> float | None:
        return degrees(value) if one.angle and value is not None else value

    budget = one.budget
    return {
        "name": one.name, "unit": "°" if one.angle else "mm", "value": given(one.value), "u": given(one.u), "U": given(one.U),
        "k": budget.k, "dof": budget.dof if isfinite(budget.dof) else None, "systematic_error": given(one.systematic),
        "corrected": one.corrected, "u_one_measurement": given(one.single), "scatter": given(one.scatter),
        "budget": [
            {"line": str.__str__(line.name), "depth": depth, "share": share,
             "dof": line.dof if isfinite(line.dof) else None}
            for depth, line, share in budget.flat()
        ],
    }  # fmt: skip


def _compared(one: ComparedCharacteristic) -> dict[str, Any]:
    return {
        "name": one.name,
        "normalised_errors": [{"one": pair.one, "other": pair.other, "E_n": pair.normalised} for pair in one.pairs],
        "why": [str.__str__(text) for text in one.why],
    }
