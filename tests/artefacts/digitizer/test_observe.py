"""A digitizer in several attitudes on a reference sphere: the offset of its mount, and what leaves it open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.optimize import least_squares

from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.digitizer import DigitizerArtefact, offset_misfit
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.units import ARCSECOND
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.physics.digitizer import Alignment, mount_offset
from cmm_uq.maths.inference.linear_model import Freedoms
from cmm_uq.maths.inference.posterior import sample
from tests.artefacts.constructions import estimated, free, indicated
from tests.artefacts.digitizer.aligned import OFFSET, RADIUS, SIX, SPHERE, THREE, cap, centres, recording, scans, turned
from tests.recordings import screened

CENTRES = artefact_facts(kind="digitizer")
SPHERES = artefact_facts(kind="digitizer", length_mm=2 * RADIUS, u_um=0.3)
UNKNOWN = artefact_facts(kind="digitizer", offset_mm=[1.0, 264.0, 130.0])
NOISE = 5e-3


def noisy(points: Points, sigma: float = NOISE, seed: int = 1) -> Points:
    return points.at(points.xyz + np.random.default_rng(seed).normal(0, sigma, points.xyz.shape))


@pytest.mark.parametrize(
    ("facts", "points"), [(CENTRES, centres()), (SPHERES, scans()), (UNKNOWN, scans(SIX)), (CENTRES, centres(SIX, 3))]
)
def test_the_offset_is_found_exactly_where_nothing_errs(facts: object, points: Points) -> None:
    found = estimated(facts, points, [])  # type: ignore[arg-type]
    np.testing.assert_allclose(found.value[:3], OFFSET, atol=1e-9)
    assert np.abs(found.residuals).max() < 1e-10
    assert found.null_space.shape[1] == 0


@given(
    offset=st.tuples(*(st.floats(-300, 300) for _ in range(3))),
    angles=st.lists(st.tuples(*(st.floats(-180, 180) for _ in range(3))), min_size=4, max_size=7),
)
@settings(max_examples=60, deadline=None)
def test_any_attitudes_that_are_accepted_give_the_offset_back(
    offset: tuple[float, ...], angles: list[tuple[float, ...]]
) -> None:
    points = centres(angles, offset=np.array(offset))
    try:
        found = estimated(CENTRES, points, [])
    except CmmUqError:
        spread = np.array([turned(each) for each in angles])
        s = np.linalg.svd((spread - spread.mean(axis=0)).reshape(-1, 3), compute_uv=False)
        assert s[-1] < 0.0101 or not np.ptp(points.xyz, axis=0).any()
        return
    np.testing.assert_allclose(found.value[:3], offset, atol=1e-8)


def by_scipy(points: Points, diameter: float | None) -> tuple[Floats, Floats]:
    """Offset and its covariance for one millimetre of noise: SciPy on distances from the sphere, with all unknown at once."""
    angles = np.column_stack([points.columns[name] for name in ("alpha_deg", "beta_deg", "gamma_deg")])
    E = np.array([turned(each) for each in angles])
    seen = np.column_stack([points.columns["u_mm"], points.columns["v_mm"], np.zeros(len(points))])

    def misses(state: Floats) -> Floats:
        point = points.xyz + np.einsum("nij,nj->ni", E, seen - state[:3])
        return np.linalg.norm(point - state[3:6], axis=1) - (state[6] if diameter is None else diameter / 2)

    start = np.concatenate(
        [OFFSET + np.array([0.5, -0.4, 0.3]), SPHERE + 1.0, [RADIUS + 0.2] if diameter is None else []]
    )
    found = least_squares(misses, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return found.x[:3], np.linalg.inv(found.jac.T @ found.jac)[:3, :3]


@pytest.mark.parametrize("diameter", [None, 2 * RADIUS])
def test_scipy_finds_the_same_offset_and_covariance_from_the_points(diameter: float | None) -> None:
    """Second method: distances from the sphere, with attitudes, centre and radius, by scipy.optimize.least_squares."""
    facts = artefact_facts(kind="digitizer", length_mm=diameter)
    points = noisy(scans(SIX))
    expected, covariance = by_scipy(points, diameter)
    found = estimated(facts, points, [], NOISE)
    np.testing.assert_allclose(found.value[:3], expected, atol=3e-6)
    np.testing.assert_allclose(found.covariance[:3, :3], NOISE**2 * covariance, rtol=2e-3, atol=1e-9)


def test_centres_are_solved_as_the_alignments_by_the_closed_solution() -> None:
    """Second method: weighted least squares over nine equations (physics.alignment), whose tests hold it to the source."""
    points = noisy(centres(SIX))
    closed = mount_offset([
        Alignment(*np.radians(angles), reading, NOISE**2 * np.eye(3)) for angles, reading in zip(SIX, points.xyz, strict=True)
    ])  # fmt: skip
    found = estimated(CENTRES, points, [], NOISE)
    np.testing.assert_allclose(found.value[:3], closed.offset, atol=1e-9)
    np.testing.assert_allclose(found.covariance[:3, :3], closed.covariance[:3, :3], rtol=1e-9, atol=1e-18)


def test_the_source_s_lines_give_13_15_and_15_um_when_all_equations_are_weighted() -> None:
    """Probing 9 µm, centre 10/√3 µm, scales 2, 16.5, 1 µm (section 5.3), against mount_offset's exact covariance."""
    u = np.sqrt(9**2 + 10**2 / 3 + np.array([2.0, 16.5, 1.0]) ** 2)
    facts, points = artefact_facts(kind="digitizer", u_centre_um=u.tolist()), centres()
    exact = mount_offset([
        Alignment(*np.radians(angles), reading, np.diag(u**2) * 1e-6)
        for angles, reading in zip(THREE, points.xyz, strict=True)
    ])  # fmt: skip
    posterior = sample(RecordingModel(DigitizerArtefact(facts, points), (), 1e-5).estimate().linear, seed=0)
    found = posterior.draws[:, :3].std(axis=0)
    assert exact.u * 1e3 == pytest.approx([12.9, 15.05, 15.10], abs=0.05)
    np.testing.assert_allclose(found, exact.u, rtol=0.02)


def test_an_attitude_in_doubt_moves_the_offset_by_its_lever() -> None:
    """One turned by 10″ about X in alignment 1: δ × q, with q from the mount to the sphere."""
    points = centres()
    q = SPHERE - points.xyz[0]
    xyz = points.xyz.copy()
    xyz[0] -= np.cross([10 * ARCSECOND, 0, 0], q)
    facts = artefact_facts(kind="digitizer", u_attitude_arcsec=2.0)
    digitizer = DigitizerArtefact(facts, points.at(xyz))
    model = RecordingModel(digitizer, (), NOISE)
    names = [size.name for size in digitizer.sizes]
    truth = np.array([*OFFSET, *np.zeros(9)])
    truth[names.index("turn_x_1_arcsec")] = 10.0
    np.testing.assert_allclose(model.residuals(truth), 0, atol=1e-6)
    assert np.abs(model.residuals(np.array([*OFFSET, *np.zeros(9)]))).max() > 5e-3


@pytest.mark.parametrize("form", ["scans", "centres"])
def test_the_jacobian_of_every_size_is_that_of_differences(form: str) -> None:
    points = scans(SIX) if form == "scans" else centres(SIX)
    size = {"length_mm": 2 * RADIUS, "u_um": 0.3} if form == "scans" else {}
    facts = artefact_facts(kind="digitizer", u_attitude_arcsec=3.0, u_centre_um=[1.0, 2.0, 3.0], **size)
    digitizer = DigitizerArtefact(facts, points)
    nominal = np.array([size.nominal for size in digitizer.sizes])
    at = digitizer.fit(digitizer.points.xyz, nominal)
    # what is left of a change after the sphere has moved along with it
    placing = Freedoms.of(digitizer.placing(at)).dense()
    left = np.eye(len(placing)) - placing @ np.linalg.pinv(placing)
    for i, size in enumerate(digitizer.sizes):
        step = {"mm": 1e-3, "″": 1.0, "µm": 1.0}[size.unit]
        ends = [digitizer.fit(at, nominal + sign * step * np.eye(len(nominal))[i]) for sign in (1, -1)]
        change = digitizer.project(at, (ends[0] - ends[1])[:, :, None] / (2 * step))[:, 0]
        np.testing.assert_allclose(left @ change, left @ digitizer.size_change()[:, i], atol=2e-6, err_msg=size.name)


@pytest.mark.parametrize(
    ("attitudes", "told"),
    [
        (THREE[:2], "2 attitudes leave the offset of the mount along w open. Align in three"),
        (
            [(90.0, 90.0, g) for g in (0.0, 45.0, 90.0, 180.0)],
            "4 attitudes leave the offset of the mount along w open. Align",
        ),
        (THREE[:1], "1 attitudes leave"),
        (
            [(90.0, 90.0, 0.0), (90.0, 90.0, 90.0), (90.2, 90.0, 0.0)],
            "along w open, 405 times as uncertain as a centre",
        ),
    ],
)
def test_attitudes_that_turn_about_one_axis_are_refused_with_what_they_leave_open(attitudes: object, told: str) -> None:
    for points in (centres(attitudes), scans(attitudes)):  # type: ignore[arg-type]
        with pytest.raises(CmmUqError, match=told):
            DigitizerArtefact(CENTRES, points, where="recording.csv")


def test_a_scale_common_to_all_axes_is_one_with_the_digitizer_s_size() -> None:
    """E.g. 10 ppm of all scales and 10 ppm less of U1, V1, W1: nothing that the recording shows changes."""
    scales = ["scale_x", "scale_y", "scale_z"]
    found = estimated(CENTRES, centres(SIX), scales)
    assert found.null_space.shape[1] == 1
    (combination,) = free(found)
    assert {"scale_x", "scale_y", "scale_z"} < set(combination)
    column = found.null_space[:, 0] / found.null_space[0, 0]
    np.testing.assert_allclose(column[3:], OFFSET * 1e-6, rtol=1e-5)


def test_carriages_that_rotate_turn_the_digitizer_with_them() -> None:
    """50″ per metre of X about Z, by hand: e = ε(x)·Z × (what carriage X carries, and from the mount to the sphere)."""
    true = centres(SIX).xyz
    points = indicated(CENTRES, centres(SIX), ["rotation_x_z"], [50.0])
    x, y, _ = points.xyz.T
    qx, qy, _ = (SPHERE - true).T
    turn = 50 * ARCSECOND * 1e-3 * x
    error = np.column_stack([-turn * (y + qy), turn * qx, 0 * x])
    indicated_off = true - points.xyz
    # the place of the sphere is free
    np.testing.assert_allclose(indicated_off - indicated_off.mean(axis=0), error - error.mean(axis=0), atol=1e-6)
    found = estimated(CENTRES, points, ["rotation_x_z"]).value
    np.testing.assert_allclose(found, [50.0, *OFFSET], rtol=2e-5, atol=1e-6)


def test_the_readings_all_alike_are_refused() -> None:
    points = centres()
    with pytest.raises(CmmUqError, match="all the same"):
        DigitizerArtefact(CENTRES, points.at(np.zeros_like(points.xyz)))


def test_a_digitizer_far_from_its_drawing_is_refused() -> None:
    facts = artefact_facts(kind="digitizer", offset_mm=[264.5, 1.0, 129.6])
    with pytest.raises(CmmUqError, match=r"\[U1 V1 W1\] = \[1.001, 264.505, 129.575\] mm, far from offset_mm"):
        DigitizerArtefact(facts, centres())


def test_several_attitudes_in_one_measurement_are_refused_with_the_line() -> None:
    points = centres()
    points = replace(points, measurement=np.array([1, 1, 2]), point=np.array([1, 2, 1]))
    with pytest.raises(CmmUqError, match=r"recording.csv line 2: measurement 1 has several attitudes"):
        DigitizerArtefact(CENTRES, points, where="recording.csv")


def test_a_recording_without_angles_or_with_half_a_scan_is_refused() -> None:
    points = scans()
    for name, told in (("beta_deg", "no column 'beta_deg'"), ("v_mm", "no column 'v_mm'")):
        columns = {key: values for key, values in points.columns.items() if key != name}
        with pytest.raises(CmmUqError, match=told):
            DigitizerArtefact(SPHERES, replace(points, columns=columns))


def test_a_scan_along_one_line_is_no_sphere() -> None:
    points = scans(count=12)
    with pytest.raises(CmmUqError, match="measurement 1"):
        DigitizerArtefact(SPHERES, points.at(np.repeat(points.xyz[:1], len(points), axis=0)))


def test_what_is_drawn_has_the_noise_that_was_asked_for() -> None:
    """1800 radial residuals: their standard deviation is known to 1.7 %."""
    model = RecordingModel(DigitizerArtefact(SPHERES, scans(SIX, 300)), ())
    sizes = np.array([size.nominal for size in model.artefact.sizes])
    drawn = model.simulate(np.zeros(0), sizes, Noise(coordinate=NOISE), np.random.default_rng(3))
    residuals = replace(model, artefact=DigitizerArtefact(SPHERES, scans(SIX, 300).at(drawn))).residuals(sizes)
    assert np.std(residuals) == pytest.approx(NOISE, rel=0.1)


def test_the_sphere_is_where_it_was() -> None:
    for facts, points in ((SPHERES, scans()), (CENTRES, centres())):
        digitizer = DigitizerArtefact(facts, points)
        sizes = np.array([size.nominal for size in digitizer.sizes])
        sizes[:3] = OFFSET
        np.testing.assert_allclose(digitizer.centre(points.xyz, sizes), SPHERE, atol=1e-9)


def test_the_construction_sees_the_sphere_from_one_side() -> None:
    assert cap()[:, 1].min() > np.cos(np.radians(76))
    assert recording(np.zeros((1, 3)), np.zeros((1, 3)), [1]).columns["alpha_deg"][0] == 0


HOW = {"needed": set(), "set_aside": [], "where": "recording.csv"}


def moved(points: Points, row: int, by: float = 3.0) -> Points:
    xyz = points.xyz.copy()
    xyz[row] += by
    return points.at(xyz)


@pytest.mark.parametrize(
    ("facts", "points", "row"),
    [
        (SPHERES, scans(), 17),
        (SPHERES, scans(THREE, 30), 80),
        (CENTRES, centres(THREE, 4), 5),
        (CENTRES, centres(SIX), 3),
    ],
)
def test_a_row_that_is_off_by_millimetres_is_left_out_and_the_offset_stays(
    facts: object, points: Points, row: int
) -> None:
    found = screened(moved(points, row), facts, **HOW)  # type: ignore[arg-type]
    (finding,) = found.findings
    assert finding.lines == (row + 2,)
    assert finding.set_aside
    assert len(found.points) == len(points) - 1
    np.testing.assert_allclose(estimated(facts, found.points, []).value[:3], OFFSET, atol=1e-6)  # type: ignore[arg-type]


def test_two_exchanged_alignments_are_named_as_what_they_are() -> None:
    points = centres(THREE, 4)
    xyz = points.xyz + np.random.default_rng(1).normal(0, 5e-3, points.xyz.shape)
    xyz[[1, 5]] = xyz[[5, 1]]
    (finding,) = screened(points.at(xyz), CENTRES, **HOW).findings
    assert finding.kind == "swapped"
    assert set(finding.lines) == {3, 7}


def test_clean_recordings_are_left_alone() -> None:
    for facts, points in ((SPHERES, scans()), (CENTRES, centres(SIX)), (CENTRES, centres())):
        assert screened(points, facts, **HOW).findings == ()


def test_readings_in_inches_are_refused() -> None:
    points = scans()
    with pytest.raises(CmmUqError, match="inch"):
        screened(points.at(points.xyz / 25.4), SPHERES, **HOW)


def test_a_wrong_sphere_is_refused() -> None:
    facts = artefact_facts(kind="digitizer", length_mm=25.9)
    with pytest.raises(CmmUqError, match=r"diameters of the scanned spheres are 25\.4 mm"):
        DigitizerArtefact(facts, scans())


def test_attitudes_that_tell_nothing_make_no_misfit() -> None:
    """Sampled by threes they are all the same; whoever makes the artefact is told so."""
    points = centres([THREE[0]] * 5)
    assert not offset_misfit(points.xyz, np.tile(np.eye(3).ravel(), (5, 1)), np.nan).any()
    assert not offset_misfit(points.xyz[:2], np.tile(np.eye(3).ravel(), (2, 1)), np.nan).any()
