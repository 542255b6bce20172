"""How the axes are read and what errors do not exceed, as stated by whom, and what the recording says to it.

And what would show, or bound, an error that a calibration did not see.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from cmm_uq.analysis.machine.regions import readings_of
from cmm_uq.analysis.machine.state import StatementEvidence
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, listed, number, say, semicolons
from cmm_uq.base.points import AXES, Floats, Machine
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import Column, Table, table
from cmm_uq.certificate.wording import effect_title
from cmm_uq.machine.model.field import PERIODIC, PLAY, READ, STATED, family_of
from cmm_uq.machine.model.readings import AxisReading
from cmm_uq.machine.physics.catalogue import every


def readings_table(machine: Machine, statements: Sequence[StatementEvidence]) -> Table | None:
    """Of the axes of which it is stated how they are read."""
    readings, said = readings_of(machine), {one.of: one for one in statements}
    heads = (
        say("Axis"),
        say("Read by"),
        say("Periodic error, to either side"),
        Column(say("Play"), unit("µm")),
        say("Stated by"),
        say("The recording"),
    )
    rows = (
        (
            Verbatim(axis.upper()),
            one.published.name,
            _periodic(one),
            DASH if one.play_um is None else number(one.play_um, "g"),
            Verbatim(one.facts.source),
            recording_words(said.get(axis)),
        )
        for axis, one in readings.items()
    )
    notes: list[Text] = [
        say(
            "Taken for what is known of these errors before the recording; 95 of 100 do not exceed it. A scale on the "
            "axis does not see the play of the drive. Play for which nothing is given is as large as physics allows."
        )
    ]
    published = dict.fromkeys(one.source for one in readings.values() if one.source)
    notes += [say("Figures that are not stated are published ones: {source}.", source=Verbatim(s)) for s in published]
    if any(one.facts.play_um is None and one.play_um is not None for one in readings.values()):
        notes.append(
            say(
                "Play that is not stated is the largest published hysteresis of a scale on its axis: RLS, LMA10, below 2 µm."
            )
        )
    return table(say("How the axes are read"), heads, rows, *notes)


def _periodic(one: AxisReading) -> Text:
    sections = [say("{um} µm within {mm} mm", um=number(um, "g"), mm=number(mm, "g")) for mm, um in one.within]
    if one.interpolation is not None:
        period, most = one.interpolation
        within = say("{um} µm within one period of {mm} mm", um=number(most, ".3g"), mm=number(period, ".3g"))
        sections.insert(0, within)
    return semicolons(sections) if sections else say("as physics allows")


def recording_words(one: StatementEvidence | None) -> Text:
    if one is None or np.isnan(one.ratio):
        return say("shows nothing of it")
    if one.denied:
        return say("denies it: not used")
    return say("supports it") if one.supported else say("shows little of it")


def readings_warnings(statements: Iterable[StatementEvidence], scales: Mapping[str, Floats]) -> list[Text]:
    """What a recording says against what is stated of axes, and against bounds.

    ``scales``: draws (N,) of each family's size; of stated ones over what is stated.
    """
    denied, texts = [one for one in statements if one.denied], list[Text]()
    if axes := [Verbatim(one.of.upper()) for one in denied if one.of in AXES]:
        texts.append(
            say(
                "The recording denies how these axes are stated to be read, so that nothing of it is used: {axes}.",
                axes=listed(axes),
            )
        )
    for one in denied:
        if one.of not in AXES:
            texts.append(
                say(
                    "The recording denies the bound that is stated, so that it is not used: {error}. It is {times} times as "
                    "probable without it.",
                    error=effect_title(one.of),
                    times=number(one.ratio, ".2g"),
                )
            )
    for name, sizes in scales.items():
        low, middle, high = np.quantile(sizes, [0.025, 0.5, 0.975])
        if name.endswith(STATED) and low > 1:
            texts.append(
                say(
                    "The recording shows more than is stated, and is followed: {errors} {size} ({low} to {high}).",
                    errors=READ[name],
                    size=number(middle, ".2g"),
                    low=number(low, ".2g"),
                    high=number(high, ".2g"),
                )
            )
    return texts


def readings_data(machine: Machine, statements: Iterable[StatementEvidence]) -> list[dict[str, Any]]:
    """For results.json."""
    said, rows = {one.of: one for one in statements}, []
    for axis, one in readings_of(machine).items():
        own = said.get(axis)
        told = one.facts.model_dump(exclude={"names"}, exclude_none=True, exclude_defaults=True)
        period, most = one.interpolation or (None, None)
        taken = {"within": [list(each) for each in one.within], "period_mm": period, "interpolation_um": most}
        rows.append(
            {
                "axis": axis,
                "stated": told,
                "taken": {**taken, "play_um": one.play_um},
                "published": one.source or None,
                **evidence_data(own),
            }
        )
    return rows


def evidence_data(one: StatementEvidence | None) -> dict[str, Any]:
    """For results.json, of one statement."""
    ratio = None if one is None or np.isnan(one.ratio) else one.ratio
    return {"recording_against": ratio, "used": one is None or not one.denied}


_SHRINKS: Mapping[str, Text] = {
    PERIODIC: say("positions along the axis that lie closer than half of the period"),
    PLAY: say("faces of a gauge that are met from both sides"),
}
_AT_THE_PLACE = say("a calibrated ring, ball or gauge at the place of the part")


def shrinking(name: str, machine: Machine) -> Text:
    """What would make an error of the machine smaller than it may be; nothing of what is none of its families."""
    effect = every().get(name)
    family = None if effect is None else family_of(effect)
    if effect is None or family is None:
        return NOTHING
    axis, measured = str(getattr(effect, "axis", "")), _SHRINKS.get(family, _AT_THE_PLACE)
    if family not in _SHRINKS or axis in machine.read_by:
        return measured
    return say("{measured}, or a statement of how {axis} is read", measured=measured, axis=Verbatim(axis.upper()))


def smaller_by(share: float) -> float:
    """Part of u that knowing exactly what makes a share of its square would take off: 1 − √(1 − share)."""
    return float(1 - np.sqrt(1 - min(max(share, 0.0), 1.0)))
