"""What states the machine of a part beside its certificate's figures: its history from records, and who signed it."""

from __future__ import annotations

import datetime as dt
import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.app.commands.certificates.verify import verify
from cmm_uq.app.commands.parts.drift import FILE
from cmm_uq.app.commands.parts.part import PartOptions, contents_of, evaluate_part
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.part.measurement import PartMeasurement
from tests.app.cli.test_due import recorded, scale
from tests.conftest import ROOT
from tests.part_machines import PDF as MACHINE_PDF, by_certificate, plate_of
from tests.part_reports import drawn_once
from tests.shared import put

PDF = "part-simulated.pdf"
TRIALS = 4000  # with fewer, what a forged history changes would be within what computing again allows for the draws
BRIDGE = {"serial": "", "name": "Simulated bridge machine", "manufacturer": "", "model": "", "place": ""}


once = pytest.fixture(autouse=True)(drawn_once)


def records(folder: Path) -> Path:
    """Scale of x by four ppm a year more, seen in all seasons up to the day of the calibration."""
    from tests.laboratory.records.histories import certificate

    days = [dt.date(2026, 1, 1) - dt.timedelta(430 * (5 - i)) for i in range(6)]
    return recorded(folder, *(certificate("", day, scale(5.0 * i), machine=BRIDGE) for i, day in enumerate(days)))


@cache
def aged(folder: Path) -> PartMeasurement:
    """Its bore measured 20 µm off along x, with the history of the machine."""
    off = np.zeros((60, 3))
    off[-8:, 0] = 0.02
    return evaluate_part(plate_of(by_certificate(), off), PartOptions(trials=TRIALS, records=records(folder)))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("records")


@pytest.mark.long
def test_changes_that_records_told_are_computed_again_from_the_history_inside(folder: Path, tmp_path: Path) -> None:
    files = contents_of(aged(folder))
    said = json.loads(files["results.json"])
    assert FILE in said["job"]["inputs_sha256"]
    assert next(one["change"] for one in said["machine"]["changes"] if one["parameter"] == "scale_x.ppm") > 0
    put(tmp_path, {PDF: files[PDF]})
    found = verify([tmp_path / PDF], rerun=True)
    assert found.inquiry.word == "VERIFIED", (found.inquiry.findings, found.inquiry.unchecked)
    assert any("follow from its history inside" in note for note in found.inquiry.notes)


@pytest.mark.long
def test_another_history_than_the_figures_were_made_of_is_found(folder: Path, tmp_path: Path) -> None:
    """Hashes and attachments are those of a machine that does not drift; the figures are not."""
    found = aged(folder)
    said = json.loads(found.job.inputs[FILE])
    said["values"][0]["value"] = [0.0] * len(said["values"][0]["value"])
    forged = {**found.job.inputs, FILE: json.dumps(said).encode()}
    put(tmp_path, contents_of(replace(found, job=replace(found.job, inputs=forged))))
    (wrong, *_) = verify([tmp_path / PDF], rerun=True).inquiry.findings
    assert wrong.check == "again"


@pytest.mark.long
def test_a_machine_held_to_trusted_signers_is_held_to_them_again(tmp_path: Path) -> None:
    pytest.importorskip("pyhanko")
    from cmm_uq.certificate.sign import sign_pdf
    from tests.certificate.sign.authority import SIGNED, curve_key, issued, root

    anchor, other = root(), root()
    for name, held in (("root.pem", anchor), ("other.pem", other)):
        (tmp_path / name).write_bytes(held.pem)
    trusted, others = [tmp_path / "root.pem"], [tmp_path / "other.pem"]
    signer = issued("A. Huber", curve_key(), anchor).signer
    machine = {MACHINE_PDF: sign_pdf(by_certificate()[MACHINE_PDF], signer, seal=None, at=SIGNED)}
    for nobody, content in ((others, machine), (trusted, by_certificate())):
        with pytest.raises(CmmUqError, match="the machine's certificate does not verify"):
            evaluate_part(plate_of(content), PartOptions(trials=TRIALS, trust=nobody))
    files = contents_of(evaluate_part(plate_of(machine), PartOptions(trials=TRIALS, trust=trusted)))
    assert json.loads(files["results.json"])["machine"]["signatures_held_to_trusted"] is True
    put(tmp_path, {PDF: sign_pdf(files[PDF], signer, seal=None, at=SIGNED)})
    alone = verify([tmp_path / PDF], rerun=True)
    assert not alone.inquiry.findings
    assert {left.what for left in alone.inquiry.unchecked} >= {"whose signature the machine's certificate has"}
    held = verify([tmp_path / PDF], rerun=True, trust=trusted)
    assert held.inquiry.word == "VERIFIED", (held.inquiry.findings, held.inquiry.unchecked)


@pytest.mark.long
@pytest.mark.parametrize(
    "pdf", ["part-iota/machine/certificate.pdf", "part-plate-simulated/machine/certificate-simulated.pdf"]
)
def test_the_certificates_of_machines_in_examples_are_what_this_version_computes(pdf: str) -> None:
    """Layout is compared only where the libraries are those that it was made with; figures are everywhere."""
    found = verify([ROOT / "examples" / pdf], rerun=True)
    assert not found.inquiry.findings, "\n".join(map(str, found.inquiry.findings[:5]))
    assert found.inquiry.done["again"] > 1000
