"""A diagnosis in words that a service technician acts on."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from cmm_uq.analysis.diagnosis.comparison.search import ASSERTED
from cmm_uq.analysis.diagnosis.diagnosis import Diagnosis, LeftOut
from cmm_uq.analysis.diagnosis.held_out import Improvement
from cmm_uq.analysis.screening.finding import Finding
from cmm_uq.base.messages import Text, Verbatim, after, commas, day, say
from cmm_uq.certificate.against import VERDICTS as AGAINST
from cmm_uq.certificate.diagnosis.next import next_sentence
from cmm_uq.certificate.diagnosis.overview import STANDING, overview_of
from cmm_uq.certificate.effect_words import effect_of, size_of, title_of, titles
from cmm_uq.certificate.in_short import Summary, Verdict
from cmm_uq.certificate.result import Diagnosed
from cmm_uq.certificate.withheld import other_periods
from cmm_uq.certificate.withheld import sentences as withheld_sentences
from cmm_uq.certificate.wording import probability
from cmm_uq.jobs.job import JobFile
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.maths.uncertainty.rounding import alike

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


def verdict_of(found: Diagnosed) -> Text:
    """The verdict in a sentence."""
    told = VERDICTS if found.simulated is None else AGAINST
    return told[found.diagnosis.verdict]


def lines(found: Diagnosed) -> list[Text]:
    """Verdict, the overview and what else follows, a sentence or two each."""
    d = found.diagnosis
    own = d.after.effects
    said = [
        verdict_of(found),
        *(say("{label}: {text}", label=label, text=text) for label, text in overview_of(found).rows),
        *withheld_sentences(d.withheld),
    ]
    said += [ambiguous(titles(group, own)) for group in d.indistinguishable]
    if told := next_sentence(found):
        said.append(told)
    return said + list(noise_words(d, stated_um(found)))


def ambiguous(group: Sequence[Text]) -> Text:
    """That a recording cannot tell some effects apart."""
    return say("This recording cannot tell apart: {effects}.", effects=commas(group))


def stated_um(found: Diagnosed) -> float | None:
    """Standard uncertainty of a coordinate, µm, that the job states; with that of the prediction that it is compared with."""
    stated = found.job.facts.recording.u_coordinate_um
    return (
        stated
        if stated is None or found.simulated is None
        else math.hypot(stated, found.simulated.u_um, found.simulated.u_turned_um)
    )


def sentence(item: LeftOut, gain: Improvement, own: Iterable[Effect] = ()) -> Text:
    """One left-out effect: size, cause, what it explains, and what was held out says."""
    told = say(
        "{title}: {size}. What it points to: {points_to}. {sure:capital}; {gain}.",
        title=item.title, size=size_of(effect_of(item.effect, own), item.parameters), points_to=item.points_to,
        sure=sure(item), gain=held_out(gain),
    )  # fmt: skip
    return after(told, other_periods(item))


def sure(item: LeftOut) -> Text:
    """How probable an effect is, and how much of the misfit it explains."""
    alike = item.together > item.probability + _SAME
    share = probability(item.probability)
    if item.probability < ASSERTED:
        share = say(
            "{share}, {together} that it is this or one that this recording cannot tell from it: {group}",
            share=share, together=probability(item.together), group=commas(title_of(name) for name in item.group),
        )  # fmt: skip
    elif alike:
        share = say("{share} ({together} of it or one that cannot be told from it)",
                    share=share, together=probability(item.together))  # fmt: skip
    return say(
        "probability {probability}; explains {explained:.0f}\u00a0% of the misfit",
        probability=share, explained=100 * item.explained,
    )  # fmt: skip


def held_out(gain: Improvement) -> Text:
    """What knowing an effect gains where the fit had not seen the recording."""
    before, after = alike(gain.heldout_rms_before_um, gain.heldout_rms_after_um)
    return say(
        "on {unseen} that the fit had not seen the rms falls from {before} to {after}\u00a0µm",
        unseen=gain.unseen, before=before, after=after,
    )  # fmt: skip


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


def summary_of(facts: JobFile, verdict: str, told: Sequence[Text], findings: Iterable[Finding]) -> Summary:
    """Verdict and everything that follows from it, and what the screening found, for the end of a command.

    Parameters
    ----------
    facts : of the job.
    verdict : of the diagnosis.
    told : the verdict in a sentence, and what follows from it.
    findings : of the screening.
    """
    first = Verdict(VERDICTS_IN_SHORT[verdict], STANDING[verdict], told[0], ())
    warned = tuple(say("{why:capital}.", why=finding.why) for finding in findings)
    machine = Verbatim(facts.machine.name)
    return Summary(machine, day(facts.job.date), (first,), remarks=tuple(told[1:]), warnings=warned)
