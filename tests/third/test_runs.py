"""Positioning runs are read from their report, and play is concealed in them with the sign that the package reads."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from benchmarks.third.runs import repeats, runs, table, written
from cmm_uq.app.commands.reading import read_job

PLACES = np.arange(5.0, 65.0, 5.0)


def report(folder: Path, error_um: np.ndarray) -> Path:
    """A report with errors (12, 2) there and back; of the first position the sensor is out of range."""
    lines = ["# ecmc motion system test report", "", "1 | 15.0 | 15.0 | 0.0"]
    for k, sense in enumerate(("Positive", "Negative")):
        lines += ["", f"## Accuracy based on Resolver and ILD2300 Sensor {sense} Direction", "", "--- | --- | --- |"]
        for i, place in enumerate(PLACES):
            seen = "Out of range" if i == 0 else f"{place + 1e-3 * error_um[i, k]:.4f}"
            lines.append(f"{i + 1} | {place:.4f} | {place:.4f} | 0.0007 | {seen} | 0.0")
    folder.mkdir()
    (folder / "report.md").write_text("\n".join(lines), encoding="utf-8")
    return folder


def errors(seed: int, reproducible_um: float) -> np.ndarray:
    random = np.random.default_rng(seed)
    return reproducible_um * random.standard_normal((12, 1)) + 3.0 * random.standard_normal((12, 2))


def test_a_report_is_read_without_what_was_out_of_range(tmp_path: Path) -> None:
    error = errors(0, 20.0)
    ((name, run),) = runs(report(tmp_path / "axis", error))
    assert name == "report"
    assert len(run) == 22
    np.testing.assert_allclose(run[:11, 1] - run[:11, 0], 1e-3 * error[1:, 0], atol=6e-5)
    np.testing.assert_allclose(run[11:, 1] - run[11:, 0], 1e-3 * error[1:, 1], atol=6e-5)
    assert list(np.unique(run[:, 2])) == [-1, 1]


def test_repeats_are_judged_as_by_an_analysis_of_variance_of_what_a_line_leaves(tmp_path: Path) -> None:
    """F of positions over readings, both of them about a mean of each way and a line through all."""
    error = errors(1, 4.0)
    ((_, run),) = runs(report(tmp_path / "axis", error))
    y, x = 1e3 * (run[:, 1] - run[:, 0]), run[:, 0]
    line = np.column_stack([run[:, 2] > 0, run[:, 2] < 0, x]).astype(float)
    whole = np.column_stack([line, x[:, None] == np.unique(x)])
    few, many = (float(np.sum((y - A @ np.linalg.lstsq(A, y, rcond=None)[0]) ** 2)) for A in (line, whole))
    of_positions, of_one = (few - many) / 9, many / 10
    means, one, p = repeats(run)
    assert one**2 == pytest.approx(of_one)
    assert 2 * means**2 == pytest.approx(of_positions)
    assert p == pytest.approx(stats.f.sf(of_positions / of_one, 9, 10))


def test_play_is_concealed_as_a_reading_that_lags_behind(tmp_path: Path) -> None:
    ((_, run),) = runs(report(tmp_path / "axis", errors(2, 0.0)))
    plain, played = (read_job(written(tmp_path / f"{play}", run, play)).points for play in (0.0, 40.0))
    moved = 1e3 * (plain.xyz[:, 0] - played.xyz[:, 0])
    np.testing.assert_allclose(moved, [20.0] * 11 + [-20.0] * 11, atol=1e-9)


@pytest.mark.long
def test_play_is_said_of_a_run_that_has_it(tmp_path: Path) -> None:
    """40 µm beside readings of 3 µm."""
    *_, row = table(report(tmp_path / "axis", errors(3, 0.0)), tmp_path / "jobs")
    said = row.split(" | ")[6]
    value, u = float(said.split(",")[0]), float(said.split("u = ")[1].split()[0])
    assert abs(value - 40.0) < 4 * u
