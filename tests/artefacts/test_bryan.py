"""Bryan gauge: a bar swept about a ball that nobody measures."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.bryan import Bryan
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Points
from cmm_uq.maths.geometry import fit_sphere
from tests.artefacts.constructions import estimated, free, indicated, swept
from tests.artefacts.simulated import SQUARE, analysed, outcome, results

BAR = artefact_facts(kind="bryan", length_mm=400.0, u_um=0.5)
EXACT = artefact_facts(kind="bryan", length_mm=400.0)
UNKNOWN = artefact_facts(kind="bryan")
SIX = ["scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx"]
TRUTH = [100.0, -60.0, 20.0, 30.0, -12.0, 80.0]


@pytest.mark.parametrize("everywhere", [False, True])
def test_the_joint_fit_recovers_centre_and_errors_exactly(everywhere: bool) -> None:
    points = indicated(BAR, swept(everywhere=everywhere), SIX, TRUTH)
    found = estimated(BAR, points, SIX)
    np.testing.assert_allclose(found.value, [*TRUTH, 400.0], atol=1e-8)
    assert np.abs(found.residuals).max() < 1e-11


def test_an_uncalibrated_bar_leaves_one_scale_common_to_axes_and_bar() -> None:
    points = indicated(UNKNOWN, swept(), SIX, TRUTH, size=400.02, sigma=1e-3)
    found = estimated(UNKNOWN, points, SIX)
    (combination,) = free(found)
    expected = {"scale_x": 1, "scale_y": 1, "scale_z": 1, "artefact": found.value[-1] * 1e-6}
    assert combination == pytest.approx(expected, rel=1e-8)
    assert found.value[3:6] == pytest.approx(TRUTH[3:], abs=5 * float(np.sqrt(np.diag(found.covariance)[3:6]).max()))


def test_the_centre_of_a_perfect_machine_is_that_of_a_sphere_fit() -> None:
    """Second method: the geometry room's orthogonal distance fit of centre and radius."""
    points = indicated(UNKNOWN, swept(), [], [], sigma=2e-3, seed=1)
    ball = fit_sphere(points.xyz)
    found = estimated(UNKNOWN, points, [], sigma=None)
    assert found.value[0] == pytest.approx(ball.radius, abs=1e-9)
    assert np.sqrt(found.covariance[0, 0]) == pytest.approx(ball.u("r"), rel=1e-4)


def test_two_steps_lose_what_the_centre_takes_up() -> None:
    """Swept over half a sphere, 80″ of ZX become mostly a shift of the centre; the joint fit keeps them."""
    points = indicated(EXACT, swept(), ["squareness_zx"], [80.0])
    two_steps, _ = Bryan(EXACT, points).in_two_steps()
    assert estimated(EXACT, points, SIX).value[5] == pytest.approx(80.0, abs=1e-8)
    assert 15 < two_steps.factors[5] < 40
    assert two_steps.residual_sd > 5e-3


def test_two_steps_are_right_when_the_sweep_is_even_about_the_fixed_ball() -> None:
    """Every position and its opposite: the centre cannot move; second order apart, both ways agree."""
    half = swept(40, everywhere=True)
    middle = np.array([450.0, 275.0, -250.0])
    even = Points(
        np.vstack([half.xyz, 2 * middle - half.xyz]), np.arange(1, 81), np.ones(80, dtype=np.int64),
        np.ones(80, dtype=np.int64), half.machine,
    )  # fmt: skip
    two_steps, _ = Bryan(EXACT, indicated(EXACT, even, SIX, TRUTH)).in_two_steps()
    np.testing.assert_allclose(two_steps.factors[3:], TRUTH[3:], atol=0.05)
    np.testing.assert_allclose(two_steps.factors[:3], TRUTH[:3], atol=0.3)


@pytest.mark.long
def test_intervals_cover_the_truth_as_often_as_they_say() -> None:
    inside, points = 0, swept()
    for seed in range(200):
        found = estimated(EXACT, indicated(EXACT, points, SIX, TRUTH, sigma=1e-3, seed=seed), SIX)
        off = found.value[:6] - TRUTH
        inside += off @ np.linalg.solve(found.covariance[:6, :6], off) < 12.592  # χ²(6), 95 %
    assert 180 <= inside <= 198  # binomial(200, 0.95): outside with probability 0.3 %


def flat(points: Points) -> Points:
    return points.at(points.xyz * [1, 1, 0])


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (flat, "60 points lie in one plane"),
        (lambda p: p.select(p.measurement <= 3), "3 points are too few"),
        (lambda p: p.at(np.repeat(p.xyz[:1], 60, axis=0)), "lie in one plane"),
        (
            lambda p: Points(p.xyz, p.measurement, p.point + 1, p.repeat, p.machine, {}, p.lines),
            "line 2.*has a point 2",
        ),
        (lambda p: p.at(p.xyz / 25.4), "look like inches"),
    ],
)
def test_a_recording_that_is_none_of_a_swept_bar_is_refused(spoil: object, message: str) -> None:
    assert callable(spoil)
    with pytest.raises(CmmUqError, match=message):
        Bryan(BAR, spoil(swept()))


JOB = "bryan-simulated"


def test_scales_are_not_determined_by_either_way_without_a_certified_length() -> None:
    factors = results(JOB)["distance_equations"]["factors"]
    assert analysed(JOB).free == {"scale_x", "scale_y", "scale_z", "artefact"}
    for name in ("scale_x", "scale_y", "scale_z"):
        assert factors[name]["ppm"] == {"value": None, "u": None, "U": None, "k": None}
    assert outcome(JOB).document is not None


@pytest.mark.parametrize("name", SQUARE)
def test_u_holds_the_bias_of_the_centre(name: str) -> None:
    """Positions above the fixed ball alone: 3″ to 5″ of the squarenesses with Z go into its centre, beside u = 0.7″."""
    found = results(JOB)["distance_equations"]["factors"][name]["angle_arcsec"]
    fitted = results(JOB)["estimates"][name]["angle_arcsec"]["value"]
    assert abs(found["value"] - SQUARE[name]) < found["U"]
    assert found["u"] == pytest.approx(np.hypot(0.706, found["value"] - fitted), rel=0.1)
