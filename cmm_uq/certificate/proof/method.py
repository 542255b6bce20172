"""What a proof says of itself: purpose and method, what it does not cover, how to check it."""

from __future__ import annotations

from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.laboratory.proving.cases import STRONGEST, WEAKEST
from cmm_uq.laboratory.proving.running import RECORDS, TRUTH
from cmm_uq.laboratory.proving.sight import ALLOWED


def method() -> tuple[Text, ...]:
    """Purpose, cases, strengths, noise, seal."""
    return (
        say(
            "Purpose: validation of a method (ISO/IEC 17025:2017, 7.2.2). The diagnosis of cmm-uq is to be fit for "
            "recordings made with these set-ups: to find what the job's model leaves out, to call it by its name, to stay "
            "silent where nothing is left out, and to state uncertainties and probabilities that hold."
        ),
        say(
            "Cases are drawn by the forward model of the job: its artefact in its set-ups, the errors that the job "
            "names as they were estimated, the size of the artefact within its certificate's uncertainty, and noise. "
            "Of every ten cases three hide nothing, three an effect of the catalogue, two two effects, one a "
            "function of place, time or set-up that no effect has, and one a fault of the artefact. Where a cause "
            "does not show in these set-ups, another takes its place."
        ),
        say(
            "A hidden cause has a strength √λ: its length in all observations over the noise, once all that the job "
            "names, and what else is hidden, has taken what it can. Strengths are evenly distributed from {weakest:g} "
            "to {strongest:g}, or to that of {allowed:g} standard deviations of what physics allows where an effect is "
            "then weaker. Of a function or a fault, no single effect leaves less than {weakest:g}.",
            weakest=WEAKEST, strongest=STRONGEST, allowed=ALLOWED,
        ),
        say(
            "Every other case has the noise of the job; the others in turn each kind of noise that these set-ups "
            "could show, as large as the job's readings."
        ),
        say(
            "The truth of all cases was written down and sealed by its hash before the first of them was diagnosed. "
            "Each recording then went through screening and diagnosis as a measured one does, with a seed of its "
            "own."
        ),
    )  # fmt: skip


def not_covered() -> tuple[Text, ...]:
    """What the figures say nothing of."""
    return (
        say(
            "Cases are drawn by the same forward model that the diagnosis fits. What is shown is that the diagnosis "
            "does what it says where machine and artefact behave as that model says, or have one of the strangers "
            "that were drawn; not that this machine does. An error in the model's own equations would not show here."
        ),
        say(
            "Not drawn: three and more causes at once, damaged and mistyped recordings, wrong temperatures and other "
            "columns beside a job's own, periods shorter than 6 mm or longer than the readings reach, set-ups other "
            "than these."
        ),
        say(
            "The figures hold for the strengths and the mixture that were drawn. Another share of strong causes "
            "would give another share of them found; the table by strength does not depend on it."
        ),
    )


def how_to_check() -> tuple[Text, ...]:
    """The seal, and the same again."""
    return (
        say(
            "{truth} holds the truth of every case, {records} what was said of it. The hash above is that of the "
            "first file as it stands: sha256sum {truth} gives it again.",
            truth=Verbatim(TRUTH), records=Verbatim(RECORDS),
        ),
        say("The same command with the same seed, on any number of processes, writes the same files."),
    )  # fmt: skip
