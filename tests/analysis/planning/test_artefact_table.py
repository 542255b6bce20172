"""The table of artefacts and factors in the docs is what the design says."""

from __future__ import annotations

from benchmarks.planning.artefact_table import BEGIN, END, column, table
from tests.conftest import ROOT


def test_the_page_shows_the_table_as_it_is_computed() -> None:
    page = (ROOT / "docs" / "planning.md").read_text(encoding="utf-8")
    assert page.split(BEGIN)[1].split(END)[0].strip() == table()


def test_what_is_known_of_some_artefacts_stands_in_it() -> None:
    """Bows of Z pass for squareness on a triangle, sag for scales on a ballbar; a level surface shows no scale."""
    assert column("triangle")["straightness_z_x"] == "as squareness zx"
    assert column("ballbar")["artefact_sag"] == "as scale x, scale y"
    assert column("plane")["scale_z"] == "not seen"
    assert column("step_gauge")["rotation_x_y"].startswith("like rotation y x")
