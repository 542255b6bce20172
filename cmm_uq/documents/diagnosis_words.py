"""A diagnosis in words that a service technician acts on."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from cmm_uq.diagnosis.diagnosis import Diagnosis, LeftOut
from cmm_uq.diagnosis.held_out import Improvement
from cmm_uq.documents.result import Diagnosed
from cmm_uq.documents.wording import expanded, probability
from cmm_uq.screening.finding import Finding

_SAME = 0.01
"""Difference of two probabilities that is not worth telling."""

VERDICTS = {
    "consistent": "The recording agrees with the model that the job names.",
    "explained": "The recording does not agree with the model that the job names; what was left out is found.",
    "partial": "Something that was left out is found, but structure remains that no known effect accounts for.",
    "unexplained": "The recording does not agree with the model that the job names, and no known effect accounts for it.",
}


def lines(found: Diagnosed) -> list[str]:
    """Verdict and everything that follows from it, a sentence or two each."""
    d = found.diagnosis
    said = [VERDICTS[d.verdict], *(sentence(item, d.improvement) for item in d.effects)]
    said += [f"Cannot be told apart by this recording: {', '.join(group)}." for group in d.indistinguishable]
    said += [f"To part {' and '.join(s.separates)}: {s.what}" for s in found.suggestions]
    return said + list(noise_words(d, found.job.facts.recording.u_coordinate_um))


def sentence(item: LeftOut, gain: Improvement) -> str:
    """One left-out effect: size, cause, what it explains, and what was held out says."""
    alone = len(item.parameters) == 1
    parameters = {name: q.times(1e6, "10⁻⁶/K") if q.unit == "1/K" else q for name, q in item.parameters.items()}
    sizes = [(name, *expanded(quantity), quantity) for name, quantity in parameters.items()]
    words = [
        f"{'' if alone else f'{name} = '}{value} ± {U}\u00a0{quantity.unit} (k\u00a0=\u00a0{k})"
        if quantity.u > 0
        else f"{name} = {quantity.value:.4g}\u00a0{quantity.unit}"
        for name, value, U, k, quantity in sizes
    ]
    alike = item.together > item.probability + _SAME
    together = f" ({probability(item.together)} of it or one that cannot be told from it)" if alike else ""
    return (
        f"{item.title}: {', '.join(words)}. What it points to: {item.points_to}. "
        f"Probability {probability(item.probability)}{together}; explains {100 * item.explained:.0f}\u00a0% of the misfit; "
        f"on {gain.unseen} that the fit had not seen the rms falls from "
        f"{gain.heldout_rms_before_um:.1f} to {gain.heldout_rms_after_um:.1f}\u00a0µm."
    )


def noise_words(diagnosis: Diagnosis, stated_um: float | None) -> tuple[str, ...]:
    """What the noise is like."""
    noise = diagnosis.noise
    low, high = noise.coordinate.interval95
    texts = [
        f"Standard uncertainty of a coordinate {noise.coordinate.value:.2g} µm (95 % interval {low:.2g} to {high:.2g} µm)."
    ]
    if noise.contradicts_stated and stated_um is not None:
        texts.append(f"This contradicts the stated {stated_um:g} µm.")
    if noise.placing.value > 0.3 * noise.coordinate.value:
        texts.append(f"Each set-up is off by about {noise.placing.value:.2g} µm that its repeats share.")
    if noise.correlated_in_time:
        texts.append("Neighbouring readings are correlated in time.")
    if noise.heavy_tails:
        texts.append("The scatter has heavier tails than a normal distribution.")
    return tuple(texts)


def summary_rows(
    verdict: str, p_value: float, told: Sequence[str], findings: Iterable[Finding]
) -> tuple[tuple[str], ...]:
    """Verdict and everything that follows from it, and what the screening found, for the end of a command."""
    first = f"{verdict.upper()} (p = {p_value:.2g}). {told[0]}"
    return ((first,), *((text,) for text in (*told[1:], *(f"{f.why[0].upper()}{f.why[1:]}." for f in findings))))
