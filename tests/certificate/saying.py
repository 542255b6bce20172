"""Texts of a document that are no message, number, date, unit, nor the user's own words: what nobody could translate."""

from __future__ import annotations

import html
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import Any

from cmm_uq.base.languages.translation import Catalogue, Code, Translation as Said, catalogue
from cmm_uq.base.messages import Day, Message, Number, Plural, Text, Verbatim
from cmm_uq.base.units import Unit
from cmm_uq.certificate.document import Document, Plot

NO_TEXT = {"language", "svg", "tone", "outcome", "standing", "date", "lettering"}
"""Fields of blocks that no reader sees as text."""

_WORD = re.compile(r"[^\W\d_]{2,}")
_NUMBER = re.compile(r"[<>\s±]*[+−-]?[\d.,\s]*(?:e[+−-]\d+|×10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?[%\s]*|[–∞¼½¾]|nan|inf")
_LETTERING = re.compile(r"<text[^>]*>(.*?)</text>", re.DOTALL)


def strangers(document: Document, known: str) -> list[str]:
    """Texts of a document with a word in them that cannot be translated and is not the user's.

    Parameters
    ----------
    known : the user's own words, and names that are the same in every language.
    """
    return [str(text) for text in leaves(document) if not said(text, known)]


def leaves(value: Any) -> Iterator[str]:
    """Every text of a document, those lettered in its pictures too."""
    if isinstance(value, str):
        yield value
    elif is_dataclass(value):
        for field in fields(value):
            if field.name not in NO_TEXT:
                yield from leaves(getattr(value, field.name))
        if isinstance(value, Plot):
            yield from lettered(value)
    elif isinstance(value, (list, tuple)):
        for item in value:
            yield from leaves(item)


def untranslated(value: Any, code: Code) -> set[str]:
    """Patterns of a document, those lettered in its pictures too, that the catalogue of a language lacks."""
    every = (message for text in (*leaves(value), *lettering(value)) for message in messages(text))
    return {message.pattern for message in every if not _known(message, catalogue(code))}


def _known(message: Message, known: Catalogue) -> bool:
    if isinstance(message, Plural) and (message.one.pattern, message.many.pattern) in known.plural:
        return True
    return message.pattern in known.single


def lettering(value: Any) -> Iterator[Text]:
    """Texts that pictures were lettered with."""
    for section in value.sections:
        for block in section.blocks:
            if isinstance(block, Plot):
                yield from block.lettering


def messages(text: object) -> Iterator[Message]:
    """A message and all that stand in it."""
    if isinstance(text, Message):
        yield text
        parts = (text.one, text.many) if isinstance(text, Plural) else (text,)
        for argument in (argument for part in parts for argument in part.arguments.values()):
            yield from messages(argument)


_DATES = re.compile(r"\d{4}-\d\d-\d\d|\d\d\.\d\d\.\d{4}|\d\d/\d\d/\d{4}|\d{4}年\d+月\d+日")


def figures(text: str) -> Counter[str]:
    """Numbers of a text with a decimal point or comma, dates left out."""
    plain = _DATES.sub(" ", str.__str__(text))
    return Counter(found.replace(",", ".") for found in re.findall(r"\d+(?:[.,]\d+)?", plain))


def lettered(plot: Plot) -> Iterator[str]:
    """Texts in the picture: the message that each is, where it is one."""
    sorts = {str.__str__(text): text for text in plot.lettering}
    for found in _LETTERING.findall(plot.svg):
        text = html.unescape(re.sub(r"<[^>]*>", "", found))
        known = sorts.get(text, text)
        yield known.source if isinstance(known, Said) else known


def said(text: object, known: str) -> bool:
    """Whether a text, and all that it is made of, can be said in another language or need not be."""
    if isinstance(text, Message):
        return all(said(argument, known) for argument in text.arguments.values())
    if isinstance(text, (Unit, Day, int, float)):
        return True
    if isinstance(text, Number):
        return bool(_NUMBER.fullmatch(text))
    if isinstance(text, Verbatim):
        return all(line.strip() in known or not _prose(line, known) for line in text.splitlines())
    return not _WORD.search(str(text)) if not isinstance(text, Text) else not text


def _prose(line: str, known: str) -> bool:
    """Whether a line has a word that is neither the user's nor an identifier."""
    return any(_WORD.fullmatch(word) and word not in known for word in re.split(r"[\s()\[\]{}*/+,;]+", line))
