"""Datums leave free the motions under which all of them are invariant (ISO 5459, classes of invariance).

Names of common datums, and what features are as one datum.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cmm_uq.analysis.parts.setup import plan_of, refuse_unfit
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.part.checks import as_one, freedoms, members
from cmm_uq.jobs.part.probed import Probed
from tests.jobs.part.parts import feature, plate

FEW: dict[str, Any] = {"pattern": "points", "points": 6}


def plane(*direction: float, at: tuple[float, ...] = (0.0, 0.0, 0.0)) -> Probed:
    return feature("plane", point_mm=list(at), direction=list(direction), length_mm=80.0, width_mm=60.0, strategy=FEW)


def bore(x: float, y: float, kind: str = "cylinder") -> Probed:
    length = {"length_mm": 20.0} if kind == "cylinder" else {}
    return feature(
        kind, point_mm=[x, y, 0.0], direction=[0.0, 0.0, 1.0], diameter_mm=10.0, inner=True, strategy=FEW, **length
    )


def ball(x: float, y: float, z: float) -> Probed:
    return feature("sphere", point_mm=[x, y, z], diameter_mm=10.0, inner=False, strategy=FEW)


TOP, FRONT, SIDE = plane(0, 0, 1), plane(0, -1, 0), plane(-1, 0, 0)
EDGE = feature(
    "line", point_mm=[0.0, 0.0, 0.0], direction=[1.0, 0.0, 0.0], normal=[0.0, -1.0, 0.0], length_mm=50.0, strategy=FEW
)
STOP = feature("point", point_mm=[-40.0, 0.0, 0.0], direction=[-1.0, 0.0, 0.0])


@pytest.mark.parametrize(("datums", "free"), [
    ((), ("shift along x", "shift along y", "shift along z", "rotation about x", "rotation about y", "rotation about z")),
    ((TOP,), ("shift along x", "shift along y", "rotation about z")),
    ((TOP, FRONT), ("shift along x",)),
    ((TOP, FRONT, SIDE), ()),
    ((TOP, EDGE, STOP), ()),
    ((TOP, bore(0, 0)), ("rotation about z",)),
    ((TOP, bore(0, 0), bore(50, 0)), ()),
    ((TOP, bore(0, 0, "circle"), bore(50, 0, "circle")), ()),
    ((bore(0, 0), bore(50, 0)), ("shift along z",)),
    ((ball(0, 0, 0), ball(100, 0, 0)), ("rotation about x",)),
    ((ball(0, 0, 0), ball(100, 0, 0), ball(0, 100, 0)), ()),
    ((ball(0, 0, 0), ball(50, 0, 0), ball(100, 0, 0)), ("rotation about x",)),
    ((TOP, plane(0, 0, 1, at=(0, 0, -20))), ("shift along x", "shift along y", "rotation about z")),
])  # fmt: skip
def test_what_datums_leave_free(datums: tuple[Probed, ...], free: tuple[str, ...]) -> None:
    assert freedoms([(datum,) for datum in datums]) == free


def test_it_does_not_matter_where_the_part_has_its_origin() -> None:
    moved = [plane(0, 0, 1, at=(3000, -2000, 500)), bore(3000, -2000), bore(3050, -2000)]
    assert freedoms([(one,) for one in moved]) == ()
    assert freedoms([(one,) for one in moved[:2]]) == ("rotation about z",)


@pytest.mark.parametrize(("name", "known", "found"), [
    ("A", ["A"], ("A",)), ("A-B", ["A", "B"], ("A", "B")), ("A - B", ["A", "B"], ("A", "B")),
    # a hyphen in a name of its own
    ("A-B", ["A-B", "A", "B"], ("A-B",)), ("bore-1-bore-2", ["bore-1", "bore-2"], ("bore-1", "bore-2")),
    ("A1-A2-A3", ["A3", "A2", "A1"], ("A1", "A2", "A3")),
])  # fmt: skip
def test_a_datum_names_the_features_between_its_hyphens(name: str, known: list[str], found: tuple[str, ...]) -> None:
    assert members(name, known) == found


@pytest.mark.parametrize(("name", "known", "words"), [
    ("A-X", ["A", "B"], "there is no feature 'X' of the common datum 'A-X'"),
    ("a-b-c", ["a", "b-c", "a-b", "c"], "is 'a' and 'b-c', or 'a-b' and 'c'"),
    ("A-A", ["A"], "names 'A' twice"),
    ("-".join(["a"] * 49) + "-b", ["a", "a-a", "a-a-a"], "there is no feature 'b'"),
])  # fmt: skip
def test_a_name_that_says_no_features_is_refused(name: str, known: list[str], words: str) -> None:
    with pytest.raises(CmmUqError, match=words):
        members(name, known)


CONE = feature("cone", point_mm=[0.0, 0.0, 90.0], direction=[0.0, 0.0, -1.0], diameter_mm=10.0, angle_deg=60.0, inner=True,
               length_mm=5.0, strategy={"pattern": "points", "points": 8})  # fmt: skip


@pytest.mark.parametrize(("features", "kind"), [
    ((bore(0, 0), CONE), "line"), ((bore(0, 0), bore(0, 0, "circle")), "line"), ((bore(0, 0), ball(0, 0, 50)), "line"),
    ((ball(0, 0, 0), ball(90, 10, 5)), "line"), ((bore(0, 0), bore(50, 0)), "point"), ((bore(0, 0), TOP), "point"),
    ((TOP, plane(0, 0, -1, at=(0, 0, -20))), "plane"), ((STOP, SIDE), "plane"), ((TOP, FRONT), "point"),
])  # fmt: skip
def test_what_features_are_as_one_datum(features: tuple[Probed, ...], kind: str) -> None:
    assert as_one(features)[0] == kind


@pytest.mark.parametrize(("datums", "free"), [
    (((bore(0, 0), CONE),), ("shift along z", "rotation about z")),
    (((bore(0, 0), bore(50, 0)),), ("shift along z",)),
    # a circle alone says nothing of how it leans, two of them say it together
    (((bore(0, 0, "circle"), CONE),), ("shift along z", "rotation about z")),
    (((ball(0, 0, 0), ball(100, 0, 0), ball(0, 100, 0)),), ()),
    (((TOP, FRONT), SIDE), ()),
])  # fmt: skip
def test_what_common_datums_leave_free(datums: Any, free: tuple[str, ...]) -> None:
    assert freedoms([datum if isinstance(datum, tuple) else (datum,) for datum in datums]) == free


SEAT = {
    "kind": "cylinder", "direction": [1.0, 0.0, 0.0], "diameter_mm": 30.0, "inner": False, "length_mm": 20.0,
    "strategy": {"pattern": "sections", "sections": 2, "points": 8},
}  # fmt: skip


def shaft(*characteristics: dict[str, Any], **alignment: Any) -> Any:
    seats = [
        {**SEAT, "name": name, "point_mm": [x, 0.0, 0.0]} for name, x in (("A", 0.0), ("B", 200.0), ("gear", 100.0))
    ]
    face = {"name": "end", "kind": "plane", "point_mm": [-10.0, 0, 0], "direction": [-1.0, 0, 0], "diameter_mm": 20.0,
            "strategy": {"pattern": "circles", "circles": 2, "points": 6}}  # fmt: skip
    flat = {**face, "name": "key", "point_mm": [150.0, 0, 15.0], "direction": [0.0, 0, 1.0]}
    return plate(feature=[*seats, face, flat], characteristic=list(characteristics), alignment=alignment)


RUNOUT = {"name": "r", "what": "total_runout", "features": ["gear"], "datums": ["A-B"], "tolerance_mm": 0.02}


def test_a_shaft_on_its_two_seats_is_a_job() -> None:
    """Aligned by A-B, end and key; the runout of a seat itself is asked for too."""
    job = shaft(RUNOUT, {**RUNOUT, "name": "s", "features": ["A"]}, datums=["A-B", "end", "key"])
    plan = plan_of(job)
    refuse_unfit(job)
    assert [(one.name, one.features, one.kind) for one in plan.common] == [("A-B", ("A", "B"), "line")]
    assert np.array_equal(plan.rows_of("A-B"), np.r_[plan.rows["A"], plan.rows["B"]])


@pytest.mark.parametrize(("one", "alignment", "words"), [
    ({**RUNOUT, "datums": ["A-key"]}, {"best_fit": True}, "'A-key' is neither one axis nor one plane by the nominals"),
    ({**RUNOUT, "datums": ["A-X"]}, {"best_fit": True}, "there is no feature 'X' of the common datum 'A-X'"),
    (RUNOUT, {"datums": ["A-B", "end"]}, "do not fix the part: they leave free rotation about x"),
    (RUNOUT, {"datums": ["A-B", "A"]}, "'A' stands in two of these datums"),
    ({**RUNOUT, "what": "perpendicularity"}, {"best_fit": True}, "'gear' lies at 0° to 'A-B' by their nominals"),
])  # fmt: skip
def test_a_common_datum_that_does_not_serve_is_refused(one: dict[str, Any], alignment: Any, words: str) -> None:
    with pytest.raises(CmmUqError, match=words):
        shaft(one, **alignment)
