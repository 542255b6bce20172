"""A job folder is read whole, or refused with file, line or key and the fix."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.app.commands.reading import NAMEABLE, read_job
from cmm_uq.artefacts import artefact_facts
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.source import sha256
from cmm_uq.jobs.tables.conformity import ConformityFacts, TestUncertainty, uncertainty_missing


def edit(job: Path, pattern: str, replacement: str) -> Path:
    """job.toml with the first match of a pattern replaced; the pattern must be there."""
    path = job / "job.toml"
    text, count = re.subn(pattern, replacement, path.read_text(encoding="utf-8"), count=1, flags=re.MULTILINE)
    assert count == 1
    path.write_text(text, encoding="utf-8")
    return job


def refused(job: Path) -> str:
    with pytest.raises(CmmUqError) as caught:
        read_job(job)
    return str(caught.value)


def test_the_example_is_read_with_its_machine_and_points(iota: Path) -> None:
    job = read_job(iota)
    assert job.facts.job.id == "iota-1102-20C"
    assert job.points.xyz.shape == (40, 3)
    assert job.points.machine.travel("z") == (-500.0, 0.0)
    np.testing.assert_allclose(job.points.carriages[0], [-496.6823 + 805, -134.2409 + 303, 27.7912 - 294])
    assert set(job.points.columns) == {"radius_mm", "fit_rms_um", "n_points"}


def test_the_toml_itself_may_be_named(iota: Path) -> None:
    assert read_job(iota / "job.toml").facts == read_job(iota).facts


def test_every_input_is_hashed(iota: Path) -> None:
    hashes = sha256(read_job(iota).inputs)
    expected = hashlib.sha256((iota / "ballbar.csv").read_bytes()).hexdigest()
    assert hashes.keys() == {"job.toml", "ballbar.csv"}
    assert hashes["ballbar.csv"] == expected


@pytest.mark.parametrize(
    ("pattern", "replacement", "message"),
    [
        (r"^id = .*", "", r"job\.toml line \d+: \[job\] id: is missing\. Add it"),
        (r"^date = .*", 'date = "yesterday"', r"line \d+: \[job\] date: .*date"),
        (r"^id = .*", 'id = "../../etc"', r"\[job\] id: string should match"),
        (r"^id = .*", 'id = ".."', r"cannot consist of dots"),
        (r"^chain = .*", 'chain = "XYY"', r"\[machine\]: chain = 'XYY': give X, Y, Z once each"),
        (r"x = \[0, 900\]", "x = [900, 0]", r"travel_mm.*first number must be the lower"),
        (r"^kind = .*", 'kind = "ballbat"', r"\[artefact\] kind: input should be 'ballbar'"),
        (r"^length_mm = .*", 'length_mm = "404"', r"line \d+: \[artefact\] length_mm: input.* valid number.*without quotes"),
        (r"^length_mm = .*", "length_mm = nan", r"length_mm: input should be (a finite number|greater than 0)"),
        (r"^length_mm = .*", "length_mm = inf", r"length_mm: input should be a finite number"),
        (r"^length_mm = .*", "", r"u_um is given without length_mm"),
        (r"^length_mm = .*", "length_mn = 404.2", r"\[artefact\] length_mn: unknown key\. Did you mean 'length_mm'"),
        (r"^cte_per_k = .*", "cte_per_k = 12", r"12 is no expansion coefficient"),
        (r"^\[model\]$", "[modle]", r"\[modle\]: unknown key\. Did you mean 'model'|\[model\]: is missing"),
        (r"^standard = .*", 'standard = "Six Sigma"', r"\[\[conformity\]\] 1 standard: no such standard is.*Known: ASME"),
        (r"^\[\[conformity\]\]$", "[conformity]", r"\[conformity\]: .*Head it \[\[conformity\]\], in double brackets"),
        (r"^rule = .*", 'rule = "lenient"', r"\[\[conformity\]\] 1 rule"),
        (r"^rule = .*", 'rule = "ISO 14253"', r"Did you mean 'ISO 14253-1'"),
        (r"^length_mm = ", "lenght_mm = ", r"Did you mean 'length_mm'\? Certified length at 20 °C"),
        (r"^limit_um = .*", "", r'give either limit_um, or mpe = "3 \+ L/300"'),
        (r"^limit_um = .*", "limit_um = -1", r"limit_um: input should be greater than 0"),
        (r"^rule = .*", 'characteristic = "R0"', r"characteristic = 'R0' of ASME B89.4.1-1997 is not decided here"),
        (r"^\[job\]$", "[job", r"is not valid TOML"),
        (r"^file = .*", 'file = "../ballbar.csv"', r"is not inside the job folder"),
        (r"^file = .*", 'file = "barbell.csv"', r"barbell\.csv: no such file"),
        (r"^u_um = .*", "u_um = 1e-300", r"\[artefact\] u_um: must be 0, or at least 1e-06"),
        (r"^u_um = .*", "u_um = 1e300", r"\[artefact\] u_um: input should be less than or equal to 1000000"),
        (r"^length_mm = .*", "length_mm = 1e308", r"\[artefact\] length_mm: input should be less than"),
        (r"^length_mm = .*", "length_mm = 1e-9", r"\[artefact\] length_mm: must be at least 1e-06"),
        (r"^file = .*", 'file = "ballbar.csv"\nu_coordinate_um = 1e-9', r"u_coordinate_um: must be at least 1e-06"),
        (r"^file = .*", 'file = "ballbar.csv"\nu_coordinate_um = 1.7e308', r"u_coordinate_um: .* 1000000"),
        (r"^file = .*", 'file = "ballbar.csv"\nset_aside = [99999999999]', r"set_aside\.0\.measurement: .* 1000000000"),
        (r"^limit_um = .*", "limit_um = 1e308", r"limit_um: input should be less than or equal to 1000000"),
        (r"^limit_um = .*", "mpe = { a_um = 1.0, k = 1e-300 }", r"k: must be at least 0\.001"),
        (r"^origin_mm = .*", "origin_mm = [1e300, 0.0, 0.0]", r"origin_mm\.0: input should be less than"),
        (r"x = \[0, 900\]", "x = [0.0, 1e-300]", r"travel_mm.*a travel of less than 0\.001 mm"),
        (r"x = \[0, 900\]", "x = [0.0, 1e308]", r"travel_mm\.x\.1: input should be less than"),
        (r"^effects = .*", f"effects = {['scale_x'] * 101}", r"effects: list should have at most 100 items"),
        (r"^id = .*", 'id = "NUL"', r"\[job\]: .*Windows takes this name for a device"),
        (r"^u_um = .*", f"u_um = {'9' * 5000}", r"job\.toml line \d+: '9+' … has 5000 characters"),
        (r"^u_um = .*", f"u_um = {'[' * 3000}", r"job\.toml line \d+: is nested too deeply"),
        (r"^place = .*", f'place = "{"W" * 100_000}"', r"job\.place: a text of 100000 characters"),
        (r"^place = .*", r'place = "a\\u202eb"', r"job\.place: has the control character U\+202E"),
    ],
)  # fmt: skip
def test_a_wrong_job_is_refused_with_its_place(job: Path, pattern: str, replacement: str, message: str) -> None:
    assert re.search(message, refused(edit(job, pattern, replacement)))


def test_the_named_line_is_the_one_with_the_mistake(job: Path) -> None:
    message = refused(edit(job, r"^u_um = .*", 'u_um = "five"'))
    line = int(re.search(r"line (\d+)", message)[1])
    assert (job / "job.toml").read_text(encoding="utf-8").splitlines()[line - 1] == 'u_um = "five"'


def test_a_folder_without_a_job_is_refused(tmp_path: Path) -> None:
    assert "job.toml: no such file" in refused(tmp_path)


def test_a_recording_that_is_a_folder_is_refused(job: Path) -> None:
    (job / "day one").mkdir()
    assert "day one: is a folder, not a file" in refused(edit(job, r"^file = .*", 'file = "day one"'))


def test_a_job_that_is_no_text_is_refused(job: Path) -> None:
    (job / "job.toml").write_bytes(b"\xff\xfe[job]")
    assert "is not UTF-8 text" in refused(job)


@pytest.mark.parametrize("rule", ['"simple"', '"ISO 14253-1"', "{ guard_band = 0.8 }", "{ max_false_accept = 0.02 }"])
def test_every_decision_rule_is_understood(job: Path, rule: str) -> None:
    assert read_job(edit(job, r"^rule = .*", f"rule = {rule}")).facts.conformity[0].rule


def test_a_pipe_is_refused_as_job_and_as_recording(job: Path) -> None:
    if not hasattr(os, "mkfifo"):
        pytest.skip("no pipes here")
    (job / "ballbar.csv").unlink()
    os.mkfifo(job / "ballbar.csv")
    assert "ballbar.csv: is a pipe, not a file" in refused(job)
    (job / "job.toml").unlink()
    os.mkfifo(job / "job.toml")
    assert "job.toml: is a pipe, not a file" in refused(job)


@pytest.mark.parametrize("what", ["key", "kind", "effects"])
def test_a_refusal_never_echoes_what_it_refuses(job: Path, what: str) -> None:
    long = "k" * 90
    lines = {"key": f"{long} = 1", "kind": f'kind = "{"k " * 4000}"', "effects": f"effects = {[long] * 90}x"}
    message = refused(edit(job, r"^kind = .*", lines[what]))
    assert len(message) <= 300
    assert "job.toml" in message


@pytest.mark.parametrize("rule", ['"ISO 14253-1"', "{ guard_band = 0.8 }", "{ max_false_accept = 0.02 }"])
@pytest.mark.parametrize("stated", ["", "u_um = 0"])
def test_a_rule_that_needs_an_uncertainty_is_refused_without_at_reading(job: Path, rule: str, stated: str) -> None:
    edit(edit(job, r"^standard = .*", 'standard = "ISO 10360-2:2009"'), r"^rule = .*", f"rule = {rule}")
    message = refused(edit(job, r"^u_um = .*", stated))
    assert re.search(
        r"line \d+: \[conformity\]: the rule .+ needs the uncertainty .* no u_um above 0\. Give u_um", message
    )
    assert "{" not in message


def test_simple_acceptance_and_figures_without_a_certificate_need_no_uncertainty(job: Path) -> None:
    read_job(edit(job, r"^u_um = .*", ""))  # the range of ASME B89.4.1 has its uncertainty from the recording
    edit(edit(job, r"^standard = .*", 'standard = "ISO 10360-2:2009"'), r"^rule = .*", 'rule = "simple"')
    assert read_job(job).facts.conformity[0].rule == "simple"


def test_a_test_sphere_without_its_form_is_refused_by_name() -> None:
    wish = ConformityFacts(standard="ISO 10360-5:2010", limit_um=3.0)
    missing = partial(uncertainty_missing, wish, stated=TestUncertainty(), standards=NAMEABLE.standards)
    assert missing(artefact_facts(kind="sphere", length_mm=25.0, u_um=0.1)) == "form_um"
    assert missing(artefact_facts(kind="sphere", length_mm=25.0, u_um=0.1, form_um=0.1)) is None


def test_references_in_the_recording_count_as_certified_unless_they_are_nominal() -> None:
    wish = ConformityFacts(standard="VDI/VDE 2617", limit_um=3.0)
    missing = partial(uncertainty_missing, wish, stated=TestUncertainty(), standards=NAMEABLE.standards)
    assert missing(artefact_facts(kind="step_gauge")) == "u_um"
    assert missing(artefact_facts(kind="step_gauge", nominal=True)) is None


def test_an_adjustment_lies_before_the_measurement(job: Path) -> None:
    toml = job / "job.toml"
    text = toml.read_text(encoding="utf-8")
    for day, fine in (("2004-08-31", True), ("2004-09-01", True), ("2004-09-02", False)):
        toml.write_text(text.replace("[job]\n", f"[job]\nadjusted_since = {day}\n"), encoding="utf-8")
        if fine:
            assert str(read_job(job).facts.job.adjusted_since) == day
        else:
            with pytest.raises(CmmUqError, match="adjusted_since = 2004-09-02 is after the measurement"):
                read_job(job)


def test_references_that_were_made_of_the_readings_make_no_test_whole(tmp_path: Path) -> None:
    job = tmp_path / "job"
    shutil.copytree("examples/step-gauge-simulated", job)
    read = np.genfromtxt(job / "recording.csv", delimiter=",", names=True)
    xyz = np.column_stack([read[f"{axis}_mm"] for axis in "xyz"])
    begin = np.flatnonzero(read["point"] == 1)[np.cumsum(read["point"] == 1) - 1]
    read["reference_mm"] = np.round(np.linalg.norm(xyz - xyz[begin], axis=1), 5)
    assert not any("readings themselves" in what for what, _ in read_job(job).circumstances.lapsed)
    np.savetxt(job / "recording.csv", read, "%.12g", ",", header=",".join(read.dtype.names), comments="")
    assert any("readings themselves (261 are" in what for what, _ in read_job(job).circumstances.lapsed)
