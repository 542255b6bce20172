"""A page: its template with what it shows; cells and tables as data; the records' words as a reader sees them.

Templates lie in ``templates/serve``: what surrounds every page (``layout.html``), what pages are made of (``blocks.html``),
and one a page. Texts are rounded and worded; an address is a path of this site with its query, quoted.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from http import HTTPStatus
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias
from urllib.parse import urlencode

from cmm_uq.base.messages import DASH, NOTHING, Day, Text, Verbatim, day, say

if TYPE_CHECKING:
    from cmm_uq.certificate.document import Standing


def address(path: str, **query: object) -> str:
    """A path with its query; what is ``None`` or empty is left out.

    Examples
    --------
    >>> address("/machine", serial="A/7 <b>", page=None)
    '/machine?serial=A%2F7+%3Cb%3E'
    """
    stated = {name: value for name, value in query.items() if value not in (None, "")}
    return f"{path}?{urlencode(stated)}" if stated else path


class Cell(NamedTuple):
    """A text in a table or a list of facts, where it leads, and how it is to be taken: by a sign and a colour beside it."""

    text: Text
    address: str = ""
    standing: Standing | None = None
    note: Text = NOTHING
    download: bool = False  # whether the address gives a file to keep rather than to look at


class PageColumn(NamedTuple):
    """Heading of a column; figures stand to the right under each other, a date is never broken."""

    heading: Text
    sort: Literal["text", "number", "day"] = "text"


def columns(*headings: Text | tuple[Text, Literal["number", "day"]]) -> tuple[PageColumn, ...]:
    """Headings of texts, or of figures or days where they are named so."""
    return tuple(PageColumn(*one) if isinstance(one, tuple) else PageColumn(one) for one in headings)


class PageTable(NamedTuple):
    """Rows under headings; the first cell names its row. Where there is no row, ``empty`` says so.

    A caption that would only say the title of its section again is for those who hear the page (``heard``).
    """

    caption: Text
    columns: tuple[PageColumn, ...]
    rows: tuple[tuple[Cell, ...], ...]
    empty: Text = NOTHING
    notes: tuple[Text, ...] = ()
    heard: bool = False


class WebPage(NamedTuple):
    """What a reader gets: a template with its values, under an entry (``place``) of the contents."""

    template: str
    place: str
    values: Mapping[str, Any]
    status: HTTPStatus = HTTPStatus.OK
    headers: Mapping[str, str] = {}


def page(template: str, place: str, **values: Any) -> WebPage:
    return WebPage(template, place, values)


Word: TypeAlias = "tuple[Text, Standing | None]"

STATES: Mapping[str, Word] = {
    "draft": (say("Draft, not released"), "open"), "released": (say("Released"), "good"),
    "withdrawn": (say("Withdrawn"), "bad"), "replaced": (say("Replaced"), "bad"),
}  # fmt: skip

DECISIONS: Mapping[str, Word] = {
    "pass": (say("Pass"), "good"), "conditional pass": (say("Conditional pass"), "open"),
    "incomplete": (say("Incomplete"), "open"), "undecided": (say("Undecided"), "open"),
    "remeasure": (say("Remeasure"), "open"), "conditional fail": (say("Conditional fail"), "bad"),
    "fail": (say("Fail"), "bad"), "none": (say("None stated"), None),
}  # fmt: skip

VERDICTS: Mapping[str, Word] = {
    "consistent": (say("Consistent"), "good"), "undetermined": (say("Undetermined"), "open"),
    "explained": (say("Explained"), "open"), "partial": (say("Partly explained"), "open"),
    "empirical": (say("Modelled, not named"), "open"), "unexplained": (say("Unexplained"), "bad"),
}  # fmt: skip

ORIGINS: Mapping[str, Text] = {
    "measured": say("Measured"), "simulated": say("Simulated"), "compensated": say("Compensated"),
}  # fmt: skip

NOT_MEASURED: Mapping[str, Text] = {  # what must not be overlooked
    "simulated": say("Nothing was measured: the recording was simulated"),
    "compensated": say("The recording was corrected by an error map, not measured so"),
}


def cell_of(words: Mapping[str, Word], word: str) -> Cell:
    """A word of the records in a cell; one that is not known, as it stands."""
    if not word:
        return Cell(DASH)
    text, standing = words.get(word, (Verbatim(word), "open"))
    return Cell(text, standing=standing)


def day_cell(date: dt.date | None) -> Cell:
    return Cell(DASH if date is None else day(date))


def moment(at: dt.datetime) -> Text:
    return say("{moment} UTC", moment=Day(f"{at:%Y-%m-%d %H:%M}"))


def shown(text: str) -> Text:
    """A name of the records, or a dash where it is empty."""
    return Verbatim(text) if text else DASH
