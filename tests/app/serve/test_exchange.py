"""An address is read as it stands, or refused in words; nothing is guessed."""

from __future__ import annotations

import datetime as dt
import io
from hashlib import sha256

import pytest
from hypothesis import given, strategies as st

from cmm_uq.app.serve import exchange as uploaded
from cmm_uq.app.serve.exchange import RefusedRequest, WebRequest as Request, read_address, read_dropped
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


BOUNDARY = "----WebKitFormBoundary7MA4YWxk"


def form(content: bytes, name: str = "certificate.pdf", boundary: str = BOUNDARY) -> bytes:
    told = f'form-data; name="file"; filename="{name}"\r\nContent-Type: application/pdf'
    return (
        f"--{boundary}\r\nContent-Disposition: {told}\r\n\r\n".encode() + content + f"\r\n--{boundary}--\r\n".encode()
    )


def asked(body: bytes, length: int | None = None, boundary: str = BOUNDARY) -> Request:
    headers = {"content-type": f"multipart/form-data; boundary={boundary}"}
    return Request("POST", "/file", {}, headers, io.BytesIO(body), len(body) if length is None else length)


@given(content=st.binary(max_size=3000) | st.text("\r\n-WebKit", max_size=300).map(str.encode),
       block=st.integers(1, 400))  # fmt: skip
def test_the_hash_is_that_of_the_file(content: bytes, block: int) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(uploaded, "_BLOCK", block)
        found = read_dropped(asked(form(content)))
    assert (found.sha256, found.size, found.content) == (sha256(content).hexdigest(), len(content), content)


def test_a_file_too_large_to_be_held_is_hashed_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uploaded, "HELD", 1000)
    found = read_dropped(asked(form(b"x" * 1001)))
    assert (found.sha256, found.content) == (sha256(b"x" * 1001).hexdigest(), None)


def test_a_file_larger_than_any_certificate_is_refused_before_it_is_read() -> None:
    body = io.BytesIO(form(b"x"))
    huge = Request("POST", "/file", {}, {"content-type": f"multipart/form-data; boundary={BOUNDARY}"}, body, 2**40)
    with pytest.raises(RefusedRequest) as refused:
        read_dropped(huge)
    assert refused.value.status == 413
    assert body.tell() == 0


@pytest.mark.parametrize("body", [
    form(b"x")[:-6], form(b"x")[:60], b"", b"\r\n\r\n", form(b"x") + b"more", form(b"x", boundary="another"),
    form(b"x", name=""), b"--" + BOUNDARY.encode() + b"\r\nContent-Disposition: form-data; name=a\r\n\r\nx",
])  # fmt: skip
def test_a_form_that_is_not_this_page_s_is_refused_in_words(body: bytes) -> None:
    with pytest.raises(RefusedRequest) as refused:
        read_dropped(asked(body))
    assert refused.value.status == 400
    assert refused.value.problem


def test_a_file_s_name_has_no_folder() -> None:
    assert read_dropped(asked(form(b"x", name="C:\\lab\\../../etc/k-1.pdf"))).name == "k-1.pdf"


@pytest.mark.parametrize(
    "media", ["", "application/json", "multipart/form-data", "multipart/form-data; boundary=" + "x" * 80]
)
def test_only_the_form_s_own_media_type_is_read(media: str) -> None:
    with pytest.raises(RefusedRequest) as refused:
        read_dropped(Request("POST", "/file", {}, {"content-type": media}, io.BytesIO(b"x"), 1))
    assert refused.value.status == 415
