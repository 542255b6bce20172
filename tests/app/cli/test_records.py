"""``cmm-uq records``: verified after somebody altered them, backed up, restored, imported, kept small; and what is refused."""

from __future__ import annotations

import json
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from cmm_uq.laboratory.records.opening import REVISION
from cmm_uq.laboratory.records.tables import TRIGGERS
from tests.app.cli.laboratory import PLACE, kept, older
from tests.app.cli.process import run
from tests.laboratory.records.histories import certificate

GUARDS = "DROP TRIGGER entries_no_update; DROP TRIGGER entries_no_delete; DROP TRIGGER entries_no_replace;"


def behind(place: Path, script: str) -> None:
    """What somebody does with another program, who puts the triggers back afterwards."""
    with closing(sqlite3.connect(place)) as raw:
        raw.executescript(script)
        for statement in TRIGGERS["sqlite"] if GUARDS in script else ():
            raw.execute(statement)


@pytest.fixture
def three(tmp_path: Path) -> Path:
    """Records of three certificates, without their files."""
    return kept(tmp_path / "three" / "records.db", *(certificate(serial) for serial in ("1101", "1102", "1103")))


def test_a_report_is_sound_and_its_head_holds_until_more_is_recorded_and_after(laboratory: Path) -> None:
    head = json.loads(run("records", "head", "--records", PLACE, "--json", cwd=laboratory).stdout)
    assert head["entries"] == 1
    assert run("records", "head", "--records", PLACE, cwd=laboratory).stdout == f"1 {head['head']}\n"
    assert run("release", "K-1", "--by", "A. Huber", "--records", PLACE, cwd=laboratory).returncode == 0
    done = run("records", "verify", "--records", PLACE, "--head", f" {head['head'].upper()}", "--json", cwd=laboratory)
    told = json.loads(done.stdout)
    assert (done.returncode, done.stderr) == (0, "")
    assert (told["records"], told["entries"], told["sound"], told["findings"]) == (str(PLACE), 2, True, [])
    assert told["head"] != head["head"]


@pytest.mark.parametrize(
    ("script", "kind", "words"),
    [
        ("UPDATE entries SET content = replace(content, 'pass', 'fail') WHERE number = 2", "chain", "was altered"),
        ("UPDATE entries SET content = x'00ff' WHERE number = 2", "chain", "was altered"),
        ("DELETE FROM entries WHERE number = 2", "chain", "entry 2 is missing"),
        ("DELETE FROM entries WHERE number = 3", "index", "the table machines is not what the entries say"),
        ("UPDATE figures SET value = 0.1 WHERE certificate = 2", "index", "the table figures is not what"),
        ("UPDATE certificates SET state = 'released'", "index", "the table certificates is not what"),
    ],
)
def test_what_was_altered_behind_its_back_is_found(three: Path, script: str, kind: str, words: str) -> None:
    behind(three, GUARDS + script)
    done = run("records", "verify", "--records", three, "--json")
    assert (done.returncode, done.stderr) == (4, "")
    told = json.loads(done.stdout)
    assert not told["sound"]
    assert any(one["kind"] == kind and words in one["problem"] for one in told["findings"])


def test_what_is_wrong_is_printed_entry_by_entry(three: Path) -> None:
    behind(three, GUARDS + "UPDATE entries SET kind = 'check' WHERE number = 2")
    done = run("records", "verify", "--records", three)
    assert (done.returncode, done.stderr) == (4, "")
    assert done.stdout.startswith("chain: entry 2: was altered\n3 entries, NOT sound")


def test_the_database_itself_refuses_to_alter_entries(three: Path) -> None:
    with pytest.raises(sqlite3.IntegrityError, match="entries are never changed"):
        behind(three, "UPDATE entries SET kind = 'check'")
    assert run("records", "verify", "--records", three).returncode == 0


def test_missing_last_entries_are_found_by_the_head_that_was_filed(three: Path) -> None:
    """Entry 3 and all that follows from it gone: sound by itself, and not what was filed."""
    head = run("records", "head", "--records", three).stdout.split()[1]
    shorter = kept(three.with_name("shorter.db"), *(certificate(serial) for serial in ("1101", "1102")))
    assert run("records", "verify", "--records", shorter, "--no-files").returncode == 0
    done = run("records", "verify", "--records", shorter, "--head", head)
    assert done.returncode == 4
    assert f"no entry has the hash {head}: the last are missing" in done.stdout


def test_an_altered_certificate_is_found_and_one_that_is_gone_is_told(laboratory: Path) -> None:
    page = laboratory / "reports" / "mount" / "certificate.html"
    page.write_text(page.read_text(encoding="utf-8").replace("K-1", "K-2"), encoding="utf-8")
    done = run("records", "verify", "--records", PLACE, cwd=laboratory)
    assert done.returncode == 4
    assert "certificate.html was altered or removed" in done.stdout
    assert run("records", "verify", "--records", PLACE, "--no-files", cwd=laboratory).returncode == 0
    shutil.rmtree(page.parent)
    done = run("records", "verify", "--records", PLACE, cwd=laboratory)
    assert done.returncode == 0
    assert "missing: entry 1" in done.stdout


def test_a_backup_is_restored_elsewhere_and_over_what_is_kept(laboratory: Path, tmp_path: Path) -> None:
    head = run("records", "head", "--records", PLACE, cwd=laboratory).stdout.split()[1]
    done = run("records", "backup", "saved.db", "--records", PLACE, cwd=laboratory)
    assert (done.returncode, done.stderr) == (0, "")
    assert head in done.stdout
    again = run("records", "backup", "saved.db", "--records", PLACE, cwd=laboratory)
    assert again.returncode == 3
    assert "saved.db: is there already" in again.stderr
    done = run("records", "restore", laboratory / "saved.db", "--records", tmp_path / "new" / "records.db")
    assert done.returncode == 0
    assert run("records", "head", "--records", tmp_path / "new" / "records.db").stdout == f"1 {head}\n"
    run("release", "K-1", "--by", "A", "--records", PLACE, cwd=laboratory)
    assert run("records", "restore", "saved.db", "--records", PLACE, "--quiet", cwd=laboratory).stdout == ""
    assert run("records", "head", "--records", PLACE, cwd=laboratory).stdout == f"1 {head}\n"
    before = PLACE.with_name("records.db.before-restore")
    assert run("records", "head", "--records", before, cwd=laboratory).stdout.startswith("2 ")
    assert run("records", "verify", "--records", PLACE, cwd=laboratory).returncode == 0


def test_neither_a_broken_backup_nor_a_folder_takes_the_place_of_records(three: Path, tmp_path: Path) -> None:
    good, folder = tmp_path / "good.db", tmp_path / "folder"
    assert run("records", "backup", good, "--records", three).returncode == 0
    folder.mkdir()
    for place in (folder, Path()):
        done = run("records", "restore", good, "--records", place, cwd=tmp_path)
        assert done.returncode == 2
        assert "is a folder, and records are a file" in done.stderr
    assert folder.is_dir()
    head = run("records", "head", "--records", three).stdout
    behind(good, GUARDS + "DELETE FROM entries WHERE number = 1")
    done = run("records", "restore", good, "--records", three)
    assert done.returncode == 2
    assert "entry 1 is missing" in done.stderr
    assert run("records", "head", "--records", three).stdout == head
    assert sorted(path.name for path in three.parent.iterdir() if "restore" in path.name) == []


def test_reports_of_before_are_imported_once_and_an_altered_one_is_refused(laboratory: Path) -> None:
    archive = laboratory / "archive"
    for year, version in (("2024", "0.3.0"), ("2025", "0.4.0")):
        older(Path(shutil.copytree(laboratory / "reports" / "mount", archive / year / "mount")), version)
    altered = Path(shutil.copytree(laboratory / "reports" / "mount", archive / "2026" / "mount"))
    (altered / "certificate.html").write_text("better", encoding="utf-8")
    done = run("records", "import", archive, "--records", "lab.db", cwd=laboratory)
    assert done.returncode == 2
    assert done.stdout.splitlines()[0] == "2 recorded, 0 recorded before, 1 refused"
    assert "certificate.html: was altered or removed after it was written" in done.stderr
    done = run("records", "import", archive / "2024", archive / "2025", "--records", "lab.db", cwd=laboratory)
    assert (done.returncode, done.stdout) == (0, "0 recorded, 2 recorded before, 0 refused\n")
    (altered.parents[1] / "2024" / "mount" / "certificate.pdf").unlink()
    assert run("records", "verify", "--records", "lab.db", cwd=laboratory).returncode == 4


def test_of_a_report_whose_pdf_carries_no_inputs_only_the_results_are_gone_by(laboratory: Path) -> None:
    folder = laboratory / "reports" / "mount"
    manifest = json.loads((folder / "manifest.json").read_bytes())
    del manifest["files"]["certificate.pdf"]
    (folder / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
    (folder / "certificate.pdf").unlink()
    done = run("records", "import", "reports", "--records", "lab.db", cwd=laboratory)
    assert done.returncode == 0
    assert "the inputs of its job cannot be read, so only results.json was gone by" in done.stdout


@pytest.mark.parametrize(("folder", "words"), [("nowhere", "no such folder"), ("job", "holds no report")])
def test_nothing_is_made_of_folders_without_reports(laboratory: Path, folder: str, words: str) -> None:
    done = run("records", "import", folder, "--records", "lab.db", cwd=laboratory)
    assert (done.returncode, done.stdout) == (2, "")
    assert f"{folder}: {words}" in done.stderr
    assert not (laboratory / "lab.db").exists()


@pytest.mark.parametrize(("script", "command", "words"), [
    ("UPDATE covariances SET lower = 5", ("release", "K-1", "--by", "A"), "a row is not as it was recorded"),
    (f"UPDATE covariances SET lower = '{'[' * 3000}'", ("release", "K-1", "--by", "A"), "it is no JSON"),
    ("DELETE FROM quantities WHERE id = 2", ("affected", "--version", "0.3.0", "--list"), "a row is not as it was recorded"),
    ("UPDATE certificates SET adjusted_since = 'then'", ("affected", "--version", "0.3.0"), "a row is not as it was recorded"),
    ("UPDATE certificates SET day = '2026-13-40'", ("history", "77"), "a row is not as it was recorded"),
    ("UPDATE quantities SET unit = x'ff'", ("history", "77"), "a row is not as it was recorded"),
    ("UPDATE figures SET value = 'x'", ("fleet",), "a row is not as it was recorded"),
    ("UPDATE certificates SET day = '2026-13-40'", ("due",), "a row is not as it was recorded"),
])  # fmt: skip
def test_rows_that_somebody_altered_are_refused_in_a_line_and_verification_says_so(
    laboratory: Path, script: str, command: tuple[str, ...], words: str
) -> None:
    behind(laboratory / PLACE, script)
    done = run(*command, "--records", PLACE, cwd=laboratory)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert f"{PLACE}: " in done.stderr
    assert words in done.stderr
    assert run("records", "verify", "--records", PLACE, cwd=laboratory).returncode == 4


def test_nothing_is_made_of_reports_that_are_all_refused(laboratory: Path) -> None:
    (laboratory / "reports" / "mount" / "certificate.html").write_text("better", encoding="utf-8")
    done = run("records", "import", "reports", "--records", "new/lab.db", cwd=laboratory)
    assert (done.returncode, done.stdout) == (2, "0 recorded, 0 recorded before, 1 refused\n")
    assert "certificate.html: was altered or removed after it was written" in done.stderr
    assert not (laboratory / "new").exists()


def test_a_retention_says_first_and_removes_then(laboratory: Path) -> None:
    folder = laboratory / "reports" / "mount"
    older(folder, "0.4.0", lambda results: results["job"].update(date="2001-01-01"))
    assert run("records", "import", "reports", "--records", "lab.db", cwd=laboratory).returncode == 0
    files = sorted(path.name for path in folder.iterdir())
    asked = ("records", "retain", "--keep-years", "10", "--records", "lab.db")
    done = run(*asked, "--dry-run", cwd=laboratory)
    assert done.stdout.splitlines()[-1].endswith("would be removed")
    assert len(done.stdout.splitlines()) == len(files) + 1
    assert sorted(path.name for path in folder.iterdir()) == files
    assert run(*asked, cwd=laboratory).stdout.splitlines()[-1].startswith(f"{len(files)} files of ")
    assert not folder.exists()
    assert run("records", "verify", "--records", "lab.db", cwd=laboratory).stdout.startswith("2 entries, sound")


def test_records_of_this_version_need_no_migration(three: Path) -> None:
    done = run("records", "migrate", "--records", three)
    assert (done.returncode, done.stderr) == (0, "")
    assert "already" in done.stdout


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ("none", "no records are asked for"),
        ("gone.db", "there are no records"),
        ("empty.db", "holds no records"),
        ("other.db", "is the database of another program"),
        ("text.db", "is no database"),
        (".", "is a folder"),
    ],
)
def test_what_is_no_records_is_refused_in_a_line(place: str, words: str, tmp_path: Path) -> None:
    behind(tmp_path / "other.db", "CREATE TABLE stock (piece TEXT)")
    (tmp_path / "text.db").write_text("no database " * 99, encoding="utf-8")
    (tmp_path / "empty.db").touch()
    done = run("records", "verify", "--records", place, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert words in done.stderr
    assert done.stderr.rstrip("\n").count("\n") == 0


@pytest.mark.parametrize(
    "arguments",
    [
        ("records", "import", "reports"),
        ("records", "migrate"),
        ("release", "K-1", "--by", "A"),
        ("affected", "--version", "0.1.0"),
    ],
)
def test_the_database_of_another_program_is_left_as_it_is(
    arguments: tuple[str, ...], reported_once: Path, tmp_path: Path
) -> None:
    behind(tmp_path / "other.db", "CREATE TABLE stock (piece TEXT)")
    before = (tmp_path / "other.db").read_bytes()
    done = run(*arguments, "--records", tmp_path / "other.db", cwd=reported_once)
    assert (done.returncode, done.stdout) == (2, "")
    assert "is the database of another program" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["other.db"]
    assert (tmp_path / "other.db").read_bytes() == before


@pytest.mark.parametrize(
    "arguments",
    [("records", "verify"), ("release", "K", "--by", "A"), ("affected", "--version", "0.1.0")],
)
def test_with_json_the_refusal_is_an_object(arguments: tuple[str, ...], tmp_path: Path) -> None:
    done = run(*arguments, "--records", "gone.db", "--json", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    told = json.loads(done.stderr)["error"]
    assert (told["problem"], told["where"], told["exit_code"]) == ("there are no records", "gone.db", 2)


def test_with_json_each_tells_what_it_did_as_one_object(three: Path, tmp_path: Path) -> None:
    def told(*arguments: str | Path) -> dict[str, object]:
        done = run("records", *arguments, "--json")
        assert (done.returncode, done.stderr) == (0, "")
        answer: dict[str, object] = json.loads(done.stdout)
        return answer

    head = told("head", "--records", three)
    copy, other = tmp_path / "copy.db", tmp_path / "other.db"
    assert told("backup", copy, "--records", three) == {"backup": str(copy)} | head
    assert told("restore", copy, "--records", other) == {"records": str(other)} | head
    assert told("migrate", "--records", other) == {"records": str(other), "from": REVISION, "to": REVISION}
    kept_files = told("retain", "--keep-years", "1", "--dry-run", "--records", other)
    assert (kept_files["removed"], kept_files["files"]) == (False, [])
