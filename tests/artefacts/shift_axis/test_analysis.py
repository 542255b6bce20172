"""A shift job from its folder to its result: what is found of the example, and what is refused."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.app.commands.report import analyse
from cmm_uq.artefacts.shift.axis import ShiftResult
from cmm_uq.base.errors import CmmUqError
from tests.conftest import ROOT

EXAMPLE = ROOT / "examples" / "shift-simulated"
NOISE_UM = 1.1


def truth(x: np.ndarray) -> np.ndarray:
    """Error of the example, mm, as its remarks state it."""
    return 0.012 * np.sin(x / 90) + 0.010 * np.exp((x - 590) / 60) + 8e-6 * x


@pytest.fixture(scope="module")
def example() -> ShiftResult:
    result = analyse(EXAMPLE)
    assert isinstance(result, ShiftResult)
    return result


def edited(folder: Path, *changes: tuple[str, str]) -> Path:
    """The example with parts of its job.toml replaced."""
    job = folder / "job"
    shutil.copytree(EXAMPLE, job)
    text = (job / "job.toml").read_text(encoding="utf-8")
    for pattern, replacement in changes:
        text, count = re.subn(pattern, replacement, text)
        assert count == 1, pattern
    (job / "job.toml").write_text(text, encoding="utf-8")
    return job


def of_series(job: Path, kept: set[str]) -> None:
    """Keep only some series of the recording."""
    path = job / "recording.csv"
    header, *rows = path.read_text(encoding="utf-8").splitlines()
    path.write_text("\n".join([header, *(r for r in rows if r.split(",")[0] in kept)]) + "\n", encoding="utf-8")


def test_the_true_error_lies_within_four_standard_uncertainties_everywhere(example: ShiftResult) -> None:
    curve = example.estimate.curve
    away = curve.error - (truth(curve.position) - truth(curve.position[:1]))
    assert np.all(np.abs(away[1:]) < 4 * curve.u[1:])


def test_the_scale_is_the_mean_slope_between_the_ends_of_the_known_length(example: ShiftResult) -> None:
    ends = np.array([100.0, 540.0])
    assert example.scale is not None
    true_ppm = 1e6 * np.diff(truth(ends))[0] / 440
    assert abs(example.scale.value - true_ppm) < 4 * example.scale.u
    assert example.scale.u > 0.5 / 440 * 1e3  # the known length's own 0.5 µm at least


def test_the_linearity_error_is_that_of_the_true_curve_about_the_line_through_its_ends(example: ShiftResult) -> None:
    x = example.estimate.curve.position
    line = truth(np.array([100.0, 540.0]))
    left = truth(x) - line[0] - (line[1] - line[0]) * (x - 100) / 440
    assert abs(example.linearity.value - 1e3 * np.ptp(left)) < 4 * example.linearity.u


def test_repeats_give_the_repeatability(example: ShiftResult) -> None:
    """3 repeats of 69 readings: 138 degrees of freedom, 6 %."""
    assert abs(example.repeatability.value - NOISE_UM) < 4 * NOISE_UM / np.sqrt(2 * 138)


def test_three_placings_have_no_integration_of_two(example: ShiftResult) -> None:
    assert not example.integrated


def test_two_placings_show_the_sources_integrations_beside_the_curve(tmp_path: Path) -> None:
    job = edited(tmp_path, (r"shifts_mm = .*", "shifts_mm = [0.0, 20.0]"))
    of_series(job, {"1", "2"})
    result = analyse(job)
    assert isinstance(result, ShiftResult)
    assert set(result.integrated) == {"pitch", "improved"}
    one = result.integrated["pitch"]
    joint = result.estimate.at(one.position)
    assert np.all(np.abs(joint.error - one.error)[1:] < 4 * one.u[1:])
    assert result.undetermined.patterns.shape[1] == 0


def test_without_a_known_length_there_is_no_scale(tmp_path: Path) -> None:
    result = analyse(edited(tmp_path, (r"known = .*\n", "")))
    assert isinstance(result, ShiftResult)
    assert result.scale is None
    assert result.estimate.curve.error[0] == 0.0


@pytest.mark.parametrize(
    ("pattern", "replacement", "where", "said"),
    [
        (r"axis = .*\n", "", "[artefact]", "neither axis nor plane"),
        (r"shifts_mm = .*\n", "", "shifts_mm", "is missing"),
        (r"shifts_mm = .*", "shifts_mm = [0.0, 20.0]", "shifts_mm", "2 shifts for 3 series"),
        (r"shifts_mm = .*", "shifts_mm = [0.0, 20.0, 20.0]", "shifts_mm", "same shift"),
        (r"effects = .*", 'effects = ["scale_x"]', "effects", "not by effects"),
        (r"effects = .*", 'effects = []\n[[conformity]]\nstandard = "VDI/VDE 2617"\nlimit_um = 5.0', "conformity",
         "no standard here"),
        (r'file = "recording.csv"', 'file = "recording.csv"\nset_aside = [2]', "set_aside", "cannot be set aside"),
        (r'file = "recording.csv"', 'file = "recording.csv"\nset_aside = [9]', "set_aside", "no measurement 9"),
        (r"to = 23", "to = 24", "known", "no point 24"),
        (r"to = 23", "to = 1", "known", "both point 1"),
        (r"length_mm = 440.0", "length_mm = 400.0", "known", "not 400 mm"),
    ],
)  # fmt: skip
def test_what_a_shift_job_cannot_be_is_said_with_its_key(
    tmp_path: Path, pattern: str, replacement: str, where: str, said: str
) -> None:
    with pytest.raises(CmmUqError, match=said) as caught:
        analyse(edited(tmp_path, (pattern, replacement)))
    assert caught.value.where is not None
    assert where in caught.value.where
    assert caught.value.fix
