"""What the terminal says of a statement of conformity."""

from __future__ import annotations

from cmm_uq.certificate.document import Decision
from cmm_uq.certificate.summary import summary
from tests.certificate.simulated import analysed, blocks


def said(job: str, standard: str) -> tuple[str, str]:
    (row,) = [row for row in summary(analysed(job)) if row[0] == standard]
    return row[1:]


def test_an_incomplete_test_is_no_pass_and_says_what_it_lacks() -> None:
    outcome, remark = said("gauge-blocks-simulated", "VDI/VDE 2617")
    assert outcome == "INCOMPLETE"
    assert remark.startswith("the lengths measured conform (8.98 µm against 13 µm, ")
    assert "; missing: space diagonal +X +Y +Z; " in remark
    (block,) = [block for block in blocks("gauge-blocks-simulated") if isinstance(block, Decision)]
    assert block.outcome == "incomplete"
    assert "parallel to Z" in block.missing
    assert block.explanation.startswith("The lengths measured conform; the test lacks")
    assert "24 lengths decided" in block.explanation


def test_a_failed_test_says_what_it_lacks_after_its_figures() -> None:
    outcome, remark = said("iota-1102-20C", "ASME B89.4.1-1997")
    assert outcome == "FAIL"
    assert remark.startswith(
        "340 µm against 60 µm; conforming with less than\u00a00.01\u00a0%; missing: 1 of 20 positions"
    )


def test_a_complete_test_passes_with_nothing_missing() -> None:
    outcome, remark = said("sphere-simulated", "ISO 10360-5:2010")
    assert outcome == "PASS"
    assert "missing" not in remark
