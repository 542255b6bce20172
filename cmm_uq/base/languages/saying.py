"""A text said in another language: its pattern by the catalogue, its numbers and dates as the language writes them.

What a catalogue lacks, as it does the sentences of another package, stays English. Units and verbatim texts are the same in
every language.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from typing import Any, Self

from cmm_uq.base.languages.catalogue import catalogue
from cmm_uq.base.languages.language import ENGLISH, LANGUAGES, Code, Language
from cmm_uq.base.messages import Argument, Day, Filled, Message, Number, Plural, Text


class Said(Text):
    """A text as it stands in a language, and what was said.

    Parameters
    ----------
    text : in the language.
    source : what it was in English.
    """

    __slots__ = ("source",)

    source: Text

    def __new__(cls, text: str, source: Text) -> Self:
        """Both."""
        said = super().__new__(cls, text)
        said.source = source
        return said

    def __reduce__(self) -> tuple[type[Said], tuple[str, Text]]:
        """For pickling."""
        return Said, (str.__str__(self), self.source)


def said_in(text: Text, code: Code) -> Text:
    """A message with all that stands in it, a number or a date in a language; any other text, also a said one, as it is."""
    if code == ENGLISH or not isinstance(text, Message | Number | Day):
        return text
    language = LANGUAGES[code]
    if isinstance(text, Number):
        return Said(language.number(str.__str__(text)), text)
    if isinstance(text, Day):
        return Said(language.date(str.__str__(text)), text)
    return Said(_filled(text, language), text)


def _filled(message: Message, language: Language) -> str:
    """The pattern with its arguments; figures with decimal commas that a comma would part are parted by a semicolon."""
    pattern, arguments, formatter = _pattern(message, language), _arguments(message), _formatter(language)
    parts: list[str] = []
    joins: list[int] = []
    for literal, name, spec, _ in formatter.parse(pattern):
        text = "" if name is None else _argument(arguments[name], spec or "", formatter)
        if literal == ", " and parts and _FIGURES.fullmatch(parts[-1]) and _FIGURES.fullmatch(text):
            joins.append(len(parts))
        parts += [literal, text]
    if any(_DECIMAL.search(parts[place + side]) for place in joins for side in (-1, 1)):
        for place in joins:
            parts[place] = language.parting
    return "".join(parts)


def _argument(value: Argument, spec: str, formatter: _Localised) -> str:
    said = said_in(value, formatter.language.code) if isinstance(value, Text) else value
    return formatter.format_field(said, spec)


_SIGNS = r"[-+−±\d,.; \u00a0\u202f×⁻⁰¹²³⁴⁵⁶⁷⁸⁹e]*"
_FIGURES = re.compile(rf"{_SIGNS}\d{_SIGNS}")
_DECIMAL = re.compile(r"\d,\d")


def _pattern(message: Message, language: Language) -> str:
    """In the language, else in English."""
    found = catalogue(language.code)
    if isinstance(message, Plural):
        count = message.number
        singular = language.singular is not None and language.singular(count)
        form = found.of_count(message.one.pattern, message.many.pattern, singular=singular, exactly_one=count == 1)
        if form is not None:
            return form
    return found.single.get(message.pattern, message.pattern)


def _arguments(message: Message) -> Mapping[str, Argument]:
    """Of a plural those of both forms, since another language may need what one of the English ones leaves out."""
    if not isinstance(message, Plural):
        return message.arguments
    return {**message.one.arguments, **message.many.arguments, **message.arguments}


class _Localised(Filled):
    """Numbers as the language writes them; in one without capitals nothing is changed to one."""

    def __init__(self, language: Language) -> None:
        self.language = language

    def format_field(self, value: Any, format_spec: str) -> str:
        """One argument."""
        if not isinstance(value, str):
            return self.language.number(format(value, format_spec))
        if format_spec in ("capital", "small") and not self.language.cases:
            return str.__str__(value)
        return super().format_field(value, format_spec)


@cache
def _formatter(language: Language) -> _Localised:
    return _Localised(language)
