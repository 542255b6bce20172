"""A diagnosis is verified like a certificate, with the options that it was made with: they follow from results.json."""

from __future__ import annotations

import json
from pathlib import Path

from cmm_uq.commands.report import write_diagnosis
from cmm_uq.commands.verify import verify
from tests.conftest import ROOT

JOB = ROOT / "examples" / "plane-simulated"


def test_a_diagnosis_is_made_again_with_its_rate_of_false_alarms(tmp_path: Path) -> None:
    write_diagnosis(JOB, tmp_path / "diagnosis", alpha=0.05, seed=3)
    data = json.loads((tmp_path / "diagnosis" / "results.json").read_bytes())
    assert data["diagnosis"]["false_alarms"] == 0.05
    found = verify([tmp_path / "diagnosis"]).inquiry
    assert found.word == "VERIFIED", found.findings + found.unchecked
