"""Errors of points where they are known: scales, expansion, and motions that all points have in common."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.analysis.parts.displaced import displaced
from cmm_uq.analysis.parts.of_temperature import Expansion, Surroundings
from cmm_uq.analysis.parts.placing import Pose
from cmm_uq.analysis.parts.plan import Characteristic, Plan
from cmm_uq.analysis.parts.virtual import Circumstances, Virtual
from tests.parts_drawn import POSE, machine, spot

ENDS = Plan(
    (spot("one", [0, 0, 0]), spot("other", [300, 0, 0])), (Characteristic("apart", "distance", ("one", "other")),)
)
TURNED = Pose(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([400.0, 100.0, -300.0]))


@pytest.mark.parametrize(("scale", "pose"), [("scale_x", POSE), ("scale_y", TURNED)])
def test_a_scale_stretches_the_part_about_its_middle(scale: str, pose: Pose) -> None:
    """10 ppm of 300 mm are 3 µm, half at either end and against each other; in the frame of the part along its x."""
    draws = 10.0 * np.random.default_rng(1).standard_normal((4000, 1))
    found = displaced(Virtual(ENDS, Circumstances(machine([scale], draws), (pose,))))
    u = 1e3 * np.sqrt(np.einsum("nii->ni", found.covariance))
    np.testing.assert_allclose(u, [[1.5, 0, 0], [1.5, 0, 0]], atol=0.06)
    np.testing.assert_allclose(found.mean, 0, atol=2e-4)


def test_readings_keep_what_is_not_common() -> None:
    """Noise of 2 µm in x of both ends: √2 µm is left of each about their mean; in y and z a shift and a turn take all."""
    found = displaced(Virtual(ENDS, Circumstances(machine(noise_um=2.0), (POSE,))))
    u = 1e3 * np.sqrt(np.einsum("nii->ni", found.covariance.clip(0)))
    np.testing.assert_allclose(u, [[np.sqrt(2), 0, 0]] * 2, atol=0.07)


def test_a_warm_part_that_is_not_corrected_is_found_larger() -> None:
    """Steel at 25 °C over 300 mm: 11.5e-6 · 5 · 300 mm = 17.25 µm, outwards at either end."""
    warm = Surroundings(Expansion(11.5e-6, temperature_c=25.0, corrected=False))
    found = displaced(Virtual(ENDS, Circumstances(machine(), (POSE,), warm)), 10)
    np.testing.assert_allclose(1e3 * found.mean, [[-8.625, 0, 0], [8.625, 0, 0]], atol=1e-9)
    np.testing.assert_allclose(found.covariance, 0, atol=1e-15)


def test_where_the_part_was_measured_is_no_error_of_it() -> None:
    measured = ENDS.points + np.array([[0.0, 0, 0], [0.05, 0.02, 0]])
    found = displaced(Virtual(ENDS, Circumstances(machine(), (POSE,), measured=measured)), 10)
    np.testing.assert_allclose(found.mean, 0, atol=1e-12)
