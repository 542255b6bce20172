"""Trial parts have more of what makes a zone, and stay where they lie and as large as they are."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.parts.characteristics import Evaluation
from cmm_uq.parts.evaluating import Evaluator, characteristics_of
from cmm_uq.parts.plan import Characteristic, Plan
from cmm_uq.parts.trial_shapes import shape_of
from cmm_uq.points import Floats
from tests.parts.test_condensing import bore, face

PLAN = Plan(
    (face(5, 6), bore(3, 8)),
    (
        Characteristic("flatness", "flatness", ("A",)),
        Characteristic("cylindricity", "cylindricity", ("bore",)),
        Characteristic("squareness", "perpendicularity", ("bore",), ("A",)),
    ),
)
EVALUATIONS = Evaluator(PLAN, np.zeros_like(PLAN.points), []).evaluations


def squareness(deviations: Floats) -> float:
    return float(characteristics_of(PLAN, PLAN.points + deviations)[2])


@pytest.mark.parametrize("one", EVALUATIONS, ids=[one.characteristic.name for one in EVALUATIONS])
def test_a_part_that_is_shifted_and_larger_has_no_shape(one: Evaluation) -> None:
    """A tenth of a millimetre each, and the whole part turned: nothing of it is form or orientation."""
    moved = np.array([0.1, -0.2, 0.3]) + np.cross([1e-4, 2e-4, -1e-4], PLAN.points)
    moved[PLAN.rows["bore"]] += 0.1 * PLAN.normals[PLAN.rows["bore"]] + np.array([0.05, 0.1, 0.0])
    np.testing.assert_allclose(shape_of(one, moved), 0.0, atol=1e-12)


def test_of_a_tilted_bore_the_shape_is_its_tilt() -> None:
    own = PLAN.rows["bore"]
    tilt = np.zeros_like(PLAN.points)
    tilt[own] = np.cross([1e-3, 0.0, 0.0], PLAN.points[own])
    shape = shape_of(EVALUATIONS[2], tilt)
    assert squareness(shape) == pytest.approx(squareness(tilt), rel=0.01)
    assert np.abs(shape).max() < np.abs(tilt).max()
