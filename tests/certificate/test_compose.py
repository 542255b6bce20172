"""What the certificate of the real recording says."""

from __future__ import annotations

import datetime as dt
import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pypdf import PdfReader

from cmm_uq.app.commands.report import analyse, outcome_of
from cmm_uq.base.messages import Verbatim
from cmm_uq.certificate.clauses import STATEMENTS, formal_warnings
from cmm_uq.certificate.document import DecisionBlock, Document, Facts, Plot, Signature, Table
from cmm_uq.certificate.render import render_html, render_pdf
from cmm_uq.certificate.result import Result
from tests.artefacts.simulated import analysed
from tests.certificate.test_completeness import changed


@pytest.fixture(scope="module")
def result() -> Result:
    return analysed("iota-1102-20C")


@pytest.fixture(scope="module")
def document(result: Result) -> Document:
    return outcome_of(result).document


@pytest.fixture(scope="module")
def uncalibrated() -> Result:
    return analysed("iota-1102-20C-compensated")


def table(document: Document, caption: str) -> Table:
    blocks = [block for section in document.sections for block in section.blocks]
    return next(block for block in blocks if isinstance(block, Table) and block.caption == caption)


def facts(document: Document) -> dict[str, str]:
    blocks = [*document.particulars, *(block for section in document.sections for block in section.blocks)]
    return {label: value for block in blocks if isinstance(block, Facts) for label, value in block.rows}


def test_figures_are_stated_with_expanded_uncertainty_to_two_digits(document: Document) -> None:
    rows = {row[0]: row[1:] for row in table(document, "Figures of performance").rows}
    for value, U, k, *_ in rows.values():
        assert len(U.replace(".", "").lstrip("0")) == 2
        assert len(value.partition(".")[2]) == len(U.partition(".")[2])
        assert 1.8 < float(k) < 2.6
    assert rows["Mean length"][0] == "404.2051"


def test_the_error_factors_stand_beside_their_least_squares_estimate(document: Document) -> None:
    rows = {row[0]: row for row in table(document, "Error factors of the machine").rows}
    assert rows["Squareness X–Y"][1] == "−174"
    assert rows["Squareness X–Y"][4] == "−175"
    assert rows["Squareness X–Y"][5] == "″"


def test_the_budget_of_one_length_says_where_each_figure_comes_from(document: Document, result: Result) -> None:
    """u = √(2·σ² + 5²) µm: the readings of both balls and the certified length."""
    rows = {row[0]: row for row in table(document, "Contributions to the deviation of one length").rows}
    assert rows["Certified length"][-1] == "certificate Harris 2004, Table 21"
    assert any("residuals" in cell for cell in rows["Coordinate of a ball, along the bar, twice"])
    sigma = result.noise.coordinate.value
    share = 2 * sigma**2 / (2 * sigma**2 + 5.0**2)
    cells = [cell.replace("\u00a0", " ") for cell in rows["Coordinate of a ball, along the bar, twice"]]
    assert f"{100 * share:.1f} %" in cells


def test_the_decision_names_rule_limit_and_probability(document: Document) -> None:
    (decision,) = [
        block for section in document.sections for block in section.blocks if isinstance(block, DecisionBlock)
    ]
    assert decision.outcome == "fail"
    assert decision.limit == "60 µm"
    assert "ISO 14253-1:2017" in decision.rule
    assert "<\u00a00.01\u00a0%" in decision.explanation


def test_the_traceability_chain_of_the_artefact_is_printed(document: Document) -> None:
    said = facts(document)
    assert said["Certified length at 20 °C"] == "404.2357 mm, U = 10 µm (k = 2)"
    assert said["Its certificate"] == "Harris 2004, Table 21"


def test_the_sentences_on_scope_and_reproduction_are_there(document: Document) -> None:
    assert document.statements == STATEMENTS
    assert "relate only to the item" in STATEMENTS[0]
    assert "except in full" in STATEMENTS[1]


def test_what_is_mandatory_and_missing_is_named_in_one_warning(result: Result) -> None:
    (missing,) = [text for text in formal_warnings(result.job) if "ISO/IEC 17025" in text]
    for clause in ("7.8.2.1 b", "7.8.2.1 e", "7.8.2.1 g", "7.8.2.1 j", "7.8.2.1 o"):
        assert clause in missing
    assert "7.8.2.1 f" not in missing


def test_a_complete_job_has_no_such_warning_and_its_particulars_are_printed(job: Path) -> None:
    path = job / "job.toml"
    text = path.read_text(encoding="utf-8")
    text = text.replace(
        "[job]\n", '[job]\ncustomer = "<b>Müller & Söhne</b>"\naddress = "Ort"\nissued = 2004-09-30\n', 1
    )
    text = text.replace(
        "[machine]\n", '[laboratory]\nname = "L"\naddress = "A"\nsignatory = "S"\n[machine]\nserial = "7"\n', 1
    )
    text = text.replace(
        'machine = "DEA Iota 1102"\n',
        'issuer = "national institute"\narrangement = "CIPM MRA"\ndate = 2004-01-15\ndue = 2006-01-15\n', 1,
    )  # fmt: skip
    path.write_text(text, encoding="utf-8")
    found = analyse(job)
    made = outcome_of(found).document
    assert not any("ISO/IEC 17025" in text for text in made.warnings)
    assert facts(made)["Customer"] == "<b>Müller & Söhne</b>\nOrt"
    assert made.signatures[0].name == "S"
    html = render_html(made)
    assert "&lt;b&gt;Müller &amp; Söhne&lt;/b&gt;" in html
    assert "<b>Müller" not in html


def test_free_scales_are_not_given_figures_but_their_differences_are(uncalibrated: Result) -> None:
    document = outcome_of(uncalibrated).document
    rows = {row[0]: row for row in table(document, "Error factors of the machine").rows}
    assert rows["Scale error of X"][1:5] == ("not determined", "", "", "")
    assert rows["Squareness X–Y"][1] == "2"
    differences = table(document, "Differences that are determined").rows
    assert differences[0][0] == "Scale error of Y − Scale error of X"
    assert float(differences[0][2]) < 60
    assert any("Not determined by this recording" in text for text in document.warnings)


def test_of_parameters_that_change_by_unequal_amounts_no_difference_is_determined(uncalibrated: Result) -> None:
    """As of two squarenesses of which space diagonals see a weighted sum: 1.43 of the one and 1 of the other."""
    least_squares = uncalibrated.least_squares
    free = least_squares.null_space.copy()
    free[np.flatnonzero(free[:, 0])[1]] *= -1.43
    estimate = replace(uncalibrated.estimate, least_squares=replace(least_squares, null_space=free))
    found = replace(uncalibrated, estimate=estimate)
    ((combination,), kept) = found.undetermined, uncalibrated.differences(uncalibrated.undetermined[0])
    left = [{one.first, one.second} for one in found.differences(combination)]
    assert left == [{one.first, one.second} for one in kept if combination[1] not in (one.first, one.second)]
    assert len(left) < len(kept)


def test_a_run_that_did_not_converge_says_so_first(result: Result) -> None:
    failed = replace(result, posterior=replace(result.posterior, ess_min=500.0))
    document = outcome_of(failed).document
    assert "did not converge" in document.warnings[0]
    assert "must not be used" in document.warnings[0]
    assert facts(document)["Convergence"].startswith("NOT reached")


def test_the_copied_position_is_told_and_said_to_count_once(document: Document) -> None:
    assert any(
        text.startswith("Measurement 18 repeats the coordinates of measurement 14") and "counts once" in text
        for text in document.warnings
    )


@pytest.mark.long
def test_a_recording_that_contradicts_its_model_is_a_warning_and_the_diagnosis_is_printed_on_demand(job: Path) -> None:
    path = job / "job.toml"
    text = re.sub(r"(?m)^effects = .*", 'effects = ["scale_x", "scale_y", "scale_z"]', path.read_text(encoding="utf-8"))
    path.write_text(text.replace("[job]\n", "[job]\ndiagnosis_on_certificate = true\n", 1), encoding="utf-8")
    document = outcome_of(analyse(job)).document
    assert "does not agree with the model" in document.warnings[0]
    assert "Squareness X–Y" in document.warnings[0]
    assert "What was left out" in [section.title for section in document.sections]


def test_a_consistent_recording_prints_no_diagnosis_unless_asked(document: Document) -> None:
    assert not any("does not agree" in text for text in document.warnings)
    assert "What was left out" not in [section.title for section in document.sections]


def test_the_summary_carries_the_certificates_figures(result: Result, document: Document) -> None:
    lines = [" ".join(row) for row in outcome_of(result).summary.rows]
    for row in table(document, "Figures of performance").rows:
        assert any(f"{row[1]} ± {row[2]}" in line for line in lines)
    assert any("FAIL" in line for line in lines)


def test_results_and_decisions_come_first_and_what_interprets_them_is_in_the_annex(document: Document) -> None:
    titles = [(section.title, section.opinion) for section in document.sections]
    assert titles == [
        ("Figures of performance", False), ("Statements of conformity", False), ("Error factors", False),
        ("Where the error factors hold", False), ("Artefact and traceability", False), ("Lengths", False),
        ("Budget of one length", False), ("Method", False),
        ("The adjustment that the machine needs", True), ("Posterior distribution", True),
    ]  # fmt: skip


def test_the_first_page_says_what_every_statement_comes_to(document: Document) -> None:
    """340 µm of 60 µm, u = 7.07 µm: who reads nothing else knows what, how much, against which limit and by which rule."""
    assert document.decides
    assert document.overview is not None
    assert (document.overview.verdict, document.overview.standing) == ("Does not conform", "bad")
    rows = dict(document.overview.rows)
    assert rows["ASME B89.4.1-1997, volumetric performance"] == "fail: 340 ± 14 µm, limit 60 µm"
    assert rows["Decision rule"].startswith("ISO 14253-1:2017")


@pytest.mark.long
def test_the_first_page_has_the_picture_and_no_other_has_it_again() -> None:
    made = outcome_of(analysed("step-gauge-simulated")).document
    first = [section for section in made.sections if section.first]
    (plot,) = [block for section in first for block in section.blocks]
    assert isinstance(plot, Plot)
    assert "±MPE" in plot.caption
    again = [b for section in made.sections if not section.first for b in section.blocks if isinstance(b, Plot)]
    assert plot.svg not in [one.svg for one in again]


def test_a_number_is_not_broken_at_the_end_of_a_line(document: Document) -> None:
    """A customer's order beside words that fill its line in the narrow column of particulars."""
    orders = Facts(tuple((Verbatim("Order"), Verbatim("w" * n + " CAL-2024-0117-DIM")) for n in range(1, 24)))
    made = replace(document, particulars=(orders, orders), language="fr")
    text = PdfReader(io.BytesIO(render_pdf(made, {}))).pages[0].extract_text()
    assert text.count("CAL-2024-0117-DIM") >= 2 * 23


def test_a_certificate_without_a_statement_shows_its_figures_first() -> None:
    made = outcome_of(analysed("plate-simulated")).document
    assert made.overview is None
    (first,) = [section for section in made.sections if section.first]
    assert isinstance(first.blocks[0], Table)


def test_the_pdf_signs_on_the_page_that_decides(document: Document) -> None:
    signed = replace(document, warnings=(), signatures=(Signature("Dr. A. Muster", "Head of the laboratory"),))
    pages = [page.extract_text() for page in PdfReader(io.BytesIO(render_pdf(signed, {}))).pages]
    said = "".join(pages[0].split())
    for text in ("Doesnotconform", "340±14µm,limit60µm", "Traceability", "Conditions", "Dr.A.Muster", "Page1of"):
        assert text in said
    assert "Errorfactorsofthemachine" not in said


def test_the_conditions_stand_with_the_method(document: Document) -> None:
    assert dict(document.particulars[-1].rows)["Conditions"] == "20 °C, controlled; 11 thermocouples on the machine"


def test_the_annex_is_marked_as_such_and_comes_after_the_statements(document: Document) -> None:
    html = render_html(document)
    places = [html.index(text) for text in ("reproduced except in full", "Annex: opinions and interpretations", "7.8.7",
                                            "What to turn and what to enter", "Posterior distribution:")]  # fmt: skip
    assert places == sorted(places)


@pytest.mark.long(but="a")
@pytest.mark.parametrize(
    "kind", ["sphere-simulated", "digitizer-simulated", "gauge-blocks-simulated", "shift-simulated"]
)
def test_every_kind_begins_with_its_results(kind: str) -> None:
    made = outcome_of(analysed(kind)).document
    table = next(block for section in made.sections for block in section.blocks if isinstance(block, Table))
    assert "U" in [column.heading for column in table.columns]
    assert [section.opinion for section in made.sections] == sorted(section.opinion for section in made.sections)


def test_the_formula_of_an_mpe_stands_with_its_limit() -> None:
    """3 + 800/80 = 13 µm."""
    made = outcome_of(analysed("gauge-blocks-simulated")).document
    (decision,) = [block for section in made.sections for block in section.blocks if isinstance(block, DecisionBlock)]
    assert decision.limit == "4.25 µm at L = 100 mm; MPE = (3 + L/80) µm, L in mm"


def test_a_diagnosis_that_the_job_asks_for_is_an_opinion(result: Result) -> None:
    asked = outcome_of(replace(result, job=changed(result.job, job={"diagnosis_on_certificate": True}))).document
    assert [section.opinion for section in asked.sections if section.title == "Diagnosis"] == [True]


def test_the_next_calibration_is_printed_only_where_the_customer_agreed(result: Result, document: Document) -> None:
    label = "Next calibration, as agreed with the customer"
    agreed = changed(result.job, job={"recalibration_agreed": dt.date(2005, 9, 1)})
    assert label not in facts(document)
    assert facts(outcome_of(replace(result, job=agreed)).document)[label] == "2005-09-01"
