"""What the certificate and results.json of an axis calibrated by shifting say."""

from __future__ import annotations

import json
import re
import shutil

import numpy as np
import pytest

from cmm_uq.app.commands.report import analyse, outcome_of
from cmm_uq.artefacts.shift.axis import ShiftResult
from cmm_uq.artefacts.shift.axis_page import shift_results
from cmm_uq.certificate.document import Document, Plot
from cmm_uq.certificate.origin import as_json
from tests.artefacts.reading import number, tables
from tests.artefacts.simulated import analysed
from tests.conftest import ROOT

EXAMPLE = ROOT / "examples" / "shift-simulated"


@pytest.fixture(scope="module")
def result() -> ShiftResult:
    found = analysed(EXAMPLE.name)
    assert isinstance(found, ShiftResult)
    return found


@pytest.fixture(scope="module")
def document(result: ShiftResult) -> Document:
    return outcome_of(result).document


@pytest.fixture(scope="module")
def two_placings(tmp_path_factory: pytest.TempPathFactory) -> ShiftResult:
    """The first two series, without a known length."""
    job = tmp_path_factory.mktemp("two") / "job"
    shutil.copytree(EXAMPLE, job)
    text = (job / "job.toml").read_text(encoding="utf-8")
    text = re.sub(r"known = .*\n", "", re.sub(r"shifts_mm = .*", "shifts_mm = [0.0, 20.0]", text))
    (job / "job.toml").write_text(text, encoding="utf-8")
    rows = (job / "recording.csv").read_text(encoding="utf-8").splitlines()
    (job / "recording.csv").write_text("\n".join(r for r in rows if not r.startswith("3,")) + "\n", encoding="utf-8")
    found = analyse(job)
    assert isinstance(found, ShiftResult)
    return found


def test_it_tells_what_was_read_and_what_was_found_in_this_order(document: Document) -> None:
    assert [section.title for section in document.sections] == [
        "Figures of performance", "Artefact and traceability", "Error of the axis", "What the shifts leave open",
        "Residuals", "Method",
    ]  # fmt: skip


def test_the_table_of_errors_holds_the_true_error_within_twice_its_uncertainty(document: Document) -> None:
    """The example's own formula; 95 % of single intervals hold, twice their width all of these 47."""
    for x, error, U, band in tables(document)["Error by position"].rows[1:]:
        at = np.array([number(x), 99.988])
        true = 12 * np.sin(at / 90) + 10 * np.exp((at - 590) / 60) + 8e-3 * at
        assert abs(number(error) - (true[0] - true[1])) < 2 * number(U)
        assert number(band) > number(U)


def test_curve_pattern_and_residuals_are_drawn(document: Document) -> None:
    plots = [b for section in document.sections for b in section.blocks if isinstance(b, Plot)]
    assert len(plots) == 3
    assert "disagree by 2.31 µm rms without and 0.52 µm with the curve" in plots[2].alternative


def test_what_the_shifts_leave_open_is_warned_of(document: Document) -> None:
    assert any("1 combination of the errors" in text for text in document.warnings)


@pytest.mark.long
def test_without_a_known_length_the_certificate_says_that_there_is_no_scale(two_placings: ShiftResult) -> None:
    document = outcome_of(two_placings).document
    assert any("mean sensitivity of the axis is not determined" in text for text in document.warnings)
    assert "The artefact's own dimensions" not in tables(document)
    assert shift_results(two_placings)["artefact"]["distance_mm"] is None


def test_two_placings_stand_beside_the_sources_integrations(two_placings: ShiftResult) -> None:
    table = tables(outcome_of(two_placings).document)["Beside the integrations of the method's source"]
    assert len(table.rows) == 23
    for row in table.rows[1:]:
        _, simple, u, improved, *_ = map(number, row)
        assert abs(simple - improved) < 3 * u  # pitch and shift are equal: both sum the same slopes


def test_results_keep_their_contract(result: ShiftResult) -> None:
    found = json.loads(as_json(shift_results(result)))
    assert found["schema"] == "cmm-uq/results/1"
    assert found["sampling"]["converged"]
    curve = found["curves"]["linearity_x"]
    assert len(curve["position_mm"]) == len(curve["error_um"]) == len(curve["u_um"]) == 47
    assert set(found["estimates"]["scale_x"]["ppm"]) == {"value", "u", "interval95", "U", "k"}
    assert found["improvement"]["rms_after_um"] < found["improvement"]["rms_before_um"]
    assert "accuracy" not in found  # no lengths are measured
    assert "diagnosis" not in found
    assert found["identifiability"]["period_not_seen_mm"] == pytest.approx(10.0)


def test_what_is_left_with_the_curve_is_the_repeatability(result: ShiftResult) -> None:
    """Means of three: 1.1/√3 µm, less by the 25 of 69 that points, shifts and slope take and what the curve does."""
    after = shift_results(result)["improvement"]["rms_after_um"]
    assert 1.1 / 3**0.5 * (25 / 69) ** 0.5 < after < 1.1 / 3**0.5 * (44 / 69) ** 0.5 * 1.3


def test_the_command_ends_with_figures_and_warnings(result: ShiftResult) -> None:
    said = [row[0] for row in outcome_of(result).summary.rows]
    assert said[:4] == ["Measured", "Linearity error, peak to valley", "Mean sensitivity error of axis x",
                        "Repeatability (one reading)"]  # fmt: skip
    assert "Warning" in said
