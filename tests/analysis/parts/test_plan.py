"""A plan refuses in words what is no plan, and knows a hole from a shaft."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.analysis.parts.plan import Nominal, PartAlignment, PartCharacteristic, PartFeature, Plan
from cmm_uq.base.errors import CmmUqError

UP = np.array([0.0, 0.0, 1.0])


def plane(name: str, count: int = 4, **changes: object) -> PartFeature:
    points = np.array([[0.0, 0, 0], [10, 0, 0], [0, 10, 0], [10, 10, 0], [5, 5, 0]])[:count]
    given = {"points": points, "normals": np.tile(UP, (count, 1)), "nominal": Nominal(np.zeros(3), UP)} | changes
    return PartFeature(name, "plane", stylus="stylus", **given)  # type: ignore[arg-type]


def bore(sign: float) -> PartFeature:
    angles = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    out = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(8)])
    return PartFeature("bore", "circle", 5 * out, sign * out, "stylus", Nominal(np.zeros(3), UP, 10.0))


def test_the_normals_of_a_hole_point_to_its_axis() -> None:
    assert bore(-1.0).internal
    assert not bore(1.0).internal


@pytest.mark.parametrize(("changes", "words"), [
    ({"count": 2}, "2 points are too few for a plane"),
    ({"nominal": Nominal(np.zeros(3))}, "a plane needs a nominal direction"),
    ({"normals": np.full((4, 3), 1.0)}, "no unit vector"),
    ({"association": "least_square"}, "Did you mean 'least_squares'"),
])  # fmt: skip
def test_a_feature_that_is_none_is_refused(changes: dict[str, object], words: str) -> None:
    with pytest.raises(CmmUqError, match=words):
        plane("top", **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize(("features", "characteristics", "alignment", "words"), [
    (("top", "top"), (), (), "feature 'top' stands twice"),
    (("top",), (PartCharacteristic("flat", "flatness", ("tops",)),), (), "Did you mean 'top'"),
    (("top",), (PartCharacteristic("flat", "flat", ("top",)),), (), "flatness"),
    (("top",), (), ("side",), "alignment: there is no feature 'side'"),
])  # fmt: skip
def test_names_that_lead_nowhere_are_refused(
    features: tuple[str, ...], characteristics: tuple[PartCharacteristic, ...], alignment: tuple[str, ...], words: str
) -> None:
    with pytest.raises(CmmUqError, match=words):
        Plan(tuple(plane(name) for name in features), characteristics, alignment=PartAlignment(alignment))


def test_points_of_all_features_stand_in_their_order() -> None:
    plan = Plan((plane("top"), plane("lower", 5)), ())
    assert plan.rows == {"top": slice(0, 4), "lower": slice(4, 9)}
    np.testing.assert_array_equal(plan.points[plan.rows["lower"]], plan.feature("lower").points)
