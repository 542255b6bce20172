"""Plate: balls at reference positions, placed anyhow."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.kinds import PlateFacts
from cmm_uq.artefacts.plate import Plate
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Points
from cmm_uq.certificate.document import Facts, Paragraph, Plot
from tests.artefacts.constructions import FLAT, MIDDLE, estimated, free, indicated, model, plate
from tests.artefacts.simulated import SCALE, blocks, recovered, table
from tests.conftest import ROOT
from tests.recordings import with_columns

EXACT = artefact_facts(kind="plate")
NOMINAL = artefact_facts(kind="plate", nominal=True)
SIX = ["scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx"]


def test_a_plate_tells_scale_and_squareness_of_its_plane() -> None:
    """By hand: x shrunk by 100 ppm and sheared by 20 µm/m of y, e_x = −S·y."""
    points = plate([FLAT])
    x, y, z = points.xyz.T
    shear = 20e-6
    found = estimated(EXACT, points.at(np.column_stack([(x + shear * y) / 1.0001, y, z])), ["scale_x", "squareness_xy"])
    assert found.value[0] == pytest.approx(100.0, abs=0.01)
    assert np.radians(found.value[1] / 3600) == pytest.approx(shear, abs=1e-8)


@pytest.mark.parametrize("seed", range(6))
def test_an_angle_that_no_attitude_shows_drives_no_other_figure_away(seed: int) -> None:
    """Flat, flat turned, and upright along X: squareness YZ only turns the plate, and least squares alone makes 10⁵″ of noise.

    The others keep their true values, within what the noise of 2 µm of a coordinate leaves (u of scale Z 4 ppm, others less).
    """
    true = np.array([10.0, -5.0, 20.0, 30.0, -20.0, 15.0])
    points = plate([FLAT, (0.0, 0.0, 90.0), (90.0, 0.0, 0.0)])
    found = model(EXACT, indicated(EXACT, points, SIX, true, sigma=2e-3, seed=seed), SIX, None).estimate()
    off = np.delete(found.about[:6] - true, 4)
    assert np.abs(off).max() < 5 * 4
    assert abs(found.about[4]) < 1000


def test_the_placing_is_that_of_a_general_minimiser() -> None:
    """Second method: scipy's least squares over a rotation vector and a shift; scipy's own alignment agrees too."""
    points = indicated(EXACT, plate([(30.0, -20.0, 70.0)]), [], [], sigma=5e-3, seed=4)
    artefact = Plate(EXACT, points)
    body = artefact.reference

    def misfit(p: np.ndarray[tuple[int], np.dtype[np.float64]]) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        turned = Rotation.from_rotvec(p[:3]).apply(body - body.mean(axis=0))
        return np.asarray((points.xyz - turned - p[3:]).ravel())

    start = np.append(Rotation.from_euler("xyz", (30.0, -20.0, 70.0), degrees=True).as_rotvec(), MIDDLE)
    found = least_squares(misfit, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    np.testing.assert_allclose(artefact.deviations().ravel(), found.fun, atol=1e-9)
    aligned, _ = Rotation.align_vectors(points.xyz - points.xyz.mean(axis=0), body - body.mean(axis=0))
    np.testing.assert_allclose(artefact.attitudes(points.xyz)[0], aligned.as_matrix(), atol=1e-12)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000))
def test_no_placing_changes_what_the_plate_says(seed: int) -> None:
    random = np.random.default_rng(seed)
    points = plate(random.uniform(-180, 180, (3, 3)).tolist())
    assert np.abs(Plate(EXACT, points).deviations()).max() < 1e-11


@pytest.mark.parametrize(
    ("extra", "values"),
    [
        (["rotation_x_z", "rotation_y_x", "rotation_z_y"], [400.0, -300.0, 200.0]),
        (["straightness_x_y", "straightness_y_x", "straightness_z_x"], [150.0, -90.0, 200.0]),
        (["thermal_scale_x", "thermal_artefact"], [2.5e-5, 1.2e-5]),
        (["hysteresis_x", "drift_z"], [60.0, 30.0]),
    ],
)
def test_large_errors_of_every_kind_are_recovered_exactly(extra: list[str], values: list[float]) -> None:
    points = plate()
    n = len(points)
    points = with_columns(
        points, temp_x_c=20 + np.linspace(-4, 6, n), temp_artefact_c=20 + np.linspace(3, -2, n) ** 2 / 3,
        time_s=np.linspace(0, 9000, n), approach_x=np.where(np.arange(n) % 3, 1.0, -1.0),
        tip_x_mm=np.where(np.arange(n) % 2, 60.0, 0.0),
    )  # fmt: skip
    names, truth = SIX + extra, [300.0, -200.0, 100.0, 173.0, -400.0, 50.0, *values]
    found = estimated(EXACT, indicated(EXACT, points, names, truth), names)
    scale = np.array([u.scale for u in found.unknowns])
    np.testing.assert_allclose((found.value[:-1] - truth) / scale[:-1], 0, atol=1e-9)
    assert np.abs(found.residuals).max() < 1e-11


def test_a_plate_flat_on_the_table_leaves_z_open() -> None:
    """Squareness to z and the scale of z only shift a plate that is level: the free placing takes them up."""
    assert sorted(next(iter(c)) for c in free(estimated(EXACT, plate([FLAT]), SIX))) == [
        "scale_z", "squareness_yz", "squareness_zx",
    ]  # fmt: skip


def test_nominal_positions_leave_one_scale_common_to_axes_and_plate() -> None:
    points = indicated(NOMINAL, plate(), SIX, [250.0, -90.0, 30.0, -173.0, -19.0, 210.0], size=565.9, sigma=1e-3)
    found = estimated(NOMINAL, points, SIX)
    (combination,) = free(found)
    expected = {"scale_x": 1, "scale_y": 1, "scale_z": 1, "artefact": found.value[-1] * 1e-6}
    assert combination == pytest.approx(expected, rel=1e-8)


def test_a_level_plate_of_nominal_positions_still_tells_how_x_differs_from_y() -> None:
    combinations = free(estimated(NOMINAL, plate([FLAT]), ["scale_x", "scale_y", "squareness_xy"]))
    assert [sorted(c) for c in combinations] == [["artefact", "scale_x", "scale_y"]]


@pytest.mark.parametrize("facts", [NOMINAL, artefact_facts(kind="plate", u_um=0.5)], ids=["nominal", "certified"])
@pytest.mark.parametrize("turned", [FLAT, (0.0, 0.0, 37.0), (0.003, 0.0, 90.0)])
def test_what_only_the_noise_of_its_attitude_tells_of_a_flat_plate_stays_open(
    turned: tuple[float, float, float], facts: PlateFacts
) -> None:
    """Nothing in a plane shows an axis across it; of the plane's own scales, a free length leaves one.

    A shear of squareness S leaves S/2 of each coordinate once the plate has turned: u = σ / √(Σ(x² + y²)/4), rad.
    """
    wanted = [{"scale_z"}, {"squareness_yz"}, {"squareness_zx"}]
    wanted += [{"scale_x", "scale_y", "artefact"}] if facts.nominal else []
    u = 206264.8 * 7e-4 / np.sqrt(2 * 25 * (20000 + 20000) / 4)
    for seed in range(3):
        recorded = indicated(facts, plate([FLAT, turned]), SIX, [9, -6, 14, 12, -7.5, 4], sigma=7e-4, seed=seed)
        found = estimated(facts, recorded, SIX, sigma=None)
        assert sorted(map(sorted, free(found))) == sorted(map(sorted, wanted))
        assert np.sqrt(found.covariance[3, 3]) == pytest.approx(u, rel=0.3)
        assert found.value[3] == pytest.approx(12, abs=5 * u)


def test_the_certificate_of_the_plate_limits_the_scale() -> None:
    """u = 1 µm on the diagonal of 400 mm · √2 is 1.768 ppm of every axis."""
    found = estimated(artefact_facts(kind="plate", u_um=1.0), plate(), SIX, sigma=1e-9)
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)[:3]), 1e-3 / (400 * np.sqrt(2)) * 1e6, rtol=1e-3)


def test_the_expansion_of_a_warm_plate_is_taken_away() -> None:
    """Steel, 11.5 ppm/K, at 24 °C."""
    points = plate(pitch=100 * (1 + 46e-6))
    cold = plate().columns
    points = with_columns(points, temp_artefact_c=np.full(len(points), 24.0), **cold)
    warm = Plate(artefact_facts(kind="plate", cte_per_k=11.5e-6), points)
    assert np.abs(warm.deviations()).max() < 1e-11
    distances = warm.indications()
    assert distances is not None
    assert np.abs(distances.errors).max() < 1e-11
    assert len(distances.errors) == 4 * 25 * 24 / 2


def test_a_beam_of_balls_is_a_plate_on_one_line() -> None:
    """Its rotation about itself is free and means nothing; lengths along it count."""
    points = plate([FLAT])
    beam = points.select(points.columns["reference_y_mm"] == 0)
    found = estimated(EXACT, beam.at(beam.xyz / [1.0001, 1, 1]), ["scale_x"])
    assert found.value[0] == pytest.approx(100.0, abs=1e-6)
    assert found.degrees_of_freedom == 3 * 5 - 5 - 1


@pytest.mark.long
def test_intervals_cover_the_truth_as_often_as_they_say() -> None:
    truth, inside, points = [100.0, -60.0, 20.0, 30.0, -12.0, 5.0], 0, plate(pitch=200.0, side=3)
    for seed in range(200):
        found = estimated(EXACT, indicated(EXACT, points, SIX, truth, sigma=1e-3, seed=seed), SIX)
        off = found.value[:6] - truth
        inside += off @ np.linalg.solve(found.covariance[:6, :6], off) < 12.592  # χ²(6), 95 %
    assert 180 <= inside <= 198  # binomial(200, 0.95): outside with probability 0.3 %


def renumbered(points: Points) -> Points:
    """Numbering that starts one ball late in every placing."""
    return with_columns(points, **{c: np.roll(v.reshape(4, 25), 1, axis=1).ravel() for c, v in points.columns.items()})


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda p: p.at(p.xyz / 1000), "look like metres"),
        (lambda p: p.select((p.measurement > 1) | (p.point == 1)), "measurement 1 has no two different balls"),
        (renumbered, "do not have the shape of this plate"),
        (lambda p: Points(p.xyz, p.measurement, p.point, p.repeat, p.machine), "no column 'reference_x_mm'"),
    ],
)  # fmt: skip
def test_a_recording_that_is_none_of_this_plate_is_refused(spoil: object, message: str) -> None:
    assert callable(spoil)
    with pytest.raises(CmmUqError, match=message):
        Plate(EXACT, spoil(plate()))


JOB = "plate-simulated"


def test_the_errors_put_into_the_example_are_found() -> None:
    recovered(JOB, {**SCALE, "squareness_xy": 12.0, "squareness_zx": 4.0, "straightness_x_y": 3.5})


def test_deviations_before_the_model_are_those_of_scipys_alignment() -> None:
    rows = np.genfromtxt(ROOT / "examples" / JOB / "recording.csv", delimiter=",", names=True)
    first = rows[rows["measurement"] == 1]
    found = np.column_stack([first[f"{a}_mm"] for a in "xyz"])
    body = np.column_stack([first[f"reference_{a}_mm"] for a in "xyz"])
    found, body = found - found.mean(axis=0), body - body.mean(axis=0)
    turn, rssd = Rotation.align_vectors(found, body)
    _, balls, rms, largest, after, _ = table(JOB, "Deviation of a coordinate").rows[0]
    assert balls == "25"
    assert float(rms) == pytest.approx(rssd / np.sqrt(75) * 1e3, abs=0.006)
    in_plate = turn.inv().apply(found) - body
    assert float(largest) == pytest.approx(np.abs(in_plate).max() * 1e3, abs=0.006)
    assert float(after) < 0.3 * float(rms)


def test_every_placing_is_drawn_as_arrows() -> None:
    arrows = [
        block for block in blocks(JOB) if isinstance(block, Plot) and "displacement of each ball" in block.caption
    ]
    assert len(arrows) == 2
    assert "Plate x / mm" in arrows[0].svg
    assert "Arrows at 25 balls" in arrows[0].alternative


def test_a_comparison_of_two_dates_says_what_changed_and_what_looks_alike() -> None:
    """Scale X changed by 5 ppm, squareness by −3″, Y and the bow of 30 µm not at all; 11.5 ppm is one kelvin of steel."""
    job = "plate-two-dates-simulated"
    recovered(job, {"scale_x": 5.0, "scale_y": 0.0, "squareness_xy": -3.0, "straightness_x_y": 0.0})
    (text,) = [b.text for b in blocks(job) if isinstance(b, Paragraph) and "looks the same" in b.text]
    assert "2025-01-01" in text
    said = re.search(r"changed by (\S+) ppm.*colder by (\S+) K", text)
    assert said is not None
    assert float(said[2]) == pytest.approx(float(said[1]) / 11.5, abs=0.01)
    labels = {label: value for b in blocks(job) if isinstance(b, Facts) for label, value in b.rows}
    assert labels["References"] == "the earlier recording earlier.csv"
    assert "Certified length at 20 °C" not in labels
