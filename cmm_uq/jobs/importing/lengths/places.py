"""Where lines lie, by what a file says of them: start and end, or a start and an axis; what it leaves open is ``?``.

A text says a place by three figures in brackets, behind the letters X, Y, Z, or after a word for a start or an end. Which of
two places is the start words say, else their order; a place alone that no word calls a start may be the middle of a line.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.jobs.importing.factors import LINE, hint
from cmm_uq.jobs.importing.header import plain_words, unspaced, words_of

START, END, DIRECTION = "start", "end", "direction"
_PLAIN = r"[+-]?\d+(?:[.,]\d+)?"
_GROUPED = r"[+-]?\d{1,3}(?:[ '’]\d{3})+(?:[.,]\d+)?|" + _PLAIN
_PART = re.compile(rf"\s*(?:[XYZ]\s*[=:]?\s*)?({_GROUPED})\s*(?:mm|in|\")?\s*", re.I)
_PAIR = re.compile(rf"\s*({_GROUPED})\s*[;/|,]\s*({_GROUPED})\s*")
_BRACKET = re.compile(r"[(\[{<]([^()\[\]{}<>]{3,60})[)\]}>]")
_TO = r"\s*(?:\.{2,3}|→|->|~|–|—|-(?=\s)|\b[^\W\d]{1,5}\b)\s*"
_LETTER = re.compile(
    rf"(?<![^\W_])(?:(?P<axis>[XYZxyz])0?\s*[=:]\s*(?P<value>{_GROUPED})"
    rf"|(?P<bare>[XYZ])\s+(?P<word>[^\W\d]{{2,9}}\s+)?(?P<own>{_PLAIN}))(?![.,]?\d)(?:\s?mm\b)?"
    rf"(?:(?=(?P<to>{_TO})(?P<again>[XYZxyz]?)\s*[=:]?\s*(?P<end>{_GROUPED})(?![.,]?\d))|)"
)
_BARE = re.compile(
    rf"(?<![\w.,+-])({_PLAIN})" + rf"(?:\s*[;/|]\s*|,\s+|,(?=[+-]?\d)|\s+)({_PLAIN})" * 2 + r"(?![.,]?\d)"
)
_ALL_AXES = re.compile(r"X\W{0,3}Y\W{0,3}Z\W{0,3}(?:\([^)\d]*\))?\W{0,5}$", re.I)
_AXIS = re.compile(r"(?<![A-Za-z])([+-]?)([XYZ]+)(?![A-Za-z\d]|\s*[=:]?\s*[+-]?\d)")
_ARROW = re.compile(r"(?:→|->|=>|~|–|—|\.\.)\s*$")
_NEAR_MM = 1.0  # by which places are rounded
_FAR, _FAR_UNSAID = 3.0, 1.5  # of the longest length: farther are no ends of it, said to be so or not
_ROUNDED = 0.002  # of a length, which its place may be shorter by
_VECTOR = 2.0  # larger figures are none of a direction
_SHOWN = 160  # characters of the words of a place
_LABEL = 30  # characters of the name of a line elsewhere
_LAST = 3  # words that may lead to a place
_NEAR_WORD = 20  # characters between a word and its figures
Point = dict[str, float]
Coordinates = tuple[int, int, Point, Point | None]
"""Span in a text and coordinates by axis; behind letters with those that they run to, else of a place."""


@dataclass
class Said:
    """What texts say: coordinates of start and end, those of neither, places of which nobody says which, axes, a direction."""

    start: Point = field(default_factory=dict)
    end: Point = field(default_factory=dict)
    across: Point = field(default_factory=dict)
    loose: list[Point] = field(default_factory=list)
    axes: set[str] = field(default_factory=set)
    way: Point = field(default_factory=dict)
    odd: bool = False  # whether it contradicts itself

    def take(self, into: Point, values: Point) -> None:
        self.odd |= any(into.get(axis, value) != value for axis, value in values.items())
        into |= values

    @property
    def whole(self) -> bool:
        """Whether it has a place, and says what of a line lies there, or two."""
        return any(len(one) == 3 for one in (self.start, self.end)) or len(self.loose) > 1


def role_of(text: str, *, after: bool = False) -> str:
    """What words ahead of figures say of them; of those with two letters the last, or ``after`` other figures the first."""
    words = plain_words(text)
    least = {len(words) - 1, *([0] if after else [])}
    found = (_role(word) for k, word in [*enumerate(words)][::-1] if len(word) > 2 or not word.isascii() or k in least)
    return next(filter(None, found), "")


def role_among(text: str) -> str:
    """What a head says of the figures below it; of two letters its first word."""
    words = plain_words(text)
    found = (
        _role(word) for k, word in enumerate(words) if len(word) > 2 or not word.isascii() or (k == 0 and len(word) > 1)
    )
    return next(filter(None, found), "")


def _role(word: str) -> str:
    for name, those in words_of("places").items():
        if word in those or (unspaced(word) and any(word.endswith(one) for one in those if unspaced(one))):
            return name
    return ""


def without_place(text: str, sign: str) -> str:
    """What stands ahead of the place in a title."""
    first = next(iter(_figures(text, sign)), None)
    ahead = text if first is None else text[: first[0]]
    words = [*re.finditer(r"[^\W\d_]+", ahead)][-_LAST:]
    k = next(
        (
            k
            for k, word in enumerate(words)
            if role_of(word[0]) and (len(word[0]) > 2 or not word[0].isascii() or word is words[-1])
        ),
        None,
    )
    return (ahead if k is None else ahead[: words[k].start()]).rstrip(" \t:;,([-–—=")


def said_in(texts: Iterable[str], sign: str = ".") -> Said:
    """What texts say of the place of one line."""
    said, texts = Said(), [*dict.fromkeys(texts)]
    planes = set[str]().union(*map(_planes, texts))
    for text in texts:
        plain = unicodedata.normalize("NFKC", text).replace("−", "-")
        last, before = 0, False
        for start, end, values, to in _figures(plain, sign, planes):
            gap, place = plain[last:start], to is None or len(values) == 3
            role = role_of(re.split(r"\d", gap)[-1], after=before) or (END if before and _ARROW.search(gap) else "")
            if role == DIRECTION and len(values) == 3 and max(map(abs, values.values())) <= _VECTOR:
                said.take(said.way, values)
            elif role == START or to:
                said.take(said.start, values)
            elif role == END or (role and place):
                said.take(said.end, values)
            elif place:
                said.loose += [values] if values not in said.loose else []
            else:
                said.take(said.across, values)
            said.take(said.end, to or {})
            last, before = end, place
        axes = _AXIS.findall(plain)
        said.axes |= {sense + letters for sense, letters in axes if len(letters) == 1}
    return said


def _planes(text: str) -> set[str]:
    return {"".join(sorted(letters)) for _, letters in _AXIS.findall(text) if len(letters) == 2}


def _figures(text: str, sign: str, planes: Collection[str] = ()) -> list[Coordinates]:
    """Coordinates in a text: three in brackets, behind the letters of all axes or behind a word; each behind its letter."""
    found: list[Coordinates] = []
    planes = planes or _planes(text)
    for match in _BRACKET.finditer(text):
        if (three := _three(match[1], sign)) is not None:
            found.append((match.start(), match.end(), dict(zip("XYZ", three, strict=True)), None))
        elif (two := _PAIR.fullmatch(match[1])) and len(planes) == 1:
            both = [_value(two[k], sign) for k in (1, 2)]
            own = {axis: value for axis, value in zip(*planes, both, strict=True) if value is not None}
            found.append((match.start(), match.end(), own, None))
    for match in _BARE.finditer(text):
        ahead = text[max((b for _, b, *_ in found if b <= match.start()), default=0) : match.start()]
        role = role_of(ahead) if len(re.sub(r"^.*[^\W\d_]", "", ahead)) < _NEAR_WORD else ""
        near = role and not re.search(r"\b[a-z]\W*$", ahead, re.I)
        three = _three(match[0], sign) if near or _ALL_AXES.search(ahead) else None
        if three and role == DIRECTION and max(map(abs, three)) > _VECTOR:
            continue
        if three is not None and not any(a < match.end() and match.start() < b for a, b, *_ in found):
            found.append((match.start(), match.end(), dict(zip("XYZ", three, strict=True)), None))
    return sorted([*found, *_lettered(text, sign, found)], key=lambda one: one[0])


def _lettered(text: str, sign: str, taken: Sequence[Coordinates]) -> Iterator[Coordinates]:
    """Coordinates behind the letters of their axes, those that follow each other together; one alone is called one."""
    group: Coordinates | None = None
    for match in [*_LETTER.finditer(text), None]:
        if match is not None and any(
            a < match.end() and match.start() < b for a, b, *_ in (*taken, *([group] if group else []))
        ):
            continue
        if group is not None and (
            match is None or _axis(match) in group[2] or re.search(r"\w", text[group[1] : match.start()])
        ):
            if len(group[2]) > 1 or re.search(r"[=:]|[^\W\d]{2}", text[slice(*group[:2])]) or role_of(text[: group[0]]):
                yield group
            group = None
        value = None if match is None else _value(match["value"] or match["own"], sign)
        if match is None or value is None or (match["word"] and role_of(match["word"]) != START):
            continue
        axis, to = _axis(match), None
        if match["end"] and match["again"].upper() in ("", axis):
            to = (
                _value(match["end"], sign) if role_of(match["to"]) == END or not re.search(r"\w", match["to"]) else None
            )
        own: Coordinates = (match.start(), match.end(), {axis: value}, {})
        if to is not None:
            own = (match.start(), match.end("end"), {axis: value}, {axis: to})
        group = own if group is None else (group[0], own[1], group[2] | own[2], {**(group[3] or {}), **(own[3] or {})})


def _axis(match: re.Match[str]) -> str:
    return (match["axis"] or match["bare"]).upper()


def _three(text: str, sign: str) -> list[float] | None:
    """Three figures, apart by what stands between them; ``None`` where they are not three, or may be others."""
    cuts = [text.split(cut) for cut in ";/|"] + [re.split(r",\s+", text), re.split(r",", text), text.split()]
    for parts in cuts:
        if len(parts) == 3 and all(_PART.fullmatch(part) for part in parts):
            values = [_value(match[1], sign) for part in parts if (match := _PART.fullmatch(part))]
            return [one for one in values if one is not None] if None not in values else None
    return None


def _value(text: str, sign: str) -> float | None:
    """A figure; ``None`` where a comma may part thousands or thousandths."""
    if sign == "." and re.fullmatch(r"[+-]?\d{1,3},\d{3}", text):
        return None
    return float(re.sub(r"(?<=\d)[ '’](?=\d)", "", text).replace(",", "."))


def _full(point: Point, *others: Point) -> Floats | None:
    """A place, with coordinates of others where it has none; ``None`` where one is not there."""
    own = {axis: value for one in reversed((point, *others)) for axis, value in one.items()}
    return np.array([own[axis] for axis in "XYZ"]) if len(own) == 3 else None


def place_of_line(said: Sequence[Said], longest: float, near: float, others: Sequence[Floats] = ()) -> str:
    """Where a line lies, in the unit of the texts, as ``LINE_PLACE`` has it; with ``?`` for what is open, empty where all is.

    said : of each of its rows; longest : of its lengths; near : by what places are rounded; others : starts of other lines.
    """
    axes = set[str]().union(*(one.axes for one in said))
    letters = {axis[-1] for axis in axes}
    axis = letters.pop() if len(letters) == 1 else ""
    whole, starts, ends, said_so = Said(), list[Floats](), list[Floats](), True
    for one in said:
        start, end = one.start, one.end
        if len(one.loose) == 2 and not start and not end:
            (start, end), said_so = one.loose, False
        elif len(one.loose) == 1 and bool(start) != bool(end):
            start, end = (start, one.loose[0]) if start else (one.loose[0], end)
        else:
            whole.odd |= bool(one.loose)
        whole.odd |= one.odd
        for into, values in ((whole.across, one.across), (whole.way, one.way), (whole.start, start)):
            whole.take(into, values)
        starts += [own for own in (_full(start, one.across),) if own is not None]
        ends += [own for own in (_full(end, one.across, start),) if end and own is not None]
    if whole.odd:
        return ""
    if starts and (ends or whole.way):
        most = longest * (_FAR if said_so else _FAR_UNSAID)
        return _from_to(starts[0], ends, whole.way, axis, longest, most, near)
    if starts and axis:
        i = "XYZ".index(axis)
        sense = _sense(axes, starts[0][i], longest, [one[i] for one in others])
        return f"along {sense.removeprefix('+')}{axis} from {_text(starts[0])}" if sense else ""
    known = whole.across | whole.start
    at = ",".join(f"{known[one]:.10g}" if one in known else "?" for one in "XYZ")
    return f"along {axis} from {at}" if axis else ""


def _from_to(
    start: Floats, ends: Sequence[Floats], way: Point, axis: str, longest: float, most: float, near: float
) -> str:
    """A line from its start to the farthest of its ends, which lie in one direction and as far as its lengths need."""
    if way:
        vector = np.array([way[one] for one in "XYZ"])
        ends = [start + longest * vector / max(float(np.linalg.norm(vector)), 1e-9)]
    far = max(ends, key=lambda end: float(np.linalg.norm(end - start)))
    reach = float(np.linalg.norm(far - start))
    off = [float(np.linalg.norm(np.cross(far - start, end - start))) / max(reach, 1e-9) for end in ends]
    off += [reach - abs(float((far - start)["XYZ".index(axis)]))] if axis else []
    fits = max(off) <= near and longest * (1 - _ROUNDED) - near <= reach <= most
    return f"from {_text(start)} to {_text(far)}" if fits else ""


def _sense(axes: set[str], start: float, longest: float, others: Sequence[float]) -> str:
    """Which way a line goes from its start: as a sign says, else towards where other lines lie."""
    if signs := {one[0] for one in axes if len(one) > 1}:
        return signs.pop() if len(signs) == 1 else ""
    up, down = (sum(a <= one <= a + longest for one in others) for a in (start, start - longest))
    return "+" if up > down or (up == down == 0 and 0 <= start < longest) else ""


def _text(point: Floats) -> str:
    return ",".join(f"{one:.10g}" for one in point)


def says_figures(text: str) -> bool:
    """Whether a text has coordinates."""
    return any(_figures(unicodedata.normalize("NFKC", one), ".") for one in text.split("\n"))


def stated_places(
    names: Sequence[str],
    texts: Sequence[str],
    elsewhere: Sequence[tuple[str, str]],
    measured_mm: Sequence[float],
    mm: float,
    sign: str,
) -> dict[str, tuple[str, str]]:
    """Where lines lie by the texts of each of their lengths, in mm with ``?`` for what is open, and the words that say it.

    elsewhere : rows that are no lengths, each with its first cell; they speak of the line whose name they have, or its number.
    """
    rows: dict[str, dict[str, float]] = {name: {} for name in names}
    for name, text, length in zip(names, texts, measured_mm, strict=True):
        rows[name][text] = max(rows[name].get(text, 0.0), length)
    starts = {name: _starts(own, sign) for name, own in rows.items()}
    found = {}
    for name, own in rows.items():
        for more in ((), _about(name, rows, elsewhere)):
            said = [said_in([*text.split("\n"), *more], sign) for text in own]
            others = [one for other, starts_ in starts.items() if other != name for one in starts_]
            place = place_of_line(said, max(own.values()) / mm, _NEAR_MM / mm, others)
            if place and (name not in found or "?" not in place):
                words = "; ".join(
                    dict.fromkeys(
                        one for text in (*own, "\n".join(more)) for one in text.split("\n") if says_figures(one)
                    )
                )
                found[name] = _in_mm(place, mm), words[:_SHOWN]
            if place and "?" not in place:
                break
    return found


def _starts(texts: Iterable[str], sign: str) -> list[Floats]:
    each = (said_in(text.split("\n"), sign) for text in texts)
    return [own for said in each if (own := _full(said.start, said.across)) is not None][:1]


def _about(name: str, names: Collection[str], elsewhere: Sequence[tuple[str, str]]) -> list[str]:
    """Texts elsewhere with the name of a line up to that of another, or its number where each has its own; of one line all."""
    numbers = {one: re.findall(r"\d+", one) for one in names}
    apart = len({*map(tuple, numbers.values())}) == len(names) and all(len(own) == 1 for own in numbers.values())
    own = {
        first for first, _ in elsewhere if len(first) < _LABEL and apart and re.findall(r"\d+", first) == numbers[name]
    }
    found = [text for first, text in elsewhere if len(names) == 1 or first in own | {name}]
    called = {one: one for one in names if not one.isdigit() and len(one) > 1}
    called |= {part: one for one in names for part in re.findall(r"\b[^\W\d_]+\d+\b", one)}  # as P1 of ``Position P1``
    words = (re.escape(one) for one in sorted(called, key=len, reverse=True))
    pattern = re.compile(rf"(?<!\w)(?:{'|'.join(words) or '(?!)'})(?!\w)")
    for _, text in elsewhere:
        parts = [*pattern.finditer(text)]
        ends = [*(part.start() for part in parts[1:]), len(text)] if parts else []
        found += [text[part.start() : end] for part, end in zip(parts, ends, strict=True) if called[part[0]] == name]
    return [line for text in dict.fromkeys(found) for line in text.split("\n")]


def place_of_axis(axis: str, texts: Iterable[str], mm: float, sign: str) -> tuple[str, str] | None:
    """Where a run along an axis lies, its scale at 0, in mm: where a text that names it gives both other coordinates."""
    found: dict[str, str] = {}
    for text in texts:
        said = said_in([text], sign)
        named = hint(text, lengths=True) == LINE or {one[-1] for one in said.axes} == {axis}
        if {*said.across} == {*"XYZ"} - {axis} and named and not said.odd:
            place = f"along {axis} from {_text(np.array([(said.across | {axis: 0.0})[one] for one in 'XYZ']))}"
            found[_in_mm(place, mm)] = text
    return found.popitem() if len(found) == 1 else None


def _in_mm(place: str, mm: float) -> str:
    return (
        place if mm == 1 else re.sub(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?", lambda one: f"{float(one[0]) * mm:.10g}", place)
    )


def proposed(place: str) -> tuple[str, str]:
    """A place as far as a file says it, and an example of one.

    Examples
    --------
    >>> proposed("along Y from ?,?,?"), proposed("along X from ?,800,400")[0]
    (('', 'along Y from 100,200,300'), 'along X from ?,800,400')
    """
    return place if re.search(r"\d", place) else "", place.replace("?,?,?", "100,200,300") or "along X from 100,200,300"
