"""Pictures of machines: what rides on what, and that arrows go where readings grow."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from cmm_uq.base.arm import Arm
from cmm_uq.base.points import Floats, Machine
from cmm_uq.base.rotary import RotaryAxis, RotaryMachine
from cmm_uq.certificate.plots import machine as pictures
from cmm_uq.certificate.plots.machine import machine_plot, machine_section, poses_plot

TRAVEL = np.array([[0.0, 700.0], [0.0, 1000.0], [-600.0, 0.0]])
RIGHT = np.pi / 2
ARM = Arm(
    "arm", rows=np.array([[0, -RIGHT, 400, 0, 0], [500, 0, 0, -RIGHT, 0], [0, 0, 0, 0, 0]]), sense=np.array([1.0, -1.0, 1.0]),
    revolute=np.array([True, True, False]), limits=np.array([[-90.0, 90.0], [-40.0, 60.0], [np.nan, np.nan]]),
    tool_mm=np.array([0.0, 0.0, 100.0]),
)  # fmt: skip


def rides(machine: Machine) -> list[list[str]]:
    """Columns of boxes from the ground up, as the words beside the picture have them."""
    words = str(machine_plot(machine).alternative).split("; ")
    starts = [i for i, word in enumerate(words) if word in ("Frame", "Base")]
    return [words[a:b] for a, b in zip(starts, [*starts[1:], len(words)], strict=True)]


CHAINS = {
    "XYZ": (Machine("m", "XYZ", TRAVEL), ["Frame", "Workpiece"],
            ["Frame", "Carriage X: 0 to 700 mm", "Carriage Y: 0 to 1000 mm", "Carriage Z: −600 to 0 mm", "Probe"]),
    "YXZ": (Machine("m", "YXZ"), ["Frame", "Workpiece"],
            ["Frame", *(f"Carriage {axis}: travel not stated" for axis in "YXZ"), "Probe"]),
    "YXFZ|C": (RotaryMachine("m", "YXFZ", TRAVEL, rotary=(RotaryAxis("c", travel_deg=np.array([0.0, 360.0])),)),
               ["Frame", "Carriage X: 0 to 700 mm", "Carriage Y: 0 to 1000 mm", "Table C: 0 to 360 °", "Workpiece"],
               ["Frame", "Carriage Z: −600 to 0 mm", "Probe"]),
}  # fmt: skip


@pytest.mark.parametrize("chain", CHAINS)
def test_what_rides_on_what_stands_beside_the_picture(chain: str) -> None:
    """Carriages from the workpiece to the probe; those before the frame carry the workpiece, the first next to it."""
    machine, *columns = CHAINS[chain]
    assert rides(machine) == columns


def test_joints_of_an_arm_are_listed_from_base_to_tool() -> None:
    (column,) = rides(ARM)
    joints = ["Q1 turns: −90 to 90 °", "Q2 turns: −40 to 60 °, reversed", "Q3 shifts: travel not stated"]
    assert column == ["Base", *joints, "Tool"]


def turns_drawn(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> dict[str, tuple[Floats, Floats, Floats]]:
    """By name the arc as drawn (n, 2), its middle and its axis."""
    found, draw = dict[str, tuple[Floats, Floats, Floats]](), pictures._turn

    def turn(ax: Any, middle: Floats, axis: Floats, radius: float, name: Any, *, back: bool) -> None:
        before = len(ax.lines)
        draw(ax, middle, axis, radius, name, back=back)
        found[str(name)] = np.array(ax.lines[before + 1].get_xydata()), middle, axis

    monkeypatch.setattr(pictures, "_turn", turn)
    machine_plot(machine)
    return found


@pytest.mark.parametrize(("letter", "clockwise"), [("c", False), ("c", True), ("a", False), ("b", True)])
def test_the_arrow_of_a_table_goes_as_its_reading_grows(
    letter: str, clockwise: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By where the machine has a point of the table as it turns."""
    at = np.array([350.0, 400.0, -500.0])
    table = RotaryMachine("m", "XYZ", TRAVEL, rotary=(RotaryAxis(letter, at, clockwise=clockwise),))
    arc, _, axis = turns_drawn(table, monkeypatch)[letter.upper()]
    start = at + 1.3 * 0.16 * 1000.0 * np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    angles = np.degrees(pictures._ARC)
    turned = table.place(np.tile(start, (len(angles), 1)), {f"{letter}_deg": angles})
    assert_allclose(arc, turned @ pictures._VIEW.T, atol=1e-6)


def test_the_arrow_of_a_joint_goes_as_its_reading_grows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the reversed second joint: by the turn that the tool makes as its reading grows."""
    arc, middle, axis = turns_drawn(ARM, monkeypatch)["Q2"]
    q = np.array([[0.0, 10.0, 0.0]])
    tool, moved = ARM.at(q).tool[0] - middle, (ARM.at(q + np.array([0.0, 1e-4, 0.0])).tool - ARM.at(q).tool)[0]
    sense = np.sign(np.cross(axis, tool) @ moved)
    assert sense == -1
    start = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    assert (arc[1] - arc[0]) @ (pictures._VIEW @ np.cross(axis, start)) * sense > 0


def test_only_machines_of_more_than_three_straight_axes_have_a_section() -> None:
    assert machine_section(Machine("m", "XYZ", TRAVEL)) is None
    for machine in (ARM, RotaryMachine("m", "XYZ")):
        section = machine_section(machine)
        assert section is not None
        assert str(section.title) == "The machine"


def test_a_picture_is_the_same_each_time_and_names_every_axis() -> None:
    svg = machine_plot(ARM).svg
    assert svg == machine_plot(ARM).svg
    assert {"Q1", "Q2", "Q3", "x", "y", "z"} <= set(re.findall(r">([^<>]+)</text>", svg))


def test_planned_poses_show_the_tracker_and_say_how_many_they_are() -> None:
    path = ARM.at(np.array([[0.0, 0.0, 0.0], [30.0, 20.0, 50.0], [-60.0, 50.0, 10.0]])).path
    plot = poses_plot(path, [np.array([[100.0, 0, 0], [300.0, 200, 100]])], np.array([2000.0, 0.0, 500.0]), 0.0)
    assert "All 3 poses" in str(plot.caption)
    assert {"Tracker", "From above"} <= set(re.findall(r">([^<>]+)</text>", plot.svg))
