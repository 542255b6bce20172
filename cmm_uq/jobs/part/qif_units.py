"""Units of a QIF document: of geometry, of product information (PMI), and those that a value names itself."""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.importing.qif import child, length_unit, three
from cmm_uq.jobs.importing.units import UNITS, length_named
from cmm_uq.jobs.importing.xml_files import local
from cmm_uq.jobs.part.drawing import NotUnderstoodError
from cmm_uq.jobs.part.qif_elements import inside, number_of

_METRE_MM = 1000.0
_LINEAR, _ANGULAR = "LinearUnit", "AngularUnit"


class QifUnits:
    """What a number of a document is in mm and degrees.

    Parameters
    ----------
    root : of the document.
    where : its path, for messages.

    Raises
    ------
    CmmUqError : it does not say its unit of length, or one that is not known.
    """

    def __init__(self, root: Element, where: str) -> None:
        unit = length_unit(root, where)
        if unit is None:
            if inside(root, "ExternalQIFReferences") is not None:
                said = "does not say its unit of length, and refers to other QIF documents, which are not read"
                raise CmmUqError(said, where=where, fix="Export one document with everything in it")
            raise CmmUqError("does not say its unit of length", where=where, fix="Export the plan with FileUnits")
        name = UNITS[unit.casefold()]
        self._mm, self._degrees = name.up / name.down, math.degrees(1.0)
        units = next((element for element in root.iter() if local(element) == "FileUnits"), root)
        declared = [each for each in units.iter() if local(each).endswith((_LINEAR, _ANGULAR))]
        primary = inside(units, "PrimaryUnits")
        try:
            self._named = {(_sort(each), child(each, "UnitName")): _factor(each) for each in declared}
            own = {local(each): _factor(each) for each in ([] if primary is None else primary)}
        except NotUnderstoodError as error:
            raise CmmUqError(f"a unit {error}", where=f"{where}: FileUnits", fix="Export the plan again") from None
        self._degrees *= own.get(_ANGULAR, 1.0)
        self._pmi_mm = _METRE_MM * own["PMILinearUnit"] if "PMILinearUnit" in own else self._mm
        self._pmi_degrees = math.degrees(own["PMIAngularUnit"]) if "PMIAngularUnit" in own else self._degrees

    def mm(self, element: Element, *, pmi: bool = False) -> float:
        """A length.

        Raises
        ------
        NotUnderstoodError : it is no number, or in a unit that is not known.
        """
        return number_of(_text(element)) * self._scale(element, pmi=pmi)

    def degrees(self, element: Element, *, pmi: bool = False) -> float:
        """An angle; see :meth:`mm`."""
        given = element.get("angularUnit", "")
        scale = self._pmi_degrees if pmi else self._degrees
        if given:
            scale = math.degrees(self._declared(_ANGULAR, given))
        return number_of(_text(element)) * scale

    def place(self, element: Element | None, where: str) -> list[float]:
        """Coordinates."""
        scale = self._mm if element is None else self._scale(element, pmi=False)
        return [scale * number_of(word) for word in three("" if element is None else _text(element), where)]

    def _scale(self, element: Element, *, pmi: bool) -> float:
        given = element.get("linearUnit", "")
        if not given:
            return self._pmi_mm if pmi else self._mm
        known = length_named(given)
        return known.up / known.down if known is not None else _METRE_MM * self._declared(_LINEAR, given)

    def _declared(self, sort: str, name: str) -> float:
        if (sort, name) not in self._named:
            raise NotUnderstoodError(f"has the unit {name!r}, which the document does not explain")
        return self._named[sort, name]


def _sort(unit: Element) -> str:
    return _LINEAR if local(unit).endswith(_LINEAR) else _ANGULAR


def _factor(unit: Element) -> float:
    """Of a unit, in metres or radians."""
    return number_of(next((each.text or "" for each in unit.iter() if local(each) == "Factor"), "") or "1")


def _text(element: Element) -> str:
    return (element.text or "").strip()
