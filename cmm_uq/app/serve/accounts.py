"""Accounts of those who use the pages from other machines: who may sign in, who is signed in, and what each may do.

They lie in a TOML file of the laboratory: a table each with the role, and a hash of the password by scrypt (RFC 7914). Nobody
signs in but over TLS. Guesses are slowed down by address and by name; which of name and password was wrong is not said.

Who may use the desk: whoever opened its link, from this machine's browser, on the desk's own pages.

The desk writes files and runs commands, so every request but the link itself needs the cookie that the link gave. The link is
opened once; one that comes too late gets a new link on the terminal, never in the answer.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
import secrets
import ssl
import threading
import time
import tomllib
from collections.abc import Callable, Collection
from http import HTTPStatus
from pathlib import Path
from typing import Literal, get_args

from cmm_uq.app.serve.exchange import ACCOUNT, DESK, RefusedRequest, WebRequest, WebResponse, read_form, refusal, to
from cmm_uq.app.serve.page import WebPage, page
from cmm_uq.app.serve.server import peer_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import JOB_BYTES, content_of
from cmm_uq.base.messages import Verbatim, say
from cmm_uq.base.output.staging import replace_file
from cmm_uq.base.values import dataclass

Role = Literal["read", "work"]
SIGN_OUT = f"{ACCOUNT}/sign-out"
LOOKED_UP = ("/file", "/integrity/chain", "/integrity/files")  # forms that change nothing
SHORTEST, LONGEST = 15, 200  # characters of a password that stands alone (NIST SP 800-63B-4, 3.1.1.2)
SESSION_S = 12 * 3600.0  # for which somebody is signed in
FREE, SLOWEST_S = 5, 900.0  # guesses without waiting, and the longest wait between two later ones
_COST, _BLOCK, _PARALLEL = 2**15, 8, 1  # of scrypt: 32 MiB and about 0.1 s
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,59}")
_KEPT = re.compile(r"scrypt:([A-Za-z0-9+/]{22}==):([A-Za-z0-9+/]{43}=)")


@dataclass(frozen=True)
class Account:
    role: Role
    salt: bytes
    key: bytes


def read_accounts(path: Path) -> dict[str, Account]:
    """Accounts of a file by name.

    Raises
    ------
    CmmUqError
        The file cannot be read, or a table of it is no account.
    """
    fix = f"Add an account with --accounts {path} --add-account NAME:ROLE"
    try:
        data = tomllib.loads(content_of(path, JOB_BYTES, fix).decode())
    except ValueError as error:
        raise CmmUqError(f"is no TOML: {error}", where=str(path), fix=fix) from None
    found = {}
    for name, one in data.items():
        kept = _KEPT.fullmatch(str(one.get("password", ""))) if isinstance(one, dict) else None
        if (
            kept is None
            or one.get("role") not in get_args(Role)
            or {*one} != {"role", "password"}
            or not _NAME.fullmatch(name)
        ):
            raise CmmUqError(
                "is no account: it has a role (read or work) and a password's hash", where=f"{path}, {name!r}", fix=fix
            )
        found[name] = Account(one["role"], *map(base64.b64decode, kept.groups()))
    return found


def add_account(path: Path, stated: str, password: Callable[[], str]) -> None:
    """Write an account into the file, in the place of one of the same name; ``stated``: ``NAME:ROLE``."""
    name, _, role = stated.partition(":")
    if not _NAME.fullmatch(name) or role not in get_args(Role):
        raise CmmUqError(
            "is no name with a role", where=f"--add-account {stated}", fix="Such as anna:work, or ben:read"
        )
    accounts = read_accounts(path) if path.exists() else {}
    word = password()
    if not SHORTEST <= len(word) <= LONGEST:
        raise CmmUqError(
            f"has {len(word)} characters", where="password", fix=f"Take {SHORTEST} to {LONGEST}: a few words"
        )
    salt = secrets.token_bytes(16)
    accounts[name] = Account("work" if role == "work" else "read", salt, _key(word, salt))
    tables = (
        f'[{json.dumps(name)}]\nrole = "{one.role}"\npassword = "scrypt:{_text(one.salt)}:{_text(one.key)}"\n'
        for name, one in sorted(accounts.items())
    )
    replace_file(path, "\n".join(tables).encode(), mode=0o600)


def _text(content: bytes) -> str:
    return base64.b64encode(content).decode()


def _key(password: str, salt: bytes) -> bytes:
    return hashlib.scrypt(password.encode(), salt=salt, n=_COST, r=_BLOCK, p=_PARALLEL, maxmem=2**26, dklen=32)


def tls_of(certificate: Path | None, key: Path | None, accounts: Path | None) -> ssl.SSLContext | None:
    """What a server needs to be spoken with in secret; ``key``: where it does not stand in the certificate's file."""
    if certificate is None:
        if key is not None or accounts is not None:
            problem = "passwords are sent in secret only, and no certificate for TLS is named"
            raise CmmUqError(
                problem, where="--accounts" if accounts else "--tls-key", fix="Name one with --tls CERTIFICATE.pem"
            )
        return None
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    try:
        context.load_cert_chain(certificate, key, password=lambda: "")  # never ask: nobody may be there
    except (OSError, ssl.SSLError) as error:
        fix = "Name a certificate and its key in PEM, the key without a password"
        raise CmmUqError(
            f"cannot be used for TLS: {error.args[-1]}", where=f"{certificate}, {key or certificate}", fix=fix
        ) from None
    return context


@dataclass(frozen=True)
class SignedIn:
    name: str
    account: Account
    until: float


class Accounts:
    """Who is signed in to one start.

    ``path``: the file, read again at each request, so that an account that was taken out of it is signed out; ``tell``: says
    a line on the terminal; ``harmless``: further forms that change nothing; ``home``: first page;
    ``clock``: seconds that only grow.
    """

    def __init__(
        self,
        path: Path,
        port: int,
        tell: Callable[[str], None],
        harmless: Collection[str] = (),
        home: str = "/",
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._path, self._tell, self._clock, self._home = path, tell, clock, home
        self._harmless = {*LOOKED_UP, *harmless, SIGN_OUT}
        self._cookie = f"__Host-cmm_uq_{port}"  # of this host alone, and only by TLS
        self._sessions: dict[str, SignedIn] = {}
        # how many by address or name, and when the next may come
        self._guesses: dict[tuple[str, str], tuple[int, float]] = {}
        self._lock, self._one = threading.Lock(), threading.Lock()
        if not read_accounts(path):
            raise CmmUqError("holds no account", where=str(path), fix="Add one with --add-account NAME:ROLE")

    def admit(self, request: WebRequest, url: str) -> WebPage | WebResponse | None:
        """An answer for whoever is not signed in, signs in or out; ``None`` for a request that may go on."""
        if request.path in ("/style.css", "/icon.svg") and request.method != "POST":
            return None
        if request.method == "POST" and not request.headers.keys() & {"origin", "sec-fetch-site"}:
            raise RefusedRequest(HTTPStatus.FORBIDDEN, say("the request does not say from which page it comes"))
        session = self._session(request)
        if request.path == ACCOUNT:
            return self._signed_in(request) if request.method == "POST" else self._page(session)
        if session is None:
            if request.method == "POST":
                raise RefusedRequest(
                    HTTPStatus.FORBIDDEN, say("nobody is signed in"), say("Sign in, and send it again")
                )
            return to(ACCOUNT)
        if request.method == "POST" and session.account.role == "read" and request.path not in self._harmless:
            problem = say("the account {name} may only look", name=Verbatim(session.name))
            raise RefusedRequest(HTTPStatus.FORBIDDEN, problem, say("Ask for the role work"))
        if request.headers.get("sec-fetch-site", "same-origin") not in ("same-origin", "none"):
            raise RefusedRequest(HTTPStatus.FORBIDDEN, say("the request came from another site"))
        if request.path == SIGN_OUT and request.method == "POST":
            with self._lock:  # else it could come back with those that are kept when another signs in
                self._sessions.pop(cookie_of(request, self._cookie), None)
            return self._to(ACCOUNT, f"{self._cookie}=; Max-Age=0")
        return None

    def _session(self, request: WebRequest) -> SignedIn | None:
        token = cookie_of(request, self._cookie)
        session = self._sessions.get(token)
        if (
            session is None
            or session.until < self._clock()
            or read_accounts(self._path).get(session.name) != session.account
        ):
            self._sessions.pop(token, None)
            return None
        return session

    def _signed_in(self, request: WebRequest) -> WebPage | WebResponse:
        form = read_form(request)
        name, password = form.get("name", "")[:LONGEST], form.get("password", "")
        with self._one:  # one guess at a time: of many sent at once none is free of waiting, and memory is that of one
            return self._guessed(request, name, password)

    def _guessed(self, request: WebRequest, name: str, password: str) -> WebPage | WebResponse:
        whose = ("address", str(peer_of(request.peer))), ("name", name)
        wait = max(map(self._wait, whose))
        if wait > 0:
            problem = say("too many guesses: wait {seconds} s", seconds=int(wait) + 1)
            refused = refusal(RefusedRequest(HTTPStatus.TOO_MANY_REQUESTS, problem))
            return refused._replace(headers={"Retry-After": str(int(wait) + 1)})
        account = read_accounts(self._path).get(name)
        key = _key(password, account.salt if account else b"0" * 16)
        if account is None or not secrets.compare_digest(key, account.key):
            self._missed(*whose)
            self._tell(f"Not signed in from {request.peer}: name or password is wrong")
            return self._page(None, wrong=True)
        token = secrets.token_urlsafe(32)
        with self._lock:
            now = self._clock()
            self._sessions = {one: session for one, session in self._sessions.items() if session.until > now}
            self._sessions[token] = SignedIn(name, account, now + SESSION_S)
            for who in whose:
                self._guesses.pop(who, None)
        self._tell(f"{name} ({account.role}) signed in from {request.peer}")
        return self._to(self._home, f"{self._cookie}={token}")

    def _wait(self, who: tuple[str, str]) -> float:
        return self._guesses.get(who, (0, 0.0))[1] - self._clock()

    def _missed(self, *those: tuple[str, str]) -> None:
        """Each guess too many doubles the wait; whoever has long been let in again is forgotten."""
        with self._lock:
            now = self._clock()
            self._guesses = {who: one for who, one in self._guesses.items() if one[1] > now - SLOWEST_S}
            for who in those:
                count = self._guesses.get(who, (0, 0.0))[0] + 1
                slow = min(2.0 ** min(count - FREE, 20), SLOWEST_S) if count >= FREE else 0.0
                self._guesses[who] = count, now + slow

    def _to(self, path: str, cookie: str) -> WebResponse:
        kept = f"{cookie}; Secure; HttpOnly; SameSite=Strict; Path=/"
        return WebResponse(b"", status=HTTPStatus.SEE_OTHER, headers={"Location": path, "Set-Cookie": kept})

    def _page(self, session: SignedIn | None, *, wrong: bool = False) -> WebPage:
        status = HTTPStatus.FORBIDDEN if wrong else HTTPStatus.OK
        return page("account.html", ACCOUNT, session=session, wrong=wrong)._replace(status=status)


OPEN = "/open"


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
        if not same(cookie_of(request, self._cookie), self._session):
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


def cookie_of(request: WebRequest, name: str) -> str:
    cookies = (part.strip().partition("=") for part in request.headers.get("cookie", "").split(";"))
    return next((value for own, _, value in cookies if own == name), "")


def same(stated: str, secret: str) -> bool:
    """In a time that does not say how far they agree; an empty secret agrees with nothing."""
    return bool(secret) and secrets.compare_digest(stated.encode(), secret.encode())
