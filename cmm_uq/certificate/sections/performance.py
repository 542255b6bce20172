"""Figures of performance: as recorded, and of the machine alone, without noise.

The errors of a machine by what each made of the recording, as a picture: what to correct first.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cmm_uq.analysis.conformity.accuracy import TITLES
from cmm_uq.analysis.machine.performance import MachinePerformance, contributions
from cmm_uq.analysis.machine.regions import FactorRegions
from cmm_uq.base.messages import NOTHING, Text, commas, say, semicolons, signed
from cmm_uq.certificate import wording
from cmm_uq.certificate.document import Column, Plot, Section, Table, columns, section
from cmm_uq.certificate.origin import quantity_data
from cmm_uq.certificate.plots.residuals import budget_bars
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.wording import effect_title
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.maths.uncertainty.quantity import Quantity, rounded, significant


def machine_alone(result: Result) -> MachinePerformance | None:
    """``None`` where nothing is stated of the machine without noise."""
    regions = result.regions
    return regions.performance if isinstance(regions, FactorRegions) else None


def own_figures(result: Result) -> Mapping[str, Quantity]:
    """Of the machine, without noise; U not below the laboratory's capability."""
    machine = machine_alone(result)
    found: Mapping[str, Quantity] = {} if machine is None else machine.figures
    return found if result.stating is None else result.stating.all("performance_of_machine", found)


_LESS = 0.9  # part of U below which it is said what U would be


def returning_figures(result: Result) -> dict[str, Quantity]:
    """Whose U would be less by a tenth or more if what named errors leave at each set-up were the machine's."""
    found = result.returning if result.stating is None else result.stating.all("accuracy", result.returning)
    each = ((name, one, result.accuracy[name]) for name, one in found.items())
    return {name: one for name, one, stated in each if one.expanded < _LESS * stated.expanded}


def performance(result: Result) -> Section:
    """Figures of the lengths; without blocks for an artefact that has none."""
    title, own, regions = say("Figures of performance"), own_figures(result), result.regions
    if not result.accuracy:
        return section(title)
    machine = (say("Without noise from"), say("to")) if own else ()
    heads: tuple[Text | Column, ...] = (
        say("Quantity"),
        *map(Column, (say("Value"), say("U"), say("k"), *machine)),
        say("Unit"),
    )
    rows = []
    for name, one in result.accuracy.items():
        ends: tuple[Text, ...] = (NOTHING, NOTHING) if own else ()
        if name in own:
            ends = tuple(rounded(end, own[name].expanded)[0] for end in own[name].interval95)
        rows.append((TITLES[name], *wording.stated(one), *ends, one.unit))
    measurand = say(
        "Each figure estimates what the machine would show on average if the recording were "
        "repeated; all recorded lengths count. The test value of a statement of conformity is another quantity, that of "
        "this recording alone, and its U is the test uncertainty."
    )
    without = say(
        "Without noise: the 95 % interval of the same figure of the machine alone, by all of its errors together; nothing is "
        "decided by it."
    )
    notes: list[Text] = [wording.UNCERTAINTY, measurand]
    if again := returning_figures(result):
        each = [
            say("{figure:small} {U} {unit}", figure=TITLES[name], U=rounded(one.value, one.expanded)[1], unit=one.unit)
            for name, one in again.items()
        ]
        notes.append(
            say(
                "U counts what the named errors leave at each set-up, and its repeats share, as noise that would be another "
                "if the recording were repeated. If it is other errors of the machine, which would be there again, U is "
                "too wide, and would be: {figures}.",
                figures=semicolons(each),
            )
        )
    if own:
        notes.append(without)
    elif not isinstance(regions, FactorRegions) and regions:
        notes.append(say("What of them is the machine's alone, without noise, is not stated: {why}.", why=regions))
    notes += wording.skewed_note(result.accuracy.values())
    return section(title, Table(title, columns(heads), tuple(rows), tuple(notes)))


def with_performance(data: Mapping[str, Any], result: Result) -> dict[str, Any]:
    """Contents of results.json with the machine's own figures, and those of each statement."""
    own, machine = {name: quantity_data(one) for name, one in own_figures(result).items()}, machine_alone(result)
    found = dict(data) | ({"performance_of_machine": own} if own else {})
    if again := returning_figures(result):
        found["accuracy_if_left_returns"] = {name: quantity_data(one) for name, one in again.items()}
    if machine is None:
        return found
    each = [machine.of_statement(statement) for statement in result.statements]
    found["conformity"] = [
        stated if one is None else {**stated, "largest_um": one[0], "largest_without_noise_um": quantity_data(one[1])}
        for stated, one in zip(found["conformity"], each, strict=True)
    ]
    return found


def ranking_plot(result: Result) -> Plot:
    """Share of every named error in what the recording deviates by, the largest first."""
    ranked = contributions(result.model, result.posterior.draws.mean(axis=0))
    names = [say("{what}, {rms} µm", what=_called(one.owner, result), rms=significant(one.rms_um)) for one in ranked]
    shares = [one.share for one in ranked]
    parts = ((name, signed(100 * share, ".0f")) for name, share in zip(names, shares, strict=True))
    told = commas(say("{name}: {share} %", name=name, share=share) for name, share in parts)
    caption = say(
        "What each error makes of the recorded deviations: its share of their sum of squares, and its root mean square in one "
        "coordinate. A share below zero takes away from what others make."
    )
    return budget_bars(names, shares, caption=caption, alternative=told)


def _called(owner: str | None, result: Result) -> Text:
    if owner is None:
        return say("What no named error explains")
    return say("Sizes of the artefact") if owner == ARTEFACT else effect_title(owner, result.model.effects)
