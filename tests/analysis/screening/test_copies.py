"""Copies of measurements count once: in the estimates, and in what is known of the noise."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import cmm_uq
from cmm_uq.analysis.screening.screening import copied_measurements, counted_with
from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.base.points import Points
from cmm_uq.jobs.job import Job
from cmm_uq.maths.inference.least_squares import LeastSquares

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
