"""What a job asks for that is not modelled is refused by its name, with what to do instead."""

from __future__ import annotations

from typing import Any

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.part.job import TABLES
from tests.jobs.part.parts import plate

SIZE, POSITION = TABLES["characteristic"][:2]
BORE = TABLES["feature"][3]


@pytest.mark.parametrize(("changed", "words"), [
    ({"what": "surface_profile"}, "is the profile of a surface, which is not modelled"),
    ({"what": "profile of a line"}, "is the profile of a line, which is not modelled"),
    ({"material_condition": "M"}, "holds at maximum material condition"), ({"mmc": True}, "at maximum material condition"),
    ({"modifier": "LMC"}, "holds at least material condition"), ({"modifier": "(LP)"}, "is a two-point size"),
    ({"association": "two_point"}, "is a two-point size"), ({"free_state": True}, "in the free state"),
    ({"projected_zone_mm": 10.0}, "has a projected tolerance zone"),
])  # fmt: skip
def test_a_tolerance_that_is_not_modelled(changed: dict[str, Any], words: str) -> None:
    with pytest.raises(CmmUqError, match=f"{words}.*\\[part\\] not_measured"):
        plate(characteristic=[SIZE, {**POSITION, **changed}])


@pytest.mark.parametrize("pattern", ["scan", "scanning", "Continuous"])
def test_a_feature_that_is_scanned(pattern: str) -> None:
    scanned = {**BORE, "strategy": {"pattern": pattern, "points": 1000}}
    with pytest.raises(CmmUqError, match=r"is scanned: what scanning adds .* plan it by points"):
        plate(feature=[*TABLES["feature"][:3], scanned])
