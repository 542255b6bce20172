"""A desk in an empty folder, with a server at a free port, and what speaks to it."""

from __future__ import annotations

import http.client
import re
import ssl
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import urlencode

import pytest

from cmm_uq.app.desk.desk import Desk
from cmm_uq.app.serve.server import RecordsServer
from tests.app.serve.test_exchange import BOUNDARY, form


@dataclass
class Answer:
    status: int
    headers: dict[str, str]
    body: bytes

    @property
    def text(self) -> str:
        return self.body.decode()

    def hidden(self, name: str) -> str:
        found = re.search(rf'name="{name}" value="([^"]*)"', self.text)
        assert found is not None, self.text[:2000]
        return found[1]


@dataclass
class Visitor:
    """A browser that opened the link; ``told``: lines of the terminal."""

    desk: Desk
    server: RecordsServer
    link: str
    told: list[str]
    cookie: str = ""
    own: dict[str, str] = field(default_factory=dict)

    @property
    def host(self) -> str:
        return f"127.0.0.1:{self.server.server_port}"

    def send(self, method: str, target: str, body: bytes | None = None, **headers: str) -> Answer:
        connection = http.client.HTTPConnection(self.host, timeout=60)
        given = {"Host": self.host, "Cookie": self.cookie, **headers}
        connection.request(method, target, body, {name.replace("_", "-"): one for name, one in given.items() if one})
        answer = connection.getresponse()
        found = Answer(answer.status, {name.lower(): value for name, value in answer.getheaders()}, answer.read())
        connection.close()
        return found

    def open(self) -> Visitor:
        answer = self.send("GET", self.link.partition(self.host)[2])
        assert answer.status == 303
        self.cookie = answer.headers["set-cookie"].partition(";")[0]
        return self

    def get(self, target: str) -> Answer:
        return self.send("GET", target)

    def post(self, target: str, **fields: str) -> Answer:
        body = urlencode(fields).encode()
        return self.send(
            "POST", target, body, Content_Type="application/x-www-form-urlencoded", Origin=f"http://{self.host}"
        )

    def drop(self, content: bytes, name: str = "export.csv") -> Answer:
        body = form(content, name)
        return self.send("POST", "/desk/drop", body, Content_Type=f"multipart/form-data; boundary={BOUNDARY}",
                         Origin=f"http://{self.host}")  # fmt: skip


def opened(root: Path, accounts: Path | None = None, tls: ssl.SSLContext | None = None) -> Iterator[Visitor]:
    told: list[str] = []
    desk = Desk(root, told.append)
    with RecordsServer(desk.answer, port=0, tls=tls) as server:
        link = desk.open_at(server.url, server.server_port, accounts)
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
        thread.start()
        yield Visitor(desk, server, link, told)
        server.shutdown()
        thread.join()
        desk.close()


@pytest.fixture
def visitor(tmp_path: Path) -> Iterator[Visitor]:
    """Of a folder of its own; nothing was opened yet."""
    yield from opened(tmp_path)


@pytest.fixture(scope="module")
def seated(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Visitor]:
    """One for all tests of a file, with the link opened."""
    for visitor in opened(tmp_path_factory.mktemp("root")):
        yield visitor.open()
