"""Ring: points probed around a cylinder whose axis nobody knows."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from cmm_uq.app.commands.report import analyse
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.spheres.ring import RingGauge, shape_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Points
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.physics.effects.own_states import ROUNDNESS
from cmm_uq.maths.geometry import fit_cylinder
from tests.artefacts.constructions import MIDDLE, TILTS, estimated, free, indicated, model, recording, rings
from tests.artefacts.simulated import recovered, table
from tests.conftest import ROOT
from tests.recordings import with_columns

RING = artefact_facts(kind="ring", length_mm=50.0, u_um=0.2)
UNKNOWN = artefact_facts(kind="ring")


def flat(radii: Floats, turn: Floats) -> Points:
    xyz = MIDDLE + np.column_stack([radii * np.cos(turn), radii * np.sin(turn), np.zeros(len(turn))])
    return recording(xyz, np.ones(len(turn), dtype=np.int64), np.arange(len(turn)) + 1)


def test_lobes_are_the_fourier_coefficients_of_the_distances() -> None:
    """Distances made of two to six lobes; their coefficients by the fast Fourier transform, and those put in."""
    a, b, n = np.array([0.8, -0.3, 0.2, 0.5, -0.1]), np.array([-0.4, 0.6, 0.1, -0.2, 0.3]), 40
    turn = 2 * np.pi * np.arange(n) / n
    waves = sum(p * np.cos(k * turn) + q * np.sin(k * turn) for k, p, q in zip(ROUNDNESS, a, b, strict=True))
    forms, lobes = RingGauge(RING, flat(25.002 + 1e-3 * waves, turn)).probed
    of_fft = 2 * np.fft.rfft(25.002 + 1e-3 * waves)[2:7] / n
    np.testing.assert_allclose(lobes[0], np.column_stack([of_fft.real, -of_fft.imag]).ravel(), atol=1e-7)
    np.testing.assert_allclose(1e3 * lobes[0], np.column_stack([a, b]).ravel(), atol=1e-4)
    assert forms.size == pytest.approx([4e-3], abs=1e-7)
    assert forms.form[0] == pytest.approx(1e-3 * np.ptp(waves), abs=1e-7)


def test_scales_that_differ_and_a_leaning_axis_are_two_lobes() -> None:
    """By hand: indicated = true less s·x: r = R·(1 − (sx + sy)/2 − (sx − sy)/2·cos 2θ), and S/2·R of sin 2θ."""
    R, ppm, second = 25.0, 1e-6, np.pi / 648000
    for names, values, cosine, sine in (
        (["scale_x", "scale_y"], [40.0, -20.0], -30 * ppm * R, 0.0),
        (["squareness_xy"], [50.0], 0.0, 25 * second * R),
    ):
        points = indicated(RING, rings(places=1), names, values)
        forms, lobes = RingGauge(RING, points).probed
        assert lobes[0, :2] == pytest.approx([cosine, abs(sine) * np.sign(lobes[0, 1])], abs=1e-6)
        assert np.abs(lobes[0, 2:]).max() < 1e-6
        assert forms.size == pytest.approx([-R * sum(values) * ppm if len(values) > 1 else 0.0], abs=2e-6)


@pytest.mark.parametrize("heights", [(0.0,), (-8.0, 0.0, 8.0)])
@pytest.mark.parametrize("normals", [True, False])
def test_large_errors_are_recovered_exactly(heights: tuple[float, ...], normals: bool) -> None:
    names, truth = ["scale_x", "scale_z", "squareness_xy"], [800.0, -500.0, 900.0]
    if normals:
        names, truth = [*names, "probe_radius", "probe_lobing"], [*truth, 25.0, 9.0, -7.0]
    found = estimated(RING, indicated(RING, rings(heights, normals=normals), names, truth), names)
    scale = np.array([u.scale for u in found.unknowns])
    assert (np.abs(found.value - [*truth, 50.0]) / scale).max() < (1e-6 if normals else 1e-5)
    assert np.abs(found.residuals).max() < 1e-7


def test_estimates_are_those_of_a_dense_fit_of_everything_at_once() -> None:
    """Second method: squareness, radius of the tip, place and tilt of every axis by scipy, all distances written out."""
    points = indicated(
        RING, rings((-6.0, 0.0, 6.0)), ["squareness_xy", "probe_radius"], [20.0, 3.0], sigma=1e-3, seed=4
    )
    exact = artefact_facts(kind="ring", length_mm=50.0)
    found = estimated(exact, points, ["squareness_xy", "probe_radius"])
    basis = [e.basis(points)[:, :, 0] for e in model(exact, points, ["squareness_xy", "probe_radius"]).effects]

    def off(p: Floats) -> Floats:
        true = points.xyz + p[0] * basis[0] + p[1] * basis[1]
        parts = []
        for i in range(3):
            own = points.measurement == i + 1
            w = Rotation.from_euler("xyz", TILTS[i], degrees=True).as_matrix()
            c, d, e, f = 1e-3 * p[2 + 4 * i : 6 + 4 * i]
            axis = w @ [e, f, 1.0] / np.sqrt(1 + e * e + f * f)
            about = true[own] - points.xyz[own].mean(axis=0) - w @ [c, d, 0.0]
            parts.append(np.linalg.norm(about - (about @ axis)[:, None] * axis, axis=1) - 25.0)
        return 1e3 * np.concatenate(parts)

    fit = least_squares(off, np.zeros(14), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    u = np.sqrt(np.diag(np.linalg.inv(fit.jac.T @ fit.jac)))[:2]
    assert (
        np.abs((found.value[:2] - fit.x[:2]) / u).max() < 1e-3
    )  # errors at the indicated points, and at the true ones
    assert np.sqrt(np.diag(found.covariance))[:2] == pytest.approx(u, rel=1e-3)


def test_the_free_axis_is_that_of_the_geometry_room() -> None:
    """A third method for a tilted ring without a diameter: its residuals are those of the least-squares cylinder."""
    points = indicated(UNKNOWN, rings((-8.0, 0.0, 8.0), normals=False), [], [], sigma=2e-3, seed=8)
    ring = RingGauge(UNKNOWN, points)
    for number in (1, 2, 3):
        own = points.measurement == number
        cylinder = fit_cylinder(points.xyz[own])
        np.testing.assert_allclose(
            ring.distances(points.xyz, None)[own] - cylinder.radius, cylinder.residuals, atol=1e-8
        )


def test_a_ring_of_unknown_diameter_hides_the_error_of_the_stylus_radius() -> None:
    """Of a bore normals point to the axis: a micrometre of radius is two of diameter less; mean scales are as open."""
    (combination,) = free(estimated(UNKNOWN, indicated(UNKNOWN, rings(), ["probe_radius"], [5.0]), ["probe_radius"]))
    assert combination == pytest.approx({"probe_radius": 1.0, "artefact": -2e-3}, rel=1e-6)
    (both,) = free(estimated(RING, rings(places=1), ["scale_x", "scale_y", "probe_radius"]))
    assert {name: both[name] / both["probe_radius"] for name in both} == pytest.approx(
        {"scale_x": 40.0, "scale_y": 40.0, "probe_radius": 1.0}, rel=1e-6
    )


def test_play_of_both_axes_is_told_from_the_radius_by_four_and_six_lobes() -> None:
    """By hand: of a gap g along X the surface is indicated g/2·|cos θ| too far in: mean 2/π, four lobes 4/15π."""
    points = rings(places=1, count=48)
    points = with_columns(points, **{f"approach_{a}": -np.sign(np.round(points.columns[f"n{a}"], 9)) for a in "xyz"})
    names, truth = ["probe_radius", "hysteresis_x", "hysteresis_y"], [4.0, 6.0, -3.0]
    seen = indicated(RING, points, names, truth)
    assert estimated(RING, seen, names).value[:3] == pytest.approx(truth, abs=1e-6)
    forms, lobes = RingGauge(RING, indicated(RING, points, ["hysteresis_x"], [6.0])).probed
    assert forms.size == pytest.approx([-2 * 3e-3 * 2 / np.pi], rel=2e-3)
    assert 1e3 * lobes[0, 4] == pytest.approx(3.0 * 4 / (15 * np.pi), rel=0.02)


def test_sections_have_no_tilt_and_several_heights_have_one() -> None:
    """24 points less two of a section or four of an axis, the certified diameter and no effects; in each of three places."""
    exact = artefact_facts(kind="ring", length_mm=50.0)
    assert model(exact, rings(), []).estimate().linear.freedoms.rank == 6
    assert model(exact, rings((0.0, 8.0)), []).estimate().linear.freedoms.rank == 12


def test_one_diameter_of_a_certificate_is_no_better_than_the_form_of_the_ring() -> None:
    """By hand: √(0.2² + (0.3/√2)²) µm."""
    keys = {"kind": "ring", "length_mm": 50.0, "u_um": 0.2, "form_um": 0.3}
    (size,) = RingGauge(artefact_facts(**keys, one_direction=True), rings()).sizes
    assert 1e3 * size.sd == pytest.approx(np.hypot(0.2, 0.3 / np.sqrt(2)))
    assert RingGauge(artefact_facts(**keys), rings()).sizes[0].sd == pytest.approx(0.2e-3)


def test_a_ring_that_is_turned_tells_its_form_from_the_lobes_of_the_probe() -> None:
    """Four places flat, turned by 0, 50, 100 and 150°: three lobes of the probe, two and three of the ring, all as put in."""
    turned, one = np.repeat([0.0, 50.0, 100.0, 150.0], 24), rings(places=1)
    xyz, n = np.tile(one.xyz, (4, 1)), np.tile(np.column_stack([one.columns[f"n{a}"] for a in "xyz"]), (4, 1))
    angle = np.arctan2(-n[:, 1], -n[:, 0])
    own = 0.4 * np.cos(2 * (angle - np.radians(turned)) + 0.5) + 0.3 * np.sin(3 * (angle - np.radians(turned)))
    points = recording(
        xyz - 1e-3 * (own + 0.6 * np.cos(3 * np.arctan2(n[:, 1], n[:, 0])))[:, None] * n, np.repeat([1, 2, 3, 4], 24),
        np.tile(np.arange(24) + 1, 4), turned_deg=turned, **{f"n{a}": n[:, i] for i, a in enumerate("xyz")},
    )  # fmt: skip
    facts = artefact_facts(kind="ring", length_mm=50.0, form_um=1.4)
    found = estimated(facts, points, ["probe_lobing", "artefact_roundness"])
    value = {u.key: v for u, v in zip(found.unknowns, found.value, strict=True)}
    assert value["probe_lobing", "cosine_um"] == pytest.approx(0.6, abs=1e-3)
    assert value["probe_lobing", "sine_um"] == pytest.approx(0.0, abs=1e-3)
    two = [value["artefact_roundness", f"{part}2_um"] for part in "ab"]
    assert np.hypot(*two) * np.sqrt(2) == pytest.approx(0.4, abs=1e-3)
    three = [value["artefact_roundness", f"{part}3_um"] for part in "ab"]
    assert np.hypot(*three) * np.sqrt(2) == pytest.approx(0.3, abs=1e-3)
    assert np.abs(found.residuals).max() < 1e-6


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda p: p.at(p.xyz * [1, 0, 0]), "measurement 1: 24 points lie on one line"),
        (
            lambda p: p.at(MIDDLE + np.clip(1.5 * (p.xyz - MIDDLE), -20.62, 20.62)),
            "measurement 1: its points do not lie around",
        ),
        (lambda p: p.select(p.point <= 3), "measurement 1: 3 points are too few for a ring"),
        (lambda p: p.at(p.xyz / 1000), "look like metres"),
        (lambda p: with_columns(p, **{f"n{a}": -p.columns[f"n{a}"] for a in "xyz"}), "point into the material.*plug"),
        (lambda p: with_columns(p, nx=p.columns["ny"], ny=p.columns["nx"]), "does not point across the axis"),
    ],
)
def test_a_recording_that_is_none_of_a_ring_is_refused(spoil: object, message: str) -> None:
    assert callable(spoil)
    with pytest.raises(CmmUqError, match=f"(?s){message}") as told:
        RingGauge(RING, spoil(rings(places=1)))
    assert told.value.fix


def test_a_plug_gauge_is_probed_from_outside() -> None:
    points = rings()
    outward = with_columns(points, **{f"n{a}": -points.columns[f"n{a}"] for a in "xyz"})
    plug = artefact_facts(kind="ring", length_mm=50.0, u_um=0.2, plug=True)
    n = np.column_stack([outward.columns[f"n{a}"] for a in "xyz"])
    found = estimated(plug, outward.at(outward.xyz - 3e-3 * n), ["probe_radius"])
    assert found.value[0] == pytest.approx(3.0, abs=1e-6)


@pytest.mark.parametrize("normals", [True, False])
@pytest.mark.parametrize("facts", [RING, UNKNOWN])
def test_a_point_that_is_off_is_found_and_no_other(normals: bool, facts: ArtefactFacts) -> None:
    """5 mm outwards and sideways, where all others lie within 10 µm; over three quarters of a turn too."""
    points = indicated(UNKNOWN, rings(normals=normals), [], [], sigma=3e-3, seed=2)
    for some in (points, points.select(points.point <= 18)):
        xyz, row = some.xyz.copy(), 7
        n = (xyz - xyz[some.measurement == 1].mean(axis=0))[row]
        xyz[row] += 5.0 * n / np.linalg.norm(n) + [0.0, 0.0, 2.0]
        shape = shape_of(facts, some.at(xyz))
        assert shape is not None
        off = shape.misfit(xyz, shape.reference)
        assert off[row] > 4.0
        assert np.delete(off, row).max() < 0.05


JOB = "ring-simulated"


def test_the_errors_put_into_the_example_are_found() -> None:
    recovered(JOB, {"probe_radius": 0.7, "squareness_xy": 9.0, "probe_lobing": float(np.hypot(0.5, 0.3))})


def test_diameter_and_roundness_of_the_example_are_those_of_a_circle_fitted_by_scipy() -> None:
    rows = np.genfromtxt(ROOT / "examples" / JOB / "recording.csv", delimiter=",", names=True)
    first = rows[(rows["measurement"] == 1) & (rows["repeat"] == 1)]
    xy = np.column_stack([first["x_mm"], first["y_mm"]])
    fit = least_squares(lambda p: np.linalg.norm(xy - p[:2], axis=1) - p[2], [*xy.mean(axis=0), 25.0], xtol=1e-15)
    _, points, form, size = table(JOB, "Diameter and roundness").rows[0]
    assert points == str(len(first))
    assert float(form) == pytest.approx(np.ptp(fit.fun) * 1e3, abs=0.006)
    assert float(size.replace("−", "-")) == pytest.approx((2 * fit.x[2] - 50.0013) * 1e3, abs=0.011)


@pytest.mark.usefixtures("no_regions", "no_diagnosis")
@pytest.mark.parametrize(("form", "outcome"), [("form_um = 0.2", "pass"), ("", "undecided")])
def test_squareness_passes_by_no_ring_of_unknown_form(form: str, outcome: str, tmp_path: Path) -> None:
    shutil.copytree(ROOT / "examples" / JOB, tmp_path / "job")
    text = (tmp_path / "job" / "job.toml").read_text(encoding="utf-8").replace("form_um = 0.2", form)
    text = text.replace("[test_un", "tolerances = { squareness_xy = 25.0 }\n\n[test_un").split("[[conformity]]")[0]
    (tmp_path / "job" / "job.toml").write_text(text, encoding="utf-8")
    (verdict,) = analyse(tmp_path / "job").verdicts
    assert verdict.outcome == outcome
    assert [str(text) for text in verdict.missing] == ([] if form else ["The form of the ring is not stated"])
