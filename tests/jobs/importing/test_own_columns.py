"""A recording as this program writes it, of any kind, is read back whole by the import."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from cmm_uq.app.cli.commands import app
from tests.conftest import ROOT


def table(path: Path) -> dict[str, np.ndarray]:
    rows = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    head, *cells = csv.reader(rows)
    return dict(zip(head, np.array(cells, dtype=np.float64).T, strict=True))


@pytest.mark.parametrize("kind", ["multilateration", "optical-ballbar", "scanned-planes", "digitizer", "triangle"])
def test_no_column_is_lost_and_no_number_changed(kind: str, tmp_path: Path) -> None:
    source, out = ROOT / "examples" / f"{kind}-simulated" / "recording.csv", tmp_path / "read.csv"
    done = CliRunner().invoke(app, ["import", str(source), "--out", str(out)])
    assert done.exit_code == 0, done.output
    was, read = table(source), table(out)
    assert set(read) == set(was)
    for name, values in was.items():
        np.testing.assert_allclose(read[name], values, atol=1e-9, err_msg=name)
    assert "not used" not in done.output


def test_a_ball_without_points_is_still_a_point(tmp_path: Path) -> None:
    (tmp_path / "balls.csv").write_text(
        "measurement,ball,x_mm,y_mm,z_mm\n1,1,0,0,0\n1,2,300,0,0\n2,1,0,0,9\n2,2,0,300,9\n"
    )
    done = CliRunner().invoke(app, ["import", str(tmp_path / "balls.csv"), "--out", str(tmp_path / "read.csv")])
    assert done.exit_code == 0, done.output
    assert list(table(tmp_path / "read.csv")["point"]) == [1, 2, 1, 2]
