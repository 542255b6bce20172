"""Errors outside the catalogue: located, fitted, borne out by held-out points, and named only where they can be."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.analysis.diagnosis.comparison.search import search
from cmm_uq.analysis.diagnosis.diagnosis import Diagnosis, diagnose
from cmm_uq.analysis.diagnosis.empirical.model import EmpiricalModel, empirical_model
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.gauge_lines import StepGauge
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import effects

SIX = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")
TRAVEL = np.array([[0.0, 900.0], [0.0, 550.0], [-500.0, 0.0]])
SEVEN = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 0, 1), (1, 1, 1), (1, -1, 1))
FACES = np.array([0.0, 60.0, 100.0, 180.0, 220.0, 280.0, 360.0, 400.0])


def gauge(
    error: Floats | None = None, *, seed: int = 5, sigma: float = 1e-3, added: Floats | None = None
) -> RecordingModel:
    """Seven lines, eight faces, three times; ``error`` of X by the reading of X at equal distances, true = indicated + e."""
    random = np.random.default_rng(seed)
    xyz, numbers = [], []
    for line, direction in enumerate(SEVEN, 1):
        u = np.array(direction) / np.linalg.norm(direction)
        start = TRAVEL.mean(axis=1) - 0.5 * FACES[-1] * u + random.uniform(-40, 40, 3)
        for repeat in (1, 2, 3):
            xyz.append(start + FACES[:, None] * u)
            numbers += [(line, i + 1, repeat, face, *u) for i, face in enumerate(FACES)]
    true = np.vstack(xyz)
    measurement, point, repeated, reference, *approach = np.array(numbers).T
    shown = true + sigma * random.standard_normal(true.shape)
    if error is not None:
        shown[:, 0] -= np.interp(true[:, 0], np.linspace(0, 900, len(error)), error)
    if added is not None:
        shown += added
    columns = {"reference_mm": reference, **{f"approach_{a}": v for a, v in zip("xyz", approach, strict=True)}}
    whole = (values.astype(np.int64) for values in (measurement, point, repeated))
    points = Points(shown, *whole, Machine("m", "XYZ", TRAVEL), columns)
    return RecordingModel(StepGauge(artefact_facts(kind="step_gauge", length_mm=400.0, u_um=0.2), points), effects(SIX))


X = np.linspace(0, 900, 1801)


def modelled(error: Floats, seed: int = 5) -> EmpiricalModel:
    found = empirical_model(search(gauge(error, seed=seed), None, alpha=0.01, seed=1))
    assert found is not None
    return found


@pytest.mark.long
def test_a_dent_is_modelled_and_named() -> None:
    found = modelled(15e-3 * np.exp(-0.5 * ((X - 560) / 40) ** 2))
    one = found.functions[0]
    assert found.predicts
    assert found.improvement.heldout_rms_after_um < 0.6 * found.improvement.heldout_rms_before_um
    assert (one.term.of, one.term.along) == ("x_mm", "x")
    assert one.form is not None
    assert one.form.name == "dent"
    for name, true in (("size_um", 15.0), ("at", 560.0), ("width", 40.0)):
        told = one.form.parameters[name]
        assert abs(told.value - true) < 3 * told.u, name


@pytest.mark.long
def test_a_step_is_where_it_is_and_has_its_sign() -> None:
    one = modelled(np.where(X > 520, -10e-3, 0.0)).functions[0]
    assert one.form is not None
    assert one.form.name == "step"
    size, at = one.form.parameters["size_um"], one.form.parameters["at"]
    assert abs(size.value + 10.0) < 3 * size.u
    assert abs(at.value - 520.0) < 3 * at.u
    assert "e_x = k*((1 + sign(x - " in one.stated


@pytest.mark.long
def test_a_form_that_is_in_no_dictionary_is_modelled_without_a_name() -> None:
    """A chirp: smooth, and no sine."""
    found = modelled(8e-3 * np.sin(2 * np.pi * (X / 330) ** 2))
    one = found.functions[0]
    assert found.predicts
    assert one.form is None
    x, y, u = one.curve
    inside = (x > 250) & (x < 650)
    away = y - 8.0 * np.sin(2 * np.pi * (x / 330) ** 2)
    away -= np.polyval(np.polyfit(x, away, 1, w=1 / u), x)  # a constant and a scale are the model's own
    assert np.mean(np.abs(away[inside]) < 2 * u[inside]) > 0.9


def test_white_noise_has_no_function() -> None:
    assert empirical_model(search(gauge(), None, alpha=0.01, seed=1)) is None


def pattern(size: float) -> Diagnosis:
    """One line on which every face is off by its own, alike in all repeats; named is the scale alone."""
    model = gauge(added=None)
    points = model.artefact.points
    first = points.select(points.measurement == 1)
    off = np.random.default_rng(8).standard_normal(len(FACES)) * size
    xyz = first.xyz.copy()
    xyz[:, 0] += np.tile(off, 3)
    moved = Points(xyz, first.measurement, first.point, first.repeat, first.machine, first.columns)
    facts = artefact_facts(kind="step_gauge", length_mm=400.0, u_um=0.2)
    return diagnose(RecordingModel(StepGauge(facts, moved), effects(("scale_x",))), stated_um=None, alpha=0.01, seed=1)


@pytest.mark.long
def test_a_pattern_that_repeats_in_one_set_up_is_never_consistent() -> None:
    found = pattern(8e-3)
    assert found.verdict != "consistent"
    assert found.repeats is not None
    assert found.repeats.p_value < 1e-6
    assert found.repeats.repeatability_um == pytest.approx(1.0, rel=0.4)
    assert found.repeats.shared_um > 5 * found.repeats.repeatability_um


def test_noise_of_readings_alone_is_consistent() -> None:
    found = pattern(0.0)
    assert found.verdict == "consistent"
    assert found.repeats is not None
    assert found.repeats.p_value > 0.01
