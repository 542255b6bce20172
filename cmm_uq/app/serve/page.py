"""A page as data, before anyone decides what it looks like; and the records' words as a reader sees them.

One template (``templates/serve/page.html``) shows every page, and has no words of its own. Texts are rounded and worded
already; an address is a path of this site with its query, quoted.
"""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Iterable, Mapping
from http import HTTPStatus
from typing import TYPE_CHECKING, Literal, NamedTuple, TypeAlias
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


class PageFacts(NamedTuple):
    """Labels and values; in one column where values are long (``wide``)."""

    rows: tuple[tuple[Text, Cell], ...]
    wide: bool = False


class Count(NamedTuple):
    """How many of something there are, and where they are listed."""

    number: int
    what: Text
    address: str
    standing: Standing | None = None
    chosen: bool = False


class Tally(NamedTuple):
    """Counts side by side: what a reader with five seconds sees."""

    title: Text
    counts: tuple[Count, ...]


class PageNotice(NamedTuple):
    """A verdict, or what must not be overlooked, with what belongs to it."""

    head: Text
    standing: Standing
    lines: tuple[Cell, ...] = ()


class PageParagraph(NamedTuple):
    """Running text; a note is set smaller."""

    text: Text
    tone: Literal["plain", "note"] = "plain"


class FormField(NamedTuple):
    """A field of a form: a line of text, a date, or one of several options ``(value, text)``."""

    name: str
    label: Text
    value: str = ""
    options: tuple[tuple[str, Text], ...] = ()
    sort: Literal["search", "date", "select"] = "search"


class Chooser(NamedTuple):
    """A form that narrows a list; ``kept`` is what else of the query stays as it is."""

    title: Text
    path: str
    fields: tuple[FormField, ...]
    button: Text
    clear: Cell | None = None
    kept: tuple[tuple[str, str], ...] = ()


class Pager(NamedTuple):
    """Where in a long list the reader is, and its neighbours."""

    title: Text
    told: Text
    before: Cell | None = None
    after: Cell | None = None


CHART = 340, 150  # width and height of a picture, CSS pixels at its natural size


class Chart(NamedTuple):
    """A picture with the sentence that replaces it for whoever cannot see it."""

    title: Text
    told: Text
    svg: str
    alternative: Text
    standing: Standing | None = None


class Charts(NamedTuple):
    """Pictures side by side."""

    charts: tuple[Chart, ...]
    notes: tuple[Text, ...] = ()


class Drop(NamedTuple):
    """The form that takes a file, dropped or chosen."""

    path: str
    label: Text
    hint: Text
    button: Text


class Links(NamedTuple):
    """Where to go from here."""

    cells: tuple[Cell, ...]


class Press(NamedTuple):
    """A form with nothing but a button."""

    path: str
    button: Text


class FormEntry(NamedTuple):
    """A field that is filled in: a line, a date, a text of many lines, or one of several options; ``hint``: below it.

    ``again``: what is offered to be taken as it was the last time.
    """

    name: str
    label: Text
    value: str = ""
    sort: Literal["text", "date", "area", "select", "password"] = "text"
    options: tuple[tuple[str, Text], ...] = ()
    hint: Text = NOTHING
    example: str = ""
    again: str = ""


class GridColumn(NamedTuple):
    """A column of a file as it stands: its heading, what it is taken for, and the options that correct it."""

    heading: Text
    meaning: str  # by which it is coloured
    field: FormEntry


class CellGrid(NamedTuple):
    """Rows of a file as it stands, each with its line, its cells, and whether it belongs to the head."""

    caption: Text
    columns: tuple[GridColumn, ...]
    rows: tuple[tuple[int, tuple[str, ...], bool], ...]


class PageForm(NamedTuple):
    """A form that is sent.

    ``buttons``: the value that ``then`` has with each, and its text; ``hidden``: what goes with it; ``check``: address
    that says while somebody types what is wrong; ``further``: fields that are folded away below a ``legend``.
    """

    path: str
    fields: tuple[FormEntry, ...]
    buttons: tuple[tuple[str, Text], ...]
    hidden: tuple[tuple[str, str], ...] = ()
    grid: CellGrid | None = None
    check: str = ""
    legend: Text = NOTHING
    further: tuple[FormEntry, ...] = ()


class Choices(NamedTuple):
    """Pictures to choose from: each its address, its title, and its drawing."""

    title: Text
    choices: tuple[tuple[str, Text, str], ...]


class SourceText(NamedTuple):
    """A text as it stands: a command, a file, a difference."""

    title: Text
    text: str


class SandboxFrame(NamedTuple):
    """Another document, shown in a sandbox."""

    title: Text
    address: str


class Running(NamedTuple):
    """Work under way: its events, what is being done, and the part in hundredths that is done."""

    events: str
    what: Text
    percent: int


class Turnable(NamedTuple):
    """Vectors in a volume, drawn and turned by the site's script; ``alternative``: a sentence that replaces them."""

    data: str
    alternative: Text


ReadBlock = PageTable | PageFacts | Tally | PageNotice | PageParagraph | Chooser | Pager | Charts | Links | SourceText
Block = ReadBlock | Drop | Press | PageForm | Choices | SandboxFrame | Running | Turnable
Section = tuple[Text, tuple[Block, ...]]  # a titled part of a page


def section(title: Text, *blocks: Block) -> tuple[Section, ...]:
    """A titled part of a page; none where it has nothing in it."""
    return ((title, blocks),) if blocks else ()


def lines_of(texts: Iterable[object]) -> tuple[Cell, ...]:
    """Texts of elsewhere, each a line."""
    return tuple(Cell(Verbatim(str(text))) for text in texts)


def kind(block: Block) -> str:
    """Name of its macro in the template."""
    return re.sub("^Page(?=[A-Z])", "", type(block).__name__).lower()


class WebPage(NamedTuple):
    """What a reader gets: below one line of ``lead``, under an entry (``place``) of the contents and the pages ``above``."""

    title: Text
    place: str
    lead: Text = NOTHING
    blocks: tuple[Block, ...] = ()
    sections: tuple[Section, ...] = ()
    above: tuple[Cell, ...] = ()
    status: HTTPStatus = HTTPStatus.OK


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
