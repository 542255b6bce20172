"""Figures of ISO 230-2: a published report to its digits, the formulas written out in loops, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.maths.geometry.positioning import MissingReadingError, PositioningRuns

TARGETS = [-10.0, -4.88, 0.24, 5.36, 10.48]
FORWARD = """-10.00008102 -10.00010202 -10.00008702 -10.00009202 -10.00010002
-4.88008702 -4.88009702 -4.88009702 -4.88009502 -4.88008202
0.23992798 0.23990998 0.23991198 0.23991298 0.23991298
5.35989798 5.35991398 5.35991398 5.35990698 5.35992198
10.47989998 10.47988798 10.47987098 10.47989098 10.47990298"""
BACKWARD = """-10.00009902 -10.00009402 -10.00008202 -10.00009102 -10.00009402
-4.88010302 -4.88010402 -4.88009502 -4.88011102 -4.88009302
0.23991398 0.23989798 0.23990898 0.23992398 0.23990098
5.35992798 5.35990798 5.35990498 5.35989698 5.35991898
10.47989598 10.47987398 10.47986998 10.47985898 10.47989298"""
"""Actual positions, mm, of github.com/paulscherrerinstitute/ecmccfg at 072a917e, examples/test/fat_sat/report.md, of 2023."""


def of(x: np.ndarray) -> PositioningRuns:
    """Deviations (d, t, n) in another order than they are evaluated in."""
    d, t, n = x.shape
    side, target, repeat = (each.ravel() for each in np.indices(x.shape))
    order = np.random.default_rng(d * t * n).permutation(x.size)
    at = 100.0 * target[order] + 5.0
    sides = np.array([1.0, -1.0])[side[order]]
    return PositioningRuns.of(at, sides, repeat[order] + 1, x.ravel()[order])


@pytest.fixture
def published() -> PositioningRuns:
    actual = np.array(
        [[[float(v) for v in line.split()] for line in part.splitlines()] for part in (FORWARD, BACKWARD)]
    )
    return of(1e6 * (actual - np.array(TARGETS)[None, :, None]))  # nm


def test_a_published_report_comes_out_to_its_digits(published: PositioningRuns) -> None:
    figures = published.figures()
    expected = {"B": 12.2, "mean B": 5.4, "E↑": 24.6, "E↓": 33.0, "M": 27.7, "R↑": 50.33, "R↓": 62.9, "A↑": 64.28, "A↓": 88.81,
                "A": 88.81}  # fmt: skip
    for name, value in expected.items():
        digits = len(str(value).partition(".")[2])
        assert round(figures[name], digits) == pytest.approx(value, abs=1e-9), name
    assert published.mean[0] == pytest.approx([-92.42, -91.62, -84.82, -89.02, -109.42], abs=5e-3)
    assert published.s[1] == pytest.approx([6.28, 7.29, 10.43, 12.18, 15.73], abs=5e-3)
    assert published.reversal == pytest.approx([-0.4, 9.6, 6.0, -0.4, 12.2], abs=5e-2)


def test_where_that_report_leaves_the_standard_the_standard_is_kept(published: PositioningRuns) -> None:
    """It prints R = 62.90, the larger of both directions, and E = 24.6, that of one; of its own R_i the largest is 68.82."""
    assert published.figures()["R"] == pytest.approx(68.82, abs=5e-3)
    assert published.figures()["E"] == pytest.approx(-84.82 + 121.62, abs=1e-6)


def by_loops(x: np.ndarray) -> dict[str, float]:
    """ISO 230-2:2014, 3 and 4, written out; x[0] in the positive, x[1] in the negative direction."""
    m, n = x.shape[1:]
    up, down = [sum(x[0, i]) / n for i in range(m)], [sum(x[1, i]) / n for i in range(m)]
    s_up = [(sum((v - up[i]) ** 2 for v in x[0, i]) / (n - 1)) ** 0.5 for i in range(m)]
    s_down = [(sum((v - down[i]) ** 2 for v in x[1, i]) / (n - 1)) ** 0.5 for i in range(m)]
    B = [up[i] - down[i] for i in range(m)]
    both = [(up[i] + down[i]) / 2 for i in range(m)]
    R = [max(2 * s_up[i] + 2 * s_down[i] + abs(B[i]), 4 * s_up[i], 4 * s_down[i]) for i in range(m)]
    highest = max(max(up[i] + 2 * s_up[i], down[i] + 2 * s_down[i]) for i in range(m))
    lowest = min(min(up[i] - 2 * s_up[i], down[i] - 2 * s_down[i]) for i in range(m))
    return {
        "E↑": max(up) - min(up), "E↓": max(down) - min(down), "R↑": max(4 * s for s in s_up), "R↓": max(4 * s for s in s_down),
        "A↑": max(up[i] + 2 * s_up[i] for i in range(m)) - min(up[i] - 2 * s_up[i] for i in range(m)),
        "A↓": max(down[i] + 2 * s_down[i] for i in range(m)) - min(down[i] - 2 * s_down[i] for i in range(m)),
        "B": max(map(abs, B)), "mean B": sum(B) / m, "M": max(both) - min(both), "R": max(R), "A": highest - lowest,
        "E": max(*up, *down) - min(*up, *down),
    }  # fmt: skip


@pytest.mark.parametrize("seed", range(20))
def test_every_figure_is_what_the_formulas_say(seed: int) -> None:
    random = np.random.default_rng(seed)
    x = random.normal(0, 1, (2, 4, 3)) * random.uniform(0.1, 3, (2, 4, 1)) + random.normal(0, 2, (2, 4, 1))
    found = of(x).figures()
    assert found == pytest.approx(by_loops(x), rel=1e-12)


def test_single_runs_have_no_figures_of_scatter_and_one_direction_none_of_reversal() -> None:
    x = np.random.default_rng(1).normal(0, 1, (2, 4, 3))
    assert set(of(x[:, :, :1]).figures()) == {"E↑", "E↓", "B", "E", "M", "mean B"}
    assert of(x[:, :, :1]).figures()["M"] == pytest.approx(np.ptp(x[:, :, 0].mean(axis=0)))
    assert set(of(x[:1]).figures()) == {"E↑", "R↑", "A↑"}
    assert of(x[:1]).figures()["A↑"] == pytest.approx(of(x).figures()["A↑"])


def test_a_straight_line_is_no_straightness() -> None:
    x = np.random.default_rng(2).normal(0, 1, (2, 5, 3))
    side, target, repeat = (each.ravel() for each in np.indices(x.shape))
    at, sides = 100.0 * target, np.array([1.0, -1.0])[side]
    found, tilted = (
        PositioningRuns.of(at, sides, repeat, x.ravel() + slope * at + 7.0, straight=True).figures()
        for slope in (0.0, 0.3)
    )
    assert tilted == pytest.approx(found, rel=1e-9)


def test_the_drift_of_a_repeat_is_its_mean_less_that_of_all() -> None:
    x = np.zeros((2, 4, 3))
    x[:, :, 2] = 3.0
    assert of(x).drift == pytest.approx([-1.0, -1.0, 2.0])


def test_what_changes_the_readings_changes_the_figures_by_as_much() -> None:
    """E of a perfect axis read by an instrument whose scale is wrong by 1, 2 … over the travel is just that."""
    runs = of(np.zeros((2, 5, 3)))
    part = np.linspace(0, 1, 5)[None, None, :, None]
    draws = np.random.default_rng(3).normal(0, 2.0, (4000, 1, 1, 1))
    spread = runs.spread(np.broadcast_to(draws * part, (4000, 2, 5, 3)), np.zeros((1, 2, 5, 3)))
    assert spread["E"] == pytest.approx(float(np.sqrt(np.mean(draws**2))), rel=1e-12)
    assert spread["B"] == spread["R"] == 0.0  # and nothing of rounding, to which they would be printed


@pytest.mark.parametrize("left_out", [0, 13, 29])
def test_a_missing_reading_is_named(left_out: int) -> None:
    x = np.zeros((2, 5, 3))
    side, target, repeat = (np.delete(each.ravel(), left_out) for each in np.indices(x.shape))
    with pytest.raises(MissingReadingError) as told:
        PositioningRuns.of(10.0 * target, np.array([1.0, -1.0])[side], repeat + 1, np.zeros(29))
    d, t, n = (int(v[left_out]) for v in (each.ravel() for each in np.indices(x.shape)))
    assert (told.value.direction, told.value.target, told.value.repeat) == (1.0 - 2 * d, 10.0 * t, n + 1)
    assert told.value.count == 0


def test_runs_that_all_came_from_above_are_named_so() -> None:
    """The figures are those of the same readings from below, by another name."""
    positions, repeats = np.tile([0.0, 100.0, 200.0], 3), np.repeat([1, 2, 3], 3)
    readings = np.random.default_rng(5).normal(size=9)
    below, above = (PositioningRuns.of(positions, np.full(9, way), repeats, readings).figures() for way in (1.0, -1.0))
    assert list(above) == ["E↓", "R↓", "A↓"]
    assert list(above.values()) == list(below.values())
