"""A calibrated part measured again and again: by hand, and beside the virtual measurement of the same part."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.errors import CmmUqError
from cmm_uq.parts.calibrated import by_calibrated_part
from cmm_uq.parts.of_temperature import Expansion, Surroundings
from cmm_uq.parts.plan import Characteristic, Plan
from cmm_uq.parts.virtual import AtPose, Circumstances
from tests.parts_drawn import POSE, machine, spot

CYCLES = np.repeat(np.arange(10), 2)


def test_by_hand() -> None:
    """Ten at +1 µm and ten at +3 µm: bias 2 µm, s = √(20/19) µm."""
    repeats = 50 + 1e-3 * np.tile([1.0, 3.0], 10)
    found = by_calibrated_part(repeats, CYCLES, 50.0, 0.5e-3, u_part=0.3e-3, corrected=False)
    u = 1e-3 * np.sqrt(20 / 19 + 0.25 + 0.09)
    assert found.bias == pytest.approx(2e-3)
    assert found.u == pytest.approx(u)
    assert pytest.approx(2 * u + 2e-3) == found.U
    assert pytest.approx(2 * u) == by_calibrated_part(repeats, CYCLES, 50.0, 0.5e-3, u_part=0.3e-3).U


def test_it_sees_what_repeats_vary_and_as_a_bias_what_they_keep() -> None:
    """One machine of a scale error of 8 ppm, and temperatures that differ from set-up to set-up by 0.3 K."""
    plan = Plan((spot("o", [0, 0, 0]), spot("x", [300, 0, 0])), (Characteristic("l", "distance", ("o", "x")),))
    warm = Surroundings(Expansion(11.5e-6, u_temperature_k=0.3))
    at = AtPose(plan, Circumstances(machine(["scale_x"], [[8.0]], 0.5, corrected=False), (POSE,), warm), POSE)
    n = 4000
    errors = at.errors(at.drawn(np.random.default_rng(1), n))[:, 0]
    found = by_calibrated_part(300 + errors, np.arange(n), 300.0, 0.2e-3)
    assert found.bias == pytest.approx(-300 * 8e-6, rel=0.03)
    assert found.u_procedure == pytest.approx(np.hypot(300 * 11.5e-6 * 0.3, 0.5e-3 * np.sqrt(2)), rel=0.03)


@pytest.mark.parametrize(("count", "u", "words"), [
    (19, 1e-3, "19 measurements in 10 set-ups are too few"), (20, 0.0, "no uncertainty"),
])  # fmt: skip
def test_what_does_not_do(count: int, u: float, words: str) -> None:
    with pytest.raises(CmmUqError, match=words):
        by_calibrated_part(np.full(count, 50.0), CYCLES[:count], 50.0, u)
