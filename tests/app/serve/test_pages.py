"""How machines stand, files that are checked, and recorded files."""

from __future__ import annotations

import datetime as dt
import json
from hashlib import sha256
from pathlib import Path

import pytest

from cmm_uq.app.serve.certificate_page import RecordedFile, content_of, files_of, results_of
from cmm_uq.app.serve.exchange import RefusedRequest, UploadedFile, sent_file
from cmm_uq.app.serve.site import FileMatch, look_up, number_in, verdict
from cmm_uq.app.serve.view import MachineStanding, groups, in_order
from cmm_uq.base.messages import say
from cmm_uq.certificate.render import render_html, render_pdf
from cmm_uq.laboratory.due.due import DueItem
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.facts import Entry, RecordedMachine
from cmm_uq.laboratory.records.listing import ListedCertificate, Newest
from tests.app.serve.laboratory import files
from tests.certificate.samples import document_of

TODAY = dt.date(2026, 11, 22)


def newest(
    serial: str = "1", *, decision: str = "pass", diagnosis: str = "consistent", state: str = "released"
) -> Newest:
    day = dt.date(2026, 1, 31)
    listed = ListedCertificate(
        1, "j", "n", serial, "", "a", "ballbar", "measured", day, state, decision, diagnosis, False, "report"
    )
    return Newest(RecordedMachine(serial, "", "", "", ""), listed)


def due(days: int) -> DueItem:
    return DueItem("machine", "1", "", "", "", None, TODAY + dt.timedelta(days=days), say("so many days"))


@pytest.mark.parametrize(("days", "group"), [(-1, "overdue"), (0, "due"), (60, "due"), (61, "order")])
def test_a_machine_is_overdue_from_the_day_after_it_is_due(days: int, group: str) -> None:
    assert groups(newest(), due(days), TODAY) == (group,)


@pytest.mark.parametrize(("said", "found"), [
    ({"decision": "fail"}, ("failing",)), ({"decision": "conditional fail"}, ("failing",)),
    ({"decision": "undecided"}, ("open",)), ({"decision": "incomplete"}, ("open",)), ({"decision": "remeasure"}, ("open",)),
    ({"decision": "conditional pass"}, ("open",)), ({"decision": "of another version"}, ("open",)),
    ({"decision": "none"}, ("order",)), ({"state": "draft"}, ("draft",)), ({"diagnosis": ""}, ("order",)),
    ({"diagnosis": "unexplained"}, ("diagnosis",)), ({"diagnosis": "partial", "state": "draft"}, ("diagnosis", "draft")),
    ({"decision": "fail", "diagnosis": "explained", "state": "draft"}, ("failing", "diagnosis", "draft")),
])  # fmt: skip
def test_a_machine_stands_as_its_newest_certificate_says(said: dict[str, str], found: tuple[str, ...]) -> None:
    assert groups(newest(**said), due(200), TODAY) == found


def test_a_machine_without_a_certificate_is_not_in_order() -> None:
    assert groups(Newest(newest().machine, None), None, TODAY) == ("never",)


def test_what_is_longest_overdue_comes_first_then_what_fails() -> None:
    known = {
        "in order": ({}, 300),
        "late": ({}, -5),
        "later": ({}, -50),
        "fails": ({"decision": "fail"}, 100),
        "soon": ({}, 9),
    }
    machines = [newest(name, **said) for name, (said, _) in known.items()]
    stands = [
        MachineStanding.of(one, due(days), TODAY) for one, (_, days) in zip(machines, known.values(), strict=True)
    ]
    assert [one.serial for one in in_order(stands)] == ["later", "late", "fails", "soon", "in order"]


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
    assert any("simulated" in line for line in verdict(known(laboratory, files("sim-1")["results.json"])).lines)


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


CONTENT = b'{"a": 1}'
HASH = sha256(CONTENT).hexdigest()


def entry(**content: object) -> Entry:
    return Entry(1, "", "report", json.dumps(content), "", "")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "report"
    folder.mkdir()
    (folder / "results.json").write_bytes(CONTENT)
    (tmp_path / "secret").write_bytes(CONTENT)
    return folder


def test_a_file_is_read_while_it_is_the_recorded_one(folder: Path) -> None:
    file = RecordedFile("results.json", HASH)
    assert content_of(file, folder) == CONTENT
    assert results_of((file,), folder) == {"a": 1}
    (folder / "results.json").write_bytes(b'{"a": 2}')
    with pytest.raises(RefusedRequest, match="altered since"):
        content_of(file, folder)
    assert results_of((file,), folder) == {}


def test_a_file_that_was_signed_since_is_handed_out_as_it_was_signed(folder: Path) -> None:
    (folder / "results.json").write_bytes(b"signed")
    said = entry(files={"results.json": HASH, "posterior.npz": HASH})
    signed = {"results.json": sha256(b"signed").hexdigest(), "other": HASH}
    posterior, results = files_of(said, folder, signed)
    assert (posterior.name, posterior.sha256) == ("posterior.npz", HASH)
    assert content_of(results, folder) == b"signed"


@pytest.mark.parametrize("name", ["../secret", "/etc/passwd", "..", "", "a/../../secret", "C:secret", "a\\b", "x\0"])
def test_no_name_leads_out_of_the_folder(folder: Path, name: str) -> None:
    assert files_of(entry(files={name: HASH}), folder) == ()
    with pytest.raises(RefusedRequest) as refused:
        content_of(RecordedFile(name, HASH), folder)
    assert refused.value.status == 404


def test_a_link_is_not_followed_though_its_bytes_are_right(folder: Path, tmp_path: Path) -> None:
    (folder / "results.json").unlink()
    (folder / "results.json").symlink_to(tmp_path / "secret")
    with pytest.raises(RefusedRequest, match="a link to another place"):
        content_of(RecordedFile("results.json", HASH), folder)
    (folder / "inside").symlink_to(tmp_path)
    with pytest.raises(RefusedRequest, match="a link to another place"):
        content_of(RecordedFile("inside/secret", HASH), folder)


def test_what_is_gone_is_said_to_be_gone(folder: Path) -> None:
    with pytest.raises(RefusedRequest) as refused:
        content_of(RecordedFile("certificate.pdf", HASH), folder)
    assert refused.value.status == 410


def test_a_manifest_is_believed_only_with_the_recorded_results(folder: Path) -> None:
    """An entry that names no files was made before they were named; its results.json pins the folder's manifest."""
    manifest = {
        "schema": "cmm-uq/manifest/1", "command": "report", "job": {"id": "k-1", "origin": "measured"},
        "files": {"results.json": {"sha256": HASH, "bytes": 8}, "certificate.pdf": {"sha256": "0" * 64, "bytes": 1}},
    }  # fmt: skip
    (folder / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
    assert [file.name for file in files_of(entry(results_sha256=HASH), folder)] == ["certificate.pdf", "results.json"]
    assert files_of(entry(results_sha256="1" * 64), folder) == ()
    assert files_of(entry(), folder) == ()


@pytest.mark.parametrize(("name", "media", "how"), [
    ("certificate.html", "text/html; charset=utf-8", "inline"), ("certificate.pdf", "application/pdf", "inline"),
    ("recording.csv", "text/plain; charset=utf-8", "inline"), ("posterior.npz", "application/octet-stream", "attachment"),
    ("page.xhtml", "application/octet-stream", "attachment"),
])  # fmt: skip
def test_a_browser_shows_only_what_it_can_show_safely(name: str, media: str, how: str) -> None:
    answer = sent_file(name, b"", keep=False)
    assert (answer.media, answer.headers["Content-Disposition"].partition(";")[0]) == (media, how)
    assert "default-src 'none'" in answer.policy
    assert "script-src" not in answer.policy
    assert sent_file(name, b"", keep=True).headers["Content-Disposition"].startswith("attachment")


def test_a_recorded_page_can_run_nothing_here() -> None:
    """Not of this origin (sandbox), and without scripts."""
    assert sent_file("certificate.html", b"", keep=False).policy.startswith("sandbox; default-src 'none'")


def test_a_name_in_a_header_stays_a_name() -> None:
    answer = sent_file('a"\r\nSet-Cookie: b=ü.pdf', b"", keep=False)
    assert answer.headers["Content-Disposition"] == "inline; filename*=UTF-8''a%22%0D%0ASet-Cookie%3A%20b%3D%C3%BC.pdf"
