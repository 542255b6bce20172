"""``cmm-uq affected``: certificates that a correction of the package touches, computed again and compared figure by figure."""

from __future__ import annotations

import datetime as dt
import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from cmm_uq import __version__
from cmm_uq.app.commands.certificates import again as corrected
from cmm_uq.app.commands.certificates.again import AffectedCertificate, Correction, JobInputs, stated_version
from cmm_uq.laboratory.records import open_records
from tests.app.cli.laboratory import kept, older
from tests.app.cli.process import run
from tests.laboratory.records.histories import certificate

OFF_MM = 0.004
"""By which the older version stated the offset U1 of the digitizer wrongly."""

ANY_DIAGNOSIS = "0.5.0: A diagnosis asserts nothing whose size holds zero"
"""Beginning of the correction of corrections.toml that touches the diagnosis of every kind."""


def wrong(results: dict[str, Any]) -> None:
    """One figure as the older version had it, u as it is."""
    results["artefact"]["U1_mm"]["value"] -= OFF_MM
    results["artefact"]["U1_mm"]["interval95"] = [end - OFF_MM for end in results["artefact"]["U1_mm"]["interval95"]]


@pytest.fixture
def archive(laboratory: Path) -> Path:
    """Records of a laboratory that imported a report of version 0.4.0 with one wrong figure."""
    older(Path(shutil.copytree(laboratory / "reports" / "mount", laboratory / "old" / "mount")), "0.4.0", wrong)
    assert run("records", "import", laboratory / "old", "--records", laboratory / "lab.db").returncode == 0
    return laboratory


@pytest.mark.long
def test_a_wrong_figure_is_found_told_and_replaced_by_a_draft(archive: Path) -> None:
    stated = json.loads((archive / "reports" / "mount" / "results.json").read_bytes())["artefact"]["U1_mm"]
    asked = ("affected", "--version", "0.4.0", "--records", "lab.db")
    done = run(*asked, "--write", "drafts", cwd=archive)
    assert (done.returncode, done.stderr) == (4, "")
    lines = done.stdout.splitlines()
    assert lines[0] == "K-1 of 2026-01-01, 77, version 0.4.0, draft"
    assert any(line.strip().startswith(ANY_DIAGNOSIS) for line in lines)
    (changed,) = (line.strip() for line in lines if "->" in line)
    assert changed == (
        f"U1: {stated['value'] - OFF_MM:.10g} (u {stated['u']:.10g}) mm -> {stated['value']:.10g} (u {stated['u']:.10g}) mm"
    )
    assert lines[-2:] == [f"  draft in {Path('drafts') / 'mount'}", "1 certificate touched, 1 changed"]
    texts = [
        (archive / folder / "mount" / "results.json").read_text(encoding="utf-8") for folder in ("drafts", "reports")
    ]
    again, first = (json.loads(text)["records"] for text in texts)
    assert (again["entries"], first["entries"]) == (1, 0)  # where the records stood when each was made
    stands, should = (text.rpartition('  "records": ')[0] for text in texts)
    assert stands == should  # the same inputs, seed and version
    with open_records(archive / "lab.db", read_only=True) as records:
        assert [(one.entry, one.version, one.state) for one in records.certificates()] == [
            (1, "0.4.0", "draft"), (2, __version__, "draft"),
        ]  # fmt: skip
    assert run("records", "verify", "--records", "lab.db", cwd=archive).returncode == 0
    signed = ("--by", "A. Huber", "--records", "lab.db")
    assert run("release", "2", *signed, cwd=archive).returncode == 0
    done = run("release", "1", "--replaced-by", "2", "--reason", "corrected", *signed, cwd=archive)
    assert done.stdout == "K-1 of 2026-01-01 (77): replaced\n"
    done = run(*asked, cwd=archive)
    assert (done.returncode, done.stdout) == (0, "0 certificates touched, 0 changed\n")  # the old one does not count


def test_only_listed_nothing_is_computed_and_nothing_is_wrong_yet(archive: Path) -> None:
    done = run("affected", "--version", "0.4.0", "--list", "--records", "lab.db", "--json", cwd=archive)
    assert (done.returncode, done.stderr) == (0, "")
    (one,) = json.loads(done.stdout)["certificates"]
    assert (one["certificate"], one["version"], one["computed"], one["changed"]) == ("K-1", "0.4.0", False, False)
    assert {each["version"] for each in one["corrections"]} == {
        "0.5.0",
        "0.9.0",
        "0.11.0",
        "0.13.0",
        "0.14.0",
        "0.15.0",
    }
    assert not any("time_s" in each["what"] for each in one["corrections"])  # no reading has a time
    assert run("affected", "--version", "0.4.0", "--list", "--quiet", "--records", "lab.db", cwd=archive).stdout == ""


def test_a_certificate_that_no_correction_touches_is_not_listed(laboratory: Path) -> None:
    """0.4.0 corrected recordings with times, error maps and displays; the report of the present version none touches."""
    done = run("affected", "--version", "0.1.0", "--records", laboratory / "reports" / "records.db")
    assert (done.returncode, done.stdout) == (0, "0 certificates touched, 0 changed\n")
    place = kept(
        laboratory / "two.db", certificate("1", version="0.4.0", kind="plate", command="diagnose"),
        certificate("2", version="0.4.0", kind="shift", command="diagnose"),
    )  # fmt: skip
    done = run("affected", "--version", "0.4.0", "--list", "--records", place, "--json")
    plate, shift = json.loads(done.stdout)["certificates"]
    assert any("artefact is a suspect" in each["what"] for each in plate["corrections"])
    assert not any("artefact is a suspect" in each["what"] for each in shift["corrections"])


def test_drafts_of_two_certificates_of_one_job_have_folders_of_their_own(
    archive: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only the folders: what is computed is left out here."""
    with open_records(archive / "lab.db") as records:
        records.append("report", next(records.entries(1)).data | {"results_sha256": "1" * 64})
    monkeypatch.setattr(
        corrected, "_again", lambda one, said, _, folder, __: AffectedCertificate(one, said, (), written=folder)
    )
    done = run("affected", "--version", "0.4.0", "--write", "drafts", "--records", "lab.db", "--json", cwd=archive)
    drafts = [one["draft"] for one in json.loads(done.stdout)["certificates"]]
    assert drafts == [str(Path("drafts") / "mount-1"), str(Path("drafts") / "mount-2")]


def test_what_cannot_be_computed_again_is_told_and_ends_with_4(archive: Path) -> None:
    """Files removed; files of other inputs in their place; and a certificate that does not say its version."""
    kept(archive / "lab.db", certificate("2", dt.date(2026, 1, 2), version=""))
    with open_records(archive / "lab.db") as records:
        content = next(records.entries(1)).data
        content["inputs"]["recording.csv"] = "0" * 64
        records.append("report", content | {"results_sha256": "1" * 64, "job": "other", "number": "K-2"})
    shutil.move(archive / "old" / "mount" / "certificate.pdf", archive / "certificate.pdf")
    asked = ("affected", "--version", "0.4.0", "--records", "lab.db", "--json")
    done = run(*asked, cwd=archive)
    assert done.returncode == 4
    found = json.loads(done.stdout)["certificates"]
    assert [(one["version"], one["computed"]) for one in found] == [("0.4.0", False), ("0.4.0", False), ("", False)]
    assert "holds no PDF with the inputs of its job" in found[0]["problem"]
    shutil.move(archive / "certificate.pdf", archive / "old" / "mount" / "certificate.pdf")
    run("release", "1", "--withdraw", "--reason", "not wanted here", "--by", "A", "--records", "lab.db", cwd=archive)
    done = run(*asked[:-1], cwd=archive)
    assert done.returncode == 4
    assert "not computed again: " in done.stdout
    assert "holds the report of other inputs by now" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--version", "newest"), "'newest' is no version. Give it as 0.5.0"),
        (("--version", "0.1.0", "--to", ""), "'' is no version"),
        (("--version", "0.1.0", "--to", "99.0"), "Install the version that has the corrections"),
        (("--version", "0.1.0", "--to", "0.2.0"), "only version 0.2.0 computes as version 0.2.0 does"),
        (("--version", "99.0"), "nothing was corrected between them"),
        (("--version", "0.1.0", "--list", "--write", "x"), "nothing is written of what is only listed"),
    ],
)
def test_what_cannot_be_asked_is_told_in_a_line(arguments: tuple[str, ...], words: str, tmp_path: Path) -> None:
    place = kept(tmp_path / "records.db", certificate())
    done = run("affected", *arguments, "--records", place, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert words in done.stderr
    assert not (tmp_path / "x").exists()


JOB = b'[recording]\nfile = "r.csv"\n'


@pytest.mark.parametrize(
    ("recording", "toml", "touched"),
    [
        (b"measurement,point,x_mm,y_mm,z_mm\n1,1,0,0,0\n", JOB, False),
        (b"measurement,point,x_mm,y_mm,z_mm,time_s\n1,1,0,0,0,0\n", JOB, True),
        (b"\xef\xbb\xbftime_s,measurement,point,x_mm,y_mm,z_mm\n0,1,1,0,0,0\n", JOB, True),
        (b"# 20 degrees\n\nmeasurement,point,x_mm,y_mm,z_mm,time_s\n1,1,0,0,0,0\n", JOB, True),
        (b"Nr;X;Y;Z;Zeit\n1;0;0;0;0\n", JOB, True),
        (b"measurement,point,x_mm,y_mm,z_mm,zeit\n1,1,0,0,0,0\n", JOB + b'columns = { time_s = "zeit" }\n', True),
    ],
)
def test_a_column_of_a_recording_counts_however_its_file_is_written(
    recording: bytes, toml: bytes, touched: bool
) -> None:
    """What cannot be ruled out is computed again: of another format the columns' names say nothing."""
    with_times = Correction("0.4.0", "", columns=("time_s",))
    with_other = JobInputs.of({"job.toml": toml, "r.csv": recording})
    assert with_times.concerns(_certificate().command, _certificate().kind, with_other) is touched


def test_a_version_that_a_certificate_says_of_itself_is_never_an_error() -> None:
    assert [stated_version(text) for text in ("0.4.0", "0.5.0rc1", "", "of today")] == [(0, 4, 0), (0, 5), (), ()]
    assert stated_version("0.5.0rc1") < stated_version("0.5.0")


def _certificate() -> Any:
    from cmm_uq.laboratory.records.facts import RecordedCertificate

    day, at = dt.date(2026, 1, 1), dt.datetime(2026, 1, 1, tzinfo=dt.UTC)
    return RecordedCertificate(
        1, "", "", "", "ballbar", "measured", day, at, None, "draft", "", "", False, "", "0.3.0", "", "", "report"
    )
