"""Candidates are placings that the machine and the fixtures allow, all of them and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.analysis.planning.candidates import candidates
from cmm_uq.analysis.planning.set_up import direction_words, join, lines
from cmm_uq.analysis.planning.setting import Start
from cmm_uq.artefacts import artefact_of
from cmm_uq.base.errors import CmmUqError
from tests.analysis.planning.plans import BALLBAR, EVERY_KIND, GAUGE, setting

KINDS = [kind for kind in EVERY_KIND if kind != "shift"]


@pytest.mark.parametrize("kind", KINDS)
def test_candidates_lie_inside_and_can_be_recorded(kind: str) -> None:
    facts, wishes = EVERY_KIND[kind]
    chosen = setting(facts, candidates=60, fixtures={"heights_mm": [-450.0, -150.0]}, **wishes)
    found = candidates(chosen)
    assert 10 < len(found) <= 60
    for placing in found:
        assert np.all(placing.points.machine_xyz >= chosen.volume.box[:, 0] - 1e-6)
        assert np.all(placing.points.machine_xyz <= chosen.volume.box[:, 1] + 1e-6)
        if kind != "sphere":  # of a hemisphere the ball is held, not the middle of its points
            assert -450.0 - 1e-6 <= placing.middle[2] <= -150.0 + 1e-6
    assert len(artefact_of(facts, join(found)).noise_scale) >= len(found)


def test_a_bar_is_laid_only_where_a_fixture_holds_it() -> None:
    found = candidates(setting(BALLBAR, fixtures={"directions": [[1.0, 0.0, 0.0], [0.0, 1.0, 1.0]]}))
    bars = {tuple(np.abs(p.points.xyz[1] - p.points.xyz[0]).round(1).tolist()) for p in found}
    assert bars == {(400.0, 0.0, 0.0), (0.0, 282.8, 282.8)}


def test_an_artefact_that_fits_nowhere_is_refused() -> None:
    with pytest.raises(CmmUqError, match="no placing is possible"):
        candidates(setting(BALLBAR.model_copy(update={"length_mm": 3000.0})))


def test_a_direction_in_which_nothing_fits_is_refused() -> None:
    upright = setting(BALLBAR.model_copy(update={"length_mm": 700.0}), fixtures={"directions": [[0.0, 0.0, 1.0]]})
    with pytest.raises(CmmUqError, match="no placing is possible"):
        candidates(upright)


def test_a_shift_job_has_nothing_to_choose_from() -> None:
    facts, _ = EVERY_KIND["shift"]
    with pytest.raises(CmmUqError, match="no other placings"):
        candidates(setting(facts, named=()))


def test_a_recorded_placing_is_tried_elsewhere_as_it_was_recorded() -> None:
    chosen = setting(GAUGE, length_mm=400.0)
    recorded = candidates(chosen)[40]
    found = candidates(chosen, Start(chosen.observed(recorded.points), recorded))
    assert "as recorded" in {placing.title for placing in found}
    lengths = {round(float(np.linalg.norm(p.points.xyz[-1] - p.points.xyz[0])), 6) for p in found}
    assert len(lengths) == 1


def test_directions_are_named_as_an_operator_says_them() -> None:
    assert direction_words(np.array([-1.0, 0.0, 0.0])) == "along X"
    assert direction_words(np.array([-1.0, 1.0, 0.0])) == "along +X −Y"
    assert direction_words(np.array([0.0, 1.0, 1.0])) == "along +Y +Z, inclined 45°"


def test_the_diagonals_of_a_cube_are_those_of_its_directions() -> None:
    assert len(lines(np.full(3, 500.0))) == 13
    assert len(lines(np.array([900.0, 500.0, 300.0]))) > 13
