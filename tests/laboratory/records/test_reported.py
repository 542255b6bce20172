"""What a report leaves in the records, how it is released, withdrawn and replaced, and what a correction makes of it."""

from __future__ import annotations

import datetime as dt
import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from cmm_uq import __version__
from cmm_uq.app.commands.certificates import again as corrected
from cmm_uq.app.commands.certificates.again import Correction, JobInputs, affected_certificates, between, corrections
from cmm_uq.app.commands.certificates.release import release, withdraw
from cmm_uq.app.commands.laboratory.records import import_reports, inputs_of, remove_retained, retention
from cmm_uq.app.commands.report import write_report
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.output import interruption
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.store import Records
from tests.conftest import ROOT
from tests.laboratory.records.histories import certificate

BAR_MM, BAR_U_UM = 404.2357, 5.0
"""Of the example's job.toml."""


LABORATORY = """
[laboratory]
name = "L"
address = "A"
signatory = "S"
four_eyes = true
"""


@pytest.fixture(scope="module")
def reported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("reported")
    job = Path(shutil.copytree(ROOT / "examples" / "iota-1102-20C", folder / "job"))
    toml = (job / "job.toml").read_text(encoding="utf-8")
    toml = toml.replace('manufacturer = "DEA"', 'manufacturer = "DEA"\nserial = "1102"')
    stated = 'issued = 2004-09-02\ncustomer = "C"\naddress = "D"\n'  # what a certificate must state to be released
    toml = toml.replace("[job]\n", f'[job]\nadjusted_since = 2004-03-01\noperator = "J. Harris"\n{stated}')
    issuer = 'issuer = "national institute"\narrangement = "CIPM MRA"\ndate = 2004-01-05\ndue = 2005-01-01\n'
    toml = toml.replace(
        'machine = "DEA Iota 1102"\n', issuer
    )  # which certified the bar on this machine: no traceability
    (job / "job.toml").write_text(toml + LABORATORY, encoding="utf-8")
    write_report(job, folder / "reports" / "iota", records=folder / "reports" / "records.db", language="fr")
    return folder / "reports"


@pytest.fixture
def records(reported: Path, tmp_path: Path) -> Iterator[Records]:
    with open_records(Path(shutil.copytree(reported, tmp_path / "reports")) / "records.db") as opened:
        yield opened


def test_a_report_is_recorded_with_what_its_job_and_its_results_say(records: Records) -> None:
    results = json.loads((Path(records.certificates()[0].folder) / "results.json").read_bytes())
    (found,) = records.certificates(" 1102")
    assert (found.machine, found.kind, found.origin, found.state) == ("1102", "ballbar", "measured", "draft")
    assert found.artefact == "Harris 2004, Table 21"  # no serial number: that of its certificate
    assert found.adjusted_since == dt.date(2004, 3, 1)
    assert (found.decision, found.diagnosis) == ("fail", results["diagnosis"]["verdict"])
    values = {value.name: value for value in found.values}
    stated = results["estimates"]["squareness_xy"]["angle_arcsec"]
    squareness = values["squareness_xy.angle_arcsec"]
    assert (squareness.value, squareness.u, [squareness.lower, squareness.upper]) == (
        stated["value"], stated["u"], stated["interval95"],
    )  # fmt: skip
    assert (squareness.quantity, squareness.unit) == ("Squareness X–Y", "″")
    assert values["performance:volumetric performance"].limit == 60.0
    names, lower = found.covariance or ((), ())
    i = names.index("scale_x.ppm")
    assert lower[i * (i + 1) // 2 + i] == results["covariance"]["matrix"][i][i]
    assert records.machines()[0].adjusted == (dt.date(2004, 3, 1),)
    assert records.verify() == []


def test_what_the_artefact_adds_to_a_scale_is_its_relative_uncertainty(records: Records) -> None:
    """A length wrong by δ makes all scales wrong by δ/L; the sampling alone lets it differ by a few per cent."""
    values = {value.name: value for value in records.certificates()[0].values}
    for axis in "xyz":
        assert values[f"scale_{axis}.ppm"].u_artefact == pytest.approx(BAR_U_UM / BAR_MM * 1e3, rel=0.06)
    assert values["squareness_xy.angle_arcsec"].u_artefact < 0.05 * values["squareness_xy.angle_arcsec"].u


def test_two_persons_release_where_the_laboratory_says_so_and_none_is_the_operator(records: Records) -> None:
    with pytest.raises(CmmUqError, match="made the certificate"):
        release(records, "iota-1102-20C", by="J.  HARRIS")
    with pytest.raises(CmmUqError, match="iota-1102-20C states fail"):
        release(records, "iota-1102-20C", by="A. Huber", reason="checked")
    first = release(records, "iota-1102-20C", by="A. Huber", reason="checked", despite="the customer asked for it")
    assert first.waiting == 1
    assert records.certificates()[0].state == "draft"
    with pytest.raises(CmmUqError, match="signed the certificate"):
        release(records, "iota-1102-20C", by="a. huber")
    last = release(records, "1", by="B. Kern", despite="the customer asked for it")
    assert last.certificate.state == "released"
    assert [(one.by, one.reason) for one in records.signatures(1)] == [
        ("A. Huber", "checked; fail: the customer asked for it"), ("B. Kern", "fail: the customer asked for it"),
    ]  # fmt: skip
    with pytest.raises(CmmUqError, match="released already"):
        release(records, "1", by="C. Dorn")
    with pytest.raises(CmmUqError, match="for a reason"):
        withdraw(records, "1", by="A. Huber", reason=" ")
    assert withdraw(records, "1", by="A. Huber", reason="wrong artefact").certificate.state == "withdrawn"
    assert records.latest() == []
    assert records.series("1102") == {}
    with pytest.raises(CmmUqError, match="withdrawn already"):
        withdraw(records, "1", by="A. Huber", reason="once more")
    assert records.verify() == []


def entered(records: Records, **further: object) -> int:
    day = further.pop("day", dt.date(2026, 3, 2))
    assert isinstance(day, dt.date)
    return records.append("report", certificate("77", day, **further)).number  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("further", "why"),
    [
        ({"origin": "simulated"}, "its recording is simulated"),
        ({"interim": True}, "an interim check"),
        ({"artefact": {"serial": "BB-7", "due": "2026-03-01"}}, "artefact BB-7 was due for calibration on 2026-03-01"),
    ],
)
def test_what_must_not_be_released_is_refused(further: dict[str, object], why: str, tmp_path: Path) -> None:
    with open_records(tmp_path / "records.db", create=True) as records:
        number = entered(records, **further)
        with pytest.raises(CmmUqError, match=why):
            release(records, str(number), by="A. Huber")
        assert records.certificate(number).state == "draft"


def test_an_artefact_is_in_date_on_its_last_day(tmp_path: Path) -> None:
    with open_records(tmp_path / "records.db", create=True) as records:
        number = entered(records, artefact={"serial": "BB-7", "due": "2026-03-02"})
        assert release(records, str(number), by="A. Huber").certificate.state == "released"


def test_a_certificate_is_replaced_by_a_released_one_of_its_machine(tmp_path: Path) -> None:
    with open_records(tmp_path / "records.db", create=True) as records:
        old, new = entered(records), entered(records, day=dt.date(2026, 3, 3))
        other = records.append("report", certificate("78")).number
        release(records, str(other), by="A. Huber")
        for wrong, why in ((new, "is draft"), (other, "is of 78"), (old, "does not replace itself")):
            with pytest.raises(CmmUqError, match=why):
                withdraw(records, str(old), by="A. Huber", reason="corrected", replaced_by=str(wrong))
        release(records, str(new), by="A. Huber")
        done = withdraw(records, str(old), by="A. Huber", reason="corrected", replaced_by=str(new))
        assert done.certificate.state == "replaced"
        assert records.signatures(old)[-1].replaced_by == new
        assert [one.entry for one in records.latest()] == [new, other]


def test_reports_of_before_are_imported_once_as_they_would_have_been_recorded(
    reported: Path, records: Records, tmp_path: Path
) -> None:
    folder = Path(shutil.copytree(reported / "iota", tmp_path / "archive" / "2004" / "iota"))
    with open_records(tmp_path / "archive" / "records.db", create=True) as imported:
        done = import_reports(imported, [tmp_path / "archive"])
        assert [path.name for path in done.added] == ["iota"]
        assert imported.shown in interruption.written()  # a signal from now on says so
        assert import_reports(imported, [tmp_path / "archive"]).known == done.added
        assert next(imported.entries()).data | {"folder": ""} == next(records.entries()).data | {"folder": ""}
        assert imported.certificates()[0].folder == str(tmp_path / "archive" / "2004" / "iota")
    (folder / "certificate.html").write_text("better")
    with open_records(tmp_path / "fresh.db", create=True) as fresh:
        ((path, error),) = import_reports(fresh, [folder]).refused
        assert path == folder
        assert "certificate.html: was altered" in str(error)
        assert fresh.head()[0] == 0


def test_files_that_were_altered_after_recording_are_found(records: Records) -> None:
    folder = Path(records.certificates()[0].folder)
    (folder / "certificate.html").write_text("better")
    assert [(one.kind, one.entry) for one in records.verify()] == [("file", 1)]
    (folder / "results.json").write_text("{}")
    assert [one.kind for one in records.verify()] == ["file", "file"]
    shutil.rmtree(folder)
    assert [one.kind for one in records.verify()] == ["missing"]


def test_a_retention_removes_the_files_of_old_reports_and_keeps_what_they_said(records: Records) -> None:
    folder = Path(records.certificates()[0].folder)
    assert retention(records, 10, dt.date(2014, 9, 1)).files == ()
    found = retention(records, 10, dt.date(2014, 9, 2))
    assert {path.name for path in found.files} == {path.name for path in folder.iterdir()}
    (folder / "notes.txt").write_text("mine")
    remove_retained(records, found, 10)
    assert [path.name for path in folder.iterdir()] == ["notes.txt"]
    assert len(records.certificates()[0].values) > 6
    assert records.verify() == []
    assert retention(records, 10, dt.date(2014, 9, 2)).files == ()


def test_the_inputs_in_a_pdf_are_those_of_the_job(reported: Path) -> None:
    files = inputs_of(reported / "iota")
    assert files == {path.name: path.read_bytes() for path in (reported.parent / "job").iterdir()}


@pytest.mark.long
def test_a_correction_is_found_computed_again_and_replaced_by_a_draft(
    records: Records, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A certificate of an older version whose scale was 3 ppm less; the version after it corrected scales of ball bars."""
    old = next(records.entries()).data
    old["version"], old["results_sha256"] = "0.4.0", "0" * 64
    old["values"][0][3] -= 3.0
    records.append("withdrawal", {"certificate": 1, "by": "A", "reason": "stands for the older one"})
    number = records.append("report", old).number
    said = (
        Correction(__version__, "Scales were wrong.", kinds=("ballbar",), effects=("scale_x",)),
        Correction(__version__, "Of plates.", kinds=("plate",)), Correction(__version__, "Of times.", columns=("time_s",)),
    )  # fmt: skip
    monkeypatch.setattr(corrected, "between", lambda first, last: said)
    (found,) = affected_certificates(records, "0.4.0", __version__, out=tmp_path / "drafts", where=str(records.place))
    assert (found.certificate.entry, found.corrections, found.problem) == (number, said[:1], "")
    (change,) = found.changes or ()
    assert change.name == "scale_x.ppm"
    assert change.before is not None
    assert change.after is not None
    assert np.isclose(change.after[0] - change.before[0], 3.0)
    assert found.changed
    draft = records.certificates()[-1]
    assert (draft.folder, draft.state) == (str(found.written), "draft")
    assert draft.results_sha256 == records.certificate(1).results_sha256
    assert '<html lang="fr">' in (Path(draft.folder) / "certificate.html").read_text(encoding="utf-8")


def test_a_version_that_is_not_installed_cannot_compute(records: Records) -> None:
    with pytest.raises(CmmUqError, match="Install the version"):
        list(affected_certificates(records, "0.1.0", "99.0"))
    with pytest.raises(CmmUqError, match="only version"):
        list(affected_certificates(records, "0.1.0", "0.4.0"))
    with pytest.raises(CmmUqError, match="no version"):
        list(affected_certificates(records, "0.1.0", "newest"))
    assert list(affected_certificates(records, "0.1.0", "0.4.0", recompute=False)) == []


def test_corrections_stand_in_the_changelog_under_their_version_and_name_what_there_is() -> None:
    from cmm_uq.artefacts import names
    from cmm_uq.machine.physics.catalogue import every

    sections = {
        part.partition("\n")[0].strip(): part for part in (ROOT / "CHANGELOG.md").read_text("utf-8").split("\n## ")
    }
    for one in corrections():
        assert "Corrections that touch certificates" in sections[one.version]
        assert set(one.kinds) <= set(names())
        assert set(one.effects) <= set(every())
    assert {one.version for one in between("0.3.0", "0.4.0")} == {"0.4.0"}


@pytest.mark.parametrize(
    ("correction", "touched"),
    [
        (Correction("1", ""), True),
        (Correction("1", "", commands=("diagnose",)), False),
        (Correction("1", "", kinds=("plate",)), False),
        (Correction("1", "", effects=("scale_x", "drift_x")), True),
        (Correction("1", "", effects=("drift_x",)), False),
        (Correction("1", "", standards=("ASME B89",)), True),
        (Correction("1", "", standards=("ISO 10360",)), False),
        (Correction("1", "", keys=("artefact.certificate.due",)), True),
        (Correction("1", "", keys=("laboratory.cmc",)), False),
        (Correction("1", "", columns=("y_mm",)), True),
        (Correction("1", "", columns=("time_s",), effects=("scale_x",)), False),
    ],
)
def test_a_correction_touches_a_certificate_unless_its_inputs_rule_it_out(
    correction: Correction, touched: bool, reported: Path, records: Records
) -> None:
    (found,) = records.certificates()
    assert correction.concerns(found.command, found.kind, JobInputs.of(inputs_of(reported / "iota"))) is touched
    assert correction.concerns(found.command, found.kind, None) is (
        touched or not (correction.commands or correction.kinds)
    )
