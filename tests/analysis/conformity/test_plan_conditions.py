"""Ready plans against what their standards ask for."""

from __future__ import annotations

import pytest

from cmm_uq.analysis.conformity.plan_conditions import conditions
from cmm_uq.analysis.conformity.plans import ISO_10360_5, READY
from cmm_uq.analysis.planning.candidates import ready_plan
from cmm_uq.analysis.planning.set_up import join
from cmm_uq.artefacts import artefact_of
from tests.analysis.planning.plans import EVERY_KIND, setting


def unmet(kind: str, **wishes: object) -> list[str]:
    facts, usual = EVERY_KIND[kind]
    chosen = setting(facts, **{**usual, **wishes})
    name, placings = ready_plan(chosen)
    return [c.what for c in conditions(READY[name], artefact_of(facts, join(placings)), recorded=False) if not c.met]


@pytest.mark.parametrize("kind", ["ballbar", "sphere"])
def test_plans_of_a_standard_keep_it(kind: str) -> None:
    assert unmet(kind) == []


def test_a_gauge_as_long_as_the_space_diagonal_keeps_all_conditions() -> None:
    """Travel 900 × 800 × 600 mm: diagonal 1345 mm, of which 1000 mm are 74 %; faces every 20 mm, the shortest 20 mm."""
    assert unmet("step_gauge", length_mm=1000.0) == []


def test_a_short_gauge_misses_two_thirds_of_the_diagonals() -> None:
    (said,) = unmet("step_gauge", length_mm=600.0)
    # 600 mm of 1345 mm
    assert said == "longest length at least 66 % of the travel along each line: 45 % to 97 %"


def test_fewer_lengths_or_repeats_are_said() -> None:
    said = unmet("step_gauge", length_mm=1000.0, lengths_mm=[25.0, 500.0, 1000.0], repeats=2)
    assert any(text.startswith("5 lengths on each line: 2 to 3") for text in said)
    assert any("105 lengths in all" in text for text in said)


def test_blocks_on_one_line_count_together() -> None:
    said = unmet("gauge_blocks", lengths_mm=[25.0, 150.0, 300.0, 450.0, 560.0])
    assert not any("5 lengths" in text or "shortest" in text for text in said)


def test_a_shortest_length_above_thirty_millimetres_is_said() -> None:
    said = unmet("step_gauge", length_mm=1000.0, lengths_mm=[100.0, 200.0, 400.0, 550.0, 1000.0])
    assert "shortest length at most 30 mm: 100 mm" in said


def test_an_artefact_that_is_no_sphere_has_no_points_on_one() -> None:
    facts, usual = EVERY_KIND["ballbar"]
    artefact = artefact_of(facts, join(ready_plan(setting(facts, **usual))[1]))
    assert conditions(ISO_10360_5, artefact, recorded=True) == ()
