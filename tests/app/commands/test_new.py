"""A new job of every kind runs at once, says that it is simulated, and becomes a measured one by taking that away."""

from __future__ import annotations

import datetime as dt
import json
import re
import tomllib
from functools import cache
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from cmm_uq.app.api import calls as beginning
from cmm_uq.app.commands.budget import write_budget
from cmm_uq.app.commands.diagnose import diagnosis_outcome
from cmm_uq.app.commands.jobs.check import check_job, check_read
from cmm_uq.app.commands.jobs.new import (
    BUDGET,
    PLAN,
    README,
    RECORDING,
    SCHEMA,
    job_of_export,
    known,
    new_job,
    titles,
    write_new,
)
from cmm_uq.app.commands.parts.new import PART
from cmm_uq.app.commands.plan import write_plan
from cmm_uq.app.commands.reading import job_of, read_job
from cmm_uq.app.commands.report import report_outcome
from cmm_uq.artefacts import BUILT_IN, kind_named
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.origin import as_json, origin_warnings
from cmm_uq.jobs.columns import REQUIRED
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.tables.identification import SIMULATED
from tests.app.commands.test_budget import dated
from tests.conftest import ROOT
from tests.plugin.packages import OUTSIDE_KINDS, install
from tests.result_keys import RESULTS, described

NAMES = (
    *BUILT_IN, "shift_plate", "circular_test", "arm_sphere", "arm_orientations", "arm_lengths", "robot_poses",
    "polygon", "five_axes",
)  # fmt: skip


@cache
def begun(name: str) -> dict[str, bytes]:
    return new_job(name, {}, id=name)


def read(files: dict[str, bytes]) -> Job:
    return job_of({name: content for name, content in files.items() if name not in (README, SCHEMA)})


EVERY_RESULT = {key.partition(".")[0] for key in RESULTS}


def paths(data: object, above: str = "") -> list[str]:
    """Dotted names of the leaves of results.json, as the reference has them."""
    if isinstance(data, dict) and data:
        names = {key.replace(".", "·"): item for key, item in data.items()}  # a point in a name parts nothing
        return [path for key, item in names.items() for path in paths(item, f"{above}.{key}" if above else key)]
    if isinstance(data, list) and data and isinstance(data[0], dict):
        return [path for item in data for path in paths(item, f"{above}[]")]
    return [above] if data not in ({}, []) else []


def test_every_built_in_kind_and_a_plate_that_is_shifted_can_be_begun() -> None:
    assert tuple(known()) == tuple(sorted(NAMES, key=list(known()).index))
    assert set(known()) == set(NAMES)
    assert set(titles()) == {*NAMES, PLAN, PART, BUDGET}


@pytest.mark.long(but="sphere")
@pytest.mark.parametrize("name", NAMES)
def test_a_new_job_is_reported_at_once_as_simulated_and_agrees_with_its_model(name: str) -> None:
    """Nothing but white noise was drawn, so the diagnosis finds nothing and every statement is a complete pass."""
    job = read(begun(name))
    found = diagnosis_outcome(job) if name == "error_map" else report_outcome(job)
    assert found.origin == SIMULATED
    assert len(origin_warnings(job)) > 0
    assert found.results.get("diagnosis", {"verdict": "consistent"})["verdict"] == "consistent"
    undescribed = [path for path in paths(json.loads(as_json(found.results))) if path.split(".")[0] in EVERY_RESULT]
    assert name in ("shift", "shift_plate", "error_map") or [one for one in undescribed if not described(one)] == []
    statements = found.results.get("conformity", [])
    assert [(one["decision"], one["scope"]) for one in statements] == [("pass", "complete")] * len(job.facts.conformity)


@pytest.mark.parametrize("name", NAMES)
def test_check_finds_nothing_but_that_it_is_simulated(name: str) -> None:
    found = check_read(read(begun(name)))
    assert found.problems == ()
    assert [one.key for one in found.warnings] == ["[job] origin"]


@pytest.mark.parametrize("name", NAMES)
def test_it_has_the_lines_that_matter_each_explained_and_says_where_the_rest_is(name: str) -> None:
    files = begun(name)
    text, schema = files["job.toml"].decode(), json.loads(files[SCHEMA])
    head, *lines = text.splitlines()
    assert head == f"#:schema ./{SCHEMA}"
    told = tomllib.loads(text)
    jsonschema.Draft7Validator(schema).validate(dated(told))
    assert {"job", "machine", "artefact", "model"} <= set(told)
    assert all(where in lines[0] for where in ("cmm-uq schema job", "docs/reference/job.md"))
    assert not [line for line in lines if re.match(r"# [a-z_\[]+ ?=", line)]
    assert all("  # " in line for line in lines if re.match(r"[a-z_]+ = ", line))
    assert len([line for line in lines if re.match(r"[a-z_]+ = ", line)]) <= 25


@pytest.mark.parametrize("name", [name for name in NAMES if name != "error_map"])
def test_its_recording_has_the_columns_that_the_readme_names(name: str) -> None:
    files = begun(name)
    header = files[RECORDING].decode().splitlines()[1].split(",")
    named = re.findall(r"`(\w+)`", files[README].decode().split("Its columns: ")[1].split(";")[0])
    assert set(REQUIRED) <= set(named) <= set(header)
    assert len(files[README].decode().splitlines()) <= 12
    assert files[README].decode().startswith(f"# {titles()[name]}\n")


def test_it_becomes_a_measured_job_when_every_mark_is_taken_away_and_not_before(tmp_path: Path) -> None:
    write_new("sphere", tmp_path / "job", {"artefact": {"form_um": 0.1}})
    toml, csv = tmp_path / "job" / "job.toml", tmp_path / "job" / RECORDING
    toml.write_text(re.sub(r"(?m)^origin = .*\n", "", toml.read_text(encoding="utf-8")), encoding="utf-8")
    with pytest.raises(CmmUqError, match=r"was simulated, and job\.toml says measured"):
        read_job(tmp_path / "job")
    csv.write_text(csv.read_text(encoding="utf-8").split("\n", 1)[1], encoding="utf-8")
    told = {problem.problem.removesuffix(" is still an example's") for problem in check_job(tmp_path / "job").problems}
    assert told == {
        "name",
        "travel_mm",
        "date",
        "length_mm",
        "u_um",
        "u_form_um",
        "temperature_c",
        "standard",
        "limit_um",
        "rule",
    }  # of form_um somebody answers
    toml.write_text(toml.read_text(encoding="utf-8").replace("# EXAMPLE, put in your own:", "#"), encoding="utf-8")
    found = check_job(tmp_path / "job")
    assert found.sound
    assert "[laboratory] name" in [one.key for one in found.warnings]
    assert read_job(tmp_path / "job").origin == "measured"


def test_what_is_given_takes_the_place_of_what_the_kind_begins_with() -> None:
    given = {
        "machine": {"name": "Bridge 7", "travel_mm": {"x": [0, 500], "y": [0, 500], "z": [-500, 0]}},
        "artefact": {"length_mm": 300.0, "U_um": 0.8, "k": 2},
        "conformity": {"standard": "ISO 10360-2:2009", "mpe": "2,5 + L/300"},
    }
    job = read(new_job("ballbar", given, id="mine"))
    assert job.facts.machine.name == "Bridge 7"
    assert job.facts.artefact.u_um == 0.4
    (wish,) = job.facts.conformity
    assert wish.limit_um is None
    assert wish.mpe is not None
    assert (wish.mpe.a_um, wish.mpe.k) == (2.5, 300.0)
    first, second = job.points.xyz[:2]
    assert np.linalg.norm(second - first) == pytest.approx(300.0, abs=0.01)
    assert job.points.machine_xyz.max() <= 500.0


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    (tmp_path / "kept.txt").write_text("mine", encoding="utf-8")
    for name in ("ballbar", PLAN, BUDGET):
        with pytest.raises(CmmUqError, match=r"is not empty: 'kept\.txt' lies in it"):
            write_new(name, tmp_path, {})
    with pytest.raises(CmmUqError, match="cannot be a new folder"):
        write_new("ballbar", tmp_path / "kept.txt", {})
    assert [path.name for path in tmp_path.iterdir()] == ["kept.txt"]


@pytest.mark.parametrize(
    ("name", "given", "told"),
    [
        ("balbar", {}, "there is no kind 'balbar'. Did you mean 'ballbar'"),
        ("ballbar", {"artefact": {"lenght_mm": 3.0}}, "unknown key. Did you mean 'length_mm'"),
        ("ballbar", {"artefact": {"length_mm": 5000.0}}, "long along X"),
        (PLAN, {"artefact": {"kind": "error_map"}}, "error maps cannot be planned"),
        (BUDGET, {"artefact": {"length_mm": 3.0}}, "has no machine, artefact or job"),
    ],
)
def test_what_cannot_be_begun_is_refused_and_nothing_is_written(
    name: str, given: dict, told: str, tmp_path: Path
) -> None:
    with pytest.raises(CmmUqError, match=told):
        write_new(name, tmp_path / "new", given)
    assert not (tmp_path / "new").exists()


@pytest.mark.long
def test_a_new_plan_is_planned_and_a_new_budget_is_evaluated(tmp_path: Path) -> None:
    write_new(PLAN, tmp_path / "plan", {"artefact": {"kind": "step_gauge"}})
    planned = write_plan(tmp_path / "plan", tmp_path / "planned", power=False)
    assert str(planned.summary.subject).startswith("7 set-ups, ")  # the lines of ISO 10360-2
    (problem,) = check_job(tmp_path / "plan").problems
    assert "no such file" in problem.problem
    write_new(BUDGET, tmp_path / "budget", {})
    (stated,) = write_budget(tmp_path / "budget" / "budget.toml", tmp_path / "evaluated").found.stated.values()
    by_hand = 100.0021 - 100.0 * 11.5e-6 * 0.4
    u = np.sqrt(0.0004**2 + (100 * 0.4 * 1e-6) ** 2 / 3 + (100 * 11.5e-6 * 0.2) ** 2 / 3)
    assert stated.value == pytest.approx(by_hand, abs=1e-9)
    assert stated.u == pytest.approx(u, rel=1e-3)


def test_rows_that_were_measured_make_a_measured_job() -> None:
    points = read(begun("ballbar")).points
    rows = [",".join([*map(str, key), *(f"{v:.4f}" for v in xyz)]) for key, xyz in
            zip(zip(points.measurement, points.point, strict=True), points.xyz, strict=True)]  # fmt: skip
    files = {RECORDING: "\n".join([",".join(REQUIRED), *rows]).encode()}
    job = read(
        job_of_export(
            "ballbar", {"job": {"date": dt.date(2026, 5, 31)}, "machine": {"name": "Bridge 7"}}, files, id="mine"
        )
    )
    assert job.origin == "measured"
    np.testing.assert_allclose(job.points.xyz, points.xyz, atol=1e-4)
    assert (job.facts.artefact.length_mm, job.facts.artefact.u_um, job.facts.conformity) == (None, None, [])
    with pytest.raises(CmmUqError, match=r"\[machine\].*is missing|machine"):
        job_of_export("ballbar", {"job": {"date": dt.date(2026, 5, 31)}}, files, id="mine")


def test_a_new_job_of_a_kind_of_another_package_can_be_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(install(OUTSIDE_KINDS, tmp_path))
    kind_named.cache_clear()
    try:
        files = new_job("tracker_length", {}, id="mine")
        assert check_read(read(files)).sound
        assert "Standard uncertainty of the tracker's wavelength." in files["job.toml"].decode()
        assert "tracker_length" in files[SCHEMA].decode()
        assert "tracker_mm" in read(files).points.columns
    finally:
        kind_named.cache_clear()


def test_from_python_it_is_a_job_in_memory(tmp_path: Path) -> None:
    job = beginning.new("plane", machine={"name": "Bridge 7"})
    assert job.facts.machine.name == "Bridge 7"
    job.write(tmp_path / "job")
    assert read_job(tmp_path / "job").origin == SIMULATED
    assert not beginning.check(beginning.new(PLAN)).sound


RUNS = ROOT / "tests" / "jobs" / "importing" / "development_exports" / "D24_Z_before_comp.rtl"
OF_RUNS = {"machine": {"name": "M"}, "recording": {"file": RUNS.name, "lines": {"Z": "along Z from 100,200,0"}}}


def test_a_job_of_runs_along_one_axis_begins_with_effects_of_that_axis_alone() -> None:
    tables = {**OF_RUNS, "job": {"date": dt.date(2025, 5, 8)}}
    files = job_of_export("axis_runs", tables, {RUNS.name: RUNS.read_bytes()}, id="j")
    assert tomllib.loads(files["job.toml"].decode())["model"]["effects"] == ["scale_z", "hysteresis_z"]


def test_without_a_date_the_one_of_the_export_is_named() -> None:
    with pytest.raises(CmmUqError, match="the file has it in line 18: Date: 14:06 May 08 2025") as refused:
        job_of_export("axis_runs", OF_RUNS, {RUNS.name: RUNS.read_bytes()}, id="j")
    assert refused.value.fix == "Give the date of measurement: --set job.date=2025-05-08"
