"""XML of other programs: no entities, no external documents, and an end where the file ends."""

from __future__ import annotations

from xml.etree.ElementTree import Element, ParseError

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.importing.encodings import head_text

HOSTILE_FIX = "Export it again; a measuring program writes no DOCTYPE or ENTITY"


def root_of(content: bytes, where: str) -> Element:
    """The root of an XML file.

    Raises
    ------
    CmmUqError : it is damaged, or declares entities.
    """
    from defusedxml.common import DefusedXmlException
    from defusedxml.ElementTree import fromstring

    try:
        root: Element = fromstring(content, forbid_dtd=True)
    except DefusedXmlException:
        raise CmmUqError("declares entities or a document type, which can be made to exhaust a machine", where=where,
                         fix=HOSTILE_FIX) from None  # fmt: skip
    except (ParseError, ValueError, LookupError) as error:
        line = getattr(error, "position", (0, 0))[0]
        raise CmmUqError(f"is damaged XML: {error}", where=f"{where} line {line}" if line else where,
                         fix="Export it again: it was cut off or changed") from None  # fmt: skip
    return root


def local(element: Element) -> str:
    """Name of an element without its namespace."""
    return str(element.tag).rpartition("}")[2]


def begins_with(head: bytes, *roots: str) -> bool:
    """Whether a file is XML whose root is one of these."""
    text = head_text(head).lstrip("\ufeff \r\n\t")
    return text.startswith("<") and any(f"<{root}" in text or f":{root}" in text for root in roots)
