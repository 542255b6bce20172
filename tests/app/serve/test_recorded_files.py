"""Only the very bytes that were recorded are handed out, by a name that the entry knows."""

from __future__ import annotations

import json
from hashlib import sha256
from pathlib import Path

import pytest

from cmm_uq.app.serve.certificate_page import RecordedFile, content_of, files_of, results_of, sent
from cmm_uq.app.serve.exchange import RefusedRequest
from cmm_uq.laboratory.records.facts import Entry

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
    answer = sent(RecordedFile(name, HASH), b"", keep=False)
    assert (answer.media, answer.headers["Content-Disposition"].partition(";")[0]) == (media, how)
    assert "default-src 'none'" in answer.policy
    assert "script-src" not in answer.policy
    assert sent(RecordedFile(name, HASH), b"", keep=True).headers["Content-Disposition"].startswith("attachment")


def test_a_recorded_page_can_run_nothing_here() -> None:
    """Not of this origin (sandbox), and without scripts."""
    assert sent(RecordedFile("certificate.html", HASH), b"", keep=False).policy.startswith(
        "sandbox; default-src 'none'"
    )


def test_a_name_in_a_header_stays_a_name() -> None:
    answer = sent(RecordedFile('a"\r\nSet-Cookie: b=ü.pdf', HASH), b"", keep=False)
    assert answer.headers["Content-Disposition"] == "inline; filename*=UTF-8''a%22%0D%0ASet-Cookie%3A%20b%3D%C3%BC.pdf"
