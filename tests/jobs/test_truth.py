"""What a simulated recording is drawn from may be wrong, but makes no recording that cannot be read.

truth.toml's noise: each component by its key.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.toml_file import checked
from cmm_uq.jobs.derived_job import Truth


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


TRUTH = Path("truth.toml")


def test_the_noise_of_a_coordinate_is_one_number_or_one_for_each_axis() -> None:
    assert checked(b"[noise]\ncoordinate_um = 1.2\n", TRUTH, Truth).noise.coordinates_um == (1.2, 1.2, 1.2)
    by_axis = checked(b"[noise]\ncoordinate_um = { x = 1.0, y = 1.5, z = 2.0 }\n", TRUTH, Truth)
    assert by_axis.noise.coordinates_um == (1.0, 1.5, 2.0)


@pytest.mark.parametrize(
    "line", ["coordinate_um = { x = 1.0 }", "tails_dof = 2.0", "slow_time_s = 0.0", "growth_um = -1.0"]
)
def test_what_no_noise_can_be_is_refused_with_its_key(line: str) -> None:
    with pytest.raises(CmmUqError, match=line.split(" =")[0]):
        checked(f"[noise]\n{line}\n".encode(), TRUTH, Truth)


@pytest.mark.long
def test_components_are_drawn_in_their_sizes(ballbar_points) -> None:  # type: ignore[no-untyped-def]
    """Standard deviations over many drawings; slow noise needs a time; a display shows multiples of its steps."""
    from dataclasses import replace

    from cmm_uq.machine.model import Noise
    from cmm_uq.machine.model.recorded import distances_in_placing

    random = np.random.default_rng(1)
    timed = replace(ballbar_points, columns={"time_s": 10.0 * np.arange(len(ballbar_points))})
    axes = np.stack([Noise((1e-3, 2e-3, 3e-3)).drawn(timed, random) for _ in range(2000)])
    assert axes.std(axis=(0, 1)) == pytest.approx([1e-3, 2e-3, 3e-3], rel=0.02)
    heavy = np.stack([Noise(1e-3, tails=3.0).drawn(timed, random) for _ in range(4000)])
    assert np.median(np.abs(heavy)) == pytest.approx(1e-3 * 0.7649 / np.sqrt(3), rel=0.02)  # quartile of t with three
    slow = np.stack([Noise(slow=1e-3, slow_time_s=30.0).drawn(timed, random) for _ in range(4000)])
    assert np.mean(slow[:, 1] * slow[:, 2]) / 1e-6 == pytest.approx(np.exp(-1 / 3), abs=0.04)
    walked = np.stack([Noise(slow=1e-3, slow_time_s=np.inf).drawn(timed, random) for _ in range(4000)])
    part = timed.columns["time_s"] / timed.columns["time_s"].max()
    assert walked.std(axis=(0, 2)) == pytest.approx(1e-3 * np.sqrt(2 * part), rel=0.03, abs=1e-12)
    assert np.mean(walked[:, 1] * walked[:, -1]) == pytest.approx(2e-6 * part[1], rel=0.15)  # min(t, t')
    grown = np.stack([Noise(growth=1e-3).drawn(timed, random) for _ in range(4000)])
    away = distances_in_placing(timed.xyz, timed)
    assert grown.std(axis=(0, 2)) == pytest.approx(1e-3 * away / away.max(), abs=5e-5)
    shown = Noise(resolution=5e-3).displayed(timed.xyz) / 5e-3
    assert np.allclose(shown, np.round(shown), atol=1e-6)
    with pytest.raises(CmmUqError, match="time_s"):
        Noise(slow=1e-3).drawn(replace(timed, columns={}), random)
