"""Periods that equally spaced positions cannot tell apart are all told, and none of them is asserted."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.diagnosis.asserting import UNRESOLVED
from cmm_uq.diagnosis.diagnosis import Diagnosis, diagnose
from cmm_uq.documents.withheld import sentences
from cmm_uq.kinds import artefact_facts
from cmm_uq.kinds.plate.observe import Plate
from cmm_uq.model import MeasurementModel
from cmm_uq.physics.catalogue import effects
from cmm_uq.points import Floats, Machine, Points
from tests.recordings import TRAVEL

PERIOD, PITCH = 14.9, 5.0


def plate(places: Floats) -> Diagnosis:
    """Holes at some places along X and five along Y, 8 µm of a periodic error of X, 1 µm of noise."""
    i, j = (each.ravel() for each in np.meshgrid(places, PITCH * np.arange(5), indexing="ij"))
    reference = np.column_stack([i, j, np.zeros_like(i)])
    xyz = reference + np.array([250.0, 200.0, -300.0])
    xyz[:, 0] -= 8e-3 * np.sin(2 * np.pi * xyz[:, 0] / PERIOD + 0.5)
    xyz += 1e-3 * np.random.default_rng(1).standard_normal(xyz.shape)
    number = np.arange(1, len(xyz) + 1)
    columns = {f"reference_{a}_mm": reference[:, k] for k, a in enumerate("xyz")}
    points = Points(
        xyz, np.ones_like(number), number, np.ones_like(number), Machine("m", "XYZ", TRAVEL), columns, number
    )
    model = MeasurementModel(Plate(artefact_facts(kind="plate"), points), effects(("scale_x", "scale_y")))
    return diagnose(model, stated_um=None, alpha=0.01, seed=0)


def test_five_places_at_equal_distances_do_not_tell_a_period_from_its_aliases() -> None:
    """Sampled every 5 mm, frequencies that differ or sum up to a multiple of 1/5 mm⁻¹ are one (sampling theorem)."""
    found = plate(PITCH * np.arange(5))
    assert found.verdict == "unexplained"
    assert not found.effects
    (withheld,) = found.withheld
    assert (withheld.effect, withheld.why) == ("periodic_scale_x", UNRESOLVED)
    assert len(withheld.modes) == 5
    assert sum(mode.probability for mode in withheld.modes) == pytest.approx(1.0, abs=0.01)
    assert all(0.05 < mode.probability < 0.5 for mode in withheld.modes)
    for n, wanted in enumerate((PERIOD, *(1 / (k / PITCH + s / PERIOD) for k in (1, 2) for s in (-1, 1)))):
        assert any(abs(mode.period.value - wanted) < 2 * mode.period.u for mode in withheld.modes), n
    (sentence,) = sentences(found.withheld)
    assert "is not asserted: the positions do not tell its period" in sentence
    assert sentence.count(" mm: ") == 5


def test_places_at_unequal_distances_do() -> None:
    found = plate(np.sort(np.random.default_rng(4).uniform(0, 400, 24)).round(2))
    (item,) = found.effects
    assert item.effect == "periodic_scale_x"
    assert not found.withheld
    low, high = item.parameters["period_mm"].interval95
    assert low < PERIOD < high
    assert high - low < 0.1
