"""Residuals as vectors: each observation shows what it saw, by exact constructions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.analysis.diagnosis.location import ResidualField, residual_field
from cmm_uq.artefacts import artefact_facts, artefact_of
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.base.units import unit
from cmm_uq.machine.model import MeasurementModel
from cmm_uq.maths.uncertainty.quantity import Quantity
from tests.artefacts.constructions import plate, spheres, step_gauge
from tests.recordings import TRAVEL, bar_facts, bars

BARS = bars(np.random.default_rng(4), 12, 400.0, Machine("m", "XYZ", TRAVEL, origin_mm=np.array([100.0, 50.0, -20.0])))


def field(facts: object, points: Points) -> ResidualField:
    """Of a model without effects, exactly certified."""
    model = MeasurementModel(artefact_of(facts, points), ())  # type: ignore[arg-type]
    found = residual_field(model, model)
    assert found is not None
    return found


def test_a_bar_found_too_long_points_outwards_by_half_of_it_at_either_end() -> None:
    """The third bar by 4 µm; vectors stand at the scale readings of its ends."""
    xyz = BARS.xyz.copy()
    way = xyz[5] - xyz[4]
    xyz[5] += 4e-3 * way / 400.0
    found = field(bar_facts(u_um=0.0), BARS.at(xyz))
    lengths = np.linalg.norm(found.before, axis=1)
    assert lengths[4:6] == pytest.approx([2.0, 2.0], abs=1e-5)
    assert np.delete(lengths, [4, 5]) == pytest.approx(np.zeros(22), abs=1e-5)
    np.testing.assert_allclose(found.before[5], 2.0 * way / 400.0, atol=1e-4)
    np.testing.assert_allclose(found.before[4], -2.0 * way / 400.0, atol=1e-4)
    np.testing.assert_allclose(found.place, BARS.at(xyz).machine_xyz)
    assert found.lengths
    assert found.scale == pytest.approx(np.full(24, np.sqrt(0.5)))  # half of √2


def test_a_ball_of_a_plate_shows_all_three_coordinates() -> None:
    """One of twenty-five moves by 10 µm: rigid placing takes up 1/25 and the turn that goes with it, all others little."""
    points = plate([(0.0, 0.0, 0.0)])
    xyz, off = points.xyz.copy(), np.array([6e-3, 0.0, 8e-3])
    xyz[12] += off  # in the middle: no turn follows
    found = field(artefact_facts(kind="plate", length_mm=400.0, u_um=0.0), points.at(xyz))
    np.testing.assert_allclose(found.before[12], 1e3 * off * 24 / 25, atol=1e-4)
    np.testing.assert_allclose(np.delete(found.before, 12, axis=0), np.tile(-1e3 * off / 25, (24, 1)), atol=1e-4)
    assert found.dimensions.tolist() == [3] * 25
    assert not found.lengths


def test_a_face_shows_its_line_and_a_probed_point_its_normal_and_no_other_direction() -> None:
    gauge = step_gauge(lines=((1, 0, 0), (0, 1, 1)))
    off = np.random.default_rng(2).normal(0, 1e-3, gauge.xyz.shape)
    found = field(artefact_facts(kind="step_gauge", length_mm=420.0, u_um=0.0), gauge.at(gauge.xyz + off))
    along = np.where(gauge.measurement[:, None] == 1, [1.0, 0.0, 0.0], [0.0, np.sqrt(0.5), np.sqrt(0.5)])
    across = found.before - np.einsum("ni,ni->n", found.before, along)[:, None] * along
    assert np.abs(found.before).max() > 0.5
    assert np.abs(across).max() < 1e-4
    assert set(found.dimensions.tolist()) == {1}
    ball = spheres(places=1)
    normal = np.column_stack([ball.columns[f"n{a}"] for a in "xyz"])
    found = field(artefact_facts(kind="sphere", length_mm=25.0, u_um=0.0), ball.at(ball.xyz + 2e-3 * normal))
    # 2 µm all around, less what least squares takes up by shifting the ball, of which only one half was probed
    left = 2.0 - normal @ np.linalg.lstsq(normal, np.full(25, 2.0), rcond=None)[0]
    np.testing.assert_allclose(found.before, left[:, None] * normal, atol=1e-3)
    assert set(found.dimensions.tolist()) == {1}


def test_a_vector_is_longer_than_its_u_in_one_case_of_twenty() -> None:
    """χ² for 95 %: 3.841, 5.991, 7.815 for one, two, three directions (tables); √F with few degrees of freedom."""
    exact = Quantity(2.0, 0.0, (2.0, 2.0), unit("µm"))
    some = ResidualField(
        np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3)), np.array([1.0, 1.0, 0.5]), np.array([1, 2, 3]), False
    )
    assert some.expanded(exact) == pytest.approx(2.0 * np.sqrt([3.841459, 5.991465, 7.814728]) * [1, 1, 0.5], rel=1e-6)
    # ½(value/u)² = 10 degrees of freedom: t = 2.228139, and F(2, 10) = 4.102821, F(3, 10) = 3.708265
    known = Quantity(2.0, 2.0 / np.sqrt(20.0), (1.0, 3.0), unit("µm"))
    wanted: Floats = 2.0 * np.sqrt([2.228139**2, 2 * 4.102821, 3 * 3.708265]) * [1, 1, 0.5]
    assert some.expanded(known) == pytest.approx(wanted, rel=1e-6)


def test_only_what_is_used_is_drawn_and_the_model_after_is_its_own() -> None:
    used = np.ones(12, dtype=bool)
    used[3] = False
    model = MeasurementModel(artefact_of(bar_facts(u_um=0.0), BARS), (), used=used)
    found = residual_field(model, replace(model, sigma=1.0))
    assert found is not None
    assert len(found.place) == 22
    np.testing.assert_array_equal(found.before, found.after)
