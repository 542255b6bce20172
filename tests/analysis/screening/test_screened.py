"""What is odd in a recording is found, said, and not found where it is not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.analysis.screening.screening import gross_outliers, impossible_values, repeated_figures, screen
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts.ballbar.observe import Ballbar
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Points
from cmm_uq.machine.model import MeasurementModel
from cmm_uq.machine.physics.catalogue import effects
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


def noisy(points: Points, seed: int, *, offset: float = 0.0) -> tuple[list[int], MeasurementModel]:
    """Outliers among lengths with 1 µm noise a coordinate, one bar moved by an offset along itself."""
    xyz = points.xyz + 1e-3 * np.random.default_rng(seed).standard_normal(points.xyz.shape)
    bar = points.xyz[11] - points.xyz[10]
    xyz[11] += offset * bar / np.linalg.norm(bar)
    artefact = Ballbar(bar_facts(), points.at(xyz))
    model = MeasurementModel(artefact, effects(["scale_x", "scale_y", "scale_z", "squareness_xy"]))
    found = gross_outliers(model.estimate().linear, artefact.measurement)
    return [index for index, _ in found], model


def test_a_gross_outlier_is_found_and_only_it(ballbar_points: Points) -> None:
    assert noisy(ballbar_points, 1, offset=0.05)[0] == [5]


def test_false_outliers_are_as_rare_as_their_probability(ballbar_points: Points) -> None:
    """One in a thousand recordings by design: more than six in a thousand happens once in 10⁴ such studies."""
    assert sum(bool(noisy(ballbar_points, seed)[0]) for seed in range(1000)) <= 6


def test_a_recording_without_any_noise_has_no_outliers(ballbar_points: Points) -> None:
    model = MeasurementModel(Ballbar(bar_facts(), ballbar_points), effects(["scale_x"]))
    linear = model.estimate().linear
    quiet = replace(linear, observed=linear.design @ np.array([3.0, 400.0]))
    assert len(gross_outliers(quiet, model.artefact.measurement)) <= 4
