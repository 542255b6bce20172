"""The site of records: which address gives which page.

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
from http import HTTPStatus
from pathlib import Path
from typing import Literal, NamedTuple

from cmm_uq.app.serve import page as p, view as v
from cmm_uq.app.serve.application import Answer, Application, routed
from cmm_uq.app.serve.certificate_page import certificate_page, files_of, recorded_file
from cmm_uq.app.serve.exchange import LARGEST, RefusedRequest, UploadedFile, WebRequest, WebResponse, read_dropped, to
from cmm_uq.app.serve.lists import (
    artefacts_page,
    certificates_page,
    diagnoses_page,
    machine_page,
    machines_page,
    parts_page,
)
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, number, plural, say
from cmm_uq.base.values import dataclass
from cmm_uq.certificate.document import Standing
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.facts import RecordedCertificate
from cmm_uq.laboratory.records.listing import entry_of
from cmm_uq.laboratory.records.place import shown
from cmm_uq.laboratory.records.store import Records

MOST_CERTIFICATES = 50  # of one number that are compared: it is issued once, and drafted a few times

_SCHEMAS = ("cmm-uq/results/", "cmm-uq/part/")
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
            return str(data["job"]["id"]) if str(data["schema"]).startswith(_SCHEMAS) else ""
        except (ValueError, KeyError, TypeError, RecursionError):
            return ""
    found = (_OF_PDF if content.startswith(b"%PDF") else _OF_PAGE).search(content)
    return html.unescape(found[1].decode("utf-8", "replace")).strip() if found else ""


class CheckVerdict(NamedTuple):
    """What is said first of what was checked."""

    head: Text
    standing: Standing
    lines: list[Text]


def file_page(view: v.SiteView, request: WebRequest) -> p.WebPage:
    request.only(())
    return p.page("file.html", "/file", dropped=None, most=LARGEST // 2**20)


def dropped_page(view: v.SiteView, request: WebRequest) -> p.WebPage:
    request.only(())
    dropped = read_dropped(request)
    known = look_up(view.records, dropped)
    machine = None if known.certificate is None else v.machine_cell(known.certificate.machine)
    return p.page("file.html", "/file", dropped=dropped, most=LARGEST // 2**20, verdict=verdict(known), known=known,
                  one=known.certificate, machine=machine)  # fmt: skip


def verdict(known: FileMatch) -> CheckVerdict:
    lines: list[Text]
    if (one := known.certificate) is None:
        lines = [
            say("Its bytes are not in the records."),
            say("It says that it is {number}, which is not in them either.", number=Verbatim(known.says)) if known.says else
            say("It says no number by which it could be found: it may be of another program, a file beside a "
                "certificate, or damaged."),
        ]  # fmt: skip
        return CheckVerdict(say("Unknown: no certificate of these records"), "open", lines)
    if known.how == "altered":
        lines = [
            say("It says that it is {number}, which is in the records, but its bytes are none of those that were recorded.",
                number=Verbatim(known.says)),
            say("It was changed after it was made, or made again without being recorded here. Do not rely on it."),
        ]  # fmt: skip
        return CheckVerdict(say("Altered: not the file that was recorded"), "bad", lines)
    heads: dict[str, tuple[Text, Standing]] = {
        "released": (say("Known and released"), "good"),
        "draft": (say("Known, but a draft: nobody has released it"), "open"),
        "withdrawn": (say("Known, but withdrawn: do not rely on it"), "bad"),
        "replaced": (say("Known, but replaced by another certificate: do not rely on it"), "bad"),
    }
    head, standing = heads.get(one.state, (say("Known; its state is {state}", state=Verbatim(one.state)), "open"))
    if one.command == "diagnose":
        head, standing = say("Known: a diagnosis, which is no certificate"), "open"
    lines = [say("Its bytes are those that were recorded.")]
    if (warning := p.NOT_MEASURED.get(one.origin)) is not None:
        lines, standing = [*lines, warning], "bad" if standing == "bad" else "open"
    return CheckVerdict(head, standing, lines)


def integrity_page(view: v.SiteView, request: WebRequest) -> p.WebPage:
    """The head of the records, and what the last comparison found."""
    request.only(())
    count, head = view.records.head()
    last, since = view.checking.last, view.checking.since
    kinds = {"chain": say("Entry"), "index": say("Table"), "file": say("File"), "missing": say("Missing file")}
    kinds |= {"clock": say("Clock"), "schema": say("Database")}
    rows = tuple(
        (p.Cell(say("Entry {number}", number=number(one.entry)) if one.entry is not None else say("Records")),
         p.Cell(kinds.get(one.kind, Verbatim(one.kind))), p.Cell(Verbatim(one.problem)))
        for one in (last.findings if last is not None and not last.failed else ())
    )  # fmt: skip
    more = (
        (say("Shown are the first {most}.", most=number(v.MOST)),)
        if last is not None and last.count > len(rows)
        else ()
    )
    headings = p.columns(say("Where"), say("What"), say("Finding"))
    findings = p.PageTable(say("What is not as it was recorded"), headings, rows, notes=more)
    return p.page(
        "integrity.html", "/integrity", verdict=_compared(last, (count, head)), findings=findings, count=count, head=head,
        records=Verbatim(shown(view.records.place)), since=None if since is None else p.moment(since),
    )  # fmt: skip


def _compared(last: v.ChainComparison | None, head: tuple[int, str]) -> CheckVerdict:
    if last is None:
        return CheckVerdict(say("Not compared since cmm-uq serve was started"), "open", [])
    at = say("Compared on {moment}, {what}, up to entry {number}.", moment=p.moment(last.at), number=number(last.head[0]),
             what=say("with all files") if last.files else say("without files"))  # fmt: skip
    later: list[Text] = [say("Entries were added since.")] if last.head != head else []
    if last.failed:
        return CheckVerdict(say("The records could not be compared"), "bad", [Verbatim(last.failed), at])
    if not last.count:
        return CheckVerdict(say("The records agree with their chain"), "good", [at, *later])
    found = plural(last.count, one=say("One thing is not as it was recorded"),
                   many=say("{count} things are not as they were recorded", count=number(last.count, ",d")))  # fmt: skip
    return CheckVerdict(found, "bad", [at, *later])


def comparing(view: v.SiteView, request: WebRequest) -> WebResponse:
    request.only(())
    view.checking.begin(files=request.path.endswith("files"))
    return to("/integrity")


PAGES: Mapping[str, Callable[[v.SiteView, WebRequest], Answer]] = {  # what is looked at, by path
    "/": machines_page, "/machine": machine_page, "/certificates": certificates_page, "/certificate": certificate_page,
    "/diagnoses": diagnoses_page, "/parts": parts_page, "/artefacts": artefacts_page, "/recorded": recorded_file,
    "/file": file_page, "/integrity": integrity_page,
}  # fmt: skip
FORMS: Mapping[str, Callable[[v.SiteView, WebRequest], Answer]] = {
    "/file": dropped_page, "/integrity/chain": comparing, "/integrity/files": comparing,
}  # fmt: skip


class Site(Application):
    """The pages of records; ``where`` as :func:`~cmm_uq.laboratory.records.opening.open_records` takes it."""

    def __init__(
        self,
        where: str | Path | None = None,
        *,
        due: v.DueDates = v.by_rule,
        today: Callable[[], dt.date] = dt.date.today,
    ) -> None:
        with open_records(where, read_only=True) as records:  # what is wrong with them is told before anybody looks
            self._where = records.place
        self.place = shown(self._where)  # without a password
        self._due, self._today = due, today
        self._lock = threading.Lock()
        self._kept: v.MachineOverview | None = None
        self.checking = v.ChainComparing(self.opened)

    def opened(self) -> Records:
        return open_records(self._where, read_only=True)

    def warm(self) -> None:
        """Load what is slow to load and work out how the machines stand, so that no reader waits for it."""
        with contextlib.suppress(CmmUqError):  # whoever looks is told
            self.machines()

    def respond(self, request: WebRequest) -> Answer:
        page = routed(request, PAGES, FORMS)
        try:
            with self.opened() as records:
                today = self._today()
                view = v.SiteView(records, today, lambda: self._standing(records, today), self.checking)
                return page(view, request)
        except CmmUqError as error:
            title = say("The records cannot be read")
            raise RefusedRequest(HTTPStatus.SERVICE_UNAVAILABLE, *v.problem_of(error), title) from None

    def foot(self, page: p.WebPage) -> Text:
        return say("Records: {place}. To be looked at only: nothing here can be changed.", place=Verbatim(self.place))

    def _standing(self, records: Records, today: dt.date) -> v.MachineOverview:
        with self._lock:  # worked out once: who asks meanwhile would only do the same
            if self._kept is None or (self._kept.head, self._kept.today) != (records.head(), today):
                self._kept = v.overview(records, self._due, today, self._kept)
            return self._kept

    def machines(self) -> Sequence[v.MachineStanding]:
        """How every machine stands, the most urgent first."""
        with self.opened() as records:
            return self._standing(records, self._today()).machines
