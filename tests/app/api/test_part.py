"""``cmm_uq.part``: what it gives is what the command writes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import cmm_uq
from cmm_uq.app.api.outcomes import Part
from cmm_uq.jobs.part.job import TABLES
from tests.part_machines import THERE, by_results, plate_of


@pytest.fixture(scope="module")
def part() -> Part:
    job = plate_of(by_results(), np.zeros((60, 3)), characteristic=TABLES["characteristic"][:2], **THERE)
    return cmm_uq.part(job, trials=1000, seed=2, language="de")


def test_figures_are_tables_by_characteristic(part: Part) -> None:
    assert list(part.characteristics.index) == ["1", "2"]
    row = part.characteristics.loc["1"]
    assert row["U"] == pytest.approx((row["interval_upper"] - row["interval_lower"]) / 2)
    assert (row["unit"], row["lower"], row["upper"]) == ("mm", 29.95, 30.05)
    assert row["outcome"] == part.results["characteristics"][0]["decision"]["outcome"]
    assert part.correlation.loc["1", "1"] == 1
    assert part.budget["1"].sum() == pytest.approx(1, abs=0.1)  # causes of a diameter add up


def test_it_says_itself_in_a_line_and_in_a_notebook(part: Part) -> None:
    assert repr(part).startswith("<Part of plate: 2 characteristics, ")
    assert "<table" in part._repr_html_()
    assert part.conforming == (part.found.outcome == "pass")


def test_it_writes_what_the_command_writes(part: Part, tmp_path: Path) -> None:
    files = part.write(tmp_path / "out")
    data = json.loads(files["results.json"].read_bytes())
    assert data["simulation"]["seed"] == 2
    assert data["job"]["language"] == "de"
    assert 'lang="de"' in files["part-simulated.html"].read_text(encoding="utf-8")
