"""The curve as an error map, and what compensating by it leaves."""

from __future__ import annotations

import numpy as np

from cmm_uq.artefacts.shift.result import Curve, correction_table, table_text
from cmm_uq.base.points import Machine
from cmm_uq.machine.physics.error_map import parse_error_map

POSITION = np.linspace(100.0, 500.0, 41)
ERROR = 0.01 * np.sin(POSITION / 80)
CURVE = Curve(POSITION, np.stack([ERROR - 1e-4, ERROR + 1e-4]))
MACHINE = Machine(travel_mm=np.array([[0.0, 900.0], [0.0, 500.0], [np.nan, np.nan]]))


def test_the_table_is_the_curve_to_a_nanometre_as_displacement_of_its_own_axis() -> None:
    table = parse_error_map(table_text(correction_table("x", CURVE, MACHINE)), "table.csv")
    x, y, z = table.axes
    inside = (x.positions >= 100) & (x.positions <= 500)
    np.testing.assert_allclose(x.positions[inside], POSITION)
    np.testing.assert_allclose(x.errors[inside, 0], ERROR, atol=0.51e-6)
    assert not x.errors[:, 1:].any()
    assert not y.errors.any()
    assert not z.errors.any()


def test_it_reaches_over_the_travel_and_holds_the_last_value_there() -> None:
    x = correction_table("x", CURVE, MACHINE).axes[0]
    assert (x.positions[0], x.positions[-1]) == (0.0, 900.0)
    assert x.errors[0, 0] == x.errors[1, 0]
    assert x.errors[-1, 0] == x.errors[-2, 0]
