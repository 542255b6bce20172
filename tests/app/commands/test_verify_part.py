"""The report of a part is verified from its file alone; whatever was altered in it is found, with its place."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pikepdf
import pytest
from typer.testing import CliRunner

from cmm_uq.app.cli.terminal import NOT_VERIFIED, NOT_WHOLLY_CHECKED
from cmm_uq.app.commands.certificates.verification import Verification
from cmm_uq.app.commands.certificates.verify import verify
from cmm_uq.app.commands.certificates.verify_part import to_rerun
from cmm_uq.app.commands.parts.machine import state_machine
from cmm_uq.app.commands.parts.part import PartOptions, contents_of, evaluate_part, write_part, written
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.part.measurement import PartMeasurement, standing_data
from cmm_uq.laboratory.records import open_records
from tests.conftest import ROOT
from tests.part_machines import MACHINE, THERE, by_results, plate_files, plate_of
from tests.part_reports import TRIALS, found_again_once, plate_found, plate_report, unchanged, with_inputs
from tests.shared import put

pytestmark = pytest.mark.long  # all need what takes long to make

PDF, PAGE = "part-simulated.pdf", "part-simulated.html"
OTHER = ROOT / "examples" / "part-plate-simulated" / "machine" / "certificate-simulated.pdf"


@pytest.fixture
def once(monkeypatch: pytest.MonkeyPatch) -> None:
    """For tests whose report was made by :func:`plate_found`, that computing again has no part in."""
    monkeypatch.setattr("cmm_uq.app.commands.certificates.verify_part.evaluate_part", found_again_once)


def found_in(folder: Path, files: Mapping[str, bytes], *names: str, rerun: bool = False) -> Verification:
    put(folder, files)
    return verify([folder / name for name in names] or [folder], rerun=rerun)


def places(found: Verification) -> list[str]:
    return [one.place for one in found.inquiry.findings]


def told(found: Verification) -> str:
    return "\n".join(map(str, (*found.inquiry.findings, *found.inquiry.unchecked)))


@pytest.mark.usefixtures("once")
def test_a_report_is_verified_from_its_pdf_alone_and_computed_again_to_the_byte(tmp_path: Path) -> None:
    found = found_in(tmp_path, plate_report(), PDF, rerun=True)
    assert found.inquiry.word == "VERIFIED", told(found)
    assert found.inquiry.done["again"] > 400
    assert {name for name, count in found.inquiry.done.items() if count} >= {"figures", "decisions", "inputs", "dates"}


@pytest.mark.usefixtures("once")
def test_a_recorded_report_is_the_same_again_at_its_head(tmp_path: Path) -> None:
    place = tmp_path / "records.db"
    with open_records(place, create=True) as records:
        first = records.append("artefact", {"serial": "BB-7"})
    written(plate_found().job, plate_found, tmp_path / "out", records=place)
    found = verify([tmp_path / "out"], records=place)
    assert found.inquiry.word == "VERIFIED", told(found)
    assert "The report is entry 2 of the records. They have entry 1, which it states: nothing up to there" in "\n".join(
        found.inquiry.notes
    )
    assert first.hash in (tmp_path / "out" / PAGE).read_text(encoding="utf-8")
    with open_records(tmp_path / "rewritten.db", create=True) as others:
        others.append("artefact", {"serial": "BB-8"})
    other = verify([tmp_path / "out"], rerun=False, records=tmp_path / "rewritten.db")
    assert "was made after entry 1 with the hash" in told(other)
    (tmp_path / "none").mkdir()
    put(tmp_path / "none", plate_report())
    none = verify([tmp_path / "none"], rerun=False, records=place)
    assert "the records: the report states no head of them" in told(none)


def test_its_folder_is_held_to_its_manifest_with_the_folders_inside(tmp_path: Path) -> None:
    out = tmp_path / "out"
    written(plate_found().job, plate_found, out)
    (out / "further").mkdir(exist_ok=True)
    manifest = json.loads((out / "manifest.json").read_bytes())
    if "further/job.toml" not in manifest["files"]:
        put(out, {"further/job.toml": b"# set-ups\n"})
        digest = hashlib.sha256(b"# set-ups\n").hexdigest()
        manifest["files"]["further/job.toml"] = {"sha256": digest, "bytes": 10}
        (out / "manifest.json").write_text(json.dumps(manifest, indent=2) + "\n", encoding="utf-8")
    found = verify([out], rerun=False)
    assert not found.inquiry.findings, told(found)
    assert found.inquiry.word == "NOT WHOLLY CHECKED"
    (out / "further" / "job.toml").write_text("# others\n", encoding="utf-8")
    assert "is not the file whose hash manifest.json has" in told(verify([out], rerun=False))


@pytest.mark.parametrize(("name", "old", "new"), [
    ("points.csv", b"bore,1,", b"bore,01,"), ("results.json", b'"U": 0', b'"U": 1'), ("job.toml", b"[part]", b"[part]\n"),
])  # fmt: skip
def test_a_file_inside_that_was_exchanged_is_named(tmp_path: Path, name: str, old: bytes, new: bytes) -> None:
    files = dict(plate_report())
    with pikepdf.open(io.BytesIO(files[PDF])) as pdf:
        spec = pdf.attachments[name]
        content = spec.get_file().read_bytes()
        assert old in content
        spec.obj.EF.F.write(content.replace(old, new, 1))
        out = io.BytesIO()
        pdf.save(out)
    found = found_in(tmp_path, files | {PDF: out.getvalue()})
    assert any(name in one.file + one.place + one.problem for one in found.inquiry.findings), told(found)


@pytest.mark.usefixtures("once")
def test_another_expanded_uncertainty_in_all_documents_is_found_by_computing_again(tmp_path: Path) -> None:
    """Value, u, interval, U, k, page and PDF agree: nothing but the draws tells."""
    found = plate_found()
    one = found.stated[0]
    assert one.value is not None
    half = one.U / 2
    less = replace(one, k=one.k / 2, interval=(one.value - half, one.value + half))
    files = contents_of(replace(found, stated=(less, *found.stated[1:])))
    again = found_in(tmp_path, files, PDF, rerun=True)
    assert "characteristics[0].U" in places(again), told(again)


@pytest.mark.usefixtures("once")
@pytest.mark.parametrize(("name", "old", "new", "place"), [
    (PAGE, b"</td>", b"1</td>", "line "), (PAGE, b"</h1>", b" pass</h1>", "line "), (PDF, b"", b"", "page 1: /Contents"),
])  # fmt: skip
def test_a_page_that_says_something_else_is_found_by_making_it_again(
    tmp_path: Path, name: str, old: bytes, new: bytes, place: str
) -> None:
    files = dict(plate_report())
    if name == PDF:
        with pikepdf.open(io.BytesIO(files[PDF])) as pdf:
            pdf.pages[0].contents_add(b"q 1 1 1 rg 50 50 100 9 re f Q")
            out = io.BytesIO()
            pdf.save(out, fix_metadata_version=False, object_stream_mode=pikepdf.ObjectStreamMode.disable)
        files[PDF] = out.getvalue()
    else:
        assert old in files[name]
        files[name] = files[name].replace(old, new, 1)
    found = found_in(tmp_path, files, PDF, PAGE, rerun=True)
    assert any(one.file == name and one.place.startswith(place) for one in found.inquiry.findings), told(found)
    left = found_in(tmp_path, files, PDF, PAGE).inquiry
    assert f"texts and layout of {PDF} and {PAGE}" in [one.what for one in left.unchecked]


def test_another_expanded_uncertainty_in_one_document_is_found_without(tmp_path: Path) -> None:
    data = json.loads(plate_report()["results.json"])
    data["characteristics"][0]["U"] *= 0.9
    files = {**plate_report(), "results.json": (json.dumps(data, indent=2, ensure_ascii=False) + "\n").encode()}
    found = found_in(tmp_path, files)
    assert {"characteristics[0].U", "characteristics[0].k"} <= set(places(found)), told(found)


def moved(found: PartMeasurement) -> bytes:
    """The recording with one point of the bore moved by 10 µm."""
    lines = found.job.inputs["points.csv"].decode().splitlines()
    *rest, last = lines
    *cells, z = last.split(",")
    x = float(cells[2]) + 0.01
    return "\n".join([*rest, ",".join([*cells[:2], f"{x:.6f}", cells[3], z])]).encode() + b"\n"


def test_another_point_under_its_own_hash_is_found_by_the_values(tmp_path: Path) -> None:
    found = found_in(tmp_path, with_inputs(points=moved(plate_found())))
    assert "characteristics[0].measured" in places(found), told(found)
    assert all(one.problem == "is not the value of the measured points" for one in found.inquiry.findings)


def test_another_limit_under_its_own_hash_is_found_by_the_job(tmp_path: Path) -> None:
    job = plate_found().job.inputs["job.toml"]
    limit = plate_found().characteristics[0].upper_mm
    assert limit is not None
    wider = job.replace(f"upper_mm = {limit}".encode(), f"upper_mm = {limit + 0.1}".encode())
    assert wider != job
    found = found_in(tmp_path, with_inputs(job=wider))
    assert places(found) == ["characteristics[0].limits.upper"], told(found)


def test_another_certificate_of_the_machine_under_its_own_hash_is_found_by_what_it_states(tmp_path: Path) -> None:
    found = found_in(tmp_path, with_inputs(certificate=OTHER.read_bytes()))
    assert {"machine.number", "machine.inputs_sha256"} <= set(places(found)), told(found)


def test_the_certificate_inside_is_verified_as_by_itself(tmp_path: Path) -> None:
    name = next(name for name in plate_found().job.inputs if name.endswith(".pdf"))
    certificate = plate_found().job.inputs[name]
    with pikepdf.open(io.BytesIO(certificate)) as pdf:
        spec = pdf.attachments["results.json"]
        content = spec.get_file().read_bytes()
        spec.obj.EF.F.write(content.replace(b'"serial"', b'"Serial"', 1) + b" ")
        out = io.BytesIO()
        pdf.save(out)
    found = found_in(tmp_path, with_inputs(certificate=out.getvalue()))
    assert any(one.file.startswith(name) for one in found.inquiry.findings), told(found)


def test_the_machines_own_job_goes_with_the_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where no certificate states the machine, its job is inside, and all is computed again from the file."""
    monkeypatch.setattr("cmm_uq.app.commands.parts.part.ways", unchanged)
    (tmp_path / "machine").symlink_to(ROOT / "examples" / MACHINE)
    files = plate_files({}, np.zeros((60, 3)), machine_state={"job": "../machine"})
    put(tmp_path / "plate", files)
    write_part(tmp_path / "plate", tmp_path / "out", options=PartOptions(trials=TRIALS))
    found = verify([tmp_path / "out" / PDF])
    assert found.inquiry.word == "VERIFIED", told(found)
    assert any("was analysed, and is inside" in note for note in found.inquiry.notes)


def test_nothing_measured_is_verified_too(tmp_path: Path) -> None:
    files = contents_of(evaluate_part(plate_of(by_results(), **THERE), PartOptions(trials=1000)))
    found = found_in(tmp_path, files)
    assert not found.inquiry.findings, told(found)


def test_exit_codes_are_those_of_a_machines_certificate(tmp_path: Path) -> None:
    from cmm_uq.app.cli.commands import app

    put(tmp_path, plate_report())

    def code(*given: str) -> int:
        return CliRunner().invoke(app, ["verify", *given, "--no-rerun", "--quiet"]).exit_code

    assert code(str(tmp_path / PDF)) == NOT_WHOLLY_CHECKED
    data: dict[str, Any] = json.loads(plate_report()["results.json"])
    data["decision"]["outcome"] = "pass" if data["decision"]["outcome"] != "pass" else "fail"
    (tmp_path / "results.json").write_text(json.dumps(data, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    assert code(str(tmp_path / PDF), str(tmp_path / "results.json")) == NOT_VERIFIED
    (tmp_path / "results.json").write_text('{"schema": "cmm-uq/part/1"}', encoding="utf-8")
    with pytest.raises(CmmUqError, match="is neither cmm-uq/results/1 nor cmm-uq/part/1"):
        verify([tmp_path / "results.json"])


@pytest.mark.parametrize("rerun", [False, True])
def test_a_report_that_was_to_compute_its_machine_again_is_made_again_so(rerun: bool) -> None:
    """Whether or not that could be done: the report says of both what was asked."""
    said = standing_data(state_machine(plate_of(by_results(), **THERE), rerun=rerun).standing)
    assert not said["computed_again"]
    assert to_rerun(said) == rerun
