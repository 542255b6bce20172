"""Step gauge and gauge blocks: faces at certified distances along lines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.gauge_lines import GaugeBlocks, StepGauge
from cmm_uq.artefacts.gauge_lines_page import lines_of, periodic_part
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Machine, Points
from cmm_uq.certificate.document import Paragraph, Plot
from tests.artefacts.constructions import GAUGE_FACES, SEVEN_LINES, estimated, free, indicated, step_gauge
from tests.artefacts.simulated import SCALE, SQUARE, analysed, blocks, recovered, table
from tests.conftest import ROOT
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


@pytest.mark.long
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


@pytest.mark.parametrize(("second", "both"), [(-1.0, True), (1.0, False), (0.0, True)])
def test_a_block_that_the_recording_met_from_one_side_is_not_bidirectional(second: float, both: bool) -> None:
    """Blocks are, without approach columns too; one that is wrung to a plate is met from one side."""
    xyz, one, zero = np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0]]), np.ones(2, dtype=np.int64), np.zeros(2)
    columns = {"reference_mm": xyz[:, 0], "approach_x": np.array([1.0, second]), "approach_y": zero, "approach_z": zero}
    for named, expected in ((columns, both), ({"reference_mm": xyz[:, 0]}, True)):
        points = Points(xyz, one, np.array([1, 2]), one, Machine(), named)
        found = GaugeBlocks(artefact_facts(kind="gauge_blocks", u_um=0.2), points)
        assert found.bidirectional(np.array([[0, 1]])).tolist() == [expected]


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


def test_faces_may_be_numbered_from_0() -> None:
    points = step_gauge()
    other = Points(points.xyz, points.measurement, points.point - 1, points.repeat, points.machine, points.columns)
    np.testing.assert_array_equal(StepGauge(GAUGE, other).reference, StepGauge(GAUGE, points).reference)
    with pytest.raises(CmmUqError, match="distances count from point 0"):
        StepGauge(GAUGE, with_columns(other, reference_mm=other.columns["reference_mm"] + 5.0))


def test_a_machine_whose_travel_nobody_states_has_no_fault_that_needs_it() -> None:
    """Curved scales of the gauge itself are those of the machine over its travel."""
    points = step_gauge()
    bare = replace(points, machine=replace(points.machine, travel_mm=np.full((3, 2), np.nan)))
    faults, every = (StepGauge(GAUGE, one).faults.keys() for one in (bare, points))
    assert every - faults == {f"artefact_scale_curvature_{axis}" for axis in "xyz"}
    assert faults <= every


NOMINAL = artefact_facts(kind="step_gauge")


def test_a_periodic_error_is_found_with_its_period_and_amplitude() -> None:
    """2 µm with a period of 70 mm on faces every 20 mm, beside a slope and scatter of 0.3 µm."""
    x = np.arange(0.0, 821.0, 20.0)
    wave = 2e-3 * np.sin(2 * np.pi * x / 70 + 1) + 5e-6 * x + 3e-4 * np.random.default_rng(2).standard_normal(len(x))
    found = periodic_part(x, wave)
    assert found is not None
    assert found.period == pytest.approx(70, rel=0.02)
    assert found.amplitude == pytest.approx(2e-3, rel=0.15)
    assert found.p_value < 1e-6


def test_scatter_alone_is_called_periodic_as_rarely_as_stated() -> None:
    """1000 lines of pure scatter: one in a hundred is called periodic; 23 or more would be, with probability 0.02 %."""
    random, x = np.random.default_rng(11), np.arange(0.0, 421.0, 20.0)
    assert sum(periodic_part(x, random.standard_normal(len(x))) is not None for _ in range(1000)) < 23


def test_few_faces_and_perfect_lines_have_no_period() -> None:
    x = np.arange(0.0, 421.0, 20.0)
    assert periodic_part(x[:7], np.sin(x[:7])) is None
    assert periodic_part(x, np.zeros(len(x))) is None


def test_each_line_has_slope_linearity_and_backlash() -> None:
    points = indicated(NOMINAL, step_gauge(both_sides=True), ["scale_x", "hysteresis_y"], [100.0, 6.0])
    lines = {line.measurement: line for line in lines_of(StepGauge(NOMINAL, points))}
    assert lines[1].scale_ppm == pytest.approx(-100, abs=0.02)
    assert lines[1].gap == pytest.approx(0.0, abs=1e-12)
    assert lines[2].scale_ppm == pytest.approx(0, abs=1e-6)
    assert lines[2].gap == pytest.approx(-6e-3)
    assert np.linalg.norm(lines[2].gap_weights) == pytest.approx(np.sqrt(2 / 22))
    assert lines[1].linearity < 1e-9
    assert (lines[4].length, lines[4].faces) == (420.0, 22)


JOB = "step-gauge-simulated"


def test_the_errors_put_into_the_example_are_found() -> None:
    recovered(JOB, {**SCALE, **SQUARE, "hysteresis_x": 1.8, "hysteresis_y": -0.9, "hysteresis_z": 1.2})
    recovered("gauge-blocks-simulated", {"scale_x": 9.0, "scale_y": -6.0, "probe_radius": 0.7})


def test_each_line_has_its_slope_by_a_regression_of_the_recording() -> None:
    """numpy's polyfit of the distance along X over the certified one, straight from the file: line 5 lies along X."""
    rows = np.genfromtxt(ROOT / "examples" / JOB / "recording.csv", delimiter=",", names=True)
    line = rows[rows["measurement"] == 5]
    slope = np.polyfit(line["reference_mm"], line["x_mm"], 1)[0] - 1
    printed = {row[0]: row for row in table(JOB, "Each line by itself, at 20 °C").rows}
    assert printed["5"][1] == "parallel to X"
    assert float(printed["5"][4].replace("−", "-")) == round(slope * 1e6, 1)
    assert [printed[n][1] for n in "1234"] == [
        "space diagonal +X +Y +Z", "space diagonal +X −Y +Z", "space diagonal −X +Y +Z", "space diagonal −X −Y +Z",
    ]  # fmt: skip


def test_the_bidirectional_error_of_a_line_along_an_axis_is_its_backlash() -> None:
    """e = ½·gap·approach: outward minus inward is −gap, and X has 1.8 µm."""
    printed = {row[0]: row for row in table(JOB, "Each line by itself, at 20 °C").rows}
    assert abs(float(printed["5"][7].replace("−", "-")) + 1.8) < 2 * float(printed["5"][8])


def test_lines_too_short_for_the_standard_are_named() -> None:
    """820 mm on a diagonal of 900 × 1200 × 600 mm, 1615.5 mm long, is 51 %: ISO 10360-2 asks for 66 %."""
    notes = " ".join(block.text for block in blocks(JOB) if isinstance(block, Paragraph))
    assert "line 1 (51 %), line 2 (51 %), line 3 (51 %) and line 4 (51 %)" in notes
    assert "Not measured" not in notes


def test_positions_that_were_not_measured_are_named() -> None:
    notes = " ".join(block.text for block in blocks("gauge-blocks-simulated") if isinstance(block, Paragraph))
    assert "Not measured of the seven positions of ISO 10360-2:2009: space diagonal +X +Y +Z" in notes
    assert "and parallel to Z" in notes


def test_deviations_and_residuals_are_shown() -> None:
    captions = [block.caption for block in blocks(JOB) if isinstance(block, Plot)]
    assert any(caption.startswith("Deviation of each face") for caption in captions)
    assert any(caption.startswith("Residuals after the fitted model") for caption in captions)


def test_the_worst_indication_decides_with_the_uncertainty_of_the_gauge() -> None:
    (statement,) = analysed(JOB).statements
    errors = analysed(JOB).artefact.indications()
    assert errors is not None
    worst = np.argmax(np.abs(errors.errors) * 1e3 - (4.0 + errors.lengths / 100.0))
    assert statement.value_um == abs(errors.errors[worst]) * 1e3
    assert statement.u_um == 0.4 * errors.lengths[worst] / 820
    assert statement.decision.outcome == "fail"
