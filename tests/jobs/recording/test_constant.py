"""A temperature that is stated for the whole recording is a column of it, unless the recording has its own."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.certificate import conditions
from tests.conftest import ROOT


def job(tmp_path: Path, line: str) -> Path:
    folder = Path(shutil.copytree(ROOT / "examples" / "iota-1102-20C", tmp_path / "job"))
    text = (folder / "job.toml").read_text(encoding="utf-8")
    (folder / "job.toml").write_text(text.replace("[recording]", f"[recording]\n{line}", 1), encoding="utf-8")
    return folder


def test_it_is_recorded_and_the_certificate_says_that_it_was_stated(tmp_path: Path) -> None:
    read = read_job(job(tmp_path, "constant = { temp_air_c = 20.4 }"))
    assert {*read.points.columns["temp_air_c"].tolist()} == {20.4}
    assert "air 20.40 °C, stated for the whole recording" in str(conditions(read).rows)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (
            "constant = { temp_air = 20.4 }",
            "temp_air is no temperature, pressure or humidity. Did you mean 'temp_air_c'",
        ),
        ("constant = { x_mm = 1.0 }", "x_mm is no temperature, pressure or humidity"),
    ],
)
def test_what_is_no_condition_is_refused(tmp_path: Path, line: str, said: str) -> None:
    with pytest.raises(CmmUqError) as refused:
        read_job(job(tmp_path, line))
    assert said in str(refused.value)


def test_a_column_that_the_recording_has_is_not_stated_over(tmp_path: Path) -> None:
    read = read_job(job(tmp_path, "constant = { temp_air_c = 20.4 }"))
    with pytest.raises(CmmUqError, match="the recording has temp_air_c itself"):
        read.facts.recording.with_constant(read.points, tmp_path / "job.toml")
