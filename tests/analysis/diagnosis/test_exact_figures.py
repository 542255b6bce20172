"""Figures without noise, and a recording compared with itself, are consistent: their last digits say nothing."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.analysis.diagnosis.diagnosis import diagnose
from cmm_uq.app.commands.estimation import without_outliers
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.plate.observe import Plate
from cmm_uq.base.points import Points
from cmm_uq.jobs.recording.references import against_earlier
from cmm_uq.machine.model import MeasurementModel
from cmm_uq.machine.physics.catalogue import effects
from tests.artefacts.constructions import indicated, plate

FACTS = artefact_facts(kind="plate")
PLACES = ((0, 0, 0),)


def exact() -> Points:
    """Nine balls as a perfect machine indicates them."""
    points = plate(PLACES, side=3)
    whole = np.round(points.xyz, 5)
    return points.at(whole)


def noisy() -> Points:
    points = plate(PLACES, side=3)
    xyz = np.round(indicated(FACTS, points, ["scale_x"], [12.0], sigma=2e-3).xyz, 5)
    return Points(xyz, points.measurement, points.point, points.repeat, points.machine, {}, points.lines)


@pytest.mark.parametrize("points", [exact(), against_earlier(noisy(), noisy(), 0.0, "now.csv")], ids=["exact", "copy"])
def test_they_are_consistent_without_an_outlier(points: Points) -> None:
    model, outliers = without_outliers(MeasurementModel(Plate(FACTS, points), effects(("scale_x", "scale_y"))))
    assert not outliers
    found = diagnose(model, stated_um=None, alpha=0.01, seed=0)
    assert found.verdict == "consistent"
    assert found.p_value > 0.5
    assert not found.remaining.rivals
