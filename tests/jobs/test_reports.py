"""A job that names what the machine showed before it was adjusted.

The noise of an earlier recording, as a plan reads it from its results.json.
"""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.derived_job import derived_toml
from cmm_uq.jobs.reports import AsFound, noise_found
from tests.app.commands.test_planning import JOB, SIX

FOUND: dict[str, Any] = {
    "schema": "cmm-uq/results/1",
    "job": {"id": "before", "origin": "measured", "date": "2004-08-30", "machine": "DEA Iota 1102"},
    "estimates": {"scale_x": {"ppm": {"value": 120.0, "u": 10.0, "interval95": [100.0, 141.0]}}},
    "accuracy": {"b89_range_um": 500.0},
    "accuracy_uncertainty": {"b89_range_um": {"value": 500.0, "u": 20.0, "interval95": [460.0, 540.0]}},
    "conformity": [{"standard": "ASME B89.4.1-1997", "characteristic": "volumetric performance", "decision": "fail"}],
    "further": {"keys": ["are", "no", "matter"]},
}


def naming(job: Path, given: str, content: str) -> Path:
    (job / "before").mkdir()
    (job / "before" / "results.json").write_text(content, encoding="utf-8")
    path = job / "job.toml"
    path.write_text(
        path.read_text(encoding="utf-8").replace("[job]\n", f'[job]\nas_found = "{given}"\n', 1), encoding="utf-8"
    )
    return job


@pytest.mark.parametrize("given", ["before", "before/", "before/results.json"])
def test_the_folder_or_the_file_may_be_named_and_it_is_an_input(job: Path, given: str) -> None:
    read = read_job(naming(job, given, json.dumps(FOUND)))
    assert read.as_found is not None
    assert read.as_found.job.id == "before"
    assert read.as_found.estimates["scale_x"]["ppm"].value == 120.0
    assert "before/results.json" in read.inputs


@pytest.mark.parametrize(("change", "message"), [
    ({"job": {**FOUND["job"], "machine": "another"}}, "is of machine 'another', and this job of 'DEA Iota 1102'"),
    ({"job": {**FOUND["job"], "origin": "simulated"}}, "is of a simulated recording, and this one is measured"),
    ({"schema": "cmm-uq/budget/1"}, "is no results.json of a report: schema: "),
    ({"estimates": {"scale_x": {"ppm": {"value": None}}}}, r"estimates.scale_x.ppm.value: "),
])  # fmt: skip
def test_what_is_no_state_of_this_machine_is_refused(job: Path, change: dict[str, Any], message: str) -> None:
    with pytest.raises(CmmUqError, match=message) as error:
        read_job(naming(job, "before", json.dumps(FOUND | change)))
    assert str(error.value.where).endswith("before/results.json")


@pytest.mark.parametrize("content", ["", "[]", "{", '{"schema": NaN}', "[" * 10_000])
def test_what_is_no_results_file_is_one_line(job: Path, content: str) -> None:
    with pytest.raises(CmmUqError, match=r"is no results\.json of a report"):
        read_job(naming(job, "before", content))


def test_a_file_that_is_not_there_or_outside_is_refused(job: Path) -> None:
    with pytest.raises(CmmUqError, match="no such file"):
        read_job(naming(job, "elsewhere", "{}"))


def test_one_outside_the_job_is_refused(job: Path) -> None:
    with pytest.raises(CmmUqError, match="not inside the job folder"):
        read_job(naming(job, "../before", "{}"))


def test_a_derived_recording_was_never_adjusted_and_agrees_on_nothing(job: Path) -> None:
    read = read_job(naming(job, "before", json.dumps(FOUND)))
    text = read.inputs["job.toml"].replace(b"[job]\n", b"[job]\nrecalibration_agreed = 2005-09-01\n", 1)
    told = tomllib.loads(derived_toml(replace(read, inputs={**read.inputs, "job.toml": text}), "simulate", {}).decode())
    assert told["job"].keys().isdisjoint({"as_found", "recalibration_agreed"})
    assert told["job"]["place"] == read.facts.job.place


def test_what_was_found_by_tolerances_is_stated_too() -> None:
    found = AsFound.model_validate_json(
        json.dumps(FOUND | {"tolerances": {"scale_x": {"ppm": 25.0, "verdict": "out"}}})
    )
    assert [(one.called, one.outcome) for one in found.stated] == [
        ("ASME B89.4.1-1997 volumetric performance", "fail"), ("scale_x.ppm", "fail"),
    ]  # fmt: skip


RESULTS: dict[str, Any] = {
    "schema": "cmm-uq/results/1",
    "noise": {
        "coordinate_um": {"value": 1.5, "u": 0.1}, "x_um": {"value": 1.0, "u": 0.1}, "y_um": {"value": 1.1, "u": 0.1},
        "z_um": {"value": 2.2, "u": 0.1}, "placing_um": {"value": 0.4, "u": 0.3, "probability": 0.9},
    },
}  # fmt: skip


def read(**noise: Any) -> Any:
    data = RESULTS | {"noise": RESULTS["noise"] | noise}
    data["noise"] = {name: value for name, value in data["noise"].items() if value is not None}
    return noise_found(json.dumps(data).encode(), "earlier/results.json")


def test_a_variance_that_is_not_known_counts_with_its_mean() -> None:
    """0.4² + 0.3² = 0.5²; growth was not to be seen there, and stays unknown."""
    found = read()
    assert found.reading_um == (1.0, 1.1, 2.2)
    assert found.placing_um == pytest.approx(0.5)
    assert found.growth_um is None


def test_axes_that_could_not_be_told_apart_have_the_noise_of_a_coordinate() -> None:
    assert read(x_um=None, y_um=None, z_um=None).reading_um == (1.5, 1.5, 1.5)


@pytest.mark.parametrize(("content", "said"), [
    (b"[]", "says nothing of the noise"),
    (b"{", "it is no JSON"),
    (json.dumps({"schema": "cmm-uq/plan/1", "noise": {"coordinate_um": 1.0}}).encode(), "schema"),
    (json.dumps(RESULTS | {"noise": {"coordinate_um": {"value": -1.0}}}).encode(), "coordinate_um"),
])  # fmt: skip
def test_what_is_no_report_is_refused(content: bytes, said: str) -> None:
    with pytest.raises(CmmUqError, match=said):
        noise_found(content, "earlier/results.json")


def planned(folder: Path, plan: str) -> Any:
    (folder / "job.toml").write_text(JOB.format(plan=plan, effects=SIX, length=400.0), encoding="utf-8")
    return read_job(folder, recorded=False)


def test_a_job_names_a_folder_and_takes_the_file_along(tmp_path: Path) -> None:
    (tmp_path / "earlier").mkdir()
    (tmp_path / "earlier" / "results.json").write_text(json.dumps(RESULTS), encoding="utf-8")
    assert "earlier/results.json" in planned(tmp_path, 'noise_from = "earlier"').inputs


@pytest.mark.parametrize(("plan", "said"), [
    ('noise_from = "earlier"', "earlier/results.json"),
    ('noise_from = "earlier"\nplacing_um = 1.0', "both given"),
    ("placing_um = -1.0", "placing_um"),
])  # fmt: skip
def test_what_cannot_be_read_is_refused(tmp_path: Path, plan: str, said: str) -> None:
    with pytest.raises(CmmUqError, match=said):
        planned(tmp_path, plan)
