"""results.json keeps its layout and is the same on every run."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.results.contents import results
from cmm_uq.certificate.results.plain import as_json
from tests.artefacts.simulated import analysed
from tests.conftest import ROOT


@pytest.fixture(scope="module", params=["iota-1102-20C", "iota-1102-20C-compensated"])
def data(request: pytest.FixtureRequest) -> dict[str, Any]:
    return dict(json.loads(as_json(results(analysed(request.param)))))


def test_every_estimate_has_value_uncertainty_and_interval(data: dict[str, Any]) -> None:
    assert data["schema"] == "cmm-uq/results/1"
    assert len(data["estimates"]) == 6
    for parameters in (*data["estimates"].values(), data["artefact"]):
        for quantity in parameters.values():
            low, high = quantity["interval95"]
            assert low < quantity["value"] < high
            assert quantity["u"] > 0


def test_sampling_is_documented(data: dict[str, Any]) -> None:
    sampling = data["sampling"]
    assert sampling["sampler"].startswith("emcee ")
    assert sampling["converged"] is True
    assert sampling["ess_min"] >= 1000
    assert sampling["rhat_max"] < 1.01


def test_inputs_are_identified(data: dict[str, Any]) -> None:
    assert data["job"]["inputs_sha256"].keys() == {"job.toml", "ballbar.csv"}


def test_the_screening_names_measurements_and_file(data: dict[str, Any]) -> None:
    (finding,) = data["screening"]
    assert (finding["kind"], finding["rows"], finding["file"]) == ("duplicate", ["14", "18"], "ballbar.csv")


def test_the_diagnosis_is_part_of_the_working_file(data: dict[str, Any]) -> None:
    diagnosis = data["diagnosis"]
    assert diagnosis["verdict"] == "consistent"
    assert diagnosis["effects"] == []
    assert diagnosis["screening"] == data["screening"]


def test_an_undetermined_parameter_has_no_least_squares_value(data: dict[str, Any]) -> None:
    free = data["identifiability"]["undetermined"]
    scale = data["least_squares"]["estimates"]["scale_x"]["ppm"]
    if data["job"]["id"].endswith("-compensated"):
        assert free[0].keys() == {"scale_x.ppm", "scale_y.ppm", "scale_z.ppm", "artefact.length_mm"}
        assert scale == {"value": None, "u": None}
    else:
        assert free == []
        assert scale["u"] > 0


def test_it_keeps_the_published_contract(data: dict[str, Any], tmp_path: Path) -> None:
    checker = ROOT.parent / "shared" / "check_results.py"
    if not checker.is_file():
        pytest.skip("the contract's own checker is not beside the project")
    file = tmp_path / "results.json"
    file.write_bytes(as_json(data))
    done = subprocess.run([sys.executable, checker, file], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_numbers_that_json_cannot_carry_are_refused() -> None:
    with pytest.raises(CmmUqError, match="a figure is not finite"):
        as_json({"value": float("nan")})


def test_a_statement_has_all_that_was_decided_and_all_that_is_missing(data: dict[str, Any]) -> None:
    (found,) = data["conformity"]
    compensated = data["job"]["id"].endswith("-compensated")
    assert (found["characteristic"], found["scope"]) == ("volumetric performance", "partial")
    assert found["decision"] == ("undecided" if compensated else "fail")
    assert found["missing"][0] == "1 of 20 positions: 19 distinct, measurement 18 is a copy of 14"
    assert found["missing"][1].startswith("uncertainty: what of the artefact changes between the readings")
    assert "u_repeat_um in [test_uncertainty]" in found["missing"][1]
    (entry,) = found["errors"]
    assert (entry["error_um"], entry["u_um"], entry["limit_um"]) == (
        found["value_um"],
        found["u_um"],
        found["limit_um"],
    )
    assert (entry["outcome"], entry["measurement"], entry["repeat"]) == (found["decision"], None, None)


def test_every_length_is_in_the_table_of_errors_with_its_own_limit() -> None:
    """Limits 4 + L/100; u of 0.4 µm for every length."""
    (found,) = json.loads(as_json(results(analysed("step-gauge-simulated"))))["conformity"]
    assert found["characteristic"] == "E0"
    rows = np.genfromtxt(ROOT / "examples" / "step-gauge-simulated" / "recording.csv", delimiter=",", names=True)
    assert len(found["errors"]) == np.sum(rows["reference_mm"] > 0)
    for entry in found["errors"]:
        assert entry.keys() == {
            "measurement", "repeat", "length_mm", "position", "error_um", "u_um", "U_um", "limit_um", "guard_band_um",
            "probability_conforming", "outcome", "standing", "set_aside",
        }  # fmt: skip
        assert entry["limit_um"] == pytest.approx(4 + entry["length_mm"] / 100)
        assert entry["u_um"] == pytest.approx(0.4)
    assert (
        abs(next(e["error_um"] for e in found["errors"] if abs(e["error_um"]) == found["value_um"]))
        == found["value_um"]
    )


def test_the_contract_accepts_an_incomplete_statement(tmp_path: Path) -> None:
    checker = ROOT.parent / "shared" / "check_results.py"
    if not checker.exists():
        pytest.skip("the contract is not here")
    file = tmp_path / "results.json"
    file.write_bytes(as_json(results(analysed("gauge-blocks-simulated"))))
    (found,) = json.loads(file.read_bytes())["conformity"]
    assert (found["decision"], found["scope"]) == ("incomplete", "partial")
    assert subprocess.run([sys.executable, checker, file], check=False).returncode == 0
