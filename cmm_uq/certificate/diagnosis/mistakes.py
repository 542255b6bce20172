"""What a diagnosis says of the simulation's own mistakes: a sentence, what to do, a section, and its part of results.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from cmm_uq.analysis.diagnosis.simulation import SimulationMistake, SimulationMistakes
from cmm_uq.base.messages import NOTHING, Text, alternatives, lines, say
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import Column, Paragraph, Section, section, table
from cmm_uq.certificate.result import SimulatedTwin
from cmm_uq.certificate.wording import probability
from cmm_uq.maths.uncertainty.quantity import alike

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
    return say(
        "The simulation itself is at fault: {what}. Put right, it leaves {after} µm in place of {before} µm.",
        what=what,
        after=after,
        before=before,
    )


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
    rows = [_row(one) for one in (*([found.rounded] if found.rounded else []), *found.told)]
    heads = (
        say("Mistake"),
        Column(say("Probability")),
        Column(say("Residual rms")),
        Column(say("Held-out rms")),
        say("Unit"),
    )
    before = alike(found.rms_before_um, found.heldout_rms_before_um)
    rows.append((say("none, as it is predicted"), NOTHING, *before, unit("µm")))
    return section(_HEAD, Paragraph(said), table(say("What could be wrong with it"), heads, rows, tried))


def _row(one: SimulationMistake) -> tuple[Text, ...]:
    rms = alike(one.rms_um, one.heldout_rms_um)
    return (say("{what:capital}", what=one.title), probability(one.probability), *rms, unit("µm"))


def mistakes_data(found: SimulationMistakes) -> dict[str, Any]:
    """The ``diagnosis.simulation_mistakes`` part."""
    named, told = [one.name for one in found.asserted], [*found.told, *([found.rounded] if found.rounded else [])]
    return {
        "tried": found.tried,
        "named": named,
        "why_not": found.why or None,
        "rms_before_um": found.rms_before_um,
        "heldout_rms_before_um": found.heldout_rms_before_um,
        "told": [_data(one, named) for one in told],
    }


def _data(one: SimulationMistake, named: Sequence[str]) -> dict[str, Any]:
    value = None if one.value is None else {"value": one.value, "u": one.u, "unit": one.unit}
    return {
        "mistake": one.name,
        "what": one.title,
        "what_to_do": one.remedy,
        "named": one.name in named,
        "probability": one.probability,
        "odds_over_none": one.odds_over_none,
        "odds_over_physics": one.odds_over_physics,
        "rms_um": one.rms_um,
        "heldout_rms_um": one.heldout_rms_um,
        "elpd_gain": one.elpd_gain,
        "elpd_gain_se": one.elpd_gain_se,
        "estimate": value,
    }


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
