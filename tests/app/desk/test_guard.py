"""Who gets in: whoever opens the link once, on the desk's own pages, under its own name."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.app.desk.conftest import Visitor

GETS = (
    "/desk",
    "/desk/read?draft=0",
    "/desk/events?name=x",
    "/desk/field.json?name=x",
    "/desk/file?at=x",
    "/style.css",
    "/",
    "/file",
)
FORMS = (
    "/desk/drop",
    "/desk/read",
    "/desk/fields",
    "/desk/job",
    "/desk/run",
    "/desk/cancel",
    "/desk/check",
    "/desk/delete",
    "/file",
)


def token(link: str) -> str:
    return link.partition("token=")[2]


def test_a_link_is_opened_once_and_a_late_one_gets_another_on_the_terminal_only(visitor: Visitor) -> None:
    first = visitor.link
    visitor.open()
    assert visitor.get("/desk").status == 200
    late = visitor.send("GET", first.partition(visitor.host)[2])
    assert late.status == 403
    assert "set-cookie" not in late.headers
    (line,) = visitor.told
    fresh = line.rpartition(" ")[2]
    assert token(fresh) not in late.text
    assert token(fresh) != token(first)
    again = visitor.send("GET", first.partition(visitor.host)[2])
    assert again.status == 403
    assert len(visitor.told) == 1, "a page elsewhere could fill the terminal"
    assert visitor.send("GET", fresh.partition(visitor.host)[2]).status == 303


def test_the_cookie_is_for_no_script_and_no_other_site(visitor: Visitor) -> None:
    answer = visitor.send("GET", visitor.link.partition(visitor.host)[2])
    assert answer.headers["location"] == "/desk"
    assert {part.strip() for part in answer.headers["set-cookie"].split(";")[1:]} == {
        "HttpOnly",
        "SameSite=Strict",
        "Path=/",
    }
    assert str(visitor.server.server_port) in answer.headers["set-cookie"]


@pytest.mark.parametrize(
    "cookie", ["", "other=1", "cmm_uq_desk_{port}=", "cmm_uq_desk_{port}=x", "cmm_uq_desk_1={secret}"]
)
def test_nothing_is_answered_without_the_cookie(visitor: Visitor, cookie: str) -> None:
    secret = visitor.open().cookie.partition("=")[2]
    visitor.cookie = cookie.format(port=visitor.server.server_port, secret=secret)
    for target in GETS:
        answer = visitor.get(target)
        assert answer.status == 403, target
        assert str(visitor.desk.root) not in answer.text.partition("<footer")[0]
    for target in FORMS:
        assert visitor.post(target).status == 403, target


@pytest.mark.parametrize("headers", [
    {"Origin": "http://evil.example"}, {"Origin": "null"}, {"Origin": "http://127.0.0.1:1"}, {"Origin": ""},
    {"Sec_Fetch_Site": "cross-site"}, {"Sec_Fetch_Site": "same-site"},
])  # fmt: skip
def test_a_form_of_another_page_is_refused(seated: Visitor, headers: dict[str, str]) -> None:
    given = {"Content_Type": "application/x-www-form-urlencoded", **headers}
    for target in FORMS:
        assert seated.send("POST", target, b"name=x", **given).status == 403, target


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_pages_are_not_shown_to_other_sites(seated: Visitor, site: str) -> None:
    for target in GETS:
        assert seated.send("GET", target, Sec_Fetch_Site=site).status == 403, target


@pytest.mark.parametrize(
    "name", ["evil.example:{port}", "127.0.0.1", "127.0.0.1:1", "localhost.evil.example:{port}", "10.0.0.1:{port}"]
)
def test_it_answers_to_its_own_name_and_port_alone(seated: Visitor, name: str) -> None:
    assert seated.send("GET", "/desk", Host=name.format(port=seated.server.server_port)).status == 421


def test_it_listens_on_this_machine_alone(seated: Visitor) -> None:
    assert seated.server.server_address[0] == "127.0.0.1"


def test_pages_run_the_desk_s_own_script_and_nothing_else(seated: Visitor) -> None:
    for target in ("/desk", "/desk/nowhere"):
        answer = seated.get(target)
        policy = answer.headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "script-src 'self'" in policy
        assert "unsafe" not in policy
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert "access-control-allow-origin" not in answer.headers
        assert answer.text.count("<script") == 1
        assert not re.search(r"<[^>]*\s(on\w+|style)\s*=", answer.text), "what the policy would stop"


def test_no_get_changes_anything(visitor: Visitor, tmp_path: Path) -> None:
    visitor.open()
    before = sorted(tmp_path.rglob("*"))
    for target in (*GETS, *FORMS, "/integrity", "/certificates"):
        visitor.get(target)
    assert sorted(tmp_path.rglob("*")) == before
