"""Who is compared with whom, and who is said not to belong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.laboratory.due.fleet import Fleet, FleetMember, comparable, judged
from tests.certificate.fleets import alone, two
from tests.laboratory.due.drifting import machine

ONE_DAY, TWO_DAYS = ((0.0, 0.0), (0.0, 1.0))


def seen(*days: tuple[float, float]) -> tuple[FleetMember, ...]:
    return tuple(FleetMember(f"{i}", "", "", machine(list(each), [0.0, 0.0])) for i, each in enumerate(days))


@pytest.mark.parametrize(
    ("days", "compared"),
    [
        ((TWO_DAYS,), False),
        ((ONE_DAY, ONE_DAY), False),
        ((TWO_DAYS, ONE_DAY), False),
        ((TWO_DAYS, ONE_DAY, TWO_DAYS), True),
    ],
)
def test_machines_are_compared_where_two_have_certificates_of_two_days(
    days: tuple[tuple[float, float], ...], compared: bool
) -> None:
    assert comparable(seen(*days)) == compared


def with_p(fleet: Fleet, *p: float) -> Fleet:
    return replace(fleet, estimates=replace(fleet.estimates, p=np.array(p)))


def test_a_value_that_compares_nobody_neither_accuses_nor_counts() -> None:
    """Of two, p = 0.024 is below 5 %/2; of three, with the value that compares nobody, it were not below 5 %/3."""
    one, both = alone().values[0], two().values[0]
    found = judged(
        [
            ("a", "A", "ppm", one.members, with_p(one.fleet, 0.9), 0),
            ("b", "B", "ppm", both.members, with_p(both.fleet, 0.9, 0.024), 0),
        ],
        1,
    )
    assert [(of.name, i) for of, i in found.outsiders] == [("b", 1)]
    assert judged([("a", "A", "ppm", one.members, with_p(one.fleet, 1e-12), 0)], 1).outsiders == []
    assert (found.compared, [of.compared for of in found.values]) == (True, [False, True])
