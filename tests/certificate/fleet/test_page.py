"""The page of a fleet and its lines for a terminal: short however many machines, and silent of what nobody can know."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from pypdf import PdfReader

from cmm_uq.certificate.document import Document, Overview, Table
from cmm_uq.certificate.pages.fleet import fleet_document
from cmm_uq.certificate.pages.fleet_summary import fleet_csv, fleet_data, fleet_summary
from cmm_uq.certificate.render import render_html, render_pdf
from cmm_uq.laboratory.due.fleet import FleetResult
from tests.certificate.fleets import alone, many, two
from tests.certificate.saying import strangers
from tests.certificate.test_every_layout import HEADS_RUN_TOGETHER, HIDDEN_COLUMNS
from tests.certificate.test_html_layout import CONTRASTS, OVERLAPS

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

ALL_VALUES = "What is usual, and how many machines matter"


def tables(document: Document) -> dict[str, Table]:
    return {
        block.caption: block for section in document.sections for block in section.blocks if isinstance(block, Table)
    }


def overview(found: FleetResult) -> Overview:
    shown = fleet_document(found).overview
    assert shown is not None
    return shown


def odd(found: FleetResult) -> FleetResult:
    """The same, its first machine not belonging."""
    of = found.values[0]
    return replace(found, values=(replace(of, belongs=np.arange(len(of.members)) > 0),))


@pytest.mark.long
def test_every_text_of_the_page_can_be_translated() -> None:
    """Of one machine, of two, of two of which one does not belong, and of thousands."""
    for found in (alone(), two(), odd(two()), many()):
        assert (
            strangers(fleet_document(found), "Scale a.ppm 7 in out Model Hall emcee fleet.json fleet.csv cmm-uq") == []
        )


def test_a_machine_beyond_its_limit_is_said_to_be_so_already() -> None:
    """And one that is far within has a date, or from when on it may cross."""
    rows = tables(fleet_document(two()))["Machines"].rows
    assert [(row[0], row[-3] == "already") for row in rows] == [("out", True), ("in", False)]


def test_of_thousands_of_machines_those_that_matter_are_listed() -> None:
    shown = tables(fleet_document(many()))
    soonest = shown["Machines beyond their limit, and those that cross it soonest"]
    assert [row[0] for row in soonest.rows] == [*map(str, range(19, 4, -1)), *map(str, range(1999, 1984, -1))]
    assert soonest.notes[-1] == "30 of 3000 machines; fleet.json and fleet.csv have all."
    unlike = shown["Machines that do not belong"]
    assert [row[0] for row in unlike.rows] == [*map(str, range(2999, 2984, -1))]
    assert unlike.notes[-1] == "15 of 40 machines; fleet.json and fleet.csv have all."


def test_the_models_and_places_with_most_machines_are_listed() -> None:
    usual = tables(fleet_document(many()))["Usual drift"]
    assert [row[0] for row in usual.rows] == ["Average machine", *(f"Model {m}" for m in range(20, 31)), "Place Hall"]
    assert usual.notes[-1] == "19 more models and places have fewer machines; fleet.json has all."


def test_one_table_has_all_values_and_how_many_machines_matter() -> None:
    """Day 0 and the 365 days after it have one crossing each."""
    (row,) = tables(fleet_document(many()))[ALL_VALUES].rows
    assert row == ("Scale (a.ppm)", "3000", "0.5 ± 0.2 ppm/year", "40", "20", "365")
    assert tables(fleet_document(alone()))[ALL_VALUES].rows[0][3:] == ("not compared", "–", "–")


@pytest.mark.long
def test_ten_times_the_machines_make_neither_the_page_nor_the_terminal_longer() -> None:
    few, more = many(3000), many(30_000)
    for a, b in zip(tables(fleet_document(few)).values(), tables(fleet_document(more)).values(), strict=True):
        assert len(a.rows) == len(b.rows)
    few_lines, more_lines = fleet_summary(few).rows, fleet_summary(more).rows
    assert len(few_lines) == len(more_lines) == 11
    assert max(len(text) for _, text in overview(more).rows) < 120


def test_a_fleet_without_limits_shows_those_that_drift_fastest() -> None:
    of = many(40).values[0]
    fast = replace(of.fleet.estimates, rate=-np.arange(40.0), crossing=None)
    found = FleetResult((replace(of, fleet=replace(of.fleet, estimates=fast)),), 1)
    assert [row[0] for row in tables(fleet_document(found))["Machines that drift fastest"].rows] == [
        str(i) for i in range(39, 24, -1)
    ]


def test_the_verdict_names_the_first_of_many_machines_and_counts_the_others() -> None:
    shown = overview(many())
    rows = dict(shown.rows)
    assert (shown.verdict, shown.standing) == ("40 machines drift unlike their fleet", "open")
    assert rows["Unlike the fleet"].startswith("2960, 2961, ")
    assert rows["Unlike the fleet"].endswith("2971 and 28 more")
    assert rows["Beyond a limit"].endswith("and 8 more")
    said = fleet_summary(many())
    assert [each.subject for each in said.verdicts] == [f"machine {i}" for i in range(2999, 2993, -1)]
    assert [str.__str__(text) for text in said.remarks] == [
        "34 more values of machines differ, less clearly: fleet.json has all",
        "20 machines are beyond a limit",
        "365 machines will probably be beyond a limit by 2000-09-02",
    ]


def test_machines_alike_of_which_one_is_beyond_its_limit_are_not_all_well() -> None:
    assert (overview(two()).verdict, overview(two()).standing) == ("No machine drifts unlike its fleet", "open")
    of = two().values[0]
    free = replace(of, fleet=replace(of.fleet, estimates=replace(of.fleet.estimates, crossing=None)))
    assert overview(replace(two(), values=(free,))).standing == "good"


def test_one_machine_is_neither_like_its_fleet_nor_unlike() -> None:
    """In no colour of a verdict, on the page, on paper and in a terminal."""
    shown, said = overview(alone()), fleet_summary(alone()).verdicts[0]
    assert (shown.verdict, shown.standing) == ("Not enough history to compare machines", "unknown")
    assert shown.rows == (("Compared", "0 machines of 1 have certificates of two days"),)
    assert (said.word, said.standing) == ("UNKNOWN", "unknown")
    page = render_html(fleet_document(alone()))
    assert 'class="overview unknown"' in page
    assert "No machine drifts unlike" not in page
    assert "Not enough history to compare machines: two at least need certificates of two days." in page
    paper = PdfReader(io.BytesIO(render_pdf(fleet_document(alone()), {}))).pages[0].extract_text()
    assert "? Not enough history to compare machines" in paper


def test_what_a_fleet_cannot_say_is_said() -> None:
    warnings = [str.__str__(text) for text in fleet_summary(alone()).warnings]
    assert warnings == [
        "Scale (a.ppm): 2 certificates state no uncertainty and cannot be weighed",
        "Scale (a.ppm): one machine is no fleet; what machines have in common is assumed, not learnt",
        "Scale (a.ppm): no machine has certificates of two days; drift is assumed, not learnt",
    ]
    assert fleet_data(alone())["values"][0]["machines"][0]["crossing"] is None


def test_the_table_for_spreadsheets_has_every_machine_and_nothing_that_computes() -> None:
    found = many(2100)
    of = found.values[0]
    cunning = replace(of.members[0], model='=HYPERLINK("x")')
    text = fleet_csv(fleet_data(replace(found, values=(replace(of, members=(cunning, *of.members[1:])),)))).decode()
    rows = list(csv.DictReader(io.StringIO(text)))
    assert [row["machine"] for row in rows] == [member.machine for member in of.members]
    assert rows[0]["model"] == '\'=HYPERLINK("x")'
    assert (rows[0]["already"], rows[0]["day_50"], rows[0]["belongs"]) == ("1.0", rows[0]["last"], "True")
    assert (rows[-1]["day_50"], rows[-1]["p"], rows[-1]["belongs"]) == ("", repr(0.1 / 2100), "False")
    assert len(list(csv.DictReader(io.StringIO(fleet_csv(fleet_data(alone())).decode())))) == 1


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    context = browser.new_context(bypass_csp=True)  # axe is a script, and the page allows none
    yield context.new_page()
    context.close()


@pytest.mark.long
@pytest.mark.parametrize("fleet", [alone, many])
def test_nothing_is_off_a_screen_of_any_width_and_everybody_can_read_it(
    page: Page, fleet: Callable[[], FleetResult], tmp_path: Path
) -> None:
    path = tmp_path / "fleet.html"
    path.write_text(render_html(fleet_document(fleet())), encoding="utf-8")
    page.goto(path.as_uri())
    for width in (360, 1280):
        page.set_viewport_size({"width": width, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        for wrong in (HIDDEN_COLUMNS, HEADS_RUN_TOGETHER, OVERLAPS):
            assert page.evaluate(wrong) == []
    assert [one["id"] for one in Axe().run(page).response["violations"]] == []
    assert min(page.evaluate(CONTRASTS)) >= 4.5
