"""Faults of an artefact can be simulated by name, as any effect can, and named in a model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.app.commands.jobs.simulate import simulated_job
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import artefact_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.machine.model.placed import Rigid
from tests.conftest import ROOT

PLATE, BARS = (read_job(ROOT / "examples" / name) for name in ("plate-simulated", "iota-1102-20C"))


def in_own_axes(truth: dict[str, object]) -> Floats:
    """Where a simulated plate without noise is found against its certificate, by set-up (q, N, 3), µm."""
    job = simulated_job(PLATE, truth)
    artefact = artefact_of(job.facts.artefact, job.points)
    assert isinstance(artefact, Rigid)
    points = job.points
    own = 1e3 * np.einsum("nij,ni->nj", artefact.attitudes(points.xyz), artefact.deviations())
    order = np.lexsort((points.point, points.repeat, points.measurement))
    return own[order].reshape(len(np.unique(points.measurement)), -1, 3)


def test_a_simulated_pattern_is_the_same_in_every_set_up_and_as_large_as_asked_for() -> None:
    found = in_own_axes({"effects": {"artefact_pattern": {"rms_um": 8.0, "seed": 3}}})
    np.testing.assert_allclose(found, np.broadcast_to(found[0], found.shape), atol=2e-3)
    assert np.sqrt(np.mean(found**2)) == pytest.approx(8.0, rel=1e-3)
    other = in_own_axes({"effects": {"artefact_pattern": {"rms_um": 8.0, "seed": 4}}})
    assert np.abs(found - other).max() > 5


def test_a_warmer_plate_is_simulated_longer() -> None:
    """By 2 K · 11.5 ppm/K in every direction from its middle."""
    found = in_own_axes({"effects": {"artefact_temperature": {"k": 2.0}}})
    places = np.column_stack([PLATE.points.columns[f"reference_{a}_mm"] for a in "xyz"])
    order = np.lexsort((PLATE.points.point, PLATE.points.repeat, PLATE.points.measurement))
    about = places[order].reshape(found.shape)
    about = about - about.mean(axis=1, keepdims=True)
    np.testing.assert_allclose(found, 23e-3 * about, atol=0.01)


def test_an_artefact_that_cannot_have_the_fault_says_so() -> None:
    with pytest.raises(CmmUqError, match="'ballbar' has no artefact_pattern") as caught:
        simulated_job(BARS, {"effects": {"artefact_pattern": {"rms_um": 8.0}}})
    assert caught.value.where == "truth.toml [effects]"
    assert caught.value.fix == "Leave it out; it has artefact_temperature"


def test_a_model_may_name_a_fault_and_its_size_is_estimated() -> None:
    job = simulated_job(PLATE, {"effects": {"artefact_bending": {"um": 30.0}}, "noise": {"coordinate_um": 0.5}})
    facts = job.facts.model_copy(update={"model": job.facts.model.model_copy(update={"effects": ["artefact_bending"]})})
    model, _ = screened_model(replace(job, facts=facts))
    found = model.estimate().least_squares
    assert abs(found.value[0] - 30.0) < 4 * np.sqrt(found.covariance[0, 0])
