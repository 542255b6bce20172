"""Sizes of families of errors as a recording shows them, and what would change with what was taken for them before it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from cmm_uq.analysis.machine.influence import ALL, MATTERS, PriorInfluence
from cmm_uq.base.messages import DASH, Text, number, say, signed
from cmm_uq.base.points import Floats
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import Column, Table, table
from cmm_uq.certificate.wording import effect_title
from cmm_uq.machine.model.field import FAMILIES, allowed

_LITTLE = 0.01  # change that is not worth a line
_SHOWN = 0.5  # per cent that are not zero as printed


def resting(influence: Iterable[PriorInfluence], k: Floats) -> list[int]:
    """Places of figures whose U, or value by a part of U, changes by a tenth with another prior of one family or of all.

    ``k``: (c,) coverage factors.
    """
    beyond = np.zeros(len(k), dtype=bool)
    for one in influence:
        beyond |= (np.abs(one.u - 1) >= MATTERS) | (np.abs(one.shift) / k >= MATTERS)
    return [int(i) for i in np.flatnonzero(beyond)]


def family_words(name: str) -> Text:
    if name == ALL:
        return say("All of them together")
    return FAMILIES.get(name) or effect_title(name)


def sizes_table(scales: Mapping[str, Floats]) -> Table | None:
    """``scales``: draws (N,) of each family's size, over what physics allows."""
    figures = (say("Physics allows"), say("As recorded"), say("95 % interval from"), say("to"))
    heads: tuple[Text | Column, ...] = (say("Errors"), *map(Column, figures), say("Unit"))
    rows = (
        (
            family_words(str(one["family"])),
            *(number(one[key], ".2g") for key in ("allowed", "size", "low", "high")),
            unit(str(one["unit"])),
        )
        for one in families_data(scales)
    )
    return table(say("Sizes of errors, root mean square"), heads, rows, say(
        "A family has one size, half-normal beforehand with what physics allows, and as the recording of the calibration "
        "shows it afterwards; its members of which little is seen are taken as large as the others. Of play the size of the "
        "gap, of periodic errors of the amplitude."
    ))  # fmt: skip


def changes_table(influence: Iterable[PriorInfluence], names: Sequence[Text]) -> Table | None:
    """``names`` of the figures that the changes are of."""
    heads = (
        say("Errors"),
        Column(say("Prior times")),
        Column(say("u changes by"), unit("%")),
        say("Of"),
        Column(say("Value changes by"), unit("%")),
        say("Of"),
    )
    rows = (
        (family_words(one.family), number(one.times, "g"), *_largest(one.u - 1, names), *_largest(one.shift, names))
        for one in influence if one.family == ALL or not _little(one)
    )  # fmt: skip
    return table(say("If this were different"), heads, rows, say(
        "The largest change of all figures, of the value as a part of its u. Errors of a family that the recording "
        "hardly shows are scaled with its prior. Priors that would change nothing by more than 1 % are left out.",
    ))  # fmt: skip


def _little(one: PriorInfluence) -> bool:
    """Whether nothing changes by more than a hundredth."""
    return bool(np.all(np.abs(one.u - 1) < _LITTLE) and np.all(np.abs(one.shift) < _LITTLE))


def _largest(changes: Floats, names: Sequence[Text]) -> tuple[Text, Text]:
    """The largest of changes (c,) in per cent, and whose it is; a zero is nobody's."""
    i, percent = _percent(changes)
    if abs(percent) < _SHOWN:
        return number(0.0, ".0f"), DASH
    return signed(percent, ".0f"), names[i]


def _percent(changes: Floats) -> tuple[int, float]:
    i = int(np.argmax(np.abs(changes)))
    return i, float(100 * changes[i])


def families_data(scales: Mapping[str, Floats]) -> list[dict[str, Any]]:
    """Size of each family as the recording shows it."""
    rows = []
    for name, sizes in scales.items():
        most, of_unit = allowed(name)
        low, median, high = (most * np.quantile(sizes, [0.025, 0.5, 0.975])).tolist()
        rows.append({"family": name, "allowed": most, "unit": of_unit, "size": median, "low": low, "high": high})
    return rows


def priors_data(influence: Iterable[PriorInfluence]) -> list[dict[str, Any]]:
    return [
        {
            "family": one.family,
            "times": one.times,
            "u_ratio": one.u.tolist(),
            "shift_u": one.shift.tolist(),
            "u_percent": _percent(one.u - 1)[1],
            "value_percent": _percent(one.shift)[1],
        }
        for one in influence
    ]
