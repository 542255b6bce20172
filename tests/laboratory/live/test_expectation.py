"""What all other observations say of one: the deleted residual is that of a fit without it, whatever the artefact."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.app.commands.model import recorded_model
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.base.units import MICROMETRE
from cmm_uq.laboratory.live.judging import RARE, predicted, scatter
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from tests.conftest import ROOT
from tests.recordings import bar_facts


def left_out(model: RecordingModel, row: int, sigma: float) -> tuple[float, float]:
    linear = model.linearised(np.array([unknown.prior_mean for unknown in model.unknowns]))
    place = linear.freedoms.dense()
    whole = np.hstack([linear.design, place]) / linear.noise_scale[:, None]
    y = linear.observed / linear.noise_scale
    keep = np.arange(len(y)) != row
    rows, known = linear.priors
    prior = np.hstack([rows, np.zeros((len(rows), place.shape[1]))]) * sigma
    rest = np.vstack([whole[keep], prior])
    size = np.linalg.norm(rest, axis=0)
    inverse = (
        np.linalg.pinv(rest / size, rcond=1e-10) / size[:, None]
    )  # of the rows: their squares would lose half the digits
    values = inverse @ np.concatenate([y[keep], known * sigma])
    scale = linear.noise_scale[row] / MICROMETRE
    variance = sigma**2 * (1 + np.sum((whole[row] @ inverse) ** 2))
    return float((y[row] - whole[row] @ values) * scale), float(np.sqrt(variance) * scale)


@pytest.mark.parametrize("name", ["iota-1102-20C", "step-gauge-simulated", "plate-simulated", "sphere-simulated"])
def test_it_is_what_a_fit_without_the_observation_leaves(name: str) -> None:
    model, _ = recorded_model(read_job(ROOT / "examples" / name))
    found = predicted(model)
    assert found is not None
    for row in np.linspace(0, len(found.measured) - 1, 4).astype(int):
        if not np.isfinite(found.expected[row]):
            continue
        off, u = left_out(model, row, found.sigma * MICROMETRE)
        assert found.measured[row] - found.expected[row] == pytest.approx(off, rel=1e-4, abs=1e-3)
        assert found.u[row] == pytest.approx(u, rel=1e-4)


def repeated(errors_um: Floats, machine: Machine) -> RecordingModel:
    count, repeats = errors_um.shape
    m, r = (a.ravel() for a in np.meshgrid(np.arange(1, count + 1), np.arange(1, repeats + 1), indexing="ij"))
    first = np.column_stack([100.0 + 0 * m, 100.0 + 10 * m, -300.0 + 0 * m])
    second = first + np.column_stack([400 + errors_um.ravel() * MICROMETRE, 0 * m, 0 * m])
    one = np.ones(len(m), dtype=np.int64)
    points = Points(np.vstack([first, second]), np.tile(m, 2), np.concatenate([one, 2 * one]), np.tile(r, 2), machine)
    return RecordingModel(Ballbar(bar_facts(400.0, 0.5), points), effects(["scale_x"]))


def test_the_scatter_of_repeats_is_judged_against_that_of_the_others_by_f(machine: Machine) -> None:
    """Repeats of ±1 µm everywhere: a coordinate of 1/√2·√2 = 1 µm a length's √2; F(1, 4; 0.01) = 21.198 (tables)."""
    usual = np.array([[1.0, -1.0]] * 4)
    for wild, asked in ((np.array([[4.5, -4.5]]), False), (np.array([[4.7, -4.7]]), True)):
        found = scatter(repeated(np.vstack([usual, wild]), machine), 5)
        assert (found is not None) is asked
    assert found is not None
    assert found.usual == pytest.approx(1.0, rel=1e-3)
    assert found.s == pytest.approx(4.7, rel=1e-3)
    assert found.limit == pytest.approx(np.sqrt(21.198), rel=1e-3)


def test_and_against_the_stated_noise_by_chi_square(machine: Machine) -> None:
    """χ²(1; 0.01) = 6.635 (tables): two repeats that differ by 2·√6.635 σ."""
    from dataclasses import replace

    assert RARE == 0.01
    for half, asked in ((2.5, False), (2.65, True)):
        model = replace(repeated(np.array([[half, -half]]), machine), sigma=MICROMETRE)
        assert (scatter(model, 1) is not None) is asked


def test_without_repeats_or_stated_noise_nothing_is_asked_for(machine: Machine) -> None:
    assert scatter(repeated(np.array([[1.0], [2.0]]), machine), 1) is None
    assert predicted(repeated(np.array([[1.0]]), machine)) is None
