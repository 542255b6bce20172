"""The site: which address gives which page, as HTML, and a page in words for whatever goes wrong.

Records are opened for each request and closed after it, so that a page shows what is there now, and not a file that was
moved, restored or migrated meanwhile.
"""

from __future__ import annotations

import contextlib
import datetime as dt
import threading
from collections.abc import Callable, Mapping, Sequence
from http import HTTPStatus
from pathlib import Path

from cmm_uq import __version__
from cmm_uq.app.serve.certificate_page import certificate_page, recorded_file
from cmm_uq.app.serve.checks_page import dropped_page, file_page, integrity_page
from cmm_uq.app.serve.exchange import RefusedRequest, WebRequest, WebResponse
from cmm_uq.app.serve.lists import artefacts_page, certificates_page, diagnoses_page, machine_page, machines_page
from cmm_uq.app.serve.page import WebPage
from cmm_uq.app.serve.rendering import fault, refusal, render_page, style
from cmm_uq.app.serve.view import ChainComparing, DueDates, MachineStanding, SiteView, by_rule, overview, problem_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Verbatim, say
from cmm_uq.certificate.look import template_folder
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.place import shown
from cmm_uq.laboratory.records.store import Records

PAGES: Mapping[str, Callable[[SiteView, WebRequest], WebPage | WebResponse]] = {  # what is looked at, by path
    "/": machines_page, "/machine": machine_page, "/certificates": certificates_page, "/certificate": certificate_page,
    "/diagnoses": diagnoses_page, "/artefacts": artefacts_page, "/recorded": recorded_file, "/file": file_page,
    "/integrity": integrity_page,
}  # fmt: skip

# pages with a form that is sent: a browser must say where it comes from, which it does to this site alone
WITH_FORM = ("/file", "/integrity")


class Site:
    """Answers requests; ``where`` as :func:`~cmm_uq.laboratory.records.opening.open_records` takes it.

    ``desk``, ``account``: what surrounds its pages (:func:`~cmm_uq.app.serve.rendering.render_page`).
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

    def _rendered(self, page: WebPage) -> WebResponse:
        foot = (
            say("Records: {place}. To be looked at only: nothing here can be changed.", place=Verbatim(self.place)),
            say("cmm-uq {version}", version=Verbatim(__version__)),
        )
        referrer = "same-origin" if page.place in WITH_FORM else "no-referrer"
        return WebResponse(render_page(page, foot, **self._around), status=page.status, referrer=referrer)
