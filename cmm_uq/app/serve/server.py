"""The server of the pages of records: connections, their deadlines, and to whom it answers.

It takes one request a connection, each with deadlines, as few at a time as a page for one laboratory needs, and of these few
from one address. It listens on this machine alone unless it is told otherwise, and answers only to its own names: a page
elsewhere that has its own name pointed to this address (DNS rebinding) gets nothing, nor does a form from elsewhere.
"""

from __future__ import annotations

import contextlib
import io
import ipaddress
import math
import socket
import ssl
import threading
import time
from collections.abc import Callable, Collection
from dataclasses import replace
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from socketserver import TCPServer
from typing import Any, BinaryIO, cast

from cmm_uq import __version__
from cmm_uq.app.serve.exchange import RefusedRequest, WebRequest, WebResponse, bad, read_address
from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.messages import Verbatim, say

HEAD_S, BODY_S, ANSWER_S = 10.0, 60.0, 60.0
"""Seconds that a browser has to send its request's head, to send a file, and to take its answer."""

AT_ONCE, OF_ONE_PEER = 64, 32  # connections at the same time, in all and of one address
GRACE_S = 1.0  # for which a browser may keep its place waiting when another needs it
LOOPBACK = ("localhost", "127.0.0.1", "[::1]")
Answering = Callable[[WebRequest | RefusedRequest], WebResponse]  # given a request, or why it is none; never raises


class RecordsServer(ThreadingHTTPServer):
    """Answers browsers until it is closed.

    ``answer``: gives the page of a request; ``port``: 0 takes a free one; ``names``: further names under which
    browsers reach this machine; ``tls``: with which it is spoken with in secret.
    """

    daemon_threads = True
    request_queue_size = 64
    allow_reuse_address = not hasattr(socket, "SO_EXCLUSIVEADDRUSE")  # on Windows it would let two servers share a port

    def __init__(
        self,
        answer: Answering,
        bind: str = "127.0.0.1",
        port: int = 8765,
        names: Collection[str] = (),
        tls: ssl.SSLContext | None = None,
    ):
        self.answer, self.tls, self._lock = answer, tls, threading.Lock()
        self._open: dict[Any, tuple[str | int, float]] = {}  # whose, and since when it waits for its browser
        try:
            address = ipaddress.ip_address(bind)
        except ValueError:
            raise CmmUqError(
                "is no address of a network card",
                where=f"--bind {bind}",
                fix="127.0.0.1 is this machine alone, 0.0.0.0 every network that it is in",
            ) from None
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
        host = self.server_name
        if ipaddress.ip_address(host).is_unspecified:
            host = "127.0.0.1"
        return f"{self.scheme}://{f'[{host}]' if ':' in host else host}:{self.server_port}/"

    @property
    def scheme(self) -> str:
        return "http" if self.tls is None else "https"

    def get_request(self) -> tuple[socket.socket, Any]:
        """A connection; of one in secret nothing was said yet, so that no slow browser holds up the next."""
        connection, address = super().get_request()
        if self.tls is not None:
            connection = self.tls.wrap_socket(connection, server_side=True, do_handshake_on_connect=False)
        return connection, address

    def answers_to(self, host: str) -> bool:
        """Whether a Host header names this server; beyond this machine any number will do, which no rebinding can forge."""
        name, _, port = host.lower().rpartition(":") if not host.endswith("]") else (host.lower(), "", "")
        if not name:
            name, port = port, ""
        if (port or ("80" if self.tls is None else "443")) != str(self.server_port):
            return False
        if name in self.names:
            return True
        with contextlib.suppress(ValueError):
            return not self.alone and bool(ipaddress.ip_address(name.strip("[]")))
        return False

    def process_request(self, request: Any, client_address: Any) -> None:
        """In a thread of its own; where there are too many, the one whose browser has kept it waiting longest is cut off.

        Whose a connection is, its address says, and no header that somebody may write.
        """
        peer, now = peer_of(client_address[0]), time.monotonic()
        with self._lock:
            many = [one for one, (whose, _) in self._open.items() if whose == peer]
            if len(many) < OF_ONE_PEER:
                many = list(self._open) if len(self._open) >= AT_ONCE else []
            slowest = min(many, key=lambda one: self._open[one][1], default=None)
            room = slowest is None or now - self._open[slowest][1] > GRACE_S
            if room and slowest is not None:
                del self._open[slowest]
                with contextlib.suppress(OSError):
                    slowest.shutdown(socket.SHUT_RDWR)
            if room:
                self._open[request] = peer, now
        if room:
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def shutdown_request(self, request: Any) -> None:
        """Of a connection that has ended, however it did."""
        with self._lock:
            self._open.pop(request, None)
        super().shutdown_request(request)

    def waits(self, request: Any, since: float) -> None:
        """From when on a connection waits for its browser: never, while its page is worked out."""
        with self._lock:
            if request in self._open:
                self._open[request] = self._open[request][0], since

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that went away is no event."""


def peer_of(host: str) -> str | int:
    """Whose an address is; of IPv6 its first half, since one network has all of the second."""
    address = ipaddress.ip_address(host.partition("%")[0])
    return int(address) >> 64 if isinstance(address, ipaddress.IPv6Address) and not address.ipv4_mapped else host


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
        if isinstance(self.request, ssl.SSLSocket):
            self.request.settimeout(HEAD_S)
            self.request.do_handshake()
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
        if self.command != "POST":  # a file comes while it is answered
            self.server.waits(self.connection, math.inf)
        answer = self.server.answer(request)
        self.server.waits(self.connection, time.monotonic())
        self._send(answer)

    do_HEAD = do_POST = do_GET  # noqa: N815 - names of the standard library

    def _asked(self) -> WebRequest:
        hosts = self.headers.get_all("Host", [])
        if len(hosts) != 1 or not self.server.answers_to(hosts[0].strip()):
            raise RefusedRequest(
                HTTPStatus.MISDIRECTED_REQUEST,
                say("this page is not known by that name"),
                say("Open {url}", url=Verbatim(self.server.url)),
            )
        path, query = read_address(self.path)
        headers = {name.lower(): value for name, value in self.headers.items()}
        return WebRequest(self.command, path, query, headers, peer=self.client_address[0])

    def _posted(self) -> WebRequest:
        asked = self._asked()
        origin = asked.headers.get("origin")
        host = f"{self.server.scheme}://{asked.headers['host'].strip().lower()}"
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
        return replace(asked, body=body, length=int(given[0]))

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
            for part in answer.stream or ():
                self.wfile.write(part)
        if self.command == "POST" and answer.status >= HTTPStatus.BAD_REQUEST:
            self._let_go()

    def _let_go(self) -> None:
        """Take the rest of a refused file without looking: a browser that cannot send it on would not show why."""
        with contextlib.suppress(OSError):
            self.connection.shutdown(socket.SHUT_WR)
            self._timed.allow(ANSWER_S)
            while self.rfile.read(2**16):
                pass
