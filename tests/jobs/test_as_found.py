"""A job that names what the machine showed before it was adjusted."""

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
from cmm_uq.jobs.reports import AsFound

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
