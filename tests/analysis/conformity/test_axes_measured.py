"""ISO 230-2 of axes: over how much of their travel, which of them, and temperatures that act by no coefficient."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cmm_uq.analysis.conformity.standards import statement
from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.axis_runs.artefact import AxisRuns
from cmm_uq.base.points import Points
from cmm_uq.jobs.tables.conformity import Circumstances, ConformityFacts, TestUncertainty
from cmm_uq.machine.model.kind import POSITIONING
from tests.analysis.conformity.tests_by_hand import changing
from tests.artefacts.test_axis_runs import joined, run

FACTS = artefact_facts(kind="axis_runs", u_scale_um_per_m=0.1)
WISH = ConformityFacts(standard="ISO 230-2:2014", limit_um=20.0, rule="ISO 14253-1")
TRAVEL = np.array([[0.0, 900.0], [-600.0, 600.0], [-600.0, 0.0]])


def recorded(longest: float, *axes: int, travel: Any = TRAVEL) -> Points:
    """Nine targets from the lower end of X, five times either way, and of Y and Z where these are named."""
    random, runs = np.random.default_rng(7), []
    for axis in (0, *axes):
        first = TRAVEL[axis, 0]
        rows = run(axis + 1, np.eye(3)[axis], axis=axis, at=first + np.linspace(0.0, longest, 9), repeats=5)
        rows["reading_um"] = random.normal(size=len(rows["xyz"]))
        runs.append(rows)
    points = joined(*runs)
    return replace(points, machine=replace(points.machine, travel_mm=travel))


def decided(points: Points, under: Circumstances) -> Statement:
    return statement(WISH, AxisRuns(FACTS, points), {}, "[[conformity]] 1", (POSITIONING,), None, under)


UNDER = changing(0.05)


@pytest.mark.parametrize(
    ("longest", "lacks"), [(601.0, ()), (599.0, ("two thirds of the travel of X (599 of 900 mm)",))]
)
def test_a_part_of_an_axis_is_no_test_of_it(longest: float, lacks: tuple[str, ...]) -> None:
    found = decided(recorded(longest), UNDER)
    assert tuple(map(str, found.missing)) == lacks
    assert found.outcome == ("incomplete" if lacks else "pass")


def test_targets_that_crowd_at_one_end_are_no_test_of_the_axis() -> None:
    """Eight of nine targets within 60 mm of 800 mm: five a metre, and nothing seen of the middle."""
    points = recorded(800.0)
    crowded = np.where(points.xyz[:, 0] < 750.0, points.xyz[:, 0] / 12.0, points.xyz[:, 0])
    found = decided(points.at(np.column_stack([crowded, points.xyz[:, 1:]])), UNDER)
    assert (found.outcome, *map(str, found.missing)) == (
        "incomplete", "measurement 1: 5 runs, 9 targets, 93 % of the run without one",
    )  # fmt: skip


def test_of_a_travel_that_nobody_states_no_part_is_known() -> None:
    found = decided(recorded(800.0, travel=np.full((3, 2), np.nan)), UNDER)
    assert found.outcome == "incomplete"
    assert [str(one) for one in found.missing] == ["the travel of X ([machine] travel_mm), of which its run is a part"]


def test_axes_that_no_run_is_of_are_named() -> None:
    said = [str(one) for one in decided(recorded(601.0), UNDER).remarks]
    assert "Of X alone: nothing is said of Y, Z." in said
    assert not any("nothing is said" in str(one) for one in decided(recorded(590.0, 1, 2), UNDER).remarks)


@pytest.mark.parametrize(("cte", "lacks"), [(None, 1), (11.5e-6, 0)])
def test_a_temperature_that_acts_by_no_coefficient_is_no_uncertainty(cte: float | None, lacks: int) -> None:
    stated = UNDER.uncertainty.model_dump(exclude_none=True) | {"u_temperature_k": 5.0}
    stated["negligible"] = {k: v for k, v in (stated.get("negligible") or {}).items() if k != "temperature"}
    under = replace(UNDER, uncertainty=TestUncertainty.model_validate(stated), cte_per_k=cte)
    found = decided(recorded(800.0), under)
    assert len(found.missing) == lacks
    assert all("no expansion coefficient by which it acts" in str(one) for one in found.missing)
    assert found.u_um > 10.0 or cte is None  # 5 K of 800 mm of steel: 46 µm
