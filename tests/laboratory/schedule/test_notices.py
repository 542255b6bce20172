"""Each way in which a certificate is no pass has its event, by the words of results.json."""

from __future__ import annotations

from typing import Any, get_args

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.document import Outcome
from cmm_uq.laboratory.schedule.notices import EVENTS, Notice, of_error, of_results

OF_DECISION = {
    "pass": None, "conditional pass": "undecided", "incomplete": "incomplete", "undecided": "undecided",
    "conditional fail": "fail", "remeasure": "undecided", "fail": "fail", "a word of a later version": "undecided",
}  # fmt: skip


def results(*decisions: str, verdict: str | None = "consistent") -> dict[str, Any]:
    return {
        "job": {"id": "a-1", "machine": "CMM 3", "inputs_sha256": {}},
        "conformity": [
            {"standard": "ISO 10360-2:2009", "characteristic": "E0", "decision": word} for word in decisions
        ],
        "diagnosis": {"verdict": verdict},
    }


def told(data: dict[str, Any]) -> list[Notice]:
    return of_results(data, "0" * 64, "/reports/a-1")


def test_every_decision_that_there_is_has_its_event() -> None:
    assert set(get_args(Outcome)) < set(OF_DECISION)
    for word, event in OF_DECISION.items():
        assert [notice.event for notice in told(results(word))] == ([] if event is None else [event]), word


@pytest.mark.parametrize("verdict", ["explained", "partial", "unexplained", "a word of a later version"])
def test_every_verdict_but_consistent_is_a_mismatch(verdict: str) -> None:
    (notice,) = told(results("pass", verdict=verdict))
    assert notice.event == "mismatch"
    assert notice.text.startswith("CMM 3 (job a-1): the recording contradicts its model")


def test_a_certificate_without_decision_or_diagnosis_says_nothing() -> None:
    assert told({"job": {"id": "a"}, "conformity": [], "diagnosis": None}) == []
    assert told(results(verdict=None)) == []


def test_statements_of_one_event_are_one_notice() -> None:
    fail, undecided = told(results("fail", "undecided", "conditional fail"))
    assert fail.text == "CMM 3 (job a-1): ISO 10360-2:2009 E0: fail, ISO 10360-2:2009 E0: conditional fail."
    assert fail.title == "fail: CMM 3 (job a-1)"
    assert undecided.event == "undecided"
    assert {notice.event for notice in (fail, undecided)} < set(EVENTS)


def test_the_same_is_the_same_notice_and_what_changed_is_another() -> None:
    data = results("fail")
    keys = {of_results(data, inputs, where)[0].key for inputs in ("a", "b") for where in ("x", "y")}
    assert len(keys) == 2
    error = CmmUqError("no such file", where="a/points.csv")
    assert of_error(error, "a", "monday").key == of_error(error, "a", "monday").key
    assert len({of_error(error, about, since).key for about in "ab" for since in ("monday", "friday")}) == 4
