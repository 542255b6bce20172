"""The site: which address gives which page, as HTML, and a page in words for whatever goes wrong.

Records are opened for each request and closed after it, so that a page shows what is there now, and not a file that was
moved, restored or migrated meanwhile.
"""

from __future__ import annotations

import contextlib
import datetime as dt
import threading
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from http import HTTPStatus
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmm_uq import __version__
from cmm_uq.app.serve import trends as drawing
from cmm_uq.app.serve.certificate_page import certificate_page, recorded_file
from cmm_uq.app.serve.checks_page import dropped_page, file_page, integrity_page
from cmm_uq.app.serve.exchange import RefusedRequest, WebRequest, WebResponse
from cmm_uq.app.serve.lists import artefacts_page, certificates_page, diagnoses_page, machine_page, machines_page
from cmm_uq.app.serve.page import Cell, Chart, PageNotice, WebPage, kind
from cmm_uq.app.serve.view import ChainComparing, DueDates, MachineStanding, SiteView, by_rule, overview, problem_of
from cmm_uq.base.errors import CmmUqError, printable
from cmm_uq.base.messages import NOTHING, Text, Verbatim, say
from cmm_uq.certificate.plots import style as plot_style
from cmm_uq.certificate.render import template_folder
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.place import shown
from cmm_uq.laboratory.records.store import Records

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup


CONTENTS: tuple[tuple[str, Text], ...] = (
    ("/", say("Machines")), ("/certificates", say("Certificates")), ("/diagnoses", say("Diagnoses")),
    ("/artefacts", say("Artefacts")), ("/file", say("Check a file")), ("/integrity", say("Integrity")),
)  # fmt: skip
WORDS: dict[str, Text] = {  # what stands around every page
    "site": say("Calibration records"), "skip": say("To the content"), "contents": say("Contents"),
    "above": say("Belongs to"),
}  # fmt: skip


def render_page(page: WebPage, foot: Sequence[Text]) -> bytes:
    template = _environment().get_template("page.html")
    return template.render(page=page, foot=foot, contents=CONTENTS, words=WORDS).encode()


@cache
def style() -> bytes:
    """The style sheet, in the colours of the documents."""
    colours = {**plot_style.COLOURS, "band": plot_style.BAND}
    return _environment().get_template("style.css").render(colour=colours).encode()


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(template_folder() / "serve"), autoescape=True, undefined=StrictUndefined,
        finalize=_visible, trim_blocks=True, lstrip_blocks=True, auto_reload=False,
    )  # fmt: skip
    environment.filters |= {"picture": _picture, "kind": kind}
    return environment


def _visible(value: Any) -> Any:
    """A text with what would turn it round, or hide in it, written as an escape."""
    return printable(str.__str__(value)) if isinstance(value, str) and not hasattr(value, "__html__") else value


def _picture(chart: Chart) -> Markup:
    """A picture with its alternative text; its elements were drawn here, of numbers and escaped words."""
    from markupsafe import Markup, escape

    size, label = f"0 0 {drawing.WIDTH} {drawing.HEIGHT}", escape(printable(chart.alternative))
    return Markup(f'<svg viewBox="{size}" role="img" aria-label="{label}">{chart.svg}</svg>')  # noqa: S704 - nothing in it is from elsewhere


PAGES: Mapping[str, Callable[[SiteView, WebRequest], WebPage | WebResponse]] = {  # what is looked at, by path
    "/": machines_page, "/machine": machine_page, "/certificates": certificates_page, "/certificate": certificate_page,
    "/diagnoses": diagnoses_page, "/artefacts": artefacts_page, "/recorded": recorded_file, "/file": file_page,
    "/integrity": integrity_page,
}  # fmt: skip

# pages with a form that is sent: a browser must say where it comes from, which it does to this site alone
WITH_FORM = ("/file", "/integrity")


class Site:
    """Answers requests; ``where`` as :func:`~cmm_uq.laboratory.records.opening.open_records` takes it."""

    def __init__(
        self, where: str | Path | None = None, *, due: DueDates = by_rule, today: Callable[[], dt.date] = dt.date.today
    ) -> None:
        with open_records(where, read_only=True) as records:  # what is wrong with them is told before anybody looks
            self._where = records.place
        self.place = shown(self._where)  # without a password
        self._due, self._today = due, today
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
            told = say("a fault of the program: {what}", what=Verbatim(f"{type(error).__name__}: {error}"))
            refused = RefusedRequest(HTTPStatus.INTERNAL_SERVER_ERROR, told, say("Please report it"))
        titles = {HTTPStatus.NOT_FOUND: say("Not found"), HTTPStatus.INTERNAL_SERVER_ERROR: say("A fault")}
        head = title or titles.get(refused.status, say("This cannot be shown"))
        problem = say("{problem:capital}.", problem=refused.problem)
        lines = (Cell(say("{fix}.", fix=refused.fix)),) if refused.fix else ()
        notice = PageNotice(problem, "bad", lines)
        return self._rendered(WebPage(head, "", lead=NOTHING, blocks=(notice,), status=refused.status))

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
        return WebResponse(render_page(page, foot), status=page.status, referrer=referrer)
