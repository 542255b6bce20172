"""What the terminal says of a statement of conformity."""

from __future__ import annotations

import shutil
from pathlib import Path

from cmm_uq.app.commands.report import analyse, outcome_of
from cmm_uq.certificate.document import DecisionBlock
from cmm_uq.certificate.sections.first_page import summary
from cmm_uq.certificate.wording import Headline
from tests.artefacts.simulated import analysed, blocks
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
