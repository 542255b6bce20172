"""The language of what is lettered in pictures: it is chosen before a document is composed, since a picture is drawn once.

The texts of a document are said in a language when all is composed (``in_language``); a picture's are part
of it by then, with the room that they need.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

from cmm_uq.base.languages.language import ENGLISH, LANGUAGES, Code
from cmm_uq.base.languages.saying import Said, said_in
from cmm_uq.base.messages import Text, Verbatim
from cmm_uq.certificate.fonts import JAPANESE, japanese_font

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.ticker import Formatter

_LANGUAGE: ContextVar[Code] = ContextVar("language of pictures", default=ENGLISH)


@contextmanager
def lettered_in(language: Code) -> Iterator[None]:
    """Pictures that are drawn meanwhile are lettered in a language."""
    before = _LANGUAGE.set(language)
    try:
        yield
    finally:
        _LANGUAGE.reset(before)


def lettered(text: Text) -> Text:
    """A text as it will stand in the picture, for what goes by its length."""
    return said_in(text, _LANGUAGE.get())


def measuring_fonts() -> list[str]:
    """Families that the room of a text is measured with.

    Raises
    ------
    CmmUqError : the language needs a font that is not installed.
    """
    return ["DejaVu Sans", _known_to_matplotlib()] if _LANGUAGE.get() == "ja" else ["DejaVu Sans"]


@cache
def _known_to_matplotlib() -> str:
    from matplotlib.font_manager import fontManager

    fontManager.addfont(japanese_font())
    fontManager.ttflist.append(
        replace(fontManager.ttflist[-1], weight=700)
    )  # its one weight serves bold lettering, too
    return JAPANESE


def letter(figure: Figure) -> None:
    """Say every text of a figure in the language of pictures, figures of its ticks too."""
    from matplotlib.text import Text as Lettering

    code = _LANGUAGE.get()
    if code == ENGLISH:
        return
    tickers = {id(axis.major): axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)}
    for axis in tickers.values():  # panels may share theirs
        axis.set_major_formatter(_localised()(axis.get_major_formatter(), code))
    for found in figure.findobj(Lettering):
        found.set_text(_said(found.get_text(), code))


def _said(text: str, code: Code) -> Text:
    """A message in the language; a plain string in a picture is a figure (a test holds pictures to that)."""
    if isinstance(text, Text):
        return said_in(text, code)
    return Said(LANGUAGES[code].number(text), Verbatim(text))


@cache
def _localised() -> Callable[[Formatter, Code], Formatter]:
    """The class of what says the texts of ticks, made when matplotlib is needed."""
    from matplotlib.ticker import Formatter

    class Localised(Formatter):
        """Texts of another formatter, in a language."""

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
