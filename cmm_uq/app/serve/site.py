"""The site: which address gives which page, as HTML, and a page in words for whatever goes wrong.

Records are opened for each request and closed after it, so that a page shows what is there now, and not a file that was
moved, restored or migrated meanwhile.

Pages that check: a dropped file against the records, and the records against their chain.

A file is known by its SHA-256 alone, and where that is unknown by what it says it is. No signature is checked, and nothing
computed anew.
"""

from __future__ import annotations

import contextlib
import datetime as dt
import html
import json
import re
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from http import HTTPStatus
from pathlib import Path
from typing import Literal

from cmm_uq import __version__
from cmm_uq.app.serve import page as p
from cmm_uq.app.serve.certificate_page import certificate_page, files_of, recorded_file
from cmm_uq.app.serve.exchange import (
    LARGEST,
    RefusedRequest,
    UploadedFile,
    WebRequest,
    WebResponse,
    fault,
    read_dropped,
    refusal,
    render_page,
    style,
)
from cmm_uq.app.serve.lists import artefacts_page, certificates_page, diagnoses_page, machine_page, machines_page
from cmm_uq.app.serve.view import (
    MOST,
    ChainComparing,
    DueDates,
    MachineStanding,
    SiteView,
    by_rule,
    machine_cell,
    overview,
    problem_of,
)
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, Verbatim, day, number, plural, say
from cmm_uq.certificate.document import Standing
from cmm_uq.certificate.look import template_folder
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.facts import RecordedCertificate
from cmm_uq.laboratory.records.listing import entry_of
from cmm_uq.laboratory.records.place import shown, shown as shown_place
from cmm_uq.laboratory.records.store import Records

MOST_CERTIFICATES = 50  # of one number that are compared: it is issued once, and drafted a few times

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
    if (results := records.has_results(dropped.sha256)) is not None:
        return FileMatch("recorded", records.certificate(results), "results.json")
    says = number_in(dropped.content or b"")
    candidates = records.named(says)[-MOST_CERTIFICATES:] if says else []
    for certificate in reversed(candidates):
        entry = entry_of(records, certificate.entry)
        folder, signed = Path(certificate.folder), records.signed(certificate.entry)
        known = (*files_of(entry, folder), *files_of(entry, folder, signed)) if entry is not None else ()
        for file in known:  # as it was written, and as it was signed since
            if file.sha256 == dropped.sha256:
                return FileMatch("recorded", certificate, file.name, says)
    if candidates:
        return FileMatch("altered", candidates[-1], says=says)
    return FileMatch("unknown", says=says)


def number_in(content: bytes) -> str:
    """The number that a certificate (PDF or HTML) or a results.json says it has; empty where none can be read."""
    if not content.startswith(b"%PDF") and content.lstrip()[:1] == b"{":
        try:
            data = json.loads(content)
            return str(data["job"]["id"]) if str(data["schema"]).startswith("cmm-uq/results/") else ""
        except (ValueError, KeyError, TypeError, RecursionError):
            return ""
    found = (_OF_PDF if content.startswith(b"%PDF") else _OF_PAGE).search(content)
    return html.unescape(found[1].decode("utf-8", "replace")).strip() if found else ""


_SCOPE = say(
    "What is compared is the SHA-256 of the whole file with those in the records. No signature is checked, nothing is "
    "computed anew, and the records themselves are taken as they are: whether they agree with their chain, Integrity says."
)


def file_page(view: SiteView, request: WebRequest) -> p.WebPage:
    request.only(())
    lead = say("Is this certificate the one that was issued, and does it still hold?")
    return p.WebPage(say("Check a file"), "/file", lead=lead, blocks=_form())


def dropped_page(view: SiteView, request: WebRequest) -> p.WebPage:
    request.only(())
    dropped = read_dropped(request)
    known = look_up(view.records, dropped)
    rows: list[tuple[Text, p.Cell]] = []
    if (one := known.certificate) is not None:
        name = say("recorded as {name}", name=Verbatim(known.name)) if known.name else NOTHING
        rows = [
            (say("Certificate"), p.Cell(Verbatim(one.number), p.address("/certificate", entry=one.entry), note=name)),
            (say("Machine"), machine_cell(one.machine)),
            (say("Measured on"), p.Cell(day(one.day))),
        ]
    size = say("{bytes} bytes", bytes=number(dropped.size, ",d"))
    rows += [(say("Size"), p.Cell(size)), (say("SHA-256"), p.Cell(Verbatim(dropped.sha256)))]
    return p.WebPage(
        say("Check a file"), "/file", lead=Verbatim(dropped.name),
        blocks=(verdict(known), p.PageFacts(tuple(rows), wide=True), p.PageParagraph(_SCOPE, "note")),
        sections=((say("Another file"), _form()),),
    )  # fmt: skip


def _form() -> tuple[p.Block, ...]:
    hint = say(
        "A certificate as PDF or HTML, or its results.json; at most {most} MB. It is read once and not kept.",
        most=number(LARGEST // 2**20),
    )
    return (p.Drop("/file", say("Drop a file here, or choose one"), hint, say("Check it")),)


def verdict(known: FileMatch) -> p.PageNotice:
    """What is said first of a file."""
    lines: list[Text]
    if (one := known.certificate) is None:
        lines = [
            say("Its bytes are not in the records."),
            say("It says that it is {number}, which is not in them either.", number=Verbatim(known.says)) if known.says else
            say("It says no number by which it could be found: it may be of another program, a file beside a "
                "certificate, or damaged."),
        ]  # fmt: skip
        return _notice(say("Unknown: no certificate of these records"), "open", lines)
    if known.how == "altered":
        lines = [
            say("It says that it is {number}, which is in the records, but its bytes are none of those that were recorded.",
                number=Verbatim(known.says)),
            say("It was changed after it was made, or made again without being recorded here. Do not rely on it."),
        ]  # fmt: skip
        return _notice(say("Altered: not the file that was recorded"), "bad", lines)
    heads: dict[str, tuple[Text, Standing]] = {
        "released": (say("Known and released"), "good"),
        "draft": (say("Known, but a draft: nobody has released it"), "open"),
        "withdrawn": (say("Known, but withdrawn: do not rely on it"), "bad"),
        "replaced": (say("Known, but replaced by another certificate: do not rely on it"), "bad"),
    }
    head, standing = heads.get(one.state, (say("Known; its state is {state}", state=Verbatim(one.state)), "open"))
    if one.command != "report":
        head, standing = say("Known: a diagnosis, which is no certificate"), "open"
    lines = [say("Its bytes are those that were recorded.")]
    if (warning := p.NOT_MEASURED.get(one.origin)) is not None:
        lines, standing = [*lines, warning], "bad" if standing == "bad" else "open"
    return _notice(head, standing, lines)


def _notice(head: Text, standing: Standing, lines: list[Text]) -> p.PageNotice:
    return p.PageNotice(head, standing, tuple(map(p.Cell, lines)))


_WHAT = say(
    "Every entry carries the hash of the one before. A comparison finds entries that were altered, deleted or exchanged, and "
    "tables and files that are not what was recorded. Whether entries are missing at the end, only a head that was filed "
    "elsewhere can show."
)


def integrity_page(view: SiteView, request: WebRequest) -> p.WebPage:
    """The head of the records, and what the last comparison found."""
    request.only(())
    count, head = view.records.head()
    rows = (
        (say("Entries"), p.Cell(number(count, ",d"))),
        (say("Head"), p.Cell(Verbatim(head) if count else say("none yet"))),
        (say("Records"), p.Cell(Verbatim(shown_place(view.records.place)))),
    )
    forms: tuple[p.Block, ...] = (
        p.PageParagraph(_WHAT),
        p.Press("/integrity/chain", say("Compare entries and tables")),
        p.Press("/integrity/files", say("Compare entries, tables and all files")),
    )
    if (since := view.checking.since) is not None:
        under_way = say("A comparison is under way since {moment}.", moment=p.moment(since))
        forms = (p.PageParagraph(under_way), p.Links((p.Cell(say("Look again"), "/integrity"),)))
    return p.WebPage(
        say("Integrity"), "/integrity", lead=NOTHING,
        blocks=(*_comparison(view, (count, head)), p.PageFacts(rows, wide=True)),
        sections=((say("Compare the records with their chain"), forms),),
    )  # fmt: skip


def _comparison(view: SiteView, head: tuple[int, str]) -> tuple[p.Block, ...]:
    last = view.checking.last
    if last is None:
        return (p.PageNotice(say("Not compared since cmm-uq serve was started"), "open"),)
    at = say("Compared on {moment}, {what}, up to entry {number}.", moment=p.moment(last.at), number=number(last.head[0]),
             what=say("with all files") if last.files else say("without files"))  # fmt: skip
    later = [say("Entries were added since.")] if last.head != head else []
    if last.failed:
        return (_notice(say("The records could not be compared"), "bad", [Verbatim(last.failed), at]),)
    if not last.count:
        return (_notice(say("The records agree with their chain"), "good", [at, *later]),)
    found = plural(last.count, one=say("One thing is not as it was recorded"),
                   many=say("{count} things are not as they were recorded", count=number(last.count, ",d")))  # fmt: skip
    kinds = {"chain": say("Entry"), "index": say("Table"), "file": say("File"), "missing": say("Missing file")}
    kinds |= {"clock": say("Clock"), "schema": say("Database")}
    rows = tuple(
        (p.Cell(say("Entry {number}", number=number(one.entry)) if one.entry is not None else say("Records")),
         p.Cell(kinds.get(one.kind, Verbatim(one.kind))), p.Cell(Verbatim(one.problem)))
        for one in last.findings
    )  # fmt: skip
    more = (say("Shown are the first {most}.", most=number(MOST)),) if last.count > len(rows) else ()
    headings = p.columns(say("Where"), say("What"), say("Finding"))
    table = p.PageTable(say("What is not as it was recorded"), headings, rows, notes=more)
    return (_notice(found, "bad", [at, *later]), table)


PAGES: Mapping[str, Callable[[SiteView, WebRequest], p.WebPage | WebResponse]] = {  # what is looked at, by path
    "/": machines_page, "/machine": machine_page, "/certificates": certificates_page, "/certificate": certificate_page,
    "/diagnoses": diagnoses_page, "/artefacts": artefacts_page, "/recorded": recorded_file, "/file": file_page,
    "/integrity": integrity_page,
}  # fmt: skip

# pages with a form that is sent: a browser must say where it comes from, which it does to this site alone
WITH_FORM = ("/file", "/integrity")


class Site:
    """Answers requests; ``where`` as :func:`~cmm_uq.laboratory.records.opening.open_records` takes it.

    ``desk``, ``account``: what surrounds its pages (:func:`~cmm_uq.app.serve.exchange.render_page`).
    """

    def __init__(
        self,
        where: str | Path | None = None,
        *,
        due: DueDates = by_rule,
        today: Callable[[], dt.date] = dt.date.today,
        desk: bool = False,
        account: bool = False,
    ) -> None:
        with open_records(where, read_only=True) as records:  # what is wrong with them is told before anybody looks
            self._where = records.place
        self.place = shown(self._where)  # without a password
        self._due, self._today, self._around = due, today, {"desk": desk, "account": account}
        self._lock = threading.Lock()
        self._kept: tuple[tuple[int, str, dt.date], Sequence[MachineStanding]] | None = None
        self.checking = ChainComparing(self.opened)

    def opened(self) -> Records:
        return open_records(self._where, read_only=True)

    def warm(self) -> None:
        """Load what is slow to load and work out how the machines stand, so that no reader waits for it."""
        with contextlib.suppress(CmmUqError):  # whoever looks is told
            self.machines()

    def answer(self, request: WebRequest | RefusedRequest) -> WebResponse:
        title = None
        try:
            if isinstance(request, RefusedRequest):
                raise request
            return self._answer(request)
        except RefusedRequest as error:
            refused = error
        except CmmUqError as error:
            title = say("The records cannot be read")
            refused = RefusedRequest(HTTPStatus.SERVICE_UNAVAILABLE, *problem_of(error))
        except TimeoutError:
            refused = RefusedRequest(HTTPStatus.REQUEST_TIMEOUT, say("the request took too long to come"))
        except Exception as error:  # a fault is told on its page; the others go on
            refused = fault(error)
        return self._rendered(refusal(refused, title))

    def _answer(self, request: WebRequest) -> WebResponse:
        if request.method == "POST":
            return self._posted(request)
        if request.path == "/style.css":
            return WebResponse(style(), "text/css; charset=utf-8")
        if request.path == "/icon.svg":
            return WebResponse((template_folder() / "serve" / "icon.svg").read_bytes(), "image/svg+xml")
        if request.path not in PAGES:
            raise RefusedRequest(HTTPStatus.NOT_FOUND, say("there is no page of that address"))
        with self.opened() as records:
            page = PAGES[request.path](self._view(records), request)
        return page if isinstance(page, WebResponse) else self._rendered(page)

    def _posted(self, request: WebRequest) -> WebResponse:
        if request.path in ("/integrity/chain", "/integrity/files"):
            request.only(())
            self.checking.begin(files=request.path.endswith("files"))
            return WebResponse(b"", status=HTTPStatus.SEE_OTHER, headers={"Location": "/integrity"})
        if request.path != "/file":
            raise RefusedRequest(HTTPStatus.METHOD_NOT_ALLOWED, say("this page can only be looked at"))
        with self.opened() as records:
            return self._rendered(dropped_page(self._view(records), request))

    def _view(self, records: Records) -> SiteView:
        today = self._today()
        return SiteView(records, today, lambda: self._standing(records, today), self.checking)

    def _standing(self, records: Records, today: dt.date) -> Sequence[MachineStanding]:
        head = (*records.head(), today)
        with self._lock:  # worked out once: who asks meanwhile would only do the same
            if self._kept is None or self._kept[0] != head:
                self._kept = head, overview(records, self._due, today)
            return self._kept[1]

    def machines(self) -> Sequence[MachineStanding]:
        """How every machine stands, the most urgent first."""
        with self.opened() as records:
            return self._standing(records, self._today())

    def _rendered(self, page: p.WebPage) -> WebResponse:
        foot = (
            say("Records: {place}. To be looked at only: nothing here can be changed.", place=Verbatim(self.place)),
            say("cmm-uq {version}", version=Verbatim(__version__)),
        )
        referrer = "same-origin" if page.place in WITH_FORM else "no-referrer"
        return WebResponse(render_page(page, foot, **self._around), status=page.status, referrer=referrer)
