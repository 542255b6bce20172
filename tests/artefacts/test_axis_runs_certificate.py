"""The certificate of the simulated runs: truth, figures by hand, decisions, what no run reads, and what is not evaluated."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from benchmarks.artefacts.axis_runs_coverage import Machine as Curves, recorded
from cmm_uq.app.commands.diagnose import diagnose_read
from cmm_uq.app.commands.jobs.compensate import write_new_map
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import write_report
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Machine, Points
from cmm_uq.certificate.document import Plot
from cmm_uq.machine.physics.catalogue import effects
from tests.artefacts.simulated import blocks, results
from tests.conftest import ROOT
from tests.maths.geometry.test_positioning import by_loops

NAME = "axis-runs-simulated"
JOB = ROOT / "examples" / NAME
TRUTH = {
    "scale_x": 9.0, "scale_y": -6.0, "scale_z": 14.0, "hysteresis_x": 3.0, "hysteresis_y": -1.5, "straightness_x_y": 5.0,
    "straightness_y_z": -4.0, "rotation_x_z": 6.0, "rotation_y_x": -4.0, "rotation_z_y": 5.0,
}  # fmt: skip
ROWS = list(csv.DictReader((JOB / "recording.csv").read_text(encoding="utf-8").splitlines()))
POSITIONS = {1: "x", 8: "y", 15: "z"}


def deviations(measurement: int) -> np.ndarray:
    """(2, targets, repeats), µm, of a run by its rows alone."""
    axis = POSITIONS[measurement]
    own = [row for row in ROWS if row["measurement"] == str(measurement)]
    targets = sorted({float(row[f"{axis}_mm"]) for row in own})
    found = np.full((2, len(targets), 5), np.nan)
    for row in own:
        side, repeat = int(float(row[f"approach_{axis}"]) < 0), int(row["repeat"]) - 1
        found[side, targets.index(float(row[f"{axis}_mm"])), repeat] = float(row["reading_um"])
    return found


def test_the_errors_that_were_put_in_are_found() -> None:
    for effect, true in TRUTH.items():
        (found,) = results(NAME)["estimates"][effect].values()
        assert abs(found["value"] - true) < 3 * found["u"], effect
        assert found["u"] < 0.2 * abs(true) + 0.1, effect


@pytest.mark.parametrize("measurement", POSITIONS)
def test_figures_are_those_of_the_recorded_readings(measurement: int) -> None:
    (found,) = (run for run in results(NAME)["runs"] if run["measurement"] == measurement)
    assert found["figures"] == pytest.approx(by_loops(deviations(measurement)), rel=1e-6)
    assert found["quantity"] == f"{POSITIONS[measurement]}t{POSITIONS[measurement]}"
    x = deviations(measurement)
    assert np.array([way["mean"] for way in found["directions"]]) == pytest.approx(x.mean(axis=2), abs=1e-6)
    assert found["drift_of_repeats"] == pytest.approx(x.mean(axis=(0, 1)) - x.mean(), abs=1e-6)


def test_the_worst_axis_is_decided_with_the_test_uncertainty() -> None:
    accuracy, reversal = results(NAME)["conformity"]
    worst = max(by_loops(deviations(number))["A"] for number in POSITIONS)
    assert accuracy["value_um"] == pytest.approx(worst, rel=1e-6)
    assert (accuracy["finding"], accuracy["decision"]) == (
        "pass",
        "incomplete",
    )  # no rated temperatures are stated: no pass
    assert reversal["value_um"] == pytest.approx(max(by_loops(deviations(n))["B"] for n in POSITIONS), rel=1e-6)
    assert accuracy["guard_band_um"] == pytest.approx(1.6449 * accuracy["u_um"], rel=1e-3)
    assert reversal["decision"] == "fail"  # 3 µm against 2.5 µm


def test_the_test_uncertainty_is_what_draws_by_hand_make_of_the_statements() -> None:
    """0.3 µm/m and 0.2 µm at the end of the way together, 0.1 µm of each reading: other draws, the figures in loops.

    What scatter adds to a figure is as much as √3 of it adds once more.
    """
    random = np.random.default_rng(11)
    for number, way in ((1, 0.810), (8, 1.080)):
        x, part = deviations(number), np.linspace(0, 1, 7)[None, :, None]
        whole = np.hypot(0.3 * way, 0.2)
        draws = [(whole * random.normal() * part, 0.1 * random.normal(size=x.shape)) for _ in range(1500)]
        once, more = ([by_loops(x + common + n * each) for common, each in draws] for n in (1.0, np.sqrt(3)))
        (found,) = (run for run in results(NAME)["runs"] if run["measurement"] == number)
        for figure in ("A", "E", "R", "B", "M", "mean B"):
            bias = np.mean([one[figure] for one in more]) - by_loops(x)[figure]
            u = np.hypot(np.std([one[figure] for one in once]), bias)
            assert found["U"][figure] == pytest.approx(2 * u, rel=0.1), figure


def test_what_no_run_reads_is_named() -> None:
    assert results(NAME)["not_read"] == ["zrz", "xwy", "ywz", "xwz"]


@pytest.mark.long
def test_a_run_without_one_reading_is_not_evaluated_and_not_decided(tmp_path: Path) -> None:
    job = tmp_path / "job"
    shutil.copytree(JOB, job)
    text = (job / "recording.csv").read_text(encoding="utf-8").splitlines()
    (job / "recording.csv").write_text("\n".join([*text[:5], *text[6:]]) + "\n", encoding="utf-8")
    with pytest.raises(CmmUqError, match=r"target 585 mm has 0 readings in direction \+1 of repeat 1"):
        write_report(job, tmp_path / "out")
    toml = (job / "job.toml").read_text(encoding="utf-8")
    (job / "job.toml").write_text(toml[: toml.index("[[conformity]]")], encoding="utf-8")
    written = write_report(job, tmp_path / "out")
    (found, *_) = json.loads(written.results)["runs"]
    assert "target 585 mm in the positive direction has 0 readings in repeat 1" in found["not_evaluated"]
    assert "Measurement 1 is not evaluated" in (tmp_path / "out" / "certificate-simulated.html").read_text("utf-8")


@pytest.mark.long
def test_a_map_of_the_runs_corrects_the_machine_and_the_other_sign_spoils_it(tmp_path: Path) -> None:
    """Distances along lines beside the recorded ones, by the true errors that need nothing but a place."""
    from cmm_uq.machine.physics.kinematics import on_leaning_axes

    _, found = write_new_map(JOB, tmp_path / "map")
    job = read_job(JOB)
    machine, random = job.points.machine, np.random.default_rng(2)
    ends = np.array([machine.travel(a) for a in "xyz"])
    first, second = (ends[:, 0] + random.random((400, 3)) * np.ptp(ends, axis=1) for _ in range(2))
    second[:, 1:] = first[:, 1:]  # along X, so that no squareness, which nobody read, counts
    placed = {name: true for name, true in TRUTH.items() if not name.startswith("hysteresis")}

    def true(xyz: np.ndarray) -> np.ndarray:
        one = np.ones(len(xyz), dtype=np.int64)
        points = Points(xyz, one, np.arange(len(xyz)), one, Machine("", machine.chain, machine.travel_mm))
        return sum(
            value * effect.basis(points)[:, :, 0]
            for effect, value in zip(effects(list(placed)), placed.values(), strict=True)
        )  # type: ignore[return-value]

    def by_map(xyz: np.ndarray) -> np.ndarray:
        figures = np.stack([
            np.column_stack([np.interp(xyz[:, i], axis.positions, axis.errors[:, k]) for k in range(6)])
            for i, axis in enumerate(found.error_map.axes)
        ], axis=1)  # fmt: skip
        return on_leaning_axes(xyz, figures, found.error_map.squareness, chain=machine.chain)

    off, known = ((of(second) - of(first))[:, 0] * np.sign(second[:, 0] - first[:, 0]) for of in (true, by_map))
    left, before, other = (1e3 * float(np.sqrt(np.mean(each**2))) for each in (off - known, off, off + known))
    assert left < 0.4 * before < before < other


def test_a_run_that_was_repeated_is_drawn_target_by_target() -> None:
    pictures = {
        b.caption: b.alternative for b in blocks(NAME) if isinstance(b, Plot) and "repeats, filled" in b.caption
    }
    assert [str(caption)[:13] for caption in pictures] == [f"Measurement {number}"[:13] for number in POSITIONS]
    for number, told in zip(POSITIONS, pictures.values(), strict=True):
        mean = deviations(number).mean(axis=2)
        assert str(told) == f"Mean deviations from {mean.min():.2f} to {mean.max():.2f} µm.".replace("-", "−")


@pytest.mark.long
def test_effects_whose_sizes_no_machine_has_do_not_stop_the_diagnosis(tmp_path: Path) -> None:
    """Curves of no known form along X alone: three rotations and a period fit them by metres that cancel."""
    random = np.random.default_rng([3, 6])
    runs = [(0, 0), (0, 1), (0, 2), (0, 4), (0, 5)]
    job = recorded(
        Curves(random, smooth=True), random, tmp_path, runs, targets=9, repeats=2, names=["scale_x", "hysteresis_x"]
    )
    found = diagnose_read(read_job(job)).diagnosis
    assert found.verdict in ("partial", "empirical", "unexplained")
    assert found.improvement.heldout_rms_after_um <= found.improvement.heldout_rms_before_um
