"""Two recordings of one plate: what changed between, and what it cannot be told from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.plate import Plate
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Points
from cmm_uq.jobs.recording.references import against_earlier
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


def test_only_plates_are_compared(tmp_path: Path) -> None:
    text = (ROOT / "examples" / "sphere-simulated" / "job.toml").read_text(encoding="utf-8")
    (tmp_path / "job.toml").write_text(text.replace("[recording]", '[recording]\nearlier = "e.csv"'), encoding="utf-8")
    with pytest.raises(CmmUqError, match="at two dates, which a job of kind 'sphere' has not"):
        read_job(tmp_path)
