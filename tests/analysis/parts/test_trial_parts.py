"""What a part may be that was measured: less errors of place, not less form that only errors have."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.analysis.parts.evaluating import Movement
from cmm_uq.analysis.parts.plan import Characteristic, Plan
from cmm_uq.analysis.parts.trial_parts import trial_parts
from cmm_uq.base.points import Floats
from tests.analysis.parts.test_condensing import bore, face

PLAN = Plan((face(5, 6), bore(3, 8)), (Characteristic("squareness", "perpendicularity", ("bore",), ("A",)),))
BORE = PLAN.feature("bore")


def moved(*displacements: Floats) -> Movement:
    return Movement(np.zeros((len(displacements), 0)), {"bore": np.array(displacements)})


def tilted() -> Floats:
    """A bore that leans, lies aside and is larger."""
    return np.asarray(np.cross([1e-3, 2e-3, 0.0], BORE.points) + [0.01, 0.02, 0.0] + 0.005 * BORE.normals)


def waved(size: float) -> Floats:
    """Three lobes, which no motion has and no size."""
    angle = np.arctan2(BORE.normals[:, 1], BORE.normals[:, 0])
    return np.asarray(size * np.cos(3 * angle)[:, None] * BORE.normals)


def along(movement: Movement) -> Floats:
    return np.asarray(np.einsum("kmi,mi->km", movement.points["bore"], BORE.normals))


@pytest.mark.parametrize("form", [True, False])
def test_errors_of_place_and_size_are_taken_off(form: bool) -> None:
    trial = trial_parts(moved(tilted()), moved(np.zeros_like(BORE.points)), PLAN, form=form)
    np.testing.assert_allclose(along(trial), along(moved(-tilted())), atol=1e-15)


def test_form_of_errors_is_taken_off_where_form_is_asked_alone() -> None:
    """Else what was measured of it loses what errors explain: a form of 5 µm, of which errors make 3 µm, is 1 − 9/25 of it."""
    errors, perfect = moved(waved(0.003), waved(-0.003)), moved(-waved(0.005))
    asked, not_asked = (trial_parts(errors, perfect, PLAN, form=form) for form in (True, False))
    np.testing.assert_allclose(along(asked), along(moved(-waved(0.003), waved(0.003))), atol=1e-15)
    np.testing.assert_allclose(along(not_asked), along(moved(*[-waved(0.005 * 9 / 25)] * 2)), atol=1e-15)


def test_no_more_form_is_taken_off_than_was_measured() -> None:
    trial = trial_parts(moved(waved(0.02)), moved(-waved(0.005)), PLAN, form=False)
    np.testing.assert_allclose(along(trial), along(moved(-waved(0.005))), atol=1e-15)


def test_displacements_along_normals_are_as_those_in_space() -> None:
    errors, perfect = moved(tilted() + waved(0.003)), moved(-waved(0.005) - tilted())
    flat, still = (Movement(one.change, {"bore": along(one)}) for one in (errors, perfect))
    trial = trial_parts(flat, still, PLAN, form=False)
    np.testing.assert_allclose(trial.points["bore"], along(trial_parts(errors, perfect, PLAN, form=False)), atol=1e-15)
