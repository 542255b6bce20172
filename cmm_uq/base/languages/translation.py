"""A document's texts in other languages: patterns by a catalogue, numbers and dates as the language writes them.

A decimal comma in German and French, a point in Japanese (both are right by the SI Brochure, 5.4.4); figures are grouped
nowhere, as in English. Dates by DIN 5008, by French usage, and by JIS X 0301. Catalogues are the ``.po`` files beside this
module: an entry's ``msgid`` is a pattern as :func:`cmm_uq.base.messages.say` has it, those of a ``Plural`` are ``msgid`` and
``msgid_plural``. What a catalogue lacks, as it does the sentences of another package, stays English. Units and verbatim texts
are the same in every language.
"""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, Self, get_args

from cmm_uq.base.messages import Argument, Day, Message, Number, Plural, Text, field, fields_of, parts_of, printed
from cmm_uq.base.values import dataclass

Code = Literal["en", "de", "fr", "ja"]  # of a language, by BCP 47
ENGLISH: Code = "en"  # what every text is written in; no catalogue is read for it


@dataclass(frozen=True)
class Language:
    """How a language writes what is no sentence.

    ``day``: pattern of a date; ``singular``: whether the form for one is said of a count, ``None`` where there is one form for
    all; ``parting``: what parts figures in a row with decimal commas; ``cases``: whether it has capital and small letters.
    """

    code: Code
    decimal: str
    day: str
    singular: Callable[[int], bool] | None
    parting: str = ", "
    cases: bool = True

    def number(self, text: str) -> str:
        """A number as English prints it, or a text of several: ``−3.2``, ``1.5e-3``, ``[0.1, 0.4]``."""
        if self.decimal == ".":
            return text
        return re.sub(r"(?<=\d)\.(?=\d)", self.decimal, text)

    def date(self, text: str) -> str:
        date = dt.date.fromisoformat(text)
        return self.day.format(year=date.year, month=date.month, day=date.day)


LANGUAGES: Mapping[Code, Language] = MappingProxyType({language.code: language for language in (
    Language("en", ".", "{year:04d}-{month:02d}-{day:02d}", lambda count: count == 1),
    Language("de", ",", "{day:02d}.{month:02d}.{year:04d}", lambda count: count == 1, "; "),
    Language("fr", ",", "{day:02d}/{month:02d}/{year:04d}", lambda count: count in (0, 1), "\u202f; "),
    Language("ja", ".", "{year:04d}年{month}月{day}日", None, cases=False),
)})  # fmt: skip
"""By their codes."""


def code_of(tag: str) -> Code:
    """The language of a BCP 47 tag, ``de-AT`` as ``de``; English of one that documents cannot be said in."""
    primary = tag.split("-")[0].lower()
    return next((code for code in get_args(Code) if code == primary), ENGLISH)


@dataclass(frozen=True)
class Catalogue:
    """Patterns in one language, by the English ones; of a plural by both forms of English, that for one first."""

    single: Mapping[str, str]
    plural: Mapping[tuple[str, str], tuple[str, ...]]

    def of_count(self, one: str, many: str, *, singular: bool, exactly_one: bool) -> str | None:
        """The form of a count; ``None`` where the catalogue has none.

        A form that says its number in words ("une longueur") is for one alone, though the grammar of a language may use the
        singular of other counts, as French does of 0.
        """
        forms = self.plural.get((one, many))
        if forms is None:
            return None
        return forms[0 if singular and (exactly_one or fields_of(many) <= fields_of(forms[0])) else -1]


def file_of(code: Code) -> Path:
    return Path(__file__).with_name(f"{code}.po")


@cache
def catalogue(code: Code) -> Catalogue:
    """The catalogue of a language, read when it is first asked for."""
    single: dict[str, str] = {}
    plural: dict[tuple[str, str], tuple[str, ...]] = {}
    for entry in _entries(file_of(code).read_text(encoding="utf-8")):
        forms = tuple(text for name, text in entry.items() if name.startswith("msgstr"))
        if not entry["msgid"] or not all(forms):
            continue
        if "msgid_plural" in entry:
            plural[entry["msgid"], entry["msgid_plural"]] = forms
        else:
            single[entry["msgid"]] = forms[0]
    return Catalogue(single, plural)


def _entries(text: str) -> Iterator[dict[str, str]]:
    """Texts of each entry that is not fuzzy, by their keywords: ``msgid``, ``msgstr[0]``."""
    entry: dict[str, str] = {}
    fuzzy, ignored, last = False, False, ""
    for line in (*text.splitlines(), 'msgid ""'):
        if line.startswith("#,"):
            fuzzy = "fuzzy" in line
        keyword, quote, rest = line.partition('"')
        if line.startswith("#") or not quote:
            continue
        if keyword == "msgid ":
            if entry:
                yield entry
            entry, ignored, fuzzy = {}, fuzzy, False
        if keyword:
            last = keyword.strip()
        if not ignored:
            entry[last] = entry.get(last, "") + _ESCAPED.sub(lambda found: _MEANT.get(found[1], found[1]), rest[:-1])


_ESCAPED, _MEANT = re.compile(r"\\(.)"), {"n": "\n", "t": "\t"}


class Translation(Text):
    """A text as it stands in a language, and what it was in English."""

    __slots__ = ("source",)

    source: Text

    def __new__(cls, text: str, source: Text) -> Self:
        translation = super().__new__(cls, text)
        translation.source = source
        return translation

    def __reduce__(self) -> tuple[type[Translation], tuple[str, Text]]:
        return Translation, (str.__str__(self), self.source)


def translated(text: Text, code: Code) -> Text:
    """A message with all that stands in it, a number or a date in a language; any other text, also a said one, as it is."""
    if code == ENGLISH or not isinstance(text, Message | Number | Day):
        return text
    language = LANGUAGES[code]
    if isinstance(text, Number):
        return Translation(language.number(str.__str__(text)), text)
    if isinstance(text, Day):
        return Translation(language.date(str.__str__(text)), text)
    return Translation(_filled(text, language), text)


def _filled(message: Message, language: Language) -> str:
    """The pattern with its arguments; figures with decimal commas that a comma would part are parted by a semicolon."""
    arguments: Mapping[str, Argument] = message.arguments
    if isinstance(message, Plural):  # another language may need what one of the English forms leaves out
        arguments = {**message.one.arguments, **message.many.arguments, **arguments}
    parts: list[str] = []
    joins: list[int] = []
    for literal, name, spec in parts_of(_pattern(message, language)):
        value = "" if name is None else arguments[name]
        value = translated(value, language.code) if isinstance(value, Text) else value
        text = "" if name is None else _field(value, spec, language)
        if literal == ", " and parts and _FIGURES.fullmatch(parts[-1]) and _FIGURES.fullmatch(text):
            joins.append(len(parts))
        parts += [literal, text]
    if any(_DECIMAL.search(parts[place + side]) for place in joins for side in (-1, 1)):
        for place in joins:
            parts[place] = language.parting
    return "".join(parts)


_SIGNS = r"[-+−±\d,.; \u00a0\u202f×⁻⁰¹²³⁴⁵⁶⁷⁸⁹e]*"
_FIGURES = re.compile(rf"{_SIGNS}\d{_SIGNS}")
_DECIMAL = re.compile(r"\d,\d")


def _pattern(message: Message, language: Language) -> str:
    """In the language, else in English."""
    patterns, form = catalogue(language.code), None
    if isinstance(message, Plural):
        count, one, many = message.number, message.one.pattern, message.many.pattern
        singular = language.singular is not None and language.singular(count)
        form = patterns.of_count(one, many, singular=singular, exactly_one=count == 1)
    return patterns.single.get(message.pattern, message.pattern) if form is None else form


def _field(value: Any, spec: str, language: Language) -> str:
    """Numbers as the language writes them; in one without capitals nothing is changed to one."""
    if not isinstance(value, str):
        return language.number(printed(value, spec))
    return str.__str__(value) if spec in ("capital", "small") and not language.cases else field(value, spec)
