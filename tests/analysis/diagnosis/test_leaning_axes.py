"""Squarenesses of hundreds of seconds that a job leaves out are found by themselves: their squares are no further effects."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.analysis.diagnosis.diagnosis import diagnose
from cmm_uq.artefacts.ballbar.observe import Ballbar
from cmm_uq.machine.model import MeasurementModel
from cmm_uq.machine.physics.catalogue import effects
from tests.machine.model.test_leaning_axes import LENGTH, recorded
from tests.recordings import bar_facts

SCALES = ("scale_x", "scale_y", "scale_z")


@pytest.mark.parametrize(
    ("truth", "named"),
    [([0, 0, 0, 600, 600, 600], ()), ([0, 0, 0, 1500, -1500, 900], SCALES)],
    ids=["600 arcsec each", "1500 arcsec and scales named"],
)
def test_nothing_but_the_squarenesses_is_found(truth: list[float], named: tuple[str, ...]) -> None:
    """To first order Z would be 8.5 ppm short at 600″, and bars and guideways would be blamed for products of angles."""
    points = recorded(np.array(truth, dtype=np.float64), sigma=1e-3, seed=1, count=40)
    model = MeasurementModel(Ballbar(bar_facts(LENGTH, 0.5), points), effects(named), None)
    found = diagnose(model, stated_um=1.0, alpha=0.01, seed=0)
    assert found.verdict == "explained"
    assert {e.effect for e in found.effects} == {"squareness_xy", "squareness_yz", "squareness_zx"}
    for effect, angle in zip(("squareness_xy", "squareness_yz", "squareness_zx"), truth[3:], strict=True):
        quantity = next(e for e in found.effects if e.effect == effect).parameters["angle_arcsec"]
        assert abs(quantity.value - angle) < 4 * quantity.u
        assert quantity.u < 1
