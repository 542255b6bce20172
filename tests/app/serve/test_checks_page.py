"""What the records know of a file: by its bytes, else by what it says it is."""

from __future__ import annotations

import json
from hashlib import sha256
from pathlib import Path

import pytest

from cmm_uq.app.serve.checks_page import FileMatch, look_up, number_in, verdict
from cmm_uq.app.serve.exchange import UploadedFile
from cmm_uq.certificate.render.html import render_html
from cmm_uq.certificate.render.pdf import render_pdf
from cmm_uq.laboratory.records import open_records
from tests.app.serve.laboratory import files
from tests.certificate.samples import document_of


def known(place: Path, content: bytes) -> FileMatch:
    with open_records(place, read_only=True) as records:
        return look_up(records, UploadedFile("file", len(content), sha256(content).hexdigest(), content))


@pytest.mark.parametrize("name", ["results.json", "certificate.html", "certificate.pdf"])
@pytest.mark.parametrize(("number", "head", "standing"), [
    ("k-1", "Known and released", "good"), ("k-4", "Known, but withdrawn: do not rely on it", "bad"),
    ("k-5", "Known, but a draft: nobody has released it", "open"),
    ("sim-1", "Known, but a draft: nobody has released it", "open"),
])  # fmt: skip
def test_the_very_file_is_known_with_its_state(
    laboratory: Path, name: str, number: str, head: str, standing: str
) -> None:
    found = known(laboratory, files(number)[name])
    assert found.certificate is not None
    assert (found.how, found.name, found.certificate.number) == ("recorded", name, number)
    assert (verdict(found).head, verdict(found).standing) == (head, standing)


def test_a_simulated_certificate_is_never_taken_for_a_measured_one(laboratory: Path) -> None:
    assert any("simulated" in line.text for line in verdict(known(laboratory, files("sim-1")["results.json"])).lines)


@pytest.mark.parametrize("name", ["results.json", "certificate.html", "certificate.pdf"])
def test_one_altered_byte_is_seen(laboratory: Path, name: str) -> None:
    found = known(laboratory, files("k-1")[name] + b" ")
    assert found.how == "altered"
    assert found.says == "k-1"
    assert (verdict(found).head, verdict(found).standing) == ("Altered: not the file that was recorded", "bad")


@pytest.mark.parametrize("content", [
    b"", b"{", b"{}", b"[" * 10**5, b'{"schema": "cmm-uq/results/1", "job": []}', b"%PDF-1.7", b"\xff\xfe", b"<html>",
    json.dumps({"schema": "cmm-uq/results/1", "job": {"id": "elsewhere"}}).encode(),
])  # fmt: skip
def test_what_the_records_do_not_know_is_unknown(laboratory: Path, content: bytes) -> None:
    found = known(laboratory, content)
    assert (found.how, found.certificate, verdict(found).standing) == ("unknown", None, "open")


@pytest.mark.parametrize("number", ["QZ-2026/117", "<&> \"7\" '8' ü"])
def test_certificates_of_this_program_say_their_number(number: str) -> None:
    """In the pages and files that it renders itself; a change of their look must not go unseen."""
    from dataclasses import replace

    document = replace(document_of("x"), number=number)
    assert number_in(render_html(document).encode()) == number
    assert number_in(render_pdf(document, {})) == number
