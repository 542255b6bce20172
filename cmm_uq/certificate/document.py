"""A document as data: what a certificate says, before anyone decides what it looks like.

HTML and PDF are two views of one :class:`Document`; every figure stands in it once, already as text, so that the views
cannot differ. A section is a list of blocks, and a block is one of the small classes below: whoever adds an artefact, a
budget or a diagnosis composes blocks and touches neither view. Text is plain Unicode without markup; a line feed is a new
line; both views escape the rest.
"""

from __future__ import annotations

import datetime as dt
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from contextvars import ContextVar
from functools import cache
from typing import Any, ClassVar, Literal

from cmm_uq import __version__
from cmm_uq.base.languages.translation import ENGLISH, Code, code_of, translated as said_in
from cmm_uq.base.messages import NOTHING, Text, Verbatim, say
from cmm_uq.base.values import asdict, dataclass, fields, is_dataclass, replace
from cmm_uq.jobs.job import JobFile
from cmm_uq.jobs.logo import Logo

_BREAK = Verbatim("\x1f")

WORDS: Mapping[str, Text] = {
    "number": say("No."), "quantity": say("Quantity"), "measured": say("Measured"), "limit": say("Limit"),
    "rule": say("Decision rule"), "missing": say("Missing"), "warning": say("Warning"), "warnings": say("Warnings"),
    "warning_mark": say("Warning."), "in_short": say("In short"), "particulars": say("Particulars"),
    "authorised": say("Authorised by"),
    "attachments": say("Files that belong to this document: {files}", files=_BREAK),
    "page": say("Page {page} of {pages}", page=_BREAK, pages=_BREAK),
    "replaced": say("□ stands for a character that the fonts of this file lack: {codes}. The HTML view shows it.",
                    codes=_BREAK),
    "annex": say("Annex: opinions and interpretations"),
    "annex_clause": say("Opinions and interpretations by ISO/IEC 17025:2017, 7.8.7."),
    "annex_note": say(
        "What stands in this annex interprets the results above. It is no result of the "
        "calibration, and no statement of conformity rests on it."
    ),
    "pass": say("Pass"), "fail": say("Fail"), "undecided": say("Undecided"), "incomplete": say("Incomplete"),
    "conditional pass": say("Conditional pass"), "conditional fail": say("Conditional fail"), "remeasure": say("Remeasure"),
}  # fmt: skip
"""By the names that the templates use."""


def view_words(language: Code) -> dict[str, Any]:
    """The same as plain text in a language; what a view fills in parts it into a list."""
    said = {name: str.__str__(said_in(text, language)) for name, text in WORDS.items()}
    return {name: text.split(_BREAK) if _BREAK in text else text for name, text in said.items()}


Outcome = Literal["pass", "conditional pass", "incomplete", "undecided", "conditional fail", "remeasure", "fail"]


NOT_LETTERED: ContextVar[str] = ContextVar("what to install for characters that no font had", default="")


@dataclass(frozen=True)
class Paragraph:
    """Running text; a note is set smaller, a warning stands out."""

    text: Text
    tone: Literal["plain", "note", "warning"] = "plain"
    kind: ClassVar[str] = "paragraph"


@dataclass(frozen=True)
class Facts:
    """Label and value pairs, such as the customer's address or the conditions. Values may have several lines."""

    rows: tuple[tuple[Text, Text], ...]
    kind: ClassVar[str] = "facts"


def facts(*rows: tuple[Text, Text]) -> Facts:
    """Without those that have no value."""
    return Facts(tuple(row for row in rows if row[1]))


@dataclass(frozen=True)
class Column:
    """Heading of a table column; numeric columns are aligned to the right with tabular figures."""

    heading: Text
    unit: Text = NOTHING
    numeric: bool = True


def figure_columns(*headings: Text, unit: Text = NOTHING) -> tuple[Column, ...]:
    return tuple(Column(heading, unit) for heading in headings)


@dataclass(frozen=True)
class Table:
    """Rows of text under headings; every row has as many cells as there are columns."""

    caption: Text
    columns: tuple[Column, ...]
    rows: tuple[tuple[Text, ...], ...]
    notes: tuple[Text, ...] = ()
    kind: ClassVar[str] = "table"

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ValueError(f"table {self.caption!r}: {len(row)} cells under {len(self.columns)} headings: {row}")


def table(
    caption: Text, headings: Iterable[Text | Column], rows: Iterable[tuple[Text, ...]], *notes: Text
) -> Table | None:
    """A table where there are rows; a heading by itself is of a column of text, a :class:`Column` of figures."""
    cells = tuple(rows)
    return Table(caption, columns(headings), cells, notes) if cells else None


def columns(headings: Iterable[Text | Column]) -> tuple[Column, ...]:
    return tuple(one if isinstance(one, Column) else Column(one, numeric=False) for one in headings)


@dataclass(frozen=True)
class Plot:
    """A picture as SVG, with the sentence that replaces it for whoever cannot see it, and the texts lettered in it."""

    caption: Text
    alternative: Text
    svg: str
    lettering: tuple[Text, ...] = ()
    kind: ClassVar[str] = "plot"


@dataclass(frozen=True)
class DecisionBlock:
    """A statement of conformity: what was compared with what, by which rule, what follows, and what of the test is missing."""

    standard: Text
    quantity: Text
    measured: Text
    limit: Text
    rule: Text
    outcome: Outcome
    explanation: Text
    missing: tuple[Text, ...] = ()
    kind: ClassVar[str] = "decision"


Standing = Literal["good", "open", "bad", "unknown"]
"""Whether nothing is left to do, something is, the machine is not what it should be, or nothing can be said of it."""


@dataclass(frozen=True)
class Overview:
    """What a reader with ten seconds must know: a verdict, in colour, by a sign and in words, and labelled lines on it."""

    verdict: Text
    standing: Standing
    rows: tuple[tuple[Text, Text], ...]
    kind: ClassVar[str] = "overview"


Block = Paragraph | Facts | Table | Plot | DecisionBlock | Overview


@dataclass(frozen=True)
class Section:
    title: Text
    blocks: tuple[Block, ...]
    opinion: bool = False  # interprets the results and belongs in the annex
    first: bool = False  # stands on the first page of a document that decides there


def section(title: Text, *blocks: Block | None) -> Section:
    return Section(title, tuple(block for block in blocks if block is not None))


@dataclass(frozen=True)
class Signature:
    """A line to sign on: who authorises the document."""

    name: Text
    role: Text = NOTHING


@dataclass(frozen=True, kw_only=True)
class Document:
    title: Text  # what it is, such as "Calibration certificate"
    number: Text  # unique identification, shown on every page
    subject: Text  # one line under the title: the machine and the date
    issuer: tuple[Text, ...] = ()  # the laboratory that answers for it; lines of name and address
    particulars: tuple[Facts, ...] = ()  # customer, item, dates, method: the first thing after the title
    warnings: tuple[Text, ...] = ()  # what the reader must know before using a figure; shown on the first page
    sections: tuple[Section, ...] = ()  # the results; those of opinion last, which make up the annex
    statements: tuple[Text, ...] = ()  # on scope, reproduction and the like, before the signatures
    signatures: tuple[Signature, ...] = ()
    attachments: tuple[Text, ...] = ()  # names of the files that travel with the document
    produced_by: Text  # program and version, seed and whatever else is needed to run it again
    records: Text = NOTHING  # how the laboratory's records stood when it was made; empty where it is kept in none
    date: dt.date | None = None  # of issue, which is also the PDF's date; the clock is never read
    language: str = "en"  # BCP 47 tag, for screen readers and hyphenation
    end: Text = say("End of certificate")  # the mark after the last line
    banner: Text = NOTHING  # what every page must say at its head, such as that nothing was measured
    overview: Overview | None = None  # what comes before everything else
    draft: bool = False  # the banner says only that something is still to be stated
    logo: Logo | None = None
    decides: bool = False  # all that is decided, stated and signed stands on the first page, and the figures behind it

    def as_data(self) -> dict[str, Any]:
        """The document as plain dicts and lists of printable text, ready for JSON.

        Every block carries its ``kind``; tables and plots also their ``label``, counted through the document
        ("Table 2", "Figure 1"), so that the views number them alike; tables also what their layout goes by.
        """
        data: dict[str, Any] = _printable(asdict(replace(self, logo=None)))
        data["logo"] = self.logo and {"uri": self.logo.uri, "alternative": data["issuer"][0] if self.issuer else "–"}
        data["date"] = self.date.isoformat() if self.date else None
        counted: Counter[str] = Counter()
        language = code_of(self.language)
        for section, plain in zip(self.sections, data["sections"], strict=True):
            for block, plain_block in zip(section.blocks, plain["blocks"], strict=True):
                plain_block["kind"] = block.kind
                plain_block.pop("lettering", None)
                if block.kind in _NUMBERED:
                    counted[block.kind] += 1
                    number = counted[block.kind]
                    table, figure = say("Table {number}", number=number), say("Figure {number}", number=number)
                    label = table if block.kind == "table" else figure
                    plain_block["label"] = str.__str__(said_in(label, language))
                if block.kind == "table":
                    _measure(plain_block, english=language == ENGLISH)
        return data


_NUMBERED = ("table", "plot")


def _measure(table: dict[str, Any], *, english: bool) -> None:
    """What the views must know to lay a table out.

    Every column is given its longest line in characters (``need``), and the texts that are likely to be its widest: a line
    (``longest``), a word of its cells (``word``) and one of its heading (``heading_word``). What is longer than any figure is
    set as text; figures stay figures below the longer headings of languages other than English. The table is given the
    characters of its narrowest line (``least``): figures whole, texts broken at words.
    """
    for index, column in enumerate(table["columns"]):
        cells = [line for row in table["rows"] for line in row[index].split("\n")]
        head = [column["heading"], column["unit"]]
        column["need"] = max(4, *map(letters, head), *map(letters, cells), 0)
        longest = column["need"] if english else max(map(letters, cells), default=0)
        column["numeric"] = column["numeric"] and longest <= _LONGEST_FIGURE
        column["longest"] = max(cells, key=_width, default="")
        column["word"] = max((part for line in cells for part in _parts(line, " ")), key=_width, default="")
        column["heading_word"] = max((part for line in head for part in _parts(line, None)), key=_width, default="")
    kept = [
        max(letters(c["longest"] if c["numeric"] else c["word"]), letters(c["heading_word"])) for c in table["columns"]
    ]
    table["least"] = sum(kept) + 2 * len(kept)


def letters(line: str) -> int:
    """Of a line; a Chinese or Japanese character has the room of two."""
    return len(line) + _wide(line)


def _parts(line: str, separator: str | None) -> list[str]:
    """What a line is not broken within: words; Japanese, which is written without spaces, a few characters at a time."""
    words = line.split(separator)
    return [part for word in words for part in (_patterns()[1].findall(word) if _wide(word) else [word])]


def _width(line: str) -> float:
    return _wide(line) + sum(
        1.5 if c in "mwMW%—" else 0.6 if c in "fijlrtI.,:;'|()[] −-" else 1.2 if c.isupper() else 1.0 for c in line
    )


def _wide(line: str) -> int:
    """How many characters are Chinese, Japanese or Korean."""
    return len(_patterns()[0].findall(line)) if max(line, default="") >= _CHARACTERS[0] else 0


@cache
def _patterns() -> tuple[re.Pattern[str], re.Pattern[str]]:
    """One such character, and a few or what is between: compiled where there is any, as long as a command's tables take."""
    return re.compile(f"[{_CHARACTERS}]"), re.compile(f"[{_CHARACTERS}]{{1,6}}|[^{_CHARACTERS}]+")


_LONGEST_FIGURE = 28
_CHARACTERS = "\u2e80-\ua4cf\uac00-\ud7a3\uf900-\ufaff\uff00-\uff60"  # of Chinese, Japanese and Korean
_LEFT_OUT = re.compile("[\u202a-\u202e\u2066-\u2069\ufeff]")
_UNPRINTABLE = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\ud800-\udfff\ue000-\uf8ff\ufdd0-\ufdef\ufffe\uffff\U000f0000-\U0010ffff]"
)


def _printable(value: Any) -> Any:
    """The same data with every text made safe to show.

    What no view may carry (control characters, lone surrogates, private and non-characters, which PDF/A forbids) becomes
    the replacement character; byte order marks, and marks that reorder the text around them (they could turn a figure
    round), are left out.
    """
    if isinstance(value, dict):
        return {key: _printable(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_printable(item) for item in value]
    if isinstance(value, str):
        plain = value.replace("\r\n", "\n").replace("\r", "\n").replace("\t", " ")
        return _UNPRINTABLE.sub("\ufffd", _LEFT_OUT.sub("", plain))
    return value


def translated(document: Document, code: Code) -> Document:
    """The document in a language; pictures were lettered when they were drawn (:mod:`cmm_uq.certificate.plots.style`)."""
    if code == ENGLISH:
        return document
    found: Document = with_each_text(document, lambda text: said_in(text, code))
    return replace(found, language=code)


def with_each_text(value: Any, change: Callable[[Text], Text]) -> Any:
    """The same blocks, tuples and texts, each text changed."""
    if isinstance(value, Text):
        return change(value)
    if isinstance(value, tuple):
        return tuple(with_each_text(item, change) for item in value)
    if is_dataclass(value) and not isinstance(value, type):
        return replace(value, **{f.name: with_each_text(getattr(value, f.name), change) for f in fields(value)})
    return value


def working_page(
    facts: JobFile, title: Text, subject: Text, *, particulars: tuple[Facts, ...], warnings: Iterable[Text],
    sections: Iterable[Section], produced_by: Text, end: Text = say("End of diagnosis"),
    attachments: tuple[Text, ...] = (), overview: Overview | None = None,
) -> Document:  # fmt: skip
    """A document about a job, without the sections that have nothing to say; see :class:`Document`."""
    return Document(
        title=title, number=Verbatim(facts.job.id), date=facts.job.date,
        subject=say("{name}, {subject}", name=Verbatim(facts.machine.name), subject=subject),
        issuer=tuple(Verbatim(line) for line in (facts.laboratory.name,) if line),
        particulars=particulars, warnings=tuple(warnings),
        sections=tuple(section for section in sections if section.blocks),
        attachments=attachments, produced_by=produced_by, end=end, overview=overview,
    )  # fmt: skip


def program_page(
    title: Text, number: Text, subject: Text, sections: Iterable[Section], *files: str, seed: int | None = None, **further: Any
) -> Document:  # fmt: skip
    """A document about no job, by the program alone, with the files that belong to it; see :class:`Document`."""
    by: Text = say("cmm-uq {version}", version=Verbatim(__version__))
    if seed is not None:
        by = say("cmm-uq {version}, seed {seed}", version=Verbatim(__version__), seed=seed)
    return Document(title=title, number=number, subject=subject, sections=tuple(sections), produced_by=by,
                    attachments=tuple(map(Verbatim, files)), **further)  # fmt: skip
