"""The smooth errors of the axes: their waves, what they do to points, and their families."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.base.points import Points
from cmm_uq.machine.model.field import ALLOWED, FAMILIES, WAVES, AxisFunction, allowed, bounded, curves, family_of
from cmm_uq.machine.physics.catalogue import EVERY
from cmm_uq.machine.physics.effect import Family
from tests.parts_drawn import MACHINE

RANDOM = np.random.default_rng(2)
XYZ = RANDOM.uniform([0, 0, -500], [900, 550, 0], (40, 3))
COUNT = np.arange(1, 41)
POINTS = Points(XYZ, COUNT, COUNT, np.ones(40, dtype=np.int64), MACHINE, {})


def curve(name: str, *, long: bool = True) -> AxisFunction:
    effect = EVERY[name]
    assert isinstance(effect, Family)
    return AxisFunction(effect, long=long)


def test_a_machine_has_eighteen_functions_of_long_and_of_short_waves() -> None:
    """Three positions, six straightnesses, nine rotations (VDI/VDE 2617-3); squarenesses are numbers."""
    names = [one.name for one in curves()]
    assert len(names) == 2 * 18
    assert len(set(names)) == 18
    assert {one.family for one in curves()} | {"periodic", "play"} == set(FAMILIES)


@pytest.mark.parametrize("name", ["scale_curvature_y", "straightness_y_z", "rotation_y_x"])
def test_long_and_short_waves_together_have_the_size_that_physics_allows(name: str) -> None:
    """Over the travel: waves are orthogonal there, each with the mean square ½·2."""
    parts = curve(name), curve(name, long=False)
    assert sum(len(one.coefficients) for one in parts) == WAVES
    squares = sum(c.prior_sd**2 for one in parts for c in one.coefficients)
    assert np.sqrt(squares) == pytest.approx(ALLOWED[parts[0].kind])
    assert np.hypot(*(allowed(one.family)[0] for one in parts)) == pytest.approx(ALLOWED[parts[0].kind])
    sd = [c.prior_sd for one in parts for c in one.coefficients]
    np.testing.assert_allclose(np.array(sd) * np.arange(1, WAVES + 1), sd[0])


def test_a_wave_moves_points_across_by_its_cosine() -> None:
    """By hand: half way through the travel of x the first wave is zero, the second −√2 µm."""
    middle = POINTS.at(np.where(np.arange(3) == 0, 450.0, XYZ))
    moved = curve("straightness_x_z").basis(middle)
    np.testing.assert_allclose(moved[:, 2], np.tile([0.0, -np.sqrt(2) * 1e-3], (40, 1)), atol=1e-15)
    assert not moved[:, :2].any()


def test_a_rotation_turns_what_its_carriage_carries() -> None:
    """As the rotation of the catalogue, whose angle grows with the travel, where that has the same angle."""
    low, high = MACHINE.travel("y")
    plain = EVERY["rotation_y_x"].basis(POINTS)[:, :, 0] / ((XYZ[:, [1]] - low) / 1000)
    waves = np.sqrt(2) * np.cos(np.pi * (XYZ[:, [1]] - low) / (high - low) * np.array([[1, 2]]))
    np.testing.assert_allclose(curve("rotation_y_x").basis(POINTS), plain[:, :, None] * waves[:, None, :], atol=1e-12)


def test_effects_know_their_family() -> None:
    found = {name: family_of(EVERY[name]) for name in ("scale_x", "hysteresis_y", "periodic_scale_z", "rotation_x_x")}
    assert found == {
        "scale_x": None,
        "hysteresis_y": "play",
        "periodic_scale_z": "periodic",
        "rotation_x_x": "rotation",
    }
    assert family_of(curve("rotation_x_x", long=False)) == "rotation short"


def test_a_bound_is_what_ninety_five_of_a_hundred_do_not_exceed() -> None:
    """Of a gap by the normal quantile 1.96; of an amplitude by Rayleigh's distribution, √(−2·ln 0.05) = 2.448."""
    gap, wave = bounded(EVERY["hysteresis_x"], 2.0), bounded(EVERY["periodic_scale_y"], 0.5)
    assert gap.coefficients[0].prior_sd == pytest.approx(2.0 / 1.959964)
    assert [one.prior_sd for one in wave.coefficients] == pytest.approx([0.5 / 2.447747] * 2)
    assert (family_of(gap), family_of(wave)) == (None, None)
    assert EVERY["hysteresis_x"].coefficients[0].prior_sd == 30.0
