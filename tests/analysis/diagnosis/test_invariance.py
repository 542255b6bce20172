"""A diagnosis is of the recording: order of rows, numbers, direction of axes and origin change nothing that is said."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import Phase, given, settings, strategies as st

from cmm_uq.analysis.diagnosis.comparison.explanations import covariates
from cmm_uq.analysis.diagnosis.diagnosis import Diagnosis, diagnose
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.base.points import Machine, Points
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from tests.recordings import TRAVEL, bar_facts, bars, with_columns

NAMED = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")


@cache
def recording(gap_um: float = 24.0) -> Points:
    """Eight bars twice, with backlash of X."""
    random = np.random.default_rng(1)
    once = bars(random, 8, 400.0, Machine("m", "XYZ", TRAVEL))
    n = 2 * len(once)
    points = Points(
        np.tile(once.xyz, (2, 1)), np.tile(once.measurement, 2), np.tile(once.point, 2),
        np.repeat([1, 2], len(once)), once.machine,
    )  # fmt: skip
    points = with_columns(points, time_s=60.0 * np.arange(n), approach_x=random.choice([-1.0, 1.0], n))
    model = RecordingModel(Ballbar(bar_facts(), points), effects(("hysteresis_x",)))
    return points.at(model.simulate(np.array([gap_um]), np.array([400.0]), Noise(1.5e-3), random))


def diagnosed(points: Points) -> Diagnosis:
    return diagnose(RecordingModel(Ballbar(bar_facts(), points), effects(NAMED)), stated_um=1.5, alpha=0.01, seed=0)


@cache
def plainly() -> Diagnosis:
    return diagnosed(recording())


def in_order(points: Points, order: np.ndarray[tuple[int], np.dtype[np.int64]]) -> Points:
    return Points(
        points.xyz[order], points.measurement[order], points.point[order], points.repeat[order], points.machine,
        {name: values[order] for name, values in points.columns.items()},
    )  # fmt: skip


@pytest.mark.long
@settings(max_examples=2, deadline=None, phases=[Phase.generate])
@given(st.randoms(use_true_random=False))
def test_order_of_rows_numbers_and_origin_change_no_figure(random: object) -> None:
    """A p-value is printed with two digits, all else with no more than four."""
    rng = np.random.default_rng(random.getrandbits(32))  # type: ignore[attr-defined]
    points = recording()
    numbers = rng.permutation(50)[:8]
    shift = rng.uniform(-500, 500, 3)
    changed = replace(
        points, xyz=points.xyz - shift, measurement=numbers[points.measurement - 1], point=3 - points.point,
        machine=replace(points.machine, origin_mm=shift),
    )  # fmt: skip
    found, plain = diagnosed(in_order(changed, rng.permutation(len(points)))), plainly()
    assert found.verdict == plain.verdict
    assert found.p_value == pytest.approx(plain.p_value, rel=2e-3)
    assert [item.effect for item in found.effects] == [item.effect for item in plain.effects] == ["hysteresis_x"]
    (one,), (other,) = ([item.parameters["gap_um"] for item in d.effects] for d in (found, plain))
    assert (one.value, one.u) == pytest.approx((other.value, other.u), rel=1e-4)
    assert found.improvement.elpd_gain == pytest.approx(plain.improvement.elpd_gain, rel=1e-4)
    assert [w.what for w in found.where] == [w.what for w in plain.where]


@pytest.mark.long
def test_a_mirrored_axis_changes_no_verdict_and_no_figure_that_is_printed() -> None:
    """Steps between the same places are tried from the other end: probabilities differ in their third digit at most."""
    points = recording()
    travel = np.array([[-900.0, 0.0], *TRAVEL[1:]])
    mirrored = replace(
        points, xyz=points.xyz * [-1, 1, 1], machine=Machine("m", "XYZ", travel),
        columns={**points.columns, "approach_x": -points.columns["approach_x"]},
    )  # fmt: skip
    found, plain = diagnosed(mirrored), plainly()
    assert found.verdict == plain.verdict
    assert found.p_value == pytest.approx(plain.p_value, rel=0.05)
    (one,), (other,) = found.effects, plain.effects
    assert one.effect == other.effect
    assert one.probability == pytest.approx(other.probability, abs=0.005)
    assert one.parameters["gap_um"].value == pytest.approx(other.parameters["gap_um"].value, rel=1e-4)


@pytest.mark.long
@pytest.mark.parametrize(("factor", "start"), [(1.0, 1.7e9), (60.0, 0.0)], ids=["epoch", "minutes"])
def test_a_clock_that_started_long_ago_or_counts_in_minutes_changes_no_verdict(factor: float, start: float) -> None:
    """Of a backlash of 24 µm, far from the rate: where times differ in their last digit, other shapes of slow noise stand for
    all, and of one of 12 µm the p-value is 0.001 or 0.01.
    """
    points = recording(24.0)
    plain = diagnosed(points)
    found = diagnosed(with_columns(points, time_s=factor * points.columns["time_s"] + start))
    assert found.verdict == plain.verdict == "explained"
    (one,), (other,) = found.effects, plain.effects
    assert one.effect == other.effect
    assert one.parameters["gap_um"].value == pytest.approx(other.parameters["gap_um"].value, rel=1e-3)


def test_without_a_time_the_order_of_rows_is_no_covariate() -> None:
    """With one it is the order of time, however the rows are sorted."""
    points = recording()
    uneven = with_columns(points, time_s=points.columns["time_s"] ** 2)
    last_first = in_order(uneven, np.arange(len(points))[::-1])
    untimed = replace(points, columns={"approach_x": points.columns["approach_x"]})
    models = [RecordingModel(Ballbar(bar_facts(), each), effects(NAMED)) for each in (uneven, last_first, untimed)]
    plain, turned, without = (covariates(model) for model in models)
    assert "order" not in without
    np.testing.assert_array_equal(np.sort(plain["order"]), np.arange(len(points) // 2))
    np.testing.assert_array_equal(turned["order"], plain["order"][::-1])
