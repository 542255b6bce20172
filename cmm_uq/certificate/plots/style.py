"""The looks and lettering of all pictures, black and white first: one accent colour, quiet axes, one path a series.

The language of what is lettered is chosen before a document is composed, since a picture is drawn once, with the room that
its texts need. Text stays text in the SVG, without a font of its own: the browser then sets it in the page's face and the
PDF in the document's. Room is measured with DejaVu Sans, which is wider than the faces that show it, so nothing runs into
its neighbour (a test looks at that in a browser).
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from dataclasses import replace
from functools import cache, lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.languages.translation import ENGLISH, LANGUAGES, Code, Translation, translated as said_in
from cmm_uq.base.messages import Text, Verbatim
from cmm_uq.base.points import Floats
from cmm_uq.certificate import look
from cmm_uq.certificate.document import Plot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.path import Path as Outline
    from matplotlib.ticker import Formatter

JAPANESE = "IPAexGothic"  # family that sets Japanese, under the IPA Font License 1.0, which allows it in documents.
_PACKAGE = "matplotlib_fontja"  # has it; the package is not imported, since that would change matplotlib's settings
_LANGUAGE: ContextVar[Code] = ContextVar("language of pictures", default=ENGLISH)
_KEPT: ContextVar[list[tuple[str, Figure]] | None] = ContextVar("figures kept", default=None)


def japanese_font() -> Path:
    spec = find_spec(_PACKAGE)
    for folder in (spec.submodule_search_locations or ()) if spec else ():
        file = Path(folder) / "fonts" / "ipaexg.ttf"
        if file.is_file():
            return file
    raise CmmUqError(
        f"a document in Japanese needs the font {JAPANESE}, which is not installed",
        fix="pip install 'cmm-uq[ja]', or ask for another language",
    )


def fonts_of(language: Code) -> list[Path]:
    return [japanese_font()] if language == "ja" else []


@contextmanager
def _within(variable: ContextVar[Any], value: Any) -> Iterator[Any]:
    before = variable.set(value)
    try:
        yield value
    finally:
        variable.reset(before)


def lettered_in(language: Code) -> AbstractContextManager[None]:
    return _within(_LANGUAGE, language)


def lettered(text: Text) -> Text:
    """A text as it will stand in the picture, for what goes by its length."""
    return said_in(text, _LANGUAGE.get())


def measuring_fonts() -> list[str]:
    """Families that the room of a text is measured with."""
    return ["DejaVu Sans", _known_to_matplotlib()] if _LANGUAGE.get() == "ja" else ["DejaVu Sans"]


@cache
def _known_to_matplotlib() -> str:
    from matplotlib.font_manager import fontManager

    fontManager.addfont(japanese_font())
    # its one weight serves bold lettering, too
    fontManager.ttflist.append(replace(fontManager.ttflist[-1], weight=700))
    return JAPANESE


def _said(text: str, code: Code) -> Text:
    """A message in the language; a plain string in a picture is a figure (a test holds pictures to that)."""
    if isinstance(text, Text):
        return said_in(text, code)
    return Translation(LANGUAGES[code].number(text), Verbatim(text))


@cache
def _localised() -> Callable[[Formatter, Code], Formatter]:
    """The class of what says the texts of ticks, made when matplotlib is needed."""
    from matplotlib.ticker import Formatter

    class Localised(Formatter):
        def __init__(self, own: Formatter, code: Code) -> None:
            self.own, self.code = own, code

        def __call__(self, x: float, pos: int | None = None) -> str:
            return _said(self.own(x, pos), self.code)

        def format_ticks(self, values: Any) -> list[str]:
            return [_said(text, self.code) for text in self.own.format_ticks(values)]

        def get_offset(self) -> str:
            return _said(self.own.get_offset(), self.code)

        def set_locs(self, locs: Any) -> None:
            self.own.set_locs(locs)

    return Localised


ACCENT, BAD, BAND = look.ACCENT, look.BAD, look.BAND
GOOD, INK, MUTED = look.GOOD, look.INK, look.MUTED
OPEN, RULE, TINT = look.OPEN, look.RULE, look.TINT
DIVERGING = ("#0b5c7a", "#3f86a0", "#86b1c2", "#c3ccd0", "#e0b48a", "#cc7f3c", "#a84e08")
"""Negative to positive, parted by blue and orange, which every common kind of colour vision tells apart."""

WIDTH_MM = 170.0  # width of the text on the page (A4 with margins of 20 mm)
SMALL, TINY = 7.5, 6.8  # sizes of lettering, pt

_TICKS = {"color": MUTED, "labelcolor": INK, "labelsize": SMALL, "major.width": 0.6, "major.size": 2.5}
_SETTINGS = {
    "svg.fonttype": "none", "svg.hashsalt": "cmm_uq",
    "path.simplify": False,
    "text.parse_math": False,  # a dollar sign in a customer's column name is a dollar sign
    "font.size": SMALL, "text.color": INK,
    "axes.unicode_minus": True, "axes.edgecolor": MUTED, "axes.labelcolor": INK, "axes.labelsize": SMALL, "axes.labelpad": 4.0,
    "axes.linewidth": 0.6, "axes.spines.top": False, "axes.spines.right": False, "axes.axisbelow": True,
    "axes.titley": 1.0,  # or matplotlib looks through all ticks for one that a title could touch; none is above
    "grid.color": "#e6eaec", "grid.linewidth": 0.5,
    "legend.frameon": False, "legend.fontsize": SMALL,
    **{f"{axis}tick.{key}": value for axis in "xy" for key, value in _TICKS.items()},
}  # fmt: skip


@contextmanager
def house_style() -> Iterator[None]:
    """Settings under which a figure is built and written; the viewer's font draws what the measuring font lacks."""
    import matplotlib as mpl

    with mpl.rc_context({**_SETTINGS, "font.family": measuring_fonts()}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        yield


def new_figure(height_mm: float) -> Figure:
    """An empty figure as wide as the page's text; never pyplot, so nothing global is left behind."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH_MM / 25.4, height_mm / 25.4), facecolor="none")
    FigureCanvasSVG(figure)
    return figure


@contextmanager
def pictures(
    height_mm: float, rows: int, columns: int = 1, height_ratios: Sequence[float] | None = None, **layout: Any
) -> Iterator[tuple[Figure, list[Axes]]]:
    """A figure in the house style with panels that share their axes; edges and gaps of ``layout`` are parts of it."""
    with house_style():
        figure = new_figure(height_mm)
        axes = figure.subplots(rows, columns, sharex=True, sharey=rows == 1, squeeze=False, height_ratios=height_ratios)
        figure.subplots_adjust(**layout)
        yield figure, list(axes.ravel())


@contextmanager
def picture(height_mm: float, **layout: Any) -> Iterator[tuple[Figure, Axes]]:
    with pictures(height_mm, 1, **layout) as (figure, axes):
        yield figure, axes[0]


_NUMBER = re.compile(r"-?\d+\.\d+(?:e-?\d+)?")
_COORDINATES = re.compile(r'(?<= )(?:x|y|points|transform)="[^"]*"')
_UNWANTED = re.compile(r'font-family: [^;"]*;? ?| transform="rotate\(-0 [^"]*"| xmlns:xlink="[^"]*"| version="1.1"')
_TAG = re.compile(r"<[^>]*>")
_ALONE = re.compile(r"M (\S+) (\S+)(?: L \1 \2| M \1 \2)+ ?")
"""Dots in one place: a path without extent, which some viewers of PDF leave out."""


def _shorter(value: float) -> str:
    text = f"{value:.2f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _shortened(text: str) -> str:
    return _NUMBER.sub(lambda number: _shorter(float(number[0])), text)


class _Words(dict[str, str]):
    """Words of paths, shortened where they are numbers: that of a dot has each of them twice, that of a ring four times."""

    def __missing__(self, word: str) -> str:
        self[word] = _shortened(word)
        return self[word]

    def path(self, data: str) -> str:
        words = " ".join(map(self.__getitem__, data.split()))
        alone = _ALONE.fullmatch(words)
        return f"M {alone[1]} {alone[2]} L {_shorter(float(alone[1]) + 0.01)} {alone[2]}" if alone else words


def as_svg(figure: Figure) -> str:
    """The figure as one ``<svg>`` element: no prolog, no date, no unused ids, coordinates to 0.01 pt.

    The same figure gives the same bytes on every run. The ids that stay (of clip paths and markers) are made unique
    when several pictures share a page, see :mod:`cmm_uq.certificate.render`.
    """
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata=dict.fromkeys(("Creator", "Date", "Format", "Type")))
    svg = buffer.getvalue()
    svg = re.sub(r"<style.*?</style>", "", svg[svg.index("<svg") :], count=1, flags=re.DOTALL)
    used, words = set(re.findall(r'(?:url\(|href=")#([^)"]+)', svg)), _Words()

    def clean(found: re.Match[str]) -> str:
        before, path, after = found[0].partition(' d="')
        data, _, after = after.partition('"')
        return f'{plain(before)} d="{words.path(data)}"{plain(after)}' if path else plain(before)

    def plain(tag: str) -> str:
        tag = _UNWANTED.sub("", tag).replace("xlink:href", "href")
        tag = re.sub(r' id="([^"]*)"', lambda name: name[0] if name[1] in used else "", tag)
        tag = _COORDINATES.sub(lambda values: _shortened(values[0]), tag)
        return re.sub(r"\s+", " ", tag).replace(' "', '"')

    svg = re.sub(r">\s+<", "><", _TAG.sub(clean, svg))
    while "<g></g>" in svg or "<defs></defs>" in svg:
        svg = svg.replace("<g></g>", "").replace("<defs></defs>", "")
    return svg.replace("<svg ", '<svg font-family="sans-serif" stroke-linejoin="round" ', 1).strip()


def figures_kept() -> AbstractContextManager[list[tuple[str, Figure]]]:
    """What is drawn within, by the names of its sort, besides as blocks of a document."""
    return _within(_KEPT, [])


def drawn(figure: Figure, caption: Text, alternative: Text, name: str) -> Plot:
    """The figure as a block of a document, with the texts that are lettered in it; ``name`` of its sort."""
    from matplotlib.text import Text as Lettering

    if (kept := _KEPT.get()) is not None:
        kept.append((name, figure))
    code = _LANGUAGE.get()
    if code != ENGLISH:  # every text, figures of ticks too
        tickers = {id(axis.major): axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)}
        for axis in tickers.values():  # panels may share theirs
            axis.set_major_formatter(_localised()(axis.get_major_formatter(), code))
        for found in figure.findobj(Lettering):
            found.set_text(_said(found.get_text(), code))
    svg = as_svg(figure)
    lettering = (found.get_text() for found in figure.findobj(Lettering))
    return Plot(caption, alternative, svg, tuple(text for text in lettering if isinstance(text, Text) and text))


def finite(name: str, values: ArrayLike, shape: tuple[int | None, ...]) -> Floats:
    """The values as floats of a shape (``None`` = any length), every one of them finite."""
    array = np.asarray(values, dtype=np.float64)
    fits = array.ndim == len(shape) and all(want in (None, got) for want, got in zip(shape, array.shape, strict=True))
    if not fits:
        raise CmmUqError(f"a plot needs {name} of shape {shape}, not {array.shape}")
    if not np.isfinite(array).all():
        raise CmmUqError(f"{name} holds a value that is not finite, so it cannot be plotted")
    return array


def strokes(ax: Axes, x0: Floats, x1: Floats, y0: Floats, y1: Floats, **style: Any) -> None:
    """Straight lines from (x0, y0) to (x1, y1), each (n,), as one path."""
    gaps = np.full(len(x0), np.nan)
    ax.plot(np.column_stack([x0, x1, gaps]).ravel(), np.column_stack([y0, y1, gaps]).ravel(), **style)


def dots(ax: Axes, x: Floats, y: Floats, size: float, colour: str, *, hollow: bool = False, zorder: float = 3) -> None:
    """Round marks of ``size`` pt: strokes of no length with round ends, which viewers of SVG and PDF alone draw as dots."""
    if _KEPT.get() is not None:
        ring = 0.25 * size if hollow else 0.0
        ax.plot(x, y, "o", ms=size - ring, mew=ring, mec=colour, mfc="white" if hollow else colour, zorder=zorder)
        return
    strokes(ax, x, x, y, y, lw=size, color=colour, solid_capstyle="round", zorder=zorder)
    if hollow:
        strokes(ax, x, x, y, y, lw=size * 0.5, color="white", solid_capstyle="round", zorder=zorder + 0.01)


def bars(ax: Axes, x: Floats, low: Floats, high: Floats, width: float, colour: str, zorder: float = 2) -> None:
    """Vertical bars from ``low`` to ``high`` of ``width`` pt."""
    strokes(ax, x, x, low, high, lw=width, color=colour, solid_capstyle="butt", zorder=zorder)


def crosses(ax: Axes, x: Floats, y: Floats, size: float, width: float) -> None:
    ax.plot(x, y, ls="", marker="x", ms=size, mec=DIVERGING[-1], mew=width, zorder=4)


def band(ax: Axes, x: Floats, y: Floats, half: Floats, colour: str = ACCENT, **style: Any) -> None:
    """What lies within ``half`` of a curve."""
    ax.fill(np.append(x, x[::-1]), np.append(y - half, (y + half)[::-1]), color=colour, lw=0, **style)


def named_rows(ax: Axes, rows: ArrayLike, names: Sequence[Text]) -> None:
    """Rows from above, each with its name beside it in place of an axis."""
    ax.set_yticks(rows, names)
    ax.invert_yaxis()
    ax.tick_params(left=False)
    ax.spines["left"].set_visible(False)


def panel_title(ax: Axes, text: Text, colour: str) -> None:
    ax.set_title(text, loc="left", fontsize=8, color=colour, fontweight="bold", pad=4)


def note(figure: Figure, text: Text, right: float = 0.985, top: float = 0.975) -> None:
    """What the marks are, small, at the upper right."""
    figure.text(right, top, text, ha="right", va="top", fontsize=TINY, color=MUTED)


_MM = 25.4 / 72  # of a point


def width_mm(text: str, size: float, weight: str = "normal") -> float:
    return _width_mm(str.__str__(text), size, weight, *measuring_fonts())


@lru_cache(maxsize=4096)
def _width_mm(text: str, size: float, weight: str, *families: str) -> float:
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    font = FontProperties(family=[*families], weight=weight)
    return _MM * max(farthest_right(TextPath((0, 0), text, size=size, prop=font)), size)


def farthest_right(path: Outline) -> float:
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
