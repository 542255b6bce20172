"""A document as data: what a certificate says, before anyone decides what it looks like.

HTML and PDF are two views of one :class:`Document`; every figure stands in it once, already as text, so that the views
cannot differ. A section is a list of blocks, and a block is one of the small classes below: whoever adds an artefact, a
budget or a diagnosis composes blocks and touches neither view. Text is plain Unicode without markup; both views escape it.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Literal

Outcome = Literal["pass", "fail", "undecided"]


@dataclass(frozen=True)
class Paragraph:
    """Running text; a note is set smaller, a warning stands out."""

    text: str
    tone: Literal["plain", "note", "warning"] = "plain"
    kind: ClassVar[str] = "paragraph"


@dataclass(frozen=True)
class Facts:
    """Label and value pairs, such as the customer's address or the conditions. Values may have several lines."""

    rows: tuple[tuple[str, str], ...]
    kind: ClassVar[str] = "facts"


@dataclass(frozen=True)
class Column:
    """Heading of a table column; numeric columns are aligned to the right with tabular figures."""

    heading: str
    unit: str = ""
    numeric: bool = True


@dataclass(frozen=True)
class Table:
    """Rows of text under headings; every row has as many cells as there are columns."""

    caption: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()
    kind: ClassVar[str] = "table"


@dataclass(frozen=True)
class Plot:
    """A picture as SVG, with the sentence that replaces it for whoever cannot see it."""

    caption: str
    alternative: str
    svg: str
    kind: ClassVar[str] = "plot"


@dataclass(frozen=True)
class Decision:
    """A statement of conformity: what was compared with what, by which rule, and what follows."""

    standard: str
    quantity: str
    measured: str
    limit: str
    rule: str
    outcome: Outcome
    explanation: str
    kind: ClassVar[str] = "decision"


Block = Paragraph | Facts | Table | Plot | Decision


@dataclass(frozen=True)
class Section:
    """A titled part of the document."""

    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Signature:
    """A line to sign on: who authorises the document."""

    name: str
    role: str = ""


@dataclass(frozen=True)
class Document:
    """A certificate or report.

    Parameters
    ----------
    title : what it is, such as "Calibration certificate".
    number : unique identification, shown on every page.
    subject : one line under the title: the machine and the date.
    issuer : the laboratory that answers for it; lines of name and address. Empty when the job does not say.
    particulars : facts that identify customer, item, dates, method; the first thing after the title.
    warnings : what the reader must know before using a figure; shown on the first page.
    sections : the results.
    statements : sentences on scope, reproduction and the like, before the signatures.
    signatures : who authorises.
    attachments : names of the files that travel with the document.
    produced_by : program and version, seed and whatever else is needed to run it again.
    """

    title: str
    number: str
    subject: str
    issuer: tuple[str, ...]
    particulars: tuple[Facts, ...]
    warnings: tuple[str, ...]
    sections: tuple[Section, ...]
    statements: tuple[str, ...]
    signatures: tuple[Signature, ...]
    attachments: tuple[str, ...]
    produced_by: str

    def as_data(self) -> dict[str, Any]:
        """The document as plain dicts and lists; every block carries its ``kind``."""
        data = asdict(self)
        for section, plain in zip(self.sections, data["sections"], strict=True):
            for block, plain_block in zip(section.blocks, plain["blocks"], strict=True):
                plain_block["kind"] = block.kind
        return data
