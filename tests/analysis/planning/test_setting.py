"""Which effects a plan considers besides those that the job names."""

from __future__ import annotations

from pathlib import Path

import pytest

from cmm_uq.base.points import Points
from cmm_uq.machine.physics.catalogue import CATALOGUE
from tests.analysis.planning.plans import BALLBAR, SIX, setting
from tests.plugin.packages import OUTSIDE_EFFECTS, install


def test_by_default_the_linear_ones_of_the_first_tier_that_the_columns_allow(ballbar_points: Points) -> None:
    rivals = {effect.name for effect in setting(BALLBAR).rivals(ballbar_points)}
    assert rivals == {name for name, effect in CATALOGUE.items() if not effect.columns and not effect.shape} - set(SIX)


def test_an_outside_effect_is_among_them_and_can_be_listed_by_name(
    ballbar_points: Points, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(OUTSIDE_EFFECTS, tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    rivals = setting(BALLBAR).rivals(ballbar_points)
    assert rivals[-1].name == "beam_twist"
    (listed,) = setting(BALLBAR, rivals=["beam_twist"]).rivals(ballbar_points)
    assert listed.title == "Twist of the beam"
