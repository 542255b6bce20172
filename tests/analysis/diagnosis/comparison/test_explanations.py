"""Which effects a diagnosis considers, those of other packages among them."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.analysis.diagnosis.comparison.explanations import Explanation, known_effects
from cmm_uq.artefacts import artefact_facts, artefact_of
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.base.plugins import BrokenPluginError
from cmm_uq.base.points import Machine, Points
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import EVERY
from cmm_uq.machine.physics.effect import FURTHER
from tests.artefacts.constructions import spheres
from tests.plugin.packages import OUTSIDE_EFFECTS, describe, install
from tests.recordings import TRAVEL, bar_facts, bars

BROKEN = """
from cmm_uq.machine.physics.effect import Effect, Parameter
class Torn(Effect):
    name, title, formula, mechanism, points_to = "torn", "Torn", "e = 0", "table", "the table: turn it round"
    coefficients = (Parameter("um", "µm", 1.0),)
    def basis(self, points, shape=()):
        return points.nothing
"""


def candidates(points: Points, named: tuple[str, ...] = ()) -> dict[str, Explanation]:
    model = RecordingModel(Ballbar(bar_facts(), points), ())
    values = np.array([size.nominal for size in model.artefact.sizes])
    return {explanation.name: explanation for explanation in known_effects(model, values, named)}


def test_what_needs_a_column_that_is_not_recorded_is_no_candidate(ballbar_points: Points) -> None:
    found = candidates(ballbar_points, ("scale_x",))
    assert found.keys() <= {name for name, effect in EVERY.items() if not effect.columns} - {"scale_x"}
    assert {"scale_y", "squareness_zx", "straightness_x_y", "rotation_x_x", "scale_curvature_z"} <= found.keys()


def test_what_needs_the_travel_is_no_candidate_where_the_job_does_not_give_it() -> None:
    points = bars(np.random.default_rng(2), 10, 400.0, Machine())
    assert not [name for name in candidates(points) if name.startswith(("straightness", "rotation"))]


def test_a_candidate_has_the_weight_of_its_effect(ballbar_points: Points) -> None:
    weights = {name: e.weight for name, e in candidates(ballbar_points).items()}
    assert weights.pop("artefact_temperature") == 0.3, "a bar's own, as it is thought of beside the machine's"
    assert weights == {name: 0.1 if EVERY[name].tier == FURTHER else 1.0 for name in weights}
    assert set(weights.values()) == {0.1, 1.0}


def test_a_fourth_of_an_idealised_effect_is_of_other_forms(ballbar_points: Points) -> None:
    for name, explanation in candidates(ballbar_points).items():
        rough = sum(member.weight for member in explanation.members if member.rough)
        own = sum(member.weight for member in explanation.members if not member.rough)
        if EVERY[name].idealised_over:
            assert rough / (rough + own) == pytest.approx(0.25)
        else:
            assert rough == 0


def test_scales_and_squarenesses_belong_together_where_the_artefact_is_longer_than_a_ball(
    ballbar_points: Points,
) -> None:
    six = {name for name, effect in EVERY.items() if effect.everywhere and not effect.of_artefact}
    assert {name for name, each in candidates(ballbar_points).items() if each.together} == six
    model = RecordingModel(artefact_of(artefact_facts(kind="sphere"), spheres()), ())
    found = known_effects(model, np.array([size.nominal for size in model.artefact.sizes]), ())
    assert six <= {each.name for each in found}
    assert not [each.name for each in found if each.together]


def test_a_guideway_has_no_other_form_along_an_axis_that_the_recording_hardly_moves() -> None:
    """Bars level at one height but for 1 µm: other forms of Z are no more than Z's own, by what they vary along 1 µm."""
    random = np.random.default_rng(4)
    placed, angle = bars(random, 12, 400.0, Machine("test machine", "XYZ", TRAVEL)), random.uniform(0, np.pi, 12)
    half = 200.0 * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(12)])
    xyz = np.array([450.0, 275.0, -100.0]) + np.stack([-half, half], axis=1).reshape(-1, 3)
    xyz[:, 2] += 1e-3 * random.standard_normal(len(xyz))
    found = candidates(placed.at(xyz))["straightness_z_x"]
    (own,) = (np.abs(member.columns).max() for member in found.members if not member.rough)
    rough = [np.abs(member.columns).max() for member in found.members if member.rough]
    assert max(rough) < 1.5 * own + 1e-3 * 150e-3


def test_an_outside_effect_is_a_candidate(
    ballbar_points: Points, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "beam_twist" not in candidates(ballbar_points)
    install(OUTSIDE_EFFECTS, tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    assert candidates(ballbar_points)["beam_twist"].weight == 1.0


def test_one_that_fails_ends_the_diagnosis_and_is_not_left_out(
    ballbar_points: Points, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "torn.py").write_text(BROKEN, encoding="utf-8")
    describe(tmp_path, "torn-effects", "3.0", {"cmm_uq.effects": {"torn": "torn:Torn"}})
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "torn", raising=False)
    with pytest.raises(BrokenPluginError, match="torn-effects"):
        candidates(ballbar_points)
