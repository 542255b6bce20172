"""Labels of pictures: how wide they are, how they are shortened, and which of very many are drawn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cmm_uq.base.languages.translation import Translation
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import Floats, Ints
from cmm_uq.certificate.plots.style import SMALL, lettered, measuring_fonts

if TYPE_CHECKING:
    from matplotlib.path import Path

_MM = 25.4 / 72  # of a point


def width_mm(text: str, size: float, weight: str = "normal") -> float:
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    font = FontProperties(family=measuring_fonts(), weight=weight)
    return _MM * max(farthest_right(TextPath((0, 0), str.__str__(text), size=size, prop=font)), size)


def farthest_right(path: Path) -> float:
    """Largest x of a path of lines and quadratic curves, in the steps of its ``get_extents`` but for all curves at once."""
    x, codes = np.asarray(path.vertices)[:, 0], np.asarray(path.codes)
    controls = np.flatnonzero(codes == path.CURVE3)[::2]
    begin, control, end = x[controls - 1], x[controls], x[controls + 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (begin - control) / (begin - 2 * control + end)
    t = np.where((t > 0) & (t < 1), t, 0.0)
    turns = (1 - t) ** 2 * begin + 2 * t * (1 - t) * control + t**2 * end
    corners = x[np.isin(codes, (path.MOVETO, path.LINETO))]
    return float(max(part.max(initial=-np.inf) for part in (corners, turns, end)))


NAMES_MM = 54.0  # room of the names beside the bars of a budget


def narrowed(text: Text, room_mm: float) -> Text:
    """A name as it is lettered, cut to the room that it has."""
    said = lettered(text)
    whole = str.__str__(said)
    kept = whole if width_mm(whole, SMALL) <= room_mm else _longest(whole, room_mm)
    if kept == text:
        return text
    return Verbatim(kept) if said is text else Translation(kept, text)


def folded(text: Text, room_mm: float, size: float = SMALL, weight: str = "normal") -> list[Text]:
    """A name as it is lettered, in two texts where one line lacks room: lines of one text would not align in other fonts."""
    whole = str.__str__(lettered(text))
    if width_mm(whole, size, weight) <= room_mm:
        return [text]
    blanks = [i for i, letter in enumerate(whole) if letter == " "]
    ends = [i for i in blanks or range(1, len(whole)) if width_mm(whole[:i], size, weight) <= room_mm]
    if not ends:
        return [narrowed(text, room_mm)]
    rest = whole[ends[-1] :].strip()
    kept = rest if width_mm(rest, size, weight) <= room_mm else _longest(rest, room_mm * SMALL / size)
    return [Translation(line, text) for line in (whole[: ends[-1]], kept)]


def told_apart(names: Sequence[Text], room_mm: float) -> list[Text]:
    """Names cut to their room; where the beginnings of two are the same, each with its end in place of its beginning."""
    short = [narrowed(name, room_mm) for name in names]
    again = list(map(str, short))
    return [
        _ending(name, room_mm) if again.count(text) > 1 and text != str(name) else beginning
        for name, beginning, text in zip(names, short, again, strict=True)
    ]


def _ending(text: Text, room_mm: float) -> Text:
    """The longest end of a text that has room, with what says that it began before."""
    whole = str.__str__(lettered(text))
    ends = ("…" + whole[i:].lstrip(" ,") for i in range(1, len(whole)))
    return Verbatim(next(end for end in ends if width_mm(end, SMALL) <= room_mm))


def _longest(text: str, room_mm: float) -> str:
    """The longest beginning of a text that has room, with what says that it goes on."""

    def beginning(count: int) -> str:
        return text[:count].rstrip(" ,") + "…"

    fits, too_long, trial = 0, len(text), len(text) // 2
    while too_long - fits > 1:
        width = width_mm(beginning(trial), SMALL)
        fits, too_long = (trial, too_long) if width <= room_mm else (fits, trial)
        trial = min(max(round(trial * room_mm / width), fits + 1), too_long - 1)
    return beginning(fits)


MOST = 1500  # marks of one series: more would run into each other, and a page with them would take a browser seconds
_LARGEST = 300


def shown(sizes: Sequence[Floats], flagged: NDArray[np.bool_] | None = None, most: int = MOST) -> Ints:
    """Rows to draw, ascending: of more than ``most`` those flagged, the largest of each size (n,), and some others."""
    count = len(sizes[0])
    if count <= most:
        return np.arange(count)
    largest = min(_LARGEST, most // 2)
    each = largest // len(sizes)
    first = [np.argsort(-np.abs(size), kind="stable")[:each] for size in sizes]
    marked = np.flatnonzero(flagged)[:largest] if flagged is not None else np.zeros(0, dtype=np.int64)
    chosen = np.unique(np.concatenate([*first, marked]))
    rest = np.setdiff1d(np.arange(count), chosen, assume_unique=True)
    evenly = np.linspace(0, len(rest) - 1, most - len(chosen)).astype(np.int64)
    return np.sort(np.concatenate([chosen, rest[evenly]]))


def told(caption: Text, drawn: int, count: int) -> Text:
    """A caption that says how many of all are drawn, where it is not all."""
    if drawn == count:
        return caption
    return say(
        "{caption} Drawn are {drawn} of {count}: the largest, and some of the others from all over the recording.",
        caption=caption, drawn=drawn, count=count,
    )  # fmt: skip
