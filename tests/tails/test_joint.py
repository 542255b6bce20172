"""The posterior beside latent weights of readings, against dense algebra and the package's own density."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from benchmarks.coverage.cells import Cell
from benchmarks.coverage.recordings import recording
from benchmarks.tails.joint import DOF, Readings, log_tails
from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.app.commands.reading import read_job
from cmm_uq.machine.model.measurement import RecordingModel
from cmm_uq.maths.inference.marginal import Marginal
from cmm_uq.maths.inference.noise import Sizes

SIZES = Sizes(
    1e-3 * np.array([[1.0, 2.0, 0.5], [1.0, 1.0, 1.0]]), 1e-3 * np.array([1.5, 0.0]), 1e-3 * np.array([0.7, 0.4]),
    np.zeros(2), np.ones(2),
)  # fmt: skip
"""Two draws, one of them without a set-up offset."""


@pytest.fixture(params=["step gauge", "plate"])
def model(request: pytest.FixtureRequest, tmp_path: Path) -> RecordingModel:
    """Observations of one point's three coordinates, and of a point along a line; every second recording has no time."""
    return screened_model(read_job(recording(Cell(request.param, "t3"), 3, 0).write(tmp_path / "job")))[0]


def test_with_equal_weights_the_density_is_that_without_any(model: RecordingModel) -> None:
    """Of readings alike in all axes, of which the mean and the contrasts of repeats are independent to the last digit."""
    of, estimate = Readings.of(model), model.estimate()
    alike = replace(SIZES, reading=1e-3 * np.array([[1.4] * 3, [0.9] * 3]), growth=np.zeros(2))
    _, found = of.factors(1 / of.variances(alike), alike.placing)
    log, squares = Marginal(estimate.linear, of.noise, estimate.least_squares).log_likelihood(alike)
    assert float(np.diff(found)[0]) == pytest.approx(float(np.diff(log - 0.5 * squares)[0]), abs=1e-4)


def test_with_weights_it_is_the_normal_density_of_the_dense_covariance(model: RecordingModel) -> None:
    """Differences between weights; coefficients and placings, whose prior is wide or none, are integrated out with V⁻¹."""
    of = Readings.of(model)
    weight = np.random.default_rng(1).chisquare(3, (2, len(of.whole))) / 3 / of.variances(SIZES)
    _, found = of.factors(weight, SIZES.placing)
    shared = (of.quantity[:, None] == of.quantity) * of.scale[:, None] * of.scale
    wanted = []
    for each, placing in zip(weight, SIZES.placing, strict=True):
        V = np.diag(1 / each) + placing**2 * shared
        precision = of.whole.T @ np.linalg.solve(V, of.whole) + of.known.T @ of.known
        A, b = precision[:-1, :-1], precision[:-1, -1]
        squares = precision[-1, -1] - b @ np.linalg.solve(A, b)
        wanted.append(-0.5 * (np.linalg.slogdet(V)[1] + np.linalg.slogdet(A)[1] + squares))
    assert float(np.diff(found)[0]) == pytest.approx(float(np.diff(wanted)[0]), abs=1e-4)


def test_readings_of_any_degrees_of_freedom_have_the_same_quartiles() -> None:
    """By SciPy's densities, the scale of each being such that half of all lies within 0.674 of the normal one's."""
    z = np.random.default_rng(2).standard_normal((1, 30))
    (found,) = log_tails(z**2)
    for log, dof in zip(found, DOF, strict=True):
        own = stats.norm if np.isinf(dof) else stats.t(dof)
        scale = stats.norm.ppf(0.75) / own.ppf(0.75)
        assert log == pytest.approx(float(np.sum(own.logpdf(z / scale) - np.log(scale))), rel=1e-9)
