"""Sphere: points probed on a ball whose centre nobody knows."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from cmm_uq.app.commands.estimation import doubt_of
from cmm_uq.app.commands.report import analyse
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.spheres.sphere import SphereArtefact
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Points
from cmm_uq.jobs.tables.conformity import Circumstances
from cmm_uq.machine.model.artefact_doubt import causes_of
from cmm_uq.maths.geometry import fit_sphere
from tests.artefacts.constructions import estimated, free, hemisphere, indicated, model, spheres
from tests.artefacts.simulated import analysed, recovered, table
from tests.conftest import ROOT
from tests.recordings import with_columns

BALL = artefact_facts(kind="sphere", length_mm=25.0, u_um=0.2)
UNKNOWN_BALL = artefact_facts(kind="sphere")


def test_a_ball_larger_by_the_probe_error_is_an_error_of_the_radius() -> None:
    """Points 3 µm inside a certified ball (by hand): true = indicated + 3 µm · n; P_Size is −6 µm, P_Form nothing."""
    points = spheres()
    n = np.tile(hemisphere(), (4, 1))
    found = estimated(BALL, points.at(points.xyz - 3e-3 * n), ["probe_radius"])
    assert found.value[0] == pytest.approx(3.0, abs=1e-8)
    probed = SphereArtefact(BALL, points.at(points.xyz - 3e-3 * n)).forms()
    np.testing.assert_allclose(probed.size, -6e-3, atol=1e-11)
    assert probed.form.max() < 1e-11
    assert probed.count.tolist() == [25] * 4


def test_the_free_centre_is_that_of_an_orthogonal_distance_fit() -> None:
    """Second method: the geometry room's sphere; its residuals are those of the model with a free diameter."""
    points = indicated(UNKNOWN_BALL, spheres(1, normals=False), [], [], sigma=2e-3, seed=8)
    ball = fit_sphere(points.xyz)
    found = estimated(UNKNOWN_BALL, points, [], sigma=None)
    assert found.value[0] == pytest.approx(2 * ball.radius, abs=1e-9)
    np.testing.assert_allclose(found.residuals, ball.residuals, atol=1e-7)  # second order of 2 µm on 12.5 mm
    assert np.sqrt(found.covariance[0, 0]) == pytest.approx(2 * ball.u("r"), rel=1e-3)


@pytest.mark.parametrize("normals", [True, False])
def test_large_errors_are_recovered_exactly(normals: bool) -> None:
    names, truth = ["scale_x", "scale_z", "squareness_xy"], [800.0, -500.0, 900.0]
    if normals:
        names, truth = [*names, "probe_radius", "probe_lobing"], [*truth, 25.0, 9.0, -7.0]
    found = estimated(BALL, indicated(BALL, spheres(normals=normals), names, truth), names)
    scale = np.array([u.scale for u in found.unknowns])
    np.testing.assert_allclose((found.value - [*truth, 25.0]) / scale, 0, atol=1e-9)
    assert np.abs(found.residuals).max() < 1e-11


def test_a_ball_of_unknown_diameter_hides_the_error_of_the_stylus_radius() -> None:
    """One micrometre of radius is two of diameter, exactly: every point moves along its normal either way."""
    points = indicated(UNKNOWN_BALL, spheres(), ["probe_radius", "probe_lobing"], [5.0, 2.0, 1.0], sigma=1e-3)
    (combination,) = free(estimated(UNKNOWN_BALL, points, ["probe_radius", "probe_lobing"]))
    assert combination == pytest.approx({"probe_radius": 1.0, "artefact": 2e-3}, rel=1e-9)


@pytest.mark.parametrize("normals", [True, False])
def test_a_ball_of_unknown_diameter_hides_the_three_scales_together(normals: bool) -> None:
    """In noisy recordings too, where rounding and the fit of each place blur the null space."""
    scales = ["scale_x", "scale_y", "scale_z"]
    for seed in range(20):
        points = indicated(UNKNOWN_BALL, spheres(normals=normals), scales, [10.0, -5.0, 20.0], sigma=1.5e-3, seed=seed)
        (combination,) = free(estimated(UNKNOWN_BALL, points, scales))
        assert [combination[name] for name in scales] == pytest.approx([1.0, 1.0, 1.0], abs=1e-3)
        assert combination["artefact"] == pytest.approx(25e-6, rel=0.01)


def test_a_certified_diameter_leaves_nothing_open() -> None:
    assert free(estimated(BALL, spheres(), ["probe_radius", "probe_lobing"])) == []


def test_backlash_and_drift_common_to_a_ball_are_lost_in_its_centre() -> None:
    """One approach for all points moves the whole ball: the column vanishes once the centre is free."""
    points = with_columns(spheres(), approach_x=np.ones(100), time_s=np.repeat([0.0, 60.0, 120.0, 180.0], 25))
    assert sorted(next(iter(c)) for c in free(estimated(BALL, points, ["hysteresis_x", "drift_y", "probe_radius"]))) == [
        "drift_y", "hysteresis_x",
    ]  # fmt: skip


def test_normals_of_rough_length_are_brought_to_unit_length() -> None:
    """Four printed digits must not part what is the same: radius and diameter stay exactly one combination."""
    points = spheres()
    points = with_columns(points, **{c: np.round(points.columns[c], 4) for c in ("nx", "ny", "nz")})
    assert len(free(estimated(UNKNOWN_BALL, points, ["probe_radius"]))) == 1


@pytest.mark.parametrize("lobes", [2, 3, 4, 6])
def test_what_a_ball_that_is_not_round_does_to_lobes_is_in_their_uncertainty(lobes: int) -> None:
    """All of a form of 0.4 µm in as many lobes: they swing by 0.2 µm, of unknown phase; their cosine has u = 0.2/√2 µm."""
    ball = artefact_facts(kind="sphere", length_mm=25.0, u_um=0.2, form_um=0.4)
    effect = "probe_lobing" + f"_{lobes}" * (lobes != 3)
    points = spheres()
    seen = model(ball, points, ["probe_radius", effect])
    (form,) = causes_of(seen.artefact, Circumstances())
    u = np.sqrt(np.diag(doubt_of(seen, seen.estimate(), 1e-3, [form]).covariance()))
    assert u[1:3] == pytest.approx(0.2 / np.sqrt(2), rel=0.2)
    n = np.column_stack([points.columns[name] for name in ("nx", "ny", "nz")])
    for phase in np.linspace(0, np.pi, 7):
        round_off = 2e-4 * np.cos(lobes * np.arctan2(n[:, 1], n[:, 0]) + phase)
        off = estimated(ball, points.at(points.xyz + round_off[:, None] * n), ["probe_radius", effect]).value
        assert np.all(np.abs(off[:3]) <= 2 * u[:3] + 1e-9)


@pytest.mark.usefixtures("no_regions", "no_diagnosis")
@pytest.mark.parametrize(
    ("form", "outcome"), [("form_um = 0.1", "pass"), ("form_um = 1.0", "undecided"), ("", "undecided")]
)
def test_lobes_of_the_probe_pass_by_no_ball_of_unknown_or_larger_form(form: str, outcome: str, tmp_path: Path) -> None:
    """0.908 µm of lobes against 1.2 µm; U was 0.126 µm whatever the form."""
    shutil.copytree(ROOT / "examples" / JOB, tmp_path / "job")
    text = (tmp_path / "job" / "job.toml").read_text(encoding="utf-8").replace("form_um = 0.1", form)
    text = text.replace("[test_un", "tolerances = { probe_lobing = 1.2 }\n\n[test_un").split("[[conformity]]")[0]
    (tmp_path / "job" / "job.toml").write_text(text, encoding="utf-8")
    (lobing,) = analyse(tmp_path / "job").verdicts
    assert lobing.outcome == outcome
    assert [str(text) for text in lobing.missing] == ([] if form else ["The form of the sphere is not stated"])


@pytest.mark.long
def test_intervals_cover_the_truth_as_often_as_they_say() -> None:
    names, truth, inside = ["probe_radius", "probe_lobing"], [2.0, 1.5, -0.5], 0
    exact = artefact_facts(kind="sphere", length_mm=25.0)
    points = spheres(2)
    for seed in range(200):
        found = estimated(exact, indicated(exact, points, names, truth, sigma=1e-3, seed=seed), names)
        off = found.value[:3] - truth
        inside += off @ np.linalg.solve(found.covariance[:3, :3], off) < 7.815  # χ²(3), 95 %
    assert 180 <= inside <= 198  # binomial(200, 0.95): outside with probability 0.3 %


def flat(points: Points) -> Floats:
    return points.xyz * [1, 1, 0]


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda p: p.at(flat(p)), "measurement 1: 25 points lie in one plane"),
        (lambda p: p.select(p.point <= 3), "measurement 1: 3 points are too few"),
        (lambda p: p.at(p.xyz / 1000), "look like metres"),
        (lambda p: with_columns(p, **{f"n{a}": -p.columns[f"n{a}"] for a in "xyz"}), "point into the sphere"),
        (lambda p: with_columns(p, nx=p.columns["ny"], ny=p.columns["nx"]), "does not point away from the centre"),
    ],
)
def test_a_recording_that_is_none_of_a_ball_is_refused(spoil: object, message: str) -> None:
    assert callable(spoil)
    with pytest.raises(CmmUqError, match=message):
        SphereArtefact(BALL, spoil(spheres()))


JOB = "sphere-simulated"


def test_the_errors_put_into_the_example_are_found() -> None:
    """Lobing 0.9 µm · cos φ and 0.4 µm · sin φ: amplitude 0.985 µm."""
    recovered(JOB, {"probe_radius": 0.8, "probe_lobing": float(np.hypot(0.9, 0.4))})


def test_form_and_size_are_those_of_a_sphere_fitted_by_scipy() -> None:
    rows = np.genfromtxt(ROOT / "examples" / JOB / "recording.csv", delimiter=",", names=True)
    first = rows[rows["measurement"] == 1]
    xyz = np.column_stack([first["x_mm"], first["y_mm"], first["z_mm"]])
    fit = least_squares(lambda p: np.linalg.norm(xyz - p[:3], axis=1) - p[3], [*xyz.mean(axis=0), 12.0], xtol=1e-15)
    number, points, form, size = table(JOB, "Probing errors").rows[0]
    assert (number, points) == ("1", "25")
    assert float(form) == pytest.approx(np.ptp(fit.fun) * 1e3, abs=0.006)
    assert float(size.replace("−", "-")) == pytest.approx((2 * fit.x[3] - 25.0012) * 1e3, abs=0.006)


def test_iso_10360_5_decides_on_the_largest_form_error_with_half_the_form_of_the_ball() -> None:
    """The ball's certificate says 0.1 µm of form: u = 0.05 µm (ISO/TS 23165)."""
    (statement,) = analysed(JOB).statements
    printed = [float(row[2]) for row in table(JOB, "Probing errors").rows]
    assert round(statement.value_um, 2) == max(printed)
    assert statement.u_um == pytest.approx(0.05)
    assert statement.decision.outcome == "pass"
    assert any("largest of 3 spheres" in remark for remark in statement.remarks)
