"""Names folded or cut to the room that a picture has for them; they stand whole in a table."""

from __future__ import annotations

from collections.abc import Sequence

from cmm_uq.base.languages.saying import Said
from cmm_uq.base.messages import Text, Verbatim
from cmm_uq.certificate.lettering import lettered
from cmm_uq.certificate.measured import width_mm
from cmm_uq.certificate.plot_style import SMALL

NAMES_MM = 54.0
"""Room of the names beside the bars of a budget."""


def narrowed(text: Text, room_mm: float) -> Text:
    """A name as it is lettered, cut to the room that it has."""
    said = lettered(text)
    whole = str.__str__(said)
    kept = whole if width_mm(whole, SMALL) <= room_mm else _longest(whole, room_mm)
    if kept == text:
        return text
    return Verbatim(kept) if said is text else Said(kept, text)


def folded(text: Text, room_mm: float, size: float = SMALL, weight: str = "normal") -> list[Text]:
    """A name as it is lettered, in two lines where one has no room for it, the first as long as it goes; the second is cut.

    They are for texts of their own: the ends of several lines of one would not stand below each other in other fonts.
    """
    whole = str.__str__(lettered(text))
    if width_mm(whole, size, weight) <= room_mm:
        return [text]
    blanks = [i for i, letter in enumerate(whole) if letter == " "]
    ends = [i for i in blanks or range(1, len(whole)) if width_mm(whole[:i], size, weight) <= room_mm]
    if not ends:
        return [narrowed(text, room_mm)]
    rest = whole[ends[-1] :].strip()
    kept = rest if width_mm(rest, size, weight) <= room_mm else _longest(rest, room_mm * SMALL / size)
    return [Said(line, text) for line in (whole[: ends[-1]], kept)]


def told_apart(names: Sequence[Text], room_mm: float) -> list[Text]:
    """Names cut to their room; where the beginnings of two are the same, each with its end in place of its beginning."""
    found = [narrowed(name, room_mm) for name in names]
    again = [str(one) for one in found]
    return [
        _ending(name, room_mm) if again.count(str(one)) > 1 and str(one) != str(name) else one
        for name, one in zip(names, found, strict=True)
    ]


def _ending(text: Text, room_mm: float) -> Text:
    """The longest end of a text that has room, with what says that it began before."""
    whole = str.__str__(lettered(text))
    start = next(i for i in range(1, len(whole)) if width_mm("…" + whole[i:].lstrip(" ,"), SMALL) <= room_mm)
    return Verbatim("…" + whole[start:].lstrip(" ,"))


def _longest(text: str, room_mm: float) -> str:
    """The longest beginning of a text that has room, with what says that it goes on."""
    fits, too_long, trial = 0, len(text), len(text) // 2
    while too_long - fits > 1:
        width = width_mm(_going_on(text, trial), SMALL)
        fits, too_long = (trial, too_long) if width <= room_mm else (fits, trial)
        trial = min(max(round(trial * room_mm / width), fits + 1), too_long - 1)
    return _going_on(text, fits)


def _going_on(text: str, count: int) -> str:
    return text[:count].rstrip(" ,") + "…"
