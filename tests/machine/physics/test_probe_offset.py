"""US 4,866,643 claim 1, step by step."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.machine.physics.compensation import offset_plane

CONTACTS = np.array([[0.0, 0, 5], [40, 0, 5], [40, 30, 5], [0, 30, 5], [20, 15, 5]])


def test_the_plane_moves_by_the_probe_offset_away_from_the_direction_point():
    above = offset_plane(np.array([0.0, 0, 8]), CONTACTS, 2.0, u_point=1e-3)
    assert above.normal.tolist() == [0, 0, 1]
    assert above.point[2] == pytest.approx(3.0)
    assert not above.reversed


def test_a_normal_into_the_material_is_reversed():
    below = offset_plane(np.array([0.0, 0, 1]), CONTACTS, 2.0, u_point=1e-3)
    assert below.normal.tolist() == [0, 0, -1]
    assert below.point[2] == pytest.approx(7.0)
    assert below.reversed
    assert below.angle == pytest.approx(0)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("tilt", [0.0, 30.0, 59.0])
def test_directions_within_the_range_of_acceptance_are_believed(tilt, side):
    approach = np.array([np.sin(np.radians(tilt)), 0, side * np.cos(np.radians(tilt))])
    found = offset_plane(CONTACTS[0] + 3 * approach, CONTACTS, 1.0, u_point=1e-3)
    assert np.degrees(found.angle) == pytest.approx(tilt, abs=1e-6)
    assert found.point[2] == pytest.approx(5 - side)


@pytest.mark.parametrize("tilt", [61.0, 80.0, 89.9, 90.1, 119.0])
def test_directions_between_the_range_of_acceptance_and_90_degrees_are_rejected(tilt):
    approach = np.array([np.sin(np.radians(tilt)), 0, np.cos(np.radians(tilt))])
    with pytest.raises(CmmUqError, match=r"direction point is rejected.*Measure the direction point again"):
        offset_plane(CONTACTS[0] + 3 * approach, CONTACTS, 1.0, u_point=1e-3)


def test_the_range_of_acceptance_can_be_narrowed():
    direction = CONTACTS[0] + np.array([np.sin(0.5), 0, np.cos(0.5)])
    offset_plane(direction, CONTACTS, 1.0, acceptance=0.51, u_point=1e-3)
    with pytest.raises(CmmUqError, match="rejected"):
        offset_plane(direction, CONTACTS, 1.0, acceptance=0.49, u_point=1e-3)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_covariance_is_that_of_drawn_planes(side):
    rng = np.random.default_rng(6)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    contacts, direction = CONTACTS @ turn, (CONTACTS[0] + [0.3, 0.2, side * 3]) @ turn
    drawn = []
    for _ in range(3000):
        touched = contacts + rng.normal(scale=2e-3, size=(5, 1)) * turn[2]
        found = offset_plane(direction, touched, rng.normal(10.0, 3e-3), u_offset=3e-3, u_point=2e-3)
        drawn.append([*(found.point - found.contact.point.mean()), *found.normal])
        drawn[-1][:3] = found.point
    spread = np.cov(drawn, rowvar=False)
    # variances from 3000 draws have a relative standard uncertainty of 2.6 %
    np.testing.assert_allclose(np.diag(spread), np.diag(found.covariance), rtol=0.13)
    np.testing.assert_allclose(spread, found.covariance, atol=0.1 * np.abs(spread).max())


@pytest.mark.parametrize(
    ("direction", "contacts", "options", "message"),
    [
        ([0, 0, 8.0], CONTACTS[:2], {}, "2 points are too few. Measure at least 3"),
        ([0, 0, 8.0], np.outer(np.arange(4.0), [1, 1, 0]), {}, "lie on one line"),
        ([0, 0, 5.0], CONTACTS, {}, "the direction point is the first point of contact"),
        ([0, 0, 8.0], CONTACTS, {"offset": 0.0}, "a probe offset of 0.0 mm"),
        ([0, 0, 8.0], CONTACTS, {"acceptance": np.pi / 2}, "a range of acceptance of 90°"),
    ],
)
def test_what_cannot_be_compensated_is_refused(direction, contacts, options, message):
    with pytest.raises(CmmUqError, match=message):
        offset_plane(np.array(direction), contacts, **{"offset": 1.0, "u_point": 1e-3} | options)
