"""Who may use the desk: whoever opened its link, from this machine's browser, on the desk's own pages.

The desk writes files and runs commands, so every request but the link itself needs the cookie that the link gave. The link is
opened once; one that comes too late gets a new link on the terminal, never in the answer.
"""

from __future__ import annotations

import secrets
import threading
from collections.abc import Callable
from http import HTTPStatus

from cmm_uq.app.serve.exchange import OWN, RefusedRequest, WebRequest, WebResponse
from cmm_uq.app.serve.rendering import DESK
from cmm_uq.base.messages import say

OPEN = "/open"
POLICY = OWN.replace("style-src", "script-src 'self'; connect-src 'self'; frame-src 'self'; style-src")
"""What a page of the desk may load: what records' pages may, the desk's own script, its events, and documents in frames."""


class Guard:
    """The secrets of one start; ``tell``: says a line on the terminal; ``port``: of the server, by which cookies differ."""

    def __init__(self, tell: Callable[[str], None], port: int) -> None:
        self._tell, self._lock = tell, threading.Lock()
        self._token, self._session = secrets.token_urlsafe(32), secrets.token_urlsafe(32)
        self._cookie = f"cmm_uq_desk_{port}"  # cookies of one name go to every port

    def link(self, url: str) -> str:
        return f"{url.rstrip('/')}{OPEN}?token={self._token}"

    def admit(self, request: WebRequest, url: str) -> WebResponse | None:
        """Refuse a request that is not the desk's own; an answer for the link, ``None`` for a request that may go on."""
        site = request.headers.get("sec-fetch-site", "same-origin")
        if request.path == OPEN and request.method == "GET":
            return self._opened(request, url)
        if site not in ("same-origin", "none"):
            raise RefusedRequest(HTTPStatus.FORBIDDEN, say("the request came from another site"))
        if request.method == "POST" and "origin" not in request.headers and "sec-fetch-site" not in request.headers:
            raise RefusedRequest(HTTPStatus.FORBIDDEN, say("the request does not say from which page it comes"))
        cookies = (part.strip().partition("=") for part in request.headers.get("cookie", "").split(";"))
        if not any(name == self._cookie and same(value, self._session) for name, _, value in cookies):
            problem = say("this browser has not opened the desk")
            raise RefusedRequest(HTTPStatus.FORBIDDEN, problem, say("Open the link that cmm-uq desk printed"))
        return None

    def _opened(self, request: WebRequest, url: str) -> WebResponse:
        request.only(("token",))
        with self._lock:
            fresh = same(request.text("token"), self._token)
            if fresh:
                self._token = ""
            elif not self._token:
                self._token = secrets.token_urlsafe(32)
                self._tell(f"The link was opened already. Another, to be opened once: {self.link(url)}")
        if not fresh:
            problem = say("this link is none, or was opened already")
            raise RefusedRequest(
                HTTPStatus.FORBIDDEN, problem, say("Open the newest link on the terminal of cmm-uq desk")
            )
        cookie = f"{self._cookie}={self._session}; HttpOnly; SameSite=Strict; Path=/"
        return WebResponse(b"", status=HTTPStatus.SEE_OTHER, headers={"Location": DESK, "Set-Cookie": cookie})


def same(stated: str, secret: str) -> bool:
    """In a time that does not say how far they agree; an empty secret agrees with nothing."""
    return bool(secret) and secrets.compare_digest(stated.encode(), secret.encode())
