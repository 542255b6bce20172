"""What correcting for a found effect would change: a squareness added to a real recording, taken away again."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cmm_uq.analysis.conformity.accuracy import figures
from cmm_uq.app.commands.diagnose import diagnose_read
from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.units import ARCSECOND
from cmm_uq.certificate.result import JobDiagnosis

EXAMPLE = Path(__file__).parents[3] / "examples" / "iota-1102-20C-compensated"
LIMIT_UM = 150.0


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> JobDiagnosis:
    """With 150″ of squareness XY added to the compensated recording, and a model of scale alone."""
    job = tmp_path_factory.mktemp("squareness") / "job"
    shutil.copytree(EXAMPLE, job)
    table = pd.read_csv(job / "ballbar.csv", comment="#")
    table["x_mm"] += 150 * ARCSECOND * table["y_mm"]
    table.to_csv(job / "ballbar.csv", index=False)
    text = (job / "job.toml").read_text(encoding="utf-8")
    text = re.sub(r"(?m)^effects = .*$", 'effects = ["scale_x", "scale_y", "scale_z"]', text)
    text = re.sub(r"(?m)^limit_um = .*$", f"limit_um = {LIMIT_UM}", text)
    (job / "job.toml").write_text(text + STATED, encoding="utf-8")
    return diagnose_read(read_job(job))


STATED = """
[test_uncertainty]
u_repeat_um = 7.0
[rated_conditions]
declared = { by = "A. Muster", reason = "as the thesis has it" }
"""


def lengths(file: Path) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    xyz = pd.read_csv(file, comment="#")[["x_mm", "y_mm", "z_mm"]].to_numpy()
    return np.linalg.norm(xyz[1::2] - xyz[::2], axis=1)


@pytest.mark.long
def test_corrected_figures_are_those_of_the_recording_before_the_squareness_was_added(found: JobDiagnosis) -> None:
    assert [item.effect for item in found.diagnosis.effects] == ["squareness_xy"]
    assert found.consequences is not None
    before = figures(lengths(EXAMPLE / "ballbar.csv"))
    for name, (as_recorded, corrected) in found.consequences.figures.items():
        assert abs(corrected.value - float(before[name])) < 2 * corrected.u
        if name != "mean_length_mm":
            assert as_recorded.value > corrected.value + 2 * corrected.u


@pytest.mark.long
def test_a_decision_that_the_squareness_spoilt_is_mended_by_its_correction(found: JobDiagnosis) -> None:
    """As far as measured: position 18 is a copy of 14 and stays one."""
    assert found.consequences is not None
    (before, after), *_ = found.consequences.statements
    assert before.value_um > LIMIT_UM
    assert (before.outcome, after.outcome) == ("fail", "incomplete")
    assert after.decision.outcome == "pass"
    assert after.missing == before.missing == ("1 of 20 positions: 19 distinct, measurement 18 is a copy of 14",)


@pytest.mark.long
def test_nothing_found_changes_nothing() -> None:
    assert diagnose_read(read_job(EXAMPLE)).consequences is None
