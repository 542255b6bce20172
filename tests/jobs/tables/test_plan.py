"""``[plan]`` of a job that may still be measured."""

from __future__ import annotations

from pathlib import Path

import pytest

from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.errors import CmmUqError


def with_plan(job: Path, plan: str) -> Path:
    with (job / "job.toml").open("a", encoding="utf-8") as file:
        file.write(f"\n[plan]\n{plan}\n")
    return job


def test_a_job_to_be_measured_has_no_points_and_knows_its_machine(job: Path) -> None:
    (job / "ballbar.csv").unlink()
    read = read_job(job, recorded=False)
    assert len(read.points) == 0
    assert read.points.machine.travel("x") == (0.0, 900.0)
    assert list(read.inputs) == ["job.toml"]


def test_a_report_still_asks_for_the_recording(job: Path) -> None:
    (job / "ballbar.csv").unlink()
    with pytest.raises(CmmUqError, match="no such file"):
        read_job(job)


def test_wishes_are_left_out_by_whoever_has_none(job: Path) -> None:
    plan = read_job(job).facts.plan
    assert plan.criterion is None
    assert plan.candidates == 300


@pytest.mark.parametrize(("plan", "said"), [
    ("volume_mm = { x = [900.0, 0.0] }", "first number must be the lower one"),
    ("volume_mm = { w = [0.0, 1.0] }", "volume_mm"),
    ('criterion = "E"', "criterion"),
    ("more = 1", "need a criterion"),
    ('criterion = "D"\nmore = 1\nnumber = 2', "number and more are both given"),
    ("repeats = 0", "repeats"),
    ("budget_min = -1.0", "budget_min"),
    ("[plan.fixtures]\nheights_mm = [0.0, -100.0]", "first number must be the lower one"),
    ("[plan.fixtures]\ndirections = [[0.0, 0.0, 0.0]]", "points nowhere"),
])  # fmt: skip
def test_impossible_wishes_are_refused_with_their_key(job: Path, plan: str, said: str) -> None:
    with pytest.raises(CmmUqError, match=said):
        read_job(with_plan(job, plan))
