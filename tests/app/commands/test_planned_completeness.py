"""What the laboratory says of a complete test is a condition of its plan; kinds of stations and scans are proved too."""

from __future__ import annotations

from pathlib import Path

import pytest

from cmm_uq.app.commands.plan import make_plan
from cmm_uq.app.commands.prove import ProofOptions, prove_job
from cmm_uq.app.commands.reading import read_job
from tests.conftest import ROOT


def planned(folder: Path, complete: str) -> dict[str, list[str]]:
    """Conditions of a plan for the example's recorded places, each with what is missing of it."""
    source = ROOT / "examples" / "plane-simulated"
    rule = 'standard = "laboratory\'s own rule"\ncharacteristic = "flatness"\nlimit_um = 9.0\nrule = "simple"'
    statement = f"\n[[conformity]]\n{rule}\n{complete}\n"
    for name in ("job.toml", "recording.csv"):
        (folder / name).write_bytes((source / name).read_bytes() + statement.encode() * (name == "job.toml"))
    plan = make_plan(read_job(folder), power=False)
    return {str(one.what): [str(text) for text in one.missing] for one in plan.conditions}


def test_more_measurements_than_are_planned_are_missing(tmp_path: Path) -> None:
    points = read_job(ROOT / "examples" / "plane-simulated").points
    count = len(set(points.measurement.tolist()))
    enough = planned(tmp_path, f"complete = {{ measurements = {count}, repeats = 1, points = 4 }}")
    assert enough[f"{count} measurements by the laboratory's own rule"] == []
    lacking = planned(tmp_path, f"complete = {{ measurements = {count + 90}, repeats = 1, points = 4 }}")
    (missing,) = lacking[f"{count + 90} measurements by the laboratory's own rule"]
    assert missing.startswith(f"{count + 90} measurements by the laboratory's own rule (")
    assert not any("own rule" in what for what in planned(tmp_path, ""))


@pytest.mark.long
@pytest.mark.parametrize("name", ["multilateration-simulated", "optical-ballbar-simulated", "scanned-planes-simulated"])
def test_a_diagnosis_of_stations_and_of_scans_is_proved(name: str, tmp_path: Path) -> None:
    proof, kept = prove_job(read_job(ROOT / "examples" / name), ProofOptions(1, 1), folder=tmp_path / "kept")
    assert kept is not None
    kept.close()
    assert len(proof.records) == 1
