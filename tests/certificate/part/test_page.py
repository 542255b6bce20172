"""A part's page says what was found of it, and nothing else: figures, verdicts, causes, and what is missing.

A part in a few lines: what to measure on the machine is named with its file, set-ups are left to the page.
"""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from decimal import Decimal
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from cmm_uq.analysis.conformity.decision import Outcome
from cmm_uq.analysis.conformity.limits import LimitDecision
from cmm_uq.analysis.parts.budget import PointErrors
from cmm_uq.analysis.parts.characteristics import never_negative
from cmm_uq.base.messages import say
from cmm_uq.certificate.clauses import of_a_part
from cmm_uq.certificate.document import Document, Overview, Section, Table
from cmm_uq.certificate.part.budget_section import by_family, unseen_section, ways_section
from cmm_uq.certificate.part.figures import _remarks
from cmm_uq.certificate.part.measurement import FurtherSetUps, PartMeasurement, UnseenError
from cmm_uq.certificate.part.method import machine_section, method_section
from cmm_uq.certificate.part.page import errors_section, overview_of, part_document, results_section
from cmm_uq.certificate.render import render_html, render_pdf
from cmm_uq.certificate.wording import effect_title
from cmm_uq.jobs.part.job import TABLES
from tests.certificate.parts_found import ERRORS, STANDING as CERTIFICATE, found_of, measured_points
from tests.certificate.saying import leaves, strangers
from tests.certificate.test_completeness import mentioned
from tests.certificate.test_html_layout import LABELS_COLLIDING, OVERLAPS
from tests.jobs.part.parts import plate

if TYPE_CHECKING:
    from playwright.sync_api import Browser

LONG = "Bohrung für den Passstift am Flansch des Getriebegehäuses, Ausführung links, vierte von oben"
STYLI = [
    {"name": "down", "diameter_mm": 4.0, "offset_mm": [0.0, 0.0, -150.0], "u_diameter_um": 0.3},
    {"name": "side", "diameter_mm": 3.0, "offset_mm": [0.0, 40.0, -120.0], "u_offset_um": [0.5, 0.5, 0.5]},
]
KINDS: list[dict[str, Any]] = [
    {"name": LONG, "kind": "cone", "point_mm": [30.0, 40.0, -5.0], "direction": [0.0, 0.0, 1.0], "diameter_mm": 16.0,
     "angle_deg": 60.0, "inner": True, "length_mm": 8.0, "stylus": "down",
     "strategy": {"pattern": "sections", "sections": 3, "points": 8, "margin_mm": 1.0}},
    {"name": "ball", "kind": "sphere", "point_mm": [90.0, 40.0, 12.0], "diameter_mm": 24.0, "inner": False, "stylus": "side",
     "strategy": {"pattern": "points", "points": 15}},
    {"name": "edge", "kind": "line", "point_mm": [60.0, 80.0, -5.0], "direction": [1.0, 0.0, 0.0], "normal": [0.0, 1.0, 0.0],
     "length_mm": 100.0, "stylus": "side", "strategy": {"pattern": "points", "points": 9}},
    {"name": "spot", "kind": "point", "point_mm": [10.0, 10.0, 0.0], "direction": [0.0, 0.0, 1.0], "stylus": "down"},
]  # fmt: skip
CHARACTERISTICS = [
    {"name": "tilt", "what": "angle", "features": ["A", "B"], "lower_deg": 89.9, "upper_deg": 90.1},
    {"name": "open", "what": "angle", "features": ["A", "C"], "lower_deg": 89.99},
    {"name": f"Ø {LONG[:90]}", "what": "size", "features": ["ball"], "upper_mm": 24.01},
    {"name": "edge", "what": "straightness", "features": ["edge"], "tolerance_mm": 0.01},
    {"name": "to the ball", "what": "distance", "features": ["spot", "ball"]},
]


@pytest.fixture(scope="module")
def planned() -> PartMeasurement:
    return found_of()


@pytest.fixture(scope="module")
def measured() -> PartMeasurement:
    """The bore 20 µm off in x and 10 µm in y; the job says all that is asked for, and that a thread was left out."""
    stated = {
        "id": "plate", "date": dt.date(2026, 5, 31), "number": "P-77", "issued": dt.date(2026, 6, 1), "customer": "Customer",
        "address": "Street 1", "place": "Room 4", "procedure": "P 12", "conditions": "20 °C",
    }  # fmt: skip
    laboratory = {"name": "Lab", "address": "Road 2", "signatory": "A. Person"}
    part = {**TABLES["part"], "serial": "0007", "drawing": "D-1 rev. B", "not_measured": ["M6 thread"]}
    job = plate(job=stated, laboratory=laboratory, part=part)
    return found_of(job, points=measured_points(job, {"bore": [0.02, 0.01, 0.0]}))


@pytest.fixture(scope="module")
def every_kind() -> PartMeasurement:
    """Angles beside lengths, limits on one side and on none, long names, two styli, features of every other kind."""
    planes = [{**one, "stylus": "down"} for one in TABLES["feature"][:3]]
    job = plate(feature=[*planes, *KINDS], stylus=STYLI, characteristic=CHARACTERISTICS)
    return found_of(job, points=measured_points(job))


@cache
def page(found: PartMeasurement) -> Document:
    return part_document(found)


def row_of(found: PartMeasurement, label: str) -> str:
    """A row of the overview."""
    return next(text for what, text in overview_of(found).rows if what == label)


def in_section(one: Section) -> list[Table]:
    return [block for block in one.blocks if isinstance(block, Table)]


def tables(document: Document, title: str | None = None) -> list[Table]:
    return [table for one in document.sections if title in (None, one.title) for table in in_section(one)]


def section(document: Document, title: str) -> Section:
    return next(one for one in document.sections if one.title == title)


def said(blocks: Iterable[object]) -> str:
    return "\n".join(str.__str__(text) for block in blocks for text in leaves(block))


def figure(text: str) -> Decimal:
    return Decimal(text.replace("−", "-"))


def agrees(text: str, value: float) -> bool:
    """Whether a printed figure is a value, to half of its last digit (5 % where an uncertainty was rounded up)."""
    shown = figure(text)
    half = 0.5 * 10.0 ** float(shown.as_tuple().exponent)
    return abs(float(shown) - value) <= 1.0001 * half or (value > 0 and 0 <= float(shown) / value - 1 < 0.06)


@pytest.mark.long
def test_every_figure_of_the_results_is_what_was_found(measured: PartMeasurement) -> None:
    (table,) = tables(page(measured), "Results")
    assert [column.unit for column in table.columns] == ["", "", "mm", "µm", "", "mm"]
    for i, (row, one) in enumerate(zip(table.rows, measured.stated, strict=True)):
        number, _, value, U, k, interval = row
        assert int(number) == i + 1
        assert one.value is not None
        assert agrees(value, one.value)
        width = never_negative(measured.plan)[i]
        if width:
            assert (U, k) == ("–", "–")
        else:
            assert agrees(U, 1e3 * 0.5 * (one.interval[1] - one.interval[0]))
            assert agrees(k, one.k)
        low, high = interval.split(" to ")
        assert agrees(low, one.interval[0])
        assert agrees(high, one.interval[1])
        places = [figure(each).as_tuple().exponent for each in (value, low, high)]
        assert len(set(places)) == 1
        if not width:
            assert figure(value).as_tuple().exponent == min(figure(U).as_tuple().exponent - 3, figure(U).adjusted() - 4)  # type: ignore[operator]


@pytest.mark.long
def test_angles_are_stated_in_degrees_and_seconds(every_kind: PartMeasurement) -> None:
    lengths, angles = tables(page(every_kind), "Results")
    assert [column.unit for column in angles.columns] == ["", "", "°", "″", "", "°"]
    assert [int(row[0]) for row in angles.rows] == [1, 2]
    assert [int(row[0]) for row in lengths.rows] == [3, 4, 5]
    one = every_kind.stated[0]
    assert one.value is not None
    assert agrees(angles.rows[0][2], np.degrees(one.value))
    assert agrees(angles.rows[0][3], 3600 * np.degrees(one.U))
    assert agrees(angles.rows[0][5].split(" to ")[0], np.degrees(one.interval[0]))


@pytest.mark.long
def test_of_a_planned_measurement_only_its_uncertainty_is_stated(planned: PartMeasurement) -> None:
    document = page(planned)
    (table,) = tables(document, "Results")
    assert [column.heading for column in table.columns] == [
        "No.",
        "Characteristic",
        "U",
        "k",
        "95 % interval",
        "Mean error",
    ]
    for row, one in zip(table.rows, planned.stated, strict=True):
        assert agrees(row[2], 1e3 * one.U)
        assert agrees(row[4].split(" to ")[0], 1e3 * one.interval[0])
        assert agrees(row[5], 1e3 * one.error)
    assert document.title == "Measurement uncertainty"
    assert document.overview is not None
    assert document.overview.verdict == "Uncertainty of a planned measurement: nothing was measured"
    assert document.overview.standing == "unknown"
    assert not document.signatures
    assert not document.draft
    assert "Decision" not in [column.heading for table in tables(document) for column in table.columns]


def test_limits_nominals_and_what_is_accepted(measured: PartMeasurement) -> None:
    (table,) = tables(page(measured), "Conformity with the drawing")
    rows = {str.__str__(row[0]): row for row in table.rows}
    assert rows["1"][2:5] == ("30", "29.95", "30.05")
    assert rows["2"][2:5] == ("–", "–", "0.1")
    assert rows["5"][2:5] == ("40", "39.95", "40.05")
    judged = measured.judged[0]
    assert judged is not None
    assert judged.accepted is not None
    low, high = rows["1"][5].split(" to ")
    assert agrees(low, judged.accepted[0] or 0.0)
    assert agrees(high, judged.accepted[1] or 0.0)
    assert [row[6] for row in table.rows] == [one and one.outcome for one in measured.judged]


def test_limits_on_one_side_and_on_none(every_kind: PartMeasurement) -> None:
    lengths, angles = tables(page(every_kind), "Conformity with the drawing")
    assert [row[0] for row in angles.rows] == ["1", "2"]
    assert [row[0] for row in lengths.rows] == ["3", "4"]
    assert angles.rows[1][2:5] == ("90", "89.99", "–")
    assert angles.rows[1][5].startswith("from 8")
    assert lengths.rows[0][2:5] == ("24", "–", "24.01")
    assert lengths.rows[0][5].startswith("up to 2")


def judged_as(found: PartMeasurement, outcomes: Iterable[Outcome | None], left: Sequence[str] = ()) -> Overview:
    """The overview, had the rule decided otherwise, and with these characteristics of the drawing not measured."""
    judged = tuple(
        None if outcome is None or one is None else replace(one, outcome=outcome)
        for one, outcome in zip(found.judged, outcomes, strict=True)
    )
    facts = found.job.facts
    facts = facts.model_copy(update={"part": facts.part.model_copy(update={"not_measured": list(left)})})
    return overview_of(replace(found, judged=judged, job=replace(found.job, facts=facts)))


@pytest.mark.parametrize(("outcomes", "verdict", "standing"), [
    (("pass",) * 5, "Incomplete: not all of the drawing was measured", "open"),
    (("pass", "fail", "pass", "pass", "pass"), "Does not conform: one of 5 characteristics is not within the limits", "bad"),
    ((None,) * 5, "Measured: no limits to decide on", "unknown"),
])  # fmt: skip
def test_a_part_of_which_not_all_was_measured_is_incomplete_at_best(
    measured: PartMeasurement, outcomes: tuple[Outcome | None, ...], verdict: str, standing: str
) -> None:
    overview = judged_as(measured, outcomes, ["M6 thread"])
    assert (overview.verdict, overview.standing) == (verdict, standing)


@pytest.mark.parametrize(("outcomes", "verdict", "standing"), [
    (("pass",) * 5, "Conforms: all 5 limited characteristics are within limits", "good"),
    (("pass", None, None, None, None), "Conforms: its one limited characteristic is within its limits", "good"),
    (("pass", "fail", "undecided", "pass", "fail"),
     "Does not conform: 2 of 5 characteristics are not within the limits", "bad"),
    (("pass", "undecided", "pass", "pass", "pass"), "Undecided: one of 5 characteristics is too near to a limit", "open"),
    (("pass", "conditional pass", "pass", "pass", "pass"),
     "Conditionally accepted: all values are within their limits, not all with their uncertainty", "open"),
    (("pass", "conditional fail", "pass", "pass", "pass"),
     "Conditionally rejected: one of 5 characteristics is not within its limits with certainty", "bad"),
    ((None,) * 5, "Measured: no limits to decide on", "unknown"),
])  # fmt: skip
def test_the_verdict_is_that_of_all_decisions(
    measured: PartMeasurement, outcomes: tuple[Outcome | None, ...], verdict: str, standing: str
) -> None:
    overview = judged_as(measured, outcomes)
    assert overview.verdict == verdict
    assert overview.standing == standing


def test_a_part_whose_uncertainty_leaves_no_value_to_accept_is_near_to_no_limit(measured: PartMeasurement) -> None:
    first, *others = measured.judged
    assert first is not None
    overview = overview_of(replace(measured, judged=(replace(first, outcome="undecided", accepted=None), *others)))
    assert overview.verdict == "Not decided: the uncertainty is too large for any value to be accepted"


def test_the_least_margin_is_told_first(measured: PartMeasurement) -> None:
    told = row_of(measured, "Least margin")
    place = measured.nearest
    assert place is not None
    assert told.startswith(f"{measured.stated[place].name}: ")
    times = re.search(r", ([\d.]+) u inside", told)
    assert times is not None
    assert agrees(times[1], float(measured.margins[place]))
    outside = replace(
        measured.stated[place], value=(measured.plan.characteristics[place].upper or 0.0) + 3 * measured.stated[place].u
    )
    stated = tuple(outside if i == place else one for i, one in enumerate(measured.stated))
    assert "3.0 u outside of the limit" in row_of(replace(measured, stated=stated), "Least margin")


def test_what_is_planned_is_told_by_the_share_of_its_tolerance(planned: PartMeasurement) -> None:
    told = row_of(planned, "Tightest")
    widths = np.array([0.1, 0.1, 0.05, 0.02, 0.1])
    taken = np.array([one.interval[1] - one.interval[0] for one in planned.stated]) / widths
    assert told.startswith(f"{int(taken.argmax()) + 1}: ")
    share = re.search(r"takes (\d+) % of it", told)
    assert share is not None
    assert agrees(share[1], 100 * float(taken.max()))


def test_shares_of_a_characteristic_are_those_of_its_budget(measured: PartMeasurement) -> None:
    budget = measured.budget
    table = tables(page(measured), "What the uncertainty is made of")[0]
    lines = {str.__str__(row[2]): row for row in table.rows if row[0] == "1"}
    g = int(np.argmax(budget.total[:, 0]))
    row = next(iter(lines.values()))
    assert agrees(row[4], min(100.0, 100 * float(budget.total[g, 0])))
    assert agrees(row[3], min(100.0, 100 * float(budget.first[g, 0])))
    assert next(iter(lines)) == "Hysteresis of Y"


def test_families_share_the_variance_among_them(measured: PartMeasurement) -> None:
    names, shares = by_family(measured)
    np.testing.assert_allclose(shares.sum(axis=0), 1.0)
    stylus = [g for g, line in enumerate(measured.budget.causes) if line.startswith("stylus: ")]
    expected = measured.budget.total[stylus].clip(0).sum(axis=0) / measured.budget.total.clip(0).sum(axis=0)
    np.testing.assert_allclose(shares[names.index("stylus")], expected)
    assert list(shares.sum(axis=1)) == sorted(shares.sum(axis=1), reverse=True)


def test_what_the_calibration_did_not_see_is_named_with_its_share_and_what_to_measure(
    measured: PartMeasurement,
) -> None:
    unseen = (
        UnseenError(
            "2",
            "machine: roll",
            "rotation_x_x",
            effect_title("rotation_x_x"),
            0.73,
            say("the calibration did not model it"),
        ),
        UnseenError(
            "1",
            "machine: roll",
            "rotation_x_x",
            effect_title("rotation_x_x"),
            0.2,
            say("the calibration did not model it"),
        ),
    )
    further = FurtherSetUps(("rotation_x_x",), 4, say("Four set-ups of the ballbar would show it."), "cmm-uq plan roll")
    found = replace(measured, unseen=unseen, further=further)
    told = said(unseen_section(found).blocks)
    assert f"73 % of the variance of characteristic 2 comes from {effect_title('rotation_x_x')[0].lower()}" in told
    assert "Four set-ups of the ballbar would show it." in told
    assert "cmm-uq plan roll" in told
    (table,) = in_section(unseen_section(found))
    assert [row[1:3] for row in table.rows] == [("73", "characteristic 2, and one more")]
    assert "73 %" in row_of(found, "Not seen")
    assert unseen_section(replace(measured, unseen=())).blocks == ()


def test_the_best_way_is_the_one_that_makes_u_smallest(measured: PartMeasurement) -> None:
    place = measured.nearest
    assert place is not None
    planned, first, *others = measured.ways
    better = np.array(planned.u)
    better[place] *= 0.6
    ways = (planned, replace(first, u=better), *(replace(other, u=planned.u) for other in others))
    found = replace(measured, ways=ways)
    told = row_of(found, "To reduce it")
    assert told.endswith(f"would reduce the uncertainty of characteristic {measured.stated[place].name} most, by 40 %.")
    (table,) = in_section(ways_section(found))
    for row, u in zip(table.rows[:2], (planned.u, better), strict=True):
        assert all(agrees(cell, 1e3 * float(size)) for cell, size in zip(row[1:], u, strict=True))


def test_no_way_is_praised_that_gains_nothing(measured: PartMeasurement) -> None:
    same = tuple(replace(way, u=measured.ways[0].u) for way in measured.ways)
    assert row_of(replace(measured, ways=same), "To reduce it").startswith("None of the ways")


def test_correlations_are_those_of_the_errors(measured: PartMeasurement) -> None:
    (table,) = tables(page(measured), "Correlations")
    for i, row in enumerate(table.rows):
        for j, cell in enumerate(row[2:]):
            assert cell == "–" if j > i else agrees(cell, float(measured.correlation[i, j]))


def test_the_machine_s_certificate_and_what_of_it_was_verified(measured: PartMeasurement) -> None:
    told = said(section(page(measured), "The machine and its certificate").blocks)
    for text in ("K-2031", "Portal 7, serial number 1102", "2026-03-01, 91 days before", "2027-02-28", "20.10 °C",
                 "55 comparisons of 2 sorts", "not computed again", "All errors are drawn", "1, 1, 1 µm"):  # fmt: skip
        assert text in told
    draft = replace(CERTIFICATE, draft=True, again=True, source="results", trusted=True)
    told = said(machine_section(replace(measured, standing=draft)).blocks)
    for text in (
        "K-2031, a draft",
        "computed again from its inputs",
        "without the recording",
        "by trusted certificates",
    ):
        assert text in told


def test_a_complete_report_is_no_draft_and_what_another_lacks_is_named(measured: PartMeasurement) -> None:
    whole = page(measured)
    assert not whole.draft
    assert whole.number == "P-77"
    assert [one.name for one in whole.signatures] == ["A. Person"]
    assert whole.date == dt.date(2026, 6, 1)
    job = plate(job={"id": "plate", "date": dt.date(2026, 5, 31), "customer": "C"})
    missing = [one for one in of_a_part(job.facts, measured.measured) if one.status == "missing"]
    assert {"[part] serial", "[laboratory] name", "[job] conditions"} <= {one.key for one in missing}
    assert "[job] customer" not in {one.key for one in missing}
    assert not [one for one in of_a_part(measured.job.facts, measured.measured) if one.status == "missing"]


def test_what_is_not_measured_and_not_stated_is_said(measured: PartMeasurement) -> None:
    told = said(section(page(measured), "What is not covered").blocks)
    assert "these are not measured here: M6 thread" in told
    assert "Clamping: declared negligible by the test: nothing is." in told
    undeclared = replace(measured, job=replace(measured.job, facts=plate(negligible=None).facts))
    assert "without uncertainty: clamping, operators and" in said(
        section(page(undeclared), "What is not covered").blocks
    )
    assert "qualification of the styli" not in told
    assert "M6 thread" in row_of(measured, "Not covered")


def test_the_method_says_how_often_and_how_to_do_it_again(measured: PartMeasurement) -> None:
    told = said(method_section(replace(measured, seed=11, digits=2)).blocks)
    assert "cmm-uq part plate --seed 11 --digits 2" in told
    assert "4000" in told
    for standard in ("ISO/TS 15530-4", "VDI/VDE 2617-7", "VDI/VDE 2617-11", "JCGM 101"):
        assert standard in told


def test_pictures_show_what_was_found_of_the_points(measured: PartMeasurement) -> None:
    n = len(measured.plan.points)
    covariance = np.tile(np.diag([9e-6, 1e-6, 1e-6]), (n, 1, 1))
    found = replace(measured, displaced=PointErrors(np.zeros((n, 3)), covariance))
    assert "standard uncertainties of up to 3.0 µm" in said(errors_section(found).blocks)


def test_what_no_cause_moves_has_no_uncertainty_and_a_page_all_the_same(measured: PartMeasurement) -> None:
    still = replace(measured.stated[0], u=0.0, interval=(30.0, 30.0), k=float("nan"), value=30.0)
    judged = LimitDecision(29.95, 30.05, "pass", 1.0, 0.0, (29.95, 30.05), say("rule"))
    found = replace(measured, stated=(still, *measured.stated[1:]), judged=(judged, *measured.judged[1:]))
    (table,) = in_section(results_section(found))
    assert table.rows[0][2:5] == ("30", "0", "–")


@pytest.mark.parametrize("which", ["planned", "measured", "every_kind"])
def test_every_text_can_be_translated(which: str, request: pytest.FixtureRequest) -> None:
    found: PartMeasurement = request.getfixturevalue(which)
    effects = " ".join([*ERRORS, "straightness_x_y", "hysteresis_y"])
    own = " ".join([f.name for f in found.plan.features] + [c.name for c in found.plan.characteristics])
    known = "\n".join([
        *(content.decode() for content in found.job.inputs.values()), own, effects, "cmm-uq part plate", "0.7.0 results.json",
        *(str(getattr(CERTIFICATE, key)) for key in ("files", "number", "laboratory", "machine", "serial")),
        "[job] [laboratory] [part] name address customer place procedure issued signatory serial conditions",
    ])  # fmt: skip
    assert [text for text in strangers(page(found), known) if not text.endswith("…")] == []


@pytest.mark.long
@pytest.mark.parametrize("which", ["planned", "every_kind"])
def test_nothing_runs_into_anything_on_a_screen_or_a_phone(
    which: str, request: pytest.FixtureRequest, browser: Browser, tmp_path: Path
) -> None:
    path = tmp_path / "part.html"
    path.write_text(render_html(page(request.getfixturevalue(which))), encoding="utf-8")
    for width in (1280, 360):
        opened = browser.new_page(viewport={"width": width, "height": 900})
        opened.goto(path.as_uri())
        assert opened.evaluate("document.documentElement.scrollWidth") <= width
        assert opened.evaluate(OVERLAPS) == []
        assert opened.evaluate(LABELS_COLLIDING) == []
        opened.close()


@pytest.mark.long
def test_the_pdf_is_made_of_the_same(every_kind: PartMeasurement) -> None:
    import io

    from pypdf import PdfReader

    text = "".join(page.extract_text() for page in PdfReader(io.BytesIO(render_pdf(page(every_kind), {}))).pages)
    (table, *_) = tables(page(every_kind), "Results")
    for row in table.rows:
        assert row[2] in text


def test_a_machine_that_was_calibrated_on_the_same_day(measured: PartMeasurement) -> None:
    same = replace(CERTIFICATE, age=dt.timedelta(0))
    assert "2026-03-01, the day of the measurement" in said(machine_section(replace(measured, standing=same)).blocks)


@pytest.mark.long
def test_of_many_characteristics_those_nearest_to_their_limits_are_told_of_in_detail() -> None:
    """Twelve limits on one diameter, the tightest last: of the first two there is no budget, and of the first six no way."""
    many = [
        {"name": f"D{i}", "what": "size", "features": ["bore"], "upper_mm": 30.07 - 0.005 * i} for i in range(1, 13)
    ]
    job = plate(characteristic=many)
    found = found_of(job, points=measured_points(job))
    (lines, *_) = tables(page(found), "What the uncertainty is made of")
    assert {int(row[0]) for row in lines.rows} == set(range(3, 13))
    assert lines.notes[-1].startswith("Shown are the 10 characteristics with the least margin.")
    (ways,) = tables(page(found), "What would reduce it")
    assert [column.heading for column in ways.columns[1:]] == [f"u of No. {i}" for i in range(7, 13)]
    assert tables(page(found), "Correlations") == []
    assert "66 of 66 correlations" in said(section(page(found), "Correlations").blocks)
    without = replace(found, judged=(None,) * 12)
    assert in_section(ways_section(without))[0].notes[-1] == "Shown are the first 6 characteristics."


@pytest.mark.long
def test_no_key_of_a_job_file_stands_on_the_report_of_a_part(
    planned: PartMeasurement, measured: PartMeasurement, every_kind: PartMeasurement
) -> None:
    """Nor where the job does not state what every report must: the page says it in words, without ``[part] serial``."""
    job = plate()
    bare = found_of(job, points=measured_points(job))
    assert "serial number of the part (7.8.2.1 g)" in page(bare).warnings[-1]
    assert [mentioned(page(one)) for one in (planned, measured, every_kind, bare)] == [[], [], [], []]
    assert all("[part]" not in text for text in leaves(page(bare)))


def remark(further: FurtherSetUps) -> str:
    found: Any = SimpleNamespace(standing=SimpleNamespace(path=say("drawn")), unseen=(), further=further)
    return str(_remarks(found)[-1])


def test_what_further_set_ups_show_is_named_and_what_they_do_not_is_left_out() -> None:
    further = FurtherSetUps(
        ("scale_x", "rotation_x_x"), 2, say("all"), "cmm-uq plan further", "further/job.toml", ("rotation_x_x",)
    )
    assert remark(further) == "2 further set-ups of the artefact show Scale error of X: further/job.toml."


def test_where_none_shows_anything_that_is_said() -> None:
    said = remark(FurtherSetUps(("rotation_x_x",), 0, say("all"), missed=("rotation_x_x",)))
    assert said == "No further set-up of the artefact as it was recorded shows what the calibration did not see."
