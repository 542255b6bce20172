"""What the certificate of a step gauge says."""

from __future__ import annotations

import numpy as np

from cmm_uq.certificate.document import Paragraph, Plot
from tests.artefacts.simulated import SCALE, SQUARE, analysed, blocks, recovered, table
from tests.conftest import ROOT

JOB = "step-gauge-simulated"


def test_the_errors_put_into_the_example_are_found() -> None:
    recovered(JOB, {**SCALE, **SQUARE, "hysteresis_x": 1.8, "hysteresis_y": -0.9, "hysteresis_z": 1.2})
    recovered("gauge-blocks-simulated", {"scale_x": 9.0, "scale_y": -6.0, "probe_radius": 0.7})


def test_each_line_has_its_slope_by_a_regression_of_the_recording() -> None:
    """numpy's polyfit of the distance along X over the certified one, straight from the file: line 5 lies along X."""
    rows = np.genfromtxt(ROOT / "examples" / JOB / "recording.csv", delimiter=",", names=True)
    line = rows[rows["measurement"] == 5]
    slope = np.polyfit(line["reference_mm"], line["x_mm"], 1)[0] - 1
    printed = {row[0]: row for row in table(JOB, "Each line by itself, at 20 °C").rows}
    assert printed["5"][1] == "parallel to X"
    assert float(printed["5"][4].replace("−", "-")) == round(slope * 1e6, 1)
    assert [printed[n][1] for n in "1234"] == [
        "space diagonal +X +Y +Z", "space diagonal +X −Y +Z", "space diagonal −X +Y +Z", "space diagonal −X −Y +Z",
    ]  # fmt: skip


def test_the_bidirectional_error_of_a_line_along_an_axis_is_its_backlash() -> None:
    """e = ½·gap·approach: outward minus inward is −gap, and X has 1.8 µm."""
    printed = {row[0]: row for row in table(JOB, "Each line by itself, at 20 °C").rows}
    assert abs(float(printed["5"][7].replace("−", "-")) + 1.8) < 2 * float(printed["5"][8])


def test_lines_too_short_for_the_standard_are_named() -> None:
    """820 mm on a diagonal of 900 × 1200 × 600 mm, 1615.5 mm long, is 51 %: ISO 10360-2 asks for 66 %."""
    notes = " ".join(block.text for block in blocks(JOB) if isinstance(block, Paragraph))
    assert "line 1 (51 %), line 2 (51 %), line 3 (51 %) and line 4 (51 %)" in notes
    assert "Not measured" not in notes


def test_positions_that_were_not_measured_are_named() -> None:
    notes = " ".join(block.text for block in blocks("gauge-blocks-simulated") if isinstance(block, Paragraph))
    assert "Not measured of the seven positions of ISO 10360-2:2009: space diagonal +X +Y +Z" in notes
    assert "and parallel to Z" in notes


def test_deviations_and_residuals_are_shown() -> None:
    captions = [block.caption for block in blocks(JOB) if isinstance(block, Plot)]
    assert any(caption.startswith("Deviation of each face") for caption in captions)
    assert any(caption.startswith("Residuals after the fitted model") for caption in captions)


def test_the_worst_indication_decides_with_the_uncertainty_of_the_gauge() -> None:
    (statement,) = analysed(JOB).statements
    errors = analysed(JOB).artefact.indications()
    assert errors is not None
    worst = np.argmax(np.abs(errors.errors) * 1e3 - (4.0 + errors.lengths / 100.0))
    assert statement.value_um == abs(errors.errors[worst]) * 1e3
    assert statement.u_um == 0.4 * errors.lengths[worst] / 820
    assert statement.decision.outcome == "fail"
