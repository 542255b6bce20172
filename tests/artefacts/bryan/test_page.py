"""The patent's second way on a certificate: what it cannot determine, and U with the bias of its first step."""

from __future__ import annotations

import numpy as np
import pytest

from tests.artefacts.simulated import SQUARE, analysed, outcome, results

JOB = "bryan-simulated"


def test_scales_are_not_determined_by_either_way_without_a_certified_length() -> None:
    factors = results(JOB)["distance_equations"]["factors"]
    assert analysed(JOB).free == {"scale_x", "scale_y", "scale_z", "artefact"}
    for name in ("scale_x", "scale_y", "scale_z"):
        assert factors[name]["ppm"] == {"value": None, "u": None, "U": None, "k": None}
    assert outcome(JOB).document is not None


@pytest.mark.parametrize("name", SQUARE)
def test_u_holds_the_bias_of_the_centre(name: str) -> None:
    """Positions above the fixed ball alone: 3″ to 5″ of the squarenesses with Z go into its centre, beside u = 0.7″."""
    found = results(JOB)["distance_equations"]["factors"][name]["angle_arcsec"]
    fitted = results(JOB)["estimates"][name]["angle_arcsec"]["value"]
    assert abs(found["value"] - SQUARE[name]) < found["U"]
    assert found["u"] == pytest.approx(np.hypot(0.706, found["value"] - fitted), rel=0.1)
