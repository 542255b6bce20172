"""Where the error factors hold: over the recorded set-ups, the measuring range and parts of it, with all errors together.

How the axes are read and what errors do not exceed, as stated by whom, and what the recording says to it; and what would show,
or bound, an error that a calibration did not see.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from cmm_uq.analysis.machine.agreement import Key
from cmm_uq.analysis.machine.performance import ALL, MATTERS, PriorInfluence
from cmm_uq.analysis.machine.regions import FactorRegions, readings_of
from cmm_uq.analysis.machine.state import FREE, StatementEvidence
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, after, holding, listed, number, say, semicolons, signed
from cmm_uq.base.points import AXES, Floats, Machine
from cmm_uq.base.units import unit
from cmm_uq.certificate import wording
from cmm_uq.certificate.document import Column, Paragraph, Section, Table, section, table
from cmm_uq.certificate.origin import further_data, further_table, quantity_data
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.sections.agreement import agreement_data, contradicted, held
from cmm_uq.certificate.wording import effect_title
from cmm_uq.machine.model.field import FAMILIES, PERIODIC, PLAY, READ, STATED, allowed, family_of
from cmm_uq.machine.model.readings import AxisReading
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.machine.physics.effects.rigid_body import SCALE
from cmm_uq.maths.uncertainty.quantity import Quantity, rounded, significant

_TITLE = say("Where the error factors hold")


def over_range(result: Result) -> dict[Key, Quantity]:
    """Error factors over the whole measuring range; by this recording alone no better known than over its set-ups."""
    regions = result.regions
    if not isinstance(regions, FactorRegions):
        return {}
    if not result.further().used:
        given = {key: one for key, one in regions.whole.items() if key not in result.not_given}
        return {key: one.at_least(result.parameters[key[0]][key[1]].expanded) for key, one in given.items()}
    # what further recordings show of the range, the recorded set-ups neither bound nor leave free
    prior = {one.key: FREE * one.prior_sd for one in result.model.unknowns}
    contradicted = {*result.denied, *(one.key for one in result.contradictions)}
    return {key: one for key, one in regions.whole.items() if key not in contradicted and one.u < prior[key]}


def regions_section(result: Result) -> Section:
    """Without blocks where there are no error factors of a machine."""
    regions, ranged = result.regions, over_range(result)
    if not isinstance(regions, FactorRegions):
        why = say(
            "They are means over the recorded set-ups; what they are elsewhere is not stated: {why}.", why=regions
        )
        return section(_TITLE, Paragraph(why) if regions else None)
    if not ranged:
        return section(_TITLE)
    names, further = [wording.title_of(key, result) for key in regions.whole], result.further()
    k = np.array([one.coverage_factor or np.inf for one in regions.whole.values()])
    given = [key in ranged for key in regions.whole]
    rests = listed([names[i] for i in resting(regions.influence, k) if given[i]])
    words: Text = say(
        "The first figures are means over the recorded set-ups. The machine has other errors besides, taken as large as this "
        "recording shows errors of their kind to be; elsewhere a factor differs by what they do."
    )
    prior = UNMOVED if not rests else say(
        "Over the measuring range these rest on what was taken for the other errors before the recording, so that value or U "
        "changes by a tenth of U or more with it: {names}.", names=rests,
    )  # fmt: skip
    read_by = readings_table(result.model.artefact.points.machine, regions.statements)
    tables = sizes_table(regions.scales), read_by, changes_table(regions.influence, names), further_table(further.each)
    told = (
        Paragraph(after(words, further.together)),
        _table(result, regions, ranged),
        Paragraph(held(regions.agreement)),
    )
    return section(_TITLE, *told, Paragraph(prior) if regions.influence else None, *tables)


def _table(result: Result, regions: FactorRegions, ranged: dict[Key, Quantity]) -> Table | None:
    figures = (say("As recorded"), say("U"), say("In the range"), say("U"), say("Eighths from"), say("to"))
    heads: tuple[Text | Column, ...] = (say("Error factor"), *map(Column, figures), say("Unit"))
    rows = []
    for key, quantity in ranged.items():
        # an average over explanations is of each beside other errors, and no mean over the set-ups
        own = regions.recorded[key] if result.averaged else result.parameters[key[0]][key[1]]
        mean, U = (DASH, DASH) if key in result.not_given else wording.stated(own)[:2]
        value, wider = rounded(quantity.value, quantity.expanded)
        ends: Sequence[Text] = [rounded(end, quantity.expanded)[0] for end in regions.eighths.get(key, ())]
        title, ends = wording.title_of(key, result), ends or (NOTHING, NOTHING)
        rows.append((title, mean, U, value, wider, *ends, quantity.unit))
    note = say(
        "As recorded: the mean over the recorded set-ups. In the measuring range, and in an eighth of it with half of each "
        "travel, a factor is what least squares of all factors find of all errors at points that fill it; its U is "
        "conditional on other errors as large as stated below. The interval holds all eight with 95 %. A bow is one of the "
        "whole travel."
    )
    some, count = regions.observations
    of = say("{some} of {count} observations are used for this.", some=some, count=count)
    return table(_TITLE, heads, rows, note, *([of] if some < count else []))


def regions_warnings(result: Result) -> list[Text]:
    """What all errors together say against the named model, and against a tolerance that it keeps or exceeds."""
    regions, texts, open_there = result.regions, list[Text](), list[Text]()
    if not isinstance(regions, FactorRegions):
        return texts
    texts += [*readings_warnings(regions.statements, regions.scales), *result.further().warnings]
    texts += contradicted(regions.agreement)
    denied = {effect for effect, _ in regions.agreement.factors}
    for key in (one for one in result.denied if one[0] in denied):
        one, together = result.parameters[key[0]][key[1]], regions.recorded.get(key)
        name, alone = wording.title_of(key, result), wording.with_uncertainty(one)
        texts.append(
            say("{name} is not given: with errors beside the named ones the recording contradicts it.", name=name)
            if together is None or result.averaged  # then what is stated is no estimate of the named errors alone
            else say(
                "{name} is not given: {alone} {unit} by the named errors alone, {together} {unit} of the same set-ups by all "
                "errors together, which their joint uncertainty does not allow.",
                name=name, alone=alone, together=wording.with_uncertainty(together), unit=one.unit,
            )
        )  # fmt: skip
    for key, quantity in over_range(result).items():
        tolerance, one = result.job.facts.model.tolerances.get(key[0]), result.parameters[key[0]][key[1]]
        if tolerance is not None and _place(one, tolerance) not in (None, _place(quantity, tolerance)):
            value, name = wording.with_uncertainty(quantity), wording.title_of(key, result)
            open_there.append(say("{name} ({value} {unit})", name=name, value=value, unit=quantity.unit))
    return texts + holding((open_there, say(
        "Tolerances are judged on the error factors as estimated. Over the measuring range it is open whether these are kept: "
        "{names}.", names=listed(open_there),
    )))  # fmt: skip


def _place(quantity: Quantity, tolerance: float) -> bool | None:
    """Whether all of its interval lies within a tolerance, or beyond it; ``None`` where neither."""
    low, high = quantity.interval95
    if -tolerance <= low and high <= tolerance:
        return True
    return False if low > tolerance or high < -tolerance else None


def with_regions(data: Mapping[str, Any], result: Result) -> dict[str, Any]:
    """Contents of results.json with what is known of the factors elsewhere, and what that is conditional on."""
    found = regions_data(result)
    conditional = {**data.get("conditional", {}), **found.pop("conditional", {})}
    return {**data, **found, **({"conditional": conditional} if conditional else {})}


def regions_data(result: Result) -> dict[str, Any]:
    regions = result.regions
    if not isinstance(regions, FactorRegions):
        return {"regions": {"not_stated": str(regions)}} if regions else {}
    ranged, recorded = over_range(result), regions.recorded
    if not (ranged or result.denied):
        return {}
    both = [*ranged, *(key for key in result.denied if key in recorded and key not in ranged)]
    given = "other errors as large as regions.families says"
    some, count = regions.observations
    read_by = readings_data(result.model.artefact.points.machine, regions.statements)
    return {
        "over_range": _by_effect({key: quantity_data(quantity) for key, quantity in ranged.items()}),
        "regions": {
            "observations": some, "of": count,
            "recorded": _by_effect({key: quantity_data(recorded[key]) for key in both}),
            "eighths": _by_effect({key: list(regions.eighths[key]) for key in ranged if key in regions.eighths}),
            "disagree": [".".join(key) for key in regions.agreement.factors], "agreement": agreement_data(regions.agreement),
            "families": families_data(regions.scales), **({"axes": read_by} if read_by else {}),
            **further_data(result.further().each), "of_priors": [".".join(key) for key in regions.whole],
            "priors": priors_data(regions.influence),
        },
        "conditional": {"over_range": given, "regions": given},
    }  # fmt: skip


def _by_effect(values: Mapping[Key, Any]) -> dict[str, dict[str, Any]]:
    found: dict[str, dict[str, Any]] = {}
    for (effect, name), value in values.items():
        found.setdefault(effect, {})[name] = value
    return found


UNMOVED = say("Where priors of the machine's errors are half as wide, or twice, no figure changes by a tenth of U.")
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
    return FAMILIES.get(name) or READ.get(name) or effect_title(name)


def sizes_table(scales: Mapping[str, Floats]) -> Table | None:
    """``scales``: draws (N,) of each family's size, over what physics allows."""
    keys = ("allowed", "size", "low", "high")
    figures = (say("Physics allows"), say("As recorded"), say("95 % interval from"), say("to"))
    heads: tuple[Text | Column, ...] = (say("Errors"), *map(Column, figures), say("Unit"))
    rows = (
        (family_words(one["family"]), *(significant(one[key]) for key in keys), unit(one["unit"]))
        for one in families_data(scales)
    )
    return table(say("Sizes of errors, root mean square"), heads, rows, say(
        "A family has one size, half-normal beforehand with what physics allows, and as the recording of the calibration "
        "shows it afterwards; its members of which little is seen are taken as large as the others. Of play the size of the "
        "gap, of periodic errors of the amplitude."
    ))  # fmt: skip


def changes_table(influence: Iterable[PriorInfluence], names: Sequence[Text]) -> Table | None:
    """``names`` of the figures that the changes are of."""
    of_u, of_value = (Column(head, unit("%")) for head in (say("u changes by"), say("Value changes by")))
    heads = (say("Errors"), Column(say("Prior width, times")), of_u, say("Of"), of_value, say("Of"))
    rows = (
        (family_words(one.family), number(one.times, "g"), *_largest(one.u - 1, names), *_largest(one.shift, names))
        for one in influence
        if np.abs([one.u - 1, one.shift]).max() >= _LITTLE
    )
    return table(say("Influence of the priors"), heads, rows, say(
        "The largest change of all figures, of the value as a part of its u, if the prior were as much wider. Errors of a "
        "family that the recording hardly shows are scaled with its prior. Priors that change nothing by 1 % are left out.",
    ))  # fmt: skip


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
    rows = []
    for name, sizes in scales.items():
        most, of_unit = allowed(name)
        low, median, high = (most * np.quantile(sizes, [0.025, 0.5, 0.975])).tolist()
        rows.append({"family": name, "allowed": most, "unit": of_unit, "size": median, "low": low, "high": high})
    return rows


def priors_data(influence: Iterable[PriorInfluence]) -> list[dict[str, Any]]:
    return [
        {"family": one.family, "times": one.times, "u_ratio": one.u.tolist(), "shift_u": one.shift.tolist(),
         "u_percent": _percent(one.u - 1)[1], "value_percent": _percent(one.shift)[1]}
        for one in influence
    ]  # fmt: skip


def readings_table(machine: Machine, statements: Sequence[StatementEvidence]) -> Table | None:
    """Of the axes of which it is stated how they are read."""
    readings, said = readings_of(machine), {one.of: one for one in statements}
    heads = (say("Axis"), say("Read by"), say("Periodic error, to either side"), Column(say("Play"), unit("µm")),
             say("Stated by"), say("The recording"))  # fmt: skip
    rows = (
        (Verbatim(axis.upper()), one.published.name, _periodic(one), DASH if one.play_um is None else number(one.play_um, "g"),
         Verbatim(one.facts.source), recording_words(said.get(axis)))
        for axis, one in readings.items()
    )  # fmt: skip
    taken = say(
        "Taken for what is known of these errors before the recording; 95 of 100 do not exceed it. A scale on the axis does "
        "not see the play of the drive. Play for which nothing is given is as large as physics allows."
    )
    published = dict.fromkeys(one.source for one in readings.values() if one.source)
    of = (say("Figures that are not stated are published ones: {source}.", source=Verbatim(name)) for name in published)
    play = say(
        "Play that is not stated is the largest published hysteresis of a scale on its axis: RLS, LMA10, below 2 µm."
    )
    unstated = any(one.facts.play_um is None and one.play_um is not None for one in readings.values())
    return table(say("How the axes are read"), heads, rows, taken, *of, *holding((unstated, play)))


def _periodic(one: AxisReading) -> Text:
    period = [one.interpolation] if one.interpolation is not None else []
    sections = [
        *(say("{um} µm within one period of {mm} mm", um=number(um, ".3g"), mm=number(mm, ".3g")) for mm, um in period),
        *(say("{um} µm within {mm} mm", um=number(um, "g"), mm=number(mm, "g")) for mm, um in one.within),
    ]
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
    axes = listed([Verbatim(one.of.upper()) for one in denied if one.of in AXES])
    texts += holding((axes, say(
        "The recording denies how these axes are stated to be read, so that nothing of it is used: {axes}.", axes=axes,
    )))  # fmt: skip
    texts += [
        say("The recording denies the bound that is stated, so that it is not used: {error}. It is {times} times as probable "
            "without it.", error=effect_title(one.of), times=number(one.ratio, ".2g"))
        for one in denied if one.of not in AXES
    ]  # fmt: skip
    for name, sizes in scales.items():
        ends = np.quantile(sizes, [0.025, 0.5, 0.975])
        low, size, high = (number(end, ".2g") for end in ends)
        if name.endswith(STATED) and ends[0] > 1:
            texts.append(say("The recording shows more than is stated, and is followed: {errors} {size} ({low} to {high}).",
                             errors=READ[name], size=size, low=low, high=high))  # fmt: skip
    return texts


def readings_data(machine: Machine, statements: Iterable[StatementEvidence]) -> list[dict[str, Any]]:
    said, rows = {one.of: one for one in statements}, []
    for axis, one in readings_of(machine).items():
        told = one.facts.model_dump(exclude={"names"}, exclude_none=True, exclude_defaults=True)
        period, most = one.interpolation or (None, None)
        taken = {"within": [list(each) for each in one.within], "period_mm": period, "interpolation_um": most}
        own = {"taken": {**taken, "play_um": one.play_um}, "published": one.source or None}
        rows.append({"axis": axis, "stated": told, **own, **evidence_data(said.get(axis))})
    return rows


def evidence_data(one: StatementEvidence | None) -> dict[str, Any]:
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
        return say("an artefact of calibrated length") if effect in SCALE.values() else NOTHING
    axis, measured = str(getattr(effect, "axis", "")), _SHRINKS.get(family, _AT_THE_PLACE)
    if family not in _SHRINKS or axis in machine.read_by:
        return measured
    return say("{measured}, or a statement of how {axis} is read", measured=measured, axis=Verbatim(axis.upper()))


def smaller_by(share: float) -> float:
    """Part of u that knowing exactly what makes a share of its square would take off: 1 − √(1 − share)."""
    return float(1 - np.sqrt(1 - min(max(share, 0.0), 1.0)))
