"""What a recording shows of an error of each of its points."""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.parts.at_each import shown
from cmm_uq.machine.physics.catalogue import effects
from tests.analysis.parts.test_conditional import BARS, calibration

(PERIODIC,) = effects(["periodic_scale_y"])


def test_a_recording_shows_the_sum_of_what_it_shows_of_each_point() -> None:
    """Along the motion of Y, which leans by 170″ at most on this machine: by so much of itself the sum differs."""
    model = calibration()
    about = model.estimate().about
    e = PERIODIC.basis(BARS, (37.0,)) @ np.array([3.0, 4.0])
    expected = model.seen(e[:, :, None], about)[:, 0]
    np.testing.assert_allclose(shown(model, PERIODIC) @ e[:, 1], expected, atol=2 * 170 / 206265 * np.abs(e).max())
