"""The page of a plan says in words what the design leaves free, and draws what it plans."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.analysis.planning.candidates import ready_plan
from cmm_uq.app.commands.plans.page import combination, plan_document
from cmm_uq.app.commands.plans.plan import plan_results
from cmm_uq.app.commands.plans.planning import MeasurementPlan, make_plan
from cmm_uq.app.commands.reading import read_job
from cmm_uq.certificate.origin import as_json
from cmm_uq.certificate.plots.plans import gain_plot, placing_pictures
from cmm_uq.certificate.render.html import render_html
from tests.analysis.planning.plans import EVERY_KIND, setting
from tests.app.commands.test_planning import JOB, SIX


def plan_of(folder: Path, plan: str, length: str = "400.0") -> MeasurementPlan:
    text = JOB.format(plan=plan, effects=SIX, length=length)
    if not length:
        text = text.replace("length_mm = \nu_um = 0.5\n", "")
    (folder / "job.toml").write_text(text, encoding="utf-8")
    return make_plan(read_job(folder, recorded=False), power=False)


def test_a_free_scale_is_said_in_words(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, "length_mm = 400.0", length="")
    page = render_html(plan_document(plan))
    assert "Scale error of X, Y and Z together, with the artefact&#39;s own length" in page
    assert "Not determined by these placings" in page


@pytest.mark.parametrize(("parts", "said"), [
    ({("scale_x", "ppm"): 1.0, ("artefact_sag", "um"): -2.5}, "Scale error of X and Sag of the artefact together"),
    ({("squareness_yz", "angle_arcsec"): 1.0}, "Squareness Y–Z: nothing shows of it"),
    ({("artefact", "length_mm"): 1.0}, "The artefact's own length"),
    ({("artefact", "block_12_mm"): 1.0, ("scale_x", "ppm"): 1.0, ("artefact", "block_23_mm"): 1.0},
     "Scale error of X, with the artefact's own dimensions"),
])  # fmt: skip
def test_combinations_in_words(parts: dict[tuple[str, str], float], said: str) -> None:
    assert combination(parts) == said


@pytest.mark.parametrize("kind", EVERY_KIND)
def test_every_artefact_has_a_picture_of_each_placing(kind: str) -> None:
    facts, wishes = EVERY_KIND[kind]
    chosen = setting(facts, named=(), **wishes)
    _, placings = ready_plan(chosen)
    plots = placing_pictures(placings, chosen.volume.box, 1)
    assert len(plots) == -(-len(placings) // 3)
    svg = "".join(plot.svg for plot in plots)
    for number, placing in enumerate(placings, 1):
        assert re.search(rf">\s*{number}\s*<", svg)
        assert placing.ends in svg


def test_what_has_no_end_stands_at_the_edge() -> None:
    plot = gain_plot(["A", "B"], [2.0, None], [1.0, np.inf], names=("before", "after"), quantity="Uncertainty")
    assert "A: 2 before, 1 after" in plot.alternative
    assert "B: not at all before, not at all after" in plot.alternative
    assert "nan" not in plot.svg


def test_a_shift_job_says_what_no_reading_shows() -> None:
    from tests.conftest import ROOT

    plan = make_plan(read_job(ROOT / "examples" / "shift-simulated", recorded=False), power=False)
    assert "No reading shows: errors that repeat every 10 mm" in render_html(plan_document(plan))


def test_conditions_that_are_not_met_are_a_warning(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, "budget_min = 60")
    assert "Not met: at most 60 min: 120 min." in plan_document(plan).warnings


def test_results_hold_finite_numbers_only(tmp_path: Path) -> None:
    data = plan_results(plan_of(tmp_path, "length_mm = 400.0", length=""))
    assert b"NaN" not in as_json(data)
    assert {p["u"] for p in data["start"]["determined"] if p["status"] == "free"} == {None}


def test_what_is_not_known_of_the_noise_is_said(tmp_path: Path) -> None:
    page = render_html(plan_document(plan_of(tmp_path, "")))
    assert "averaged over the prior" in page
    assert "u is the geometric mean" in page
    stated = plan_of(tmp_path, "placing_um = 1.0\ngrowth_um = 0.0")
    page = render_html(plan_document(stated))
    assert "averaged over" not in page
    # 20 placings of 20 s a bar: from four repeats on, see test_repeats.py; certificates set scales apart
    data = plan_results(stated)
    assert data["noise"]["placing_um"] == pytest.approx(1.0)
    assert data["repeats"]["rows"][2]["readings"] == 120
    assert "a minute of one more placing lowers every expected uncertainty more" in page


def test_repeats_beyond_what_they_are_worth_are_named(tmp_path: Path) -> None:
    page = render_html(plan_document(plan_of(tmp_path, "placing_um = 5.0\ngrowth_um = 0.0\nrepeats = 5")))
    assert "With 1 or more repeats" in page
    assert "fewer repeats and more placings would tell more in the same time" in page


def test_a_table_has_one_figure_in_brackets_for_one_more_placing(tmp_path: Path) -> None:
    data = plan_results(plan_of(tmp_path, "placing_um = 1.0\ngrowth_um = 0.0"))
    row = data["repeats"]["rows"][2]
    now, more = (one["u"]["squareness_xy.angle_arcsec"] for one in (row, row["one_placing_more"]))
    assert more / now == pytest.approx(np.sqrt(20 / 21), rel=1e-9)
    (determined,) = [p for p in data["start"]["determined"] if p["effect"] == "squareness_xy"]
    assert determined["u"] == pytest.approx(now, rel=1e-9)
