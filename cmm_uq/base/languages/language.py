"""The languages that documents can be said in, and how each writes numbers, dates and plurals.

A decimal comma in German and French, a point in Japanese (both are right by the SI Brochure, 5.4.4); figures are grouped
nowhere, as in English. Dates by DIN 5008, by French usage, and by JIS X 0301.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, get_args

Code = Literal["en", "de", "fr", "ja"]
"""Of a language, by BCP 47."""

ENGLISH: Code = "en"
"""What every text is written in; no catalogue is read for it."""


@dataclass(frozen=True)
class Language:
    """How a language writes what is no sentence.

    Parameters
    ----------
    code : by BCP 47.
    decimal : its decimal sign.
    day : pattern of a date.
    singular : whether the form for one is said of a count; ``None`` where there is one form for all.
    parting : what parts figures in a row, where a comma is their decimal sign.
    cases : whether it has capital and small letters to begin a sentence with.
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
        return "".join(
            self.decimal
            if sign == "." and text[place - 1 : place].isdigit() and text[place + 1 : place + 2].isdigit()
            else sign
            for place, sign in enumerate(text)
        )

    def date(self, text: str) -> str:
        """A date by ISO 8601."""
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
