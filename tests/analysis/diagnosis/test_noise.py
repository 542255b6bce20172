"""When a diagnosis says that the scatter has heavy tails."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import optimize, stats

from cmm_uq.analysis.diagnosis.noise import has_heavy_tails, probable_tails
from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.app.commands.reading import read_job
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.maths.inference.linear_model import studentised

TRIANGLE = Path(__file__).parents[3] / "examples" / "triangle-simulated"


@pytest.mark.parametrize("dof", [4, 1000])
def test_tails_are_heavy_where_student_s_t_is_e_to_the_fourth_times_as_likely_as_a_normal_distribution(
    dof: int,
) -> None:
    """Both at their likeliest scale, by SciPy's densities."""
    random = np.random.default_rng(dof)
    decided = []
    for _ in range(60):
        z = 2e-3 * random.standard_t(dof, 80)
        tailed = optimize.minimize_scalar(
            lambda log_scale, z=z: -stats.t.logpdf(z, 4, scale=np.exp(log_scale)).sum(),
            bounds=(-9, -4),
            method="bounded",
        )
        ratio = -tailed.fun - stats.norm.logpdf(z, scale=np.sqrt(np.mean(z**2))).sum()
        decided.append((ratio, has_heavy_tails(z)))
    assert all(said == (ratio > 4) for ratio, said in decided if abs(ratio - 4) > 0.3)
    assert any(said for _, said in decided) == (dof == 4)


def test_few_residuals_and_exact_figures_have_no_tails() -> None:
    assert not has_heavy_tails(np.array([*np.zeros(13), 1.0]))
    assert not has_heavy_tails(np.zeros(40))
    assert not has_heavy_tails(np.zeros(0))


def test_a_normal_scatter_is_not_said_to_have_heavy_tails_where_each_placing_is_fitted_by_itself() -> None:
    """Placings of a triangle take nearly all of the mean of its repeats: as they are, its residuals are a mixture of large and
    small ones, and half of all normal recordings had heavy tails. A ratio of likelihoods of e⁴ comes by chance about once in
    four hundred recordings; of readings with three degrees of freedom more than half show.
    """
    model, _ = screened_model(read_job(TRIANGLE))
    linear, noise = model.estimate().linear, noise_of(model)
    white = noise.sizes(np.zeros((1, noise.dimension)))
    random = np.random.default_rng(11)
    drawn = {"normal": random.standard_normal((100, 189)), "t": random.standard_t(3, (100, 189))}
    said = {
        name: sum(has_heavy_tails(studentised(linear, noise, white, readings)) for readings in each)
        for name, each in drawn.items()
    }
    assert said["normal"] <= 3
    assert said["t"] >= 40


def test_one_recording_in_four_may_have_heavy_tails_and_its_residuals_say_whether() -> None:
    """The odds are one to three times the ratio of likelihoods, each at its largest (scipy's fit of the scale of t)."""
    random = np.random.default_rng(3)
    for z in (random.standard_normal(19), random.standard_t(3, 19)):
        best = optimize.minimize_scalar(lambda s, z=z: -stats.t.logpdf(z, 4, scale=s).sum(), bounds=(0.1, 5)).fun
        odds = np.exp(-best - stats.norm.logpdf(z, scale=np.sqrt(np.mean(z**2))).sum()) / 3
        assert probable_tails(z) == pytest.approx(odds / (1 + odds), rel=0.01)
    assert probable_tails(random.standard_normal(300)) < 0.001
    assert probable_tails(random.standard_t(3, 300)) > 0.9
    assert probable_tails(np.zeros(19)) == pytest.approx(0.25)
