"""What is odd in a recording is found, said, and not found where it is not.

Copies of measurements count once: in the estimates, and in what is known of the noise.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import cmm_uq
from cmm_uq.analysis.screening.screening import (
    copied_measurements,
    counted_with,
    gross_outliers,
    impossible_values,
    repeated_figures,
    screen,
)
from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Points
from cmm_uq.jobs.job import Job
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.maths.inference.linear_model import LeastSquares
from tests.recordings import bar_facts, with_columns


def test_position_18_of_the_thesis_repeats_position_14(iota: Path) -> None:
    """Figures C 1 to C 4 of Harris 2004 print the same coordinates, radii and numbers of points for both."""
    (found,) = repeated_figures(read_job(iota).points)
    assert found.kind == "duplicate"
    assert found.measurements == (14, 18)
    assert found.lines == (28, 29, 36, 37)


def test_a_copy_with_its_ends_exchanged_is_found_too(ballbar_points: Points) -> None:
    xyz = ballbar_points.xyz.copy()
    xyz[[11, 10]] = xyz[[2, 3]]
    (found,) = repeated_figures(ballbar_points.at(xyz))
    assert found.measurements == (2, 6)


def test_a_repeat_of_the_same_measurement_is_no_copy(ballbar_points: Points) -> None:
    xyz, number, repeat = ballbar_points.xyz.copy(), ballbar_points.measurement.copy(), ballbar_points.repeat.copy()
    xyz[2:4], number[2:4], repeat[2:4] = xyz[:2], number[:2], 2
    assert not repeated_figures(replace(ballbar_points, xyz=xyz, measurement=number, repeat=repeat))


@pytest.mark.parametrize(
    ("column", "value", "kind", "why"),
    [
        ("radius_mm", -38.1, "impossible", "a radius is positive"),
        ("humidity_pct", 140.0, "impossible", "between 0 and 100"),
        ("pressure_hpa", 101325.0, "unit", "It looks like Pa"),
        ("pressure_hpa", 101.325, "unit", "It looks like kPa"),
        ("temp_x_c", 293.15, "unit", "It looks like kelvin"),
        ("temp_artefact_c", 68.0, "unit", "It looks like °F"),
        ("temp_air_c", 2e6, "impossible", "is it in °C"),
        ("n_points", 0.0, "impossible", "needs points"),
    ],
)
def test_impossible_values_are_named_with_their_lines(
    ballbar_points: Points, column: str, value: float, kind: str, why: str
) -> None:
    values = np.full(len(ballbar_points), {"pressure_hpa": 1000.0}.get(column, 20.0))
    values[6] = value
    (found,) = impossible_values(with_columns(ballbar_points, **{column: values}))
    assert found.kind == kind
    assert found.lines == (8,)
    assert found.measurements == (4,)
    assert why in found.why


def test_readings_beyond_the_travel_are_impossible(ballbar_points: Points) -> None:
    xyz = ballbar_points.xyz.copy()
    xyz[3, 2] = 20.0
    (found,) = impossible_values(ballbar_points.at(xyz))
    assert "scale readings of Z" in found.why


def test_normals_have_unit_length(ballbar_points: Points) -> None:
    n = len(ballbar_points)
    bent = with_columns(ballbar_points, nx=np.ones(n), ny=np.ones(n), nz=np.zeros(n))
    assert "no unit length" in impossible_values(bent)[0].why


def test_an_impossible_value_that_the_model_needs_is_an_error(ballbar_points: Points) -> None:
    hot = with_columns(ballbar_points, temp_x_c=np.full(len(ballbar_points), 293.0))
    with pytest.raises(CmmUqError, match=r"bar.csv line 2, column temp_x_c"):
        screen(hot, needed={"temp_x_c"}, set_aside=[], where="bar.csv")


def noisy(points: Points, seed: int, *, offset: float = 0.0) -> tuple[list[int], RecordingModel]:
    """Outliers among lengths with 1 µm noise a coordinate, one bar moved by an offset along itself."""
    xyz = points.xyz + 1e-3 * np.random.default_rng(seed).standard_normal(points.xyz.shape)
    bar = points.xyz[11] - points.xyz[10]
    xyz[11] += offset * bar / np.linalg.norm(bar)
    artefact = Ballbar(bar_facts(), points.at(xyz))
    model = RecordingModel(artefact, effects(["scale_x", "scale_y", "scale_z", "squareness_xy"]))
    found = gross_outliers(model.estimate().linear, artefact.measurement)
    return [index for index, _ in found], model


def test_a_gross_outlier_is_found_and_only_it(ballbar_points: Points) -> None:
    assert noisy(ballbar_points, 1, offset=0.05)[0] == [5]


@pytest.mark.long
def test_false_outliers_are_as_rare_as_their_probability(ballbar_points: Points) -> None:
    """One in a thousand recordings by design: more than six in a thousand happens once in 10⁴ such studies."""
    assert sum(bool(noisy(ballbar_points, seed)[0]) for seed in range(1000)) <= 6


def test_a_recording_without_any_noise_has_no_outliers(ballbar_points: Points) -> None:
    model = RecordingModel(Ballbar(bar_facts(), ballbar_points), effects(["scale_x"]))
    linear = model.estimate().linear
    quiet = replace(linear, observed=linear.design @ np.array([3.0, 400.0]))
    assert len(gross_outliers(quiet, model.artefact.measurement)) <= 4


GRID = np.array([[i, j, 0.0] for j in range(5) for i in range(5)]) * 90.0


def plate(seed: int, *measurements: int) -> pd.DataFrame:
    """A flat plate with noise of 1 µm, once under each number."""
    random = np.random.default_rng(seed)
    frames = []
    for number in measurements:
        xyz = np.round(GRID + [100, 80, -300] + 1e-3 * random.standard_normal(GRID.shape), 6)
        told = {f"{a}_mm": xyz[:, i] for i, a in enumerate("xyz")}
        told |= {f"reference_{a}_mm": GRID[:, i] for i, a in enumerate("xyz")}
        frames.append(pd.DataFrame({"measurement": number, "point": np.arange(1, 26), **told}))
    return pd.concat(frames)


def job_of(points: pd.DataFrame, *, aside: tuple[int, ...] = ()) -> Job:
    effects = ["scale_x", "scale_y", "squareness_xy"]
    return cmm_uq.job(points, machine="M", artefact={"kind": "plate", "u_um": 0.3}, effects=effects,
                      recording={"set_aside": list(aside)})  # fmt: skip


def fitted(job: Job) -> LeastSquares:
    model, _ = screened_model(job)
    return model.estimate().least_squares


def test_a_copied_plate_leaves_every_estimate_and_its_uncertainty_as_they_are() -> None:
    """One plate measured again would make u smaller by √2; copied, it says nothing new, whichever number it has."""
    once = plate(1, 2)
    copied = pd.concat([once, once.assign(measurement=7)])
    alone, both = fitted(job_of(once)), fitted(job_of(copied))
    assert both.value == pytest.approx(alone.value, abs=1e-6)
    assert both.covariance == pytest.approx(alone.covariance, rel=1e-6)
    assert both.degrees_of_freedom == alone.degrees_of_freedom == 75 - 6 - 3
    again = fitted(job_of(pd.concat([once, plate(5, 7)])))
    own = [i for i, unknown in enumerate(alone.unknowns) if unknown.key[0] == "squareness_xy"]
    ratio = np.sqrt(np.diag(again.covariance) / np.diag(alone.covariance))[own] * alone.sigma / again.sigma
    assert ratio == pytest.approx(2**-0.5, rel=1e-3)


def test_three_of_one_count_once_and_rows_may_stand_in_any_order() -> None:
    once = plate(1, 2)
    copied = pd.concat([once, once.assign(measurement=7), once.assign(measurement=9)])
    shuffled = copied.sample(frac=1, random_state=3)
    assert fitted(job_of(shuffled)).covariance == pytest.approx(fitted(job_of(once)).covariance, rel=1e-6)


def test_the_copy_of_what_the_job_leaves_out_counts() -> None:
    once = plate(1, 2)
    copied = pd.concat([once, once.assign(measurement=7)])
    assert fitted(job_of(copied, aside=(2,))).value == pytest.approx(fitted(job_of(once)).value, abs=1e-6)
    with pytest.raises(cmm_uq.CmmUqError, match="no observation is left"):
        fitted(job_of(copied, aside=(2, 7)))


def test_the_finding_says_that_a_copy_counts_once() -> None:
    once = plate(1, 2)
    _, (found,) = screened_model(job_of(pd.concat([once.assign(measurement=7), once])))
    assert (found.kind, found.measurements, found.set_aside) == ("duplicate", (2, 7), True)
    assert found.why.endswith("a copy, not a measurement, and counts once")


def test_points_count_with_the_original_of_their_group(iota: Path) -> None:
    points = cmm_uq.read(iota).points
    (later,), (original,) = (np.unique(points.group[points.measurement == number]) for number in (18, 14))
    assert copied_measurements(points) == {later: original}
    counts = counted_with(points)
    assert set(points.measurement[counts[points.measurement == 18]]) == {14}
    assert np.array_equal(points.group[counts[points.measurement != 18]], points.group[points.measurement != 18])
    assert np.array_equal(points.group[counted_with(points, [14])], points.group)


def test_a_repeat_that_reads_the_same_is_no_copy_of_a_measurement(ballbar_points: Points) -> None:
    xyz, number, repeat = ballbar_points.xyz.copy(), ballbar_points.measurement.copy(), ballbar_points.repeat.copy()
    xyz[2:4], number[2:4], repeat[2:4] = xyz[:2], number[:2], 2
    points = replace(ballbar_points, xyz=xyz, measurement=number, repeat=repeat)
    assert points.copies == {1: 0}
    assert not copied_measurements(points)


def test_a_copy_is_found_whatever_the_sign_of_its_zeros_and_one_end_in_common_is_none(ballbar_points: Points) -> None:
    xyz = ballbar_points.xyz.copy()
    xyz[:2, 2] = 0.0
    xyz[4:6] = xyz[1::-1]  # the ends in the other order
    xyz[4:6, 2] = -0.0
    xyz[8] = xyz[0]
    assert replace(ballbar_points, xyz=xyz).copies == {2: 0}
