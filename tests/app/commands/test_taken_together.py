"""A calibration with further certificates of its machine: one posterior of all recordings, or words why not."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmm_uq.app.commands.certificates.verify import verify
from cmm_uq.app.commands.jobs.check import check_read
from cmm_uq.app.commands.jobs.compensate import write_new_map
from cmm_uq.app.commands.jobs.simulate import simulated_job
from cmm_uq.app.commands.reading import job_of, read_job
from cmm_uq.app.commands.report import REPORT, report_outcome
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.render import render_html
from cmm_uq.jobs.job import Job
from tests.app.commands.test_verify_part import OTHER
from tests.conftest import ROOT
from tests.shared import put

EXAMPLES = ROOT / "examples"
IOTA = EXAMPLES / "part-iota" / "machine" / "certificate.pdf"
GAUGE = EXAMPLES / "step-gauge-simulated"
PLATE = {"job.toml": (EXAMPLES / "plate-simulated" / "job.toml").read_bytes(),
         "recording.csv": (EXAMPLES / "plate-simulated" / "recording.csv").read_bytes()}  # fmt: skip


def beside(files: Mapping[str, bytes], **further: bytes) -> dict[str, bytes]:
    """A job that names further certificates, which lie beside it."""
    named = "".join(f'[[machine.further]]\ncertificate = "{name}.pdf"\n\n' for name in further)
    toml = files["job.toml"].decode().replace("[artefact]", f"{named}[artefact]", 1)
    return {**files, "job.toml": toml.encode(), **{f"{name}.pdf": content for name, content in further.items()}}


def half(number: int) -> dict[str, bytes]:
    """The step gauge's recording along every other line."""
    head, *rows = (GAUGE / "recording.csv").read_text().splitlines()
    chosen = [row for row in rows if int(row.split(",")[0]) % 2 == number]
    toml = re.sub(r'^id = "[^"]*"', f'id = "half-{number}"', (GAUGE / "job.toml").read_text(), count=1, flags=re.M)
    return {"job.toml": toml.encode(), "recording.csv": "\n".join([head, *chosen, ""]).encode()}


def certificate(job: Job) -> bytes:
    files = REPORT.contents(report_outcome(job))
    return next(content for name, content in files.items() if name.endswith(".pdf"))


@cache
def results(**further: bytes) -> Mapping[str, Any]:
    return report_outcome(job_of(beside(PLATE, **further))).results


@pytest.mark.long
def test_two_halves_of_a_recording_taken_together_say_what_the_whole_says() -> None:
    """Each half leaves scales or squarenesses open that the whole, one recording by itself, determines. The gauge is known
    exactly here: of two certificates each has an artefact of its own, whose doubt does not go out between them."""
    halves = [half(0), half(1)]
    for files in halves:
        files["job.toml"] = exact(files["job.toml"])
    together = report_outcome(job_of(beside(halves[1], other=certificate(job_of(halves[0]))))).results
    files = {name: (GAUGE / name).read_bytes() for name in ("job.toml", "recording.csv")}
    whole = report_outcome(job_of({**files, "job.toml": exact(files["job.toml"])})).results["over_range"]
    assert together["over_range"].keys() == whole.keys()
    assert len(report_outcome(job_of(halves[1])).results["over_range"]) < len(whole)
    for effect, parameters in whole.items():
        for name, one in parameters.items():
            both = together["over_range"][effect][name]
            assert abs(both["value"] - one["value"]) < 0.5 * one["u"]
            assert 0.8 < both["u"] / one["u"] < 1.25


def exact(toml: bytes) -> bytes:
    assert b"u_um = 0.4" in toml
    return toml.replace(b"u_um = 0.4", b"u_um = 0.001")


@pytest.mark.long
def test_a_step_gauge_beside_a_plate_narrows_the_factors_over_the_range() -> None:
    alone, both = results(), results(gauge=OTHER.read_bytes())
    for effect, true in {"scale_x": 9.0, "scale_y": -6.0, "scale_z": 14.0}.items():
        one, other = alone["over_range"][effect]["ppm"], both["over_range"][effect]["ppm"]
        assert other["u"] < 0.5 * one["u"]
        assert abs(other["value"] - true) < 2.5 * other["u"]
    assert both["estimates"] == alone["estimates"]
    (told,) = both["regions"]["further"]
    assert (told["file"], told["number"], told["used"]) == ("gauge.pdf", "step-gauge-simulated", True)
    assert "further" not in alone["regions"]


@pytest.mark.long
def test_one_that_contradicts_the_recording_is_told_and_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cmm_uq.app.commands.certificates.further.CONTRADICTED", 1.1)
    found = report_outcome(job_of(beside(PLATE, gauge=OTHER.read_bytes())))
    assert found.results["over_range"] == results()["over_range"]
    assert [one["used"] for one in found.results["regions"]["further"]] == [False]
    assert "contradicts the machine as its other certificates have it" in render_html(found.document)


REFUSED = [
    ({"other": IOTA.read_bytes()}, "is of another name: DEA Iota 1102"),
    ({"altered": OTHER.read_bytes() + b"further\n"}, "does not verify"),
    ({"half": OTHER.read_bytes()[:5000]}, "half.pdf"),
    ({"one": OTHER.read_bytes(), "again": OTHER.read_bytes()}, "is of a recording that is reckoned with already"),
]


@pytest.mark.parametrize(("further", "words"), REFUSED, ids=[words for _, words in REFUSED])
def test_one_of_another_machine_or_altered_is_refused_before_anything_is_computed(
    further: dict[str, bytes], words: str
) -> None:
    job = job_of(beside(PLATE, **further))
    assert any(words in str(one) and one.fix for one in check_read(job).problems)


@pytest.mark.usefixtures("no_diagnosis")
def test_a_report_refuses_what_a_check_does() -> None:
    with pytest.raises(CmmUqError, match=r"half\.pdf"):
        report_outcome(job_of(beside(PLATE, half=OTHER.read_bytes()[:5000])))


@pytest.mark.usefixtures("no_diagnosis")
def test_a_simulated_recording_is_not_taken_together_with_a_measured_one() -> None:
    measured = PLATE["job.toml"].replace(b'origin = "simulated"\n', b"")
    job = job_of(beside({**PLATE, "job.toml": measured}, gauge=OTHER.read_bytes()))
    with pytest.raises(CmmUqError, match="is of a recording that is simulated, and that of the machine is measured"):
        report_outcome(job)


def test_what_is_simulated_from_a_job_has_none() -> None:
    made = simulated_job(job_of(beside(PLATE, gauge=OTHER.read_bytes())), {"effects": {"scale_x": {"ppm": 9.0}}})
    assert "gauge.pdf" not in made.inputs
    assert made.facts.machine.further == []


@pytest.mark.long
def test_a_report_of_several_recordings_is_computed_again_to_the_byte_with_those_inside(
    tmp_path: Path,
) -> None:
    files = beside(PLATE, gauge=certificate(read_job(GAUGE)))
    made = REPORT.contents(report_outcome(job_of(files)))
    assert b"Further certificates of the machine" in made["certificate-simulated.html"]
    assert b"taken together with it" in made["certificate-simulated.html"]
    found = verify([put(tmp_path / "good", made) / "certificate-simulated.pdf"])
    assert not found.inquiry.findings, found.inquiry.findings
    assert found.inquiry.word == "VERIFIED"


@pytest.mark.long
def test_a_map_of_several_recordings_is_better_known_than_of_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cmm_uq.analysis.machine.correction._held_out", lambda *_: None)
    _, alone = write_new_map(put(tmp_path / "alone", PLATE), tmp_path / "map-alone")
    files, both = write_new_map(put(tmp_path / "both", beside(PLATE, gauge=OTHER.read_bytes())), tmp_path / "map-both")
    assert both.range_um[1] < 0.5 * alone.range_um[1]
    assert '"number": "step-gauge-simulated"' in (tmp_path / "map-both" / "compensation.json").read_text()
    spread = [np.linalg.norm(one.error_map.covariance.factor) for one in (alone, both)]  # type: ignore[union-attr]
    assert spread[1] < spread[0]
    assert files["compensation.json"].is_file()
