"""The site and its server: which address gives which page, as HTML, and a page in words for whatever goes wrong.

Records are opened for each request and closed after it, so that a page shows what is there now, and not a file that was
moved, restored or migrated meanwhile. The server takes one request a connection, each with a deadline, as few at a time as a
page for one laboratory needs. It listens on this machine alone unless it is told otherwise, and answers only to its own names:
a page elsewhere that has its own name pointed to this address (DNS rebinding) gets nothing, nor does a form from elsewhere.
"""

from __future__ import annotations

import contextlib
import datetime as dt
import io
import ipaddress
import socket
import threading
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cache
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from socketserver import TCPServer
from typing import TYPE_CHECKING, Any, BinaryIO, cast

from cmm_uq import __version__
from cmm_uq.app.serve import trends as drawing
from cmm_uq.app.serve.certificate_page import certificate_page, recorded_file
from cmm_uq.app.serve.checks_page import dropped_page, file_page, integrity_page
from cmm_uq.app.serve.exchange import RefusedRequest, WebRequest, WebResponse, bad, read_address
from cmm_uq.app.serve.lists import artefacts_page, certificates_page, diagnoses_page, machine_page, machines_page
from cmm_uq.app.serve.page import Cell, Chart, PageNotice, WebPage, kind
from cmm_uq.app.serve.view import ChainComparing, DueDates, MachineStanding, SiteView, by_rule, overview, problem_of
from cmm_uq.base.errors import CmmUqError, OutputError, printable
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
        """The records, to be read."""
        return open_records(self._where, read_only=True)

    def warm(self) -> None:
        """Load what is slow to load and work out how the machines stand, so that no reader waits for it."""
        with contextlib.suppress(CmmUqError):  # whoever looks is told
            self.machines()

    def answer(self, request: WebRequest | RefusedRequest) -> WebResponse:
        """The answer to a request, whatever happens."""
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

    def forget(self) -> None:
        """Work out anew how the machines stand when it is next asked for, as after a new entry."""
        with self._lock:
            self._kept = None

    def _rendered(self, page: WebPage) -> WebResponse:
        foot = (
            say("Records: {place}. To be looked at only: nothing here can be changed.", place=Verbatim(self.place)),
            say("cmm-uq {version}", version=Verbatim(__version__)),
        )
        referrer = "same-origin" if page.place in WITH_FORM else "no-referrer"
        return WebResponse(render_page(page, foot), status=page.status, referrer=referrer)


HEAD_S, BODY_S, ANSWER_S = 10.0, 60.0, 60.0
"""Seconds that a browser has to send its request's head, to send a file, and to take its answer."""

AT_ONCE = 32  # requests that are answered at the same time; further ones are turned away
LOOPBACK = ("localhost", "127.0.0.1", "[::1]")
Answering = Callable[[WebRequest | RefusedRequest], WebResponse]  # given a request, or why it is none; never raises


class RecordsServer(ThreadingHTTPServer):
    """Answers browsers until it is closed.

    ``answer``: gives the page of a request; ``port``: 0 takes a free one; ``names``: further names under which
    browsers reach this machine.
    """

    daemon_threads = True
    request_queue_size = 64
    allow_reuse_address = not hasattr(socket, "SO_EXCLUSIVEADDRUSE")  # on Windows it would let two servers share a port

    def __init__(self, answer: Answering, *, bind: str = "127.0.0.1", port: int = 8765, names: Collection[str] = ()):
        self.answer, self._room = answer, threading.BoundedSemaphore(AT_ONCE)
        try:
            address = ipaddress.ip_address(bind)
        except ValueError:
            raise CmmUqError(
                "is no address of a network card", where=f"--bind {bind}",
                fix="127.0.0.1 is this machine alone, 0.0.0.0 every network that it is in",
            ) from None  # fmt: skip
        self.address_family = socket.AF_INET6 if address.version == 6 else socket.AF_INET
        self.alone = address.is_loopback
        try:
            super().__init__((bind, port), _Handler)
        except OSError as error:
            taken = f"--port {port}"
            fix = "Name another port with --port" if port else "Name another address with --bind"
            raise OutputError(f"cannot be listened on: {error.strerror or error}", where=taken, fix=fix) from None
        own = {f"[{bind}]" if address.version == 6 else bind, *LOOPBACK, *(name.lower() for name in names)}
        self.names = own if self.alone else own | {socket.gethostname().lower()}

    def server_bind(self) -> None:
        """Bind without asking the network for this machine's name, which may take seconds."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = str(self.server_address[0]), int(self.server_address[1])

    @property
    def url(self) -> str:
        """Where a browser on this machine finds it."""
        host = self.server_name
        if ipaddress.ip_address(host).is_unspecified:
            host = "127.0.0.1"
        return f"http://{f'[{host}]' if ':' in host else host}:{self.server_port}/"

    def answers_to(self, host: str) -> bool:
        """Whether a Host header names this server; beyond this machine any number will do, which no rebinding can forge."""
        name, _, port = host.lower().rpartition(":") if not host.endswith("]") else (host.lower(), "", "")
        if not name:
            name, port = port, ""
        if (port or "80") != str(self.server_port):
            return False
        if name in self.names:
            return True
        with contextlib.suppress(ValueError):
            return not self.alone and bool(ipaddress.ip_address(name.strip("[]")))
        return False

    def process_request(self, request: Any, client_address: Any) -> None:
        """In a thread of its own, unless too many are at work."""
        if self._room.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """As the standard library does, and make room afterwards."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._room.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that went away is no event."""


class _Timed(io.RawIOBase):
    """What comes from a socket, until a deadline: a browser that sends a byte now and then is cut off too."""

    def __init__(self, connection: socket.socket, seconds: float) -> None:
        self._connection, self._until = connection, time.monotonic() + seconds

    def allow(self, seconds: float) -> None:
        self._until = time.monotonic() + seconds

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        left = self._until - time.monotonic()
        if left <= 0:
            raise TimeoutError
        self._connection.settimeout(left)
        return self._connection.recv_into(buffer)


class _Handler(BaseHTTPRequestHandler):
    server: RecordsServer
    protocol_version = "HTTP/1.1"

    def setup(self) -> None:
        super().setup()
        self._timed = _Timed(self.connection, HEAD_S)
        self.rfile = cast("io.BufferedIOBase", io.BufferedReader(self._timed, 2**16))

    def finish(self) -> None:
        with contextlib.suppress(OSError):  # it went away before it had its answer
            super().finish()

    def version_string(self) -> str:
        return f"cmm-uq/{__version__}"

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002 - the standard library's name
        """Nothing: who looked at what is nobody's business."""

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """What the standard library refuses (a malformed request, another method), in the site's words."""
        status = HTTPStatus.METHOD_NOT_ALLOWED if code == HTTPStatus.NOT_IMPLEMENTED else HTTPStatus(code)
        told = say("the request cannot be read: {why}", why=Verbatim(status.phrase.lower()))
        if status == HTTPStatus.METHOD_NOT_ALLOWED:
            told = say("this page can only be looked at")
        self._send(self.server.answer(RefusedRequest(status, told)))

    def do_GET(self) -> None:
        try:
            request: WebRequest | RefusedRequest = self._posted() if self.command == "POST" else self._asked()
        except RefusedRequest as refused:
            request = refused
        self._send(self.server.answer(request))

    do_HEAD = do_POST = do_GET  # noqa: N815 - names of the standard library

    def _asked(self) -> WebRequest:
        hosts = self.headers.get_all("Host", [])
        if len(hosts) != 1 or not self.server.answers_to(hosts[0].strip()):
            raise RefusedRequest(
                HTTPStatus.MISDIRECTED_REQUEST, say("this page is not known by that name"),
                say("Open {url}", url=Verbatim(self.server.url)),
            )  # fmt: skip
        path, query = read_address(self.path)
        headers = {name.lower(): value for name, value in self.headers.items()}
        return WebRequest(self.command, path, query, headers)

    def _posted(self) -> WebRequest:
        asked = self._asked()
        origin = asked.headers.get("origin")
        host = f"http://{asked.headers['host'].strip().lower()}"
        site = asked.headers.get("sec-fetch-site", "same-origin")
        if (origin is not None and origin.lower() != host) or site != "same-origin":
            raise RefusedRequest(HTTPStatus.FORBIDDEN, say("the form was sent from another site"))
        given = self.headers.get_all("Content-Length", [])
        if len(given) != 1 or not (given[0].isascii() and given[0].isdigit()) or "transfer-encoding" in asked.headers:
            raise RefusedRequest(HTTPStatus.LENGTH_REQUIRED, say("the request does not say how long it is"))
        if len(given[0]) > 15:
            raise bad(say("the request says that it is longer than anything"))
        self._timed.allow(BODY_S)
        body = cast("BinaryIO", self.rfile)
        return WebRequest(asked.method, asked.path, asked.query, asked.headers, body, int(given[0]))

    def _send(self, answer: WebResponse) -> None:
        """All of it within its time; then the connection is closed, after what still comes has been let go."""
        self.close_connection = True
        self.connection.settimeout(ANSWER_S)
        self.send_response(answer.status)
        for name, value in answer.all_headers().items():
            self.send_header(name, value)
        self.send_header("Connection", "close")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(answer.body)
        if self.command == "POST" and answer.status >= HTTPStatus.BAD_REQUEST:
            self._let_go()

    def _let_go(self) -> None:
        """Take the rest of a refused file without looking: a browser that cannot send it on would not show why."""
        with contextlib.suppress(OSError):
            self.connection.shutdown(socket.SHUT_WR)
            self._timed.allow(ANSWER_S)
            while self.rfile.read(2**16):
                pass
