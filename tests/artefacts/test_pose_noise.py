"""What a robot leaves at each pose: the likeliest scatter by SciPy's multivariate t, and what was drawn comes back."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import f, multivariate_t

from cmm_uq.app.commands.jobs.new import new_job
from cmm_uq.app.commands.reading import job_of
from cmm_uq.artefacts.optical.pose_noise import pose_noise, reaches
from cmm_uq.base.points import Floats, Machine, Points

POSES = 3000


def drawn(seed: int, growing: float, degrees: float) -> tuple[Floats, Floats]:
    """Residuals (n, 3), mm, of σ = 0.05 mm at the mean reach, and reaches (n,), mm."""
    random = np.random.default_rng(seed)
    reach = random.uniform(400.0, 2000.0, POSES)
    s = 0.05 * np.sqrt(1 - growing + growing * reach**2 / np.mean(reach**2))
    factor = np.sqrt(degrees / random.chisquare(degrees, POSES)) if np.isfinite(degrees) else np.ones(POSES)
    return random.normal(0, 1, (POSES, 3)) * (s * factor)[:, None], reach


@pytest.mark.parametrize(("growing", "degrees"), [(0.0, np.inf), (0.5, np.inf), (0.0, 4.0), (0.7, 5.0)])
def test_what_was_drawn_comes_back_and_ellipsoids_hold_95_percent(growing: float, degrees: float) -> None:
    for seed in range(3):
        residuals, reach = drawn(seed, growing, degrees)
        found = pose_noise(residuals, reach, residuals.size)
        assert found.sigma == pytest.approx(0.05, rel=0.06)
        assert found.growing == pytest.approx(growing, abs=0.12)
        assert found.degrees > 25 if np.isinf(degrees) else found.degrees == pytest.approx(degrees, rel=0.25)
        again, far = drawn(seed + 100, growing, degrees)
        squares = np.sum(again**2, axis=1) / (found.sigma * found.scale(far)) ** 2
        assert np.mean(squares <= 3 * f.ppf(0.95, 3, found.degrees)) == pytest.approx(0.95, abs=0.015)


def test_no_other_figures_are_likelier_by_another_program() -> None:
    residuals, reach = drawn(7, 0.5, 5.0)
    residuals, reach = residuals[:300], reach[:300]
    found = pose_noise(residuals, reach, residuals.size)

    def likelihood(sigma: float, growing: float, tail: float) -> float:
        s = sigma * np.sqrt(1 - growing + growing * reach**2 / np.mean(reach**2))
        return sum(
            float(multivariate_t.logpdf(r, shape=each**2 * np.eye(3), df=1 / tail))
            for r, each in zip(residuals, s, strict=True)
        )

    tail = 1 / found.degrees - 1 / residuals.size
    best = likelihood(found.sigma, found.growing, tail)
    for by in (0.97, 1.03):
        assert likelihood(found.sigma * by, found.growing, tail) < best
        assert likelihood(found.sigma, found.growing * by, tail) < best
        assert likelihood(found.sigma, found.growing, tail * by) < best


def test_the_reach_is_what_each_joint_moves_of_the_tool_and_one_without_joints() -> None:
    points = job_of(new_job("tracked_points", {}, id="robot")).points
    columns, step = dict(points.columns), 1e-4
    squares = np.zeros(len(points))
    for i in range(1, 7):
        ends = []
        for sign in (-1, 1):
            there = {**columns, f"q{i}_deg": columns[f"q{i}_deg"] + np.degrees(sign * step)}
            ends.append(points.machine.posed(there).tool)  # type: ignore[attr-defined]
        squares += np.sum(((ends[1] - ends[0]) / (2 * step)) ** 2, axis=1)
    assert reaches(points) == pytest.approx(np.sqrt(squares), rel=1e-6)
    one = np.ones(2, dtype=np.int64)
    assert reaches(Points(np.zeros((2, 3)), one, one, one, Machine())).tolist() == [1.0, 1.0]
