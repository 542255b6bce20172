"""The noise of an earlier recording, as a plan reads it from its results.json."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.reports import noise_found
from tests.app.commands.test_planning import JOB, SIX

RESULTS: dict[str, Any] = {
    "schema": "cmm-uq/results/1",
    "noise": {
        "coordinate_um": {"value": 1.5, "u": 0.1}, "x_um": {"value": 1.0, "u": 0.1}, "y_um": {"value": 1.1, "u": 0.1},
        "z_um": {"value": 2.2, "u": 0.1}, "placing_um": {"value": 0.4, "u": 0.3, "probability": 0.9},
    },
}  # fmt: skip


def read(**noise: Any) -> Any:
    data = RESULTS | {"noise": RESULTS["noise"] | noise}
    data["noise"] = {name: value for name, value in data["noise"].items() if value is not None}
    return noise_found(json.dumps(data).encode(), "earlier/results.json")


def test_a_variance_that_is_not_known_counts_with_its_mean() -> None:
    """0.4² + 0.3² = 0.5²; growth was not to be seen there, and stays unknown."""
    found = read()
    assert found.reading_um == (1.0, 1.1, 2.2)
    assert found.placing_um == pytest.approx(0.5)
    assert found.growth_um is None


def test_axes_that_could_not_be_told_apart_have_the_noise_of_a_coordinate() -> None:
    assert read(x_um=None, y_um=None, z_um=None).reading_um == (1.5, 1.5, 1.5)


@pytest.mark.parametrize(("content", "said"), [
    (b"[]", "says nothing of the noise"),
    (b"{", "it is no JSON"),
    (json.dumps({"schema": "cmm-uq/plan/1", "noise": {"coordinate_um": 1.0}}).encode(), "schema"),
    (json.dumps(RESULTS | {"noise": {"coordinate_um": {"value": -1.0}}}).encode(), "coordinate_um"),
])  # fmt: skip
def test_what_is_no_report_is_refused(content: bytes, said: str) -> None:
    with pytest.raises(CmmUqError, match=said):
        noise_found(content, "earlier/results.json")


def planned(folder: Path, plan: str) -> Any:
    (folder / "job.toml").write_text(JOB.format(plan=plan, effects=SIX, length=400.0), encoding="utf-8")
    return read_job(folder, recorded=False)


def test_a_job_names_a_folder_and_takes_the_file_along(tmp_path: Path) -> None:
    (tmp_path / "earlier").mkdir()
    (tmp_path / "earlier" / "results.json").write_text(json.dumps(RESULTS), encoding="utf-8")
    assert "earlier/results.json" in planned(tmp_path, 'noise_from = "earlier"').inputs


@pytest.mark.parametrize(("plan", "said"), [
    ('noise_from = "earlier"', "earlier/results.json"),
    ('noise_from = "earlier"\nplacing_um = 1.0', "both given"),
    ("placing_um = -1.0", "placing_um"),
])  # fmt: skip
def test_what_cannot_be_read_is_refused(tmp_path: Path, plan: str, said: str) -> None:
    with pytest.raises(CmmUqError, match=said):
        planned(tmp_path, plan)
