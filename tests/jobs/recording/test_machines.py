"""A chain with a rotary table: one key and one column, and an exact rigid turn behind them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import cmm_uq
from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Machine
from cmm_uq.base.rotary import RotaryMachine
from cmm_uq.machine.physics.effects.probing import machine_normals

AXIS = np.array([450.0, 600.0, 0.0])
BALLS = np.array([[x, y, -300.0] for y in (-200.0, 0.0, 200.0) for x in (-200.0, -50.0, 80.0, 200.0)])
TRUE = {"scale_x": 9e-6, "scale_y": -6e-6}
TOML = """
[job]
id = "on-a-table"
date = 2026-01-01
origin = "simulated"
[machine]
name = "m"
chain = "XYZ|C"
travel_mm = {{ x = [0, 900], y = [0, 1200], z = [-600, 0] }}
{table}
[artefact]
kind = "plate"
u_um = 0.1
[recording]
file = "recording.csv"
[model]
effects = ["scale_x", "scale_y", "squareness_xy"]
"""


def written(folder: Path, angles: Floats, table: str, recorded: Callable[[Floats, Floats, Floats], Floats]) -> Path:
    """A plate that stays where it is on a turning table, on a machine that errs along its own axes.

    ``recorded``: of where the carriages stood (n, 3), the middle of the plate (n, 3) and the turns (n, 3, 3).
    """
    random, lines = np.random.default_rng(5), []
    for repeat, degrees in enumerate(angles, 1):
        turn = Rotation.from_euler("z", degrees, degrees=True).as_matrix()
        true = AXIS + (BALLS + np.array([40.0, -25.0, 0.0])) @ turn.T
        scales = np.array([TRUE["scale_x"], TRUE["scale_y"], 0.0])
        read = true / (1 + scales) + random.normal(0, 2e-4, true.shape)  # true = indicated + scale · indicated
        xyz = recorded(read, AXIS, turn)
        lines += [
            f"1,{i + 1},{repeat},{','.join(f'{v:.7f}' for v in p)},{','.join(f'{v:g}' for v in b)},{degrees:g}"
            for i, (p, b) in enumerate(zip(xyz, BALLS, strict=True))
        ]
    head = "measurement,point,repeat,x_mm,y_mm,z_mm,reference_x_mm,reference_y_mm,reference_z_mm,c_deg"
    (folder / "recording.csv").write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
    (folder / "job.toml").write_text(TOML.format(table=table), encoding="utf-8")
    return folder


def on_table(read: Floats, axis: Floats, turn: Floats) -> Floats:
    """Turned back by the controller, zero on the axis."""
    return np.asarray((read - axis) @ turn)


def in_machine(read: Floats, axis: Floats, turn: Floats) -> Floats:
    return read


ON_TABLE = "origin_mm = [450, 600, 0]"
IN_MACHINE = 'table = { coordinates = "machine", axis_mm = [450, 600, 0] }'
ANGLES = np.array([0.0, 40.0, 90.0, 200.0, 310.0])


@pytest.mark.usefixtures("no_regions", "no_diagnosis")
@pytest.mark.long(but="axis_mm")
@pytest.mark.parametrize(("table", "recorded"), [(ON_TABLE, on_table), (IN_MACHINE, in_machine)])
def test_errors_of_carriages_are_found_through_a_plate_that_turns_with_the_table(
    tmp_path: Path, table: str, recorded: Callable[[Floats, Floats, Floats], Floats]
) -> None:
    """A plate turned under one scale error shows it along another of its axes; the squareness that is not there is none."""
    found = cmm_uq.report(written(tmp_path, ANGLES, table, recorded), seed=1).estimates
    for name, true in TRUE.items():
        row = found.loc[f"{name}.ppm"]
        assert abs(row["value"] - 1e6 * true) < 3 * row["u"]
        assert row["u"] < 2.0
    row = found.loc["squareness_xy.angle_arcsec"]
    assert abs(row["value"]) < 3 * row["u"] < 1.5


def test_a_machine_without_a_bar_in_its_chain_is_the_cartesian_one(tmp_path: Path) -> None:
    job = written(tmp_path, ANGLES, ON_TABLE, on_table)
    text = (job / "job.toml").read_text(encoding="utf-8").replace("XYZ|C", "XYZ")
    (job / "job.toml").write_text(text, encoding="utf-8")
    assert type(read_job(job).points.machine) is Machine


def test_chain_and_table_are_read(tmp_path: Path) -> None:
    table = "table = { turns = 'clockwise', travel_deg = [-5, 365], axis_mm = [1, 2, 3] }"
    machine = read_job(written(tmp_path, ANGLES, table, on_table)).points.machine
    assert isinstance(machine, RotaryMachine)
    assert machine.fourth
    assert (machine.chain, machine.fourth.clockwise, machine.axes) == ("XYZ", True, ("x", "y", "z", "c"))
    assert machine.travel("c") == (-5.0, 365.0)
    np.testing.assert_array_equal(machine.pivot(machine.fourth), [1.0, 2.0, 3.0])


@pytest.mark.parametrize(
    ("chain", "table", "message"),
    [
        ("XYZ|ABC", "", r"give one or two rotary tables behind the bar, A, B or C .* such as XYZ\|C or XYZ\|AC"),
        ("XYZ|", "", "give one or two rotary tables behind the bar"),
        ("XYZ-|C", "", "give one or two rotary axes of a head behind the hyphen"),
        ("XYZ|CC", "", "name each rotary axis once, A, B or C"),
        ("XYZ-C|C", "", "name each rotary axis once, A, B or C"),
        ("XYZ|AD", "", "name each rotary axis once, A, B or C"),
        ("XYZ-B|C", "", "a head turns the stylus"),
        (
            "XYZ|C",
            "head = { stylus_mm = [0, 0, -1] }",
            r"\[machine.head\] is of a head, which chain = 'XYZ\|C' has not",
        ),
        ("XYZ|AC", "table = { axis_mm = [0, 0, 0] }", r"\[machine.table\] axis_mm does not say of which table"),
        ("XYZ|C", "rotary = [{ name = 'A' }]", r"\[\[machine.rotary\]\] A is twice there, or not in chain"),
        (
            "XYZ|C",
            "rotary = [{ name = 'C' }]\ntable = { turns = 'clockwise' }",
            r"table C is in \[machine.table\] and in \[\[machine.rotary\]\]: leave turns",
        ),
        (
            "XYZ|AC",
            "rotary = [{ name = 'C', axis_mm = [0, 0, 0] }]\ntable = { coordinates = 'machine' }",
            r"give a point of it, axis_mm",
        ),
        (
            "XYZ|AC",
            "rotary = [{ name = 'C', travel_deg = [0, 300] }]",
            r"line 50: c_deg = 310 lies outside the travel of the table, 0 to 300 °. Mend it, or travel_deg in \[\[",
        ),
        ("XYX|C", "", "give X, Y, Z once each"),
        (
            "XYZ",
            "table = { axis_mm = [0, 0, 0] }",
            r"\[machine.table\] is of a rotary table, which chain = 'XYZ' has not",
        ),
        ("XYZ|C", "table = { coordinates = 'machine' }", r"give a point of it, axis_mm = \[x, y, z\]"),
        ("XYZ|C", "table = { travel_deg = [360, 0] }", "the first number must be the lower one"),
        (
            "XYZ|C",
            "table = { travel_deg = [0, 300] }",
            "line 50: c_deg = 310 lies outside the travel of the table, 0 to 300",
        ),
    ],
)
def test_what_does_not_go_together_is_said(tmp_path: Path, chain: str, table: str, message: str) -> None:
    job = written(tmp_path, ANGLES, table, on_table)
    text = (job / "job.toml").read_text(encoding="utf-8").replace("XYZ|C", chain)
    (job / "job.toml").write_text(text, encoding="utf-8")
    with pytest.raises(CmmUqError, match=message):
        read_job(job)


def with_columns(job: Path, head: str, *values: str) -> None:
    text = (job / "recording.csv").read_text(encoding="utf-8").strip()
    lines = [f"{line},{value}" for line, value in zip(text.split("\n")[1:], values, strict=True)]
    (job / "recording.csv").write_text("\n".join([f"{text.split(chr(10))[0]},{head}", *lines]) + "\n", encoding="utf-8")


@pytest.mark.parametrize("frame", [None, "table", "machine"])
def test_normals_on_a_turned_table_are_in_the_frame_that_the_job_says(tmp_path: Path, frame: str | None) -> None:
    job = written(tmp_path, ANGLES, f"{ON_TABLE}\n" + (f"table = {{ normals = '{frame}' }}" if frame else ""), on_table)
    normals = np.random.default_rng(1).normal(size=(60, 3))
    with_columns(job, "nx,ny,nz", *(",".join(map(str, normal)) for normal in normals))
    if frame is None:
        with pytest.raises(CmmUqError, match=r'normals of probed points.*normals = "table" or "machine"'):
            read_job(job)
        return
    points = read_job(job).points
    turns = Rotation.from_euler("z", np.repeat(ANGLES, 12)[:, None], degrees=True)
    along_machine = turns.apply(normals) if frame == "table" else normals
    np.testing.assert_allclose(machine_normals(points), along_machine, atol=1e-12)
    # and written anew they are those of the recording
    columns = points.machine.columns_as_recorded(points.columns)
    np.testing.assert_allclose(np.column_stack([columns[f"n{a}"] for a in "xyz"]), normals, atol=1e-12)


def test_sensors_are_added_along_the_axes_of_the_machine(tmp_path: Path) -> None:
    job = written(tmp_path, ANGLES, ON_TABLE, on_table)
    before = read_job(job).points.xyz
    with_columns(job, "sensor_x_um,sensor_y_um,sensor_z_um", *["3,-4,5"] * 60)
    moved = read_job(job).points.xyz - before
    turns = Rotation.from_euler("z", np.repeat(ANGLES, 12)[:, None], degrees=True)
    np.testing.assert_allclose(turns.apply(moved), np.tile([0.003, -0.004, 0.005], (60, 1)), atol=1e-12)


def test_a_head_carries_the_stylus_as_its_axes_turn(tmp_path: Path) -> None:
    """Carriages at rest over a turning head: the tip goes round, and the columns of its offset say so."""
    table = "head = { stylus_mm = [100, 0, -50], coordinates = 'carriages' }\nrotary = [{ name = 'C', turns = 'clockwise' }]"
    job = written(tmp_path, ANGLES, table, lambda read, axis, turn: BALLS)
    (job / "job.toml").write_text((job / "job.toml").read_text().replace("XYZ|C", "XYZ-C"), encoding="utf-8")
    points = read_job(job).points
    tips = Rotation.from_euler("z", -np.repeat(ANGLES, 12)[:, None], degrees=True).apply([100, 0, -50])
    np.testing.assert_allclose(points.xyz, np.tile(BALLS, (5, 1)) + tips - [100, 0, -50], atol=1e-6)
    np.testing.assert_allclose(np.column_stack([points.columns[f"tip_{a}_mm"] for a in "xyz"]), tips, atol=1e-9)
    np.testing.assert_allclose(points.carriages, np.tile(BALLS, (5, 1)), atol=1e-6)
