"""A diagnosis in four lines, and in sentences that a service technician acts on."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from cmm_uq.analysis.diagnosis.asserted import OmittedEffect
from cmm_uq.analysis.diagnosis.diagnosis import Diagnosis
from cmm_uq.analysis.diagnosis.held_out import Improvement
from cmm_uq.analysis.diagnosis.joint import NAMED, Mode, WithheldEffect
from cmm_uq.analysis.planning.set_up import odds_words
from cmm_uq.analysis.screening.columns import Finding
from cmm_uq.base import messages
from cmm_uq.base.messages import NOTHING, Text, Verbatim, after, commas, holding, lines, listed, say, semicolons
from cmm_uq.certificate.diagnosis import empirical
from cmm_uq.certificate.diagnosis.sections import by_columns, explanation, next_sentence, place_words, without_power
from cmm_uq.certificate.document import Overview, Standing
from cmm_uq.certificate.result import JobDiagnosis
from cmm_uq.certificate.wording import Headline, Summary, effect_of, effect_title, probability, size_of, titles
from cmm_uq.jobs.job import JobFile
from cmm_uq.jobs.verdicts import DIAGNOSES
from cmm_uq.maths.uncertainty.quantity import alike, rounded

# What a verdict means for who is to act
_STANDING: Mapping[str, Standing] = {"consistent": "good", "unexplained": "bad"}
STANDING: Mapping[str, Standing] = {verdict: _STANDING.get(verdict, "open") for verdict in DIAGNOSES}

# A verdict as the title of its overview
VERDICT_TITLES: Mapping[str, Text] = {
    "consistent": say("Consistent: nothing is found to be missing"),
    "undetermined": say("Undetermined: noise or an error, this recording cannot tell"),
    "explained": say("Explained: the cause is found"),
    "partial": say("Partly explained: a cause is found, and there is more"),
    "empirical": say("Modelled, not named: no known effect accounts for it"),
    "unexplained": say("Unexplained: something is wrong that no known effect accounts for"),
}
VERDICT_SENTENCES: Mapping[str, Text] = {
    "consistent": say("The recording agrees with the model that the job names."),
    "undetermined": say(
        "The recording agrees with the model that the job names as far as its set-ups tell; what repeats share is more than "
        "they scatter by."
    ),
    "explained": say("The recording does not agree with the model that the job names; what was left out is found."),
    "partial": say("Something that was left out is found, but structure remains that no known effect accounts for."),
    "empirical": say(
        "The recording does not agree with the model that the job names; a function that was fitted predicts it, and no known "
        "effect accounts for it."
    ),
    "unexplained": say(
        "The recording does not agree with the model that the job names, and no known effect accounts for it."
    ),
}

# A verdict in a word
VERDICT_WORDS: Mapping[str, Text] = {
    "consistent": say("consistent"), "undetermined": say("undetermined"), "explained": say("explained"),
    "partial": say("partial"), "empirical": say("empirical"), "unexplained": say("unexplained"),
}  # fmt: skip

_RAREST = 1e-4  # probability below which only this is told
_TOLD = 0.05  # probability from which another explanation is told beside what is asserted
_SAME = 0.01  # difference of two probabilities that is not worth telling


def overview_of(result: JobDiagnosis) -> Overview:
    d = result.diagnosis
    rows = (
        (say("Found"), _found(result)), (say("Where"), _where(d)), (say("How sure"), _sure(result)),
        (say("What to do"), _to_do(result)),
    )  # fmt: skip
    title, standing = VERDICT_TITLES[d.verdict], STANDING[d.verdict]
    if result.mistakes.asserted:
        title, standing = empirical.TITLE, "open"
    elif without_power(result):
        title, standing = say("Consistent, as far as this recording can show"), "open"
    elif d.verdict == "explained" and (
        _otherwise(d) or any(instead(d, item) or item.alternatives for item in d.effects)
    ):
        title = say("Explained: more than one cause is possible")
    if said := empirical.mistaken(result.mistakes):
        rows = ((rows[0][0], lines(filter(None, (said, rows[0][1])))), *rows[1:])
    return Overview(title, standing, tuple(row for row in rows if row[1]))


def _found(result: JobDiagnosis) -> Text:
    d = result.diagnosis
    if d.verdict == "undetermined":
        return lines((say("Nothing that stands out of noise of the set-ups."), empirical.repeats_words(d)))
    if d.verdict == "consistent":
        if result.simulated is None:
            return say("Nothing beyond the effects that the job names: what they leave is noise.")
        return say("Nothing beyond the simulation: what it leaves is noise.")
    if not d.effects:
        if result.mistakes.named:
            return NOTHING
        beyond = empirical.empirical_words(d) or [say("A misfit that no known effect accounts for.")]
        return lines((*beyond, *withheld_words(d.withheld)))
    texts: list[Text] = []
    for item in d.effects:
        size = size_of(effect_of(item.effect, d.after.effects), item.parameters, factors=False)
        told = say("{title}: {size}.", title=item.title, size=size)
        single = (say("{title:small}", title=title) for title in titles(besides(d, item), d.after.effects))
        if others := [*single, *sets_instead(item)]:  # with what is known of sets beforehand
            few = say("It could as well be: {others}.", others=messages.alternatives(others))
            many = say("It could as well be one of {count} others; a table below has them.", count=len(others))
            told = say("{told} {others}", told=told, others=few if len(others) <= INLINE else many)
        texts.append(after(told, empirical.contained(result.simulated, item.effect)))
    if d.verdict == "partial":
        texts += empirical.empirical_words(d) or [say("And more that no known effect accounts for.")]
        texts += filter(None, [empirical.repeats_words(d)])
    return lines(texts)


def besides(d: Diagnosis, item: OmittedEffect) -> list[str]:
    """Single effects that this recording cannot tell from one, but those among its sets."""
    sets = {one.effects for one in item.alternatives if one.instead_of == (item.effect,)}
    return [name for name in instead(d, item) if (name,) not in sets]


def instead(d: Diagnosis, item: OmittedEffect) -> list[str]:
    """What this recording cannot tell from an effect; of an improbable one the whole group, as one of which it is asserted."""
    group = item.group if item.probability < NAMED else ()
    twins = (name for twins in d.indistinguishable if twins[0] == item.effect for name in twins[1:])
    return [name for name in dict.fromkeys((*group, *twins)) if name != item.effect]


def _where(d: Diagnosis) -> Text:
    if d.agrees:
        return say("No place, direction or time stands out.")
    if not d.where:
        return by_columns(d) or say("Spread over the recording: no reading or direction by itself stands out.")
    return say("{places:capital}.", places=semicolons([place_words(place) for place in d.where[:2]]))


def _sure(result: JobDiagnosis) -> Text:
    d = result.diagnosis
    by_chance = say("Noise alone looks like this in {share} recordings.", share=share_of(d.p_value))
    if d.agrees:
        return lines(filter(None, (by_chance, without_power(result))))
    if not d.effects:
        found = d.empirical
        return lines((by_chance, gained(found.improvement))) if found is not None and found.predicts else by_chance
    probable = say("Probability: {each}.", each=semicolons(map(_probable, d.effects)))
    return lines(filter(None, (by_chance, probable, _otherwise(d), gained(d.improvement))))


def _otherwise(d: Diagnosis) -> Text:
    asserted = {item.effect for item in d.effects}
    each = [
        say("{title} {probability}", title=explanation(one), probability=probability(one.probability))
        for one in d.remaining.rivals
        if one.probability >= _TOLD and not asserted <= set(one.effects)
    ]
    return say("Otherwise: {each}.", each=semicolons(each)) if each else NOTHING


def _probable(item: OmittedEffect) -> Text:
    title, chance = item.title, probability(item.probability)
    one_of = say("{title} {probability}, it or one that it could as well be {together}", title=title, probability=chance,
                 together=probability(item.together))  # fmt: skip
    return one_of if item.probability < NAMED else say("{title} {probability}", title=title, probability=chance)


def gained(gain: Improvement) -> Text:
    """What the cause gains where the fit had not seen the recording, in a sentence."""
    before, after = alike(gain.heldout_rms_before_um, gain.heldout_rms_after_um)
    return say(
        "{unseen:capital} that the fit had not seen are predicted to {after}\u00a0µm with it, to {before}\u00a0µm "
        "without it.",
        unseen=gain.unseen, before=before, after=after,
    )  # fmt: skip


def share_of(p_value: float) -> Text:
    """A probability as a share of recordings: ``17 of 100``."""
    if p_value < _RAREST:
        return say("fewer than 1 of 10\u00a0000")
    if p_value < 0.05:
        return say("1 of {many:.0f}", many=1 / p_value)
    return say("{many:.0f} of 100", many=100 * p_value)


def _to_do(result: JobDiagnosis) -> Text:
    d, further = result.diagnosis, result.next_plan is not None
    if mend := empirical.to_mend(result.mistakes):
        return lines(mend)
    misfit, acting = d.verdict in ("partial", "unexplained"), d.verdict in ("empirical", "unexplained")
    nearest = empirical.nearest_words(d) if acting else NOTHING
    first = say("First measure the set-ups listed below, to tell apart what this recording cannot.")
    return lines(dict.fromkeys((
        *([first] if further and not d.agrees else []),
        *(line for item in d.effects for line in _look_at(d, item)),
        *holding(
            (misfit, say("Look at the pictures below and measure again: do not compensate by a model that does not fit.")),
            (d.verdict == "empirical",
             say("Look for what acts where it is; until that is found, the function can be corrected and counted.")),
            (nearest, nearest), (d.verdict == "explained", say("Then measure again.")),
            (d.verdict == "undetermined",
             say("Place the artefact anew in the same set-ups and measure again: what stays is the machine's.")),
            (d.agrees and result.findings, say("Nothing on account of the machine; see the warnings on the recording.")),
            (d.agrees and not result.findings, say("Nothing on account of this recording.")),
            (d.agrees and further, say("To see what it could not have shown, measure the set-ups listed below.")),
        ),
    )))  # fmt: skip


INLINE = 3  # alternatives that a sentence tells; of more there is a table


def sets_instead(item: OmittedEffect) -> list[Text]:
    """Sets of effects that the readings alone do not tell from one, with the odds of what is known beforehand."""
    told: list[Text] = []
    for one in sorted(item.alternatives, key=lambda one: one.odds):
        what = listed([say("{title:small}", title=title) for title in one.titles])
        if rest := [say("{title:small}", title=effect_title(n)) for n in one.instead_of if n != item.effect]:
            what = say("{what} in its place and in that of {rest}", what=what, rest=listed(rest))
        elif len(one.titles) > 1:
            what = say("{what} together", what=what)
        told.append(say("{what} (odds beforehand {odds} against it)", what=what, odds=odds_words(one.prior_odds)))
    return told


def _look_at(d: Diagnosis, item: OmittedEffect) -> list[Text]:
    """The cause to look at; of effects that cannot be told apart, that of each on a line, where they are few."""
    names = dict.fromkeys((*instead(d, item), *(name for one in item.alternatives for name in one.effects)))
    others = [effect_of(name, d.after.effects) for name in names]
    causes = [(item.title, item.points_to), *((one.title, one.points_to) for one in others if one is not None)]
    if len(causes) == 1:
        return [say("{what:capital}.", what=item.points_to)]
    few = causes if len(causes) <= INLINE + 1 else causes[:1]
    return [say("If it is {title:small}: {what}.", title=title, what=what) for title, what in few]


def verdict_of(result: JobDiagnosis) -> Text:
    return (VERDICT_SENTENCES if result.simulated is None else empirical.AGAINST_SIMULATION)[result.diagnosis.verdict]


def summary_lines(result: JobDiagnosis) -> list[Text]:
    d, measure = result.diagnosis, next_sentence(result)
    return [
        verdict_of(result),
        *(say("{label}: {text}", label=label, text=text) for label, text in overview_of(result).rows),
        *withheld_words(d.withheld), *(ambiguous(titles(group, d.after.effects)) for group in d.indistinguishable),
        *([measure] if measure else []), *noise_words(d, stated_um(result)),
    ]  # fmt: skip


def ambiguous(group: Sequence[Text]) -> Text:
    return say("This recording cannot tell apart: {effects}.", effects=commas(group))


def stated_um(result: JobDiagnosis) -> float | None:
    """Standard uncertainty of a coordinate, µm, that the job states; with that of the prediction that it is compared with."""
    stated, simulated = result.job.facts.recording.u_coordinate_um, result.simulated
    return stated if stated is None or simulated is None else math.hypot(stated, simulated.u_um, simulated.u_turned_um)


def sentence(item: OmittedEffect, gain: Improvement) -> Text:
    """One left-out effect: size, cause, what it explains, and what was held out says."""
    told = say(
        "{title}: {size}. What it points to: {points_to}. {sure:capital}; {gain}.",
        title=item.title, size=size_of(effect_of(item.effect), item.parameters), points_to=item.points_to,
        sure=sure(item), gain=held_out(gain),
    )  # fmt: skip
    return after(told, other_periods(item))


def sure(item: OmittedEffect) -> Text:
    share, group = probability(item.probability), (*map(effect_title, item.group), *sets_instead(item))
    if item.probability < NAMED:
        share = say(
            "{share}, {together} that it is this or one that this recording cannot tell from it: {group}",
            share=share,
            together=probability(item.together),
            group=commas(group) if len(group) <= INLINE else say("{count} others", count=len(group)),
        )
    elif item.together > item.probability + _SAME:
        share = say("{share} ({together} of it or one that cannot be told from it)",
                    share=share, together=probability(item.together))  # fmt: skip
    return say(
        "probability {probability}; explains {explained:.0f}\u00a0% of the misfit",
        probability=share,
        explained=100 * item.explained,
    )


def held_out(gain: Improvement) -> Text:
    """What knowing an effect gains where the fit had not seen the recording."""
    before, after = alike(gain.heldout_rms_before_um, gain.heldout_rms_after_um)
    return say(
        "on {unseen} that the fit had not seen the rms falls from {before} to {after}\u00a0µm",
        unseen=gain.unseen, before=before, after=after,
    )  # fmt: skip


def noise_words(diagnosis: Diagnosis, stated_um: float | None) -> tuple[Text, ...]:
    noise, value = diagnosis.noise, diagnosis.noise.coordinate.value
    low, high = noise.coordinate.interval95
    coordinate = say("Standard uncertainty of a coordinate {value:.2g} µm (95 % interval {low:.2g} to {high:.2g} µm).",
                     value=value, low=low, high=high)  # fmt: skip
    return (coordinate, *holding(
        (noise.contradicts_stated and stated_um is not None,
         say("This contradicts the stated {stated_um:g} µm.", stated_um=stated_um or 0.0)),
        (noise.placing.value > 0.3 * value and diagnosis.verdict != "empirical" and not empirical.repeats_words(diagnosis),
         say("Each set-up is off by about {value:.2g} µm that its repeats share.", value=noise.placing.value)),
        (noise.correlated_in_time, say("Neighbouring readings are correlated in time.")),
        (noise.heavy_tails, say("The scatter has heavier tails than a normal distribution.")),
    ))  # fmt: skip


def summary_of(facts: JobFile, verdict: str, sentences: Sequence[Text], found: Iterable[Finding]) -> Summary:
    """Verdict and everything that follows from it, and what the screening found, for the end of a command."""
    first = Headline(verdict.upper(), STANDING[verdict], sentences[0], ())
    warned = tuple(say("{why:capital}.", why=one.why) for one in found)
    machine = Verbatim(facts.machine.name)
    return Summary(machine, messages.day(facts.job.date), (first,), remarks=tuple(sentences[1:]), warnings=warned)


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
    left = len(modes) - _PERIODS
    return commas([*periods, say("and {count} more", count=left)] if left > 0 else periods)
