"""Accounts: whoever is signed in over TLS sees the pages, may do what the role says, and guessing is slow."""

from __future__ import annotations

import hashlib
import http.client
import io
import re
import ssl
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import urlencode

import pytest

from cmm_uq.app.desk.desk import Desk
from cmm_uq.app.serve import accounts as own
from cmm_uq.app.serve.accounts import Accounts, add_account, read_accounts, tls_of
from cmm_uq.app.serve.exchange import RefusedRequest, WebRequest
from cmm_uq.app.serve.server import RecordsServer
from cmm_uq.base.errors import CmmUqError
from tests.laboratory.schedule.servers import certificate as certificate_files

WORK, READ = "correct horse battery", "staple of the reader"


@pytest.fixture(scope="module")
def pem(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return certificate_files(tmp_path_factory.mktemp("tls"))


@pytest.fixture(scope="module")
def people(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("people") / "accounts.toml"
    add_account(path, "anna:work", lambda: WORK)
    add_account(path, "ben:read", lambda: READ)
    return path


@dataclass
class Caller:
    """A browser of another machine that trusts the server's certificate."""

    server: RecordsServer
    trusted: ssl.SSLContext
    cookie: str = ""
    told: list[str] = field(default_factory=list)

    def send(self, method: str, path: str, body: bytes | None = None, **headers: str) -> http.client.HTTPResponse:
        host = f"localhost:{self.server.server_port}"
        connection = http.client.HTTPSConnection("localhost", self.server.server_port, timeout=30, context=self.trusted)
        given = {"Host": host, "Cookie": self.cookie, **{name.replace("_", "-"): one for name, one in headers.items()}}
        connection.request(method, path, body, {name: one for name, one in given.items() if one})
        answer = connection.getresponse()
        answer.text = answer.read().decode()  # type: ignore[attr-defined]
        connection.close()
        return answer

    def post(self, path: str, **fields: str) -> http.client.HTTPResponse:
        headers = {
            "Content_Type": "application/x-www-form-urlencoded", "Origin": f"https://localhost:{self.server.server_port}"
        }  # fmt: skip
        return self.send("POST", path, urlencode(fields).encode(), **headers)

    def sign_in(self, name: str, password: str) -> http.client.HTTPResponse:
        answer = self.post("/account", name=name, password=password)
        self.cookie = (answer.getheader("Set-Cookie") or "").partition(";")[0]
        return answer


@pytest.fixture
def caller(tmp_path: Path, people: Path, pem: tuple[Path, Path]) -> Iterator[Caller]:
    told: list[str] = []
    desk = Desk(tmp_path, told.append)
    with RecordsServer(desk.answer, port=0, tls=tls_of(*pem, people)) as server:
        assert desk.open_at(server.url, server.server_port, people) == f"https://127.0.0.1:{server.server_port}/desk"
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
        thread.start()
        yield Caller(server, ssl.create_default_context(cafile=str(pem[0])), told=told)
        server.shutdown()
        thread.join()
        desk.close()


def test_whoever_is_not_signed_in_sees_the_form_alone(caller: Caller) -> None:
    for path in ("/desk", "/", "/certificates", "/desk/file?at=x", "/desk.js"):
        answer = caller.send("GET", path)
        assert (answer.status, answer.getheader("Location")) == (303, "/account"), path
    for path in ("/desk/drop", "/desk/job", "/file", "/account/sign-out"):
        assert caller.post(path).status == 403, path
    assert 'type="password"' in caller.send("GET", "/account").text  # type: ignore[attr-defined]


def test_each_may_do_what_the_role_says(caller: Caller) -> None:
    answer = caller.sign_in("ben", READ)
    assert {part.strip() for part in (answer.getheader("Set-Cookie") or "").split(";")[1:]} == {
        "Secure", "HttpOnly", "SameSite=Strict", "Path=/"
    }  # fmt: skip
    assert caller.cookie.startswith("__Host-")
    assert caller.send("GET", "/desk").status == 200
    refused = caller.post("/desk/delete", draft="0" * 16)
    assert refused.status == 403
    assert "may only look" in refused.text  # type: ignore[attr-defined]
    caller.sign_in("anna", WORK)
    assert "may only look" not in caller.post("/desk/delete", draft="0" * 16).text  # type: ignore[attr-defined]
    assert any("ben (read) signed in from 127.0.0.1" in line for line in caller.told)


def test_signed_out_is_signed_out(caller: Caller) -> None:
    caller.sign_in("ben", READ)
    cookie = caller.cookie
    assert caller.post("/account/sign-out").getheader("Location") == "/account"
    caller.cookie = cookie
    assert caller.send("GET", "/desk").status == 303


@pytest.mark.parametrize(
    "headers", [{"Origin": "https://evil.example"}, {"Origin": ""}, {"Sec_Fetch_Site": "cross-site"}]
)
def test_no_other_site_signs_anybody_in(caller: Caller, headers: dict[str, str]) -> None:
    body = urlencode({"name": "ben", "password": READ}).encode()
    answer = caller.send("POST", "/account", body, Content_Type="application/x-www-form-urlencoded", **headers)
    assert answer.status == 403
    assert answer.getheader("Set-Cookie") is None


def test_a_page_elsewhere_gets_nothing_of_who_is_signed_in(caller: Caller) -> None:
    caller.sign_in("anna", WORK)
    assert caller.send("GET", "/desk", Sec_Fetch_Site="cross-site").status == 403


def test_without_tls_nothing_is_answered(caller: Caller) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", caller.server.server_port, timeout=30)
    connection.request("GET", "/account")
    with pytest.raises((http.client.HTTPException, OSError)):
        connection.getresponse()
    assert caller.send("GET", "/account").status == 200


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


def asked(name: str = "ben", password: str = READ, *, peer: str = "10.0.0.1", cookie: str = "", path: str = "/account",
          method: str = "POST") -> WebRequest:  # fmt: skip
    body = urlencode({"name": name, "password": password}).encode()
    headers = {"content-type": "application/x-www-form-urlencoded", "origin": "https://x", "cookie": cookie}
    return WebRequest(method, path, {}, headers, io.BytesIO(body), len(body), peer)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    monkeypatch.setattr(own, "_key", lambda password, salt: password.encode().ljust(32)[:32])
    monkeypatch.setattr(
        own, "read_accounts", lambda path: {"ben": own.Account("read", b"", READ.encode().ljust(32)[:32])}
    )
    return Clock()


def statuses(accounts: Accounts, *requests: WebRequest) -> list[int]:
    return [int(answer.status) for one in requests if (answer := accounts.admit(one, "")) is not None]


def test_guesses_wait_twice_as_long_each_from_the_fifth_on(clock: Clock) -> None:
    accounts = Accounts(Path(), 1, lambda line: None, clock=clock)
    wrong = asked(password="wrong")
    assert statuses(accounts, *(asked(password="wrong") for _ in range(6))) == [403] * 5 + [429]
    waits = []
    for _ in range(12):
        answer = accounts.admit(asked(), "")
        assert answer is not None
        assert answer.status == 429, "the right password too"
        waits.append(int(answer.headers["Retry-After"]))
        clock.now += waits[-1]
        assert statuses(accounts, asked(password="wrong")) == [403]
    assert wrong.path == "/account"
    assert waits == [2, 3, 5, 9, 17, 33, 65, 129, 257, 513, 901, 901]
    clock.now += 901
    assert statuses(accounts, asked(), asked(password="wrong")) == [303, 403], "who got in begins anew"


def test_of_many_guesses_sent_at_once_no_more_are_tried_than_one_after_the_other(
    clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    def slow(password: str, salt: bytes) -> bytes:
        time.sleep(0.01)
        return password.encode().ljust(32)[:32]

    monkeypatch.setattr(own, "_key", slow)
    accounts = Accounts(Path(), 1, lambda line: None, clock=clock)
    with ThreadPoolExecutor(20) as pool:
        found = list(pool.map(lambda _: statuses(accounts, asked(password="wrong")), range(20)))
    assert sorted(found) == [[403]] * 5 + [[429]] * 15


def test_who_guesses_for_ever_waits_for_ever(clock: Clock) -> None:
    accounts = Accounts(Path(), 1, lambda line: None, clock=clock)
    accounts._guesses["name", "ben"] = 5000, 0.0
    assert statuses(accounts, asked(password="wrong"), asked()) == [403, 429]


def test_addresses_of_one_network_are_one(clock: Clock) -> None:
    """Of IPv6 one network has all of the second half of an address."""
    accounts = Accounts(Path(), 1, lambda line: None, clock=clock)
    tries = [asked(name=f"name{i}", peer=f"2001:db8::{i + 1:x}") for i in range(6)]
    assert statuses(accounts, *tries) == [403] * 5 + [429]


def test_guesses_of_one_name_from_many_places_are_slowed_down_too(clock: Clock) -> None:
    accounts = Accounts(Path(), 1, lambda line: None, clock=clock)
    tries = [asked(password="wrong", peer=f"10.0.0.{i}") for i in range(6)]
    assert statuses(accounts, *tries) == [403] * 5 + [429]
    others = [asked(name=f"name{i}", peer="10.0.1.1") for i in range(6)]
    assert statuses(accounts, *others) == [403] * 5 + [429], "and of many names from one place"


def test_nobody_is_signed_in_for_longer_than_a_shift(clock: Clock) -> None:
    accounts = Accounts(Path(), 1, lambda line: None, clock=clock)
    answer = accounts.admit(asked(), "")
    assert answer is not None
    cookie = answer.headers["Set-Cookie"].partition(";")[0]
    clock.now += 12 * 3600 - 1
    assert accounts.admit(asked(cookie=cookie, path="/desk", method="GET"), "") is None
    clock.now += 2
    assert statuses(accounts, asked(cookie=cookie, path="/desk", method="GET")) == [303]


def test_who_is_taken_out_of_the_file_is_signed_out(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    accounts = Accounts(Path(), 1, lambda line: None, clock=clock)
    answer = accounts.admit(asked(), "")
    assert answer is not None
    cookie = answer.headers["Set-Cookie"].partition(";")[0]
    monkeypatch.setattr(own, "read_accounts", lambda path: {"anna": own.Account("work", b"", b"")})
    assert statuses(accounts, asked(cookie=cookie, path="/desk", method="GET")) == [303]


def test_a_request_that_does_not_say_from_where_is_refused(clock: Clock) -> None:
    accounts = Accounts(Path(), 1, lambda line: None, clock=clock)
    with pytest.raises(RefusedRequest, match="from which page"):
        accounts.admit(WebRequest("POST", "/account"), "")


def test_the_file_holds_no_password_and_is_its_owner_s_alone(people: Path) -> None:
    text = people.read_text()
    assert WORK not in text
    assert people.stat().st_mode & 0o077 == 0
    assert {name: one.role for name, one in read_accounts(people).items()} == {"anna": "work", "ben": "read"}
    assert len({one.salt for one in read_accounts(people).values()}) == 2


def test_the_hash_is_scrypt_as_rfc_7914_has_it() -> None:
    # the third vector of RFC 7914, section 12, by the same function
    expected = (
        "7023bdcb3afd7348461c06cd81fd38ebfda8fbba904f8e3ea9b543f6545da1f2"
        "d5432955613f0fcf62d49705242a9af9e61e85dc0d651e40dfcf017b45575887"
    )
    made = hashlib.scrypt(b"pleaseletmein", salt=b"SodiumChloride", n=16384, r=8, p=1, maxmem=2**26, dklen=64)
    assert made.hex() == expected
    assert own._key("a", b"b" * 16) == hashlib.scrypt(b"a", salt=b"b" * 16, n=2**15, r=8, p=1, maxmem=2**26, dklen=32)


@pytest.mark.parametrize(("content", "words"), [
    ("x", "no TOML"), ("a = 1", "is no account"), ('[a]\nrole = "owner"\npassword = "x"', "is no account"),
    ('[a]\nrole = "read"\npassword = "plain words"', "is no account"), ("", "holds no account"),
])  # fmt: skip
def test_a_file_that_is_none_is_named(tmp_path: Path, content: str, words: str) -> None:
    path = tmp_path / "accounts.toml"
    path.write_text(content)
    with pytest.raises(CmmUqError, match=words) as refused:
        Accounts(path, 1, lambda line: None)
    assert str(path) in str(refused.value)
    assert refused.value.fix


@pytest.mark.parametrize(("stated", "password", "words"), [
    ("anna", WORK, "no name with a role"), ("anna:all", WORK, "no name with a role"), ("a/b:read", WORK, "no name"),
    ("anna:work", "short", "has 5 characters"),
])  # fmt: skip
def test_an_account_without_role_or_a_long_password_is_refused(
    tmp_path: Path, stated: str, password: str, words: str
) -> None:
    with pytest.raises(CmmUqError, match=words):
        add_account(tmp_path / "accounts.toml", stated, lambda: password)
    assert not any(tmp_path.iterdir())


def test_passwords_need_tls(tmp_path: Path, pem: tuple[Path, Path]) -> None:
    with pytest.raises(CmmUqError, match="in secret only"):
        tls_of(None, None, tmp_path)
    assert tls_of(None, None, None) is None
    for certificate, key in ((tmp_path / "none.pem", None), (pem[1], None), (pem[0], pem[0])):
        with pytest.raises(CmmUqError, match="cannot be used for TLS") as refused:
            tls_of(certificate, key, None)
        assert re.search("PEM", refused.value.fix or "")
