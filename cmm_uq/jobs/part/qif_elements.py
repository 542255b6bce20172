"""What an element of a QIF document says: numbers, directions, on which side material lies."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree.ElementTree import Element

from cmm_uq.jobs.importing.qif import child, three
from cmm_uq.jobs.importing.xml_files import local
from cmm_uq.jobs.part.drawing import NotUnderstoodError


def number_of(text: str) -> float:
    """A number.

    Raises
    ------
    NotUnderstoodError : it is none.
    """
    try:
        return float(text)
    except ValueError:
        raise NotUnderstoodError(f"has {text!r} where a number belongs") from None


def inside(element: Element, name: str) -> Element | None:
    """The first element of this name in another; ``None`` where there is none."""
    return next((inner for inner in element if local(inner) == name), None)


def referred(element: Element, name: str, by_id: Mapping[str, Element]) -> Element:
    """The element to which another refers by a number.

    Raises
    ------
    NotUnderstoodError : there is none.
    """
    found = by_id.get(child(element, name))
    if found is None:
        raise NotUnderstoodError(f"refers by {name} to nothing that is there")
    return found


def numbers_in(element: Element | None) -> list[str]:
    """Numbers of elements that a list of them names."""
    return [] if element is None else [(one.text or "").strip() for one in element]


def direction(text: str, place: str) -> list[float]:
    """A direction or a normal.

    Raises
    ------
    NotUnderstoodError : it is not said.
    """
    if not text:
        raise NotUnderstoodError("does not say its direction or normal")
    return [number_of(word) for word in three(text, place)]


def is_inner(definition: Element) -> bool:
    """Whether a feature is a hole.

    Raises
    ------
    NotUnderstoodError : it does not say.
    """
    said = child(definition, "InternalExternal")
    if said not in ("INTERNAL", "EXTERNAL"):
        raise NotUnderstoodError("does not say whether it is a hole or a shaft")
    return said == "INTERNAL"
