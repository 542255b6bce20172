"""What the calls give, held to the files that the commands write and to ArviZ."""

from __future__ import annotations

import dataclasses
import datetime as dt
import json
from pathlib import Path
from typing import Any

import arviz
import numpy as np
import pytest

import cmm_uq
from cmm_uq.app.api.outcomes import Part, Report
from cmm_uq.jobs.part.job import TABLES
from tests.app.cli.test_due import recorded
from tests.certificate.iota import JOB as IOTA, iota_report
from tests.conftest import ROOT
from tests.laboratory.records.histories import certificate
from tests.part_machines import THERE, by_results, plate_of
from tests.part_reports import nothing_foreseen
from tests.shared import put


@pytest.fixture(scope="module")
def found() -> Report:
    return cmm_uq.report(str(IOTA), seed=0)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the command writes."""
    return put(tmp_path_factory.mktemp("written"), iota_report())


@pytest.fixture(scope="module")
def results(written: Path) -> dict[str, Any]:
    return dict(json.loads((written / "results.json").read_bytes()))


@pytest.mark.long
def test_nothing_is_written_before_it_is_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    cmm_uq.report(IOTA)
    assert not list(tmp_path.iterdir())


@pytest.mark.long
def test_it_writes_the_bytes_that_the_command_writes(found: Report, written: Path, tmp_path: Path) -> None:
    files = found.write(str(tmp_path / "out"))
    assert sorted(files) == sorted(path.name for path in written.iterdir())
    for name, path in files.items():
        assert path.read_bytes() == (written / name).read_bytes()


def test_the_estimates_are_those_of_results_json(found: Report, results: dict[str, Any]) -> None:
    for effect, parameters in results["estimates"].items():
        for name, item in parameters.items():
            row = found.estimates.loc[f"{effect}.{name}"]
            assert [row.value, row.u, row.lower, row.upper] == pytest.approx(
                [item["value"], item["u"], *item["interval95"]], rel=1e-9
            )
    assert found.estimates.loc["squareness_xy.angle_arcsec", "unit"] == "″"
    assert found.estimates.loc["artefact.length_mm", "unit"] == "mm"
    assert found.figures.loc["b89_range_um", "unit"] == "µm"


def test_the_covariance_has_the_variances_and_order_of_the_estimates(found: Report) -> None:
    assert list(found.covariance.index) == list(found.covariance.columns) == list(found.estimates.index)
    assert np.sqrt(np.diag(found.covariance)) == pytest.approx(found.estimates["u"].to_numpy(), rel=1e-12)


def test_arviz_computes_the_r_hat_and_effective_samples_that_results_json_says(
    found: Report, results: dict[str, Any]
) -> None:
    data = found.posterior.to_arviz()
    said = results["posterior"]
    chains, draws = data.posterior.sizes["chain"], data.posterior.sizes["draw"]
    assert (chains, len(range(0, draws, said["every"]))) == (said["chains"], said["draws"])
    assert max(float(v) for v in arviz.rhat(data).values()) == pytest.approx(said["rhat_max"], rel=1e-9)
    assert min(float(v) for v in arviz.ess(data).values()) == pytest.approx(said["ess_bulk_min"], rel=1e-9)


def test_arviz_counts_as_many_effective_samples_as_the_sampler_does(found: Report, results: dict[str, Any]) -> None:
    """By another estimator, and of the quantities instead of the sampler's own coordinates. The least is that of the noise:
    all else is drawn independently, given it. Strung together, its draws would be counted too often.
    """
    sampler = results["sampling"]["ess_min"]
    assert results["posterior"]["ess_bulk_min"] == pytest.approx(sampler, rel=0.3)
    noise = found.posterior["noise.coordinate_um"]
    strung = arviz.ess({"x": noise.swapaxes(0, 1).reshape(4, -1)})
    assert float(strung["x"]) > 1.3 * float(arviz.ess({"x": noise})["x"])
    assert float(arviz.ess({"x": found.posterior["scale_x.ppm"]})["x"]) > 0.5 * found.posterior["scale_x.ppm"].size


def test_it_is_frozen_and_shows_itself_in_one_line_and_in_escaped_html(found: Report) -> None:
    assert repr(found) == "<Report of iota-1102-20C: 11 estimates, ASME B89.4.1-1997 fail, consistent>"
    page = found._repr_html_()
    assert "squareness_xy.angle_arcsec" in page
    assert "<td>fail</td>" in page
    with pytest.raises(dataclasses.FrozenInstanceError):
        found.outcome = found.outcome  # type: ignore[misc]


def test_what_a_job_says_cannot_become_markup() -> None:
    page = cmm_uq.job(
        machine="<b>M", artefact="ballbar", effects=["scale_x"], recording={"file": "r.csv"}
    )._repr_html_()
    assert "&lt;b&gt;M" in page
    assert "<b>M" not in page


def test_provenance_names_program_inputs_and_seed(found: Report, results: dict[str, Any]) -> None:
    assert found.provenance["job"]["inputs_sha256"] == results["job"]["inputs_sha256"]
    assert found.provenance["software"]["version"] == cmm_uq.__version__
    assert found.provenance["seed"] == 0
    assert found.origin == "measured"


@pytest.mark.long
def test_a_kind_without_named_draws_says_so() -> None:
    shift = cmm_uq.report(ROOT / "examples" / "shift-simulated")
    assert shift.estimates.loc["scale_x.ppm", "unit"] == "ppm"
    assert "simulated" in shift.warnings[0]
    without = dataclasses.replace(shift, outcome=dataclasses.replace(shift.outcome, draws=None))
    with pytest.raises(cmm_uq.CmmUqError, match="no draws by name"):
        without.covariance  # noqa: B018


@pytest.mark.long
def test_a_diagnosis_names_what_was_left_out_with_its_probability() -> None:
    found = cmm_uq.diagnose(ROOT / "examples" / "iota-1102-maps")
    said = {each["effect"]: each["probability"] for each in found.diagnosis["effects"]}
    assert found.verdict == "partial"
    assert {name.split(".")[0] for name in found.effects.index} == set(said)
    assert found.effects.loc["thermal_scale_y.cte_per_k", "probability"] == said["thermal_scale_y"]


@pytest.mark.long
def test_a_plan_lists_its_placings_and_writes_the_recording_to_fill_in(tmp_path: Path) -> None:
    found = cmm_uq.plan(ROOT / "examples" / "plan-ballbar", power=False)
    assert len(found.placings) == 20
    assert {"plan.csv", "plan.html", "results.json", "manifest.json"} == set(found.write(tmp_path / "plan"))


@pytest.fixture(scope="module")
def part() -> Part:
    job = plate_of(by_results(), np.zeros((60, 3)), characteristic=TABLES["characteristic"][:2], **THERE)
    with pytest.MonkeyPatch.context() as patched:
        nothing_foreseen(patched)
        return cmm_uq.part(job, trials=1000, seed=2, language="de")


@pytest.mark.long
def test_figures_are_tables_by_characteristic(part: Part) -> None:
    assert list(part.characteristics.index) == ["1", "2"]
    row = part.characteristics.loc["1"]
    assert row["U"] == pytest.approx((row["interval_upper"] - row["interval_lower"]) / 2)
    assert (row["unit"], row["lower"], row["upper"]) == ("mm", 29.95, 30.05)
    assert row["outcome"] == part.results["characteristics"][0]["decision"]["outcome"]
    assert part.correlation.loc["1", "1"] == 1
    assert part.budget["1"].sum() == pytest.approx(1, abs=0.1)  # causes of a diameter add up


def test_it_says_itself_in_a_line_and_in_a_notebook(part: Part) -> None:
    assert repr(part).startswith("<Part of plate: 2 characteristics, ")
    assert "<table" in part._repr_html_()
    assert part.conforming == (part.found.outcome == "pass")


@pytest.mark.long
def test_it_writes_what_the_command_writes(part: Part, tmp_path: Path) -> None:
    files = part.write(tmp_path / "out")
    data = json.loads(files["results.json"].read_bytes())
    assert data["simulation"]["seed"] == 2
    assert data["job"]["language"] == "de"
    assert 'lang="de"' in files["part-simulated.html"].read_text(encoding="utf-8")


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """Two certificates of one machine, 2 ppm apart."""
    values = (
        (("scale_x.ppm", "Scale error of x", "ppm", value, 0.5, value - 1, value + 1, 0.4, 8.0),)
        for value in (1.0, 3.0)
    )
    days = (dt.date(2025, 3, 2), dt.date(2026, 3, 2))
    return recorded(tmp_path, *(certificate("1102", day, value) for day, value in zip(days, values, strict=True)))


def test_what_is_due_is_a_table(place: Path, tmp_path: Path) -> None:
    found = cmm_uq.due(records=place, on="2026-11-22")
    assert repr(found) == "<Due on 2026-11-22: 0 overdue, 0 due, 2 later, 0 unknown>"
    assert found.frame.loc[0, ["serial", "state", "due"]].tolist() == ["1102", "later", "2027-03-02"]
    assert "1102" in found._repr_html_()
    assert set(found.write(tmp_path / "out")) == {"due.html", "due.json", "manifest.json"}


def test_one_machine_may_be_named_alone(place: Path) -> None:
    found = cmm_uq.due("1102", records=place, on=dt.date(2027, 3, 3), within=dt.timedelta(days=1))
    assert found.frame["serial"].tolist() == ["1102"]
    assert found.frame["state"].tolist() == ["overdue"]


def test_a_history_has_its_values_and_all_that_was_recorded(place: Path, tmp_path: Path) -> None:
    found = cmm_uq.history("1102", records=place, on="2026-11-22")
    assert repr(found) == "<History of 1102: 2 recordings, 1 values>"
    row = found.values.loc["scale_x.ppm"]
    assert (row["value"], row["change"], row["u_change"]) == (3.0, 2.0, pytest.approx(0.18**0.5))
    assert row["per_year"] == pytest.approx(2 * 365.2425 / 365)
    assert dt.date(2026, 3, 2) < row["early"] < row["middle"]
    assert found.recorded["value"].tolist() == [1.0, 3.0]
    assert "Scale error of x" in found._repr_html_()
    assert set(found.write(tmp_path / "out")) == {"history.html", "history.json", "manifest.json"}
