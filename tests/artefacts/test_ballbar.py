"""A ballbar: lengths of two balls, and recordings that are none."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.errors import CmmUqError
from cmm_uq.jobs.job import ArtefactFacts
from cmm_uq.points import Points
from tests.recordings import bar_facts, with_columns


def test_lengths_are_distances_of_the_balls(ballbar_points: Points) -> None:
    np.testing.assert_allclose(Ballbar(bar_facts(), ballbar_points).lengths(), 400.0, rtol=1e-14)


def test_rows_may_come_in_any_order(ballbar_points: Points) -> None:
    order = np.random.default_rng(1).permutation(len(ballbar_points))
    shuffled = Ballbar(bar_facts(), ballbar_points.select(order))
    assert sorted(shuffled.measurement) == list(range(1, 41))
    np.testing.assert_allclose(shuffled.lengths(), 400.0, rtol=1e-14)


def test_a_stated_expansion_brings_lengths_to_20_degrees(ballbar_points: Points) -> None:
    """A steel bar of 400 mm at 25 °C is 23 µm longer."""
    warm = with_columns(ballbar_points, temp_artefact_c=np.full(len(ballbar_points), 25.0))
    facts = ArtefactFacts(kind="ballbar", length_mm=400.0, u_um=0.5, cte_per_k=11.5e-6)
    np.testing.assert_allclose(Ballbar(facts, warm).lengths(), 400.0 / (1 + 11.5e-6 * 5), rtol=1e-14)
    placed = Ballbar(facts, warm).fit(warm.xyz, np.array([400.0])).reshape(-1, 2, 3)
    np.testing.assert_allclose(np.linalg.norm(placed[:, 1] - placed[:, 0], axis=1), 400.023, atol=1e-9)


def test_a_placed_bar_keeps_middle_and_direction(ballbar_points: Points) -> None:
    bar = Ballbar(bar_facts(), ballbar_points)
    placed = bar.fit(ballbar_points.xyz, np.array([401.0])).reshape(-1, 2, 3)
    given = ballbar_points.xyz.reshape(-1, 2, 3)
    np.testing.assert_allclose(placed.mean(axis=1), given.mean(axis=1), atol=1e-12)
    np.testing.assert_allclose(np.cross(placed[:, 1] - placed[:, 0], given[:, 1] - given[:, 0]), 0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(placed[:, 1] - placed[:, 0], axis=1), 401.0, rtol=1e-14)


def test_the_change_of_a_length_is_its_derivative(ballbar_points: Points) -> None:
    """Against central differences of the lengths themselves."""
    random = np.random.default_rng(2)
    step = 1e-4 * random.standard_normal((len(ballbar_points), 3))
    bar = Ballbar(bar_facts(), ballbar_points)
    after, before = (Ballbar(bar_facts(), ballbar_points.at(ballbar_points.xyz + s * step)).lengths() for s in (1, -1))
    np.testing.assert_allclose(
        bar.project(ballbar_points.xyz, step[:, :, None])[:, 0], (after - before) / 2, atol=1e-12
    )


def test_a_certified_bar_has_errors_of_indication_and_another_has_none(ballbar_points: Points) -> None:
    found = Ballbar(bar_facts(399.99), ballbar_points).indications()
    assert found is not None
    np.testing.assert_allclose(found.errors, 0.01, atol=1e-10)
    assert Ballbar(bar_facts(None), ballbar_points).indications() is None


def test_a_bar_with_one_end_is_refused_with_its_line(ballbar_points: Points) -> None:
    with pytest.raises(CmmUqError, match=r"bar.csv line 6: measurement 3, repeat 1 has no point 2: a bar with one end"):
        Ballbar(bar_facts(), ballbar_points.select(np.arange(len(ballbar_points)) != 5), where="bar.csv")


def test_a_bar_with_three_balls_is_refused(ballbar_points: Points) -> None:
    number = ballbar_points.measurement.copy()
    point = ballbar_points.point.copy()
    number[2], point[2] = 1, 3
    spoiled = Points(ballbar_points.xyz, number, point, ballbar_points.repeat, ballbar_points.machine)
    with pytest.raises(CmmUqError, match=r"measurement 1, repeat 1 has points \[1, 2, 3\]"):
        Ballbar(bar_facts(), spoiled)


def test_two_balls_in_one_place_are_refused(ballbar_points: Points) -> None:
    xyz = ballbar_points.xyz.copy()
    xyz[5] = xyz[4]
    with pytest.raises(CmmUqError, match=r"line 6: both ends of the bar lie in one place"):
        Ballbar(bar_facts(), ballbar_points.at(xyz), where="bar.csv")


@pytest.mark.parametrize(("factor", "unit"), [(1e-3, "metres"), (1 / 25.4, "inches"), (1e3, "micrometres")])
def test_a_wrong_unit_is_recognised(ballbar_points: Points, factor: float, unit: str) -> None:
    with pytest.raises(CmmUqError, match=f"look like {unit}, not mm"):
        Ballbar(bar_facts(), ballbar_points.at(ballbar_points.xyz * factor))


def test_another_bar_is_recognised(ballbar_points: Points) -> None:
    with pytest.raises(CmmUqError, match="the recording belongs to this artefact"):
        Ballbar(bar_facts(500.0), ballbar_points)
