"""Attitude of a digitizer from scanned planes: built from the definition alone, found again."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.optical.planes import ScannedPlanes
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.machine.model import RecordingModel
from tests.app.cli.process import run
from tests.artefacts.digitizer.aligned import turned
from tests.conftest import ROOT

EXAMPLE = ROOT / "examples" / "scanned-planes-simulated"
INDEXED = (90.0, 90.0, 30.0)
TRUE = np.array([90.31, 89.82, 30.17])
NORMALS = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.5, 0.5, 0.7))
FACTS = artefact_facts(kind="scanned_planes")


def scanned(
    true: Floats = TRUE, noise_um: float = 0.0, seed: int = 0, normals: tuple[tuple[float, ...], ...] = NORMALS
) -> Points:
    """Points on planes n·X = d with X = D + E·[u v 0], E by SciPy; u and v anywhere, D where it has to be."""
    random, parts = np.random.default_rng(seed), []
    E = turned(true.tolist())
    for number, normal in enumerate(normals, 1):
        n = np.array(normal) / np.linalg.norm(normal)
        uv = random.uniform(-20, 20, (60, 2))
        seen = uv @ E[:, :2].T
        D = np.array([400.0, 300.0, -200.0]) + random.uniform(-30, 30, (60, 3))
        D -= np.outer((D + seen) @ n - 100.0, n)
        D += noise_um * 1e-3 * random.standard_normal(D.shape)
        parts.append(np.column_stack([np.full(60, number), D, uv]))
    rows = np.vstack(parts)
    columns = {name: np.full(len(rows), value) for name, value in zip(("alpha_deg", "beta_deg", "gamma_deg"), INDEXED)}  # noqa: B905
    columns |= {"u_mm": rows[:, 4], "v_mm": rows[:, 5]}
    number = rows[:, 0].astype(np.int64)
    point = np.tile(np.arange(1, 61), len(normals))
    lines = np.arange(2, len(rows) + 2)
    return Points(rows[:, 1:4], number, point, np.ones_like(number), Machine(), columns, lines)


def test_angles_that_the_index_of_the_wrist_does_not_know_come_out_exactly() -> None:
    found = RecordingModel(ScannedPlanes(FACTS, scanned()), ()).estimate().least_squares
    np.testing.assert_allclose(found.value, TRUE, atol=1e-7)
    assert np.abs(found.residuals).max() < 1e-9


def test_the_covariance_is_how_the_angles_scatter() -> None:
    found = [
        RecordingModel(ScannedPlanes(FACTS, scanned(noise_um=9.0, seed=seed)), ()).estimate().least_squares
        for seed in range(200)
    ]
    off = np.array([each.value - TRUE for each in found])
    squares = [o @ np.linalg.solve(each.covariance, o) / 3 for o, each in zip(off, found, strict=True)]
    assert abs(np.mean(squares) - 1) < 4 * np.sqrt(2 / 3 / 200)


def test_planes_of_one_direction_leave_an_angle_open_and_are_refused() -> None:
    with pytest.raises(CmmUqError, match="leave part of α, β, γ open"):
        ScannedPlanes(FACTS, scanned(normals=((0.0, 0.0, 1.0), (0.0, 0.0, 1.0)), noise_um=9.0))


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda p: p.select(np.flatnonzero((p.measurement != 2) | (p.point < 5))), "measurement 2 has 4 points"),
        (lambda p: p.at(p.xyz + (p.measurement == 3)[:, None] * np.random.default_rng(1).normal(0, 20, p.xyz.shape)),
         "the points of measurement 3 lie in no plane"),
    ],
)  # fmt: skip
def test_points_of_no_plane_are_refused_with_their_line(change: Callable[[Points], Points], told: str) -> None:
    with pytest.raises(CmmUqError, match=told) as refused:
        ScannedPlanes(FACTS, change(scanned()), where="recording.csv")
    assert str(refused.value.where).startswith("recording.csv line ")
    assert refused.value.fix


def test_the_command_gives_the_angles_and_refuses_a_scan_without_v(tmp_path: Path) -> None:
    shutil.copytree(EXAMPLE, tmp_path / "job")
    done = run("report", "job", "--out", "out", cwd=tmp_path)
    assert done.returncode == 0
    assert "γ of attitude 1" in done.stdout
    recording = tmp_path / "job" / "recording.csv"
    recording.write_text(recording.read_text(encoding="utf-8").replace("v_mm", "other"), encoding="utf-8")
    done = run("report", "job", "--out", "again", cwd=tmp_path)
    assert done.returncode == 2
    assert "no column 'v_mm'" in done.stderr
