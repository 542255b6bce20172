"""What the desk hands on: files of its folder in a sandbox, pages of the records by the worker, its own style and script."""

from __future__ import annotations

import base64
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from http import HTTPStatus
from pathlib import Path
from typing import Any

from cmm_uq.app.desk.place import below
from cmm_uq.app.desk.workers import Worker
from cmm_uq.app.serve.exchange import LARGEST, RefusedRequest, WebRequest, WebResponse, sent_file
from cmm_uq.app.serve.rendering import style
from cmm_uq.base.files.content import content_of
from cmm_uq.base.files.limits import TABLE_BYTES
from cmm_uq.base.messages import say
from cmm_uq.certificate.look import template_folder

OWN_FILES = {
    "/desk.js": "text/javascript; charset=utf-8",
    "/icon.svg": "image/svg+xml",
    "/style.css": "text/css; charset=utf-8",
}


def own_file(path: str) -> WebResponse:
    content = style() if path == "/style.css" else (template_folder() / "serve" / path[1:]).read_bytes()
    return WebResponse(content, OWN_FILES[path])


def shown_file(root: Path, request: WebRequest) -> WebResponse:
    """A file of the folder, in a sandbox; only the desk's own pages may frame it."""
    request.only(("at", "keep"))
    path = below(root, request.text("at"))
    content = content_of(path, TABLE_BYTES, "It lies in the folder of the desk")
    answer = sent_file(path.name, content, keep=bool(request.one_of("keep", ("yes",))))
    policy = answer.policy.replace("frame-ancestors 'none'", "frame-ancestors 'self'")
    return replace(answer, policy=policy, headers={**answer.headers, "X-Frame-Options": "SAMEORIGIN"})


def records_page(worker: Worker, request: WebRequest, *, account: bool) -> WebResponse:
    """A page of the records, made by the worker."""
    headers = {name: value for name, value in request.headers.items() if name == "content-type"}
    given: dict[str, Any] = {
        "method": request.method,
        "path": request.path,
        "query": dict(request.query),
        "headers": headers,
        "account": account,
    }
    if request.body is None:
        return _answered(worker.ask("page", body=None, **given))
    if request.length > LARGEST:
        problem = say("the file is larger than {most} MB", most=LARGEST // 2**20)
        fix = say("No certificate is; check that it is the right file")
        raise RefusedRequest(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, problem, fix)
    with tempfile.TemporaryDirectory(prefix="cmm-uq-") as folder:
        path = Path(folder) / "sent"
        with path.open("wb") as file:
            shutil.copyfileobj(_LimitedBody(request), file)
        return _answered(worker.ask("page", body=str(path), **given))


class _LimitedBody:
    """The body of a request, as long as it says that it is."""

    def __init__(self, request: WebRequest) -> None:
        self._body, self._left = request.body, request.length

    def read(self, size: int = 2**16) -> bytes:
        block = self._body.read(min(size, self._left)) if self._body is not None and self._left else b""
        self._left -= len(block)
        return block


def _answered(found: Mapping[str, Any]) -> WebResponse:
    body, status = base64.b64decode(found["body"]), HTTPStatus(found["status"])
    return WebResponse(body, found["media"], status, found["policy"], found["referrer"], found["headers"])
