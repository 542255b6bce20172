"""What a simulated recording is drawn from may be wrong, but makes no recording that cannot be read."""

from __future__ import annotations

from pathlib import Path

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.toml_file import checked
from cmm_uq.jobs.truth import Truth


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[noise]\ncoordinate_um = 1e308", r"line 2: \[noise\] coordinate_um: .* 1000000"),
        ("[noise]\nplacing_um = 1e-300", r"\[noise\] placing_um: must be 0, or at least"),
        ("[effects.scale_x]\nppm = 1e300", r"\[effects\] scale_x\.ppm: input should be less than"),
        ('[columns]\n"=1+1" = 1.0', r"the column '=1\+1' begins as a formula"),
        ("[columns]\nx_mm = 1.0", r"\[columns\]: x_mm comes from the job's own recording"),
        ("[columns]\ntemp_x_c = 2e5", r"temp_x_c = 200000 is more than anything"),
        (f"seed = {'9' * 40}", r"\[seed\]: input should be less than"),
    ],
)
def test_what_no_recording_could_hold_is_refused(text: str, says: str) -> None:
    with pytest.raises(CmmUqError, match=says):
        checked(text.encode(), Path("truth.toml"), Truth)


def test_what_a_machine_can_have_is_taken() -> None:
    text = b"seed = 1\n[effects.scale_x]\nppm = -3e4\n[noise]\ncoordinate_um = 0.0\n[columns]\ntemp_x_c = 22.5"
    assert checked(text, Path("truth.toml"), Truth).columns == {"temp_x_c": 22.5}


def test_a_table_of_an_odd_name_is_refused_by_that_name(tmp_path: Path) -> None:
    path = tmp_path / "truth.toml"
    with pytest.raises(CmmUqError, match=r"unknown key"):
        checked(b'["[/]"]\nx = 1\n', path, Truth)
