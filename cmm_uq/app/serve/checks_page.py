"""Pages that check: a dropped file against the records, and the records against their chain.

Whether the records know a file: by its SHA-256 alone, and where that is unknown by what the file says it is.

This is all that is said of a dropped file: whether its bytes are those that were recorded, and how their certificate
stands. It checks no signature and computes nothing anew; a check that does takes the place of :func:`look_up` and gives a
:class:`Known` too.
"""

from __future__ import annotations

import html
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from cmm_uq.app.serve.exchange import LARGEST, UploadedFile, WebRequest, read_dropped
from cmm_uq.app.serve.page import (
    NOT_MEASURED,
    Block,
    Cell,
    Drop,
    Links,
    PageFacts,
    PageNotice,
    PageParagraph,
    PageSection,
    PageTable,
    Press,
    WebPage,
    address,
    columns,
    moment,
)
from cmm_uq.app.serve.recorded_files import files_of
from cmm_uq.app.serve.view import MOST, ChainComparison, SiteView, machine_cell
from cmm_uq.base.messages import NOTHING, Text, Verbatim, day, number, plural, say
from cmm_uq.certificate.document import Standing
from cmm_uq.laboratory.records.facts import RecordedCertificate
from cmm_uq.laboratory.records.listing import entry_of
from cmm_uq.laboratory.records.place import shown as shown_place
from cmm_uq.laboratory.records.store import Records

MOST_CERTIFICATES = 50  # certificates of one number that are compared: it is issued once, and drafted a few times
_OF_PAGE = re.compile(rb'class="number">[^<]{0,40}<bdi>([^<]{1,300})</bdi>')
_OF_PDF = re.compile(rb"<pdf:Keywords>([^<]{1,300})</pdf:Keywords>")


@dataclass(frozen=True)
class FileMatch:
    """What the records know of a file.

    ``how``: recorded, the very bytes; altered, other bytes that say they are a certificate of the records; unknown;
    ``certificate``: that it is of, or says that it is of; ``name``: under which it was recorded; ``says``: the number
    that an altered or unknown file says it has; empty where it says none that can be read.
    """

    how: Literal["recorded", "altered", "unknown"]
    certificate: RecordedCertificate | None = None
    name: str = ""
    says: str = ""


def look_up(records: Records, dropped: UploadedFile) -> FileMatch:
    """Look a file up."""
    entry = records.has_results(dropped.sha256)
    if entry is not None:
        return FileMatch("recorded", records.certificate(entry), "results.json")
    says = number_in(dropped.content or b"")
    candidates = records.named(says)[-MOST_CERTIFICATES:] if says else []
    for certificate in reversed(candidates):
        found = entry_of(records, certificate.entry)
        folder, signed = Path(certificate.folder), records.signed(certificate.entry)
        known = (*files_of(found, folder), *files_of(found, folder, signed)) if found is not None else ()
        for file in known:  # as it was written, and as it was signed since
            if file.sha256 == dropped.sha256:
                return FileMatch("recorded", certificate, file.name, says)
    if candidates:
        return FileMatch("altered", candidates[-1], says=says)
    return FileMatch("unknown", says=says)


def number_in(content: bytes) -> str:
    """The number that a certificate (PDF or HTML) or a results.json says it has; empty where none can be read."""
    if content.startswith(b"%PDF"):
        found = _OF_PDF.search(content)
    elif content.lstrip()[:1] == b"{":
        return _of_results(content)
    else:
        found = _OF_PAGE.search(content)
    return html.unescape(found[1].decode("utf-8", "replace")).strip() if found else ""


def _of_results(content: bytes) -> str:
    try:
        data = json.loads(content)
        if str(data["schema"]).startswith("cmm-uq/results/"):
            return str(data["job"]["id"])
    except (ValueError, KeyError, TypeError, RecursionError):
        pass
    return ""


_SCOPE = say(
    "What is compared is the SHA-256 of the whole file with those in the records. No signature is checked, nothing is "
    "computed anew, and the records themselves are taken as they are: whether they agree with their chain, Integrity says."
)


def file_page(view: SiteView, asked: WebRequest) -> WebPage:
    """The form."""
    asked.only(())
    return WebPage(say("Check a file"), "/file",
                lead=say("Is this certificate the one that was issued, and does it still hold?"), blocks=_form())  # fmt: skip


def dropped_page(view: SiteView, asked: WebRequest) -> WebPage:
    """What the records know of the file in the request."""
    asked.only(())
    dropped = read_dropped(asked)
    known = look_up(view.records, dropped)
    return WebPage(
        say("Check a file"), "/file", lead=Verbatim(dropped.name),
        blocks=(verdict(known), _facts(known, dropped), PageParagraph(_SCOPE, "note")),
        sections=(PageSection(say("Another file"), _form()),),
    )  # fmt: skip


def _form() -> tuple[Block, ...]:
    hint = say(
        "A certificate as PDF or HTML, or its results.json; at most {most} MB. It is read once and not kept.",
        most=number(LARGEST // 2**20),
    )
    return (Drop("/file", say("Drop a file here, or choose one"), hint, say("Check it")),)


def verdict(known: FileMatch) -> PageNotice:
    """What is said first of a file."""
    if known.certificate is None:
        return PageNotice(say("Unknown: no certificate of these records"), "open", _unknown(known))
    if known.how == "altered":
        told = (
            say("It says that it is {number}, which is in the records, but its bytes are none of those that were recorded.",
                number=Verbatim(known.says)),
            say("It was changed after it was made, or made again without being recorded here. Do not rely on it."),
        )  # fmt: skip
        return PageNotice(say("Altered: not the file that was recorded"), "bad", tuple(Cell(line) for line in told))
    return _of_state(known.certificate)


def _of_state(one: RecordedCertificate) -> PageNotice:
    heads: dict[str, tuple[Text, Standing]] = {
        "released": (say("Known and released"), "good"),
        "draft": (say("Known, but a draft: nobody has released it"), "open"),
        "withdrawn": (say("Known, but withdrawn: do not rely on it"), "bad"),
        "replaced": (say("Known, but replaced by another certificate: do not rely on it"), "bad"),
    }
    head, standing = heads.get(one.state, (say("Known; its state is {state}", state=Verbatim(one.state)), "open"))
    if one.command != "report":
        head, standing = say("Known: a diagnosis, which is no certificate"), "open"
    lines: list[Text] = [say("Its bytes are those that were recorded.")]
    if (warning := NOT_MEASURED.get(one.origin)) is not None:
        lines, standing = [*lines, warning], "bad" if standing == "bad" else "open"
    return PageNotice(head, standing, tuple(Cell(line) for line in lines))


def _unknown(known: FileMatch) -> tuple[Cell, ...]:
    lines = [say("Its bytes are not in the records.")]
    if known.says:
        lines.append(say("It says that it is {number}, which is not in them either.", number=Verbatim(known.says)))
    else:
        lines.append(say("It says no number by which it could be found: it may be of another program, a file beside a "
                         "certificate, or damaged."))  # fmt: skip
    return tuple(Cell(line) for line in lines)


def _facts(known: FileMatch, dropped: UploadedFile) -> PageFacts:
    rows: list[tuple[Text, Cell]] = []
    if (one := known.certificate) is not None:
        name = say("recorded as {name}", name=Verbatim(known.name)) if known.name else NOTHING
        rows = [
            (say("Certificate"), Cell(Verbatim(one.number), address("/certificate", entry=one.entry), note=name)),
            (say("Machine"), machine_cell(one.machine)),
            (say("Measured on"), Cell(day(one.day))),
        ]
    size = say("{bytes} bytes", bytes=number(dropped.size, ",d"))
    return PageFacts((*rows, (say("Size"), Cell(size)), (say("SHA-256"), Cell(Verbatim(dropped.sha256)))), wide=True)


_WHAT = say(
    "Every entry carries the hash of the one before. A comparison finds entries that were altered, deleted or exchanged, and "
    "tables and files that are not what was recorded. Whether entries are missing at the end, only a head that was filed "
    "elsewhere can show."
)


def integrity_page(view: SiteView, asked: WebRequest) -> WebPage:
    """The head of the records, and what the last comparison found."""
    asked.only(())
    count, head = view.records.head()
    rows = (
        (say("Entries"), Cell(number(count, ",d"))),
        (say("Head"), Cell(Verbatim(head) if count else say("none yet"))),
        (say("Records"), Cell(Verbatim(shown_place(view.records.place)))),
    )
    return WebPage(
        say("Integrity"), "/integrity", lead=NOTHING,
        blocks=(*_found(view, (count, head)), PageFacts(rows, wide=True)),
        sections=(PageSection(say("Compare the records with their chain"), _forms(view)),),
    )  # fmt: skip


def _forms(view: SiteView) -> tuple[Block, ...]:
    if (since := view.checking.since) is not None:
        told = say("A comparison is under way since {moment}.", moment=moment(since))
        return (PageParagraph(told), Links((Cell(say("Look again"), "/integrity"),)))
    return (
        PageParagraph(_WHAT),
        Press("/integrity/chain", say("Compare entries and tables")),
        Press("/integrity/files", say("Compare entries, tables and all files")),
    )


def _found(view: SiteView, head: tuple[int, str]) -> tuple[Block, ...]:
    last = view.checking.last
    if last is None:
        return (PageNotice(say("Not compared since cmm-uq serve was started"), "open"),)
    at = say("Compared on {moment}, {what}, up to entry {number}.", moment=moment(last.at), number=number(last.head[0]),
             what=say("with all files") if last.files else say("without files"))  # fmt: skip
    later = (Cell(say("Entries were added since.")),) if last.head != head else ()
    if last.failed:
        failed = Cell(Verbatim(last.failed))
        return (PageNotice(say("The records could not be compared"), "bad", (failed, Cell(at))),)
    if not last.count:
        return (PageNotice(say("The records agree with their chain"), "good", (Cell(at), *later)),)
    head_text = plural(last.count, one=say("One thing is not as it was recorded"),
                       many=say("{count} things are not as they were recorded", count=number(last.count, ",d")))  # fmt: skip
    return (PageNotice(head_text, "bad", (Cell(at), *later)), _table(last))


def _table(last: ChainComparison) -> PageTable:
    kinds = {"chain": say("Entry"), "index": say("Table"), "file": say("File"), "missing": say("Missing file")}
    rows = tuple(
        (Cell(say("Entry {number}", number=number(one.entry)) if one.entry is not None else say("Records")),
         Cell(kinds.get(one.kind, Verbatim(one.kind))), Cell(Verbatim(one.problem)))
        for one in last.findings
    )  # fmt: skip
    more = (say("Shown are the first {most}.", most=number(MOST)),) if last.count > len(rows) else ()
    return PageTable(say("What is not as it was recorded"), columns(say("Where"), say("What"), say("Finding")),
                 rows, notes=more)  # fmt: skip
