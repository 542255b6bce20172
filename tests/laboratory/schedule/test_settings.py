"""schedule.toml says what is wrong with it in one line, with line and key; and no secret can stand in it."""

from __future__ import annotations

from pathlib import Path

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.schedule.notices import EVENTS
from cmm_uq.laboratory.schedule.settings import Mail, channels, read_schedule

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
