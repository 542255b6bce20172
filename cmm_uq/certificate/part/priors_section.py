"""How large the recording of the calibration shows each family of errors to be, and what rests on what was known before."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from cmm_uq.analysis.parts.influence import ALL, MATTERS, PriorInfluence
from cmm_uq.base.messages import DASH, Text, Verbatim, commas, number, say, signed
from cmm_uq.base.points import Floats
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import Column, Paragraph, Section, Table, section, table
from cmm_uq.certificate.part.measurement import PartMeasurement
from cmm_uq.certificate.wording import effect_title
from cmm_uq.machine.model.field import FAMILIES, allowed

_LITTLE = 0.01  # change that is not worth a line
_SHOWN = 0.005  # change that is not zero as printed


def priors_section(found: PartMeasurement) -> Section:
    """Sizes of the families, and what would change with other priors."""
    title = say("What the recording says of the machine's errors, and what it does not")
    if not found.influence:
        return section(title, _bounds(found))
    return section(
        title,
        Paragraph(priors_words(found), "warning" if resting(found) else "plain"),
        _sizes(found),
        _bounds(found),
        _changes(found),
    )


def resting(found: PartMeasurement) -> list[str]:
    """Characteristics whose U, or value by a part of U, changes by a tenth with another prior of one family or of all."""
    names = [one.name for one in found.characteristics]
    k = np.array([one.U / one.u if one.u else np.inf for one in found.stated])
    beyond = np.zeros(len(names), dtype=bool)
    for one in found.influence:
        beyond |= (np.abs(one.u - 1) >= MATTERS) | (np.abs(one.shift) / k >= MATTERS)
    return [name for name, rests in zip(names, beyond, strict=True) if rests]


def priors_words(found: PartMeasurement) -> Text:
    """What rests on priors, in a sentence."""
    names = resting(found)
    if not names:
        return say(
            "Where priors of the machine's errors are half as wide, or twice, no figure changes by a tenth of U."
        )
    return say(
        "{count} of {all} characteristics rest on what was taken for the machine's errors before its recording: their value "
        "or U changes by a tenth of U or more where a prior is half as wide, or twice.",
        count=len(names), all=len(found.stated),
    )  # fmt: skip


def family_words(name: str) -> Text:
    if name == ALL:
        return say("All of them together")
    return FAMILIES.get(name) or effect_title(name)


def _sizes(found: PartMeasurement) -> Table | None:
    heads = (say("Errors"), Column(say("Physics allows")), Column(say("As recorded")), Column(say("95 % interval")))
    rows = []
    for one in families_data(found):
        of_unit = unit(str(one["unit"]))
        size, low, high, most = (number(one[key], ".2g") for key in ("size", "low", "high", "allowed"))
        rows.append((
            family_words(str(one["family"])), say("{value} {unit}", value=most, unit=of_unit),
            say("{value} {unit}", value=size, unit=of_unit), say("{low} to {high} {unit}", low=low, high=high, unit=of_unit),
        ))  # fmt: skip
    return table(say("Sizes of errors, root mean square"), heads, rows, say(
        "A family has one size, half-normal beforehand with what physics allows, and as the recording of the calibration "
        "shows it afterwards; its members of which little is seen are taken as large as the others. Of play the size of the "
        "gap, of periodic errors of the amplitude."
    ))  # fmt: skip


def _bounds(found: PartMeasurement) -> Table | None:
    heads = (say("Errors"), Column(say("At most"), unit("µm")), say("Stated by"))
    rows = (
        (commas([effect_title(name) for name in one.errors]), number(one.largest_um, "g"), Verbatim(one.source))
        for one in found.job.facts.machine_state.bound
    )
    note = say(
        "Of play the gap, of a periodic error the amplitude, which 95 of 100 do not exceed. They are taken as stated: the "
        "recording of the calibration cannot show these errors by itself."
    )
    return table(say("Bounds that are stated"), heads, rows, note)


def _changes(found: PartMeasurement) -> Table | None:
    heads = (say("Errors"), Column(say("Prior times")), Column(say("u changes by"), unit("%")), say("Of"),
             Column(say("Value changes by"), unit("%")), say("Of"))  # fmt: skip
    shown = [one for one in found.influence if one.family == ALL or not _little(one)]
    return table(say("If this were different"), heads, (_change(found, one) for one in shown), say(
        "The largest change of all characteristics, of the value as a part of its u. Errors of a family that the recording "
        "hardly shows are scaled with its prior. Priors that would change nothing by more than 1 % are left out."
    ))  # fmt: skip


def _little(one: PriorInfluence) -> bool:
    """Whether nothing changes by more than a hundredth."""
    return bool(np.all(np.abs(one.u - 1) < _LITTLE) and np.all(np.abs(one.shift) < _LITTLE))


def _change(found: PartMeasurement, one: PriorInfluence) -> tuple[Text, ...]:
    name, times = family_words(one.family), number(one.times, "g")
    return name, times, *_largest(found, one.u - 1), *_largest(found, one.shift)


def _largest(found: PartMeasurement, changes: Floats) -> tuple[Text, Text]:
    """The largest of changes (c,) in per cent, and whose it is; a zero is nobody's."""
    i = int(np.argmax(np.abs(changes)))
    if abs(changes[i]) < _SHOWN:
        return number(0.0, ".0f"), DASH
    return signed(100 * changes[i], ".0f"), Verbatim(found.characteristics[i].name)


def families_data(found: PartMeasurement) -> list[dict[str, Any]]:
    """Size of each family as the recording shows it."""
    rows = []
    for name, sizes in found.given.machine.scales.items():
        most, of_unit = allowed(name)
        low, median, high = (most * np.quantile(sizes, [0.025, 0.5, 0.975])).tolist()
        rows.append({"family": name, "allowed": most, "unit": of_unit, "size": median, "low": low, "high": high})
    return rows


def priors_data(influence: Iterable[PriorInfluence]) -> list[dict[str, Any]]:
    return [
        {"family": one.family, "times": one.times, "u_ratio": one.u.tolist(), "shift_u": one.shift.tolist()}
        for one in influence
    ]
