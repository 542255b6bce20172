from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.machine.physics.error_map import AxisErrors, ErrorMap, read_error_map
from cmm_uq.machine.physics.map_interpolation import ErrorMaps

HARRIS = Path(__file__).parent / "harris2004"
TABLE_7 = {20: (-173, -19, 21), 25: (-178, -4, 42), 30: (-172, -20, 1)}


def published(*temperatures: int) -> ErrorMaps:
    return ErrorMaps(
        [
            read_error_map(HARRIS / f"error_map_{t}C.csv", temperature=t).with_squareness_arcsec(*TABLE_7[t])
            for t in temperatures
        ]
    )


def somewhere(n: int, seed: int = 1):
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(0, 900, n), rng.uniform(0, 550, n), rng.uniform(-500, 0, n)])


def by_hand(error_map: ErrorMap, readings):
    """The same by numpy.interp."""
    return np.stack(
        [
            np.stack([np.interp(readings[:, i], c.positions, column) for column in c.errors.T], axis=1)
            for i, c in enumerate(error_map.axes)
        ],
        axis=1,
    )


def test_between_positions_it_is_linear():
    maps, readings = published(20), somewhere(500)
    np.testing.assert_allclose(maps.at(readings).errors, by_hand(maps.maps[0], readings), atol=1e-16)


def test_at_a_position_it_is_the_table():
    maps = published(20)
    looked_up = maps.at(np.array([[900.0, 550, -500], [0, 0, 0], [625, 225, -250]]))
    for i in range(3):
        np.testing.assert_allclose(looked_up.errors[0, i], maps.maps[0].axes[i].errors[-1 if i < 2 else 0], atol=1e-18)
    np.testing.assert_allclose(looked_up.errors[2, 0], maps.maps[0].axes[0].errors[25], atol=1e-18)


@pytest.mark.parametrize("temperature", [20.0, 22.0, 25.0, 27.5, 30.0])
def test_between_temperatures_the_two_maps_that_enclose_it_count(temperature):
    maps, readings = published(20, 25, 30), somewhere(50)
    low = 1 if temperature > 25 else 0
    share = (temperature - maps.temperatures[low]) / 5
    expected = (1 - share) * by_hand(maps.maps[low], readings) + share * by_hand(maps.maps[low + 1], readings)
    for given in (temperature, np.full(3, temperature), np.full((50, 3), temperature)):
        looked_up = maps.at(readings, given)
        np.testing.assert_allclose(looked_up.errors, expected, atol=1e-16)
        s = (1 - share) * maps.maps[low].squareness + share * maps.maps[low + 1].squareness
        np.testing.assert_allclose(np.broadcast_to(looked_up.squareness, (50, 3)), np.tile(s, (50, 1)), rtol=1e-12)


def test_each_carriage_is_at_the_temperature_of_its_own_scale():
    maps, readings = published(20, 25, 30), somewhere(20)
    looked_up = maps.at(readings, np.array([20.0, 25.0, 30.0]))
    for i in range(3):
        np.testing.assert_allclose(looked_up.errors[:, i], by_hand(maps.maps[i], readings)[:, i], atol=1e-16)
    mean = maps.maps[1].squareness
    np.testing.assert_allclose(looked_up.squareness, mean, rtol=1e-12)


def test_temperatures_may_differ_from_point_to_point():
    maps, readings = published(20, 25, 30), somewhere(40)
    temperatures = np.random.default_rng(2).uniform(20, 30, (40, 3))
    one_by_one = [maps.at(readings[i : i + 1], temperatures[i]).errors[0] for i in range(40)]
    np.testing.assert_allclose(maps.at(readings, temperatures).errors, one_by_one, atol=1e-16)


def test_maps_with_other_positions_are_brought_together_without_loss():
    def carriage(positions, slope):
        p = np.array(positions, dtype=float)
        return AxisErrors(p, np.outer(p * slope, np.ones(6)))

    cold = ErrorMap(tuple(carriage([0, 40, 100], 1e-5) for _ in range(3)), temperature=20)
    hot = ErrorMap(tuple(carriage([-10, 30, 70, 90], 3e-5) for _ in range(3)), temperature=30)
    maps = ErrorMaps([hot, cold])
    assert maps.span("y") == (0.0, 90.0)
    assert maps.at(np.array([[55.0, 5, 90]]), 25.0).errors[0, :, 0] == pytest.approx([55 * 2e-5, 5 * 2e-5, 90 * 2e-5])


def test_beyond_the_map_is_refused_with_axis_and_line_or_marked():
    maps, readings = published(20), np.array([[450.0, 200, -100], [912.5, 200, -100]])
    with pytest.raises(CmmUqError, match=r"line 14: x reads 912\.5 mm, the error map reaches from 0 to 900 mm"):
        maps.at(readings, lines=np.array([13, 14]))
    looked_up = maps.at(readings, beyond="extrapolate")
    assert looked_up.extrapolated.tolist() == [False, True]
    x = maps.maps[0].axes[0]
    expected = x.errors[-1] + 0.5 * (x.errors[-1] - x.errors[-2])
    np.testing.assert_allclose(looked_up.errors[1, 0], expected, atol=1e-16)


def test_a_temperature_out_of_the_calibrated_span_is_refused_or_marked():
    maps, readings = published(20, 25, 30), somewhere(3)
    with pytest.raises(CmmUqError, match=r"a scale is at .* the error maps are from 20 to 30 °C"):
        maps.at(readings, np.array([22.0, 33.0, 22.0]))
    looked_up = maps.at(readings, np.array([22.0, 35.0, 22.0]), beyond="extrapolate")
    assert looked_up.extrapolated.all()
    b, c = by_hand(maps.maps[1], readings)[:, 1], by_hand(maps.maps[2], readings)[:, 1]
    np.testing.assert_allclose(looked_up.errors[:, 1], c + (c - b), atol=1e-16)


def test_within_a_kelvin_of_the_span_the_nearest_map_holds():
    maps, readings = published(20, 25), somewhere(5)
    np.testing.assert_allclose(maps.at(readings, 19.4).errors, by_hand(maps.maps[0], readings), atol=1e-16)
    np.testing.assert_allclose(published(20).at(readings, 20.7).errors, by_hand(maps.maps[0], readings), atol=1e-16)
    with pytest.raises(CmmUqError, match="the error maps are from 20 to 20"):
        published(20).at(readings, 24.0)


def test_several_maps_need_a_temperature():
    with pytest.raises(CmmUqError, match="the scales' temperatures are not known"):
        published(20, 25).at(somewhere(2))


def test_what_is_no_number_is_never_looked_up():
    with pytest.raises(CmmUqError, match="y reads nan mm"):
        published(20).at(np.array([[1.0, np.nan, -3.0]]))
    with pytest.raises(CmmUqError, match="a scale is at"):
        published(20, 25).at(somewhere(1), np.array([22.0, np.nan, 22.0]))


def test_two_maps_at_one_temperature_contradict_each_other():
    with pytest.raises(CmmUqError, match="two error maps at 20 °C"):
        ErrorMaps([published(20).maps[0]] * 2)
    with pytest.raises(CmmUqError, match="no error map"):
        ErrorMaps([])
