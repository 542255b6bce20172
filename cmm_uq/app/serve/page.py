"""A page as data: what it says, before anyone decides what it looks like; and the records' words as a reader sees them.

A page as data: what it says, before anyone decides what it looks like.

As a document's, a page's blocks are small frozen classes with texts already rounded and worded; one template
(``templates/serve/page.html``) shows every page, and has no words of its own. An address is a path of this site with its
query, already quoted.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import ClassVar, Literal
from urllib.parse import urlencode

from cmm_uq.base.messages import DASH, NOTHING, Day, Text, Verbatim, day, say
from cmm_uq.certificate.document import Standing


def address(path: str, **query: object) -> str:
    """A path with its query; what is ``None`` or empty is left out.

    >>> address("/machine", serial="A/7 <b>", page=None) '/machine?serial=A%2F7+%3Cb%3E'
    """
    given = {name.rstrip("_"): value for name, value in query.items() if value not in (None, "")}
    return f"{path}?{urlencode(given)}" if given else path


@dataclass(frozen=True)
class Cell:
    """A text in a table or a list of facts.

    ``address``: where it leads, if anywhere; ``standing``: how it is to be taken: shown by a sign and a colour beside
    the words; ``download``: whether the address gives a file to keep rather than to look at.
    """

    text: Text
    address: str = ""
    standing: Standing | None = None
    note: Text = NOTHING
    download: bool = False


@dataclass(frozen=True)
class PageColumn:
    """Heading of a column; figures stand to the right under each other, a date is never broken."""

    heading: Text
    sort: Literal["text", "number", "day"] = "text"


def columns(*headings: Text | tuple[Text, Literal["number", "day"]]) -> tuple[PageColumn, ...]:
    """Headings of texts, or of figures or days where they are named so."""
    return tuple(PageColumn(*one) if isinstance(one, tuple) else PageColumn(one) for one in headings)


@dataclass(frozen=True)
class PageTable:
    """Rows under headings; the first cell names its row. Where there is no row, ``empty`` says so.

    A caption that would only say the title of its section again is for those who hear the page (``heard``).
    """

    caption: Text
    columns: tuple[PageColumn, ...]
    rows: tuple[tuple[Cell, ...], ...]
    empty: Text = NOTHING
    notes: tuple[Text, ...] = ()
    heard: bool = False
    kind: ClassVar[str] = "table"


@dataclass(frozen=True)
class PageFacts:
    """Labels and values; in one column where values are long (``wide``)."""

    rows: tuple[tuple[Text, Cell], ...]
    wide: bool = False
    kind: ClassVar[str] = "facts"


@dataclass(frozen=True)
class Count:
    """How many of something there are, and where they are listed."""

    count: int
    what: Text
    address: str
    standing: Standing | None = None
    chosen: bool = False


@dataclass(frozen=True)
class Tally:
    """Counts side by side: what a reader with five seconds sees."""

    title: Text
    counts: tuple[Count, ...]
    kind: ClassVar[str] = "tally"


@dataclass(frozen=True)
class PageNotice:
    """A verdict, or what must not be overlooked, with what belongs to it."""

    head: Text
    standing: Standing
    lines: tuple[Cell, ...] = ()
    kind: ClassVar[str] = "notice"


@dataclass(frozen=True)
class PageParagraph:
    """Running text; a note is set smaller."""

    text: Text
    tone: Literal["plain", "note"] = "plain"
    kind: ClassVar[str] = "paragraph"


@dataclass(frozen=True)
class FormField:
    """A field of a form: a line of text, a date, or one of several options ``(value, text)``."""

    name: str
    label: Text
    value: str = ""
    options: tuple[tuple[str, Text], ...] = ()
    sort: Literal["search", "date", "select"] = "search"


@dataclass(frozen=True)
class Chooser:
    """A form that narrows a list; ``kept`` is what else of the query stays as it is."""

    title: Text
    path: str
    fields: tuple[FormField, ...]
    button: Text
    clear: Cell | None = None
    kept: tuple[tuple[str, str], ...] = ()
    kind: ClassVar[str] = "chooser"


@dataclass(frozen=True)
class Pager:
    """Where in a long list the reader is; addresses of its neighbours, empty where there are none."""

    title: Text
    told: Text
    before: Cell | None = None
    after: Cell | None = None
    kind: ClassVar[str] = "pager"


@dataclass(frozen=True)
class Chart:
    """A picture with the sentence that replaces it for whoever cannot see it."""

    title: Text
    told: Text
    svg: str
    alternative: Text
    standing: Standing | None = None


@dataclass(frozen=True)
class Charts:
    """Pictures side by side."""

    charts: tuple[Chart, ...]
    notes: tuple[Text, ...] = ()
    kind: ClassVar[str] = "charts"


@dataclass(frozen=True)
class Drop:
    """The form that takes a file, dropped or chosen."""

    path: str
    label: Text
    hint: Text
    button: Text
    kind: ClassVar[str] = "drop"


@dataclass(frozen=True)
class Links:
    """Where to go from here."""

    cells: tuple[Cell, ...]
    kind: ClassVar[str] = "links"


@dataclass(frozen=True)
class Press:
    """A form with nothing but a button."""

    path: str
    button: Text
    kind: ClassVar[str] = "press"


Block = PageTable | PageFacts | Tally | PageNotice | PageParagraph | Chooser | Pager | Charts | Drop | Links | Press


@dataclass(frozen=True)
class PageSection:
    """A titled part of a page."""

    title: Text
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class WebPage:
    """What a reader gets.

    ``place``: path of the entry of the contents that it belongs to; ``lead``: one line below the title; ``above``:
    the pages that it stands below.
    """

    title: Text
    place: str
    lead: Text = NOTHING
    blocks: tuple[Block, ...] = ()
    sections: tuple[PageSection, ...] = ()
    above: tuple[Cell, ...] = ()
    status: HTTPStatus = field(default=HTTPStatus.OK, compare=False)


Word = tuple[Text, Standing | None]

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
    "consistent": (say("Consistent"), "good"), "explained": (say("Explained"), "open"),
    "partial": (say("Partly explained"), "open"), "unexplained": (say("Unexplained"), "bad"),
}  # fmt: skip

ORIGINS: Mapping[str, Text] = {
    "measured": say("Measured"), "simulated": say("Simulated"), "compensated": say("Compensated"),
}  # fmt: skip

NOT_MEASURED: Mapping[str, Text] = {
    "simulated": say("Nothing was measured: the recording was simulated"),
    "compensated": say("The recording was corrected by an error map, not measured so"),
}
"""What must not be overlooked of a recording that was not measured."""


def cell_of(words: Mapping[str, Word], word: str, *, address: str = "") -> Cell:
    """A word of the records in a cell; one that is not known, as it stands."""
    if not word:
        return Cell(DASH)
    text, standing = words.get(word, (Verbatim(word), "open"))
    return Cell(text, address, standing)


def day_cell(date: dt.date | None, *, before: dt.date | None = None, note: Text = NOTHING) -> Cell:
    """A date; one that lies before another is marked."""
    if date is None:
        return Cell(DASH, note=note)
    return Cell(day(date), standing="bad" if before is not None and date < before else None, note=note)


def moment(at: dt.datetime) -> Text:
    """A moment to the minute."""
    return say("{moment} UTC", moment=Day(f"{at:%Y-%m-%d %H:%M}"))


def shown(text: str) -> Text:
    """A name of the records, or a dash where it is empty."""
    return Verbatim(text) if text else DASH
