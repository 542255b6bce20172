"""What results.json says of what the model of a recording leaves out, as a section of a certificate's page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cmm_uq.app.serve.page import Block, Cell, Column, Facts, Paragraph, Section, Table
from cmm_uq.app.serve.words import VERDICTS, cell_of
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, commas, say
from cmm_uq.base.units import unit
from cmm_uq.certificate.effect_words import effect_of, size_of, title_of
from cmm_uq.certificate.wording import probability
from cmm_uq.laboratory.records.content import unit_of
from cmm_uq.maths.uncertainty.quantity import Quantity


def diagnosis_section(found: Mapping[str, Any]) -> tuple[Section, ...]:
    """A section, where there is a verdict.

    Parameters
    ----------
    found : ``diagnosis`` of results.json, of any version: what is not as expected is passed over.
    """
    if not found.get("verdict"):
        return ()
    blocks: list[Block] = [Facts(tuple(_verdict(found)))]
    rows = tuple(row for one in _list(found.get("effects")) if (row := _effect(one)) is not None)
    if rows:
        columns = (Column(say("Effect")), Column(say("Probability"), sort="number"), Column(say("Size")))
        blocks.append(Table(say("What the model leaves out"), columns, rows))
    pairs = [one for one in _list(found.get("indistinguishable")) if isinstance(one, list)]
    for pair in pairs:
        names = commas(title_of(str(name)) for name in pair)
        blocks.append(Paragraph(say("This recording cannot tell apart: {names}.", names=names)))
    asked = [one.get("what") for one in _list(found.get("suggested_measurements")) if isinstance(one, Mapping)]
    blocks += [Paragraph(say("Measure next: {what}", what=Verbatim(str(what)))) for what in asked if what]
    return (Section(say("Diagnosis"), tuple(blocks)),)


def _verdict(found: Mapping[str, Any]) -> list[tuple[Text, Cell]]:
    rows: list[tuple[Text, Cell]] = [(say("Verdict"), cell_of(VERDICTS, str(found["verdict"])))]
    p = found.get("p_value")
    if isinstance(p, (int, float)):
        rows.append((say("Lack-of-fit test, p"), Cell(probability(float(p)))))
    return rows


def _effect(one: Any) -> tuple[Cell, ...] | None:
    if not isinstance(one, Mapping) or not one.get("effect"):
        return None
    name, p = str(one["effect"]), one.get("probability")
    given = one.get("parameters")
    sizes = {str(key): quantity for key, value in (given if isinstance(given, Mapping) else {}).items()
             if (quantity := _quantity(str(key), value)) is not None}  # fmt: skip
    size = size_of(effect_of(name), sizes, factors=False) if sizes else NOTHING
    return Cell(title_of(name)), Cell(probability(float(p)) if isinstance(p, (int, float)) else DASH), Cell(size)


def _quantity(name: str, value: Any) -> Quantity | None:
    """A quantity of results.json; ``None`` where it is not whole."""
    try:
        low, high = value["interval95"]
        return Quantity(float(value["value"]), float(value["u"]), (float(low), float(high)), unit(unit_of(name)))
    except (TypeError, KeyError, ValueError):
        return None


def _list(found: Any) -> list[Any]:
    return found if isinstance(found, list) else []
