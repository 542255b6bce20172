"""Ballbar: the distance of two balls, wherever and whichever way the bar lies."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.spatial.transform import Rotation

from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import artefact_facts, kind_of
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Points
from tests.artefacts.constructions import MACHINE, estimated, free, indicated
from tests.conftest import ROOT
from tests.recordings import bar_facts, bars, with_columns

SIX = ["scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx"]
BAR = bar_facts()


def placed(count: int = 40, seed: int = 20) -> Points:
    return bars(np.random.default_rng(seed), count, 400.0, MACHINE)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000))
def test_no_placing_changes_the_length(seed: int) -> None:
    random = np.random.default_rng(seed)
    points = placed(12)
    turned = Rotation.random(rng=random).apply(points.xyz) + random.uniform(-1000, 1000, 3)
    np.testing.assert_allclose(Ballbar(BAR, points.at(turned)).lengths(), 400.0, atol=1e-10)


def test_indications_are_measured_minus_certified() -> None:
    """Every bar 4 µm too long by hand: pulled apart along itself by 1 in 10⁵."""
    points = placed()
    middle = points.group_means(points.xyz)
    found = Ballbar(BAR, points.at(middle + (points.xyz - middle) * (1 + 1e-5))).indications()
    assert found is not None
    np.testing.assert_allclose(found.errors, 4e-3, atol=1e-10)
    assert found.u.tolist() == [0.5e-3] * 40
    assert Ballbar(bar_facts(None), points).indications() is None


@pytest.mark.parametrize(
    ("extra", "values"),
    [
        (["rotation_x_z", "rotation_y_x", "rotation_x_x"], [400.0, -300.0, 200.0]),
        (["straightness_x_y", "straightness_y_x", "straightness_z_x"], [150.0, -90.0, 200.0]),
        (["thermal_scale_x", "thermal_artefact", "thermal_gradient"], [2.5e-5, 1.2e-5, 30.0]),
        (["hysteresis_x", "drift_z"], [60.0, 30.0]),
    ],
)
def test_large_errors_of_every_kind_are_recovered_exactly(extra: list[str], values: list[float]) -> None:
    points = placed(60)
    n, random = len(points), np.random.default_rng(4)
    points = with_columns(
        points, temp_x_c=20 + np.linspace(-4, 6, n), temp_artefact_c=np.repeat(20 + np.linspace(3, -2, n // 2) ** 2 / 3, 2),
        temp_table_top_c=20 + random.normal(size=n), temp_table_bottom_c=20 + random.normal(size=n),
        time_s=random.permutation(n) * 60.0, approach_x=random.choice([-1.0, 1.0], n),
    )  # fmt: skip
    names, truth = SIX + extra, [300.0, -200.0, 100.0, 173.0, -400.0, 50.0, *values]
    found = estimated(BAR, indicated(BAR, points, names, truth), names)
    scale = np.array([u.scale for u in found.unknowns])
    np.testing.assert_allclose((found.value[:-1] - truth) / scale[:-1], 0, atol=1e-8)
    assert np.abs(found.residuals).max() < 1e-10


def test_an_uncalibrated_bar_leaves_one_common_scale_free() -> None:
    combinations = free(estimated(bar_facts(None), placed(), SIX))
    assert [sorted(c) for c in combinations] == [["artefact", "scale_x", "scale_y", "scale_z"]]
    np.testing.assert_allclose([combinations[0][s] for s in SIX[:3]], 1.0, rtol=1e-9)


def test_parallel_bars_tell_the_scale_along_them_only() -> None:
    points = placed()
    middle = np.repeat(points.xyz.reshape(-1, 2, 3).mean(axis=1), 2, axis=0)
    along_x = points.at(middle + np.tile([[-200.0, 0, 0], [200.0, 0, 0]], (40, 1)))
    assert sorted(next(iter(c)) for c in free(estimated(BAR, along_x, SIX))) == sorted(SIX[1:])


def test_sag_looks_like_the_scales_of_x_and_y() -> None:
    """cos² of the elevation is (dX² + dY²)/L²: 1 µm of sag on 400 mm is −2.5 ppm of X and of Y, exactly."""
    (combination,) = free(estimated(BAR, placed(), [*SIX, "artefact_sag"]))
    sag = combination.pop("artefact_sag")
    assert {effect: part / sag for effect, part in combination.items()} == pytest.approx(
        {"scale_x": -2.5, "scale_y": -2.5}
    )


def test_a_warm_bar_of_known_expansion_is_brought_to_20_degrees() -> None:
    """Steel, 11.5 ppm/K, 24 °C at one ball and 22 °C at the other: 34.5 ppm longer on the mean."""
    points = placed()
    middle = points.group_means(points.xyz)
    warm = with_columns(
        points.at(middle + (points.xyz - middle) * (1 + 34.5e-6)), temp_artefact_c=np.tile([24.0, 22.0], 40)
    )
    facts = artefact_facts(kind="ballbar", length_mm=400.0, u_um=0.5, cte_per_k=11.5e-6)
    np.testing.assert_allclose(Ballbar(facts, warm).lengths(), 400.0, atol=1e-10)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (
            lambda p: p.select(np.arange(len(p)) != 5),
            "line 6: measurement 3, repeat 1 has no point 2: a bar with one end",
        ),
        (lambda p: Points(p.xyz, p.measurement, p.point + 1, p.repeat, p.machine), "has no point 1"),
        (lambda p: p.at(np.where(p.measurement[:, None] == 4, 1.0, p.xyz)), "both ends of the bar lie in one place"),
        (lambda p: p.at(p.xyz / 1000), "look like metres"),
        (lambda p: p.at(p.xyz * 1.02), "they differ by 20 mm/m"),
    ],
)
def test_a_recording_that_is_none_of_a_bar_is_refused(spoil: object, message: str) -> None:
    assert callable(spoil)
    with pytest.raises(CmmUqError, match=message):
        Ballbar(BAR, spoil(placed()))


@pytest.mark.parametrize(
    "job", ["iota-1102-20C", "optical-ballbar-simulated", "step-gauge-simulated", "sphere-simulated"]
)
def test_of_points_that_all_move_along_one_direction_the_same_is_seen(job: str) -> None:
    """By fewer steps, as of points that move anyhow."""
    read = read_job(ROOT / "examples" / job)
    artefact = kind_of(read).observing("measured")(read.facts.artefact, read.points)
    xyz = artefact.points.xyz
    moved = np.random.default_rng(5).standard_normal((len(xyz), 3))
    direction = np.array([0.6, -0.64, 0.48])
    seen = artefact.project(xyz, direction[:, None] * moved[:, None])
    np.testing.assert_allclose(artefact.project_along(xyz, direction, moved), seen, atol=1e-12)
    assert np.abs(seen).max() > 0.1
