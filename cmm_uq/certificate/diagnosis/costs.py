"""What the choice of an explanation costs: what each that remains makes of effects, figures and decisions, and on average."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cmm_uq.analysis.conformity.accuracy import TITLES, UNITS
from cmm_uq.analysis.diagnosis.rivals import Named, Rival
from cmm_uq.base.messages import NOTHING, Text, Verbatim, after, commas, plural, say
from cmm_uq.certificate.document import Column, Section, Table
from cmm_uq.certificate.effect_words import parameter_title, titles
from cmm_uq.certificate.quantity_data import quantity_data
from cmm_uq.certificate.result import Diagnosed
from cmm_uq.certificate.wording import OUTCOME_WORDS, probability, with_uncertainty
from cmm_uq.maths.uncertainty.quantity import Quantity

_SHOWN = 4
"""Explanations that a table has columns for."""


def costs_section(found: Diagnosed) -> Section:
    """A table of what remains; without blocks where one explanation is settled, or nothing depends on it."""
    title, rivals = say("What the choice of an explanation costs"), found.diagnosis.remaining.rivals
    rows = (*_named(found), *_figures(found), *_decisions(found)) if rivals else ()
    if not rows:  # as against a simulation, where no effect of the job takes part
        return Section(title, ())
    heads = (
        Column(say("Quantity"), numeric=False),
        *(
            Column(say("{what}: {probability}", what=explanation(one), probability=probability(one.probability)))
            for one in rivals[:_SHOWN]
        ),
        Column(say("Averaged")), Column(say("Unit"), numeric=False),
    )  # fmt: skip
    notes: list[Text] = [
        say(
            "Each column is what follows if this explanation is the right one; figures and decisions are then corrected for "
            "its effects. Averages are weighted by the probabilities; a certificate states those of the error factors."
        )
    ]
    told = sum(one.probability for one in rivals)
    more = max(len(rivals) - _SHOWN, 0)
    share = say(
        "The averages are over explanations with {told} of the probability together; each of the rest has less.",
        told=probability(told),
    )
    left = plural(
        more, one=say("One further explanation is in results.json."),
        many=say("{count} further explanations are in results.json.", count=more),
    ) if more else NOTHING  # fmt: skip
    notes.append(after(left, share))
    return Section(title, (Table(say("What follows from each explanation that remains"), heads, rows, tuple(notes)),))


def costs_data(found: Diagnosed) -> dict[str, Any]:
    """For results.json: what remains, and the average; nothing where one explanation is settled."""
    remaining, costs = found.diagnosis.remaining, found.costs
    if not remaining.rivals:
        return {}
    each: list[dict[str, Any]] = []
    for i, rival in enumerate(remaining.rivals):
        cost = None if costs is None else costs.each[i]
        each.append({
            "probability": rival.probability, "effects": list(rival.effects), "functions": list(rival.functions),
            "estimates": _data(rival.named), "parameters": _data(rival.added),
            "figures": {} if cost is None else _each(cost.figures),
            "decisions": [] if cost is None else [one.outcome for one in cost.statements],
        })  # fmt: skip
    whole = {
        "estimates": _data(remaining.averaged),
        "figures": {} if costs is None else _each(costs.figures),
        "decisions": [] if costs is None else [dict(one) for one in costs.decisions],
    }
    return {"remaining": each, "averaged": whole}


def explanation(rival: Rival) -> Text:
    """What remains as an explanation, in short."""
    words = (*titles(rival.effects), *rival.functions)
    return commas(words) if words else say("nothing missing")


def _named(found: Diagnosed) -> list[tuple[Text, ...]]:
    remaining = found.diagnosis.remaining
    return [
        (
            parameter_title(effect, name),
            *(_size(rival.named[effect][name]) for rival in remaining.rivals[:_SHOWN]), _size(quantity), quantity.unit,
        )
        for effect, parameters in remaining.averaged.items() for name, quantity in parameters.items()
    ]  # fmt: skip


def _figures(found: Diagnosed) -> list[tuple[Text, ...]]:
    costs = found.costs
    if costs is None:
        return []
    return [
        (TITLES[name], *(_size(cost.figures[name]) for cost in costs.each[:_SHOWN]), _size(quantity), UNITS[name])
        for name, quantity in costs.figures.items()
    ]


def _decisions(found: Diagnosed) -> list[tuple[Text, ...]]:
    costs = found.costs
    if costs is None:
        return []
    return [
        (
            say("{standard}, {quantity}", standard=Verbatim(first.facts.standard), quantity=first.quantity),
            *(OUTCOME_WORDS[cost.statements[i].outcome] for cost in costs.each[:_SHOWN]),
            commas(
                say("{outcome} {probability}", outcome=OUTCOME_WORDS[outcome], probability=probability(p))
                for outcome, p in costs.decisions[i].items()
            ),
            NOTHING,
        )
        for i, first in enumerate(costs.each[0].statements)
    ]


def _size(quantity: Quantity) -> Text:
    return with_uncertainty(quantity)


def _data(named: Named) -> dict[str, Any]:
    return {effect: _each(parameters) for effect, parameters in named.items()}


def _each(quantities: Mapping[str, Quantity]) -> dict[str, Any]:
    return {name: quantity_data(quantity) for name, quantity in quantities.items()}
