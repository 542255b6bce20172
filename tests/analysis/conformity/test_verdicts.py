"""One list of what is stated: tolerances by the whole 95 % interval, the gravest outcome, and the same read back."""

from __future__ import annotations

import json

import pytest

from cmm_uq.analysis.conformity.statement import GRAVEST as FINDINGS, by_tolerance
from cmm_uq.base.units import UNITS
from cmm_uq.jobs.verdicts import GRAVEST, NO_VERDICTS, Verdict, Verdicts
from cmm_uq.maths.uncertainty.quantity import Quantity

PPM = UNITS["ppm"]


def stated(*outcomes: str) -> Verdicts:
    return Verdicts(Verdict(f"E{i}", one, 1.0, 0.5, 2.0, UNITS["µm"]) for i, one in enumerate(outcomes))


@pytest.mark.parametrize(
    ("low", "high", "outcome"),
    [
        (-4.0, 5.0, "pass"),  # an end at the tolerance is within it
        (-5.0, 4.0, "pass"),
        (-4.0, 5.1, "undecided"),
        (-5.1, 4.0, "undecided"),
        (-6.0, 6.0, "undecided"),
        (5.0, 6.0, "undecided"),  # the tolerance itself conforms
        (5.1, 6.0, "fail"),
        (-6.0, -5.0, "undecided"),
        (-6.0, -5.1, "fail"),
    ],
)
def test_a_tolerance_of_five(low: float, high: float, outcome: str) -> None:
    quantity = Quantity((low + high) / 2, (high - low) / 4, (low, high), PPM)
    found = by_tolerance("scale_x.ppm", "Scale of X", quantity, 5.0)
    assert (found.outcome, found.limit, found.by) == (outcome, 5.0, "")


@pytest.mark.parametrize(("low", "outcome"), [(-2.0, "undecided"), (4.0, "undecided"), (5.1, "fail")])
def test_what_speaks_against_a_pass_makes_none_and_hides_no_fail(low: float, outcome: str) -> None:
    quantity, against = Quantity(low + 1, 0.5, (low, low + 2), PPM), ("it is estimated without some measurements",)
    found = by_tolerance("scale_x.ppm", "Scale of X", quantity, 5.0, against=against)
    assert (found.outcome, found.missing) == (outcome, against if low == -2.0 else ())


def test_what_the_recording_does_not_determine_is_undecided_and_says_so() -> None:
    found = by_tolerance("scale_x.ppm", "Scale of X", Quantity(0.0, 1.0, (-2.0, 2.0), PPM), 5.0, determined=False)
    assert (found.outcome, found.value, found.U) == ("undecided", None, None)
    assert found.missing == ("the recording does not determine it",)


@pytest.mark.parametrize(
    ("outcomes", "overall"),
    [
        (("pass", "fail", "undecided"), "fail"),
        (("remeasure", "conditional fail"), "conditional fail"),
        (("undecided", "remeasure"), "remeasure"),
        (("incomplete", "undecided"), "undecided"),
        (("conditional pass", "incomplete"), "incomplete"),
        (("pass", "conditional pass"), "conditional pass"),
        (("pass", "pass"), "pass"),
        (("pass", "a word of another package"), "a word of another package"),
        (("fail", "a word of another package"), "fail"),
        ((), "none"),
    ],
)
def test_the_gravest_stands_for_all(outcomes: tuple[str, ...], overall: str) -> None:
    found = stated(*outcomes)
    assert found.overall == overall
    assert found.conforming == (overall in ("pass", "none"))


def test_what_is_written_is_read_back() -> None:
    found = Verdicts(
        (*stated("pass", "incomplete"), by_tolerance("b.ppm", "B", Quantity(9.0, 1.0, (7.0, 11.0), PPM), 5.0))
    )
    assert Verdicts.of_results(json.loads(json.dumps({"verdicts": found.data()}))) == found
    assert Verdicts.of_results({"verdicts": NO_VERDICTS.data(), "conformity": []}) == ()


def test_results_of_earlier_versions_have_none_of_it_and_say_the_same() -> None:
    old = {
        "conformity": [{"standard": "ISO 10360-2:2009", "characteristic": "E0", "decision": "pass", "value_um": 1.0,
                        "u_um": 0.2, "limit_um": 3.0, "missing": []}],
        "tolerances": {"scale_x": {"ppm": 25.0, "verdict": "out"}, "scale_y": {"ppm": 25.0, "verdict": "open"}},
        "estimates": {"scale_x": {"ppm": {"value": -53.0, "U": 6.0}}},
    }  # fmt: skip
    found = Verdicts.of_results(old)
    assert [(one.called, one.outcome, one.value, one.U, one.limit, one.unit) for one in found] == [
        ("ISO 10360-2:2009 E0", "pass", 1.0, 0.4, 3.0, "µm"), ("scale_x.ppm", "fail", -53.0, 6.0, 25.0, "ppm"),
        ("scale_y.ppm", "undecided", None, None, 25.0, "ppm"),
    ]  # fmt: skip
    assert found.overall == "fail"


def test_findings_and_outcomes_have_one_order() -> None:
    assert [one for one in GRAVEST if one != "incomplete"] == list(FINDINGS)
