"""What set-ups can show of every effect, and of a fault of the artefact."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.laboratory.proving.cases import OWN
from cmm_uq.laboratory.proving.design import DRAWN, TAKEN, UNRECORDED, fault_reaches, reaches
from cmm_uq.machine.physics.catalogue import every
from tests.laboratory.proving.test_cases import cases, design

GAUGE = {reach.effect: reach for reach in reaches(design("step-gauge-simulated"))}


def test_every_effect_that_the_job_does_not_name_is_told_of_once() -> None:
    named = {effect.name for effect in design("step-gauge-simulated").model.effects}
    assert set(GAUGE) == set(every()) - named


def test_a_size_has_the_strength_that_cases_of_it_have() -> None:
    """Linear effects under the job's own noise: strength over size."""
    single = [c for c in cases("step-gauge-simulated") if len(c.hidden) == 1 and c.noise_kind == OWN]
    checked = 0
    for (hidden,) in (case.hidden for case in single):
        if not every()[hidden.effect].shape:
            (size,) = hidden.parameters.values()
            reach = GAUGE[hidden.effect]
            assert reach.per_unit * abs(size) == pytest.approx(hidden.strength, rel=1e-9)
            assert reach.amplitude(hidden.strength) == pytest.approx(abs(size), rel=1e-9)
            checked += 1
    assert checked >= 2


def test_nothing_is_found_beyond_what_physics_allows() -> None:
    reach = next(reach for reach in GAUGE.values() if reach.standing == DRAWN)
    assert reach.amplitude(0.999 * reach.per_unit * reach.allowed) is not None
    assert reach.amplitude(1.001 * reach.per_unit * reach.allowed) is None


def test_why_an_effect_is_not_hidden() -> None:
    """A gauge on lines: a carriage that turns about its own line moves no face along another; drift needs the time."""
    assert GAUGE["drift_x"].standing == UNRECORDED
    assert GAUGE["drift_x"].columns == ("time_s",)
    assert GAUGE["rotation_x_x"].standing == TAKEN
    assert GAUGE["straightness_y_z"].standing == DRAWN


def test_twins_are_told() -> None:
    """Seven lines do not part a vertical bow of Y from one of X: they leave less than a tenth of each other."""
    for reach in GAUGE.values():
        if reach.alike:
            sight = design("step-gauge-simulated").sight(design("step-gauge-simulated").noise)
            one, other = (sight.candidates[name][0] for name in (reach.effect, reach.alike))
            if other.shape[1] == 1:
                cosine = abs(float(one[:, 0] @ other[:, 0])) / np.linalg.norm(one) / np.linalg.norm(other)
                assert cosine > np.sqrt(1 - 0.1**2)
    assert GAUGE["straightness_x_z"].alike


def test_a_wrong_length_is_taken_by_the_scales_that_a_job_names() -> None:
    faults = {fault.what: fault for fault in fault_reaches(design("step-gauge-simulated"))}
    assert not faults["length"].shows
    assert not faults["warm"].shows
    assert faults["nodes"].shows
    assert not faults["nodes"].hidden
