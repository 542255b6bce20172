"""Where recording and model differ: regions in words, in a table and in pictures."""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.diagnosis.diagnosis import Diagnosis
from cmm_uq.analysis.diagnosis.location import Place, residual_field
from cmm_uq.base.messages import NOTHING, Number, Text, Verbatim, after, alternatives, commas, number, say, signed
from cmm_uq.base.points import AXES
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import Block, Column, Paragraph, Plot, Section, Table, text_columns
from cmm_uq.certificate.effect_words import effect_of
from cmm_uq.certificate.plots.vectors import profile_plot, residual_field_plot
from cmm_uq.jobs.columns import in_words, labelled, unit_of
from cmm_uq.maths.uncertainty.quantity import significant

_READINGS = frozenset(f"{a}_mm" for a in AXES)


def place_words(place: Place) -> Text:
    """A place in words: ``along Y, depending on X, most from 300 to 600 mm``."""
    what, region = in_words(place.covariate), region_words(place.covariate, *place.region)
    if place.covariate not in _READINGS:
        what = say("the {what}", what=what)
    if place.along is None:
        return say("depending on {what}, most {region}", what=what, region=region)
    axis = Verbatim(place.along.upper())
    if place.scale:
        return say("in the scale of {axis}, depending on {what}, most {region}", axis=axis, what=what, region=region)
    return say("along {axis}, depending on {what}, most {region}", axis=axis, what=what, region=region)


def region_words(covariate: str, low: float, high: float) -> Text:
    """A region of a covariate: ``from 300 to 600 mm``; of one value, ``at 300 mm``."""
    own = unit_of(covariate)
    space = Verbatim("\u00a0" if own else "")
    one, other = _reading(low), _reading(high)
    if one == other:
        return say("at {value}{space}{unit}", value=one, space=space, unit=own)
    return say("from {low} to {high}{space}{unit}", low=one, high=other, space=space, unit=own)


def by_columns(d: Diagnosis) -> Text:
    """What the effects found go by, where no function of it was looked for, such as of two directions of travel."""
    found = (effect_of(item.effect, d.after.effects) for item in d.effects)
    columns = dict.fromkeys(column for effect in found if effect is not None for column in effect.columns)
    return say("It depends on the {what}.", what=commas(in_words(column) for column in columns)) if columns else NOTHING


def _reading(value: float) -> Number:
    return signed(value, ".0f" if abs(value) >= 100 else ".3g")


def where_section(d: Diagnosis) -> Section:
    """Pictures and table of where the residuals lie; without a mismatch, nothing."""
    if d.verdict == "consistent":
        return Section(say("Where it is"), ())
    picture = field_picture(d)
    found: tuple[Block, ...] = (_profile(d.where[0]), _table(d.where)) if d.where else ()
    pictures = () if picture is None else (picture,)
    return Section(say("Where it is"), (Paragraph(where_sentence(d)), *pictures, *found))


def where_sentence(d: Diagnosis) -> Text:
    if not d.where and (told := by_columns(d)):
        return told
    if not d.where:
        return say("No reading, column or direction by itself carries the evidence: it is spread over the recording.")
    first = d.where[0]
    size = significant(first.amplitude_um)
    told = say("The evidence lies {place}: up to {size} µm.", place=place_words(first), size=size)
    if not first.also:
        return told
    return after(told, say("It could as well be read as {others}.", others=alternatives(first.also)))


def field_picture(d: Diagnosis) -> Plot | None:
    """The residual field before and after what was found; before alone, where nothing was."""
    field = residual_field(d.before, d.after)
    if field is None:
        return None
    expanded = field.expanded(d.noise.coordinate)
    beyond = [int(np.sum(np.linalg.norm(values, axis=1) > expanded)) for values in (field.before, field.after)]
    titles: tuple[Text, Text] | tuple[Text] = (say("Before: what the model leaves"), say("After: with what was found"))
    if not d.effects:
        titles = (titles[0],)
    what = say("Half of each length's residual at either end") if field.lengths else say("Residual of each point")
    told = say(
        "{what}, as far as it was observed, over the scale readings; arrows are longer than their U, shaded is where the "
        "evidence lies.",
        what=what,
    )
    count = say("{before} of {all} vectors are longer than their U before", before=beyond[0], all=len(expanded))
    if d.effects:
        count = say("{count} and {after} after", count=count, after=beyond[1])
    along = next((place for place in d.where[:1] if place.covariate in _READINGS), None)
    shade = None if along is None else (along.covariate[0], *along.region)
    alternative = say("{count}.", count=count)
    return residual_field_plot(field, expanded, titles=titles, shade=shade, caption=told, alternative=alternative)


def _profile(place: Place) -> Plot:
    x, y, u = place.curve
    sizes = {"along": Verbatim((place.along or "").upper()), "k": number(place.k, ".2f")}
    label = say("Error along {along} / µm", along=sizes["along"]) if place.along else say("Error / µm")
    if place.scale:
        label = say("Scale of {along}, at the end of its range / µm", along=sizes["along"])
    return profile_plot(
        (x, y, place.k * u), place.data, place.region, x_label=labelled(place.covariate), y_label=label,
        caption=say(
            "{what:capital}, with U (k = {k}), as what the model leaves shows it; below, each observation over the range of "
            "its points. What the model itself would absorb is no part of it.",
            what=place.what, k=sizes["k"],
        ),
        alternative=say("A function of up to {size:.3g} µm, largest {region}.", size=place.amplitude_um,
                        region=region_words(place.covariate, *place.region)),
    )  # fmt: skip


def _table(where: tuple[Place, ...]) -> Table:
    rows = tuple(
        (place.what, say("{where:capital}", where=region_words(place.covariate, *place.region)),
         significant(place.amplitude_um), number(place.p_value, ".1g"))
        for place in where
    )  # fmt: skip
    heads = (*text_columns(say("What it depends on"), say("Where")), Column(say("Up to"), unit("µm")), Column(say("p")))
    note = say(
        "p is corrected for having looked everywhere, and of a further place holds beside those above it. A region is where "
        "the function exceeds half its largest value and its band does not hold zero, or between which values it jumps."
    )
    return Table(say("What the residuals depend on"), heads, rows, (note,))
