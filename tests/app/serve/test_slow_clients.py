"""Forty browsers that are slow, silent or half gone hold up nobody else: real sockets, and one that is served meanwhile."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing

import pytest

from cmm_uq.app.serve import server
from cmm_uq.app.serve.exchange import RefusedRequest, WebRequest, WebResponse
from cmm_uq.app.serve.server import RecordsServer
from tests.app.serve.test_server import Host, closed_after, head, spoken, status

FORTY = 40
LARGE = bytes(20_000_000)  # more than the buffers of a socket hold
OTHER = "127.0.0.2"  # another address of this machine, as if of another one


def answer(asked: WebRequest | RefusedRequest) -> WebResponse:
    if isinstance(asked, RefusedRequest):
        return WebResponse(b"refused", status=asked.status)
    if asked.path == "/computed":
        time.sleep(2.0)
    if asked.body is not None:
        return WebResponse(asked.body.read(asked.length))
    return WebResponse(LARGE if asked.path == "/large" else b"page")


@pytest.fixture
def host() -> Iterator[Host]:
    with RecordsServer(answer, port=0) as made:
        thread = threading.Thread(target=made.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
        thread.start()
        yield "127.0.0.1", made.server_port
        made.shutdown()


def from_elsewhere(host: Host, source: str, *, path: str = "/", wait: float = 2.0) -> bytes:
    """What a browser at an address of its own is answered; nothing where it is turned away."""
    try:
        line = socket.create_connection(host, timeout=wait, source_address=(source, 0))
    except OSError:
        pytest.skip("this system has one loopback address")
    with closing(line), contextlib.suppress(ConnectionError):
        line.sendall(head(host, path=path))
        found = b""
        while block := line.recv(65536):
            found += block
        return found
    return b""


SLOW: dict[str, tuple[Callable[[Host], bytes], bytes]] = {
    "a head byte by byte": (lambda host: b"GET / HTTP/1.1\r\nX: ", b"a"),
    "a body byte by byte": (lambda host: head(host, "Content-Length: 100000", method="POST", path="/file"), b"a"),
    "an answer that nobody takes": (lambda host: head(host, path="/large"), b""),
    "nothing at all": (lambda host: b"", b""),
    "half a request, and no more": (lambda host: b"GET / HTTP/1.1\r\nHost: ", b""),
}


@contextlib.contextmanager
def slow_browsers(host: Host, kind: str, source: str = "127.0.0.1") -> Iterator[list[socket.socket]]:
    begin, drip = SLOW[kind]
    over = threading.Event()
    with ExitStack() as stack:
        lines = []
        for _ in range(FORTY):
            line = stack.enter_context(closing(socket.create_connection(host, timeout=5, source_address=(source, 0))))
            with contextlib.suppress(ConnectionError):  # one that was turned away
                line.sendall(begin(host))
            lines.append(line)

        def keep_on() -> None:
            while drip and not over.wait(0.05):
                for line in lines:
                    with contextlib.suppress(OSError):
                        line.send(drip)

        thread = threading.Thread(target=keep_on)
        thread.start()
        try:
            yield lines
        finally:
            over.set()
            thread.join()


@pytest.mark.parametrize("kind", SLOW)
def test_while_forty_are_slow_another_is_served_at_once(host: Host, kind: str) -> None:
    """All from one address; who asks from another has room from the first moment on."""
    with slow_browsers(host, kind):
        for _ in range(5):
            assert status(from_elsewhere(host, OTHER)) == 200
            time.sleep(0.1)


@pytest.mark.long
@pytest.mark.parametrize("kind", SLOW)
def test_one_at_the_same_address_takes_the_place_of_the_slowest(host: Host, kind: str) -> None:
    """As behind a proxy, where all have one address."""
    with slow_browsers(host, kind):
        time.sleep(server.GRACE_S + 0.2)
        for _ in range(5):
            assert status(spoken(host, head(host), wait=2.0)) == 200


def test_no_header_gives_a_browser_another_address(host: Host) -> None:
    """Whoever says that it speaks for others is counted as itself."""
    with ExitStack() as stack:
        lines = [stack.enter_context(closing(socket.create_connection(host, timeout=2))) for _ in range(FORTY)]
        for i, line in enumerate(lines):
            with contextlib.suppress(OSError):
                line.sendall(
                    f"GET / HTTP/1.1\r\nX-Forwarded-For: 192.0.2.{i}\r\nForwarded: for=192.0.2.{i}\r\n".encode()
                )
        turned_away = [line for line in lines[server.OF_ONE_PEER :] if gone(line)]
        assert len(turned_away) == FORTY - server.OF_ONE_PEER


def gone(line: socket.socket) -> bool:
    try:
        return line.recv(10) == b""
    except TimeoutError:
        return False
    except ConnectionError:
        return True


@pytest.mark.long
def test_no_more_are_open_than_there_is_room_for_however_many_addresses_ask(
    host: Host, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server, "AT_ONCE", 10)
    with ExitStack() as stack:
        lines = []
        for i in range(20):
            try:
                made = socket.create_connection(host, timeout=2, source_address=(f"127.0.0.{i + 2}", 0))
            except OSError:
                pytest.skip("this system has one loopback address")
            lines.append(stack.enter_context(closing(made)))
            time.sleep(0.01)
        assert all(gone(line) for line in lines[10:])
        time.sleep(server.GRACE_S)
        assert status(from_elsewhere(host, "127.0.0.99")) == 200
        assert gone(lines[0])


@pytest.mark.long
def test_a_page_that_is_being_worked_out_keeps_its_place(host: Host, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its browser waits for the server, and not the server for it."""
    monkeypatch.setattr(server, "OF_ONE_PEER", 2)
    with closing(socket.create_connection(host, timeout=5)) as busy, closing(socket.create_connection(host)) as silent:
        busy.sendall(head(host, path="/computed"))
        time.sleep(server.GRACE_S + 0.2)
        assert status(spoken(host, head(host))) == 200
        assert gone(silent)
        assert status(busy.recv(65536)) == 200


def test_a_browser_that_closes_its_half_after_asking_is_answered_and_one_that_does_before_is_not(host: Host) -> None:
    for sent, served in ((head(host), True), (b"GET / HTTP/1.1\r\nHost: ", False)):
        with closing(socket.create_connection(host, timeout=2)) as line:
            line.sendall(sent)
            line.shutdown(socket.SHUT_WR)
            assert (b"page" in b"".join(iter(lambda: line.recv(65536), b""))) is served


@pytest.mark.long
def test_whatever_a_slow_browser_does_its_time_is_over(host: Host, monkeypatch: pytest.MonkeyPatch) -> None:
    """Deadlines of head, body and answer, each as a whole, however often a byte comes."""
    for name in ("HEAD_S", "BODY_S", "ANSWER_S"):
        monkeypatch.setattr(server, name, 0.5)
    for begin, drip in SLOW.values():
        with closing(socket.create_connection(host)) as line:
            line.sendall(begin(host))
            time.sleep(0.7) if not drip else None
            assert closed_after(line, drip) < 3


@pytest.mark.parametrize(("host_", "same"), [
    ("192.0.2.1", "192.0.2.1"), ("::ffff:192.0.2.1", "::ffff:192.0.2.1"), ("fe80::1%eth0", "fe80::2%eth1"),
    ("2001:db8:0:1::5", "2001:db8:0:1:ffff::9"),
])  # fmt: skip
def test_one_network_of_ipv6_is_one_peer(host_: str, same: str) -> None:
    others = ("192.0.2.2", "::ffff:192.0.2.2", "2001:db8:0:2::5", "::1")
    assert server.peer_of(host_) == server.peer_of(same)
    assert server.peer_of(host_) not in {server.peer_of(one) for one in others}
