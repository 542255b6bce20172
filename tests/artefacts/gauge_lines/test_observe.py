"""Step gauge and gauge blocks: faces at certified distances along lines."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.gauge_lines import GaugeBlocks, StepGauge
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Points
from tests.artefacts.constructions import GAUGE_FACES, SEVEN_LINES, estimated, free, indicated, step_gauge
from tests.recordings import with_columns

GAUGE = artefact_facts(kind="step_gauge", u_um=0.5)
SIX = ["scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx"]


def only(points: Points, measurement: int) -> Points:
    return points.select(points.measurement == measurement)


def test_a_gauge_along_x_reads_short_by_the_scale_error() -> None:
    """100 ppm: true = indicated · 1.0001, so 420 mm read 42 µm short; the points are shrunk by hand."""
    points = only(step_gauge(), 1)
    short = points.at(points.xyz / [1.0001, 1, 1])
    errors = StepGauge(GAUGE, short).indications()
    assert errors is not None
    np.testing.assert_allclose(errors.errors, GAUGE_FACES[1:] * (1 / 1.0001 - 1), atol=1e-12)
    found = estimated(GAUGE, short, ["scale_x"])
    assert found.value[0] == pytest.approx(100.0, abs=1e-7)


def test_the_scale_and_its_uncertainty_are_those_of_a_regression_line() -> None:
    """Second method: slope of position over certified distance by numpy's polyfit; u = σ/√Σ(r − r̄)²."""
    points = indicated(GAUGE, only(step_gauge(), 1), ["scale_x"], [80.0], sigma=1e-3, seed=3)
    slope = np.polyfit(GAUGE_FACES, points.xyz[:, 0], 1)[0]
    found = estimated(artefact_facts(kind="step_gauge"), points, ["scale_x"])
    assert found.value[0] == pytest.approx((1 / slope - 1) * 1e6, abs=1e-3)
    spread = np.sqrt(np.sum((GAUGE_FACES - GAUGE_FACES.mean()) ** 2))
    assert np.sqrt(found.covariance[0, 0]) == pytest.approx(1e-3 / spread * 1e6, rel=2e-4)


@pytest.mark.parametrize(
    ("extra", "values"),
    [
        (["rotation_x_z", "rotation_y_x", "straightness_x_y"], [400.0, -300.0, 300.0]),
        (["hysteresis_x", "hysteresis_y", "hysteresis_z"], [60.0, -35.0, 12.0]),
        (["thermal_scale_x", "thermal_artefact"], [2.5e-5, 1.2e-5]),
        (["drift_x", "drift_z"], [30.0, -20.0]),
    ],
)
def test_large_errors_of_every_kind_are_recovered_exactly(extra: list[str], values: list[float]) -> None:
    points = step_gauge(both_sides=True)
    n = len(points)
    points = with_columns(
        points, temp_x_c=20 + np.linspace(-4, 6, n), temp_artefact_c=20 + np.linspace(3, -2, n) ** 2 / 3,
        time_s=np.linspace(0, 9000, n),
    )  # fmt: skip
    names, truth = SIX + extra, [300.0, -200.0, 100.0, 173.0, -400.0, 50.0, *values]
    found = estimated(GAUGE, indicated(GAUGE, points, names, truth), names)
    scale = np.array([u.scale for u in found.unknowns])
    np.testing.assert_allclose((found.value - np.append(truth, 420.0)) / scale, 0, atol=1e-9)
    assert np.abs(found.residuals).max() < 1e-11


def test_one_line_along_x_tells_its_scale_and_nothing_of_the_rest() -> None:
    found = estimated(GAUGE, only(step_gauge(), 1), SIX)
    assert sorted(next(iter(c)) for c in free(found)) == sorted(SIX[1:])
    assert found.determined[0]


def test_seven_lines_determine_scales_and_squareness() -> None:
    assert free(estimated(GAUGE, step_gauge(), SIX)) == []


def test_nominal_distances_leave_one_scale_common_to_axes_and_gauge() -> None:
    """One ppm on every axis looks like a gauge longer by one ppm of 420 mm: exactly, whatever the machine's errors."""
    points = indicated(GAUGE, step_gauge(), SIX, [250.0, -90.0, 30.0, -173.0, -19.0, 210.0], size=420.05, sigma=1e-3)
    found = estimated(artefact_facts(kind="step_gauge", nominal=True), points, SIX)
    (combination,) = free(found)
    size = found.value[-1]
    assert combination == pytest.approx({"scale_x": 1, "scale_y": 1, "scale_z": 1, "artefact": size * 1e-6}, rel=1e-8)


def test_the_certificate_of_the_gauge_limits_the_scale() -> None:
    """u = 0.5 µm on 420 mm is 1.19 ppm common to every axis, however many faces are read."""
    found = estimated(GAUGE, step_gauge(both_sides=True), SIX, sigma=1e-9)
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)[:3]), 0.5 / 420e3 * 1e6, rtol=1e-3)


def test_an_uncertainty_may_belong_to_a_stated_length() -> None:
    """A number holds for every length: 1 µm at 1000 mm and on every length up to the 420 mm recorded."""
    gauge = StepGauge(artefact_facts(kind="step_gauge", length_mm=1000.0, u_um=1.0), step_gauge())
    errors = gauge.indications()
    assert errors is not None
    assert set(errors.u.tolist()) == {1e-3}
    assert errors.lengths.max() == 420.0
    assert len(np.unique(np.round(errors.lengths))) == 21


def test_a_warm_gauge_of_known_expansion_is_brought_to_20_degrees() -> None:
    """Steel, 11.5 ppm/K, at 24 °C is 46 ppm longer; the machine reads it so, and the errors at 20 °C vanish."""
    points = step_gauge(faces=GAUGE_FACES * (1 + 46e-6))
    points = with_columns(points, temp_artefact_c=np.full(len(points), 24.0), reference_mm=np.tile(GAUGE_FACES, 7))
    found = StepGauge(artefact_facts(kind="step_gauge", cte_per_k=11.5e-6), points).indications()
    assert found is not None
    assert np.abs(found.errors).max() < 1e-12


def test_backlash_shows_as_the_difference_of_either_side() -> None:
    """Sign rule e = ½·gap·approach: travelling along +x, x reads ½·gap short; outward minus inward is −gap."""
    points = indicated(GAUGE, only(step_gauge(both_sides=True), 1), ["hysteresis_x"], [8.0])
    found = StepGauge(GAUGE, points).reversals()
    assert found is not None
    np.testing.assert_allclose(found.gap, -8e-3, atol=1e-12)
    np.testing.assert_allclose(found.reference, GAUGE_FACES)
    np.testing.assert_allclose(np.abs(found.weights), 1.0)  # each side was reached once


def test_where_on_a_face_the_probe_touches_does_not_matter() -> None:
    """Inner faces met up to 3 mm beside the line: their distance along it is what counts."""
    points = only(step_gauge(), 1)
    aside = np.zeros((len(points), 3))
    aside[1:-1, 1:] = np.random.default_rng(5).uniform(-3, 3, (len(points) - 2, 2))
    errors = StepGauge(GAUGE, points.at(points.xyz + aside)).indications()
    assert errors is not None
    assert np.abs(errors.errors).max() < 1e-12


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000))
def test_where_the_gauge_stands_along_its_line_does_not_matter(seed: int) -> None:
    points = step_gauge()
    u = np.repeat([np.array(line) / np.linalg.norm(line) for line in SEVEN_LINES], len(GAUGE_FACES), axis=0)
    shift = np.repeat(np.random.default_rng(seed).uniform(-20, 20, 7), len(GAUGE_FACES))
    gauge = StepGauge(GAUGE, points.at(points.xyz + shift[:, None] * u))
    assert np.abs(gauge.deviations()).max() < 1e-11


def test_intervals_cover_the_truth_as_often_as_they_say() -> None:
    """200 simulated recordings: squared distance from the truth over the covariance is χ² with six degrees of freedom."""
    truth, inside = [100.0, -60.0, 20.0, 30.0, -12.0, 5.0], 0
    exact = artefact_facts(kind="step_gauge")
    points = step_gauge(faces=np.linspace(0, 420, 5))
    for seed in range(200):
        found = estimated(exact, indicated(exact, points, SIX, truth, sigma=1e-3, seed=seed), SIX)
        off = found.value[:6] - truth
        inside += off @ np.linalg.solve(found.covariance[:6, :6], off) < 12.592  # χ²(6), 95 %
    assert 180 <= inside <= 198  # binomial(200, 0.95): outside with probability 0.3 %


def test_gauge_blocks_are_a_gauge_of_two_faces() -> None:
    points = step_gauge(faces=np.array([0.0, 300.0]))
    blocks = GaugeBlocks(artefact_facts(kind="gauge_blocks", u_um=0.2), points)
    found = blocks.indications()
    assert found is not None
    assert len(found.errors) == 7
    assert blocks.sizes[0].title == "Length of the gauge blocks"


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda p: with_columns(p, reference_mm=p.columns["reference_mm"] + 5.0), "distances count from point 1"),
        (lambda p: with_columns(p, reference_mm=np.where(p.measurement == 2, 0.0, p.columns["reference_mm"])),
         "measurement 2 has a single face"),
        (lambda p: p.at(p.xyz / 25.4), "look like inches"),
        (lambda p: p.at(p.xyz * 1.05), "they differ by 50 mm/m"),
        (lambda p: p.at(np.where(p.measurement[:, None] == 3, 1.0, p.xyz)), "of measurement 3 lie in one place"),
        (lambda p: Points(p.xyz, p.measurement, p.point, p.repeat, p.machine), "no column 'reference_mm'"),
    ],
)  # fmt: skip
def test_a_recording_that_is_none_of_a_gauge_is_refused(spoil: object, message: str) -> None:
    assert callable(spoil)
    with pytest.raises(CmmUqError, match=message):
        StepGauge(GAUGE, spoil(step_gauge()))
