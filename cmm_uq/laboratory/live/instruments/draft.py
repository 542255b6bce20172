"""A new profile from one example line: its numbers become quantities, all else stays as it is."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.cells import column_problem
from cmm_uq.laboratory.live.instruments.control_codes import bytes_of

NUMBER = r"[-+]?\s*\d+\.?\d*(?:[Ee][-+]?\d+)?"
"""A number in a line."""

_FOUND = re.compile(r"(?:[-+]\s*|(?<![\w.]))\d+(?:\.\d+)?(?:[Ee][-+]?\d+)?|(?<=[A-Za-z_])\d+\.\d+")
"""The 1 of CH1 is none, the 20.1 of T20.1 is one."""


@dataclass(frozen=True)
class Drafted:
    """What a new profile says.

    Parameters
    ----------
    name, title : of it.
    line : an example, as it comes, with or without its end.
    quantities : name of the quantity for each number of the line that is one, by its place, counted from 1.
    ranges : least and largest plausible value by quantity.
    ask : what is sent to get a line; empty where they come by themselves.
    every_s : how often it is asked.
    settings : further keys of ``[connection]``.
    """

    name: str
    title: str
    line: str
    quantities: Mapping[int, str]
    ranges: Mapping[str, Sequence[float]]
    ask: str = ""
    every_s: float = 1.0
    settings: Mapping[str, str | int] | None = None


def numbers_in(line: str) -> list[str]:
    """The numbers of an example line, in turn."""
    return [found[0] for found in _FOUND.finditer(line_of(line))]


def line_of(text: str) -> str:
    """An example without its end."""
    return re.sub(r"(?:<CR>|<LF>|\r|\n)+$", "", text)


def terminator_of(text: str) -> str:
    """The end of an example; a line feed where it shows none, which nearly all lines end with."""
    end = text[len(line_of(text)) :].replace("\r", "<CR>").replace("\n", "<LF>")
    return end or "<LF>"


def range_of(text: str, name: str) -> tuple[float, float]:
    """Least and largest value, of ``0:40``.

    Raises
    ------
    CmmUqError : it is no range.
    """
    low, _, high = text.partition(":")
    try:
        found = float(low), float(high)
    except ValueError:
        found = (1.0, 0.0)
    if not found[0] < found[1]:
        raise CmmUqError(f"{text!r} is no range", where=f"range of {name}", fix="Write it as 0:40")
    return found


def drafted(wanted: Drafted) -> bytes:
    """The profile's file.

    Raises
    ------
    CmmUqError : a number that the line has not, or a name that is none of a column.
    """
    line = line_of(wanted.line)
    found = list(_FOUND.finditer(line))
    for place, name in wanted.quantities.items():
        if not 1 <= place <= len(found):
            raise CmmUqError(f"the line has {len(found)} numbers, so none with the number {place}", where="--quantity",
                             fix="Count them from 1")  # fmt: skip
        if problem := column_problem(name) or ("" if name.isidentifier() else "letters, digits and _ only"):
            raise CmmUqError(f"{name!r} cannot name a quantity: {problem}", where="--quantity",
                             fix="Name it as temp_c or x_mm, with its unit at its end")  # fmt: skip
    if not wanted.quantities:
        raise CmmUqError(
            "no quantity is named", where="--quantity", fix="Name one as temp_c=1, the line's first number"
        )
    pattern, place = "^", 0
    for number, one in enumerate(found, 1):
        pattern += _literal(line[place : one.start()])
        named = wanted.quantities.get(number)
        pattern += f"(?P<{named}>{NUMBER})" if named else NUMBER
        place = one.end()
    pattern += _literal(line[place:]) + r"\s*$"
    values = {name: float("".join(found[number - 1][0].split())) for number, name in wanted.quantities.items()}
    return "\n".join(_lines(wanted, pattern, values)).encode()


def _lines(wanted: Drafted, pattern: str, values: Mapping[str, float]) -> list[str]:
    end = terminator_of(wanted.line)
    lines = [
        f"name = {_text(_plain_name(wanted.name))}", f"title = {_text(wanted.title)}", "", "[connection]",
        *(f"{key} = {_text(value) if isinstance(value, str) else value}" for key, value in (wanted.settings or {}).items()),
        "", "[frame]", f"terminator = {_text(end)}", "", "[send]",
    ]  # fmt: skip
    if wanted.ask:
        lines += [f"poll = [{{ send = {_text(wanted.ask)} }}]", f"every_s = {wanted.every_s:g}"]
    else:
        lines += ["silent_after_s = 10"]
    lines += ["", "[parse]", "# Each number that is a quantity has its name in the pattern; blanks fit any number of blanks.",
              f"pattern = {_text(pattern)}", "ignore = ['\\s*']"]  # fmt: skip
    for name in values:
        if name in wanted.ranges:
            low, high = wanted.ranges[name]
            lines += ["", f"[quantities.{name}]", f"range = [{low:g}, {high:g}]"]
    told = ", ".join(f"{name} = {value!r}" for name, value in values.items())
    body = line_of(wanted.line)
    lines += [
        "", "[[example]]", f"received = {_text(body + end)}", f"values = {{ {told} }}", "", "[facts]",
        'not_found = ["what the instrument says when something is wrong: add [[ill]] for it"]', "",
    ]  # fmt: skip
    return lines


def _plain_name(name: str) -> str:
    """A name as profiles have it."""
    return re.sub(r"[^a-z0-9.-]+", "-", name.lower()).strip("-.") or "instrument"


def _literal(text: str) -> str:
    """Text that must be there, with as many blanks as there may be."""
    return r"\s*".join("".join(map(_escaped, bytes_of(part))) for part in re.split(r"\s+", text))


def _escaped(byte: int) -> str:
    return re.escape(chr(byte)) if 32 <= byte < 127 else f"\\x{byte:02x}"


def _text(text: str) -> str:
    """A literal text of TOML; one with a single quote in it in the other way."""
    if "'" not in text and text.isprintable():
        return f"'{text}'"
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04X}" for c in escaped) + '"'
