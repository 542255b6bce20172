"""A recording that agrees, without power: said beside the verdict, with a plan that can be measured and read back."""

from __future__ import annotations

from functools import cache

from cmm_uq.app.commands.diagnose import diagnosis_outcome
from cmm_uq.app.commands.reading import job_of, read_job
from cmm_uq.certificate.diagnosis.sections import TO_FILL_IN
from cmm_uq.certificate.outcome import Outcome
from tests.conftest import ROOT

EXAMPLE = ROOT / "examples" / "iota-1102-20C"


@cache
def outcome() -> Outcome:
    """Of the real bars."""
    return diagnosis_outcome(read_job(EXAMPLE))


def test_agreement_without_power_is_said_to_be_so_and_stays_consistent() -> None:
    """Twenty bars with 10 µm of noise: a bow of 40 µm, and much larger ones, would not have shown."""
    diagnosis = outcome().results["diagnosis"]
    assert diagnosis["verdict"] == "consistent"
    beside = "But this recording could not have shown: straightness of X along Y up to 150\u00a0µm"
    assert any(beside in remark for remark in outcome().summary.remarks)
    rows = {row["effect"]: row for row in diagnosis["unseen"]}
    assert not rows["straightness_x_y"]["shown"]
    assert rows["artefact_sag"]["taken_up_by"] == ["scale_x", "scale_y"]
    assert not {"scale_x", "squareness_xy"} & rows.keys(), "what the job names is estimated"


def test_its_plan_shows_more_and_is_numbered_on() -> None:
    plan = outcome().results["diagnosis"]["next_plan"]
    assert [one["measurement"] for one in plan["set_ups"]] == list(range(21, 21 + len(plan["set_ups"])))
    shown = {one["effect"]: one for one in plan["shows"]}
    assert shown["straightness_x_y"]["detected_before"] is None
    assert shown["straightness_x_y"]["detected_after"] < 150.0


def test_the_plan_is_a_recording_to_fill_in() -> None:
    files = {path.name: path.read_bytes() for path in EXAMPLE.iterdir() if path.suffix in (".toml", ".csv")}
    plan = outcome().results["diagnosis"]["next_plan"]
    job = job_of({**files, "ballbar.csv": outcome().files[TO_FILL_IN]})
    assert job.planned
    assert len(job.points) == 2 * plan["repeats"] * len(plan["set_ups"])
    assert set(job.points.measurement.tolist()) == {one["measurement"] for one in plan["set_ups"]}
    assert "fit_rms_um" not in job.points.columns
