"""The desk over HTTP: uploads and limits, writes and conflicts, what is shown in a sandbox, and what stays after a kill."""

from __future__ import annotations

import re
import signal
import socket
import subprocess
import sys
import time
import tomllib
from contextlib import closing
from pathlib import Path

import pytest

from cmm_uq.app.desk import place
from cmm_uq.app.desk.workers import Worker
from cmm_uq.base.errors import CmmUqError
from tests.app.desk.conftest import Visitor
from tests.app.desk.test_questions import ANSWERS, EXPORT
from tests.app.serve.test_exchange import BOUNDARY, form
from tests.conftest import ROOT


def draft_of(visitor: Visitor, content: bytes, name: str = "export.csv") -> str:
    answer = visitor.drop(content, name)
    assert answer.status == 303, answer.text
    return answer.headers["location"].partition("draft=")[2]


def made(visitor: Visitor, folder: str = "K-1") -> str:
    """A job of the tutorial's export, by forms alone."""
    draft = draft_of(visitor, EXPORT.read_bytes(), EXPORT.name)
    page = visitor.get(f"/desk/read?draft={draft}")
    answer = visitor.post("/desk/read", draft=draft, seen=page.hidden("seen"), then="on")
    assert answer.headers["location"] == f"/desk/artefact?draft={draft}"
    page = visitor.get(f"/desk/fields?draft={draft}&kind=ballbar")
    answer = visitor.post(
        "/desk/fields", draft=draft, kind="ballbar", seen=page.hidden("seen"), then="create", folder=folder, **ANSWERS
    )
    assert answer.headers.get("location") == f"/desk/job?name={folder}", answer.text
    return folder


@pytest.fixture(scope="module")
def worked(seated: Visitor) -> Visitor:
    made(seated)
    return seated


def test_a_dropped_name_is_reduced_and_nothing_is_read_elsewhere(seated: Visitor) -> None:
    draft_of(seated, EXPORT.read_bytes(), "..\\..\\CON.xlsx")
    names = {path.name for path in seated.desk.root.rglob("*.xlsx")}
    assert "export-CON.xlsx" in names
    assert not list(seated.desk.root.parent.glob("*.xlsx"))


def test_half_a_gigabyte_is_refused_in_words_before_it_is_read(seated: Visitor) -> None:
    begun = time.monotonic()
    head = (
        f"POST /desk/drop HTTP/1.1\r\nHost: {seated.host}\r\nCookie: {seated.cookie}\r\nOrigin: http://{seated.host}\r\n"
        "Content-Type: multipart/form-data; boundary=x\r\nContent-Length: 500000000\r\n\r\n"
    )
    with closing(socket.create_connection(("127.0.0.1", seated.server.server_port), timeout=10)) as line:
        line.sendall(head.encode())
        answer = b""
        while b"</html>" not in answer:
            answer += line.recv(65536)
    assert answer.startswith(b"HTTP/1.1 413")
    assert b"larger than 61 MB" in answer
    assert time.monotonic() - begun < 5


def test_what_does_not_come_whole_leaves_nothing(seated: Visitor) -> None:
    before = sorted(seated.desk.root.rglob("*"))
    head = (
        f"POST /desk/drop HTTP/1.1\r\nHost: {seated.host}\r\nCookie: {seated.cookie}\r\nOrigin: http://{seated.host}\r\n"
        "Content-Type: multipart/form-data; boundary=x\r\nContent-Length: 5000\r\n\r\n"
        '--x\r\nContent-Disposition: form-data; name="file"; filename="a.csv"\r\n\r\n1;2;3'
    )
    with closing(socket.create_connection(("127.0.0.1", seated.server.server_port), timeout=10)) as line:
        line.sendall(head.encode())
        line.shutdown(socket.SHUT_WR)
        while line.recv(65536):
            pass
    assert sorted(seated.desk.root.rglob("*")) == before


def test_more_exports_than_anybody_finishes_are_refused(visitor: Visitor, monkeypatch: pytest.MonkeyPatch) -> None:
    visitor.open()
    monkeypatch.setattr(place, "MOST_DRAFTS", 1)
    draft_of(visitor, b"X;Y;Z\n1;2;3\n")
    assert "lie here unfinished" in visitor.drop(b"X;Y;Z\n1;2;3\n").text


@pytest.mark.long
def test_a_workbook_that_unpacks_to_more_than_it_may_is_refused_in_words(
    visitor: Visitor, monkeypatch: pytest.MonkeyPatch
) -> None:
    visitor.open()
    bomb = (ROOT / "docs" / "tutorial" / "ballbar-export.xlsx").read_bytes()
    draft = draft_of(visitor, bomb + b"", "a.xlsx")
    import zipfile  # of nothing but zeros

    path = visitor.desk.root / ".cmm-uq" / "desk" / draft / "a.xlsx"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("[Content_Types].xml", "<Types/>")
        for i in range(5):
            archive.writestr(f"xl/worksheets/sheet{i}.xml", b"\0" * 100_000_000)
    page = visitor.get(f"/desk/read?draft={draft}")
    assert "once it is unpacked" in page.text
    assert "Delete this export" in page.text


@pytest.mark.parametrize(
    ("content", "told"), [(b"%PDF-1.7 x", "is a PDF"), (b"", "is empty"), (b"\x00\x01\x02", "is no text")]
)
def test_what_is_no_export_is_told_with_what_to_do_and_can_be_deleted(
    seated: Visitor, content: bytes, told: str
) -> None:
    draft = draft_of(seated, content, "a.bin")
    page = seated.get(f"/desk/read?draft={draft}")
    assert page.status == 200
    assert told in page.text
    assert "Export" in page.text
    assert "It is right" not in page.text
    assert seated.post("/desk/delete", draft=draft).status == 303
    assert seated.get(f"/desk/read?draft={draft}").status == 409


@pytest.mark.long
def test_a_worker_that_takes_too_long_or_too_much_is_ended_and_another_begun(tmp_path: Path) -> None:
    worker = Worker(tmp_path)
    with pytest.raises(CmmUqError, match="took longer than"):
        worker.ask("kinds", seconds=0.01)
    small, path = Worker(tmp_path, memory=300_000_000), tmp_path / "large.csv"
    path.write_text("1;2;3\n" * 8_000_000, encoding="utf-8")
    with pytest.raises(CmmUqError, match=r"needed more|needs more memory|has ended"):
        small.ask("read", path=str(path), keys={})
    assert worker.ask("kinds")
    worker.end()
    small.end()


def test_two_tabs_do_not_write_over_each_other(worked: Visitor) -> None:
    path = worked.desk.root / "K-1" / "job.toml"
    original = path.read_bytes()
    page = worked.get("/desk/job?name=K-1")
    seen, text = page.hidden("seen"), original.decode()
    first = worked.post("/desk/job", name="K-1", seen=seen, then="save", text=text.replace("CMM 3", "CMM three"))
    assert first.status == 303
    second = worked.post("/desk/job", name="K-1", seen=seen, then="save", text=text.replace("CMM 3", "CMM iii"))
    assert second.status == 409
    assert "changed meanwhile" in second.text
    assert re.search(r"-name = &#34;CMM three&#34;.*\n\+name = &#34;CMM iii&#34;", second.text)
    assert b"CMM three" in path.read_bytes()
    assert "CMM iii" in second.text.partition("<textarea")[2], "what was typed is gone"
    assert worked.post("/desk/job", name="K-1", seen=second.hidden("seen"), then="save", text=text).status == 303
    assert path.read_bytes() == original


def test_the_machine_of_a_job_is_shown(worked: Visitor) -> None:
    page = worked.get("/desk/job?name=K-1")
    assert '<img src="/desk/machine?name=K-1"' in page.text
    picture = worked.get("/desk/machine?name=K-1")
    assert picture.text.startswith("<svg")
    assert "Carriage X" in picture.text
    assert worked.get("/desk/machine?name=K-9").status == 409


def test_an_editor_is_not_written_over(worked: Visitor) -> None:
    path = worked.desk.root / "K-1" / "job.toml"
    original = path.read_bytes()
    page = worked.get("/desk/job?name=K-1")
    path.write_bytes(original + b"# by an editor\n")
    assert worked.post("/desk/job", name="K-1", seen=page.hidden("seen"), then="save", text="x = 1").status == 409
    assert path.read_bytes() == original + b"# by an editor\n"
    path.write_bytes(original)


def test_two_tabs_on_one_export_do_not_lose_an_answer(seated: Visitor) -> None:
    draft = draft_of(seated, EXPORT.read_bytes(), EXPORT.name)
    seen = seated.get(f"/desk/read?draft={draft}").hidden("seen")
    assert seated.post("/desk/read", draft=draft, seen=seen, then="read", unit="inch").status == 303
    late = seated.post("/desk/read", draft=draft, seen=seen, then="read", unit="mm")
    assert late.status == 409
    assert "changed meanwhile" in late.text


@pytest.mark.long
def test_checking_writes_nothing_and_says_what_the_command_says(worked: Visitor) -> None:
    path = worked.desk.root / "K-1" / "job.toml"
    text = path.read_text(encoding="utf-8")
    before = {one: one.stat().st_mtime_ns for one in worked.desk.root.rglob("*")}
    found = worked.post("/desk/check", name="K-1", text=text.replace("404.205", "399"))
    told = subprocess.run(
        [sys.executable, "-m", "cmm_uq", "check", "K-1"],
        cwd=worked.desk.root,
        capture_output=True,
        text=True,
        check=False,
    ).stdout
    assert "404.205" in found.text
    assert "SOUND" in told
    page = worked.get("/desk/job?name=K-1").text
    (warning,) = re.findall(r"<li[^>]*>(K-1/job.toml: not stated[^<]*)", page)
    assert warning in told
    assert {one: one.stat().st_mtime_ns for one in worked.desk.root.rglob("*")} == before


HOSTILE = b"<!doctype html><script>fetch('/desk')</script><p>certificate</p>"


@pytest.mark.parametrize(("name", "media"), [
    ("page.html", "text/html"), ("picture.svg", "image/svg+xml"), ("data.json", "application/json"),
    ("table.csv", "text/plain"), ("run.js", "application/octet-stream"),
])  # fmt: skip
def test_files_of_the_folder_are_shown_in_a_sandbox(worked: Visitor, name: str, media: str) -> None:
    (worked.desk.root / "K-1" / name).write_bytes(HOSTILE)
    answer = worked.get(f"/desk/file?at=K-1/{name}")
    assert answer.headers["content-type"].startswith(media)
    policy = answer.headers["content-security-policy"]
    assert policy.startswith("sandbox; default-src 'none'")
    assert "script-src" not in policy
    assert "frame-ancestors 'self'" in policy
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert answer.headers["content-disposition"].startswith("attachment" if name == "run.js" else "inline")
    kept = worked.get(f"/desk/file?at=K-1/{name}&keep=yes")
    assert kept.headers["content-disposition"].startswith("attachment")
    (worked.desk.root / "K-1" / name).unlink()


@pytest.mark.parametrize(
    "at", ["../x", "/etc/passwd", ".cmm-uq/desk/last.json", "K-1/../../x", "K-1/.cmm-uq/job.schema.json", "C:/x"]
)
def test_no_file_is_shown_from_elsewhere(worked: Visitor, at: str) -> None:
    assert worked.get(f"/desk/file?at={at}").status == 409


@pytest.mark.parametrize("folder", ["", "../x", "a/b", "CON", "reports", ".hidden", "K-1", "x" * 300])
def test_a_folder_that_cannot_be_new_is_told_and_nothing_is_lost(worked: Visitor, folder: str) -> None:
    draft = draft_of(worked, EXPORT.read_bytes(), EXPORT.name)
    seen = worked.get(f"/desk/fields?draft={draft}&kind=ballbar").hidden("seen")
    answer = worked.post(
        "/desk/fields", draft=draft, kind="ballbar", seen=seen, then="create", folder=folder, **ANSWERS
    )
    assert answer.status == 409
    assert 'value="CMM 3"' in answer.text
    worked.post("/desk/delete", draft=draft)


def test_what_was_filled_in_last_is_there_the_next_time(worked: Visitor) -> None:
    draft = draft_of(worked, EXPORT.read_bytes(), EXPORT.name)
    page = worked.get(f"/desk/fields?draft={draft}&kind=ballbar").text
    chosen = r'name="conformity.standard"[^>]*>(?:\s*<option[^>]*>[^<]*</option>)*?\s*<option value="([^"]*)" selected'
    assert re.findall(chosen, page) == ["ASME B89.4.1-1997"], "how the laboratory works is filled in"
    assert re.search(r'name="conformity.limit_um"[^>]*value=""', page), "the limit of another machine is not"
    page = worked.get(f"/desk/fields?draft={draft}&kind=step_gauge").text
    # what another machine, artefact or kind of measurement has is offered alone
    assert re.findall(chosen, page) == [""]
    assert "The last time: ASME B89.4.1-1997" in page
    for key in ("machine.serial", "artefact.U_um"):
        assert re.search(rf'name="{key}"[^>]*value=""', page)
        assert re.search(rf'<datalist id="[^"]*-{key}-again"><option value="[^"]', page)
    assert "The last time: 1102" in page
    assert re.search(r'name="job.date"[^>]*value=""', page), "a date is of one measurement"


@pytest.mark.long
def test_a_killed_server_loses_nothing(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "cmm_uq", "desk", str(tmp_path), "--no-open"]

    def started() -> tuple[subprocess.Popen[str], Visitor]:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        assert process.stdout is not None
        found = re.search(r"http://127\.0\.0\.1:(\d+)/open\?token=\S+", process.stdout.readline())
        assert found is not None
        return process, Visitor(None, type("At", (), {"server_port": int(found[1])}), found[0], []).open()  # type: ignore[arg-type]

    process, visitor = started()
    draft = draft_of(visitor, EXPORT.read_bytes(), EXPORT.name)
    seen = visitor.get(f"/desk/fields?draft={draft}&kind=ballbar").hidden("seen")
    visitor.post("/desk/fields", draft=draft, kind="ballbar", seen=seen, then="check", folder="K-1", **ANSWERS)
    process.send_signal(signal.SIGKILL if sys.platform != "win32" else signal.SIGTERM)
    process.wait()
    process.stdout.close()  # type: ignore[union-attr]
    process, visitor = started()
    assert EXPORT.name in visitor.get("/desk").text
    page = visitor.get(f"/desk/fields?draft={draft}&kind=ballbar")
    assert re.search(r'name="artefact.length_mm"[^>]*value="404.205"', page.text)
    answer = visitor.post(
        "/desk/fields", draft=draft, kind="ballbar", seen=page.hidden("seen"), then="create", folder="K-1", **ANSWERS
    )
    assert answer.headers["location"] == "/desk/job?name=K-1"
    visitor.post("/desk/run", name="K-1")
    time.sleep(1.5)
    process.kill()
    process.wait()
    process.stdout.close()  # type: ignore[union-attr]
    process, visitor = started()
    assert visitor.get("/desk/job?name=K-1").status == 200
    process.terminate()
    process.wait()
    process.stdout.close()  # type: ignore[union-attr]
    left = [path for path in tmp_path.glob("reports/K-1/*") if not path.name.startswith(".")]
    assert not left or (tmp_path / "reports" / "K-1" / "manifest.json").is_file(), "half a certificate"


def test_for_others_it_is_refused_with_what_is_for_them(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "cmm_uq", "desk", str(tmp_path), "--no-open", "--bind", "0.0.0.0"]
    told = subprocess.run(command, capture_output=True, text=True, check=False)
    assert told.returncode == 2
    assert "for this machine alone" in told.stderr
    assert "cmm-uq serve --bind" in told.stderr


def test_the_artefacts_certificate_is_dropped_beside_its_job_and_named(worked: Visitor) -> None:
    def drop(name: str) -> int:
        media = f"multipart/form-data; boundary={BOUNDARY}"
        own = {"Content_Type": media, "Origin": f"http://{worked.host}"}
        return worked.send(
            "POST", "/desk/certified?name=K-1", form(b"point;reference_mm\n1;0\n2;40\n", name), **own
        ).status

    job = worked.desk.root / "K-1" / "job.toml"
    assert drop("gauge.csv") == 303
    text = job.read_text(encoding="utf-8")
    assert tomllib.loads(text)["artefact"]["certificate"]["file"] == "gauge.csv"
    assert "gauge.csv" in worked.get("/desk/job?name=K-1").text
    assert drop("gauge.csv") == 409  # over nothing
    job.write_text(text.replace("[artefact]", "[[artefact", 1), encoding="utf-8")
    assert drop("other.csv") == 409
    assert not (job.parent / "other.csv").exists()
    job.write_text(text, encoding="utf-8")
