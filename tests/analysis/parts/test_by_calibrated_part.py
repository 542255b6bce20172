"""A calibrated part measured again and again: by hand, and beside the virtual measurement of the same part."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.analysis.parts.by_calibrated_part import Calibrated, Warmth, by_calibrated_part
from cmm_uq.analysis.parts.of_temperature import Expansion, Surroundings
from cmm_uq.analysis.parts.plan import Characteristic, Plan
from cmm_uq.analysis.parts.virtual import AtPose, Circumstances
from cmm_uq.base.errors import CmmUqError
from tests.parts_drawn import POSE, machine, spot

CYCLES = np.repeat(np.arange(10), 2)
REPEATS = 50 + 1e-3 * np.tile([1.0, 3.0], 10)
"""Ten at +1 µm and ten at +3 µm: b = 2 µm, s = √(20/19) µm."""


def test_by_hand() -> None:
    """U = 2 √(u_cal² + u_p² + u_b² + u_w²), with u_b = l |t − 20 °C| u_α and u_w of the part's own u_α and form."""
    known = Calibrated(50.0, 0.5e-3, 0.3e-3, expanding_mm=50.0)
    found = by_calibrated_part("d", REPEATS, CYCLES, known, Warmth(22.0, 1e-6, 2e-6), measured=50.010)
    u = 1e-3 * np.sqrt(20 / 19 + 0.25 + 0.09 + 0.1**2 + 0.2**2)
    assert found.systematic == pytest.approx(2e-3)
    assert found.u == pytest.approx(u)
    assert pytest.approx(2 * u) == found.U
    assert found.value == pytest.approx(50.008)
    assert found.scatter == pytest.approx(1e-3 * np.sqrt(20 / 19))
    assert found.scatter_dof == 19


def test_a_systematic_error_that_is_not_corrected_is_added_and_stays_in_the_value() -> None:
    known = Calibrated(50.004, 0.5e-3)
    found = by_calibrated_part("d", REPEATS, CYCLES, known, measured=50.010, corrected=False)
    assert found.systematic == pytest.approx(-2e-3)
    assert pytest.approx(2 * found.u + 2e-3) == found.U
    assert found.value == pytest.approx(50.010)


def test_an_angle_is_in_rad_and_does_not_expand() -> None:
    known = Calibrated(0.5, 1e-6, angle=True)
    found = by_calibrated_part("a", 0.5 + 1e-6 * np.tile([1.0, 3.0], 10), CYCLES, known, Warmth(30.0, 1e-5, 1e-5))
    assert found.angle
    assert found.u == pytest.approx(1e-6 * np.sqrt(20 / 19 + 1))


def test_it_sees_what_repeats_vary_and_as_a_systematic_error_what_they_keep() -> None:
    """One machine of a scale error of 8 ppm, and temperatures that differ from set-up to set-up by 0.3 K."""
    plan = Plan((spot("o", [0, 0, 0]), spot("x", [300, 0, 0])), (Characteristic("l", "distance", ("o", "x")),))
    warm = Surroundings(Expansion(11.5e-6, u_temperature_k=0.3))
    at = AtPose(plan, Circumstances(machine(["scale_x"], [[8.0]], 0.5, corrected=False), (POSE,), warm), POSE)
    n = 4000
    errors = at.errors(at.drawn(np.random.default_rng(1), n))[:, 0]
    found = by_calibrated_part("l", 300 + errors, np.arange(n), Calibrated(300.0, 0.2e-3))
    assert found.systematic == pytest.approx(-300 * 8e-6, rel=0.03)
    assert found.scatter == pytest.approx(np.hypot(300 * 11.5e-6 * 0.3, 0.5e-3 * np.sqrt(2)), rel=0.03)


@pytest.mark.parametrize(("count", "cycles", "u", "words"), [
    (19, 10, 1e-3, "19 measurements in 10 set-ups"), (20, 9, 1e-3, "20 measurements in 9 set-ups"),
    (20, 10, 0.0, "no uncertainty"),
])  # fmt: skip
def test_what_does_not_do(count: int, cycles: int, u: float, words: str) -> None:
    with pytest.raises(CmmUqError, match=words):
        by_calibrated_part("d", np.linspace(50, 50.01, count), np.arange(count) % cycles, Calibrated(50.0, u))
