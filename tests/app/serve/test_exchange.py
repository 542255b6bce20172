"""An address is read as it stands, or refused in words; nothing is guessed."""

from __future__ import annotations

import datetime as dt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cmm_uq.app.serve.exchange import RefusedRequest, Request, read_address
from cmm_uq.app.serve.page import address

VALUES = st.text(st.characters(exclude_characters="\0\r\n", exclude_categories=["Cs"]), min_size=1, max_size=60)


@given(serial=VALUES, text=VALUES)
def test_whatever_a_serial_holds_its_address_leads_back_to_it(serial: str, text: str) -> None:
    assert read_address(address("/machine", serial=serial, text=text)) == ("/machine", {"serial": serial, "text": text})


@pytest.mark.parametrize("target", [
    "http://elsewhere/", "*", "", "/?a=1&a=2", "/?a=%ff", "/?a=%00", "/?a=%0d%0a", "/?" + "a=&" * 30,
    "/?a=" + "x" * 400, "/\u202e", "/?noequals",
])  # fmt: skip
def test_an_address_that_cannot_be_read_is_refused(target: str) -> None:
    with pytest.raises(RefusedRequest) as refused:
        read_address(target)
    assert refused.value.status == 400
    assert refused.value.problem


@pytest.mark.parametrize("value", ["0", "-1", "1.5", "x", "99999999999999999999", "²", "1000001"])
def test_a_page_is_a_whole_number_from_one(value: str) -> None:
    with pytest.raises(RefusedRequest, match="whole number from 1"):
        Request("GET", "/", {"page": value}).count("page")


def test_what_was_not_asked_is_left_out() -> None:
    asked = Request("GET", "/", {"since": "", "page": "7", "until": " 2026-03-31 "})
    assert (asked.day("since"), asked.count("page"), asked.day("until")) == (None, 7, dt.date(2026, 3, 31))
    assert asked.text("text") == ""


@pytest.mark.parametrize(("query", "told"), [
    ({"stat": "draft"}, "this page knows no 'stat' in its address"),
    ({"state": "drafted"}, "state cannot be 'drafted'"),
    ({"since": "31.3.2026"}, "since is a date such as 2026-03-31, not '31.3.2026'"),
])  # fmt: skip
def test_a_slip_in_an_address_is_answered_with_what_was_meant(query: dict[str, str], told: str) -> None:
    def read(asked: Request) -> None:
        asked.only(("state", "since"))
        asked.one_of("state", ("draft", "released"))
        asked.day("since")

    with pytest.raises(RefusedRequest) as refused:
        read(Request("GET", "/", query))
    assert refused.value.problem == told
    if "since" not in query:
        assert refused.value.fix in ("Did you mean 'state'?", "Did you mean 'draft'?")
