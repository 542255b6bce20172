"""What a diagnosis adds: effects that are probable and not asserted, corrections of a simulated machine, and the gain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from cmm_uq.analysis.diagnosis.assertion import WithheldEffect
from cmm_uq.analysis.diagnosis.diagnosis import OmittedEffect
from cmm_uq.analysis.diagnosis.held_out import Improvement
from cmm_uq.analysis.diagnosis.joint import Mode
from cmm_uq.base.messages import NOTHING, Text, Verbatim, commas, say
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import Block, Facts, Paragraph, Section, Table, figure_columns, text_columns
from cmm_uq.certificate.effect_words import parameter_title, titles
from cmm_uq.certificate.result import SimulatedTwin
from cmm_uq.certificate.wording import expanded, probability, with_uncertainty
from cmm_uq.machine.model import RecordingModel
from cmm_uq.maths.inference.posterior import Posterior
from cmm_uq.maths.uncertainty.quantity import Quantity, alike, rounded

_TOLD = 8  # periods that a sentence tells; results.json has all.


def sentences(withheld: Sequence[WithheldEffect]) -> list[Text]:
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


def withheld_data(withheld: Sequence[WithheldEffect]) -> list[dict[str, Any]]:
    return [{"effect": item.effect, "probability": item.probability, "why": item.why,
             "periods_mm": periods_data(item.modes)} for item in withheld]  # fmt: skip


def periods_data(modes: Sequence[Mode]) -> list[dict[str, Any]]:
    return [{"value": m.period.value, "u": m.period.u, "interval95": list(m.period.interval95),
             "probability": m.probability} for m in modes]  # fmt: skip


def _listed(modes: Sequence[Mode]) -> Text:
    periods: list[Text] = []
    for mode in modes[:_TOLD]:
        value, U = rounded(mode.period.value, mode.period.expanded)
        periods.append(say("{value} ± {U} {unit}: {probability}", value=value, U=U, unit=mode.period.unit,
                           probability=probability(mode.probability)))  # fmt: skip
    return commas([*periods, *([say("and {count} more", count=len(modes) - _TOLD)] if len(modes) > _TOLD else [])])


VERDICTS: Mapping[str, Text] = {
    "consistent": say("The recording agrees with the simulation."),
    "explained": say("The recording does not agree with the simulation; what differs is found."),
    "partial": say("Something that differs is found, but structure remains that no known effect accounts for."),
    "unexplained": say("The recording does not agree with the simulation, and no known effect accounts for it."),
}


def corrections(
    simulated: SimulatedTwin, model: RecordingModel, posterior: Posterior
) -> dict[str, dict[str, Quantity]]:
    """What the effects that were estimated anew differ by from what the simulation contains, by effect and parameter."""
    found: dict[str, dict[str, Quantity]] = {}
    for (owner, name), (values, of) in model.reported(posterior.draws, simulated.refitted).items():
        found.setdefault(owner, {})[name] = Quantity.of_draws(values, of)
    return found


def simulation_section(simulated: SimulatedTwin, refitted: Mapping[str, Mapping[str, Quantity]]) -> Section:
    """Which simulation it was, and what of it was estimated anew."""
    rows: list[tuple[Text, Text]] = [
        (say("Error map") if simulated.maps else say("Prediction"), Verbatim(file)) for file in simulated.files
    ]
    rows += [(say("SHA-256"), Verbatim(value)) for value in simulated.files.values()]
    rows += [
        (say("Program"), Verbatim(simulated.program) if simulated.program else NOTHING),
        (say("Effects that it contains"), commas(titles(simulated.contains)) or say("not stated")),
        (say("Estimated anew"), commas(titles(simulated.refitted)) or say("none")),
        (say("Standard uncertainty of a predicted coordinate"), _uncertainty(simulated)),
        (say("Predicted errors, rms in the observations"), say("{rms} µm", rms=alike(simulated.rms_predicted_um)[0])),
    ]
    blocks: list[Block] = [Facts(tuple((label, text) for label, text in rows if text))]
    blocks.append(Paragraph(say(
        "Observed minus predicted is what is explained here; where the artefact was taken to stand is no part of it. Sizes of "
        "effects are what the machine has beyond what the simulation contains. The noise is that of both together."
    )))  # fmt: skip
    if refitted:
        differing = tuple(
            (parameter_title(owner, name), with_uncertainty(quantity), quantity.unit, expanded(quantity)[2])
            for owner, quantities in refitted.items() for name, quantity in quantities.items()
        )  # fmt: skip
        heads = (*text_columns(say("Parameter")), *figure_columns(say("Machine minus simulation")),
                 *text_columns(say("Unit")), *figure_columns(say("k")))  # fmt: skip
        blocks.append(Table(say("What the simulation contains, estimated anew"), heads, differing))
    return Section(say("Simulation"), tuple(blocks))


def _uncertainty(simulated: SimulatedTwin) -> Text:
    if not simulated.u_um and not simulated.u_common_um:
        return say("not stated: taken as exact")
    own = say("{u:.3g} µm", u=simulated.u_um)
    if not simulated.u_common_um:
        return own
    return say("{own}, and {common:.3g} µm of the artefact's size in common", own=own, common=simulated.u_common_um)


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
    heads = (*text_columns(say("Quantity")), *figure_columns(say("Before"), say("After")), *text_columns(say("Unit")))
    return Table(say("Improvement"), heads, rows, (note,))
