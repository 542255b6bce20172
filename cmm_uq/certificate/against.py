"""What a diagnosis against a simulation says of that simulation, on its page and in results.json."""

from __future__ import annotations

from collections.abc import Mapping

from cmm_uq.base.messages import NOTHING, Text, Verbatim, commas, say
from cmm_uq.certificate.document import Block, Column, Facts, Paragraph, Section, Table
from cmm_uq.certificate.effect_words import parameter_title, titles
from cmm_uq.certificate.simulated import Simulated
from cmm_uq.certificate.wording import expanded, with_uncertainty
from cmm_uq.machine.model import MeasurementModel
from cmm_uq.maths.inference.posterior import Posterior
from cmm_uq.maths.uncertainty.quantity import Quantity
from cmm_uq.maths.uncertainty.rounding import alike

VERDICTS: Mapping[str, Text] = {
    "consistent": say("The recording agrees with the simulation."),
    "explained": say("The recording does not agree with the simulation; what differs is found."),
    "partial": say("Something that differs is found, but structure remains that no known effect accounts for."),
    "unexplained": say("The recording does not agree with the simulation, and no known effect accounts for it."),
}


def corrections(
    simulated: Simulated, model: MeasurementModel, posterior: Posterior
) -> dict[str, dict[str, Quantity]]:  # fmt: skip
    """What the effects that were estimated anew differ by from what the simulation contains, by effect and parameter."""
    found: dict[str, dict[str, Quantity]] = {}
    for (owner, name), (values, of) in model.reported(posterior.draws, simulated.refitted).items():
        found.setdefault(owner, {})[name] = Quantity.of_draws(values, of)
    return found


def simulation_section(simulated: Simulated, refitted: Mapping[str, Mapping[str, Quantity]]) -> Section:
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
        blocks.append(_corrections(refitted))
    return Section(say("Simulation"), tuple(blocks))


def _uncertainty(simulated: Simulated) -> Text:
    if not simulated.u_um and not simulated.u_common_um:
        return say("not stated: taken as exact")
    own = say("{u:.3g} µm", u=simulated.u_um)
    if not simulated.u_common_um:
        return own
    return say("{own}, and {common:.3g} µm of the artefact's size in common", own=own, common=simulated.u_common_um)


def _corrections(refitted: Mapping[str, Mapping[str, Quantity]]) -> Table:
    rows = []
    for owner, quantities in refitted.items():
        for name, quantity in quantities.items():
            rows.append(
                (parameter_title(owner, name), with_uncertainty(quantity), quantity.unit, expanded(quantity)[2])
            )
    heads = (
        Column(say("Parameter"), numeric=False), Column(say("Machine minus simulation")),
        Column(say("Unit"), numeric=False), Column(say("k")),
    )  # fmt: skip
    return Table(say("What the simulation contains, estimated anew"), heads, tuple(rows))


def contained(simulated: Simulated | None, effect: str) -> Text:
    """To follow the sentence on an effect that the simulation contains: what was found is what it lacks of it."""
    if simulated is None or effect not in simulated.contains:
        return NOTHING
    return say("The simulation contains it: this is by how much the machine's differs.")
