"""Diagnosis and history state nothing of a machine that its certificate, with the field behind it, does not."""

from __future__ import annotations

import json

import numpy as np
import pytest

import cmm_uq
from benchmarks.parts import curved, machines
from cmm_uq.analysis.machine.recordings import components_of
from cmm_uq.base.points import Floats
from cmm_uq.machine.model import RecordingModel
from cmm_uq.maths.inference.posterior import sample_with_noise
from tests.conftest import ROOT

SIZE = len(machines.NAMED)


@pytest.mark.long
def test_a_diagnosis_says_what_the_certificate_of_the_recording_says() -> None:
    """The same search, its verdict and what is withheld; the factors of the job it does not state at all."""
    job = ROOT / "examples" / "step-gauge-simulated"
    report, diagnosis = (json.loads(json.dumps(one(job).results)) for one in (cmm_uq.report, cmm_uq.diagnose))
    apart = {key for key in report["diagnosis"] if report["diagnosis"][key] != diagnosis["diagnosis"][key]}
    assert apart <= {"next_plan"}
    assert "estimates" not in diagnosis
    assert diagnosis["diagnosis"]["verdict"] == "consistent"


def differences(artefact: str, sort: curved.Sort, count: int) -> Floats:
    """(count, 6) of the factors of unchanged machines, each calibrated twice at other set-ups, over their joint u."""
    found = []
    for number in range(count):
        random = np.random.default_rng([number, 7])
        hidden, stated = curved.drawn(sort, random), []
        for _ in range(2):
            recording = machines.calibrated(machines.Cell(artefact, "white", 0.0), hidden, 0.7e-3, 0.0, random)
            model = RecordingModel(recording, machines.NAMED)
            estimate = model.estimate()
            draws = sample_with_noise(estimate.linear, components_of(model), estimate.least_squares, number).draws
            stated.append((draws[:, :SIZE].mean(axis=0), draws[:, :SIZE].std(axis=0)))
        (one, u), (other, v) = stated
        found.append((one - other) / np.hypot(u, v))
    return np.array(found)


@pytest.mark.long
@pytest.mark.parametrize("artefact", ["bars", "step gauge"])
def test_other_set_ups_of_an_unchanged_machine_are_no_drift(artefact: str) -> None:
    """A history compares means over recorded set-ups, whose u holds the errors that the job does not name.

    Of 48 differences more than two standard uncertainties: 5 % expected, more than 12.5 % in one of a thousand cases.
    """
    sorts = [sort for sort in curved.SORTS if sort.name in ("ordinary", "one curve eight times")]
    found = np.concatenate([differences(artefact, sort, 4) for sort in sorts])
    assert np.mean(np.abs(found) > 2) <= 0.125
    assert np.sqrt(np.mean(found**2)) < 1.3
    assert np.abs(found).max() > 0.5  # they do differ
