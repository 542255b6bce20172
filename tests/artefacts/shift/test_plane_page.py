"""What the certificate and results.json of two axes calibrated by a shifted and turned plate say."""

from __future__ import annotations

import json

import numpy as np
import pytest

from cmm_uq.app.commands.report import outcome_of
from cmm_uq.artefacts.shift.placed_plate import placed_plate
from cmm_uq.artefacts.shift.plane import PlaneShiftResult, estimate_plane
from cmm_uq.artefacts.shift.plane_page import sections, shift_results, warnings
from cmm_uq.certificate.document import Document, Paragraph, Plot, Table
from cmm_uq.certificate.origin import as_json
from tests.artefacts.reading import number, tables
from tests.artefacts.simulated import analysed
from tests.conftest import ROOT

EXAMPLE = ROOT / "examples" / "shift-plate-simulated"


def error(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of the example, mm, as its remarks state it."""
    yaw = 5e-6 * np.sin(x / 150) + 1e-5 * x / 600
    ex = 0.010 * np.sin(x / 90) + 20e-6 * x + 0.003 * np.sin(y / 100) - 60e-6 * y - y * yaw
    return ex, -0.008 * np.cos(y / 110) - 10e-6 * y + 0.004 * (x / 300 - 1) ** 2 + 0.002 * np.sin(x / 60)


@pytest.fixture(scope="module")
def result() -> PlaneShiftResult:
    found = analysed(EXAMPLE.name)
    assert isinstance(found, PlaneShiftResult)
    return found


@pytest.fixture(scope="module")
def document(result: PlaneShiftResult) -> Document:
    return outcome_of(result).document


@pytest.fixture(scope="module")
def only_shifted(result: PlaneShiftResult) -> PlaneShiftResult:
    """The first four placings, without a known length."""
    points = result.job.points
    plate = placed_plate(points.select(points.measurement <= 4), "xy")
    return PlaneShiftResult(result.job, estimate_plane(plate))


def test_it_tells_what_was_read_and_what_was_found_in_this_order(document: Document) -> None:
    assert [section.title for section in document.sections] == [
        "Figures of performance", "Artefact and traceability", "Errors of the axes", "What the set-ups leave open",
        "Residuals", "Set-ups", "Method",
    ]  # fmt: skip


def test_every_figure_holds_its_truth_within_twice_its_uncertainty(
    result: PlaneShiftResult, document: Document
) -> None:
    rows = {row[0]: row for row in tables(document)["Plane figures"].rows}
    x, y = result.estimate.positions
    middle = result.estimate.plate.middle
    ex, across_x = error(x, middle[1] + 0 * x)
    across_y, ey = error(middle[0] + 0 * y, y)
    ends = {"Scale of X": 1e6 * (ex[-1] - ex[0]) / np.ptp(x), "Scale of Y": 1e6 * (ey[-1] - ey[0]) / np.ptp(y)}
    for name, place, values in (
        ("Linearity of X", x, ex), ("Linearity of Y", y, ey), ("Straightness of X along Y", x, across_x),
        ("Straightness of Y along X", y, across_y),
    ):  # fmt: skip
        line = (values[-1] - values[0]) * (place - place[0]) / np.ptp(place)
        ends[f"{name}, peak to valley"] = 1e3 * np.ptp(values - line)
    for name, true in ends.items():
        assert abs(number(rows[name][1]) - true) < 2 * number(rows[name][2]), name
    assert abs(number(rows["Repeatability (one coordinate)"][1]) - 0.7) < 2 * number(
        rows["Repeatability (one coordinate)"][2]
    )


def test_placings_are_stated_as_found(document: Document) -> None:
    turned = [number(row[1]) for row in tables(document)["Set-ups, as found from the readings"].rows]
    assert turned == pytest.approx([0.0, 0.08, -0.02, 0.03, 90.08, 89.98, 179.98], abs=0.006)


def test_the_known_diagonal_stands_in_the_plates_own_geometry(document: Document) -> None:
    last = tables(document)["The plate's own geometry"].rows[24]
    assert np.hypot(number(last[1]), number(last[3])) == pytest.approx(565.6883, abs=1.5e-3)


def test_every_curve_is_drawn(document: Document) -> None:
    plots = [b.caption.split(",")[0] for section in document.sections for b in section.blocks if isinstance(b, Plot)]
    assert plots[:5] == ["Linearity of X", "Linearity of Y", "Straightness of X along Y", "Straightness of Y along X",
                         "Rotation of X about Z"]  # fmt: skip


def test_results_keep_their_contract(result: PlaneShiftResult) -> None:
    found = json.loads(as_json(shift_results(result)))
    assert found["schema"] == "cmm-uq/results/1"
    assert found["sampling"]["converged"]
    assert set(found["curves"]) == {
        "linearity_x", "linearity_y", "straightness_x_y", "straightness_y_x", "rotation_x_z"
    }  # fmt: skip
    assert len(found["curves"]["linearity_x"]["error_um"]) == len(found["curves"]["linearity_x"]["position_mm"])
    assert "error_arcsec" in found["curves"]["rotation_x_z"]
    assert set(found["estimates"]["squareness_xy"]["angle_arcsec"]) == {"value", "u", "interval95", "U", "k"}
    assert found["identifiability"] == {"not_determined": [], "period_not_seen_mm": {"x": None, "y": None}}
    assert found["improvement"]["rms_after_um"] < 0.5 < found["improvement"]["rms_before_um"]
    assert "diagnosis" not in found


@pytest.mark.long
def test_a_plate_that_is_only_shifted_states_no_scale_and_no_squareness(only_shifted: PlaneShiftResult) -> None:
    assert not {"squareness_xy", "scale_x", "scale_y"} & set(only_shifted.scalars)
    assert "Not determined by these set-ups: scale of X, scale of Y and squareness X–Y" in warnings(only_shifted)[0]
    open_ = next(section for section in sections(only_shifted) if section.title == "What the set-ups leave open")
    words = " ".join(block.text for block in open_.blocks if isinstance(block, Paragraph))
    assert "a set-up turned by 90° parts them" in words
    assert "one known length" in words
    assert "are the same in all set-ups" in words
    captions = [b.caption for section in sections(only_shifted) for b in section.blocks if isinstance(b, Table)]
    assert "The plate's own geometry" not in captions


def test_the_command_ends_with_figures(result: PlaneShiftResult) -> None:
    assert [row[0] for row in outcome_of(result).summary.rows][:3] == ["Measured", "Squareness X–Y", "Scale of X"]
