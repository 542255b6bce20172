"""Texts of a digital certificate: in English and in the language of the job; what the user wrote, as it stands."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from cmm_uq.base.languages.language import ENGLISH, Code
from cmm_uq.base.languages.saying import said_in
from cmm_uq.base.messages import Day, Number, Text, Verbatim, say
from cmm_uq.jobs.dcc.texts import Rich, Said, Words

SayIn = Callable[[Text], Mapping[str, str]]
"""A text by language, ISO 639-1."""

NOT_STATED = say("not stated")


def speaking(code: Code) -> SayIn:
    """What says a text in a language, and in English beside it."""

    def say_in(text: Text) -> Mapping[str, str]:
        codes = (code,) if code == ENGLISH else (code, ENGLISH)
        return {one: str.__str__(said_in(text, one)) for one in codes}

    return say_in


def said(text: str, say_in: SayIn) -> tuple[Said, ...]:
    """In each language; without one where nobody may translate it."""
    if isinstance(text, Text) and not isinstance(text, Verbatim | Number | Day):
        return tuple(Said(spoken, language) for language, spoken in say_in(text).items())
    return (Said(str.__str__(text)),)


def words_of(text: str, say_in: SayIn) -> Words:
    """A name."""
    return Words(said(text, say_in))


def rich_of(texts: Iterable[str], say_in: SayIn) -> Rich:
    """Paragraphs: all of one language, then all of the next."""
    found: dict[str | None, list[Said]] = {}
    for text in texts:
        for one in said(text, say_in):
            found.setdefault(one.language, []).append(one)
    return Rich(contents=tuple(one for spoken in found.values() for one in spoken))


def english(texts: Iterable[str]) -> Rich:
    """Sentences of results.json, which is English in every language."""
    return Rich(contents=tuple(Said(text, "en") for text in texts))


def one_line(text: str) -> str:
    """A text for an element that takes no spaces at its ends."""
    return " ".join(str.__str__(text).split())
