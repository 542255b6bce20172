"""Values of a report: what follows from features exactly, what is left out, what is refused; U of widths alone.

Features are displaced by hand, and what follows of them is worked out beside them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cmm_uq.analysis.parts.characteristics import never_negative
from cmm_uq.analysis.parts.evaluation import characteristics_of
from cmm_uq.analysis.parts.reported import Measured, measured_of
from cmm_uq.analysis.parts.result import stated
from cmm_uq.analysis.parts.setup import plan_of
from cmm_uq.app.commands.parts.part import decide_limits
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.part.job import TABLES
from cmm_uq.maths.uncertainty.propagation import Source, simulate
from tests.jobs.part.parts import plate

HEAD = "characteristic,value_mm,value_deg,feature,x_mm,y_mm,z_mm,i,j,k,diameter_mm\n"


def of_report(*rows: str, **changes: Any) -> Measured:
    return measured_of(
        plate({"report.csv": (HEAD + "\n".join(rows)).encode()}, recording={"values": "report.csv"}, **changes)
    )


def row(name: str, *numbers: float | str) -> str:
    return ",".join(["", "", "", name, *map(str, numbers)])


def value(name: str, length: float | str = "", angle: float | str = "") -> str:
    return f"{name},{length},{angle},,,,,,,,"


def found(one: Measured) -> dict[str, float]:
    assert one.values is not None
    return dict(zip([each.name for each in one.job.facts.characteristic], one.values.tolist(), strict=True))


def test_what_follows_from_a_feature_is_what_geometry_says() -> None:
    """The bore leans by 2 and 1 in 10 000 and is 30.012 mm wide; the report names its axis 8 mm below its middle.

    At its middle it is off by 0.0142 and −0.0092 mm, at the ends of what is probed (6 mm from there) by as much again as it
    leans; of B nothing is said but by the frame, in which it is nominal.
    """
    lean = np.array([2e-4, 1e-4, 1.0])
    x, y = 60.0142 - 8 * lean[0], 39.9908 - 8 * lean[1]
    one = of_report(row("bore", x, y, -18, *lean, 30.012), row("B", 10, 0, -3, 0, 1, 0, ""))
    off = np.array([0.0142, -0.0092])
    ends = [np.hypot(*(off + end * lean[:2])) for end in (-6, 6)]
    assert found(one) == {
        "1": pytest.approx(30.012, abs=1e-9), "2": pytest.approx(2 * max(ends), abs=1e-8),
        "3": pytest.approx(12 * np.hypot(2e-4, 1e-4), abs=1e-8), "5": pytest.approx(39.9908, abs=1e-8)}  # fmt: skip
    assert one.job.reported is not None
    assert one.job.reported.derived == ("1", "2", "3", "5")
    assert list(one.job.facts.part.not_measured) == ["4"]
    assert "Not in the report, and so not measured: 4." in map(str.__str__, one.warnings)


def test_a_value_that_is_stated_goes_before_one_that_follows_and_the_rest_is_left_out() -> None:
    one = of_report(value("2", 0.031), row("bore", 60.01, 40, -10, 0, 0, 1, ""))
    assert found(one) == {"2": 0.031, "3": pytest.approx(0, abs=1e-12)}
    assert list(one.job.facts.part.not_measured) == ["1", "4", "5"]  # no diameter, no points, B is not there
    assert one.job.reported is not None
    rounding = one.job.reported.rounding
    assert rounding["2"] == pytest.approx(0.001 / 12**0.5)
    assert rounding["3"] == pytest.approx(2 * 0.001 / 12**0.5)  # 60.01 and 40 are 60.010 and 40.000 in this report


def test_an_axis_without_direction_says_no_place_and_a_frame_of_other_datums_none_either() -> None:
    assert list(found(of_report(row("bore", 60.01, 40, -10, "", "", "", 30.01)))) == ["1"]
    asked = [{**one, "datums": ["A", "C", "B"]} if one["name"] == "2" else one for one in TABLES["characteristic"]]
    other = of_report(row("bore", 60.01, 40, -10, 0, 0, 1, 30.01), characteristic=asked)
    assert list(found(other)) == ["1", "3"]


def test_angles_follow_from_directions() -> None:
    asked = [{"name": "6", "what": "angle", "features": ["A", "B"]}]
    lean = 1e-3
    one = of_report(
        row("A", 0, 0, 0, 0, 0, 1, ""), row("B", 0, 0, 0, 0, -np.cos(lean), np.sin(lean), ""), characteristic=asked
    )
    assert found(one)["6"] == pytest.approx(np.pi / 2 - lean, abs=1e-9)


@pytest.mark.parametrize(("rows", "words"), [
    ([value("1", 1.18157)], "line 2: 1.18157 mm is not '1', which is 30 mm by its nominals: as if it were in inches"),
    ([value("1", 0.011)], "Give the actual value, not a deviation"),
    ([value("2", -0.01)], "is no width of a zone"),
    ([value("5", 80)], "80 mm is not '5', which is 40 mm"),
    ([row("bore", 0, 0, 0, 0, 0, 1, 30)], "'bore' lies 72.11 mm from where it is planned"),
    ([row("bore", 60, 40, -10, 0, 0, 1, 15)], "'bore' has a diameter of 15 mm, and by its nominal of 30 mm"),
    ([row("A", 60, 40, 0, 0, 0, 1, "")], "asks for nothing that the report says"),
])  # fmt: skip
def test_what_cannot_be_of_this_part_is_refused(rows: list[str], words: str) -> None:
    with pytest.raises(CmmUqError, match=words):
        of_report(*rows)


def test_a_zone_is_refused_where_a_form_is_true() -> None:
    with pytest.raises(CmmUqError, match="'2' is a zone of which the report says no more than its width"):
        of_report(value("4", 0.004), form={"field_um": 1.0, "surface_points": 50})


def test_errors_change_no_zone_by_more_than_that_of_a_perfect_part() -> None:
    """|f(p + e) − f(p)| ≤ f(e): of parts and errors of any direction, to the second order of a few µm."""
    asked: list[dict[str, Any]] = [*(one for one in TABLES["characteristic"] if "tolerance_mm" in one), *(
        {"name": what, "what": what, "features": [of], "datums": datums} for what, of, datums in (
            ("perpendicularity", "B", ["A"]), ("cylindricity", "bore", []), ("total_runout", "A", ["bore"])))]  # fmt: skip
    plan = plan_of(plate(characteristic=asked))
    assert never_negative(plan).all()
    random = np.random.default_rng(2)
    for size in (1e-3, 5e-3, 2e-2):
        part, error = (each * random.standard_normal(plan.points.shape) for each in (size, 1e-3))
        true, measured, perfect = (characteristics_of(plan, plan.points + each) for each in (part, part + error, error))
        assert np.all(np.abs(measured - true) <= perfect + 1e-6)


def test_of_a_width_alone_u_is_the_quantile_of_what_a_perfect_part_would_show() -> None:
    """Lengths of errors of a normal pair: 95 % are within √(−2 ln 0.05), and the value stays as it was stated."""
    plan, random = plan_of(plate(characteristic=[TABLES["characteristic"][1]])), np.random.default_rng(3)
    pairs = random.standard_normal((200_000, 2))
    signed = 1e-3 * np.linalg.norm(pairs, axis=1, keepdims=True) * random.choice((-1.0, 1.0), (len(pairs), 1))
    simulated = simulate(Source(["2"], lambda _, n: signed[:n].T.copy()), len(signed), 0.95, 0)
    for at in (0.02, 0.001):
        (one,) = stated(simulated, np.array([at]), plan, signed, widths_alone=True)
        reach = 1e-3 * np.sqrt(-2 * np.log(0.05))
        assert (one.value, one.error) == (at, 0.0)
        assert pytest.approx(reach, rel=5e-3) == one.U
        assert one.u == pytest.approx(1e-3 * np.sqrt(2), rel=5e-3)
        assert one.interval == pytest.approx((max(0.0, at - reach), at + reach), rel=5e-3)


def test_a_width_is_decided_on_by_all_of_what_a_perfect_part_would_show_to_either_side() -> None:
    """Of a tolerance of 0.1 mm: beyond it with the probability of lengths of a normal pair, not half of it."""
    one = of_report(value("2", 0.097), characteristic=[TABLES["characteristic"][1]])
    plan, random = plan_of(one.job), np.random.default_rng(4)
    lengths = 1e-3 * np.linalg.norm(random.standard_normal((400_000, 2)), axis=1, keepdims=True)
    for width in (0.097, 0.103):
        (decided,) = decide_limits(
            one.job, plan, lengths * random.choice((-1.0, 1.0), lengths.shape), np.array([width])
        )
        assert decided is not None
        wrong = decided.beyond if width < 0.1 else decided.probability
        assert wrong == pytest.approx(np.exp(-0.5 * 9), rel=0.05)
