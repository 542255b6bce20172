"""TOML read within limits: depth, digits and lengths are checked before and after it is parsed."""

from __future__ import annotations

import re
import tomllib
import unicodedata
from collections.abc import Iterator
from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import DEPTH, LISTED, NUMERAL, TEXT, TOML_KEY, WORD

_STRING = (
    r'"""(?:[^"\\]++|\\.|"(?!""))*+(?:"{3,5})?+'
    r"|'''(?:[^']++|'(?!''))*+(?:'{3,5})?+"
    r'|"(?:[^"\\\n]++|\\.)*+"?+'
    r"|'[^'\n]*+'?+"
)
_TOKEN = re.compile(
    rf"(?P<dotted>(?:(?:[\w-]++|{_STRING})[ \t]*+\.[ \t]*+){{{DEPTH.most}}}+)"
    rf"|(?P<string>{_STRING})|(?P<comment>\#[^\n]*+)"
    rf"|(?P<long>[\w-]{{{NUMERAL.most + 1},}}+)|[\w-]++|(?P<open>[\[{{])|(?P<close>[\]}}])",
    re.DOTALL,
)
"""Every alternative takes all that it can and never gives back, so that the time is linear in the text."""

_MARKS = frozenset("\u200c\u200d\u200e\u200f\u061c\u00ad\ufeff")
"""Invisible characters that ordinary text of some languages needs; all others steer terminals and change what is read."""


def toml_of(text: str, where: str, *, most_word: int = WORD.most, most_listed: int = LISTED.most) -> dict[str, Any]:
    """Contents of a TOML file.

    Parameters
    ----------
    text : of the file.
    where : its name, for messages.
    most_word : characters without a blank between them.
    most_listed : entries of a list.

    Raises
    ------
    tomllib.TOMLDecodeError : it is no TOML.
    CmmUqError : it goes beyond a limit, or a text has control characters in it.
    """
    _check_text(text, where)
    try:
        data = tomllib.loads(text)
    except RecursionError:  # whatever the check of the text let through
        raise _too_deep(where) from None
    for key, item in _items(data, where):
        _check_item(key, item, where, most_word, most_listed)
    return data


def _check_text(text: str, where: str) -> None:
    depth = 0
    for token in _TOKEN.finditer(text):
        kind = token.lastgroup
        depth += (kind == "open") - (kind == "close")
        if kind == "dotted" or depth > DEPTH.most:
            raise _too_deep(f"{where} line {_line(text, token)}")
        if kind == "long":
            raise CmmUqError(
                f"{token[0][:20]!r} … has {len(token[0])} characters: as a number, date or key, "
                f"{NUMERAL.most} are the most", where=f"{where} line {_line(text, token)}", fix="Put text in quotes",
            )  # fmt: skip


def _line(text: str, token: re.Match[str]) -> int:
    return text.count("\n", 0, token.start()) + 1


def _too_deep(where: str) -> CmmUqError:
    return CmmUqError("is nested too deeply", where=where, fix=f"{DEPTH.most} levels are the most")


def _items(data: dict[str, Any], where: str) -> Iterator[tuple[str, Any]]:
    """Everything in it with its key, without recursion."""
    left: list[tuple[str, Any, int]] = [("", data, 0)]
    while left:
        key, item, depth = left.pop()
        if depth > DEPTH.most:
            raise _too_deep(where)
        yield key, item
        if isinstance(item, dict):
            left.extend((f"{key}.{name}" if key else name, value, depth + 1) for name, value in item.items())
        elif isinstance(item, list):
            left.extend((key, value, depth + 1) for value in item if isinstance(value, (dict, list, str)))


def _check_item(key: str, item: Any, where: str, most_word: int, most_listed: int) -> None:
    place = f"{where}: {key}"
    if isinstance(item, dict):
        for name in item:
            if len(name) > TOML_KEY.most:
                raise CmmUqError(f"a key of {len(name)} characters: {name[:20]!r} …", where=place,
                                 fix=f"{TOML_KEY.most} are the most")  # fmt: skip
            _check_characters(name, place)
    elif isinstance(item, list) and len(item) > most_listed:
        raise CmmUqError(f"has {len(item)} entries", where=place, fix=f"{most_listed} are the most")
    elif isinstance(item, str):
        _check_characters(item, place)
        if len(item) > TEXT.most:
            raise CmmUqError(f"a text of {len(item)} characters", where=place, fix=f"{TEXT.most} are the most")
        word = max(map(len, item.split()), default=0)
        if word > most_word:
            raise CmmUqError(f"a word of {word} characters", where=place,
                             fix=f"{most_word} are the most: shorten it, or put blanks into it")  # fmt: skip


def _check_characters(text: str, place: str) -> None:
    if text.isascii() and text.isprintable():
        return
    for c in text:
        if unicodedata.category(c)[0] == "C" and c not in "\n\t\r" and c not in _MARKS:
            raise CmmUqError(f"has the control character U+{ord(c):04X} in it", where=place, fix="Remove it")
