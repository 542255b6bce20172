"""The smooth errors of the axes: their waves, what they do to points, and their families."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.base.points import Points
from cmm_uq.machine.model.field import (
    ALLOWED,
    FAMILIES,
    WAVES,
    AxisFunction,
    _waves,
    allowed,
    bounded,
    curves,
    family_of,
)
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
    """Over the travel, the root mean square of what the coefficients make beforehand; of each family its part."""
    parts, low, high = (curve(name), curve(name, long=False)), *MACHINE.travel("y")
    at = low + (high - low) * (np.arange(20_000) + 0.5) / 20_000
    ones = np.ones(len(at), dtype=np.int64)
    line = Points(np.column_stack([0 * at, at, 0 * at - 300.0]), ones, np.arange(len(at)), ones, MACHINE)
    unit_of = (
        EVERY[name].basis(line)[:, :, 0] / ((at - low) / 1000)[:, None]
        if "rotation" in name
        else 1e-3 * np.ones((1, 3))
    )
    across = np.abs(unit_of).sum(axis=0).argmax() if "rotation" in name else {"y_z": 2}.get(name[-3:], 1)
    squares = []
    for one in parts:
        moved = one.basis(line)[:, across] / unit_of[:, [across]]
        squares.append(np.mean(moved**2, axis=0) @ [c.prior_sd**2 for c in one.coefficients])
        assert allowed(one.family)[0] == pytest.approx(np.sqrt(squares[-1]), rel=1e-6)
    assert np.sqrt(sum(squares)) == pytest.approx(ALLOWED[parts[0].kind], rel=1e-6)
    sd = [c.prior_sd for one in parts for c in one.coefficients][parts[0].forms :]
    assert len(sd) == WAVES
    np.testing.assert_allclose(np.array(sd) * np.arange(1, WAVES + 1), sd[0])


def test_a_wave_moves_points_across_by_its_cosine() -> None:
    """By hand: half way through the travel of x the bow is −½·√5, the first wave zero, the second −√2 µm."""
    middle = POINTS.at(np.where(np.arange(3) == 0, 450.0, XYZ))
    moved = curve("straightness_x_z").basis(middle)
    by_hand = [-0.5e-3 * np.sqrt(5), 0.0, -np.sqrt(2) * 1e-3]
    np.testing.assert_allclose(moved[:, 2], np.tile(by_hand, (40, 1)), atol=1e-15)
    assert not moved[:, :2].any()


def test_a_wave_has_slopes_at_the_ends_of_the_travel() -> None:
    """By hand: √2·cos(πk/10) at its beginning and, with the sign of (−1)^k, at its end; its slope."""
    ends, k = POINTS.at(np.column_stack([np.repeat([0.0, 9e-4, 900.0], 1), np.zeros((3, 2))])), np.array([1, 2])
    moved = curve("straightness_x_z").basis(ends)[:, 2, 1:] * 1e3
    np.testing.assert_allclose(moved[0], np.sqrt(2) * np.cos(np.pi * k / 10))
    np.testing.assert_allclose(moved[2], (-1.0) ** k * moved[0])
    np.testing.assert_allclose(
        (moved[1] - moved[0]) / 1e-6, -np.sqrt(2) * 0.8 * np.pi * k * np.sin(np.pi * k / 10), rtol=1e-4
    )


def test_a_rotation_turns_what_its_carriage_carries() -> None:
    """As the rotation of the catalogue, whose angle grows with the travel, where that has the same angle."""
    low, high = MACHINE.travel("y")
    place = (XYZ[:, [1]] - low) / (high - low)
    plain = EVERY["rotation_y_x"].basis(POINTS)[:, :, 0] / ((XYZ[:, [1]] - low) / 1000)
    waves = np.sqrt(2) * np.cos(np.pi * (place + 0.125) / 1.25 * np.array([[1, 2]]))
    forms = [np.sqrt(5) * (6 * place**2 - 6 * place + 1), np.sqrt(3) * (2 * place - 1)]
    turned = np.hstack([*forms, waves])
    np.testing.assert_allclose(curve("rotation_y_x").basis(POINTS), plain[:, :, None] * turned[:, None, :], atol=1e-12)


@pytest.mark.parametrize("name", ["scale_curvature_y", "straightness_y_z", "rotation_y_x"])
def test_the_simplest_form_of_an_error_is_one_of_its_functions(name: str) -> None:
    """But for a constant: a displacement as a whole, or a turn. Waves alone are 5 % of it off, and more at the ends."""
    simplest, columns = EVERY[name].basis(POINTS)[:, :, 0], curve(name).basis(POINTS)
    low, _ = MACHINE.travel("y")
    whole = simplest / (XYZ[:, [1]] - low) if "rotation" in name else np.ones_like(simplest) * np.any(simplest, axis=0)
    forms = np.concatenate([columns[:, :, : 1 + ("rotation" in name)], whole[:, :, None]], axis=2).reshape(
        simplest.size, -1
    )
    left = simplest.ravel() - forms @ np.linalg.lstsq(forms, simplest.ravel(), rcond=None)[0]
    assert np.abs(left).max() < 1e-12 * np.abs(simplest).max()


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


def test_many_waves_are_those_of_each_reading() -> None:
    """Of parts of a turn and what is left of it, as far as the angle itself is exact; in extended precision beside it."""
    readings, periods = np.random.default_rng(1).uniform(-600, 1200, 3000), np.array([0.53, 8.0, 970.0])
    angle = 2 * np.pi * readings.astype(np.longdouble)[:, None] / periods
    exact = 1e-3 * np.stack([np.sin(angle), np.cos(angle)], axis=2).reshape(len(readings), -1)
    one_by_one = np.concatenate([_waves(readings[i : i + 100], periods) for i in range(0, 3000, 100)])
    off, before = (np.abs(found - exact).max() for found in (_waves(readings, periods), one_by_one))
    assert off < 1e-3 * 2**-52 * 2 * np.pi * 1200 / 0.53
    assert off < 2 * before
