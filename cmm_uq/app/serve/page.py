"""A page as data: what it says, before anyone decides what it looks like.

As a document's, a page's blocks are small frozen classes with texts already rounded and worded; one template
(``templates/serve/page.html``) shows every page, and has no words of its own. An address is a path of this site with its
query, already quoted.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from http import HTTPStatus
from typing import ClassVar, Literal
from urllib.parse import urlencode

from cmm_uq.base.messages import NOTHING, Text
from cmm_uq.certificate.document import Standing


def address(path: str, **query: object) -> str:
    """A path with its query; what is ``None`` or empty is left out.

    Examples
    --------
    >>> address("/machine", serial="A/7 <b>", page=None)
    '/machine?serial=A%2F7+%3Cb%3E'
    """
    given = {name.rstrip("_"): value for name, value in query.items() if value not in (None, "")}
    return f"{path}?{urlencode(given)}" if given else path


@dataclass(frozen=True)
class Cell:
    """A text in a table or a list of facts.

    Parameters
    ----------
    text : what it says.
    address : where it leads, if anywhere.
    standing : how it is to be taken: shown by a sign and a colour beside the words.
    note : smaller, below.
    download : whether the address gives a file to keep rather than to look at.
    """

    text: Text
    address: str = ""
    standing: Standing | None = None
    note: Text = NOTHING
    download: bool = False


@dataclass(frozen=True)
class Column:
    """Heading of a column; figures stand to the right under each other, a date is never broken."""

    heading: Text
    unit: Text = NOTHING
    sort: Literal["text", "number", "day"] = "text"


@dataclass(frozen=True)
class Table:
    """Rows under headings; the first cell names its row. Where there is no row, ``empty`` says so.

    A caption that would only say the title of its section again is for those who hear the page (``heard``).
    """

    caption: Text
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    empty: Text = NOTHING
    notes: tuple[Text, ...] = ()
    heard: bool = False
    kind: ClassVar[str] = "table"


@dataclass(frozen=True)
class Facts:
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
class Notice:
    """A verdict, or what must not be overlooked, with what belongs to it."""

    head: Text
    standing: Standing
    lines: tuple[Cell, ...] = ()
    kind: ClassVar[str] = "notice"


@dataclass(frozen=True)
class Paragraph:
    """Running text; a note is set smaller."""

    text: Text
    tone: Literal["plain", "note"] = "plain"
    kind: ClassVar[str] = "paragraph"


@dataclass(frozen=True)
class Field:
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
    fields: tuple[Field, ...]
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


Block = Table | Facts | Tally | Notice | Paragraph | Chooser | Pager | Charts | Drop | Links | Press


@dataclass(frozen=True)
class Section:
    """A titled part of a page."""

    title: Text
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Page:
    """What a reader gets.

    Parameters
    ----------
    title : what it is.
    place : path of the entry of the contents that it belongs to.
    lead : one line below the title.
    blocks : before any section.
    sections : titled parts.
    above : the pages that it stands below.
    status : of the answer.
    """

    title: Text
    place: str
    lead: Text = NOTHING
    blocks: tuple[Block, ...] = ()
    sections: tuple[Section, ...] = ()
    above: tuple[Cell, ...] = ()
    status: HTTPStatus = field(default=HTTPStatus.OK, compare=False)
