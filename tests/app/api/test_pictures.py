"""What was found draws itself with the pictures of its certificate, and its tables are those that are printed there."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

import cmm_uq
from cmm_uq.app.api.outcomes import Part, Report
from cmm_uq.certificate.document import Plot, Table
from cmm_uq.jobs.part.job import TABLES
from tests.artefacts.simulated import reported
from tests.conftest import ROOT
from tests.part_machines import THERE, by_results, plate_of
from tests.part_reports import nothing_foreseen

IOTA = ROOT / "examples" / "iota-1102-20C"


@pytest.fixture(scope="module")
def found() -> Report:
    return reported("iota-1102-20C")


@pytest.fixture(scope="module")
def gauge() -> Report:
    return reported("gauge-blocks-simulated")


@pytest.fixture(scope="module")
def part() -> Part:
    job = plate_of(by_results(), np.zeros((60, 3)), characteristic=TABLES["characteristic"][:2], **THERE)
    with pytest.MonkeyPatch.context() as patched:
        nothing_foreseen(patched)
        return cmm_uq.part(job, trials=2_000)


def texts(figure: Figure) -> set[str]:
    return {text.get_text() for axes in figure.axes for text in axes.texts} | {
        axes.get_xlabel() for axes in figure.axes
    }


def dark(figure: Figure, dpi: int = 60) -> int:
    """Pixels that are not white, as Agg draws them."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    figure.set_dpi(dpi)
    canvas.draw()
    return int((np.asarray(canvas.buffer_rgba())[..., :3].min(axis=2) < 200).sum())


def test_every_picture_of_the_certificate_is_there_and_nothing_else_but_its_diagnosis(found: Report) -> None:
    drawn = [block for one in found.outcome.document.sections for block in one.blocks if isinstance(block, Plot)]
    assert set(found.pictures) == {"lengths", "residuals", "budget", "posterior", "ranking", "field"}
    assert len(drawn) == 4
    assert all(isinstance(one, Figure) for one in found.pictures.values())


def test_what_was_composed_without_figures_is_the_same_afterwards(found: Report) -> None:
    before = found.compose()
    found.plot("residuals")
    assert found.compose() == before


def test_the_trumpet_has_every_error_at_its_length(gauge: Report) -> None:
    statement = gauge.outcome.found.statements[0]  # type: ignore[attr-defined]
    (axes,) = gauge.plot().axes  # the picture that says most
    assert gauge.plot() is gauge.plot("trumpet")
    marks = [line.get_xydata() for line in axes.lines if line.get_marker() in ("o", "x")]
    drawn = sorted(map(tuple, np.round(np.vstack(marks), 6)))
    assert drawn == sorted((round(one.length_mm, 6), round(one.error_um, 6)) for one in statement.errors)
    assert axes.get_xlabel() == "Length / mm"


def test_dots_are_there_as_pixels_too(gauge: Report) -> None:
    """In SVG and PDF a dot is a stroke of no length with round ends, which matplotlib's own renderer leaves out."""
    figure = gauge.plot("residuals")
    with_dots = dark(figure)
    for axes in figure.axes:
        for line in axes.lines:
            if line.get_marker() == "o":
                line.set_visible(False)
    assert with_dots > dark(figure) + 100


def test_the_field_is_the_residuals_in_the_volume(found: Report) -> None:
    assert found.diagnosis.plot() is found.plot("field")
    assert {axes.get_xlabel() for axes in found.plot("field").axes} <= {"X / mm", "Y / mm", "Z / mm"}
    assert found.diagnosis == found.results["diagnosis"]


def test_the_ranking_names_what_the_recording_deviates_by_most(found: Report) -> None:
    (axes,) = found.plot("ranking").axes
    first, *_ = [text.get_text() for text in axes.get_yticklabels()]
    assert first == "Squareness X–Y, 50 µm"
    assert "79.8 %" in texts(found.plot("ranking"))


def test_a_picture_that_is_not_there_is_named_with_those_that_are(found: Report) -> None:
    with pytest.raises(
        cmm_uq.CmmUqError, match=r"Report of iota-1102-20C has no picture 'trumpet'\. It has ranking, field"
    ):
        found.plot("trumpet")


def test_a_notebook_shows_a_figure_by_itself(found: Report) -> None:
    svg = found.plot("posterior")._repr_svg_()  # type: ignore[attr-defined]
    assert svg.startswith("<svg ")
    assert "Squareness X–Y / ″" in svg


def test_the_tables_are_those_of_the_certificate_as_printed(found: Report) -> None:
    blocks = [block for one in found.outcome.document.sections for block in one.blocks if isinstance(block, Table)]
    assert [frame.to_numpy().tolist() for frame in found.tables.values()] == [
        list(map(list, one.rows)) for one in blocks
    ]
    assert "Estimate" in found.tables["Error factors of the machine"]
    assert "<table" in found.tables["Error factors of the machine"].to_html()


def test_units_stand_in_the_headings(gauge: Report) -> None:
    table = next(frame for name, frame in gauge.tables.items() if name.startswith("All values decided by VDI/VDE 2617"))
    assert {"Length / mm", "Errors / µm", "U / µm", "Limit / µm"} <= set(table)


def test_a_part_draws_its_characteristics_between_their_limits(part: Part) -> None:
    (axes,) = part.plot().axes
    assert len(axes.get_yticklabels()) == len(part.characteristics)
    assert part.plot() is part.plot("limits")
    assert {"part", "budget"} <= set(part.pictures)


def test_a_job_in_german_draws_in_german() -> None:
    truth = {"seed": 4, "effects": {"squareness_xy": {"angle_arcsec": -173.0}}, "noise": {"coordinate_um": 1.2}}
    german = cmm_uq.report(cmm_uq.simulate(IOTA, truth), language="de")
    assert any("Rechtwinkligkeit" in text.get_text() for text in german.plot("ranking").axes[0].get_yticklabels())


def test_an_export_says_what_each_column_was_taken_for_and_makes_a_job() -> None:
    export = cmm_uq.read_export(ROOT / "docs" / "tutorial" / "ballbar-export.xlsx")
    assert export.columns.loc["y_mm"].tolist() == ["Y [mm]", "mm"]
    assert export.reading["Header"] == "Export row 4"
    assert export.points.loc[5].tolist() == [1, 1, -496.6823, -134.2409, 27.7912]  # its line in the sheet
    job = cmm_uq.job(export.points, machine="M", artefact="ballbar", effects=["scale_x"])
    assert len(job.points) == len(export.points) == 40
    assert "Y [mm]" in export._repr_html_()


def test_a_wrong_key_for_an_export_is_named() -> None:
    with pytest.raises(cmm_uq.CmmUqError, match=r"\[unt\]: unknown key\. Did you mean 'unit'"):
        cmm_uq.read_export(ROOT / "docs" / "tutorial" / "ballbar-export.xlsx", unt="mm")
