"""Two recordings of one plate: what changed between, and what it cannot be told from."""

from __future__ import annotations

import datetime as dt
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import cmm_uq
from cmm_uq.analysis.screening.columns import Finding
from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.plate import Plate
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Points
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.recording.compared import against_earlier
from cmm_uq.machine.model import RecordingModel
from tests.artefacts.constructions import estimated, free, indicated, plate
from tests.conftest import ROOT
from tests.recordings import with_columns

EXACT = artefact_facts(kind="plate")
EFFECTS = ["scale_x", "scale_y", "squareness_xy", "straightness_x_y"]
THEN, NOW = [60.0, -40.0, 90.0, 70.0], [75.0, -46.0, 81.0, 70.0]
CHANGE = [15.0, -6.0, -9.0, 0.0]


def uncertain_plate() -> Points:
    """Balls up to 20 µm from where their nominal positions say, as nobody knows."""
    points, random = plate(), np.random.default_rng(9)
    astray = np.tile(random.uniform(-0.02, 0.02, (25, 3)), (4, 1))
    return with_columns(
        points.at(indicated(EXACT, _moved(points, astray), [], []).xyz),
        **{f"reference_{a}_mm": points.columns[f"reference_{a}_mm"] + astray[:, i] for i, a in enumerate("xyz")},
    )  # fmt: skip


def _moved(points: Points, astray: np.ndarray[tuple[int, int], np.dtype[np.float64]]) -> Points:
    columns = {f"reference_{a}_mm": points.columns[f"reference_{a}_mm"] + astray[:, i] for i, a in enumerate("xyz")}
    return with_columns(points, **columns)


def nominal(points: Points) -> Points:
    """Without any reference positions, as the lab records it."""
    return Points(points.xyz, points.measurement, points.point, points.repeat, points.machine, {}, points.lines)


def repeated(points: Points, count: int) -> Points:
    return Points(
        np.tile(points.xyz, (count, 1)), np.tile(points.measurement, count), np.tile(points.point, count),
        np.repeat(np.arange(1, count + 1), len(points)), points.machine, {}, np.tile(points.lines, count),
    )  # fmt: skip


def test_the_change_is_found_although_plate_and_machine_are_not_known() -> None:
    """Balls 20 µm astray and 70 µm of bow cancel; second order of the errors themselves leaves less than a hundredth."""
    points = uncertain_plate()
    then = nominal(indicated(EXACT, points, EFFECTS, THEN))
    now = nominal(indicated(EXACT, points, EFFECTS, NOW))
    found = estimated(EXACT, against_earlier(now, then, 0.0, "now.csv"), EFFECTS)
    np.testing.assert_allclose(found.value[:4], CHANGE, atol=0.02)
    assert np.abs(found.residuals).max() < 2e-5


def test_both_recordings_bring_their_noise() -> None:
    """One reading then and four now: u grows by √(1/1 + 1/4) over that of a single perfect reference."""
    points = nominal(plate())
    both = against_earlier(repeated(points, 4), points, 0.0, "now.csv")
    np.testing.assert_allclose(Plate(EXACT, both).noise_scale, np.sqrt(1.25))
    alone = estimated(EXACT, plate(), EFFECTS)
    compared = estimated(EXACT, both, EFFECTS)
    np.testing.assert_allclose(np.diag(compared.covariance)[:4], 1.25 * np.diag(alone.covariance)[:4], rtol=1e-6)


@pytest.mark.long
def test_intervals_cover_the_change_as_often_as_they_say() -> None:
    points, inside = uncertain_plate(), 0
    for seed in range(100):
        then, now = (
            nominal(indicated(EXACT, points, EFFECTS, truth, sigma=1e-3, seed=seed + offset))
            for truth, offset in ((THEN, 0), (NOW, 1000))
        )
        found = estimated(EXACT, against_earlier(now, then, 0.0, "now.csv"), EFFECTS)
        off = found.value[:4] - CHANGE
        inside += off @ np.linalg.solve(found.covariance[:4, :4], off) < 9.488  # χ²(4), 95 %
    assert inside >= 87  # binomial(100, 0.95): fewer with probability 0.15 %


def test_a_warmer_plate_cannot_be_told_from_a_change_of_all_scales() -> None:
    """One kelvin more on the second date: 10⁻⁶/K of the plate is −1 ppm of every axis, exactly."""
    points = nominal(plate())
    warm = with_columns(points, temp_artefact_c=np.full(len(points), 21.0))
    names = ["scale_x", "scale_y", "scale_z", "thermal_artefact"]
    (combination,) = free(estimated(EXACT, against_earlier(warm, points, 0.0, "now.csv"), names))
    part = combination["scale_x"] / combination["thermal_artefact"] * 1e-6
    assert part == pytest.approx(-1.0, rel=1e-4) or part == pytest.approx(1.0, rel=1e-4)
    assert combination["scale_x"] == pytest.approx(combination["scale_y"], rel=1e-6)


def test_recorded_temperatures_of_both_dates_are_accounted_for() -> None:
    """Steel at 22 °C then and 19 °C now: both brought to 20 °C, nothing has changed."""
    cte = 11.5e-6
    cold = nominal(plate())
    then = with_columns(nominal(plate(pitch=100 * (1 + 2 * cte))), temp_artefact_c=np.full(100, 22.0))
    now = with_columns(nominal(plate(pitch=100 * (1 - cte))), temp_artefact_c=np.full(100, 19.0))
    steel = artefact_facts(kind="plate", cte_per_k=cte)
    assert np.abs(Plate(steel, against_earlier(now, then, cte, "now.csv")).deviations()).max() < 1e-11
    assert np.abs(Plate(steel, against_earlier(cold, cold, cte, "now.csv")).deviations()).max() < 1e-11


def test_a_ball_that_was_not_there_is_named() -> None:
    points = nominal(plate())
    earlier = points.select((points.measurement != 2) | (points.point != 7))
    with pytest.raises(CmmUqError, match=r"now.csv line \d+: measurement 2, point 7 is not in the earlier recording"):
        against_earlier(points, earlier, 0.0, "now.csv")


def test_a_job_names_the_earlier_recording_and_carries_it_along() -> None:
    job = read_job(ROOT / "examples" / "plate-two-dates-simulated")
    assert set(job.inputs) == {"job.toml", "recording.csv", "earlier.csv"}
    np.testing.assert_allclose(job.points.columns["noise_ratio"], np.sqrt(2.0))


def test_an_earlier_date_that_lies_after_and_a_copy_are_refused(tmp_path: Path) -> None:
    """Either would be a change of the machine with the wrong sign, or none with a U of nanometres."""
    job = tmp_path / "job"
    shutil.copytree(ROOT / "examples" / "plate-two-dates-simulated", job)
    text = (job / "job.toml").read_text("utf-8")
    (job / "job.toml").write_text(text.replace("earlier_date = 2025-01-01", "earlier_date = 2026-01-02"), "utf-8")
    with pytest.raises(CmmUqError, match="2026-01-02 lies after the recording's date, 2026-01-01"):
        read_job(job)
    (job / "job.toml").write_text(text, "utf-8")
    head, *rows = (job / "recording.csv").read_text("utf-8").splitlines()
    (job / "earlier.csv").write_text("\n".join([head, *reversed(rows)]) + "\n", "utf-8")
    with pytest.raises(CmmUqError, match=r"earlier: is the recording itself to the last digit"):
        read_job(job)
    other = rows[0].split(",")
    other[-1] = f"{float(other[-1]) + 1e-5:.6f}"
    (job / "earlier.csv").write_text("\n".join([head, *rows[1:], ",".join(other)]) + "\n", "utf-8")
    assert len(read_job(job).points)


def test_only_plates_are_compared(tmp_path: Path) -> None:
    text = (ROOT / "examples" / "sphere-simulated" / "job.toml").read_text(encoding="utf-8")
    (tmp_path / "job.toml").write_text(text.replace("[recording]", '[recording]\nearlier = "e.csv"'), encoding="utf-8")
    with pytest.raises(CmmUqError, match="at two dates, which a job of kind 'sphere' has not"):
        read_job(tmp_path)


GRID = np.array([[i, j, 0.0] for j in range(5) for i in range(5)]) * 90.0
MACHINE = {"name": "M", "travel_mm": {"x": [0, 900], "y": [0, 600], "z": [-500, 10]}}
SCALES_AND_SQUARENESS = ["scale_x", "scale_y", "squareness_xy"]
SECOND = np.pi / 648000


def flat(seed: int, *, still: bool = True, turned: bool = False) -> pd.DataFrame:
    """Twenty-five balls in two places on the table, noise of 2 µm; z read as 0, or with its noise."""
    random, frames = np.random.default_rng(seed), []
    for number, place in enumerate(([100, 60, 0], [400, 150, 0]), 1):
        body = GRID[:, [1, 0, 2]] if turned and number == 2 else GRID
        xyz = body + place + 2e-3 * random.standard_normal(GRID.shape)
        if still:
            xyz[:, 2] = 0
        told = {f"{a}_mm": xyz[:, i] for i, a in enumerate("xyz")}
        frames.append(pd.DataFrame({"measurement": number, "point": np.arange(1, 26), **told}))
    return pd.concat(frames, ignore_index=True)


def referenced(points: pd.DataFrame) -> pd.DataFrame:
    """With the nominal positions beside them."""
    return points.assign(**{f"reference_{a}_mm": np.tile(GRID[:, i], 2) for i, a in enumerate("xyz")})


def model_of(job: Job) -> tuple[RecordingModel, tuple[Finding, ...]]:
    return screened_model(job)


def plate_job(points: pd.DataFrame, **recording: object) -> Job:
    artefact = {"kind": "plate"} if "earlier" in recording else {"kind": "plate", "u_um": 0.0}
    files = {"earlier.csv": recording.pop("frame")} if "earlier" in recording else {}
    return cmm_uq.job(
        points, machine=MACHINE, artefact=artefact, effects=SCALES_AND_SQUARENESS, recording=recording, files=files
    )


def in_the_plane(difference: Floats, at: Floats, number: Floats) -> tuple[Floats, Floats, float, int]:
    """Least squares of differences (n, 2) at places (n, 2), written out: two shifts and a turn of each placing, three factors.

    Returns the factors, their standard uncertainties, the standard deviation of a residual, and the degrees of freedom.
    """
    columns = []
    for each in np.unique(number):
        own = (number == each).astype(float)
        columns += [
            np.column_stack([own, 0 * own]),
            np.column_stack([0 * own, own]),
            own[:, None] * at[:, ::-1] * [-1, 1],
        ]
    nothing = np.zeros(len(at))
    factors = [np.column_stack([-1e-6 * at[:, 0], nothing]), np.column_stack([nothing, -1e-6 * at[:, 1]]),
               np.column_stack([SECOND * at[:, 1], nothing])]  # fmt: skip
    A = np.column_stack([column.ravel() for column in (*factors, *columns)])
    found, rest, rank, _ = np.linalg.lstsq(A, difference.ravel(), rcond=None)
    dof = A.shape[0] - int(rank)
    sd = float(np.sqrt(rest[0] / dof))
    return found[:3], sd * np.sqrt(np.diag(np.linalg.inv(A.T @ A)))[:3], sd, dof


def test_a_plate_on_two_axes_has_the_least_squares_of_two_coordinates() -> None:
    points = flat(1)
    model, _ = model_of(plate_job(referenced(points)))
    found = model.estimate().least_squares
    indicated = points[["x_mm", "y_mm"]].to_numpy()
    value, u, sd, dof = in_the_plane(indicated - np.tile(GRID[:, :2], (2, 1)), indicated, points.measurement.to_numpy())
    assert found.degrees_of_freedom == dof == 2 * 50 - 2 * 3 - 3
    assert found.sigma == pytest.approx(sd, rel=1e-3)
    assert np.sqrt(np.diag(found.covariance))[:3] == pytest.approx(u, rel=1e-3)
    assert found.value[:3] == pytest.approx(value, abs=0.01 * u.min())


@pytest.mark.parametrize(
    ("now", "then", "tilts", "within"), [(True, True, 0, 1e-3), (False, True, 0, 1e-3), (True, False, 4, 0.1)]
)
def test_what_was_not_read_on_one_of_two_dates_is_no_difference(
    now: bool, then: bool, tilts: int, within: float
) -> None:
    """Where z was read earlier alone, its noise is the shape of the plate, and two tilts of each placing move it a little."""
    later, earlier = flat(1, still=now), flat(2, still=then)
    job = plate_job(later, earlier="earlier.csv", earlier_date=dt.date(2025, 1, 1), frame=earlier)
    model, findings = model_of(job)
    assert [(f.measurements, f.column) for f in findings] == [((m,), "z_mm" if now else None) for m in (1, 2)]
    found = model.estimate().least_squares
    a, b = (frame[["x_mm", "y_mm"]].to_numpy() for frame in (later, earlier))
    _, u, sd, dof = in_the_plane(a - b, a, later.measurement.to_numpy())
    assert found.degrees_of_freedom == dof - tilts
    assert found.sigma == pytest.approx(sd / 2**0.5, rel=within)
    assert np.sqrt(np.diag(found.covariance))[:3] == pytest.approx(u, rel=within)


def test_a_plate_on_three_axes_has_three_coordinates() -> None:
    model, findings = model_of(plate_job(referenced(flat(1, still=False))))
    assert model.estimate().least_squares.degrees_of_freedom == 3 * 50 - 2 * 6 - 3
    assert not model.artefact.unread().any()
    assert not findings


def test_the_unread_axis_is_found_however_the_plate_lies() -> None:
    """Upright along X the plate's own z lies along the machine's y; with one plate tilted only the other loses an axis."""
    points = referenced(flat(3, turned=True))
    upright = points.assign(y_mm=points.z_mm + 300, z_mm=points.y_mm - 480)
    model, _ = model_of(plate_job(upright))
    assert model.artefact.unread().reshape(-1, 3).tolist() == [[False, False, True]] * 50
    tilted = points.assign(z_mm=np.where(points.measurement == 2, 0.1 * points.x_mm - 80, 0.0))
    tilted.loc[tilted.measurement == 2, "x_mm"] *= np.sqrt(1 - 0.1**2)
    artefact = model_of(plate_job(tilted))[0].artefact
    assert artefact.unread().reshape(-1, 3).any(axis=1).tolist() == [True] * 25 + [False] * 25


def test_the_coordinate_is_named_with_its_measurement() -> None:
    _, findings = model_of(plate_job(referenced(flat(1))))
    assert [(f.kind, f.column, f.measurements, f.set_aside) for f in findings] == [
        ("stuck", "z_mm", (1,), True), ("stuck", "z_mm", (2,), True)
    ]  # fmt: skip
    assert findings[0].why == "in all of measurement 1 z_mm is 0: nobody read it, and it says nothing"


def plane_job(*heights: Floats | float) -> Job:
    x, y = (each.ravel() for each in np.meshgrid(np.linspace(50, 800, 7), np.linspace(50, 500, 5)))
    frames = [
        pd.DataFrame({"measurement": number, "point": np.arange(1, 36), "x_mm": x, "y_mm": y, "z_mm": z})
        for number, z in enumerate(heights, 1)
    ]
    return cmm_uq.job(pd.concat(frames), machine=MACHINE, artefact={"kind": "plane"}, effects=["straightness_x_z"])


def test_a_plane_that_nobody_read_is_refused_and_makes_no_other_look_better() -> None:
    read = -200 + 1e-3 * np.random.default_rng(4).standard_normal(35)
    with pytest.raises(cmm_uq.CmmUqError, match="no observation is left"):
        model_of(plane_job(-300.0))
    both, alone = (model_of(job)[0].estimate().least_squares for job in (plane_job(-300.0, read), plane_job(read)))
    assert both.degrees_of_freedom == alone.degrees_of_freedom == 35 - 3 - 1
    assert both.sigma == pytest.approx(alone.sigma, rel=1e-9)
