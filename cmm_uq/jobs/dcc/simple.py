"""Simple types of the schemas: what the text of an element or an attribute may be, and what it is in Python.

Numbers are :class:`~decimal.Decimal`, so that a certificate keeps the digits it was printed with.
"""

from __future__ import annotations

import datetime as dt
import math
import re
from base64 import b64decode, b64encode
from binascii import Error as Base64Error
from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from typing import Any

from cmm_uq.base.files.limits import NUMERAL


@dataclass(frozen=True, eq=False)
class Simple:
    """A simple type.

    Parameters
    ----------
    what : it is, after "is not": "a date".
    read : value of a text; raises ``ValueError`` where it is none.
    write : text of a value; what ``read`` refuses is not written.
    """

    what: str
    read: Callable[[str], Any]
    write: Callable[[Any], str] = str


def _matching(what: str, pattern: str) -> Simple:
    """A text of a pattern."""
    wanted = re.compile(pattern)

    def read(text: str) -> str:
        if wanted.fullmatch(text) is None:
            raise ValueError(text)
        return text

    return Simple(what, read)


def one_of(*words: str) -> Simple:
    """One of some words."""
    return _matching(f"one of {', '.join(words)}", "|".join(words))


def listed(simple: Simple, plural: str) -> Simple:
    """A list of them, with spaces between."""
    return Simple(
        f"a list of {plural}",
        lambda text: tuple(simple.read(part) for part in text.split()),
        lambda values: " ".join(simple.write(value) for value in values),
    )


def _number(what: str, pattern: str, write: Callable[[Decimal], str] = str) -> Simple:
    wanted = re.compile(pattern)

    def read(text: str) -> Decimal:
        text = text.strip()
        if len(text) > NUMERAL.most or wanted.fullmatch(text) is None:
            raise ValueError(text)
        try:
            value = Decimal(text)
        except InvalidOperation:
            raise ValueError(text) from None
        if not math.isfinite(float(value)):
            raise ValueError(text)
        return value

    return Simple(what, read, write)


def _plain(value: Decimal) -> str:
    return format(value, "f")


def _not_empty(text: str) -> str:
    if not text or text != text.strip():
        raise ValueError(text)
    return text


def _boolean(text: str) -> bool:
    return {"true": True, "1": True, "false": False, "0": False}[text.strip()]


def _bytes(text: str) -> bytes:
    try:
        return b64decode("".join(text.split()), validate=True)
    except Base64Error as error:
        raise ValueError(text) from error


_UNSIGNED = r"((\d*\.\d+)|(\d+\.\d*)|(\d+\.?))([Ee][-+]?\d+)?"

STRING = Simple("a text", str)
NOT_EMPTY = Simple("a text without spaces at its ends", _not_empty)
BOOLEAN = Simple("true or false", _boolean, lambda value: "true" if value else "false")
DATE = Simple("a date", lambda text: dt.date.fromisoformat(text.strip()[:10]), dt.date.isoformat)
DATE_TIME = Simple("a date with time", lambda text: dt.datetime.fromisoformat(text.strip()), dt.datetime.isoformat)
BYTES = Simple("base64", _bytes, lambda data: b64encode(data).decode())
COUNTRY = _matching("a country of ISO 3166-1, two capital letters", "[A-Z]{2}")
LANGUAGE = _matching("a language of ISO 639-1, two small letters", "[a-z]{2}")
NAME = _matching("a name that XML takes as an id", r"[^\W\d][\w.\-]*")
DECIMAL = _number("a number", rf"[-+]?{_UNSIGNED}")
UNCERTAINTY = _number("a number, 0 or more", rf"\+?{_UNSIGNED}")
FACTOR = _number("a coverage factor, 1 or more", r"\+?(([1-9]\d*\.\d*)|([1-9]\d*))", _plain)
PROBABILITY = _number("a probability", r"\+?((0(\.\d*)?)|(1(\.0*)?))", _plain)

NAMES = listed(NAME, "ids")
STRINGS = listed(NOT_EMPTY, "words")
BOOLEANS = listed(BOOLEAN, "true and false")
DATE_TIMES = listed(DATE_TIME, "dates with times")
DECIMALS = listed(DECIMAL, "numbers")
UNCERTAINTIES = listed(UNCERTAINTY, "numbers, 0 or more")
FACTORS = listed(FACTOR, "coverage factors, 1 or more")
PROBABILITIES = listed(PROBABILITY, "probabilities")
