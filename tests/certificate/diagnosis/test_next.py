"""What to measure next, as it is written: sizes in units of what physics, or the artefact at hand, allows."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from cmm_uq.analysis.planning.advice import DetectionChange, NextPlan, Separation
from cmm_uq.artefacts import artefact_facts, artefact_of
from cmm_uq.certificate.diagnosis.sections import next_data, next_sentence
from cmm_uq.certificate.result import JobDiagnosis
from cmm_uq.machine.physics.catalogue import every
from tests.artefacts.constructions import plate


def test_a_fault_of_the_artefact_is_as_large_as_that_artefact_allows() -> None:
    """Three times its certificate's 0.5 µm at most, where the same deformation of the machine could be far more."""
    artefact = artefact_of(artefact_facts(kind="plate", u_um=0.5), plate())
    names = [fault.name for fault in artefact.own_faults() if fault.reported[0].name == fault.coefficients[0].name]
    plan = NextPlan(
        (), 1, 5, (), tuple(DetectionChange(name, np.inf, 0.5) for name in names), reached=True, box=np.zeros((3, 2))
    )
    data = next_data(plan, artefact)
    assert data is not None
    unbound, differs = every(), 0
    for name, shown in zip(names, data["shows"], strict=True):
        sd = artefact.faults[name].coefficients[0].prior_sd
        assert shown["detected_before"] is None
        assert shown["detected_after"] == pytest.approx(0.5 * sd)
        differs += sd < unbound[name].coefficients[0].prior_sd / 2
    assert differs


@pytest.mark.parametrize(
    ("odds", "expected"),
    [
        ((40.0, 25.0), "Odds of 25 : 1 or more for the true one are then expected."),
        ((40.0, 0.6), "Odds of 40 : 1 or more for the true one are then expected, but for 1 of 2 pairs, which"),
        (
            (0.095, 0.6),
            "No set-up that was tried is expected to part what this recording cannot: odds of 0.6 : 1 at best",
        ),
    ],
)
def test_set_ups_that_would_part_nothing_are_no_advice(odds: tuple[float, ...], expected: str) -> None:
    pairs = tuple(Separation(("scale_x", "scale_y"), 1.0, each) for each in odds)
    plan = NextPlan((), 3, 5, pairs, (), reached=False, box=np.zeros((3, 2)))
    artefact = artefact_of(artefact_facts(kind="plate"), plate())
    before = SimpleNamespace(artefact=artefact)
    told = next_sentence(
        cast("JobDiagnosis", SimpleNamespace(next_plan=plan, diagnosis=SimpleNamespace(before=before)))
    )
    assert expected in told
    assert told.startswith("Measure next: ") == (max(odds) > 3)
