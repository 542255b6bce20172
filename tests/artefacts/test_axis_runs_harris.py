"""The error map of Harris 2004 taken as readings of runs: its tables come out again, and correct its ballbar as they do."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.compensation import harris_runs as thesis
from cmm_uq.app.commands.jobs.compensate import write_new_map
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import kind_of
from cmm_uq.machine.physics.error_map import read_error_map


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(sys, "argv", ["harris_runs.py", str(tmp_path)])
    thesis.main()
    return tmp_path


def test_figures_of_the_runs_are_those_of_the_tables(folder: Path) -> None:
    job = read_job(folder / "runs")
    artefact = kind_of(job).observing("reported")(job.facts.artefact, job.points, where=None)
    table = read_error_map(thesis.MAP)
    assert [str(run.quantity) for run in artefact.runs if run.kind == "along"] == ["xtx", "yty", "ztz"]
    assert len(artefact.runs) == 15
    for i, runs in enumerate(artefact.positionings().values()):
        np.testing.assert_allclose(runs.x[0, :, 0], table.axes[i].errors[:, i] * 1e3, atol=1e-9)
    assert [round(runs.figures()["E↑"], 1) for runs in artefact.positionings().values()] == [79.4, 51.8, 11.3]


@pytest.mark.long
def test_the_map_of_the_runs_is_the_printed_one_as_far_as_its_waves_follow_it(folder: Path) -> None:
    """Eight waves an axis leave what the tables jump by from one position to the next; the rolls were not measured."""
    write_new_map(folder / "runs", folder / "map")
    printed, ours = thesis.both_maps(folder)
    for name, (size, _, rms) in thesis.differences(printed, ours).items():
        limit = 0.25 if name[1] == "r" else 1.0 if name != "ytx" else 2.0
        assert rms < limit, name
        assert rms < 0.15 * size or size < 4.0, name
    lines = [thesis.squarenesses(each, read_error_map(thesis.MAP)) for each in (printed, ours)]
    for name, angle in thesis.SQUARENESS.items():
        assert lines[0][name] == pytest.approx(angle, abs=0.7)
        assert lines[1][name] == pytest.approx(lines[0][name], abs=0.3)
    before = thesis.distance_errors(printed)
    off = thesis.distance_errors(ours) - before
    assert np.sqrt(np.mean(off**2)) < 0.025 * np.sqrt(np.mean(before**2))
    spread = [1e3 * thesis.bar_lengths(maps).std(ddof=1) for maps in (None, printed, ours)]
    assert spread[:2] == pytest.approx([73.2, 12.6], abs=0.05)
    assert abs(spread[2] - spread[1]) < 1.0
    thesis.main()
    assert read_job(folder / "bar-new").facts.machine.error_map
