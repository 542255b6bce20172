"""The server at real sockets: it answers to its own names, reads what it asked for, and waits for nobody."""

from __future__ import annotations

import re
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from cmm_uq.app.serve import server
from cmm_uq.app.serve.exchange import WebResponse
from cmm_uq.app.serve.server import RecordsServer
from cmm_uq.base.errors import CmmUqError, OutputError
from tests.app.serve.laboratory import files
from tests.app.serve.test_exchange import BOUNDARY, form

Host = tuple[str, int]


def spoken(host: Host, request: bytes, *, wait: float = 10.0) -> bytes:
    with closing(socket.create_connection(host, timeout=wait)) as line:
        line.sendall(request)
        found = b""
        while block := line.recv(65536):
            found += block
    return found


def head(host: Host, *lines: str, method: str = "GET", path: str = "/", name: str = "") -> bytes:
    own = name or f"{host[0]}:{host[1]}"
    return "\r\n".join([f"{method} {path} HTTP/1.1", f"Host: {own}", *lines, "", ""]).encode()


def status(answer: bytes) -> int:
    found = re.match(rb"HTTP/1\.1 (\d{3}) ", answer)
    assert found is not None, answer[:200]
    return int(found[1])


def dropped(host: Host, *lines: str, content: bytes = b"x", path: str = "/file") -> bytes:
    body = form(content)
    told = (f"Content-Type: multipart/form-data; boundary={BOUNDARY}", f"Content-Length: {len(body)}", *lines)
    return head(host, *told, method="POST", path=path) + body


def test_every_answer_forbids_what_the_page_does_not_need(host: Host) -> None:
    for path in ("/", "/style.css", "/nowhere", "/file"):
        sent = spoken(host, head(host, path=path)).partition(b"\r\n\r\n")[0].decode().lower()
        for line in ("x-content-type-options: nosniff", "x-frame-options: deny", "cache-control: no-store",
                     "content-security-policy: default-src 'none'", "cross-origin-resource-policy: same-origin"):  # fmt: skip
            assert line in sent, path
        assert "unsafe" not in sent
        assert "set-cookie" not in sent
        assert f"referrer-policy: {'same-origin' if path == '/file' else 'no-referrer'}" in sent


@pytest.mark.parametrize("name", ["evil.example", "evil.example:{port}", "127.0.0.1", "127.0.0.1:1", "10.0.0.1:{port}",
                                  "localhost.evil.example:{port}", "", "[::2]:{port}", "127.0.0.1:{port}:1"])  # fmt: skip
def test_a_name_that_is_not_its_own_gets_nothing(host: Host, name: str) -> None:
    """DNS rebinding: a page elsewhere whose name is pointed to this address asks under that name."""
    answer = spoken(host, b"GET / HTTP/1.1\r\nHost: " + name.format(port=host[1]).encode() + b"\r\n\r\n")
    assert status(answer) == 421
    assert b"K1" not in answer


def test_it_answers_to_its_own_names(host: Host) -> None:
    for name in ("localhost", "127.0.0.1", "[::1]", "LOCALHOST"):
        assert status(spoken(host, head(host, name=f"{name}:{host[1]}"))) == 200


def test_two_names_are_none(host: Host) -> None:
    assert status(spoken(host, head(host, "Host: evil.example"))) == 421
    assert status(spoken(host, b"GET / HTTP/1.1\r\n\r\n")) == 421


@pytest.mark.parametrize("line", ["Origin: http://evil.example", "Origin: null", "Sec-Fetch-Site: cross-site",
                                  "Origin: http://127.0.0.1:1"])  # fmt: skip
def test_a_form_sent_from_elsewhere_is_refused(host: Host, line: str) -> None:
    assert status(spoken(host, dropped(host, line))) == 403
    assert status(spoken(host, dropped(host, line, path="/integrity/chain"))) == 403


def test_the_site_s_own_form_is_taken(host: Host) -> None:
    lines = (f"Origin: http://{host[0]}:{host[1]}", "Sec-Fetch-Site: same-origin")
    answer = spoken(host, dropped(host, *lines, content=files("k-1")["certificate.pdf"]))
    assert status(answer) == 200
    assert b"Known and released" in answer


@pytest.mark.parametrize("method", ["PUT", "DELETE", "PATCH", "OPTIONS", "TRACE", "CONNECT", "BREW"])
def test_it_can_only_be_looked_at(host: Host, method: str) -> None:
    answer = spoken(host, head(host, method=method))
    assert status(answer) == 405
    assert b"can only be looked at" in answer


def test_nothing_but_a_file_and_a_comparison_can_be_sent(host: Host) -> None:
    for path in ("/", "/certificates", "/recorded", "/nowhere", "/integrity"):
        assert status(spoken(host, dropped(host, path=path))) == 405


def test_a_head_has_no_body(host: Host) -> None:
    whole, short = (spoken(host, head(host, method=method)) for method in ("GET", "HEAD"))
    body = whole.partition(b"\r\n\r\n")[2]
    assert short.endswith(b"\r\n\r\n")
    assert f"content-length: {len(body)}".encode() in short.lower()


@pytest.mark.parametrize("request_", [
    b"nonsense\r\n\r\n", b"GET / HTTP/9.9\r\n\r\n", b"\x16\x03\x01\x02\x00\r\n\r\n",
    b"GET /" + b"a" * 70_000 + b" HTTP/1.1\r\n\r\n",
    b"GET / HTTP/1.1\r\n" + b"".join(b"A%d: b\r\n" % i for i in range(200)) + b"\r\n",
])  # fmt: skip
def test_what_is_no_request_is_refused_in_words(host: Host, request_: bytes) -> None:
    answer = spoken(host, request_)
    assert b"cannot be read" in answer
    assert b"Traceback" not in answer


@pytest.mark.parametrize("lines", [
    (), ("Content-Length: x",), ("Content-Length: 1", "Content-Length: 2"), ("Transfer-Encoding: chunked",),
    ("Transfer-Encoding: chunked", "Content-Length: 1"), ("Content-Length: -1",),
])  # fmt: skip
def test_a_form_without_a_length_is_not_read(host: Host, lines: tuple[str, ...]) -> None:
    with closing(socket.create_connection(host, timeout=10)) as line:
        line.sendall(head(host, *lines, method="POST", path="/file"))
        assert status(line.recv(65536)) == 411


def test_a_huge_file_is_refused_at_once(host: Host) -> None:
    told = (f"Content-Type: multipart/form-data; boundary={BOUNDARY}", f"Content-Length: {10**14}")
    began = time.monotonic()
    with closing(socket.create_connection(host, timeout=10)) as line:
        line.sendall(head(host, *told, method="POST", path="/file"))
        assert status(line.recv(65536)) == 413
    assert time.monotonic() - began < 5


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> Iterator[Host]:
    import threading

    for name, value in {"HEAD_S": 0.4, "BODY_S": 0.4, "ANSWER_S": 0.4, "AT_ONCE": 2}.items():
        monkeypatch.setattr(server, name, value)

    def answer(asked: object) -> WebResponse:
        body = getattr(asked, "body", None)
        try:
            return WebResponse(body.read(5) if body is not None else b"x" * 50_000_000)
        except TimeoutError:
            return WebResponse(b"too slow")

    with RecordsServer(answer, port=0) as made:
        thread = threading.Thread(target=made.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
        thread.start()
        yield "127.0.0.1", made.server_port
        made.shutdown()


def closed_after(line: socket.socket, drip: bytes = b"") -> float:
    began = time.monotonic()
    line.settimeout(0.05)
    while time.monotonic() - began < 5:
        try:
            if drip:
                line.sendall(drip)
            if not line.recv(4096):
                break
        except TimeoutError:
            continue
        except OSError:
            break
    return time.monotonic() - began


def test_a_browser_that_says_nothing_or_a_byte_at_a_time_is_cut_off(hasty: Host) -> None:
    """Each byte comes long before any time-out for a byte: what is limited is the whole request."""
    for begin, drip in (
        (b"", b""),
        (b"GET / HTTP/1.1\r\n", b"A"),
        (head(hasty, "Content-Length: 99", method="POST"), b"x"),
    ):
        with closing(socket.create_connection(hasty)) as line:
            line.sendall(begin)
            assert closed_after(line, drip) < 3


def test_a_browser_that_takes_nothing_is_cut_off_and_others_are_served(hasty: Host) -> None:
    with closing(socket.create_connection(hasty)) as idle:
        idle.sendall(head(hasty))
        time.sleep(1.0)
        assert status(spoken(hasty, head(hasty, method="HEAD"))) == 200


def test_more_than_it_has_room_for_are_turned_away(hasty: Host) -> None:
    waiting = [socket.create_connection(hasty) for _ in range(2)]
    time.sleep(0.1)
    with closing(socket.create_connection(hasty, timeout=5)) as third:
        assert third.recv(10) == b""
    for line in waiting:
        line.close()


def test_a_port_that_is_taken_is_said_so(host: Host) -> None:
    with pytest.raises(OutputError, match=rf"--port {host[1]}: cannot be listened on.*Name another port"):
        RecordsServer(lambda asked: WebResponse(b""), port=host[1])


def test_an_address_must_be_one() -> None:
    with pytest.raises(CmmUqError, match="--bind lab-pc: is no address of a network card"):
        RecordsServer(lambda asked: WebResponse(b""), bind="lab-pc", port=0)


def test_beyond_this_machine_it_answers_to_numbers_and_to_names_that_it_was_told() -> None:
    """A number cannot be rebound; any other name could be."""
    with RecordsServer(lambda asked: WebResponse(b""), bind="0.0.0.0", port=0, names=["Lab.example"]) as made:
        port = made.server_port
        assert not made.alone
        assert made.answers_to(f"192.0.2.7:{port}")
        assert made.answers_to(f"[2001:db8::1]:{port}")
        assert made.answers_to(f"lab.example:{port}")
        assert made.answers_to(f"{socket.gethostname()}:{port}")
        assert not made.answers_to(f"evil.example:{port}")
        assert not made.answers_to("192.0.2.7")
        assert made.url == f"http://127.0.0.1:{port}/"


@pytest.mark.long
def test_ctrl_c_ends_it_at_once_and_says_so(laboratory: Path) -> None:
    import signal

    line = [sys.executable, "-m", "cmm_uq", "serve", "--records", str(laboratory), "--port", "0"]
    with subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as running:
        assert running.stdout is not None
        assert running.stderr is not None
        said = running.stdout.readline()
        found = re.search(r"at (http://127\.0\.0\.1:(\d+)/) until Ctrl-C", said)
        assert found is not None, running.stderr.read()
        with closing(socket.create_connection(("127.0.0.1", int(found[2])))) as idle:
            idle.sendall(b"GET / ")
            began = time.monotonic()
            running.send_signal(signal.SIGINT)
            assert running.wait(timeout=10) == 130
            assert time.monotonic() - began < 2
        assert running.stderr.read() == "cmm-uq: interrupted; the page is closed\n"
