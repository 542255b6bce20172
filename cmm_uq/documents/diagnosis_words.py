"""A diagnosis in words that a service technician acts on."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from cmm_uq.diagnosis.comparison.search import ASSERTED
from cmm_uq.diagnosis.diagnosis import Diagnosis, LeftOut
from cmm_uq.diagnosis.held_out import Improvement
from cmm_uq.documents.against import VERDICTS as AGAINST
from cmm_uq.documents.against import contained
from cmm_uq.documents.diagnosis_unseen import without_power
from cmm_uq.documents.in_short import Standing, Summary, Verdict
from cmm_uq.documents.result import Diagnosed
from cmm_uq.documents.withheld import other_periods
from cmm_uq.documents.withheld import sentences as withheld_sentences
from cmm_uq.documents.wording import NO_FACTOR, expanded, probability
from cmm_uq.jobs.job import JobFile
from cmm_uq.messages import NOTHING, Text, Verbatim, after, commas, day, names, say, together
from cmm_uq.screening.finding import Finding
from cmm_uq.uncertainty.quantity import Quantity
from cmm_uq.units import unit

_SAME = 0.01
"""Difference of two probabilities that is not worth telling."""

VERDICTS: Mapping[str, Text] = {
    "consistent": say("The recording agrees with the model that the job names."),
    "explained": say("The recording does not agree with the model that the job names; what was left out is found."),
    "partial": say("Something that was left out is found, but structure remains that no known effect accounts for."),
    "unexplained": say(
        "The recording does not agree with the model that the job names, and no known effect accounts for it."
    ),
}

VERDICT_WORDS: Mapping[str, Text] = {
    "consistent": say("consistent"), "explained": say("explained"), "partial": say("partial"),
    "unexplained": say("unexplained"),
}  # fmt: skip
"""A verdict in a word."""

VERDICTS_IN_SHORT: Mapping[str, Text] = {
    "consistent": say("CONSISTENT"), "explained": say("EXPLAINED"), "partial": say("PARTIAL"),
    "unexplained": say("UNEXPLAINED"),
}  # fmt: skip
"""The same, to begin a summary with."""

_STANDING: Mapping[str, Standing] = {
    "consistent": "good", "explained": "open", "partial": "open", "unexplained": "bad",
}  # fmt: skip


def verdict_of(found: Diagnosed) -> Text:
    """The verdict in a sentence."""
    told = VERDICTS if found.simulated is None else AGAINST
    return after(told[found.diagnosis.verdict], without_power(found))


def sentences_of(found: Diagnosed) -> list[Text]:
    """A sentence or two on each effect that was left out."""
    d = found.diagnosis
    return [after(sentence(item, d.improvement), contained(found.simulated, item.effect)) for item in d.effects]


def lines(found: Diagnosed) -> list[Text]:
    """Verdict and everything that follows from it, a sentence or two each."""
    d = found.diagnosis
    said = [verdict_of(found), *sentences_of(found), *withheld_sentences(d.withheld)]
    said += [
        say("Cannot be told apart by this recording: {effects}.", effects=commas(names(group)))
        for group in d.indistinguishable
    ]
    said += [
        say("To part {effects}: {what}", effects=together(names(s.separates)), what=s.what) for s in found.suggestions
    ]
    return said + list(noise_words(d, stated_um(found)))


def stated_um(found: Diagnosed) -> float | None:
    """Standard uncertainty of a coordinate, µm, that the job states; with that of the prediction that it is compared with."""
    stated = found.job.facts.recording.u_coordinate_um
    return (
        stated
        if stated is None or found.simulated is None
        else math.hypot(stated, found.simulated.u_um, found.simulated.u_turned_um)
    )


def sentence(item: LeftOut, gain: Improvement) -> Text:
    """One left-out effect: size, cause, what it explains, and what was held out says."""
    alone = len(item.parameters) == 1
    parameters = {name: q.times(1e6, unit("10⁻⁶/K")) if q.unit == "1/K" else q for name, q in item.parameters.items()}
    sizes = [(name, *expanded(quantity), quantity) for name, quantity in parameters.items()]
    words = [
        _size(NOTHING if alone else Verbatim(name), value, U, k, quantity)
        if quantity.u > 0
        else say("{name} = {value:.4g}\u00a0{unit}", name=Verbatim(name), value=quantity.value, unit=quantity.unit)
        for name, value, U, k, quantity in sizes
    ]
    alike = item.together > item.probability + _SAME
    together = (
        say(" ({probability} of it or one that cannot be told from it)", probability=probability(item.together))
        if alike
        else NOTHING
    )
    if item.probability < ASSERTED:
        together = say(
            ", {probability} that it is this or one that this recording cannot tell from it: {group}",
            probability=probability(item.together), group=commas(item.group),
        )  # fmt: skip
    told = say(
        "{title}: {sizes}. What it points to: {points_to}. Probability {probability}{together}; "
        "explains {explained:.0f}\u00a0% of the misfit; on {unseen} that the fit had not seen the "
        "rms falls from {before:.1f} to {after:.1f}\u00a0µm.",
        title=item.title,
        sizes=commas(words),
        points_to=item.points_to,
        probability=probability(item.probability),
        together=together,
        explained=100 * item.explained,
        unseen=gain.unseen,
        before=gain.heldout_rms_before_um,
        after=gain.heldout_rms_after_um,
    )
    return after(told, other_periods(item.modes))


def _size(name: Text, value: Text, U: Text, k: Text, quantity: Quantity) -> Text:
    factor = NOTHING if k == NO_FACTOR else say(" (k\u00a0=\u00a0{k})", k=k)
    size = say("{value} ± {U}\u00a0{unit}{factor}", value=value, U=U, unit=quantity.unit, factor=factor)
    return say("{name} = {size}", name=name, size=size) if name else size


def noise_words(diagnosis: Diagnosis, stated_um: float | None) -> tuple[Text, ...]:
    """What the noise is like."""
    noise = diagnosis.noise
    low, high = noise.coordinate.interval95
    texts = [
        say(
            "Standard uncertainty of a coordinate {value:.2g} µm (95 % interval {low:.2g} to {high:.2g} µm).",
            value=noise.coordinate.value,
            low=low,
            high=high,
        )
    ]
    if noise.contradicts_stated and stated_um is not None:
        texts.append(say("This contradicts the stated {stated_um:g} µm.", stated_um=stated_um))
    if noise.placing.value > 0.3 * noise.coordinate.value:
        texts.append(
            say("Each set-up is off by about {value:.2g} µm that its repeats share.", value=noise.placing.value)
        )
    if noise.correlated_in_time:
        texts.append(say("Neighbouring readings are correlated in time."))
    if noise.heavy_tails:
        texts.append(say("The scatter has heavier tails than a normal distribution."))
    return tuple(texts)


def summary_of(
    facts: JobFile, verdict: str, p_value: float, told: Sequence[Text], findings: Iterable[Finding]
) -> Summary:
    """Verdict and everything that follows from it, and what the screening found, for the end of a command.

    Parameters
    ----------
    facts : of the job.
    verdict, p_value : of the diagnosis.
    told : the verdict in a sentence, and what follows from it.
    findings : of the screening.
    """
    subject = say("p = {p_value:.2g}. {told}", p_value=p_value, told=told[0])
    first = Verdict(VERDICTS_IN_SHORT[verdict], _STANDING[verdict], subject, ())
    warned = tuple(say("{why:capital}.", why=finding.why) for finding in findings)
    machine = Verbatim(facts.machine.name)
    return Summary(machine, day(facts.job.date), (first,), remarks=tuple(told[1:]), warnings=warned)
