"""What a recording would not have shown: in a sentence beside the verdict, as a section, and in results.json."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from cmm_uq.analysis.diagnosis.showing import PLACES
from cmm_uq.analysis.diagnosis.unseen import POWER, Periods, Smallest
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, commas, listed, number, say
from cmm_uq.base.units import Unit
from cmm_uq.certificate.document import Column, Paragraph, Section, Table
from cmm_uq.certificate.result import Diagnosed
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.machine.physics.catalogue import every

_NAMED = 5
"""Effects that the sentence beside the verdict names."""

_RANGES = 3


def without_power(found: Diagnosed) -> Text:
    """What follows a verdict of agreement where even a plausible common effect would not have shown; else nothing."""
    if found.diagnosis.verdict != "consistent":
        return NOTHING
    order = {name: i for i, name in enumerate(every())}
    blind = sorted((row for row in found.unseen if row.blind), key=lambda row: order.get(row.effect, len(order)))
    if not blind:
        return NOTHING
    words = [say("{title:small} up to {size}", title=row.title, size=_size(_invisible(row), row.unit)) for row in blind]
    more = len(words) - _NAMED
    if more > 1:
        words = [*words[:_NAMED], say("{more} more", more=more)]
    return say("But this recording could not have shown: {effects}.", effects=listed(words))


def _invisible(row: Smallest) -> float:
    return row.allowed if row.detected is None else min(row.detected, row.allowed)


def unseen_section(found: Diagnosed) -> Section:
    """The smallest amplitude of each common effect that the recording would have shown, and rarer ones that it would not."""
    rows = tuple(
        (row.title, _found(row, row.detected), _found(row, row.named), _size(row.allowed, row.unit), _why(row))
        for row in found.unseen
        if row.common or not row.shown
    )
    if not rows:
        return Section(say("What would not have been seen"), ())
    heads = (
        Column(say("Error"), numeric=False), Column(say("Found from")), Column(say("Named from")),
        Column(say("Reckoned with up to")), Column(say("Why, and for which periods"), numeric=False),
    )  # fmt: skip
    notes = (
        say(
            "With the noise that was found and beside what was asserted, an error of this size would have been found, or "
            "called by its right name, in {power:.0f} of 100 such recordings; “not found” where even the largest error "
            "reckoned with would not. In closed form: mostly within 15 %, a name with a close rival within a factor of two.",
            power=100 * POWER,
        ),
    )
    beside = without_power(found)
    head = (Paragraph(beside, tone="warning"),) if beside else ()
    return Section(
        say("What would not have been seen"),
        (*head, Table(say("Smallest errors that would have shown"), heads, rows, notes)),
    )


def _found(row: Smallest, size: float | None) -> Text:
    return say("not found") if size is None or size > row.allowed else _size(size, row.unit)


def _size(value: float, unit: Unit) -> Text:
    return say("{value}\u00a0{unit}", value=number(value, ".2g" if value < 100 else ".0f"), unit=unit)


def _why(row: Smallest) -> Text:
    said: list[Text] = []
    if row.share == 0 and not row.taken_up:
        said.append(say("moves nothing that is observed here"))
    elif row.taken_up and row.share < 1e-3:
        said.append(say("taken up by {effects}", effects=listed(_titles(row.taken_up))))
    elif row.taken_up:
        said.append(say("mostly taken up by {effects}", effects=listed(_titles(row.taken_up))))
    if row.detected is not None and row.detected > row.allowed and row.detected < 100 * row.allowed:
        said.append(say("it would take {size}", size=_size(row.detected, row.unit)))
    if row.periods is not None:
        said.append(_periods(row.periods, row))
    return commas(said) if said else DASH


def _titles(owners: Sequence[str]) -> list[Text]:
    return [_taker(name) for name in owners]


def _taker(name: str) -> Text:
    """What takes an error up, in words."""
    if name == PLACES:
        return say("the place of the artefact")
    if name == ARTEFACT:
        return say("the size of the artefact")
    effect = every().get(name)
    return Verbatim(name) if effect is None else say("{title:small}", title=effect.title)


def _periods(periods: Periods, row: Smallest) -> Text:
    every_one = say("{low:.3g} to {high:.3g}\u00a0{unit}", low=periods.low, high=periods.high, unit=periods.unit)
    if periods.worst is None:
        return say("none of {every_one} resolved by these positions", every_one=every_one)
    worst = say("{every_one}, at worst {size}", every_one=every_one, size=_size(periods.worst, row.unit))
    if not periods.unresolved:
        return worst
    ranges = [
        number(low, ".3g") if low == high else say("{low:.3g} to {high:.3g}", low=low, high=high)
        for low, high in periods.unresolved
    ]
    if len(ranges) > _RANGES:
        ranges = [*ranges[:_RANGES], say("{more} more ranges", more=len(ranges) - _RANGES)]
    return say("{worst}; not resolved: {ranges}\u00a0{unit}", worst=worst, ranges=listed(ranges), unit=periods.unit)


def unseen_data(rows: Sequence[Smallest]) -> list[dict[str, Any]]:
    """The same for results.json, every effect."""
    return [
        {
            "effect": row.effect, "parameter": row.parameter, "detected": row.detected, "named": row.named,
            "allowed": row.allowed, "shown": row.shown, "share": row.share,
            "taken_up_by": [name for name in row.taken_up if name != PLACES],
            **({} if row.periods is None else {"periods": _periods_data(row.periods)}),
        }
        for row in rows
    ]  # fmt: skip


def _periods_data(periods: Periods) -> dict[str, Any]:
    return {
        "parameter": periods.parameter, "low": periods.low, "high": periods.high, "worst": periods.worst,
        "unresolved": [list(each) for each in periods.unresolved],
    }  # fmt: skip
