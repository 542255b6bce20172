"""Where lines lie, by what a file says of them: start and end, or a start and an axis; what it leaves open is ``?``.

A text says a place by three figures in brackets, behind the letters X, Y, Z, or after a word for a start or an end. Which of
two places is the start words say, else their order; a place alone that no word calls a start may be the middle of a line.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from functools import cache, lru_cache

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass, field
from cmm_uq.jobs.importing.header import plain_words, unspaced, words_of

START, END, DIRECTION, CENTRE, TOWARDS = "start", "end", "direction", "centre", "towards"
ANGLES = ("azimuth", "elevation")
_BEHIND = {"から": START, "より": START, "에서": START, "부터": START, "まで": END, "까지": END}  # figures
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
_PLUS_LENGTH = re.compile(rf"{_TO}([XYZ])\s*=\s*{_PLAIN}\s*\+\s*L\b")  # as ``from X=150 to X=150+L``
_BARE = re.compile(
    rf"(?<![\w.,+-])({_PLAIN})" + rf"(?:\s*[;/|]\s*|,\s+|,(?=[+-]?\d)|\s+)({_PLAIN})" * 2 + r"(?![.,]?\d)"
)
_NAMED = (
    re.compile(rf"\bi\s*[=:]\s*({_PLAIN})\W{{1,3}}j\s*[=:]\s*({_PLAIN})\W{{1,3}}k\s*[=:]\s*({_PLAIN})", re.I),
    re.compile(rf"\bX({_PLAIN})[ ,;/]{{1,3}}Y({_PLAIN})[ ,;/]{{1,3}}Z({_PLAIN})(?!\w)"),
)
_GLUED = re.compile(rf"(?<![\w.,-])([XYZ])({_PLAIN})[ ,;/]{{1,3}}([XYZ])({_PLAIN})(?!\w|[.,]?\d| ?[XYZ]\d)")
_ALL_AXES = re.compile(r"(?:X\W{0,3}Y\W{0,3}Z|\bI\W{1,3}J\W{1,3}K)\W{0,3}(?:\([^)\d]*\))?\W{0,5}$", re.I)
_AXIS = re.compile(r"(?<![A-Za-zÀ-ɏ])([+-]?)([XYZ]+)(?![A-Za-zÀ-ɏ\d]|\s*[=:]?\s*[+-]?\d)")
_ARROW = re.compile(r"(?:→|->|=>|~|–|—|\.\.)\s*$")
_FAR, _FAR_UNSAID = 3.0, 1.5  # of the longest length: farther are no ends of it, said to be so or not
_ROUNDED = 0.002  # of a length, which its place may be shorter by
_VECTOR = 2.0  # larger figures are none of a direction
_LAST = 3  # words that may lead to a place
_NEAR_WORD = 20  # characters between a word and its figures
Point = dict[str, float]
Coordinates = tuple[int, int, Point, Point | None]
"""Span in a text and coordinates by axis; behind letters with those that they run to, else of a place."""


@dataclass
class Said:
    """What texts say: coordinates of start, end and middle, others, places of which nobody says which, axes, a direction."""

    start: Point = field(default_factory=dict)
    end: Point = field(default_factory=dict)
    centre: Point = field(default_factory=dict)
    towards: Point = field(default_factory=dict)  # an end that says its direction alone
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
        centred = self.centre if self.way or self.axes else {}
        return any(len(one) == 3 for one in (self.start, self.end, self.towards, centred)) or len(self.loose) > 1


def role_of(text: str, *, after: bool = False) -> str:
    """What words ahead of figures say of them; of those with two letters the last, or ``after`` other figures the first."""
    words = plain_words(text)
    label = len(words) > 1 and re.search(r"(?<!\w)[A-Z]\W*$", text)  # as of ``ball A``
    least = {len(words) - (2 if label else 1), *([0] if after else [])}
    found = [(k, _role(word)) for k, word in enumerate(words) if len(word) > 2 or not word.isascii() or k in least][
        ::-1
    ]
    # words after one for a direction are of something else
    found = [(k, role) for k, role in found if role != DIRECTION or all(map(_short, words[k + 1 :]))]
    return next((role for _, role in found if role), "")


def _short(word: str) -> bool:
    return len(word) < len("with") and word.isascii()


def role_among(text: str) -> str:
    """What a head says of the figures below it; of two letters its first word."""
    words = plain_words(text)
    own = [word for k, word in enumerate(words) if len(word) > 2 or not word.isascii() or (k == 0 and len(word) > 1)]
    roles = [*filter(None, map(_role, own))] or [*filter(None, map(_begun, own))]
    return DIRECTION if {*roles} == {END, DIRECTION} else next(iter(roles), "")  # as towards the end


def _begun(word: str) -> str:
    """What a word without blanks begins with, as ``始点座標``."""
    for of, those in words_of("places").items() if unspaced(word[:1]) else ():
        if any(word.startswith(one) and len(one) > 1 and unspaced(one) for one in those):
            return of
    return ""


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
    roles = (word for word in words if role_of(word[0]))
    role = next((word for word in roles if len(word[0]) > 2 or not word[0].isascii() or word is words[-1]), None)
    return (ahead if role is None else ahead[: role.start()]).rstrip(" \t:;,([-–—=")


def said_in(texts: Iterable[str], sign: str = ".") -> Said:
    """What texts say of the place of one line."""
    said, texts = Said(), [*dict.fromkeys(texts)]
    planes = frozenset[str]().union(*map(_planes, texts))
    for text in texts:
        plain = unicodedata.normalize("NFKC", text).replace("−", "-")
        said.axes |= {f"+{one[1]}" for one in _PLUS_LENGTH.finditer(plain)}
        plain = _first().sub(START, _PLUS_LENGTH.sub("", plain), count=1)
        last, before = 0, False
        for start, end, values, to in _figures(plain, sign, planes):
            gap, place = plain[last:start], to is None or len(values) == 3
            role = role_of(re.split(r"\d", gap)[-1], after=before) or (END if before and _ARROW.search(gap) else "")
            behind = plain[end : end + 5].lstrip(" m")
            role = next((of for word, of in _BEHIND.items() if behind.startswith(word)), role)
            role = DIRECTION if plain[start] in "iI" else "" if role in ANGLES else role
            if role == DIRECTION and len(values) == 3 and max(map(abs, values.values())) <= _VECTOR:
                said.take(said.way, values)
            elif role == START or to:
                said.take(said.start, values)
            elif role == TOWARDS and place:
                said.take(said.towards, values)
            elif role == CENTRE and place and said.centre in ({}, values):
                said.centre = values
            elif role == CENTRE and place:  # of the balls at both ends
                said.loose, said.centre = [*said.loose, *([said.centre] if said.centre else []), values], {}
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


@cache
def _first() -> re.Pattern[str]:
    """The first face, ball or hole of an artefact, by its number."""
    called = "|".join(map(re.escape, sorted(words_of("columns")["point"], key=len, reverse=True)))
    place = r"\W{0,3}(?:\w{2,6}\W{1,3})?(?:[XYZ]\s?[=:]|[(\[])"  # and no figures of a table, whose row names one
    return re.compile(rf"(?<!\w)(?:{called})\s?(?:no|nr|n|#)?\W?\s?[01](?={place})", re.I)


def _planes(text: str) -> set[str]:
    return {"".join(sorted(letters)) for _, letters in _AXIS.findall(text) if len(letters) == 2}


@lru_cache(maxsize=4096)
def _figures(text: str, sign: str, planes: frozenset[str] = frozenset()) -> list[Coordinates]:
    """Coordinates in a text: three in brackets, behind the letters of all axes or behind a word; each behind its letter."""
    found: list[Coordinates] = []
    planes = planes or frozenset(_planes(text))
    for match in (match for pattern in _NAMED for match in pattern.finditer(text)):
        own = {axis: _value(one, sign) or 0.0 for axis, one in zip("XYZ", match.groups(), strict=True)}
        found.append((match.start(), match.end(), own, None))
    for match in _GLUED.finditer(text):
        own = {match[k]: _value(match[k + 1], sign) or 0.0 for k in (1, 3)}
        if len(own) > 1 and not any(a < match.end() and match.start() < b for a, b, *_ in found):
            found.append((match.start(), match.end(), own, None))
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


def full_place(point: Point, *others: Point) -> Floats | None:
    """A place, with coordinates of others where it has none; ``None`` where one is not there."""
    own = {axis: value for one in reversed((point, *others)) for axis, value in one.items()}
    return np.array([own[axis] for axis in "XYZ"]) if len(own) == 3 else None


def _ends_of(one: Said, least: float) -> tuple[Point, Point, Point]:
    """Start and end, of places that no word calls either too, and the direction to a place that is nearer than ``least``."""
    start, end = one.start, one.end or one.towards
    if len(one.loose) == 2 and not start and not end:
        start, end = one.loose
    elif len(one.loose) == 1 and bool(start) != bool(end):
        start, end = (start, one.loose[0]) if start else (one.loose[0], end)
    way = {axis: one.towards[axis] - value for axis, value in start.items() if axis in one.towards}
    near = len(way) == len("XYZ") and np.linalg.norm([*way.values()]) < least
    return start, {} if near else end, way if near else {}


def place_of_line(
    said: Sequence[Said], longest: float, near: float, others: Sequence[Floats] = (), *, alone: bool = False
) -> str:
    """Where a line lies, in the unit of the texts, as ``LINE_PLACE`` has it; with ``?`` for what is open, empty where all is.

    said : of each of its rows; longest : of its lengths; near : by what places are rounded; others : starts of other lines;
    alone : whether it has one length, which lies about its middle.
    """
    axes = set[str]().union(*(one.axes for one in said))
    letters = {axis[-1] for axis in axes}
    axis = letters.pop() if len(letters) == 1 else ""
    whole, starts, ends, said_so = Said(), list[Floats](), list[Floats](), True
    for one in said:
        start, end, way = _ends_of(one, longest * (1 - _ROUNDED) - near)
        said_so &= not (len(one.loose) == 2 and not one.start and not one.end)
        count = len(one.loose) + bool(one.start) + bool(one.end or one.towards)
        whole.odd |= one.odd or (bool(one.loose) and count != 2)
        whole.take(whole.way, way)
        each = ((whole.across, one.across), (whole.way, one.way), (whole.start, start), (whole.centre, one.centre))
        for into, values in each:
            whole.take(into, values)
        starts += [own for own in (full_place(start, one.across),) if own is not None]
        ends += [own for own in (full_place(end, one.across, start),) if end and own is not None]
    if whole.odd:
        return ""
    vector = np.array([whole.way.get(one, float(one == axis)) for one in "XYZ"])
    if not starts and len(whole.centre) == 3 and alone and vector.any():
        ends = [full_place(whole.centre) + longest * half * vector / np.linalg.norm(vector) for half in (-0.5, 0.5)]
        return f"from {place_text(ends[0])} to {place_text(ends[1])}"
    if starts and (ends or whole.way):
        lengths = (longest * (1 - _ROUNDED) - near, longest, longest * (_FAR if said_so else _FAR_UNSAID))
        return _from_to(starts[0], ends, whole.way, axis, lengths, near)
    if starts and axis:
        i = "XYZ".index(axis)
        sense = _sense(axes, starts[0][i], longest, [one[i] for one in others])
        return f"along {sense.removeprefix('+')}{axis} from {place_text(starts[0])}" if sense else ""
    known = whole.across | whole.start
    at = ",".join(f"{known[one]:.10g}" if one in known else "?" for one in "XYZ")
    return f"along {axis} from {at}" if axis else ""


def _from_to(
    start: Floats, ends: Sequence[Floats], way: Point, axis: str, lengths: Sequence[float], near: float
) -> str:
    """A line from its start to the farthest of its ends, which lie in one direction and as far as its lengths need."""
    if way:
        vector = np.array([way[one] for one in "XYZ"])
        ends = [start + lengths[1] * vector / max(float(np.linalg.norm(vector)), 1e-9)]
    far = max(ends, key=lambda end: float(np.linalg.norm(end - start)))
    reach = float(np.linalg.norm(far - start))
    off = [float(np.linalg.norm(np.cross(far - start, end - start))) / max(reach, 1e-9) for end in ends]
    off += [reach - abs(float((far - start)["XYZ".index(axis)]))] if axis else []
    fits = max(off) <= near and lengths[0] <= reach <= lengths[2]
    return f"from {place_text(start)} to {place_text(far)}" if fits else ""


def _sense(axes: set[str], start: float, longest: float, others: Sequence[float]) -> str:
    """Which way a line goes from its start: as a sign says, else towards where other lines lie."""
    if signs := {one[0] for one in axes if len(one) > 1}:
        return signs.pop() if len(signs) == 1 else ""
    up, down = (sum(a <= one <= a + longest for one in others if one != start) for a in (start, start - longest))
    return "+" if up > down or (up == down == 0 and 0 <= start < longest) else ""


def place_text(point: Floats) -> str:
    return ",".join(f"{one:.10g}" for one in point)


def says_figures(text: str) -> bool:
    """Whether a text has coordinates."""
    return any(_figures(unicodedata.normalize("NFKC", one), ".") for one in text.split("\n"))
