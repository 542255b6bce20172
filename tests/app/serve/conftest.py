"""One laboratory, one server and one browser tab for all tests of the page."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from cmm_uq.app.serve.exchange import WebRequest, WebResponse, read_address
from cmm_uq.app.serve.server import RecordsServer
from cmm_uq.app.serve.site import Site
from tests.app.serve.laboratory import TODAY, opened_in


class Looked:
    def __init__(self, place: Path) -> None:
        self.place, self.site = place, Site(place, today=lambda: TODAY)

    def get(self, target: str) -> WebResponse:
        return self.site.answer(WebRequest("GET", *read_address(target)))

    def text(self, target: str) -> str:
        return self.get(target).body.decode()


@pytest.fixture(scope="package")
def laboratory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return opened_in(tmp_path_factory.mktemp("laboratory"))


@pytest.fixture(scope="package")
def looked(laboratory: Path) -> Looked:
    return Looked(laboratory)


@pytest.fixture(scope="package")
def server(looked: Looked) -> Iterator[RecordsServer]:
    with RecordsServer(looked.site.answer, port=0) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
        thread.start()
        yield server
        server.shutdown()
        thread.join()


@pytest.fixture(scope="package")
def host(server: RecordsServer) -> tuple[str, int]:
    parts = urlsplit(server.url)
    assert parts.hostname is not None
    assert parts.port is not None
    return parts.hostname, parts.port
