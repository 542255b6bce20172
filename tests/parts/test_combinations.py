"""Every kind of feature × strategy × association × characteristic is evaluated on a plan, or refused in words."""

from __future__ import annotations

from typing import Any, get_args

import numpy as np
import pytest
from pydantic import ValidationError

from cmm_uq.commands.part_plan import plan_of
from cmm_uq.errors import CmmUqError
from cmm_uq.jobs.part.beginning import TABLES
from cmm_uq.jobs.part.characteristic import ASKS, CharacteristicFacts, What
from cmm_uq.jobs.part.checks import unfit
from cmm_uq.jobs.part.drawing_checked import probed_of
from cmm_uq.jobs.part.feature import PATTERNS, Association, Kind
from cmm_uq.parts.causes import Scatter
from cmm_uq.parts.evaluating import Evaluator
from tests.jobs.part.parts import plate

ROUND = {"diameter_mm": 30.0, "inner": True}
OF: dict[str, dict[str, Any]] = {
    "point": {}, "plane": {"length_mm": 40.0, "width_mm": 30.0}, "line": {"length_mm": 40.0, "normal": [0.0, -1.0, 0.0]},
    "circle": ROUND, "sphere": {**ROUND, "cap_deg": 120.0}, "cylinder": {**ROUND, "length_mm": 20.0},
    "cone": {**ROUND, "length_mm": 20.0, "angle_deg": 40.0},
}  # fmt: skip
PROBED: dict[str, dict[str, Any]] = {
    "points": {"points": 24}, "grid": {"rows": 4, "columns": 5}, "sections": {"sections": 3, "points": 8},
    "lines": {"lines": 6, "points": 4}, "circles": {"circles": 2, "points": 8}, "spiral": {"turns": 3.0, "points": 24},
}  # fmt: skip
AXIS = {"name": "axis", "kind": "cylinder", "point_mm": [60.0, 40.0, -60.0], "direction": [0.0, 0.0, 1.0],
        "diameter_mm": 20.0, "inner": False, "length_mm": 40.0,
        "strategy": {"pattern": "sections", "sections": 3, "points": 8}}  # fmt: skip
FACES = TABLES["feature"][:3]

MEANT: dict[str, tuple[str, ...]] = {
    "point": ("distance", "position", "x", "y", "z"),
    "line": ("straightness", "distance", "angle", "perpendicularity", "angularity", "parallelism", "position", "coaxiality"),
    "plane": ("flatness", "distance", "angle", "parallelism", "perpendicularity", "angularity", "position", "circular_runout",
              "total_runout"),
    "circle": ("size", "roundness", "distance", "position", "coaxiality", "x", "y", "z", "circular_runout"),
    "sphere": ("size", "sphericity", "distance", "position", "x", "y", "z"),
    "cylinder": ("size", "cylindricity", "distance", "angle", "parallelism", "perpendicularity", "angularity", "position",
                 "coaxiality", "x", "y", "z", "circular_runout", "total_runout"),
    "cone": ("distance", "angle", "parallelism", "perpendicularity", "angularity", "position", "coaxiality", "x", "y", "z"),
}  # fmt: skip
"""What each kind has, by ISO 1101 and ISO 14405-1, as docs/machine/parts.md lists it."""

FITTED: dict[str, tuple[str, ...]] = {
    "point": ("least_squares",), "line": ("least_squares", "minimum_zone", "tangent"),
    "plane": ("least_squares", "minimum_zone", "tangent"), "cone": ("least_squares", "minimum_zone"),
    **dict.fromkeys(("circle", "sphere", "cylinder"),
                    ("least_squares", "minimum_zone", "maximum_inscribed", "minimum_circumscribed")),
}  # fmt: skip

VALUE = {"size": 30.0, "x": 60.0, "y": 40.0, "z": 15.0, "distance": 15.0}
"""mm, of the feature at (60, 40, 15) over the face A at z = 0."""


def feature(kind: str, pattern: str | None, how: str) -> dict[str, Any]:
    keys = dict(OF[kind])
    cap = {"cap_deg": keys.pop("cap_deg")} if "cap_deg" in keys else {}
    if pattern in ("circles", "spiral") and kind == "plane":
        keys = {"diameter_mm": 40.0}
    along = {} if kind == "sphere" else {"direction": [1.0, 0.0, 0.0] if kind == "line" else [0.0, 0.0, 1.0]}
    probed = {"strategy": {"pattern": pattern, **PROBED[pattern], **cap}} if pattern else {}
    return {"name": "f", "kind": kind, "point_mm": [60.0, 40.0, 15.0], **along, **keys, **probed, "association": how}


def characteristic(what: str, datum: str, *, alone: bool = False) -> dict[str, Any]:
    asks = ASKS[what]  # type: ignore[index]
    found: dict[str, Any] = {"name": f"{what} {datum} {alone}", "what": what}
    found["features"] = ["f", "A"] if asks.features == 2 and not alone else ["f"]
    if asks.datums:
        found["datums"] = [datum]
    return found | ({"tolerance_mm": 0.05} if asks.limits == "zone" else {})


ASKED = [characteristic(what, datum) for what in get_args(What) for datum in ("A", "axis")] + [
    characteristic("angle", "A", alone=True)
]


def accepted(given: dict[str, Any]) -> tuple[list[dict[str, Any]], list[str]]:
    """Characteristics of a feature that a job takes, and why it refuses the others."""
    features = {one["name"]: probed_of(one) for one in (*FACES, AXIS, given)}
    taken, told = [], []
    for one in ASKED:
        found = unfit(CharacteristicFacts.model_validate(one), features)
        if found is None:
            taken.append(one)
        else:
            told.append(f"{found[0]}. {found[2]}")
    return taken, told


@pytest.mark.parametrize(("kind", "pattern"), [(k, p) for k in get_args(Kind) for p in PATTERNS[k] or (None,)])
def test_what_a_feature_has_is_evaluated_and_all_else_is_refused(kind: str, pattern: str | None) -> None:
    """At nominal points each association is the nominal feature; with noise of 1 µm every value is a number."""
    for how in get_args(Association):
        given = feature(kind, pattern, how)
        if how not in FITTED[kind]:
            with pytest.raises(CmmUqError, match=f"a {kind} has no association '{how}': give one of"):
                probed_of(given)
            continue
        taken, told = accepted(given)
        assert {one["what"] for one in taken} == set(MEANT[kind])
        assert all("'f'" in words or "is about" in words for words in told)
        runouts = [one for one in taken if one["what"] == "circular_runout"]
        checked(given, [one for one in taken if one not in runouts])
        if runouts and (kind, pattern) in IN_SECTIONS:
            checked(given, runouts)
        elif runouts:
            with pytest.raises(CmmUqError, match="no section of 'f' has 3 points"):
                checked(given, runouts)


IN_SECTIONS = (
    ("cylinder", "sections"), ("cylinder", "lines"), ("circle", "points"), ("plane", "circles"), ("plane", "grid"),
)  # fmt: skip
"""Patterns with three points and more on a circle about the axis."""


def checked(given: dict[str, Any], asked: list[dict[str, Any]]) -> None:
    """What nominal points say of each is what is meant, and what noise makes of it is a number."""
    plan = plan_of(plate(feature=[*FACES, AXIS, given], characteristic=asked))
    noise = Scatter.of("noise", "noise", np.full((len(plan.points), 3), 1e-3))
    evaluator = Evaluator(plan, np.zeros_like(plan.points), [noise])
    drawn = noise.draw(np.random.default_rng(1), 3)
    assert all(np.isfinite(evaluator([drawn], exact=exact)).all() for exact in (False, True))
    values = Evaluator(plan, np.zeros_like(plan.points), [])([], exact=True)[0]
    for one, value in zip(asked, values, strict=True):
        assert_meant(given["kind"], one, float(value))


def assert_meant(kind: str, one: dict[str, Any], value: float) -> None:
    what: What = one["what"]
    if kind == "line" and what == "coaxiality":  # it lies across the axis: what it is then nobody asks
        return
    if ASKS[what].limits == "zone":
        assert value == pytest.approx(0.0, abs=1e-6)
    elif what == "angle":
        expected = 40.0 if len(one["features"]) == 1 else 90.0 if kind == "line" else 0.0
        assert np.degrees(value) == pytest.approx(expected, abs=1e-5)
    else:
        assert value == pytest.approx(VALUE[what], abs=1e-6)


def test_a_pattern_that_a_kind_is_not_probed_by_is_refused() -> None:
    for kind in get_args(Kind):
        for pattern in set(PROBED) - set(PATTERNS[kind]):
            words = "is probed at point_mm" if kind == "point" else f"a {kind} is not probed by the pattern '{pattern}'"
            with pytest.raises((CmmUqError, ValidationError), match=f"{words}|needs diameter_mm"):
                probed_of(feature(kind, pattern, "least_squares"))
