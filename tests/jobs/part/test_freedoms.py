"""Datums leave free the motions under which all of them are invariant (ISO 5459, classes of invariance)."""

from __future__ import annotations

from typing import Any

import pytest

from cmm_uq.jobs.part.freedoms import freedoms
from cmm_uq.jobs.part.probed import Probed
from tests.jobs.part.parts import feature

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
