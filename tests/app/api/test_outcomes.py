"""What the calls give, held to the files that the commands write and to ArviZ."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import arviz
import numpy as np
import pytest

import cmm_uq
from cmm_uq.app.api.outcomes import Report
from cmm_uq.app.commands.report import write_report
from tests.conftest import ROOT

IOTA = ROOT / "examples" / "iota-1102-20C"


@pytest.fixture(scope="module")
def found() -> Report:
    return cmm_uq.report(str(IOTA), seed=0)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the command writes."""
    folder = tmp_path_factory.mktemp("written")
    write_report(IOTA, folder / "out")
    return folder / "out"


@pytest.fixture(scope="module")
def results(written: Path) -> dict[str, Any]:
    return dict(json.loads((written / "results.json").read_bytes()))


def test_nothing_is_written_before_it_is_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    cmm_uq.report(IOTA)
    assert not list(tmp_path.iterdir())


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


def test_a_kind_without_named_draws_says_so() -> None:
    shift = cmm_uq.report(ROOT / "examples" / "shift-simulated")
    assert shift.estimates.loc["scale_x.ppm", "unit"] == "ppm"
    assert "simulated" in shift.warnings[0]
    without = dataclasses.replace(shift, outcome=dataclasses.replace(shift.outcome, draws=None))
    with pytest.raises(cmm_uq.CmmUqError, match="no draws by name"):
        without.covariance  # noqa: B018


def test_a_diagnosis_names_what_was_left_out_with_its_probability() -> None:
    found = cmm_uq.diagnose(ROOT / "examples" / "iota-1102-maps")
    said = {each["effect"]: each["probability"] for each in found.diagnosis["effects"]}
    assert found.verdict == "partial"
    assert {name.split(".")[0] for name in found.effects.index} == set(said)
    assert found.effects.loc["thermal_scale_y.cte_per_k", "probability"] == said["thermal_scale_y"]


def test_a_plan_lists_its_placings_and_writes_the_recording_to_fill_in(tmp_path: Path) -> None:
    found = cmm_uq.plan(ROOT / "examples" / "plan-ballbar", power=False)
    assert len(found.placings) == 20
    assert {"plan.csv", "plan.html", "results.json", "manifest.json"} == set(found.write(tmp_path / "plan"))
