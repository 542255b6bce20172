"""Random fields on many points: their components are those of the whole covariance."""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.parts.causes import components
from cmm_uq.analysis.parts.fields import MANY, field_components
from cmm_uq.analysis.parts.of_form import Form
from cmm_uq.analysis.parts.of_stylus import DEGREES, styli
from cmm_uq.analysis.parts.placing import Pose
from cmm_uq.analysis.parts.plan import Plan, Stylus
from tests.parts_drawn import UP, bore, plane

FACE = plane("A", UP, [0, 0, 0], [[120, 0, 0], [0, 80, 0]], (40, 30))


def test_components_of_a_field_on_many_points_add_up_to_its_covariance() -> None:
    """Second method: eigenvectors of the whole covariance."""
    form = Form("A", field_um=1.0, correlation_mm=25.0)
    assert len(FACE.points) > MANY
    found, whole = form.components(FACE, FACE.points), form.kernel(FACE, FACE.points)
    assert len(found) < len(FACE.points) / 5
    np.testing.assert_allclose(found.T @ found, whole, rtol=0, atol=1e-8 * whole.max())
    by_eigenvectors = components(whole)
    np.testing.assert_allclose(found.T @ found, by_eigenvectors.T @ by_eigenvectors, rtol=0, atol=1e-8 * whole.max())


def test_a_field_without_correlation_has_as_many_components_as_points() -> None:
    """Closed form: of a diagonal covariance the components are the standard deviations, a point each."""
    variances = np.linspace(1.0, 4.0, MANY + 1)
    found = field_components(lambda some: np.diag(variances)[some], variances)
    np.testing.assert_allclose(found.T @ found, np.diag(variances), atol=1e-12)
    assert found.shape == (MANY + 1, MANY + 1)


def test_lobing_on_many_points_has_no_more_components_than_its_spherical_harmonics() -> None:
    """Closed form: 2l + 1 harmonics of each degree l; pre-travel of one point has the whole variance."""
    feature = bore("bore", [10, 20, 0], 8.0, count=400)
    stylus = Stylus("stylus", np.zeros(3), 4.0, lobing_um=0.8)
    (cause,) = styli(Plan((feature,), (), (stylus,)), Pose())
    assert len(cause.factors) <= sum(2 * degree + 1 for degree in DEGREES)
    shown = cause.moved(np.eye(len(cause.factors)), slice(None))
    np.testing.assert_allclose(np.sqrt(np.sum(shown**2, axis=(0, 2))), 0.8e-3, rtol=1e-7)
