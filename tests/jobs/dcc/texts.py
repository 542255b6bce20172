"""Texts of a certificate: in one language or in several, and paragraphs with files and formulas."""

from __future__ import annotations

from collections.abc import Mapping

from cmm_uq.jobs.dcc.certificate import CLASSES, Element


def words(texts: str | Mapping[str, str]) -> Element:
    """A text, or a text by language."""
    return CLASSES["Words"](_said(texts))


def rich(*texts: str | Mapping[str, str], files: tuple[Element, ...] = (), formulas: tuple[str, ...] = ()) -> Element:
    """Paragraphs, each a text or a text by language, with files and formulas (LaTeX)."""
    paragraphs = tuple(part for text in texts for part in _said(text))
    return CLASSES["Rich"](contents=(*paragraphs, *files, *(CLASSES["Latex"](latex) for latex in formulas)))


def _said(texts: str | Mapping[str, str]) -> tuple[Element, ...]:
    of = CLASSES["LanguageText"]
    return (of(texts),) if isinstance(texts, str) else tuple(of(text, language) for language, text in texts.items())
