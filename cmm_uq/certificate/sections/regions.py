"""Where the error factors hold: over the recorded set-ups, the measuring range and parts of it, with all errors together."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from cmm_uq.analysis.machine.performance import ALL, MATTERS, PriorInfluence
from cmm_uq.analysis.machine.regions import FactorRegions, Key
from cmm_uq.analysis.machine.state import FREE
from cmm_uq.base.messages import DASH, NOTHING, Text, after, listed, number, say, signed
from cmm_uq.base.points import Floats
from cmm_uq.base.units import unit
from cmm_uq.certificate import wording
from cmm_uq.certificate.document import Column, Paragraph, Section, Table, section, table
from cmm_uq.certificate.origin import further_data, further_table, quantity_data
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.sections.read_axes import readings_data, readings_table, readings_warnings
from cmm_uq.certificate.wording import effect_title
from cmm_uq.machine.model.field import FAMILIES, READ, allowed
from cmm_uq.maths.uncertainty.quantity import Quantity, rounded

_TITLE = say("Where the error factors hold")


def over_range(result: Result) -> dict[Key, Quantity]:
    """Error factors over the whole measuring range; by this recording alone no better known than over its set-ups."""
    regions = result.regions
    if not isinstance(regions, FactorRegions):
        return {}
    if not result.further().used:
        own = result.parameters
        return {
            key: one.at_least(own[key[0]][key[1]].expanded)
            for key, one in regions.whole.items()
            if key not in result.not_given
        }
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
    names = [wording.title_of(key, result) for key in regions.whole]
    k = np.array([one.coverage_factor or np.inf for one in regions.whole.values()])
    given = [key in ranged for key in regions.whole]
    rests = listed([names[i] for i in resting(regions.influence, k) if given[i]])
    words: Text = say(
        "The first figures are means over the recorded set-ups. The machine has other errors besides, taken as large as this "
        "recording shows errors of their kind to be; elsewhere a factor differs by what they do."
    )
    prior = say(
        "Over the measuring range these rest on what was taken for the other errors before the recording, so that "
        "value or U changes by a tenth of U or more with it: {names}.",
        names=rests,
    )
    read_by = readings_table(result.model.artefact.points.machine, regions.statements)
    tables = sizes_table(regions.scales), read_by, changes_table(regions.influence, names)
    further = result.further()
    words = after(words, further.together)
    return section(
        _TITLE,
        Paragraph(words),
        _table(result, regions, ranged),
        Paragraph(prior) if rests else None,
        *tables,
        further_table(further.each),
    )


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
    of = say("{some} of {count} observations are reckoned with.", some=some, count=count)
    return table(_TITLE, heads, rows, note, *([of] if some < count else []))


def regions_warnings(result: Result) -> list[Text]:
    """What all errors together say against the named model, and against a tolerance that it keeps or exceeds."""
    regions, texts, open_there = result.regions, list[Text](), list[Text]()
    if not isinstance(regions, FactorRegions):
        return texts
    texts += [*readings_warnings(regions.statements, regions.scales), *result.further().warnings]
    for key in result.denied:
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
    unknown = say(
        "Tolerances are judged on the error factors as estimated. Over the measuring range it is open whether these "
        "are kept: {names}.",
        names=listed(open_there),
    )
    return [*texts, unknown] if open_there else texts


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
    by_effect: dict[str, dict[str, dict[str, Any]]] = {"over_range": {}, "recorded": {}, "eighths": {}}
    for key, quantity in (ranged := over_range(result)).items():
        effect, name = key
        by_effect["over_range"].setdefault(effect, {})[name] = quantity_data(quantity)
        by_effect["recorded"].setdefault(effect, {})[name] = quantity_data(regions.recorded[key])
        if key in regions.eighths:
            by_effect["eighths"].setdefault(effect, {})[name] = list(regions.eighths[key])
    for effect, name in result.denied:
        if (together := regions.recorded.get((effect, name))) is not None:
            by_effect["recorded"].setdefault(effect, {})[name] = quantity_data(together)
    if not (ranged or result.denied):
        return {}
    given = "other errors as large as regions.families says"
    some, count = regions.observations
    read_by = readings_data(result.model.artefact.points.machine, regions.statements)
    return {
        "over_range": by_effect.pop("over_range"),
        "regions": {
            "observations": some,
            "of": count,
            **by_effect,
            "disagree": [".".join(key) for key in regions.disagree],
            "families": families_data(regions.scales),
            **({"axes": read_by} if read_by else {}),
            **further_data(result.further().each),
            "of_priors": [".".join(key) for key in regions.whole],
            "priors": priors_data(regions.influence),
        },
        "conditional": {"over_range": given, "regions": given},
    }


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
        (family_words(one["family"]), *(number(float(f"{one[key]:.2g}"), "g") for key in keys), unit(one["unit"]))
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
    heads = (say("Errors"), Column(say("Prior times")), of_u, say("Of"), of_value, say("Of"))
    rows = (
        (family_words(one.family), number(one.times, "g"), *_largest(one.u - 1, names), *_largest(one.shift, names))
        for one in influence if one.family == ALL or np.abs([one.u - 1, one.shift]).max() >= _LITTLE
    )  # fmt: skip
    return table(say("If this were different"), heads, rows, say(
        "The largest change of all figures, of the value as a part of its u. Errors of a family that the recording "
        "hardly shows are scaled with its prior. Priors that would change nothing by more than 1 % are left out.",
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
