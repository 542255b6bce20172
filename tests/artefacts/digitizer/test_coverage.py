"""95 % intervals for the offset hold the truth in 95 % of simulated recordings."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from benchmarks.artefacts.digitizer_coverage import cases
from cmm_uq.app.commands.model import recorded_model
from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.maths.inference.posterior import Density, sample_with_noise
from tests.conftest import ROOT

RECORDINGS = 120
CHANCE = 1e-4 / (2 * 4 * 3)
"""Of one bound, of two for each of four coverages in three cases: together they fail once in ten thousand by chance."""


@pytest.mark.long
@pytest.mark.parametrize("which", [1, 3, 5])
def test_intervals_hold_the_truth_as_often_as_they_say(which: int) -> None:
    """Scans with all that may be in doubt, centres with stated noise, centres with noise to be found."""
    hits, u = cases()[which].coverage(RECORDINGS, part=0.25)
    low, high = stats.binom.ppf([CHANCE, 1 - CHANCE], RECORDINGS, 0.95)
    assert np.all(hits >= low)
    assert np.all(hits <= high)
    assert np.all(u > 1)


@pytest.mark.long
def test_noise_is_found_where_set_ups_in_doubt_outnumber_the_observations() -> None:
    """Six points in each of three attitudes, 21 parameters: what 9 µm of noise leave, by the residuals' own scatter."""
    case = cases()[1]
    few = np.isin(case.points.point, range(1, 7))
    made, _ = replace(case, points=case.points.select(few)).draws(3)
    centre, _ = Density(made.estimate().linear).laplace()
    assert len(made.unknowns) > int(few.sum())
    assert 3e-3 < np.exp(centre[-1]) < 27e-3
    estimate = made.estimate()
    sampled = sample_with_noise(estimate.linear, noise_of(made), estimate.least_squares, 0)
    assert 3e-3 < np.median(sampled.sigma) < 27e-3


def test_the_sampler_agrees_with_weights_by_importance() -> None:
    """Two ways to one posterior; each knows u to about 1.5 %."""
    made, weighed = cases()[5].draws(0)
    estimate = made.estimate()
    sampled = sample_with_noise(estimate.linear, noise_of(made), estimate.least_squares, 0)
    assert sampled.converged
    u = weighed.std(axis=0)
    np.testing.assert_allclose(sampled.draws[:, :3].std(axis=0), u, rtol=0.07)
    np.testing.assert_allclose(sampled.draws[:, :3].mean(axis=0) - weighed.mean(axis=0), 0, atol=0.08 * u.min())


def test_noise_that_set_ups_in_doubt_could_explain_is_refused(tmp_path: Path) -> None:
    """Four points of a sphere in each attitude: turns and shifts fit them all."""
    job = Path(shutil.copytree(ROOT / "examples" / "digitizer-simulated", tmp_path / "job"))
    head, *rows = (job / "recording.csv").read_text(encoding="utf-8").splitlines()
    few = [row for row in rows if int(row.split(",")[1]) <= 4 and row.split(",")[2] == "1"]
    (job / "recording.csv").write_text("\n".join([head, *few]), encoding="utf-8")
    with pytest.raises(CmmUqError, match=r"explains all but 0 .*State u_coordinate_um"):
        recorded_model(read_job(job))
    toml = (job / "job.toml").read_text(encoding="utf-8")
    stated = toml.replace('file = "recording.csv"', 'file = "recording.csv"\nu_coordinate_um = 9.0')
    (job / "job.toml").write_text(stated, encoding="utf-8")
    assert recorded_model(read_job(job))[0].sigma == pytest.approx(9e-3)


def test_setting_an_attitude_aside_may_leave_the_offset_open_and_is_then_refused(tmp_path: Path) -> None:
    """The three attitudes less one turn about one axis only."""
    job = Path(shutil.copytree(ROOT / "examples" / "digitizer-simulated", tmp_path / "job"))
    toml = (job / "job.toml").read_text(encoding="utf-8")
    aside = toml.replace('file = "recording.csv"', 'file = "recording.csv"\nset_aside = [3]')
    (job / "job.toml").write_text(aside, encoding="utf-8")
    with pytest.raises(CmmUqError, match=r"leave a combination of U1, V1, W1 open.*Set fewer measurements aside"):
        recorded_model(read_job(job))
