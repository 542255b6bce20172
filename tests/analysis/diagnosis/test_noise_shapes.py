"""Shapes of the noise: what is known of all sizes together says nothing of their proportions.

The noise's shapes that stand for all do so beside what may be missing, too.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.second.cases import case, write
from cmm_uq.analysis.diagnosis import noise as shapes
from cmm_uq.analysis.diagnosis.comparison.explanations import unknown_functions
from cmm_uq.analysis.diagnosis.comparison.search import comparison_of
from cmm_uq.analysis.diagnosis.noise import _beside, _Density, _determined, drawn_shapes, noise_kinds
from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.units import unit
from cmm_uq.machine.model import RecordingModel
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown, solve
from tests.maths.inference.test_noise import M, components


def linear(rivals: int, sd: float) -> tuple[LinearModel, np.ndarray]:
    """Twelve observations of a constant, 1 µm of white noise, and columns of what could be missing."""
    random = np.random.default_rng(4)
    model = LinearModel(
        1e-3 * random.standard_normal(M), np.ones((M, 1)), (Unknown(("one", "mm"), unit("mm"), 0.0, np.inf, 1.0),),
        np.zeros((M, 0)), np.ones(M), None,
    )  # fmt: skip
    return model, sd * random.standard_normal((M, rivals))


@pytest.mark.parametrize("rivals", [0, 1, 5])
def test_shapes_that_differ_in_all_sizes_alike_are_equally_probable(rivals: int) -> None:
    """Their size is integrated out: with rivals that may be far larger it does not matter from where it is counted."""
    model, columns = linear(rivals, 1e3)
    estimate, noise = solve(model), components()
    taken = _determined(model, columns, estimate.sigma_of_residuals)
    assert taken == pytest.approx(rivals, abs=1e-6)
    marginal = _beside(model, noise, estimate, columns)
    density = _Density.of(marginal, taken, noise)
    latent = drawn_shapes(noise)[:40]
    larger = latent + np.array([np.log(20.0), *np.zeros(latent.shape[1] - 1)])
    one, other = (density.log_probability(shapes) for shapes in (latent, larger))
    np.testing.assert_allclose(other - one, 0.0, atol=1e-3)


@pytest.fixture(scope="module")
def jumped(tmp_path_factory: pytest.TempPathFactory) -> RecordingModel:
    """A plate in three ways whose scale of X jumps midway, with an offset of each ball of each set-up and no slow noise."""
    made, folder = case(20261124, "outside", 35), tmp_path_factory.mktemp("jumped")
    assert made.noise.kind == "set-up"
    assert set(made.truth["hidden"]) == {"jump in time"}
    write(made, folder)
    return screened_model(read_job(Path(folder) / made.name))[0]


@pytest.mark.long
def test_few_shapes_say_of_a_jump_with_time_what_many_say(
    jumped: RecordingModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Against the integral by a hundred shapes, within what is hardly worth a mention; 100 : 1 is decisive (Jeffreys)."""
    functions = [f for f in unknown_functions(jumped, jumped.estimate().about) if f.covariate_name == "time_s"]
    odds = []
    for kept in (shapes.KEPT, 100):
        monkeypatch.setattr(shapes, "KEPT", kept)
        nothing, something = comparison_of(jumped, None, functions).log_evidence()
        odds.append(something[:, 0] - nothing[0])
    np.testing.assert_allclose(*odds, atol=1.0)
    assert odds[0].max() > np.log(100)


@pytest.mark.long
def test_noise_that_is_slow_for_want_of_a_jump_is_not_all_that_is_kept(jumped: RecordingModel) -> None:
    functions = [f for f in unknown_functions(jumped, jumped.estimate().about) if f.covariate_name == "time_s"]
    normal = [kind for kind in noise_kinds(jumped, functions) if kind.name != "tails"]
    assert sum(not kind.slow.size for kind in normal) >= 2
    assert sum(bool(kind.slow.size) for kind in normal) >= 2


@pytest.mark.long
def test_without_a_time_there_is_no_jump_to_reckon_with(jumped: RecordingModel) -> None:
    """The same kinds of noise, whatever functions of other covariates are candidates."""
    functions = [replace(f, covariate_name=None) for f in unknown_functions(jumped, jumped.estimate().about)]
    assert [k.log_whitening for k in noise_kinds(jumped, functions)] == [
        k.log_whitening for k in noise_kinds(jumped, ())
    ]


def test_what_a_model_leaves_of_columns_is_at_right_angles_to_it_and_its_placing(jumped: RecordingModel) -> None:
    """By least squares on its design and the freedoms of its set-ups, written out."""
    linear = jumped.estimate().linear
    columns = np.random.default_rng(3).standard_normal((len(linear.observed), 2))
    scale = linear.noise_scale[:, None]
    every = np.hstack([linear.design, linear.freedoms.dense()]) / scale
    every = every / np.linalg.norm(every, axis=0)
    left = columns / scale - every @ np.linalg.lstsq(every, columns / scale, rcond=1e-9)[0]
    found = shapes.unreached(linear, columns)
    np.testing.assert_allclose(found.T @ found, left.T @ left, rtol=1e-6, atol=1e-6 * np.trace(left.T @ left))
