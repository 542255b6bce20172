"""Tables for controllers: read back as a controller reads them they bring the axis to its targets; the other sign does not."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.app.commands.jobs.controller import write_tables
from cmm_uq.base.errors import CmmUqError
from tests.conftest import ROOT

JOB = ROOT / "examples" / "axis-runs-simulated"
Read = Callable[[Path], tuple[np.ndarray, np.ndarray, np.ndarray]]


def actual(job: Path) -> dict[tuple[float, float], float]:
    """Where X was on average at each target and direction, mm, by the rows of the recording alone."""
    head, *rows = [line.split(",") for line in (job / "recording.csv").read_text(encoding="utf-8").splitlines()]
    cells = [dict(zip(head, row, strict=True)) for row in rows]
    own = [cell for cell in cells if cell["measurement"] == "1"]
    found: dict[tuple[float, float], list[float]] = {}
    for cell in own:
        found.setdefault((float(cell["x_mm"]), float(cell["approach_x"])), []).append(float(cell["reading_um"]))
    return {key: key[0] + 1e-3 * float(np.mean(values)) for key, values in found.items()}


def of_linuxcnc(folder: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nominal, and what the axis is to be told less: actual less nominal."""
    rows = np.loadtxt(folder / "x.comp")
    return rows[:, 0], rows[:, 1] - rows[:, 0], rows[:, 2] - rows[:, 0]


def of_sinumerik(folder: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A positive value moves the axis in the negative direction."""
    text = (folder / "AX_EEC.INI").read_text()
    values = np.array([float(v) for v in re.findall(r"\$AA_ENC_COMP\[0,\d+,X1\]=(\S+)", text)])
    low, step = (float(re.findall(rf"\$AA_ENC_COMP_{name}\[0,X1\]=(\S+)", text)[0]) for name in ("MIN", "STEP"))
    return low + step * np.arange(len(values)), values, values


def of_twincat(folder: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Deviations in 0.1 µm at setpoints in 0.1 µm."""
    text = (folder / "achskw_x.lis").read_text()
    setpoint, pos, neg = (
        1e-4 * np.array([float(v) for v in re.findall(rf"table\[\d+\]\.{name} (\S+)", text)])
        for name in ("setpoint", "pos", "neg")
    )
    return setpoint, pos, neg


@pytest.mark.parametrize(
    ("form", "read", "rounded"),
    [("linuxcnc", of_linuxcnc, 1e-6), ("sinumerik", of_sinumerik, 1e-6), ("twincat", of_twincat, 1e-4)],
)
def test_a_controller_that_subtracts_its_table_reaches_its_targets(
    form: str, read: Read, rounded: float, tmp_path: Path
) -> None:
    write_tables(JOB, tmp_path / form, form)
    targets, forward, reverse = read(tmp_path / form)
    reached = actual(JOB)
    left, other, before = [], [], []
    for table, way in ((forward, 1.0), (reverse, -1.0)):
        off = np.array([reached[round(float(t), 6), way] - t for t in targets])
        left.append(off - table)
        other.append(off + table)
        before.append(off)
    spread = [np.ptp(np.concatenate(each)) for each in (left, before, other)]
    if form == "sinumerik":  # one table for both directions: half of each reversal stays
        assert np.ptp(np.mean(left, axis=0)) < 4 * rounded
    else:
        assert spread[0] < 4 * rounded
    assert spread[0] < spread[1] < spread[2]
    zero = int(np.argmin(np.abs(targets)))
    assert forward[zero] + reverse[zero] == pytest.approx(0.0, abs=2 * rounded)


def test_what_the_tables_are_worth_is_tried_on_repeats_held_out(tmp_path: Path) -> None:
    _, said = write_tables(JOB, tmp_path / "out", "linuxcnc")
    worth = json.loads((tmp_path / "out" / "controller.json").read_text())["held_out_rms_um"]
    assert set(worth) == {"x", "y", "z"}
    for axis, each in worth.items():
        assert each["corrected"] < 0.3 < each["uncorrected"] < each["sign_reversed"], axis  # the noise is 0.2 µm
    assert len(said) == 4
    assert said[-1] == "The recording was simulated: these tables are of no machine"


def test_a_template_is_given_both_signs(tmp_path: Path) -> None:
    template = tmp_path / "mine.txt"
    template.write_text(
        "{% for a in axes %}{% for t in a.targets_mm %}{{ a.name }} {{ t }} {{ a.forward_deviation_um[loop.index0] }} "
        "{{ a.reverse_correction_um[loop.index0] }}\n{% endfor %}{% endfor %}"
    )
    write_tables(JOB, tmp_path / "own", str(template))
    write_tables(JOB, tmp_path / "cnc", "linuxcnc")
    rows = [line.split() for line in (tmp_path / "own" / "axes.txt").read_text().splitlines() if line.startswith("x ")]
    targets, forward, reverse = of_linuxcnc(tmp_path / "cnc")
    assert [float(row[1]) for row in rows] == pytest.approx(targets)
    assert [1e-3 * float(row[2]) for row in rows] == pytest.approx(forward, abs=2e-6)
    assert [-1e-3 * float(row[3]) for row in rows] == pytest.approx(reverse, abs=2e-6)


@pytest.mark.parametrize("text", ["{{ axes[0].nothing }}", "{% for %}", "{{ ''.__class__.__mro__ }}"])
def test_a_template_that_cannot_be_filled_is_refused(text: str, tmp_path: Path) -> None:
    template = tmp_path / "mine.txt"
    template.write_text(text)
    with pytest.raises(CmmUqError, match="the template cannot be filled"):
        write_tables(JOB, tmp_path / "own", str(template))
    assert not (tmp_path / "own").exists()


def test_neither_a_form_nor_a_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CmmUqError, match="no such file") as told:
        write_tables(JOB, tmp_path / "own", "fanuc")
    assert "linuxcnc, sinumerik, twincat" in str(told.value.fix)


def test_a_missing_reading_and_another_kind_are_refused(tmp_path: Path) -> None:
    job = tmp_path / "job"
    shutil.copytree(JOB, job)
    lines = (job / "recording.csv").read_text(encoding="utf-8").splitlines()
    (job / "recording.csv").write_text("\n".join([*lines[:5], *lines[6:]]) + "\n", encoding="utf-8")
    with pytest.raises(CmmUqError, match=r"target 585 mm has 0 readings in direction \+1 of repeat 1"):
        write_tables(job, tmp_path / "out", "linuxcnc")
    with pytest.raises(CmmUqError, match="cannot be made tables for a controller of"):
        write_tables(ROOT / "examples" / "bryan-simulated", tmp_path / "out", "linuxcnc")


def test_of_two_runs_along_one_axis_none_is_chosen_silently(tmp_path: Path) -> None:
    job = tmp_path / "job"
    shutil.copytree(JOB, job)
    head, *rows = (job / "recording.csv").read_text(encoding="utf-8").splitlines()
    place = head.split(",").index("reading_um")
    own = [row.split(",") for row in rows if row.startswith("1,")]
    again = [
        ["90", *row[1:place], f"{float(row[place]) + 0.01 * (k % 3):.4f}", *row[place + 1 :]]
        for k, row in enumerate(own)
    ]
    (job / "recording.csv").write_text("\n".join([head, *rows, *map(",".join, again)]) + "\n", encoding="utf-8")
    with pytest.raises(CmmUqError, match="measurement 90 is a second run along X") as told:
        write_tables(job, tmp_path / "out", "linuxcnc")
    assert "set_aside" in str(told.value.fix)
    text = (job / "job.toml").read_text(encoding="utf-8")
    (job / "job.toml").write_text(text.replace("[recording]", "[recording]\nset_aside = [90]"), encoding="utf-8")
    write_tables(job, tmp_path / "out", "linuxcnc")
    write_tables(JOB, tmp_path / "of one", "linuxcnc")
    assert (tmp_path / "out" / "x.comp").read_text() == (tmp_path / "of one" / "x.comp").read_text()
