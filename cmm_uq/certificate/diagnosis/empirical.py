"""What no known effect accounts for, in words: fitted functions, the effect that comes nearest, and what repeats share.

What a diagnosis says of the simulation's own mistakes: a sentence, what to do, a section, and its part of results.json.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from cmm_uq.analysis.diagnosis.diagnosis import Diagnosis
from cmm_uq.analysis.diagnosis.empirical.model import ODDS, EmpiricalFunction
from cmm_uq.analysis.diagnosis.held_out import Improvement
from cmm_uq.analysis.diagnosis.location import region_of
from cmm_uq.analysis.diagnosis.simulated import SimulatedTwin, SimulationMistake, SimulationMistakes
from cmm_uq.base.messages import NOTHING, Text, Verbatim, after, alternatives, commas, lines, number, say
from cmm_uq.base.units import unit
from cmm_uq.certificate.diagnosis.sections import region_words
from cmm_uq.certificate.document import Column, Facts, Paragraph, Plot, Section, Table, section, table
from cmm_uq.certificate.origin import attributes
from cmm_uq.certificate.plots.volume import profile_plot
from cmm_uq.certificate.wording import probability
from cmm_uq.jobs.columns import labelled
from cmm_uq.maths.uncertainty.quantity import alike, rounded, significant

EMPIRICAL = "empirical.toml"  # file that states the functions as effects of a job's own

FORMS: Mapping[str, Text] = {
    "smooth": say("a smooth curve"), "rough": say("a rough curve"), "step": say("a step"), "ramp": say("a ramp"),
    "dent": say("a dent"), "bow": say("a bow"), "cubic": say("a cubic"), "saturating": say("one that levels off"),
    "exponential": say("an exponential"), "sine": say("a sine"), "sawtooth": say("a sawtooth"),
    "dead_zone": say("a dead zone"), "product": say("a product"), "bowl": say("a bowl"),
}  # fmt: skip
_MANY = 1e4  # odds from which only this is told
_PARAMETERS: Mapping[str, Text] = {
    "at": say("at"), "width": say("width"), "start": say("from"), "period": say("period"), "reach": say("reach"),
}  # fmt: skip


def function_words(found: EmpiricalFunction) -> Text:
    """One function: what it is of, its form where that is told, and its size."""
    what, size, form = found.term.title, significant(found.amplitude_um), found.form
    if form is None:
        forms = commas(say("{form} {probability}", form=FORMS[f], probability=probability(p)) for f, p in found.forms)
        return say("{what:capital}: up to {size} µm; its form is not told: {forms}.", what=what, size=size, forms=forms)
    stated = {name: say("{value} ± {U} {unit}", value=value, U=U, unit=one.unit)
              for name, one in form.parameters.items() for value, U in (rounded(one.value, one.expanded),)}  # fmt: skip
    sizes = [say("{name} {value}", name=_PARAMETERS[n], value=text) for n, text in stated.items() if n in _PARAMETERS]
    told = commas([say("{form} of {size}", form=FORMS[form.name], size=stated["size_um"]), *sizes])
    chance = probability(form.probability)
    return say("{what:capital}: {form}, probability {probability}.", what=what, form=told, probability=chance)


def nearest_words(d: Diagnosis) -> Text:
    """The known effect that comes nearest, what it would bring and what contradicts it; nothing where it is asserted."""
    best = d.best_known
    if best is None or any(item.effect == best.effect for item in d.effects):
        return NOTHING
    gain, odds = best.improvement, best.odds_of_function
    before, later = alike(gain.heldout_rms_before_um, gain.heldout_rms_after_um)
    told: Text = say(
        "The known effect that comes nearest is {title:small}, probability {probability}: by itself it takes held-out "
        "{unseen} from {before} to {after}\u00a0µm.", title=best.title, probability=probability(best.probability),
        unseen=gain.unseen, before=before, after=later,
    )  # fmt: skip
    if odds > _MANY:
        told = after(
            told, say("A curve of no form makes these readings more than {odds:.0f} times as probable.", odds=_MANY)
        )
    elif odds > ODDS:
        told = after(told, say("A curve of no form makes these readings {odds:.0f} times as probable.", odds=odds))
    return after(told, say("If it is that: {what}.", what=best.points_to))


def empirical_words(d: Diagnosis) -> list[Text]:
    """The functions that held-out set-ups bear out, a sentence each."""
    found = d.empirical
    return [function_words(one) for one in found.functions] if found is not None and found.predicts else []


def stated_functions(d: Diagnosis) -> str:
    """The functions that held-out set-ups bear out, as effects of a job's own; empty where none can be stated."""
    found = d.empirical
    functions = found.functions if found is not None and found.predicts else ()
    return "\n".join(one.stated for one in functions if one.stated)


def repeats_words(d: Diagnosis) -> Text:
    """What repeats of a quantity share, beside their scatter, where that is more than noise leaves."""
    one = d.repeats
    if one is None or one.p_value >= d.alpha:
        return NOTHING
    shared, own, p = significant(one.shared_um), significant(one.repeatability_um), number(one.p_value, ".1g")
    told = say("What readings of one quantity share is {shared} µm; they scatter by {own} µm (F test, p = {p}).",
               shared=shared, own=own, p=p)  # fmt: skip
    return after(told, say(
        "It is noise of each set-up, or an error that this plan does not tell from it: the same set-ups, placed anew, tell."
    ))  # fmt: skip


def empirical_section(d: Diagnosis, improved: Callable[[Improvement], Table]) -> Section:
    """The fitted functions, what they bring on held-out set-ups, their curves, and the known effect that comes nearest."""
    title, found = say("What no known effect accounts for"), d.empirical
    nearest = Paragraph(words) if (words := nearest_words(d)) else None
    if found is None or not found.predicts:
        return section(title, nearest)
    rows = [(say("Function"), function_words(one)) for one in found.functions]
    rows += [(say("It could as well be"), alternatives(one.also)) for one in found.functions if one.also]
    if stated_functions(d):
        use = say(
            "It is stated in results.json as an effect of the laboratory's own, and a diagnosis writes it to {file}: in "
            "job.toml, and named in [model] effects, it is estimated anew, corrected, and part of every uncertainty. Its form "
            "is then held.",
            file=Verbatim(EMPIRICAL),
        )
        rows.append((say("To use it"), use))
    told = say(
        "Empirical: fitted to this recording, not known beforehand; it holds where was measured. The function is chosen anew "
        "wherever {unseen} are held out: all are averaged as the others weigh them, under the noise that is found beside "
        "them.",
        unseen=found.improvement.unseen,
    )
    curves = map(_curve, found.functions)
    return section(title, Paragraph(told), Facts(tuple(rows)), improved(found.improvement), *curves, nearest)


def _curve(found: EmpiricalFunction) -> Plot | None:
    (x, y, u), along, size = found.curve, found.term.along, found.amplitude_um
    if len(x) < 2 or not np.any(u):
        return None
    label = say("Error along {along} / µm", along=Verbatim(along.upper())) if along else say("Error / µm")
    region = region_of(x, y)
    caption = say(
        "{what:capital}, with U (k = 2), averaged over the functions that are probable; below, each observation over the "
        "range of its points.",
        what=found.term.title,
    )
    where = region_words(found.term.of, *region)
    shown = say("A function of up to {size:.3g} µm, largest {region}.", size=size, region=where)
    return profile_plot((x, y, 2 * u), found.data, region, x_label=labelled(found.term.of), y_label=label, caption=caption,
                        alternative=shown)  # fmt: skip


_HEAD = say("Mistakes of the simulation")
TITLE = say("The simulation is mistaken, as far as the recording shows")


def mistaken(found: SimulationMistakes) -> Text:
    """What is wrong with the simulation, in a sentence; nothing where nothing is asserted."""
    if not found.asserted:
        return NOTHING
    if found.rounded is not None:
        return say("The simulation itself is at fault: {what}.", what=found.rounded.title)
    before, after = alike(found.rms_before_um, found.named[0].rms_um)
    what = alternatives([one.title for one in found.named])
    return say("The simulation itself is at fault: {what}. Put right, it leaves {after} µm in place of {before} µm.",
               what=what, after=after, before=before)  # fmt: skip


def to_mend(found: SimulationMistakes) -> tuple[Text, ...]:
    """What to do about the simulation before anything is done to the machine."""
    told = tuple(dict.fromkeys(one.remedy for one in found.asserted))
    return (*told, say("Then compare again, before anything is done to the machine.")) if told else ()


def mistakes_section(found: SimulationMistakes) -> Section:
    if not (found.told or found.asserted):
        return Section(_HEAD, ())
    tried = say(
        "{count} mistakes of the simulation were tried: signs, exchanged axes, tables and numbers, shifts, factors, units, "
        "another length or temperature of the artefact.",
        count=found.tried,
    )
    said = mistaken(found)
    if found.why:
        withheld = say("None of the following is asserted: {why}.", why=found.why)
        said = lines((said, withheld)) if said else withheld
    each = (*([found.rounded] if found.rounded else []), *found.told)
    rms = alike(found.rms_before_um, found.heldout_rms_before_um)
    rows = [
        *((say("{what:capital}", what=one.title), probability(one.probability), *alike(one.rms_um, one.heldout_rms_um))
          for one in each),
        (say("none, as it is predicted"), NOTHING, *rms),
    ]  # fmt: skip
    figures = (say("Probability"), say("Residual rms"), say("Held-out rms"))
    heads: tuple[Text | Column, ...] = (say("Mistake"), *map(Column, figures), say("Unit"))
    cells = ((*row, unit("µm")) for row in rows)
    return section(_HEAD, Paragraph(said), table(say("What could be wrong with it"), heads, cells, tried))


def mistakes_data(found: SimulationMistakes) -> dict[str, Any]:
    named, told = [one.name for one in found.asserted], [*found.told, *([found.rounded] if found.rounded else [])]
    return {
        "tried": found.tried, "named": named, "why_not": found.why or None,
        **attributes(found, "rms_before_um", "heldout_rms_before_um"), "told": [_data(one, named) for one in told],
    }  # fmt: skip


def _data(one: SimulationMistake, named: Sequence[str]) -> dict[str, Any]:
    figures = attributes(one, "probability", "odds_over_none", "odds_over_physics", "rms_um", "heldout_rms_um", "elpd_gain",
                         "elpd_gain_se")  # fmt: skip
    said = {"mistake": one.name, "what": one.title, "what_to_do": one.remedy, "named": one.name in named}
    return {**said, **figures, "estimate": None if one.value is None else attributes(one, "value", "u", "unit")}


AGAINST_SIMULATION: Mapping[str, Text] = {
    "consistent": say("The recording agrees with the simulation."),
    "undetermined": say(
        "The recording agrees with the simulation as far as its set-ups tell; what repeats share is more than they scatter by."
    ),
    "explained": say("The recording does not agree with the simulation; what differs is found."),
    "partial": say("Something that differs is found, but structure remains that no known effect accounts for."),
    "empirical": say(
        "The recording does not agree with the simulation; a function that was fitted predicts what differs, and no known "
        "effect accounts for it."
    ),
    "unexplained": say("The recording does not agree with the simulation, and no known effect accounts for it."),
}


def contained(simulated: SimulatedTwin | None, effect: str) -> Text:
    """To follow the sentence on an effect that the simulation contains: what was found is what it lacks of it."""
    if simulated is None or effect not in simulated.contains:
        return NOTHING
    return say("The simulation contains it: this is by how much the machine's differs.")
