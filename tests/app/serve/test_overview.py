"""To which group a machine belongs, and which come first."""

from __future__ import annotations

import datetime as dt

import pytest

from cmm_uq.app.serve.view import DueDate, MachineStanding, groups, in_order
from cmm_uq.base.messages import say
from cmm_uq.laboratory.records.listing import Called, ListedCertificate, Newest

TODAY = dt.date(2026, 11, 22)


def newest(
    serial: str = "1", *, decision: str = "pass", diagnosis: str = "consistent", state: str = "released"
) -> Newest:
    day = dt.date(2026, 1, 31)
    listed = ListedCertificate(
        1, "j", "n", serial, "", "a", "ballbar", "measured", day, state, decision, diagnosis, False, "report"
    )
    return Newest(Called(serial, "", "", "", "", False), listed)


def due(days: int) -> DueDate:
    return DueDate(TODAY + dt.timedelta(days=days), say("so many days"))


@pytest.mark.parametrize(("days", "group"), [(-1, "overdue"), (0, "due"), (60, "due"), (61, "order")])
def test_a_machine_is_overdue_from_the_day_after_it_is_due(days: int, group: str) -> None:
    assert groups(newest(), due(days), TODAY) == (group,)


@pytest.mark.parametrize(("said", "found"), [
    ({"decision": "fail"}, ("failing",)), ({"decision": "conditional fail"}, ("failing",)),
    ({"decision": "undecided"}, ("open",)), ({"decision": "incomplete"}, ("open",)), ({"decision": "remeasure"}, ("open",)),
    ({"decision": "conditional pass"}, ("open",)), ({"decision": "of another version"}, ("open",)),
    ({"decision": "none"}, ("order",)), ({"state": "draft"}, ("draft",)), ({"diagnosis": ""}, ("order",)),
    ({"diagnosis": "unexplained"}, ("diagnosis",)), ({"diagnosis": "partial", "state": "draft"}, ("diagnosis", "draft")),
    ({"decision": "fail", "diagnosis": "explained", "state": "draft"}, ("failing", "diagnosis", "draft")),
])  # fmt: skip
def test_a_machine_stands_as_its_newest_certificate_says(said: dict[str, str], found: tuple[str, ...]) -> None:
    assert groups(newest(**said), due(200), TODAY) == found


def test_a_machine_without_a_certificate_is_not_in_order() -> None:
    assert groups(Newest(newest().machine, None), None, TODAY) == ("never",)


def test_what_is_longest_overdue_comes_first_then_what_fails() -> None:
    known = {
        "in order": ({}, 300),
        "late": ({}, -5),
        "later": ({}, -50),
        "fails": ({"decision": "fail"}, 100),
        "soon": ({}, 9),
    }
    machines = [newest(name, **said) for name, (said, _) in known.items()]
    stands = [
        MachineStanding(one, due(days), groups(one, due(days), TODAY))
        for one, (_, days) in zip(machines, known.values(), strict=True)
    ]
    assert [one.serial for one in in_order(stands)] == ["later", "late", "fails", "soon", "in order"]
