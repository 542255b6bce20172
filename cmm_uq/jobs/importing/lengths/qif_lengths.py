"""Measured lengths of QIF results: a characteristic has an item, and this one what is nominal of it."""

from __future__ import annotations

from xml.etree.ElementTree import Element

from cmm_uq.jobs.importing.cells.encodings import local
from cmm_uq.jobs.importing.format import Row

_SORTS = ("Length", "DistanceBetween", "Distance", "LinearDistance", "Linear")
_LENGTHS = tuple(f"{sort}CharacteristicMeasurement" for sort in _SORTS)


def lengths_of_qif(root: Element) -> list[Row]:
    """Of each length or distance the name of its run, its own, what is nominal and what was measured."""
    known = {one.get("id", ""): one for one in root.iter() if one.get("id")}

    def text(element: Element | None, name: str) -> str:
        return "" if element is None else (element.findtext(f"{{*}}{name}") or "").strip()

    rows: list[Row] = []
    for results in (one for one in root.iter() if local(one) == "MeasurementResults"):
        for one in results.iter():
            if local(one) in _LENGTHS and (value := text(one, "Value")):
                item = known.get(text(one, "CharacteristicItemId"))
                nominal = known.get(text(item, "CharacteristicNominalId"))
                cells = [text(results, "Name"), text(item, "Name"), text(nominal, "TargetValue"), value]
                rows.append(("", [*cells], int(own) if (own := one.get("id", "")).isdigit() else 0))
    return rows
