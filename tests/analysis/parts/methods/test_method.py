"""A calibrated part measured again and again: by hand, and beside the virtual measurement of the same part.

A part in several orientations with standards beside it: exact constructions, and machines with a known truth.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.analysis.parts.causes.surroundings import Expansion, Surroundings
from cmm_uq.analysis.parts.methods.method import (
    CalibratedCharacteristic,
    CalibratedStandard,
    CalibratedStandards,
    PartWarmth,
    Slopes,
    Warmth,
    by_calibrated_part,
    by_orientations,
)
from cmm_uq.analysis.parts.methods.of_job import sensitivities
from cmm_uq.analysis.parts.plan import PartCharacteristic, Plan, Stylus
from cmm_uq.analysis.parts.virtual import AtPose, MeasurementConditions
from cmm_uq.base.errors import CmmUqError
from tests.parts_drawn import POSE, block, bore, machine, plane, spot

CYCLES = np.repeat(np.arange(10), 2)
REPEATS = 50 + 1e-3 * np.tile([1.0, 3.0], 10)  # ten at +1 µm and ten at +3 µm: b = 2 µm, s = √(20/19) µm


def test_by_hand() -> None:
    """U = 2 √(u_cal² + u_p² + u_b² + u_w²), with u_b = l |t − 20 °C| u_α and u_w of the part's own u_α and form."""
    known = CalibratedCharacteristic(50.0, 0.5e-3, 0.3e-3, expanding_mm=50.0)
    found = by_calibrated_part("d", REPEATS, CYCLES, known, Warmth(22.0, 1e-6, 2e-6), measured=50.010)
    u = 1e-3 * np.sqrt(20 / 19 + 0.25 + 0.09 + 0.1**2 + 0.2**2)
    assert found.systematic == pytest.approx(2e-3)
    assert found.u == pytest.approx(u)
    assert pytest.approx(2 * u) == found.U
    assert found.value == pytest.approx(50.008)
    assert found.scatter == pytest.approx(1e-3 * np.sqrt(20 / 19))
    assert found.scatter_dof == 19


def test_a_systematic_error_that_is_not_corrected_is_added_and_stays_in_the_value() -> None:
    known = CalibratedCharacteristic(50.004, 0.5e-3)
    found = by_calibrated_part("d", REPEATS, CYCLES, known, measured=50.010, corrected=False)
    assert found.systematic == pytest.approx(-2e-3)
    assert pytest.approx(2 * found.u + 2e-3) == found.U
    assert found.value == pytest.approx(50.010)


def test_an_angle_is_in_rad_and_does_not_expand() -> None:
    known = CalibratedCharacteristic(0.5, 1e-6, angle=True)
    found = by_calibrated_part("a", 0.5 + 1e-6 * np.tile([1.0, 3.0], 10), CYCLES, known, Warmth(30.0, 1e-5, 1e-5))
    assert found.angle
    assert found.u == pytest.approx(1e-6 * np.sqrt(20 / 19 + 1))


def test_it_sees_what_repeats_vary_and_as_a_systematic_error_what_they_keep() -> None:
    """One machine of a scale error of 8 ppm, and temperatures that differ from set-up to set-up by 0.3 K."""
    plan = Plan((spot("o", [0, 0, 0]), spot("x", [300, 0, 0])), (PartCharacteristic("l", "distance", ("o", "x")),))
    warm = Surroundings(Expansion(11.5e-6, u_temperature_k=0.3))
    at = AtPose(plan, MeasurementConditions(machine(["scale_x"], [[8.0]], 0.5, corrected=False), (POSE,), warm), POSE)
    n = 4000
    errors = at.errors(at.drawn(np.random.default_rng(1), n))[:, 0]
    found = by_calibrated_part("l", 300 + errors, np.arange(n), CalibratedCharacteristic(300.0, 0.2e-3))
    assert found.systematic == pytest.approx(-300 * 8e-6, rel=0.03)
    assert found.scatter == pytest.approx(np.hypot(300 * 11.5e-6 * 0.3, 0.5e-3 * np.sqrt(2)), rel=0.03)


@pytest.mark.parametrize(("count", "cycles", "u", "words"), [
    (19, 10, 1e-3, "19 measurements in 10 set-ups"), (20, 9, 1e-3, "20 measurements in 9 set-ups"),
    (20, 10, 0.0, "no uncertainty"),
])  # fmt: skip
def test_what_does_not_do(count: int, cycles: int, u: float, words: str) -> None:
    with pytest.raises(CmmUqError, match=words):
        by_calibrated_part(
            "d", np.linspace(50, 50.01, count), np.arange(count) % cycles, CalibratedCharacteristic(50.0, u)
        )


OF = np.repeat(np.arange(4), 5)  # four orientations, five repeats
G = 1e-3 * np.array([3.0, -1.0, -4.0, 2.0])[OF]
E = 1e-3 * np.tile([-2.0, -1, 0, 1, 2], 4)  # errors of orientations and repeats that add up to nothing, mm
MEAN_U = 1e-3 * np.sqrt((9 + 1 + 16 + 4) / 3 / 4)  # standard deviation of the orientations' means over √4, mm


def standard(size: float, error: float, u: float = 0.5e-3, **more: object) -> CalibratedStandard:
    """A standard that is read too large by ``error``, with nothing that scatters but what adds up to nothing."""
    return CalibratedStandard(size, u, size + error + 0.1 * E, OF, **more)  # type: ignore[arg-type]


def test_the_mean_and_its_uncertainty_by_hand() -> None:
    found = by_orientations("l", 200 + G + E, OF, Slopes(0.0, {}), CalibratedStandards())
    assert found.value == pytest.approx(200.0)
    assert found.u == pytest.approx(MEAN_U)
    assert found.budget.dof == pytest.approx(3)
    assert found.budget.k == pytest.approx(3.182, abs=1e-3)  # Student's t, JCGM 100:2008, table G.2
    s_within = 1e-3 * np.sqrt(4 * 10 / 16)
    assert found.scatter == pytest.approx(np.sqrt(4 * MEAN_U**2 + 0.8 * s_within**2))
    assert found.single == pytest.approx(found.scatter)


def test_a_scale_and_a_tip_that_are_wrong_are_taken_out() -> None:
    """All coordinates 10 ppm too large and the tip 4 µm: a bore of 20 mm is 0.2 − 4 µm off, a shaft's width 0.2 + 4 µm."""
    scale, tip = 10e-6, 4e-3
    ring = standard(30.0, 30 * scale - tip, inner=True)
    standards = CalibratedStandards(standard(500.0, 500 * scale), {"s": ring})
    assert standards.scale == pytest.approx(scale)
    assert standards.tip("s") == pytest.approx(tip)
    assert CalibratedStandards(standards.length, {"s": standard(30.0, 30 * scale + tip)}).tip("s") == pytest.approx(tip)
    for slope in (-1.0, 1.0):
        read = 20 * (1 + scale) + slope * tip
        found = by_orientations("d", read + G + E, OF, Slopes(20.0, {"s": slope}), standards)
        assert found.value == pytest.approx(20.0, abs=1e-9)
        assert found.systematic == pytest.approx(20 * scale + slope * tip)


def test_uncertainties_of_standards_and_temperature_go_in_by_their_slopes() -> None:
    """A bore of 20 mm by a ring of 30 mm: the length standard is left with its part in 30 mm less 20 mm."""
    ring = standard(30.0, 0.0, 0.4e-3, inner=True)
    bar = standard(500.0, 0.0, 0.9e-3, temperature_c=22.0, u_cte_per_k=1e-6)
    warm = PartWarmth(21.0, 0.1, 12e-6, 2e-6)
    found = by_orientations("d", 20 + G + E, OF, Slopes(20.0, {"s": -1.0}), CalibratedStandards(bar, {"s": ring}), warm)
    repeats = 0.1 * 1e-3 * np.sqrt(4 * 10 / 16) / np.sqrt(20)
    by_bar = (20 - 30) / 500 * np.sqrt(0.9e-3**2 + repeats**2 + (500 * 2 * 1e-6) ** 2)
    own = 20 * np.array([1.0 * 2e-6, 12e-6 * 0.1])
    assert found.u == pytest.approx(np.sqrt(MEAN_U**2 + 0.4e-3**2 + repeats**2 + by_bar**2 + own @ own))


def test_a_bore_compared_with_a_ring_of_its_size_needs_no_length_standard() -> None:
    ring = standard(20.0, 0.0, 0.4e-3, inner=True)
    coarse = by_orientations(
        "d", 20 + G + E, OF, Slopes(20.0, {"s": -1.0}), CalibratedStandards(standard(500.0, 0.0, 1.0), {"s": ring})
    )
    none = by_orientations("d", 20 + G + E, OF, Slopes(20.0, {"s": -1.0}), CalibratedStandards(None, {"s": ring}))
    assert coarse.u == pytest.approx(none.u)


def test_a_characteristic_that_a_tip_does_not_move_is_not_corrected_for_it() -> None:
    tips = {"s": standard(30.0, 4e-3)}
    found = by_orientations("x", 20 + G + E, OF, Slopes(20.0, {"s": 0.0}), CalibratedStandards(None, tips))
    assert found.systematic == 0
    assert found.u == pytest.approx(MEAN_U)


def test_one_measurement_is_less_sure_than_the_mean_by_what_scatters() -> None:
    bar = standard(500.0, 0.0, 5e-3)
    found = by_orientations("l", 200 + G + E, OF, Slopes(200.0, {}), CalibratedStandards(bar))
    apart = found.u**2 - MEAN_U**2
    assert found.single == pytest.approx(np.sqrt(found.scatter**2 + apart))


def test_how_characteristics_follow_scale_and_tip() -> None:
    """A length is in proportion to the scale; a larger tip makes bores small and lengths over two faces large."""
    features, characteristics = block()
    found = sensitivities(Plan(features, characteristics))
    scale = dict(zip([one.name for one in characteristics], found.scale.tolist(), strict=True))
    tip = dict(zip([one.name for one in characteristics], found.tips["stylus"].tolist(), strict=True))
    assert scale["d1"] == pytest.approx(20, rel=1e-6)
    assert scale["apart"] == pytest.approx(np.hypot(140, 20), rel=1e-6)
    assert scale["length"] == pytest.approx(200, rel=1e-6)
    assert scale["corner"] == pytest.approx(0, abs=1e-6)
    assert tip["d1"] == pytest.approx(-1, rel=1e-6)
    assert tip["length"] == pytest.approx(1, rel=1e-6)
    assert tip["apart"] == pytest.approx(0, abs=1e-6)
    assert tip["position 1"] == pytest.approx(0, abs=1e-6)


def test_a_tip_moves_what_it_probes_alone() -> None:
    features = (
        bore("h", [0, 0, 0], 10.0, stylus="one"),
        plane("A", [0, 0, 1], [0, 0, 0], [[9, 0, 0], [0, 9, 0]], stylus="two"),
    )
    plan = Plan(features, (PartCharacteristic("d", "size", ("h",)),), (Stylus("one"), Stylus("two")))
    found = sensitivities(plan)
    assert found.tips["one"] == pytest.approx([-1.0], rel=1e-6)
    assert found.tips["two"] == pytest.approx([0.0], abs=1e-9)


@pytest.mark.long
def test_intervals_hold_where_each_orientation_has_errors_of_its_own() -> None:
    """2000 machines with a scale, a tip and errors of orientations that nobody knows: 95 % intervals hold 93 to 97 %."""
    random, held, n = np.random.default_rng(3), 0, 2000
    for _ in range(n):
        scale, tip, of_bar, of_ring = random.normal(0, [5e-6, 1e-3, 1e-3, 0.2e-3])

        def read(size: float, slope: float, scale: float = scale, tip: float = tip) -> np.ndarray:
            own = random.normal(0, 1e-3, 4)[OF] + random.normal(0, 0.7e-3, 20)
            return np.asarray(size * (1 + scale) + slope * tip + own)

        bar = CalibratedStandard(500.0, 1e-3, read(500.0 + of_bar, 0.0), OF)
        ring = CalibratedStandard(30.0, 0.2e-3, read(30.0 + of_ring, -1.0), OF, inner=True)
        found = by_orientations(
            "l", read(200.0, 1.0), OF, Slopes(200.0, {"s": 1.0}), CalibratedStandards(bar, {"s": ring})
        )
        held += abs(found.value - 200.0) <= found.U  # type: ignore[operator]
    assert 0.93 <= held / n <= 0.97
    assert replace(found, corrected=False).U > found.U
