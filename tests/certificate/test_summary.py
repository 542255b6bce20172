"""The summary of a certificate, and U not below the laboratory's capability."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from cmm_uq.app.commands.report import analyse, outcome_of
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import DecisionBlock
from cmm_uq.certificate.result import Outcome, Result
from cmm_uq.certificate.sections.results import summary
from cmm_uq.certificate.wording import Headline
from cmm_uq.jobs.tables.identification import Capability, LengthCapability
from cmm_uq.maths.uncertainty.quantity import Quantity
from tests.artefacts.reading import number, tables
from tests.artefacts.simulated import analysed, blocks
from tests.certificate.test_completeness import changed
from tests.conftest import ROOT


def said(job: str) -> Headline:
    (verdict,) = summary(analysed(job), ()).verdicts
    return verdict


def test_an_incomplete_test_is_no_pass_and_says_what_it_lacks() -> None:
    verdict = said("gauge-blocks-simulated")
    assert (verdict.word, verdict.standing) == ("INCOMPLETE", "open")
    assert verdict.subject.startswith("VDI/VDE 2617, ")
    assert verdict.remarks[0].startswith("the lengths measured conform (2.47 µm against 4.25 µm, ")
    assert verdict.remarks[1].startswith("missing: space diagonal +X +Y +Z; ")
    (block,) = [block for block in blocks("gauge-blocks-simulated") if isinstance(block, DecisionBlock)]
    assert block.outcome == "incomplete"
    assert "parallel to Z" in block.missing
    assert block.explanation.startswith("The lengths measured conform; the test lacks")
    assert "24 lengths decided" in block.explanation


def test_a_failed_test_says_what_it_lacks_after_its_figures() -> None:
    """U is twice the standard uncertainty that results.json states of the value, 7.071 µm."""
    verdict = said("iota-1102-20C")
    assert (verdict.word, verdict.standing) == ("FAIL", "bad")
    assert verdict.subject == "ASME B89.4.1-1997, volumetric performance"
    value, u, chance, missing = verdict.remarks
    assert value == "340 µm against 60 µm"
    assert u == "test uncertainty U = 14 µm (k = 2)"
    assert chance == "conforming with less than\u00a00.01\u00a0%"
    assert missing.startswith("missing: 1 of 20 positions")


def test_a_complete_test_passes_with_nothing_missing() -> None:
    verdict = said("sphere-simulated")
    assert (verdict.word, verdict.standing) == ("PASS", "good")
    assert not any("missing" in remark for remark in verdict.remarks)


@pytest.mark.long
def test_without_an_uncertainty_no_probability_is_printed(tmp_path: Path) -> None:
    job = tmp_path / "job"
    shutil.copytree(ROOT / "examples" / "gauge-blocks-simulated", job)
    text = (job / "job.toml").read_text(encoding="utf-8")
    text = text.replace("u_um = 0.15\n", "").replace("[[conformity]]\n", '[[conformity]]\nrule = "simple"\n')
    (job / "job.toml").write_text(text, encoding="utf-8")
    result = analyse(job)
    (verdict,) = summary(result, ()).verdicts
    assert verdict.remarks[0] == "the lengths measured conform (2.47 µm against 4.25 µm)"
    (block,) = [
        b for section in outcome_of(result).document.sections for b in section.blocks if isinstance(b, DecisionBlock)
    ]
    assert (block.measured, "Probability" in block.explanation) == ("2.47 µm", False)
    assert "No uncertainty is stated above zero" in block.explanation


@pytest.fixture(scope="module")
def result() -> Result:
    found = analysed("iota-1102-20C")
    assert isinstance(found, Result)
    return found


def stated(found: Result, capability: Capability) -> Outcome:
    return outcome_of(replace(found, job=changed(found.job, laboratory={"cmc": capability})))


def test_a_smaller_uncertainty_becomes_that_with_k_two_and_a_larger_stays() -> None:
    small = Quantity(5.0, 0.1, (4.8, 5.2), unit("µm"))
    raised = small.at_least(1.0)
    assert (raised.expanded, raised.u, raised.coverage_factor, raised.interval95) == (1.0, 0.5, 2.0, (4.0, 6.0))
    assert small.at_least(0.15) is small


def test_every_error_factor_has_at_least_the_laboratory_s_uncertainty(result: Result) -> None:
    """U of the scales is 40, 42 and 49 ppm, of the squarenesses 16, 14 and 17 ″."""
    outcome = stated(result, Capability(scale_ppm=45.0, angle_arcsec=15.0))
    rows = {row[0]: row for row in tables(outcome.document)["Error factors of the machine"].rows}
    assert {name: (row[2], row[3]) for name, row in rows.items()} == {
        "Scale error of X": ("45", "2.00"), "Scale error of Y": ("45", "2.00"), "Scale error of Z": ("49", "2.00"),
        "Squareness X–Y": ("16", "2.01"), "Squareness Y–Z": ("15", "2.00"), "Squareness Z–X": ("17", "2.01"),
    }  # fmt: skip
    raised = [name for name in outcome.results["cmc"]["raised"] if not name.startswith("distance_equations")]
    assert raised == ["scale_x.ppm", "scale_y.ppm", "squareness_yz.angle_arcsec"]
    assert outcome.results["cmc"]["raised"]["scale_x.ppm"]["evaluated_U"] == pytest.approx(
        result.parameters["scale_x"]["ppm"].expanded
    )
    assert outcome.results["estimates"]["scale_x"]["ppm"]["u"] == 22.5
    named = "than what was evaluated (scale_x.ppm, scale_y.ppm, squareness_yz.angle_arcsec"
    assert any(named in text for text in outcome.warnings)
    assert any("larger than what was evaluated." in text for text in outcome.document.warnings)  # without keys


def test_lengths_take_the_formula_at_the_artefact_s_length(result: Result) -> None:
    """10 µm + 404.2357 mm / 100 = 14.04 µm."""
    capability = Capability(length=LengthCapability(a_um=10.0, k=100.0))
    rows = {row[0]: row for row in tables(stated(result, capability).document)["Figures of performance"].rows}
    assert rows["Mean length"][1:4] == ("404.205", "0.014", "2.00")
    assert rows["Range of the lengths, on average over repeats"][2] == "40"


def test_single_lengths_and_the_second_way_have_no_smaller_uncertainty(result: Result) -> None:
    """U of a length is 34 µm by the noise and 90 µm by 40 µm + 404.2 mm / 8.08473; the equations have U below 60 ppm and ″."""
    capability = Capability(length=LengthCapability(a_um=40.0, k=8.08473), scale_ppm=60.0, angle_arcsec=60.0)
    outcome = stated(result, capability)
    found = tables(outcome.document)
    assert any("U = 90 µm (k = 2.00) for each length" in note for note in found["Lengths brought to 20 °C"].notes)
    assert outcome.results["lengths"]["U_um"] == pytest.approx(90.0, abs=0.01)
    assert outcome.results["lengths"]["k"] == 2.0
    rows = found["The six factors by the distance equations, a second way"].rows
    assert len(rows) == 6
    assert {(number(row[2]), row[3]) for row in rows} == {(60.0, "2.00")}
    factors = outcome.results["distance_equations"]["factors"]
    assert {figure["U"] for effect in factors.values() for figure in effect.values()} == {60.0}
    assert {"lengths.U_um", "distance_equations.scale_x.ppm"} <= set(outcome.results["cmc"]["raised"])


def test_lines_of_a_gauge_keep_to_it_too() -> None:
    found = analysed("step-gauge-simulated")
    outcome = stated(found, Capability(length=LengthCapability(a_um=33.0), scale_ppm=77.0))
    rows = tables(outcome.document)["Each line by itself, at 20 °C"].rows
    assert {number(row[5]) for row in rows} == {77.0}
    assert {line["slope_ppm"]["k"] for line in outcome.results["lines"]} == {2.0}
    assert {line["bidirectional_um"]["U"] for line in outcome.results["lines"] if line["bidirectional_um"]} <= {33.0}
    assert "lines.slope_ppm" in outcome.results["cmc"]["raised"]


@pytest.mark.long
def test_without_a_capability_nothing_changes(result: Result) -> None:
    plain, empty = outcome_of(result), stated(result, Capability())
    assert "cmc" not in plain.results
    assert plain.document == empty.document


@pytest.mark.long(but="shift-simulated")
@pytest.mark.parametrize(("job", "caption", "quantity"), [
    ("shift-simulated", "Axis figures", "Mean sensitivity error of axis x"),
    ("shift-plate-simulated", "Plane figures", "Scale of X"),
])  # fmt: skip
def test_shifted_artefacts_keep_to_it_too(job: str, caption: str, quantity: str) -> None:
    found = analysed(job)
    job_with = changed(found.job, laboratory={"cmc": Capability(scale_ppm=77.0)})
    outcome = outcome_of(type(found)(**{**vars_of(found), "job": job_with}))
    row = next(row for row in tables(outcome.document)[caption].rows if row[0] == quantity)
    assert (number(row[2]), row[3]) == (77.0, "2.00")
    assert any("calibration and measurement capability" in text for text in outcome.warnings)


def test_the_curve_of_an_axis_keeps_to_it_at_every_position() -> None:
    """50 µm + (589.964 − 99.988) mm / 10 = 99.0 µm at the far end; at the first position the error is zero by definition."""
    found = analysed("shift-simulated")
    capability = Capability(length=LengthCapability(a_um=50.0, k=10.0))
    with_it = type(found)(**{**vars_of(found), "job": changed(found.job, laboratory={"cmc": capability})})
    rows = tables(outcome_of(with_it).document)["Error by position"].rows
    assert (rows[0][2], rows[1][2], rows[-1][2]) == ("0", "52", "99")
    assert outcome_of(with_it).results["curves"]["linearity_x"]["U_um"][-1] == pytest.approx(98.9976, abs=1e-3)


def vars_of(found: Result) -> dict[str, object]:
    return {name: getattr(found, name) for name in type(found).__dataclass_fields__}
