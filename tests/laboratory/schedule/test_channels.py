"""Messages arrive at real servers of this computer, by mail and at a web address, and what stands in their way is told."""

from __future__ import annotations

import hashlib
import hmac
import json
import os
import time
from pathlib import Path
from typing import Any

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.schedule.notices import Channel, OutgoingMessage, UndeliveredError, within
from cmm_uq.laboratory.schedule.settings import ScheduleFile, channels
from tests.laboratory.schedule.servers import HOST, Post, Taken, certificate, hanging_server, mail_server, web_server
from tests.laboratory.schedule.told import NOW, notice

MESSAGE = OutgoingMessage.of(notice("Zeiß 3 · µm"), "x", NOW)


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return certificate(tmp_path_factory.mktemp("tls"))


def mail(port: int, folder: Path = Path(), **further: Any) -> Channel:
    table = {"to": ["quality@example.org", "b@example.org"], "sender": "cmm@example.org", "server": HOST, "port": port,
             "timeout_s": 5.0, **further}  # fmt: skip
    (found,) = channels(ScheduleFile.model_validate({"email": [table]}), folder)
    return found


def webhook(**table: Any) -> Channel:
    (found,) = channels(ScheduleFile.model_validate({"webhook": [{"timeout_s": 5.0, **table}]}), Path())
    return found


def test_a_message_arrives_by_mail() -> None:
    post = Post()
    with mail_server(post) as port:
        assert mail(port, security="none").send(MESSAGE) == ""
    (letter,) = post.letters
    assert letter["To"] == "quality@example.org, b@example.org"
    assert letter["From"] == "cmm@example.org"
    assert letter["Subject"] == "[cmm-uq] fail: Zeiß 3 · µm"
    assert letter["Message-ID"] == f"<{MESSAGE.key}@cmm-uq.invalid>"
    assert letter["Auto-Submitted"] == "auto-generated"
    assert "Zeiß 3 · µm in words." in letter.get_content()


# the server does not see that the line was made safe before it was asked
@pytest.mark.filterwarnings("ignore:Requiring AUTH while not requiring TLS:UserWarning")
@pytest.mark.parametrize("security", ["starttls", "tls"])
def test_a_login_goes_over_a_line_that_was_made_safe_first(
    security: str, pair: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    post = Post(password="secret")
    monkeypatch.setenv("SMTP_USER", "cmm")
    monkeypatch.setenv("SMTP_PASSWORD", "secret")
    with mail_server(post, security, pair) as port:
        keys = {"user_variable": "SMTP_USER", "password_variable": "SMTP_PASSWORD", "ca_file": str(pair[0])}
        mail(port, security=security, **keys).send(MESSAGE)
    assert post.logins == [("cmm", "secret")]
    assert len(post.letters) == 1


@pytest.mark.parametrize("security", ["starttls", "tls"])
def test_a_certificate_that_nobody_vouches_for_is_refused_before_anything_is_said(
    security: str, pair: tuple[Path, Path]
) -> None:
    post = Post()
    with (
        mail_server(post, security, pair) as port,
        pytest.raises(UndeliveredError, match=r"(?i)certificate verify failed"),
    ):
        mail(port, security=security).send(MESSAGE)
    assert post.letters == []


def test_a_wrong_password_is_told_without_it(pair: tuple[Path, Path], tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("SMTP_USER", "cmm")
    (tmp_path / "password").write_text("wr0ng-one\n")
    (tmp_path / "password").chmod(0o600)
    post = Post(password="secret")
    keys = {"user_variable": "SMTP_USER", "password_file": "password", "ca_file": str(pair[0])}
    with (
        mail_server(post, "starttls", pair) as port,
        pytest.raises(UndeliveredError, match="refused the login: 535") as told,
    ):
        mail(port, tmp_path, security="starttls", **keys).send(MESSAGE)
    assert "wr0ng-one" in {password for _, password in post.logins}
    assert "wr0ng-one" not in str(told.value)


@pytest.mark.skipif(os.name == "nt", reason="Windows has other rights")
def test_a_password_that_others_may_read_is_not_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SMTP_USER", "cmm")
    (tmp_path / "password").write_text("secret")
    (tmp_path / "password").chmod(0o640)
    with pytest.raises(CmmUqError, match=r"others may read it\. chmod 600"):
        mail(9, tmp_path, user_variable="SMTP_USER", password_file="password").send(MESSAGE)


def test_a_variable_that_is_not_set_is_named() -> None:
    with pytest.raises(CmmUqError, match="the variable CMM_UQ_NOT_SET is not set"):
        webhook(url_variable="CMM_UQ_NOT_SET").send(MESSAGE)


def test_one_address_that_is_refused_is_remarked_and_all_of_them_are_a_failure() -> None:
    some = Post(refused=frozenset({"b@example.org"}))
    with mail_server(some) as port:
        assert mail(port, security="none").send(MESSAGE) == "the mail server refused b@example.org"
    assert len(some.letters) == 1
    none = Post(refused=frozenset({"quality@example.org", "b@example.org"}))
    with mail_server(none) as port, pytest.raises(UndeliveredError, match=r"refused quality@example\.org"):
        mail(port, security="none").send(MESSAGE)


@pytest.mark.parametrize("greeting", [b"", b"220 hello\r\n"])
@pytest.mark.parametrize("security", ["none", "tls"])
def test_a_mail_server_that_hangs_is_left_after_its_time(greeting: bytes, security: str) -> None:
    with hanging_server(greeting) as port:
        begun = time.monotonic()
        with pytest.raises(UndeliveredError):
            mail(port, security=security, timeout_s=0.5).send(MESSAGE)
        assert time.monotonic() - begun < 3.0


def test_one_byte_a_moment_does_not_keep_a_call_alive() -> None:
    """Each byte would begin the time limit of a socket anew."""
    begun = time.monotonic()
    with pytest.raises(UndeliveredError, match=r"web address at x did not answer within 0\.3 s"):
        within(0.3, lambda: str(time.sleep(2.0)), "web address at x")
    assert time.monotonic() - begun < 1.5


def test_where_nobody_listens_it_is_told() -> None:
    for channel in (mail(1, security="none"), webhook(url=f"http://{HOST}:1/x")):
        with pytest.raises(UndeliveredError, match="refused"):
            channel.send(MESSAGE)


def test_a_web_address_gets_json_that_it_can_check(pair: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    """The signature computed here from its definition: HMAC-SHA-256 over time stamp, full stop, body."""
    monkeypatch.setenv("HOOK_SECRET", "k3y")
    taken = Taken()
    with web_server(taken, pair) as port:
        webhook(url=f"https://{HOST}:{port}/hook", secret_variable="HOOK_SECRET", ca_file=str(pair[0])).send(MESSAGE)
    ((headers, body),) = taken.requests
    stamp = headers["X-Cmm-Uq-Timestamp"]
    expected = hmac.new(b"k3y", stamp.encode() + b"." + body, hashlib.sha256).hexdigest()
    assert headers["X-Cmm-Uq-Signature"] == f"sha256={expected}"
    assert abs(int(stamp) - time.time()) < 60
    assert headers["Idempotency-Key"] == MESSAGE.key
    assert headers["Content-Type"] == "application/json"
    assert json.loads(body) == {"schema": "cmm-uq/message/1", **MESSAGE.as_data()}


def test_a_certificate_of_a_web_server_that_nobody_vouches_for_is_refused(pair: tuple[Path, Path]) -> None:
    taken = Taken()
    with web_server(taken, pair) as port, pytest.raises(UndeliveredError, match=r"(?i)certificate verify failed"):
        webhook(url=f"https://{HOST}:{port}/hook").send(MESSAGE)
    assert taken.requests == []


@pytest.mark.parametrize("answer", [301, 302, 303, 307, 308, 400, 404, 500, 503])
def test_any_answer_but_success_is_a_failure_and_no_redirection_is_followed(answer: int) -> None:
    taken = Taken(answer=answer)
    with web_server(taken) as port:
        taken.headers["Location"] = f"http://{HOST}:{port}/elsewhere"
        with pytest.raises(UndeliveredError, match=f"answered {answer}"):
            webhook(url=f"http://{HOST}:{port}/hook").send(MESSAGE)
    assert len(taken.requests) == 1


def test_an_address_that_is_a_secret_is_in_no_name_and_no_message(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOOK_URL", f"http://{HOST}:1/T0/s3cret?token=s3cret")
    channel = webhook(url_variable="HOOK_URL")
    with pytest.raises(UndeliveredError) as told:
        channel.send(MESSAGE)
    assert "s3cret" not in f"{channel.name} {told.value}"
    assert "s3cret" not in webhook(url="https://example.org/s3cret").name
    monkeypatch.setenv("HOOK_URL", "file:///etc/passwd")
    with pytest.raises(CmmUqError, match="holds no web address"):
        channel.send(MESSAGE)


def test_two_web_addresses_of_one_server_are_two_channels() -> None:
    assert webhook(url="https://example.org/a").name != webhook(url="https://example.org/b").name
