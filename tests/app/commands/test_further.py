"""Further certificates of the machine that measured a part: verified, of the same machine, taken together or contradicted."""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cmm_uq
from cmm_uq.app.commands.certificates.further import VerifiedCertificate, _recording, refuse_adjusted
from cmm_uq.app.commands.certificates.passed import refuse_passed
from cmm_uq.app.commands.certificates.verify import verify
from cmm_uq.app.commands.parts.machine import StatedMachine, refuse_machine, state_machine
from cmm_uq.app.commands.parts.part import PartOptions, contents_of, evaluate_part
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import REPORT, report_outcome
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Machine
from cmm_uq.certificate.part.measurement import FurtherCertificate
from cmm_uq.jobs.part.job import read_part
from tests.app.commands.test_verify_part import OTHER
from tests.conftest import ROOT
from tests.part_machines import MACHINE, PDF, by_certificate, by_results, plate_files, plate_of
from tests.part_reports import sampled_once, unchanged
from tests.result_keys import PART_RESULTS
from tests.shared import put

IOTA = ROOT / "examples" / "part-iota" / "machine" / "certificate.pdf"
GAUGE = {"gauge.pdf": OTHER.read_bytes()}


def state(*further: str, **more: Any) -> dict[str, Any]:
    return {"machine_state": {"certificate": "machine", "further": [{"certificate": one, **more} for one in further]}}


REFUSED: dict[str, Callable[[], dict[str, bytes]]] = {
    "is of a recording that is reckoned with already": lambda: {"again.pdf": by_certificate()[PDF]},
    "is of another name: DEA Iota 1102": lambda: {"other.pdf": IOTA.read_bytes()},
    "half.pdf": lambda: {"half.pdf": OTHER.read_bytes()[:5000]},
    "does not verify": lambda: {"altered.pdf": OTHER.read_bytes() + b"further\n"},
}


@pytest.mark.parametrize("words", REFUSED)
def test_a_further_certificate_must_verify_and_be_another_one_of_the_same_machine(words: str) -> None:
    files = REFUSED[words]()
    with pytest.raises(CmmUqError) as raised:
        refuse_machine(plate_of({**by_certificate(), **files}, **state(*files)))
    assert words in str(raised.value)
    assert raised.value.fix


def test_a_certificate_that_is_not_there_or_later_than_the_part_is_refused() -> None:
    with pytest.raises(CmmUqError, match=r"nowhere\.pdf"):
        plate_of(by_certificate(), **state("nowhere.pdf"))
    early = {"job": {"id": "plate", "date": dt.date(2026, 1, 1), "origin": "simulated"}}
    refuse_machine(plate_of({**by_certificate(), **GAUGE}, **state("gauge.pdf"), **early))
    with pytest.raises(CmmUqError, match="beside a certificate without its recording"):
        refuse_machine(plate_of({**by_results(), **GAUGE}, **state("gauge.pdf")))


def test_a_certificate_of_before_an_adjustment_is_of_another_machine() -> None:
    dates = [dt.date(2025, 3, 1), dt.date(2025, 6, 1), dt.date(2026, 1, 1)]
    before, adjusted, calibrated = dates
    named = FurtherCertificate(
        "gauge.pdf", "7", "", "Step gauge", before, "VERIFIED", corrected=False, origin="measured"
    )
    one = VerifiedCertificate(named, cmm_uq.read(ROOT / "examples" / "step-gauge-simulated"), corrected=False)
    with pytest.raises(CmmUqError, match="was adjusted on 2025-06-01"):
        refuse_adjusted([one], [adjusted], calibrated)
    refuse_adjusted([one], [before, calibrated + dt.timedelta(1)], calibrated)
    with pytest.raises(CmmUqError, match="was adjusted on 2026-01-01"):
        refuse_adjusted([one], [calibrated], calibrated)


def test_a_machine_that_its_job_states_has_further_certificates_too(tmp_path: Path) -> None:
    """Checked without drawing anything, as beside a certificate."""
    (tmp_path / "machine").symlink_to(ROOT / "examples" / MACHINE)
    further = {"job": "../machine", "further": [{"certificate": "gauge.pdf"}]}
    plate = put(tmp_path / "plate", {**plate_files({}, machine_state=further), **GAUGE})
    refuse_machine(read_part(plate))
    put(plate, {"gauge.pdf": IOTA.read_bytes()})
    with pytest.raises(CmmUqError, match="is of another name"):
        refuse_machine(read_part(plate))


@cache
def stated(*further: str) -> StatedMachine:
    return state_machine(plate_of({**by_certificate(), **GAUGE}, **state(*further)))


@pytest.mark.long
def test_what_a_further_certificate_shows_is_known_of_the_machine() -> None:
    """A swept bar shows no play, a step gauge that is met from both sides does: its errors are as the gauge shows them."""
    alone, together = stated(), stated("gauge.pdf")
    (one,) = together.standing.further
    assert (one.number, one.date, one.corrected) == ("step-gauge-simulated", dt.date(2026, 1, 1), False)
    assert one.used == (one.chance >= 1e-3)
    assert one.used
    assert [each.effect.name for each in alone.state.unmodelled if each.effect.name.startswith("hysteresis")]
    names = [effect.name for effect in together.state.effects for _ in effect.coefficients]
    for axis, gap in (("x", 1.8), ("y", -0.9), ("z", 1.2)):  # µm, as examples/step-gauge-simulated has it
        draws = together.state.draws[:, names.index(f"hysteresis_{axis}")]
        assert draws.std() < 1.0
        assert abs(draws.mean() - gap) < 4 * draws.std()
    for name in ("scale_x", "scale_y", "scale_z"):
        wide, narrow = (one.state.draws[:, names.index(name)].std() for one in (alone, together))
        assert narrow < wide
    assert "taken together" in together.standing.path


@pytest.mark.long
def test_a_certificate_of_a_machine_that_has_moved_is_told_and_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the machine is said to have corrected while the gauge was measured makes it another one."""
    monkeypatch.setattr("cmm_uq.app.commands.certificates.further.CONTRADICTED", 1.1)
    found = state_machine(plate_of({**by_certificate(), **GAUGE}, **state("gauge.pdf")))
    (one,) = found.standing.further
    assert not one.used
    assert any("contradicts the machine" in text for text in found.warnings)
    np.testing.assert_array_equal(found.state.draws, stated().state.draws)


TRAVEL = np.array([[0.0, 900.0], [0.0, 1200.0], [-600.0, 0.0]])
TEST = {"mpe": "30 + L/20", "certificate": "report 17", "date": dt.date(2026, 1, 2), "u_um": 0.2, "u_um_per_m": 0.5}


def with_test(**more: Any) -> dict[str, Any]:
    return {"machine_state": {"certificate": "machine", "passed": [{**TEST, **more}]}}


REFUSED_TESTS = [
    ({"certificate": "bryan-simulated"}, "whose recording is reckoned with already"),
    ({"date": dt.date(2030, 1, 1)}, "after the part was measured"),
    ({"readings_mm": [[0.0, 0, 0, 9999, 0, 0]]}, "X would read 9999 mm, beyond its travel"),
]


@pytest.mark.parametrize(("more", "words"), REFUSED_TESTS, ids=[words for _, words in REFUSED_TESTS])
def test_a_test_that_was_passed_is_of_this_machine_and_of_no_recording_that_is_there(
    more: dict[str, Any], words: str
) -> None:
    with pytest.raises(CmmUqError) as raised:
        refuse_machine(plate_of(by_certificate(), **with_test(**more)))
    assert words in str(raised.value)
    assert raised.value.fix


def test_records_of_an_adjustment_between_test_and_calibration_refuse_it() -> None:
    job = plate_of(by_certificate(), **with_test())
    for day, fits in ((dt.date(2026, 1, 3), False), (dt.date(2026, 1, 2), True)):
        refuse = partial(refuse_passed, job, Machine(travel_mm=TRAVEL), ("7", dt.date(2026, 1, 5)), (), [day])
        if fits:
            refuse()
        else:
            with pytest.raises(CmmUqError, match="was adjusted on 2026-01-03"):
                refuse()


@pytest.mark.long
def test_a_test_that_was_passed_bounds_what_bars_do_not_show_and_stands_on_the_report(tmp_path: Path) -> None:
    job = plate_of(by_certificate(), np.zeros((60, 3)), **with_test())
    made = evaluate_part(job, PartOptions(trials=2000))
    (one,) = made.standing.passed
    assert (one.lengths, one.used) == (35, True)
    assert one.chance > 1e-3
    assert max(one.u_without) > 1.1
    assert "play" in made.given.machine.scales
    files = contents_of(made)
    said = json.loads(files["results.json"])["machine"]["passed"]
    assert {f"machine.passed[].{key}" for key in said[0]} == {key for key in PART_RESULTS if "machine.passed" in key}
    page = files["part-simulated.html"].decode()
    assert all(words in page for words in ("Tests of lengths that the machine passed", "report 17", "(30 + L/20) µm"))
    assert not verify([put(tmp_path / "good", files) / "part-simulated.pdf"], rerun=False).inquiry.findings
    forged = replace(one, facts=one.facts.model_copy(update={"certificate": "report 18"}))
    other = contents_of(replace(made, standing=replace(made.standing, passed=(forged,))))
    found = verify([put(tmp_path / "forged", other) / "part-simulated.pdf"], rerun=False)
    assert {each.place for each in found.inquiry.findings} == {"machine.passed"}


@pytest.mark.long
def test_a_test_that_the_machine_cannot_have_passed_is_told_and_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cmm_uq.app.commands.certificates.passed.CONTRADICTED", 1.1)
    found = state_machine(plate_of(by_certificate(), **with_test()))
    (one,) = found.standing.passed
    assert not one.used
    assert any("cannot have passed the test of report 17" in text for text in found.warnings)
    np.testing.assert_array_equal(found.state.draws, stated().state.draws)


def gauge() -> dict[str, bytes]:
    """Made here, so that computing it again gives the same to the last digit."""
    files = REPORT.contents(report_outcome(read_job(ROOT / "examples" / "step-gauge-simulated")))
    return {"gauge.pdf": files["certificate-simulated.pdf"]}


@pytest.mark.long
def test_a_report_with_a_further_certificate_is_computed_again_to_the_byte(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cmm_uq.analysis.machine.conditional.sample_sizes", sampled_once)
    monkeypatch.setattr("cmm_uq.app.commands.parts.part.ways", unchanged)
    job = plate_of({**by_certificate(), **gauge()}, np.zeros((60, 3)), **state("gauge.pdf"))
    made = evaluate_part(job, PartOptions(trials=2000))
    files = contents_of(made)
    said = json.loads(files["results.json"])["machine"]["further"]
    assert [one["file"] for one in said] == ["gauge.pdf"]
    assert {f"machine.further[].{key}" for key in said[0]} == {key for key in PART_RESULTS if "machine.further" in key}
    assert b"Further certificates of the machine" in files["part-simulated.html"]
    found = verify([put(tmp_path / "good", files) / "part-simulated.pdf"])
    assert not found.inquiry.findings, found.inquiry.findings
    (one,) = made.standing.further
    forged = replace(
        made, standing=replace(made.standing, further=(replace(one, number="7", date=dt.date(2020, 1, 1)),))
    )
    found = verify([put(tmp_path / "forged", contents_of(forged)) / "part-simulated.pdf"], rerun=False)
    assert {each.place for each in found.inquiry.findings} == {"machine.further[0].number", "machine.further[0].date"}


def test_a_part_takes_over_what_its_machines_calibration_was_taken_together_with(tmp_path: Path) -> None:
    """Named again by the part it would count twice."""
    example = ROOT / "examples" / MACHINE
    toml = (example / "job.toml").read_text().replace(
        "[artefact]", '[[machine.further]]\ncertificate = "gauge.pdf"\n\n[artefact]', 1
    )  # fmt: skip
    recording = (example / "recording.csv").read_bytes()
    put(tmp_path / "machine", {"job.toml": toml.encode(), "recording.csv": recording, **GAUGE})
    refuse_machine(read_part(put(tmp_path / "plate", plate_files({}, machine_state={"job": "../machine"}))))
    again = {"job": "../machine", "further": [{"certificate": "gauge.pdf"}]}
    with pytest.raises(CmmUqError, match="is of a recording that is reckoned with already"):
        refuse_machine(read_part(put(tmp_path / "twice", {**plate_files({}, machine_state=again), **GAUGE})))


def test_readings_in_another_order_and_numbered_otherwise_are_the_same() -> None:
    """Else they counted twice, and u over the range fell by a sixth."""
    job = read_job(ROOT / "examples" / "axis-runs-simulated")
    turned = job.points.select(np.arange(len(job.points))[::-1])
    assert _recording(replace(job, points=replace(turned, measurement=turned.measurement + 7))) == _recording(job)
    reading = job.points.columns["reading_um"].copy()
    reading[3] += 1e-4
    other = replace(job.points, columns={**job.points.columns, "reading_um": reading})
    assert _recording(replace(job, points=other)) != _recording(job)
