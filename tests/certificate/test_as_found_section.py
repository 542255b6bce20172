"""As found and as left on one certificate."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import pytest

from cmm_uq.app.commands.report import outcome_of
from cmm_uq.certificate.document import Document
from cmm_uq.certificate.outcome import Outcome
from cmm_uq.certificate.result import Result
from cmm_uq.jobs.reports import AsFound
from tests.artefacts.reading import tables
from tests.artefacts.simulated import analysed
from tests.jobs.test_reports import FOUND


def adjusted(found: Any, before: dict[str, Any]) -> Outcome:
    """The certificate of a machine that showed something else before."""
    values = {field.name: getattr(found, field.name) for field in fields(found)}
    return outcome_of(type(found)(**values | {"job": replace(found.job, as_found=AsFound.model_validate(before))}))


@pytest.fixture(scope="module")
def outcome() -> Outcome:
    found = analysed("iota-1102-20C")
    assert isinstance(found, Result)
    return adjusted(found, FOUND)


def titles(document: Document) -> list[str]:
    return [section.title for section in document.sections]


def test_what_was_found_stands_beside_what_is_left_each_with_its_uncertainty(outcome: Outcome) -> None:
    """U as found is the larger distance to an end of the interval: 141 − 120 = 21 and 540 − 500 = 40."""
    left = {row[0]: row[1:3] for name in ("Figures of performance", "Error factors of the machine")
            for row in tables(outcome.document)[name].rows}  # fmt: skip
    name = "Range of the lengths, on average over repeats"
    assert tables(outcome.document)["The machine as found and as left"].rows == (
        (name, "500", "40", *left[name], "µm"),
        ("Scale error of X", "120", "21", *left["Scale error of X"], "ppm"),
    )
    assert tables(outcome.document)["Statements of conformity as found and as left"].rows == (
        ("ASME B89.4.1-1997, volumetric performance", "fail", "fail"),
    )


def test_what_nothing_determined_before_is_not_set_beside_what_is_left() -> None:
    free = FOUND | {"identifiability": {"undetermined": [{"scale_x.ppm": 0.7, "scale_y.ppm": 0.7}]}}
    rows = tables(adjusted(analysed_iota(), free).document)["The machine as found and as left"].rows
    assert "Scale error of X" not in [row[0] for row in rows]
    assert len(rows) == 1


def test_its_figures_stand_in_results_json(outcome: Outcome) -> None:
    found = outcome.results["as_found"]
    assert found["job"]["id"] == "before"
    assert found["estimates"]["scale_x"]["ppm"]["value"] == 120.0
    assert found["accuracy_uncertainty"]["b89_range_um"]["interval95"] == [460.0, 540.0]


def test_it_comes_before_what_the_results_rest_on(outcome: Outcome) -> None:
    order = titles(outcome.document)
    assert (
        order.index("Statements of conformity")
        < order.index("As found and as left")
        < order.index("Artefact and traceability")
    )


def test_a_machine_found_after_it_was_left_is_told() -> None:
    """The key of the job stands beside it for the laboratory, not on the certificate."""
    late = FOUND | {"job": {**FOUND["job"], "date": "2004-09-02"}}
    outcome = adjusted(analysed_iota(), late)
    said = "Dates out of order: the machine was found as it was after it was left, 2004-09-01 against 2004-09-02"
    assert f"{said}." in outcome.document.warnings
    assert f"{said} ([job] as_found)." in outcome.warnings


def analysed_iota() -> Any:
    return analysed("iota-1102-20C")


@pytest.mark.parametrize(("job", "group", "title"), [
    ("shift-simulated", "scale_x", "Mean sensitivity error of axis x"), ("shift-plate-simulated", "scale_x", "Scale of X"),
])  # fmt: skip
def test_an_axis_calibrated_by_shifting_has_it_too(job: str, group: str, title: str) -> None:
    before = FOUND | {"job": {"id": "before", "origin": "simulated"}}
    (row,) = tables(adjusted(analysed(job), before).document)["The machine as found and as left"].rows
    assert row[:3] == (title, "120", "21")


def test_without_it_there_is_no_such_section() -> None:
    assert "As found and as left" not in titles(outcome_of(analysed_iota()).document)
