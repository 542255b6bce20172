"""Pages of histories and of what is due: every text a message or the user's, and readable on a telephone."""

from __future__ import annotations

import datetime as dt
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from cmm_uq.certificate.document import Document
from cmm_uq.certificate.pages.fleet import due_document
from cmm_uq.certificate.pages.history import (
    history_data,
    history_document,
    meets,
    notes,
    overview_of,
    step_notes,
    terminal_note,
)
from cmm_uq.certificate.render import render_html
from cmm_uq.laboratory.due.crossing import Crossing, crossing
from cmm_uq.laboratory.due.due import CalibrationRecord, DueItem, artefact_due, machine_due
from cmm_uq.laboratory.due.history import MachineHistory, machine_history
from cmm_uq.laboratory.due.rule import Rule
from cmm_uq.laboratory.due.steps import DatedStep
from cmm_uq.laboratory.records.facts import ArtefactRow
from tests.certificate.saying import strangers
from tests.laboratory.due.histories import MACHINE, FIRST_of_made, certificate, series, value

if TYPE_CHECKING:
    from playwright.sync_api import Browser

ON = dt.date(2026, 6, 1)
OWN = "Iota DEA 1102 Hall scale_x.ppm Scale error of x quantity BB-7 PTB ballbar K-2024 history.json due.json"


def history(*numbers: float, limit: float | None = 8.0) -> MachineHistory:
    """A recording a year; an interim check among them."""
    days = [300 * i for i in range(len(numbers))]
    made = [certificate(FIRST_of_made + dt.timedelta(days=day), value(number), interim=i == 1, entry=i + 1)
            for i, (day, number) in enumerate(zip(days, numbers, strict=True))]  # fmt: skip
    return machine_history(MACHINE, made, {"scale_x.ppm": series(days, numbers, 0.5, limit=limit)}, ON)


def items() -> list[DueItem]:
    artefact = ArtefactRow("BB-7", "ballbar", "PTB 1", "PTB", None, dt.date(2026, 1, 1))
    rules = (None, {"every_months": 6}, {"method": "A3"}, {"method": "staircase"}, {"method": "control chart"})
    known = [CalibrationRecord(MACHINE, Rule.of(rule), [certificate(FIRST_of_made)], False, ON) for rule in rules]
    checked = [certificate(FIRST_of_made), certificate(FIRST_of_made + dt.timedelta(days=30), value(9.0), interim=True)]
    made = [
        machine_due(one, {"BB-7": artefact}, ON, list) for one in [*known, CalibrationRecord(MACHINE, Rule(), checked)]
    ]
    return [*made, artefact_due(artefact)]


@pytest.mark.parametrize(
    "document",
    [
        history_document(history(1.0, 2.0, 4.5)), history_document(history(1.0, limit=None)), history_document(history()),
        history_document(history(1.0, 2.0, 9.5)), due_document(items(), ON, dt.timedelta(days=90)),
        due_document([], ON, dt.timedelta(days=90)),
    ],
)  # fmt: skip
def test_every_text_is_a_message_or_the_users(document: Document) -> None:
    assert strangers(document, OWN) == []


@pytest.mark.parametrize(
    ("numbers", "standing", "verdict"),
    [
        ((1.0, 1.1, 1.0), "good", "No change that stands out"),
        ((1.0, 1.0, 4.0), "open", "Changed since the last time"),
        ((1.0, 2.0, 8.1), "bad", "Beyond its limits"),
        ((-1.0, -2.0, -8.1), "bad", "Beyond its limits"),
        ((), "open", "Nothing is recorded yet"),
    ],
)
def test_what_stands_out(numbers: tuple[float, ...], standing: str, verdict: str) -> None:
    found = overview_of(history(*numbers))
    assert (found.standing, found.verdict) == (standing, verdict)


def test_when_a_limit_is_crossed_in_words() -> None:
    """From 2024-03-01 on: 300 days apart, to 2025-10-22; asked on 2026-06-01."""
    assert meets(history(1.0, 2.0, 9.5).values[0], ON) == "is beyond it"
    assert meets(history(1.0, 2.0, 3.0, limit=None).values[0], ON) == "–"
    assert meets(history(2.0, 4.8, 7.6).values[0], ON) == "probably already"
    alone = meets(history(1.0).values[0], ON)  # one certificate has no line, and the model a wide guess
    assert alone.startswith("about 20")
    assert alone.endswith("perhaps never")
    unknown = machine_history(MACHINE, [certificate(FIRST_of_made)], {"scale_x.ppm": series([0], [1.0], 0.0)}, ON)
    assert meets(unknown.values[0], ON) == "cannot be foreseen"  # stated without an uncertainty


@pytest.mark.parametrize(
    ("probabilities", "words"),
    [
        ((0.00, 0.04), "not within 40 years"),
        ((0.00, 0.40), "not before 2026-11-27, perhaps never"),
        ((0.00, 0.90), "about 2029-02-07, perhaps already, perhaps never"),
        ((0.10, 0.90), "about 2028-09-26, perhaps already, perhaps never"),
        ((0.00, 0.9999), "about 2026-08-19, perhaps already, by 2029-05-15"),
        ((0.60, 0.9999), "probably already"),
    ],
)
def test_the_days_of_a_crossing_in_words(probabilities: tuple[float, float], words: str) -> None:
    """A constant hazard over 4000 days after 2025-10-22: the days from ln(1 − p), by hand."""
    value = history(1.0, 2.0, 3.0).values[0]
    known = Crossing(dt.date(2025, 10, 22), np.array([0.0, 4000.0]), np.array(probabilities), 0, 1, 0, 1)
    vars(value)["crossing"] = known
    assert meets(value, ON) == words


def test_which_model_the_day_of_a_crossing_is_of_is_said_and_the_data_have_it() -> None:
    made = history(1.0, 2.0, 3.0)
    assert "drift model" in terminal_note(made)
    assert "not by the straight line" in " ".join(notes(made))
    assert "drift model" not in terminal_note(history(1.0, limit=None))
    data = history_data(made)["values"]["scale_x.ppm"]["crosses_limit"]
    again = crossing(made.values[0].series, 8.0)
    assert data["model"] == "drift"
    assert [data["day_5"], data["day_50"]] == [str(again.quantile(0.05)), str(again.quantile(0.5))]


def stepped(**further: object) -> MachineHistory:
    """Seven recordings, 200 days apart, with a step of 6 before the fifth, 2026-05-10."""
    numbers, days = (0.1, 0.4, 0.2, 0.5, 6.2, 6.6, 6.1), [200 * i for i in range(7)]
    made = [certificate(FIRST_of_made + dt.timedelta(days=day), value(number), interim=i == 1, entry=i + 1)
            for i, (day, number) in enumerate(zip(days, numbers, strict=True))]  # fmt: skip
    made.insert(4, certificate(dt.date(2026, 1, 7), value(1.0, name="other"), entry=8))
    of = series(days, numbers, 0.4, **further)  # type: ignore[arg-type]
    return machine_history(MACHINE, made, {"scale_x.ppm": of}, dt.date(2028, 1, 1))


def test_a_step_is_dated_in_words_with_the_certificates_that_it_puts_in_doubt() -> None:
    """Those relied on when it came: the last that does not have it, and one of other values between both."""
    made = stepped()
    (words,) = step_notes(made)
    change = "after a change of 5.8 ± 1.4 ppm between 2025-10-22 and 2026-05-10 (probability 99 %)"
    assert words == (
        f"Scale error of x: {change}. In doubt for what was measured after 2025-10-22: K-2025-10-22, K-2026-01-07."
    )
    (data,) = history_data(made)["values"]["scale_x.ppm"]["steps"]
    assert (data["after"], data["by"], data["in_doubt"]) == ("2025-10-22", "2026-05-10", [4, 8])
    assert (data["size"], data["u"], data["probability"]) == pytest.approx((5.8, 0.7, 0.99), abs=0.05)
    html = render_html(history_document(made))
    assert change in html
    assert strangers(history_document(made), OWN) == []
    assert step_notes(history(1.0, 1.1, 1.0)) == ()


def test_a_step_after_an_adjustment_puts_no_certificate_of_before_it_in_doubt() -> None:
    made = stepped(adjusted_since=[0, 0, 0, 0, 700, 700, 700])  # a hundred days after the fourth recording
    first = FIRST_of_made.toordinal()
    for after, doubtful in ((600, [4, 8]), (700, [])):
        step = DatedStep(first + after, first + 800, 0.9, 6.0, 0.5)
        assert [one.entry for one in made.in_doubt(made.values[0], step)] == doubtful


def test_a_history_fits_a_telephone(browser: Browser, tmp_path: Path) -> None:
    for name, document in (("history", history_document(history(1.0, 2.0, 4.5))),
                           ("due", due_document(items(), ON, dt.timedelta(days=90)))):  # fmt: skip
        file = tmp_path / f"{name}.html"
        file.write_text(render_html(document), encoding="utf-8")
        page = browser.new_page(viewport={"width": 360, "height": 800})
        page.goto(file.as_uri())
        assert page.evaluate("document.documentElement.scrollWidth") == 360
        page.close()
