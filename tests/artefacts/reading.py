"""Reads a composed document back."""

from cmm_uq.certificate.document import Document, Table


def tables(document: Document) -> dict[str, Table]:
    """By their captions."""
    return {b.caption: b for section in document.sections for b in section.blocks if isinstance(b, Table)}


def number(cell: str) -> float:
    """Of a cell, with a typographic minus sign."""
    return float(cell.replace("−", "-"))
