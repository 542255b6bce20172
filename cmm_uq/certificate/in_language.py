"""A whole document said in a language: every text of every block, and what the views say by themselves go by its language."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from typing import Any

from cmm_uq.base.languages.language import ENGLISH, Code
from cmm_uq.base.languages.saying import said_in
from cmm_uq.base.messages import Text
from cmm_uq.certificate.document import Document


def said(document: Document, code: Code) -> Document:
    """The document in a language; pictures were lettered when they were drawn (:mod:`cmm_uq.certificate.lettering`)."""
    if code == ENGLISH:
        return document
    found: Document = _said(document, code)
    return replace(found, language=code)


def _said(value: Any, code: Code) -> Any:
    if isinstance(value, Text):
        return said_in(value, code)
    if isinstance(value, tuple):
        return tuple(_said(item, code) for item in value)
    if is_dataclass(value) and not isinstance(value, type):
        found = {field.name: getattr(value, field.name) for field in fields(value)}
        return replace(value, **{name: _said(item, code) for name, item in found.items()})
    return value
