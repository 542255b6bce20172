"""What a diagnosis adds: effects, corrections of a simulated machine, the gain, and where recording and model differ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cmm_uq.analysis.diagnosis.diagnosis import Diagnosis, OmittedEffect
from cmm_uq.analysis.diagnosis.held_out import Improvement
from cmm_uq.analysis.diagnosis.joint import Mode, WithheldEffect
from cmm_uq.analysis.diagnosis.location import Place, residual_field
from cmm_uq.base.messages import NOTHING, Text, Verbatim, after, alternatives, commas, number, say, signed
from cmm_uq.base.points import AXES
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import Column, Facts, Paragraph, Plot, Section, Table, columns, section, table
from cmm_uq.certificate.plots.vectors import profile_plot, residual_field_plot
from cmm_uq.certificate.result import SimulatedTwin
from cmm_uq.certificate.wording import effect_of, expanded, parameter_title, probability, titles, with_uncertainty
from cmm_uq.jobs.columns import in_words, labelled, unit_of
from cmm_uq.maths.uncertainty.quantity import Quantity, alike, rounded, significant

_PERIODS = 8  # periods that a sentence tells; results.json has all.


def withheld_words(withheld: Sequence[WithheldEffect]) -> list[Text]:
    return [
        say("{title} (probability {probability}) is not asserted: {why}.", title=item.title,
            probability=probability(item.probability),
            why=say("{why} ({periods})", why=item.why, periods=_listed(item.modes)) if item.modes else item.why)
        for item in withheld
    ]  # fmt: skip


def other_periods(item: OmittedEffect) -> Text:
    """A sentence on further periods that fit, to follow that on an effect; nothing where there are none."""
    if not item.modes:
        return NOTHING
    if item.settled:
        return say("Other periods that fit: {periods}.", periods=_listed(item.modes))
    return say(
        "The positions do not tell its period; a correction would hold where was measured, not between. "
        "Periods that fit: {periods}.",
        periods=_listed(item.modes),
    )


def _listed(modes: Sequence[Mode]) -> Text:
    periods: list[Text] = []
    for mode in modes[:_PERIODS]:
        value, U = rounded(mode.period.value, mode.period.expanded)
        periods.append(say("{value} ± {U} {unit}: {probability}", value=value, U=U, unit=mode.period.unit,
                           probability=probability(mode.probability)))  # fmt: skip
    return commas(
        [*periods, *([say("and {count} more", count=len(modes) - _PERIODS)] if len(modes) > _PERIODS else [])]
    )


VERDICTS: Mapping[str, Text] = {
    "consistent": say("The recording agrees with the simulation."),
    "explained": say("The recording does not agree with the simulation; what differs is found."),
    "partial": say("Something that differs is found, but structure remains that no known effect accounts for."),
    "unexplained": say("The recording does not agree with the simulation, and no known effect accounts for it."),
}


def simulation_section(simulated: SimulatedTwin, refitted: Mapping[str, Mapping[str, Quantity]]) -> Section:
    """Which simulation it was, and what of it was estimated anew."""
    u = say("{u:.3g} µm", u=simulated.u_um)
    if not simulated.u_um and not simulated.u_common_um:
        u = say("not stated: taken as exact")
    elif common := simulated.u_common_um:
        u = say("{own}, and {common:.3g} µm of the artefact's size in common", own=u, common=common)
    file = say("Error map") if simulated.maps else say("Prediction")
    rows = (
        *((file, Verbatim(name)) for name in simulated.files),
        *((say("SHA-256"), Verbatim(value)) for value in simulated.files.values()),
        (say("Program"), Verbatim(simulated.program)),
        (say("Effects that it contains"), commas(titles(simulated.contains)) or say("not stated")),
        (say("Estimated anew"), commas(titles(simulated.refitted)) or say("none")),
        (say("Standard uncertainty of a predicted coordinate"), u),
        (say("Predicted errors, rms in the observations"), say("{rms} µm", rms=alike(simulated.rms_predicted_um)[0])),
    )
    told = say(
        "Observed minus predicted is what is explained here; where the artefact was taken to stand is no part of it. Sizes of "
        "effects are what the machine has beyond what the simulation contains. The noise is that of both together."
    )
    differing = (
        (parameter_title(owner, name), with_uncertainty(quantity), quantity.unit, expanded(quantity)[2])
        for owner, quantities in refitted.items() for name, quantity in quantities.items()
    )  # fmt: skip
    heads = (say("Parameter"), Column(say("Machine minus simulation")), say("Unit"), Column(say("k")))
    anew = table(say("What the simulation contains, estimated anew"), heads, differing)
    return section(say("Simulation"), Facts(tuple(row for row in rows if row[1])), Paragraph(told), anew)


def contained(simulated: SimulatedTwin | None, effect: str) -> Text:
    """To follow the sentence on an effect that the simulation contains: what was found is what it lacks of it."""
    if simulated is None or effect not in simulated.contains:
        return NOTHING
    return say("The simulation contains it: this is by how much the machine's differs.")


def improvement_table(gain: Improvement, rms: Text, heldout: Text, note: Text) -> Table:
    """Rms in µm, and the gain in log predictive density; ``note``: what was held out, and what ± is."""
    density = say("{elpd_gain:.1f} ± {elpd_gain_se:.1f}", elpd_gain=gain.elpd_gain, elpd_gain_se=gain.elpd_gain_se)
    rows = (
        (rms, *alike(gain.rms_before_um, gain.rms_after_um, decimals=2), unit("µm")),
        (heldout, *alike(gain.heldout_rms_before_um, gain.heldout_rms_after_um, decimals=2), unit("µm")),
        (say("Gain in log predictive density"), NOTHING, density, NOTHING),
    )
    heads = (say("Quantity"), Column(say("Before")), Column(say("After")), say("Unit"))
    return Table(say("Improvement"), columns(heads), rows, (note,))


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
    one, other = (signed(value, ".0f" if abs(value) >= 100 else ".3g") for value in (low, high))
    if one == other:
        return say("at {value}{space}{unit}", value=one, space=space, unit=own)
    return say("from {low} to {high}{space}{unit}", low=one, high=other, space=space, unit=own)


def by_columns(d: Diagnosis) -> Text:
    """What the effects found go by, where no function of it was looked for, such as of two directions of travel."""
    found = (effect_of(item.effect, d.after.effects) for item in d.effects)
    columns = dict.fromkeys(column for effect in found if effect is not None for column in effect.columns)
    return say("It depends on the {what}.", what=commas(in_words(column) for column in columns)) if columns else NOTHING


def where_section(d: Diagnosis) -> Section:
    """Pictures and table of where the residuals lie; without a mismatch, nothing."""
    if d.verdict == "consistent":
        return section(say("Where it is"))
    further = (_profile(d.where[0]), _table(d.where)) if d.where else ()
    return section(say("Where it is"), Paragraph(where_sentence(d)), field_picture(d), *further)


def where_sentence(d: Diagnosis) -> Text:
    if not d.where:
        spread = say("No reading, column or direction by itself carries the evidence: it is spread over the recording.")
        return by_columns(d) or spread
    first = d.where[0]
    size = significant(first.amplitude_um)
    told = say("The evidence lies {place}: up to {size} µm.", place=place_words(first), size=size)
    return after(
        told, say("It could as well be read as {others}.", others=alternatives(first.also)) if first.also else NOTHING
    )


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
    (x, y, u), along, k = place.curve, Verbatim((place.along or "").upper()), number(place.k, ".2f")
    label = say("Error along {along} / µm", along=along) if place.along else say("Error / µm")
    if place.scale:
        label = say("Scale of {along}, at the end of its range / µm", along=along)
    caption = say(
        "{what:capital}, with U (k = {k}), as what the model leaves shows it; below, each observation over the range of "
        "its points. What the model itself would absorb is no part of it.", what=place.what, k=k,
    )  # fmt: skip
    region = region_words(place.covariate, *place.region)
    shown = say("A function of up to {size:.3g} µm, largest {region}.", size=place.amplitude_um, region=region)
    return profile_plot((x, y, place.k * u), place.data, place.region, x_label=labelled(place.covariate), y_label=label,
                        caption=caption, alternative=shown)  # fmt: skip


def _table(where: tuple[Place, ...]) -> Table | None:
    rows = (
        (place.what, say("{where:capital}", where=region_words(place.covariate, *place.region)),
         significant(place.amplitude_um), number(place.p_value, ".1g"))
        for place in where
    )  # fmt: skip
    heads = (say("What it depends on"), say("Where"), Column(say("Up to"), unit("µm")), Column(say("p")))
    return table(say("What the residuals depend on"), heads, rows, say(
        "p is corrected for having looked everywhere, and of a further place holds beside those above it. A region is where "
        "the function exceeds half its largest value and its band does not hold zero, or between which values it jumps."
    ))  # fmt: skip
