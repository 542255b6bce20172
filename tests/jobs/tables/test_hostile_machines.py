"""Mistaken and hostile ``[machine]`` tables: each is refused in one line that names the key, or the column, and what to do."""

from __future__ import annotations

import pytest

from cmm_uq.app.commands.reading import job_of
from cmm_uq.base.errors import CmmUqError

ROWS = "\n".join(("[[machine.joint]]\na_mm = 300", "[[machine.joint]]\na_mm = 200"))
AT_HOME = "\n".join(
    f"[[machine.joint]]\ndirection = [0, 0, 1]\npoint_mm = [{x}, 0, 0]" for x in (0, 300)
)  # fmt: skip
HOME = "arm = { home = [[1, 0, 0, 500], [0, 1, 0, 0], [0, 0, 1, 0]] }\n"
XYZ, Q = "x_mm,y_mm,z_mm", "q1_deg,q2_deg"


def row(*keys: str) -> str:
    return "\n".join(["[[machine.joint]]", *keys, "[[machine.joint]]\na_mm = 200"])


# by what is wrong: keys below [machine], the recording's columns, what the line says of where it is, and of what to do
CASES: dict[str, tuple[str, str, str, str]] = {
    "an axis twice": ('chain = "XXZ"', XYZ, "chain = 'XXZ'", "X, Y, Z once each"),
    "four carriages": ('chain = "XYZX"', XYZ, "chain = 'XYZX'", "X, Y, Z once each"),
    "a bar without a table": ('chain = "XYZ|"', XYZ, "chain = 'XYZ|'", "A, B or C"),
    "a table of no letter": ('chain = "XYZ|D"', XYZ, "chain = 'XYZ|D'", "A, B or C"),
    "a carriage behind the bar": ('chain = "XYZ|XC"', XYZ, "chain = 'XYZ|XC'", "A, B or C"),
    "a chain that is a list": ('chain = ["X", "Y", "Z"]', XYZ, "chain", "Put it in quotes"),
    "a table that the chain has not": ('table = { turns = "clockwise" }', XYZ, "[machine.table]", "XYZ|C"),
    "a table that turns left": ('chain = "XYZ|C"\ntable = { turns = "left" }', XYZ, "table.turns", "'clockwise'"),
    "a table's travel downwards": ('chain = "XYZ|C"\ntable = { travel_deg = [360, 0] }', XYZ, "table.travel_deg", "lower one"),
    "a table's reading in radians": ('chain = "XYZ|C"', f"{XYZ},c_rad", "'c_rad'", "Give it in degrees as c_deg"),
    "a table's reading without its unit": ('chain = "XYZ|C"', f"{XYZ},c", "'c'", "Give it in degrees as c_deg"),
    "a travel downwards": ("travel_mm = { x = [500, 0] }", XYZ, "travel_mm.x", "lower one"),
    "a travel in metres": ("travel_mm = { x = [0, 0.0005] }", XYZ, "travel_mm", "less than"),
    "rows beside carriages": (f'chain = "XYZ"\n{ROWS}', Q, "chain is of a machine of carriages", "leave one of them out"),
    "one row as a table": ("[machine.joint]\na_mm = 3", "q1_deg", "joint", "[[machine.joint]]"),
    "an arm without rows": ("arm = { tool_mm = [0, 0, 1] }", XYZ, "[machine.arm]", "[[machine.joint]]"),
    "a joint of another kind": (row('type = "linear"', "a_mm = 3"), Q, "joint.0.type", "'prismatic'"),
    "a length in metres": (row("a_m = 0.3"), Q, "joint.0.a_m", "a_mm = 1000"),
    "a twist without its unit": (row("alpha = 90"), Q, "joint.0.alpha", "alpha_deg"),
    "a twist in a key of radians": (row("alpha_rad = 1.57"), Q, "joint.0.alpha_rad", "alpha_deg"),
    "a twist in radians": (row("a_mm = 300", "alpha_deg = -1.5708"), Q, "alpha_deg = -1.5708", "give degrees"),
    "an angle in radians": (row("a_mm = 300", "theta_deg = 3.14159"), Q, "theta_deg = 3.14159", "give degrees"),
    "a joint's travel in radians": (row("a_mm = 300", "travel = [-3.1416, 3.1416]"), Q, "travel = [-3.14",
                                    "degrees"),
    "a joint's travel downwards": (row("a_mm = 300", "travel = [90, -90]"), Q, "joint.0.travel", "lower one"),
    "rows without a length": ("[[machine.joint]]\n[[machine.joint]]\nalpha_deg = 90", Q, "has a length", "a_mm and d_mm"),
    "thirteen joints": ("[[machine.joint]]\na_mm = 1\n" * 13, Q, "joint", "at most 12"),
    "another convention": (f'arm = {{ convention = "craig" }}\n{ROWS}', Q, "arm.convention", "'modified'"),
    "a tool of two numbers": (f"arm = {{ tool_mm = [0, 1] }}\n{ROWS}", Q, "arm.tool_mm", "at least 3"),
    "no up": (f"arm = {{ up = [0, 0, 0] }}\n{ROWS}", Q, "up = [0, 0, 0]", "no direction"),
    "a joint that is not recorded": (ROWS, "q1_deg", "no column 'q2_deg'", "Known"),
    "a joint recorded in radians": (ROWS, "q1_deg,q2_rad", "'q2_rad'", "Give it in degrees as q2_deg"),
    "a joint that turns, recorded in mm": (ROWS, "q1_deg,q2_mm", "'q2_mm'", "Give it in degrees as q2_deg"),
    "a joint that shifts, recorded in degrees": (row('type = "prismatic"'), Q, "'q1_deg'", "Give it in mm as q1_mm"),
    "a joint more than rows": (ROWS, f"{Q},q3_deg", "'q3_deg' is of joint 3, and the arm has 2", "[[machine.joint]]"),
    "a joint recorded twice": (ROWS, f"{Q},q2_deg", "'q2_deg' is there twice", "Keep one"),
    "a row and a screw axis": (f"{HOME}{AT_HOME}\n[[machine.joint]]\na_mm = 1", Q, "joint 1 is a screw axis", "in one way"),
    "a row within a screw axis": (f"{HOME}{AT_HOME}\na_mm = 1", Q, "joint.1: a_mm is of a row", "direction with point_mm"),
    "a point without a direction": (row("point_mm = [0, 0, 0]"), Q, "joint.0: point_mm", "direction"),
    "no direction": (f"{HOME}{AT_HOME}".replace("[0, 0, 1]\npoint_mm = [300", "[0, 0, 0]\npoint_mm = [300"), Q,
                     "joint.1.direction", "no direction"),
    "a screw axis nowhere": (f"{HOME}{AT_HOME}".replace("\npoint_mm = [300, 0, 0]", ""), Q, "joint.1",
                             "give one of a revolute"),
    "a prismatic joint somewhere": (f'{HOME}{AT_HOME}\ntype = "prismatic"', Q, "joint.1", "else none"),
    "a thread": (f"{HOME}{AT_HOME}".replace("point_mm = [300, 0, 0]", "v_mm = [0, -300, 5]"), Q, "joint.1: v_mm", "point_mm"),
    "no home": (AT_HOME, Q, "[machine.arm] home", "missing"),
    "a home of rows": (f"{HOME}{ROWS}", Q, "[machine.arm] home", "leave it out"),
    "a home that is mirrored": (f"{HOME}{AT_HOME}".replace("[[1, 0", "[[-1, 0"), Q, "arm: home", "right-handed"),
    "a home of two rows": (f"{HOME}{AT_HOME}".replace(", [0, 0, 1, 0]]", "]"), Q, "arm.home", "at least 3"),
    "a convention of screw axes": (HOME.replace("home", 'convention = "modified", home') + AT_HOME, Q,
                                   "[machine.arm] convention", "leave it out"),
}  # fmt: skip


def read(keys: str, columns: str) -> None:
    head = '[job]\nid = "a"\ndate = 2026-01-01\n[machine]\nname = "M"\n'
    tail = (
        '\n[artefact]\nkind = "tracked_points"\nu_um = 5\n[recording]\nfile = "recording.csv"\n[model]\neffects = []\n'
    )
    count = columns.count(",") + 1
    header = f"measurement,point,{columns},reference_x_mm,reference_y_mm,reference_z_mm"
    rows = (
        f"1,{i}," + ",".join(str(3 * i + 7 * i * j) for j in range(count)) + f",{i},{i * i},{5 - i}"
        for i in range(1, 7)
    )
    recording = "\n".join([header, *rows]) + "\n"
    job_of({"job.toml": f"{head}{keys}{tail}".encode(), "recording.csv": recording.encode()})


@pytest.mark.parametrize("case", CASES)
def test_a_mistaken_machine_is_refused_in_one_line(case: str) -> None:
    keys, columns, where, fix = CASES[case]
    with pytest.raises(CmmUqError) as refused:
        read(keys, columns)
    line = str(refused.value)
    assert "\n" not in line
    assert where in line
    assert fix in line
    assert line.startswith(("job.toml line", "recording.csv line 1"))
    assert not refused.value.also, "one mistake is said once"


@pytest.mark.parametrize(("keys", "columns"), [
    ("", XYZ), ('chain = "YXFZ|A"', f"{XYZ},a_deg"), (ROWS, Q), (ROWS, "q2_deg,q1_deg"), (f"{HOME}{AT_HOME}", Q),
    (row("a_mm = 300", "alpha_deg = 1.57", "travel = [-3, 90]"), Q), ("", f"{XYZ},a_deg,b_deg,c_deg"),
    ('arm = { tool_mm = [0, 0, 500] }\n[[machine.joint]]\nalpha_deg = 90\n[[machine.joint]]', Q),
])  # fmt: skip
def test_what_is_no_mistake_is_read(keys: str, columns: str) -> None:
    read(keys, columns)
