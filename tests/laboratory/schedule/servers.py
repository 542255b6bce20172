"""Servers of this computer that take messages: mail by aiosmtpd, the web by http.server, with a certificate made for them."""

from __future__ import annotations

import contextlib
import shutil
import socket
import ssl
import subprocess
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from email.message import Message as Letter
from email.parser import BytesParser
from email.policy import default
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import pytest

HOST = "localhost"


def certificate(folder: Path) -> tuple[Path, Path]:
    openssl = shutil.which("openssl")
    if openssl is None:
        pytest.skip("no openssl is installed")
    made = folder / "certificate.pem", folder / "key.pem"
    subprocess.run(
        [openssl, "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2", "-subj",
         f"/CN={HOST}", "-addext", f"subjectAltName=DNS:{HOST},IP:127.0.0.1", "-keyout", made[1], "-out", made[0]],
        check=True, capture_output=True,
    )  # fmt: skip
    return made


def serving(pair: tuple[Path, Path]) -> ssl.SSLContext:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(*pair)
    return context


@dataclass(eq=False)
class Post:
    letters: list[Letter] = field(default_factory=list)
    refused: frozenset[str] = frozenset()
    logins: list[tuple[str, str]] = field(default_factory=list)
    password: str = ""

    async def handle_RCPT(self, server: Any, session: Any, envelope: Any, address: str, options: Any) -> str:  # noqa: N802
        if address in self.refused:
            return "550 no such user"
        envelope.rcpt_tos.append(address)
        return "250 OK"

    async def handle_DATA(self, server: Any, session: Any, envelope: Any) -> str:  # noqa: N802
        self.letters.append(BytesParser(policy=default).parsebytes(envelope.content))
        return "250 OK"

    def authenticate(self, server: Any, session: Any, envelope: Any, mechanism: str, data: Any) -> Any:
        from aiosmtpd.smtp import AuthResult

        self.logins.append((data.login.decode(), data.password.decode()))
        return AuthResult(success=data.password.decode() == self.password, handled=False)


@contextlib.contextmanager
def mail_server(post: Post, security: str = "none", pair: tuple[Path, Path] | None = None) -> Iterator[int]:
    controller = pytest.importorskip("aiosmtpd.controller")
    further: dict[str, Any] = {}
    if security == "starttls":
        assert pair is not None
        further = {"tls_context": serving(pair), "require_starttls": True}
    if post.password:
        further |= {"authenticator": post.authenticate, "auth_required": True}
    if security == "tls":
        assert pair is not None
        further |= {"ssl_context": serving(pair), "auth_require_tls": False}
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = int(free.getsockname()[1])
    server = controller.Controller(post, hostname="127.0.0.1", port=port, server_hostname=HOST, **further)
    server.start()
    try:
        yield port
    finally:
        server.stop()


@dataclass(eq=False)
class Taken:
    requests: list[tuple[dict[str, str], bytes]] = field(default_factory=list)
    answer: int = 204
    headers: dict[str, str] = field(default_factory=dict)


@contextlib.contextmanager
def web_server(taken: Taken, pair: tuple[Path, Path] | None = None) -> Iterator[int]:

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            taken.requests.append((dict(self.headers), body))
            self.send_response(taken.answer)
            for name, value in taken.headers.items():
                self.send_header(name, value)
            self.end_headers()

        def do_GET(self) -> None:
            taken.requests.append(({}, b"GET"))
            self.send_response(200)
            self.end_headers()

        def log_message(self, *_: Any) -> None:
            return

    server = HTTPServer(("127.0.0.1", 0), Handler)
    if pair is not None:
        server.socket = serving(pair).wrap_socket(server.socket, server_side=True)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    try:
        yield server.server_port
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


@contextlib.contextmanager
def hanging_server(greeting: bytes = b"") -> Iterator[int]:
    held: list[socket.socket] = []
    server = socket.create_server(("127.0.0.1", 0))

    def take() -> None:
        with contextlib.suppress(OSError):
            while True:
                connection, _ = server.accept()
                connection.sendall(greeting)
                held.append(connection)

    thread = threading.Thread(target=take, daemon=True)
    thread.start()
    try:
        yield int(server.getsockname()[1])
    finally:
        with contextlib.suppress(OSError):
            server.shutdown(socket.SHUT_RDWR)
        server.close()
        for connection in held:
            connection.close()
        thread.join(2.0)
