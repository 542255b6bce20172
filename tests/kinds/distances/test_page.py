"""The adjustment that a machine needs, as the certificate of a ballbar and of a Bryan gauge prints it."""

from __future__ import annotations

from cmm_uq.documents.document import Paragraph
from tests.kinds.reading import number
from tests.kinds.simulated import SQUARE, blocks, recovered, table

WHAT = "What to turn and what to enter"
SECOND_WAY = "The six factors by the distance equations, a second way"


def test_the_real_machine_is_told_what_to_turn() -> None:
    """Squareness XY −174″: the angle X–Y is 174″ short of 90°, so Y turns by +174″ about +Z, 465 µm over 550 mm."""
    rows = {row[0]: row for row in table("iota-1102-20C", WHAT).rows}
    guide = rows["Guide of Y: turn about +Z by"]
    assert guide[1:4] == ("174", "16", "″")
    assert guide[4] == "465"
    assert guide[5] == "yes"
    assert rows["Scale of Z: lengthen what it reads by"][5] == ""


def test_distance_equations_and_model_agree_on_the_real_recording() -> None:
    for name, by_equations, U, by_model, _ in table("iota-1102-20C", SECOND_WAY).rows:
        assert abs(number(by_equations) - number(by_model)) <= 0.1 * number(U), name


def test_an_uncalibrated_bar_gives_no_scale_to_enter() -> None:
    rows = table("bryan-simulated", WHAT).rows
    assert [row[0] for row in rows] == [
        "Guide of Y: turn about +Z by", "Guide of Z: turn about +X by", "Guide of Z: turn about +Y by",
    ]  # fmt: skip
    assert [row[3] for row in table("bryan-simulated", SECOND_WAY).rows[:3]] == ["not determined"] * 3
    notes = [block.text for block in blocks("iota-1102-20C-compensated") if isinstance(block, Paragraph)]
    assert any("The length of the bar is not certified" in note for note in notes)


def test_the_joint_fit_finds_what_two_steps_lose() -> None:
    """Swept over half a sphere: Z–X was simulated as 4″, and the patent's second step is left with a quarter of it."""
    recovered("bryan-simulated", SQUARE)
    rows = {row[0]: row for row in table("bryan-simulated", SECOND_WAY).rows}
    _, two_steps, U, joint, _ = rows["Angle Z–X − 90°"]
    assert abs(number(joint) - 4.0) < abs(number(two_steps) - 4.0) - number(U)
    _, two_steps, U, joint, _ = rows["Angle Y–Z − 90°"]
    assert abs(number(joint) + 7.5) < abs(number(two_steps) + 7.5) - number(U)
