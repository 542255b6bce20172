"""The optical chain: clouds of a bar's balls, their centres, the lengths; errors of the machine and of the mount at once.

The scans are made by benchmarks/examples/optical_ballbar_job.py from the definitions alone.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import least_squares

from benchmarks.examples.optical_ballbar_job import (
    HEADER,
    LENGTH,
    OFFSET,
    RADIUS,
    SCALES_PPM,
    SQUARE_ARCSEC,
    THREE,
    Floats,
    cap,
    scanned_bars,
    true_over_read,
)  # fmt: skip
from cmm_uq.app.commands.jobs.compensate import write_compensated_cloud, write_new_map
from cmm_uq.app.commands.planning import make_plan
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import write_report
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.optical.ballbar import ScannedBallbar, observe
from cmm_uq.artefacts.optical.balls import scanned_ball
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Machine, Points
from cmm_uq.jobs.tables.conformity import Circumstances
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.model.artefact_doubt import causes_of, taken_as_exact
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.maths.geometry.feature import BallForm
from tests.app.cli.process import run
from tests.artefacts.digitizer.aligned import turned
from tests.artefacts.simulated import analysed
from tests.conftest import ROOT

SIX = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")
TRUTH = np.array([*SCALES_PPM, *SQUARE_ARCSEC, LENGTH, *OFFSET])
EXAMPLE = ROOT / "examples" / "optical-ballbar-simulated"
COLUMNS = ("alpha_deg", "beta_deg", "gamma_deg", "u_mm", "v_mm")


def points_of(rows: Floats) -> Points:
    number = rows[:, 0].astype(np.int64)
    columns = {"ball": rows[:, 2], **dict(zip(COLUMNS, rows[:, 6:].T, strict=True))}
    lines = np.arange(2, len(rows) + 2)
    return Points(rows[:, 3:6], number, rows[:, 1].astype(np.int64), np.ones_like(number), Machine(), columns, lines)


def facts(**keys: Any) -> Any:
    return artefact_facts(
        **{"kind": "ballbar", "length_mm": LENGTH, "u_um": 0.5, "offset_mm": [1.3, 264.1, 130.0], **keys}
    )


def exact(**how: Any) -> Points:
    return points_of(scanned_bars(np.random.default_rng(5), true_over_read(), noise_um=0.0, form_um=0.0, **how))


def estimated(points: Points, **keys: Any) -> RecordingModel:
    return RecordingModel(ScannedBallbar(facts(**keys), points), effects(SIX))


def test_scales_squarenesses_and_offset_come_out_of_exact_scans_together() -> None:
    """To what is quadratic in the distortion of a ball by 32 µm: below 1 ppm and 0.1″, and a nanometre of the offset."""
    found = estimated(exact()).estimate().least_squares.value
    np.testing.assert_allclose(found[:3], TRUTH[:3], atol=1.0)
    np.testing.assert_allclose(found[3:6], TRUTH[3:6], atol=0.1)
    np.testing.assert_allclose(found[7:], OFFSET, atol=5e-6)


def test_what_the_machine_does_to_a_cloud_while_it_moves_is_no_offset() -> None:
    """With the balls as mere centres, read where the machine stood on average, the offset would be off by 0.7 µm."""
    bar = ScannedBallbar(facts(), exact())
    bar._gradient = 0.0 * bar._gradient
    found = RecordingModel(bar, effects(SIX)).estimate().least_squares.value
    assert np.abs(found[7:] - OFFSET).max() > 5e-4


def test_both_ends_in_one_attitude_leave_the_offset_alone_and_the_machine_known() -> None:
    model = estimated(exact(alike=True))
    assert [size.name for size in model.artefact.sizes] == ["length_mm"]
    np.testing.assert_allclose(model.estimate().least_squares.value[3:6], SQUARE_ARCSEC, atol=0.1)


def test_estimates_are_off_by_no_more_than_their_covariance_says() -> None:
    rows = scanned_bars(np.random.default_rng(1), true_over_read(), bars=60)
    found = estimated(points_of(rows)).estimate().least_squares
    off = np.delete(found.value - TRUTH, 6)
    covariance = np.delete(np.delete(found.covariance, 6, axis=0), 6, axis=1)
    assert off @ np.linalg.solve(covariance, off) / 9 < stats.f(9, found.degrees_of_freedom).ppf(0.999)


def test_a_simulated_recording_gives_back_what_it_was_drawn_with() -> None:
    points = exact()
    bar = ScannedBallbar(facts(), points)
    drawn = RecordingModel(bar, effects(SIX)).simulate(
        np.array([-30.0, 80.0, 10.0, 90.0, 40.0, -60.0]), np.array([LENGTH, *OFFSET]), Noise(), np.random.default_rng(0)
    )
    found = estimated(bar.recorded(points, drawn)).estimate().least_squares.value
    np.testing.assert_allclose(found[:3], [-30.0, 80.0, 10.0], atol=1.0)
    np.testing.assert_allclose(found[3:6], [90.0, 40.0, -60.0], atol=0.1)
    np.testing.assert_allclose(found[7:], OFFSET, atol=2e-5)


def test_a_bar_seen_anew_from_its_own_points_is_the_same() -> None:
    bar = ScannedBallbar(facts(), exact())
    moved = bar.points.at(bar.points.xyz + np.random.default_rng(2).normal(0, 1e-2, bar.points.xyz.shape))
    again = observe(facts(), moved)
    change = bar.project(bar.points.xyz, (moved.xyz - bar.points.xyz)[:, :, None])[:, 0]
    np.testing.assert_allclose(again.lengths() - bar.lengths(), change, atol=2e-6)


def test_what_a_scanned_point_is_from_the_mount_is_its_tip() -> None:
    points = exact(bars=9)
    tips = np.column_stack(list(ScannedBallbar(facts(), points).tips().values()))
    for row in (0, 100, 500):
        uv = np.array([points.columns["u_mm"][row], points.columns["v_mm"][row], 0.0])
        E = turned([points.columns[name][row] for name in COLUMNS[:3]])
        np.testing.assert_allclose(tips[row], E @ (uv - [1.3, 264.1, 130.0]), atol=1e-9)


@pytest.mark.parametrize("prolate", [1.0, -1.0])
def test_the_shift_of_a_centre_by_the_form_of_a_ball_is_that_of_the_source(prolate: float) -> None:
    """Harris 2004 appendix A: 38.125 mm, an axis 2.5 µm longer or shorter, seen to 85°: 3 µm to the light, or away."""
    n, E = cap(400, 85.0), turned(THREE[0])
    long = RADIUS + prolate * 2.5e-3
    surface = n / np.sqrt((n[:, [0]] ** 2 + n[:, [2]] ** 2) / RADIUS**2 + n[:, [1]] ** 2 / long**2)
    read = (OFFSET + np.column_stack([0 * n[:, :2], surface[:, 2]])) @ E.T
    same = np.tile([1.0, 1.0, 1.0], (len(n), 1))
    rows = np.column_stack([same, read, np.tile(THREE[0], (len(n), 1)), surface[:, :2]])
    found = scanned_ball(points_of(rows), OFFSET, 5.0, None)
    towards = float(found.sphere.centre @ E[:, 1]) * 1e3
    assert round(towards) == 3 * prolate
    np.testing.assert_allclose(towards, prolate * found.figures_um["shift"], rtol=0.02)


def spheres(rows: Floats, xyz: Floats) -> Floats:
    """(m,) distances of the centres of balls 1 and 2 of each bar, by SciPy."""
    found = []
    for bar in np.unique(rows[:, 0]):
        ends = []
        for ball in (1, 2):
            about = xyz[(rows[:, 0] == bar) & (rows[:, 2] == ball)]
            ends.append(least_squares(lambda s, p: np.linalg.norm(p - s[:3], axis=1) - s[3], [*about.mean(axis=0), 38.0],
                                      args=(about,)).x[:3])  # fmt: skip
        found.append(np.linalg.norm(ends[1] - ends[0]))
    return np.array(found)


@pytest.mark.long
def test_the_chain_closes_on_clouds_that_it_has_not_seen(tmp_path: Path) -> None:
    """Report, map and offset, and back onto the clouds of other bars; with the signs of the map turned it gets worse."""
    calibration = write_report(EXAMPLE, tmp_path / "calibrated").files["results.json"]
    written, _ = write_new_map(EXAMPLE, tmp_path / "map")
    rows = scanned_bars(np.random.default_rng(77), true_over_read(), bars=16)
    poses = json.loads(calibration.read_text(encoding="utf-8"))["digitizer"]["poses"]
    number = {tuple(pose[name] for name in COLUMNS[:3]): pose["pose"] for pose in poses}
    cloud = tmp_path / "cloud.csv"
    lines = [",".join(f"{one:.6f}" for one in (*row[9:], *row[3:6])) + f",{number[tuple(row[6:9])]}" for row in rows]
    cloud.write_text("\n".join(["u_mm,v_mm,d_mm,e_mm,f_mm,pose", *lines]) + "\n", encoding="utf-8")

    def rms(sign: float) -> float:
        job = tmp_path / f"job{sign:g}"
        shutil.copytree(written["error-map.csv"].parent, job)
        (job / "calibration").mkdir()
        shutil.copy(calibration, job / "calibration")
        keys = (job / "error-map.toml").read_text(encoding="utf-8").splitlines()[1]
        if sign < 0:
            head, *body = (job / "error-map.csv").read_text(encoding="utf-8").splitlines()[1:]
            turned_body = [
                ",".join([*line.split(",")[:2], *(f"{-float(c)}" for c in line.split(",")[2:])]) for line in body
            ]
            (job / "error-map.csv").write_text("\n".join([head, *turned_body]) + "\n", encoding="utf-8")
            square = keys.partition("squareness_arcsec = { ")[2].partition(" }")[0]
            other = ", ".join(
                f"{name} = {-float(value)}" for name, _, value in (one.split(" ") for one in square.split(", "))
            )
            keys = keys.replace(square, other).partition(", covariance")[0] + " }]"
        said = (EXAMPLE / "job.toml").read_text(encoding="utf-8").replace(
            "[artefact]", f'{keys}\ndigitizer = {{ calibration = "calibration" }}\n\n[artefact]'
        )  # fmt: skip
        (job / "job.toml").write_text(said, encoding="utf-8")
        found = write_compensated_cloud(job, cloud, tmp_path / f"out{sign:g}", beyond="extrapolate")
        xyz = np.loadtxt(found["cloud-compensated.csv"], delimiter=",", skiprows=2)[:, :3]
        return float(np.sqrt(np.mean((spheres(rows, xyz) - LENGTH) ** 2))) * 1e3

    seen = np.array([turned(row[6:9]) @ (np.array([*row[9:], 0.0]) - OFFSET) for row in rows])
    before = float(np.sqrt(np.mean((spheres(rows, rows[:, 3:6] + seen) - LENGTH) ** 2))) * 1e3
    assert rms(1.0) < before / 5
    assert rms(-1.0) > 1.5 * before


def edited(change: Callable[[Floats], Floats]) -> Points:
    return points_of(change(scanned_bars(np.random.default_rng(5), true_over_read(), bars=9)))


def of_ball_2(rows: Floats) -> Any:
    return (rows[:, 0] == 4) & (rows[:, 2] == 2)


def without(rows: Floats, kept: int) -> Floats:
    return np.vstack([rows[~of_ball_2(rows)], rows[of_ball_2(rows)][:kept]])


def with_column(rows: Floats, column: int, value: Any) -> Floats:
    changed = rows.copy()
    changed[of_ball_2(rows), column] = value
    return changed


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda r: without(r, 6), "measurement 4, ball 2 has 6 points, too few for a sphere"),
        (lambda r: without(r, 0), "measurement 4, repeat 1 has one ball, a bar has 1 and 2"),
        (lambda r: with_column(r, 9, r[of_ball_2(r), 9] / 25.4), "measurement 4, ball 2: sphere: "),
        (lambda r: with_column(r, 3, r[of_ball_2(r), 3] + np.tile([0.0, 1.5], 20)), "measurement 4, ball 2 lie on no sphere"),
        (lambda r: with_column(r, 2, 3.0), "ball is 3, and a bar has 1 and 2"),
        (lambda r: with_column(r, 8, np.arange(40.0)), "measurement 4, ball 2 is seen in several attitudes"),
        (lambda r: r[~of_ball_2(r) | (r[:, 10] > 37.9)], "measurement 4, ball 2"),
    ],
)  # fmt: skip
def test_clouds_that_give_no_bar_are_refused_with_ball_and_line(change: Callable[[Floats], Floats], told: str) -> None:
    with pytest.raises(CmmUqError) as refused:
        ScannedBallbar(facts(), edited(change), where="recording.csv")
    assert told in refused.value.problem
    assert refused.value.where is not None
    assert refused.value.where.startswith("recording.csv")
    assert refused.value.fix


def test_attitudes_that_turn_about_one_axis_alone_are_refused() -> None:
    with pytest.raises(CmmUqError, match=r"leave part of \[U1 V1 W1\] open"):
        ScannedBallbar(facts(), exact(attitudes=THREE[:2]))


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [("offset_mm = [1.0, 264.5, 129.6]\n", "", "offset_mm"), ("length_mm = 404.235", "length_mm = 15.915", "inches")],
)
def test_a_job_without_offset_or_in_another_unit_ends_with_code_2(
    old: str, new: str, told: str, tmp_path: Path
) -> None:
    shutil.copytree(EXAMPLE, tmp_path / "job")
    job = tmp_path / "job" / "job.toml"
    text = job.read_text(encoding="utf-8")
    assert old in text
    job.write_text(text.replace(old, new), encoding="utf-8")
    done = run("report", "job", "--out", "out", cwd=tmp_path)
    assert done.returncode == 2
    assert told in done.stderr


def test_a_cloud_with_a_coordinate_that_is_no_number_is_refused_with_its_line(tmp_path: Path) -> None:
    shutil.copytree(EXAMPLE, tmp_path / "job")
    recording = tmp_path / "job" / "recording.csv"
    lines = recording.read_text(encoding="utf-8").splitlines()
    assert lines[0] == HEADER
    lines[20] = ",".join(["nan" if i == 9 else cell for i, cell in enumerate(lines[20].split(","))])
    recording.write_text("\n".join(lines) + "\n", encoding="utf-8")
    done = run("report", "job", "--out", "out", cwd=tmp_path)
    assert done.returncode == 2
    assert "line 21" in done.stderr
    assert "u_mm" in done.stderr


SIZES = np.array([300.0] * 3 + [500.0] * 3 + [0.1] * 3)
"""Of scales, squarenesses and offsets, by which a criterion compares them: ppm, ″, mm."""


@pytest.mark.long(but="D")
@pytest.mark.parametrize("criterion", ["D", "A"])
def test_a_plan_by_criterion_tells_offset_and_factors_from_fewer_bars(tmp_path: Path, criterion: str) -> None:
    """Twelve bars that are chosen beside the first twelve of the usual plan, each end in one of three attitudes."""
    job = tmp_path / "job"
    job.mkdir()
    toml = (ROOT / "examples" / "optical-ballbar-simulated" / "job.toml").read_text(encoding="utf-8")
    (job / "job.toml").write_text(
        f'{toml}\n[plan]\ncriterion = "{criterion}"\nnumber = 12\nrepeats = 1\nrivals = []\n', encoding="utf-8"
    )
    found = make_plan(read_job(job, recorded=False), power=False)
    assert found.better is not None
    chosen, first = found.better.points, found.start.points
    bars = ScannedBallbar(facts(), chosen)
    assert (len(bars.rows), len(bars.sizes)) == (12, 4)  # all of [U1 V1 W1] is told
    both = [tuple(ball.angles_deg for ball in bars.balls[i : i + 2]) for i in range(0, 24, 2)]
    assert all(one != other for one, other in both)
    variance = {}
    for name, points in (("chosen", chosen), ("first", first.select(first.measurement <= 12))):
        model = RecordingModel(ScannedBallbar(facts(), points), effects(SIX), 1e-3)
        own = model.estimate().least_squares.covariance[:, [0, 1, 2, 3, 4, 5, 7, 8, 9]][[0, 1, 2, 3, 4, 5, 7, 8, 9]]
        scaled = own / np.outer(SIZES, SIZES)
        variance[name] = {"D": np.linalg.det(scaled) ** (1 / 9), "A": np.trace(scaled) / 9}[criterion]
    assert variance["chosen"] < 0.9 * variance["first"]


def test_the_form_of_the_balls_is_in_u_and_without_it_no_tolerance_passes() -> None:
    """A shift of either ball's centre by its form changes a length by its part along the bar; U was the same of any form."""
    found = analysed("optical-ballbar-simulated")
    bar = cast("ScannedBallbar", found.artefact)
    (form,) = causes_of(bar, Circumstances())
    ends = bar.ends()
    along = (ends[:, 1] - ends[:, 0]) / np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)[:, None]
    each = [BallForm(5.08e-3).covariance(ball.directions)[:3, :3] for ball in bar.balls]
    both = [along[i] @ (each[2 * i] + each[2 * i + 1]) @ along[i] for i in range(len(along))]
    np.testing.assert_allclose(np.sum(form.common**2, axis=1), both, rtol=1e-9)
    without = observe(found.job.facts.artefact.model_copy(update={"ball_form_um": 0.0}), found.job.points)
    assert not causes_of(without, Circumstances())
    used, u = np.ones(len(along), dtype=bool), 1e-3
    assert [str(text) for text in taken_as_exact(without, used, along[:, 0], u)] == [
        "The form of the balls is not stated"
    ]
    assert not taken_as_exact(bar, used, along[:, 0], u)
