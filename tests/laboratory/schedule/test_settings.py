"""schedule.toml, and the ways of sending that it names."""

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
from cmm_uq.laboratory.schedule.notices import EVENTS, Channel, OutgoingMessage, UndeliveredError, within
from cmm_uq.laboratory.schedule.settings import Mail, ScheduleFile, channels, read_schedule
from tests.laboratory.schedule.servers import HOST, Post, Taken, certificate, hanging_server, mail_server, web_server
from tests.laboratory.schedule.told import NOW, notice

MAIL = '[[email]]\nto = ["a@example.org"]\nsender = "cmm@example.org"\nserver = "mail.example.org"\n'

WRONG = {
    "[run]\nqiet_s = 3\n": r"line 2: \[run\] qiet_s: unknown key\. Did you mean 'quiet_s'",
    "[run]\nquiet_s = -1\n": r"line 2: \[run\] quiet_s",
    "[run]\ntries = 0\n": r"line 2: \[run\] tries",
    "[rum]\n": r"\[rum\]: unknown key",
    MAIL + "port = 70000\n": r"port",
    MAIL + 'password = "secret"\n': r"line 5: \[\[email\]\] 1 password: unknown key",
    MAIL + 'password_variable = "P"\n': r"needs user_variable",
    MAIL + 'user_variable = "U"\n': r"needs user_variable",
    MAIL + 'user_variable = "U"\npassword_variable = "P"\npassword_file = "f"\n': r"give one",
    MAIL + 'user_variable = "U"\npassword_variable = "P"\nsecurity = "none"\n': r"not sent over an open line",
    MAIL + 'user_variable = "hunter2!"\npassword_variable = "P"\n': r"is no name of a variable",
    MAIL + 'on = ["fails"]\n': r"on",
    MAIL + "on = []\n": r"on",
    MAIL.replace("a@example.org", "a example"): r"is no e-mail address",
    MAIL.replace("a@example.org", "a@example.org\\nBcc: x@example.org"): r"is no e-mail address",
    MAIL.replace('sender = "cmm@example.org"\n', ""): r"sender: is missing",
    "[[webhook]]\n": r"needs one of url and url_variable",
    '[[webhook]]\nurl = "https://x.org"\nurl_variable = "U"\n': r"needs one of url and url_variable",
    '[[webhook]]\nurl = "ftp://x.org"\n': r"is no web address",
    '[[webhook]]\nurl = "https://user:pw@x.org"\n': r"has a user or a password in it",
    "run = 3\n": r"\[run\]",
    "[log]\nkept = 0\n": r"kept",
}


def read(tmp_path: Path, text: str) -> None:
    (tmp_path / "schedule.toml").write_text(text)
    read_schedule(tmp_path / "schedule.toml")


@pytest.mark.parametrize(("text", "told"), WRONG.items())
def test_what_is_wrong_is_told_in_one_line(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(CmmUqError, match=told) as error:
        read(tmp_path, text)
    assert "schedule.toml" in str(error.value)
    assert "\n" not in str(error.value)


def test_a_file_that_is_missing_says_how_to_begin_one(tmp_path: Path) -> None:
    with pytest.raises(CmmUqError, match="cmm-uq schedule new"):
        read_schedule(tmp_path / "schedule.toml")


@pytest.mark.parametrize(("security", "port"), [("starttls", 587), ("tls", 465), ("none", 25)])
def test_the_usual_port_follows_from_the_security_and_everything_is_told_unless_said(
    tmp_path: Path, security: str, port: int
) -> None:
    path = tmp_path / "schedule.toml"
    path.write_text(f'{MAIL}security = "{security}"\n')
    (mail,) = channels(read_schedule(path), tmp_path)
    assert isinstance(mail, Mail)
    assert mail.port == port
    assert mail.events == set(EVENTS)


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
