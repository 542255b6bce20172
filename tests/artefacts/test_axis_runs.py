"""Runs along axes: readings worked out by hand come back as errors, lever arms and all; what is no run is refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cmm_uq.analysis.screening.screening import repeated_figures
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.axis_runs.artefact import AxisRuns
from cmm_uq.artefacts.axis_runs.run import roughness
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Points
from cmm_uq.maths.uncertainty.air.state import harris_2004
from tests.artefacts.constructions import MACHINE, estimated, model
from tests.recordings import TRAVEL

EXACT = artefact_facts(kind="axis_runs", u_scale_um_per_m=0.0)
TARGETS = np.linspace(0.0, 900.0, 10)
SECOND = np.pi / 180 / 3600
# of carriage x, so small that what they change over their own size, some 2e-6 of them, is nothing: ppm, µm, ″/m about x, y, z
PPM, BOW, ROLL, PITCH, YAW = 0.9, 0.05, 0.2, -0.3, 0.15
NAMES = ["scale_x", "straightness_x_y", "rotation_x_x", "rotation_x_y", "rotation_x_z"]


def run(
    number: int, read: Floats | None = None, turn: Floats | None = None, *, place: tuple[float, float] = (200.0, -300.0),
    tip: tuple[float, float, float] = (0.0, 0.0, 0.0), repeats: int = 2, axis: int = 0, at: Floats = TARGETS,
) -> dict[str, Floats]:  # fmt: skip
    """Rows of one run there and back, repeated; the readings are still to be filled in."""
    there = np.concatenate([at, at[::-1]])
    sense = np.repeat([1.0, -1.0], len(at))
    n = len(there) * repeats
    xyz = np.zeros((n, 3))
    xyz[:, [i for i in range(3) if i != axis]] = place
    xyz[:, axis] = np.tile(there, repeats)
    rows = {
        "xyz": xyz, "measurement": np.full(n, number), "point": np.tile(np.arange(1, len(there) + 1), repeats),
        "repeat": np.repeat(np.arange(1, repeats + 1), len(there)), "reading_um": np.zeros(n), "reading_arcsec": np.zeros(n),
    }  # fmt: skip
    for i, a in enumerate("xyz"):
        rows[f"approach_{a}"] = np.tile(sense, repeats) * (i == axis)
        rows[f"read_{a}"] = np.full(n, 0.0 if read is None else read[i])
        rows[f"turn_{a}"] = np.full(n, 0.0 if turn is None else turn[i])
        rows[f"tip_{a}_mm"] = np.full(n, tip[i])
    return rows


def joined(*runs: dict[str, Floats]) -> Points:
    whole = {name: np.concatenate([one[name] for one in runs]) for name in runs[0]}
    xyz, measurement, point, repeat = (whole.pop(name) for name in ("xyz", "measurement", "point", "repeat"))
    return Points(xyz, measurement, point, repeat, MACHINE, whole, np.arange(2, len(xyz) + 2))


X, Y, Z = np.eye(3)


def error_of_x(rows: dict[str, Floats]) -> tuple[Floats, Floats]:
    """Displacement (n, 3), µm, and rotation (n, 3), ″, that carriage x gives optics on the ram of the chain XYZ."""
    x, y, z = rows["xyz"].T
    tip = np.column_stack([rows[f"tip_{a}_mm"] for a in "xyz"])
    turn = np.outer((x - TRAVEL[0, 0]) / 1000, [ROLL, PITCH, YAW])
    lever = np.column_stack([np.zeros(len(x)), y, z]) + tip
    moved = 1000 * SECOND * np.cross(turn, lever)
    moved[:, 0] += PPM * x / 1000
    moved[:, 1] += BOW * (1 - (2 * (x - TRAVEL[0, 0]) / np.ptp(TRAVEL[0]) - 1) ** 2)
    return moved, turn


def read(rows: dict[str, Floats], zero: float = 0.0, slope: float = 0.0) -> dict[str, Floats]:
    moved, turn = error_of_x(rows)
    for name, axes, values in (("reading_um", "read", moved), ("reading_arcsec", "turn", turn)):
        direction = np.column_stack([rows[f"{axes}_{a}"] for a in "xyz"])
        on = np.any(direction != 0, axis=1)
        rows[name] = np.where(on, np.sum(direction * values, axis=1) + zero + slope * rows["xyz"][:, 0], 0.0)
    return rows


def six() -> list[dict[str, Floats]]:
    return [
        read(run(1, X, tip=(0.0, 30.0, -80.0)), 5.0), read(run(2, X, place=(500.0, -50.0)), -3.0),
        read(run(3, Y), 1.0, 0.02), read(run(4, turn=Y), 40.0), read(run(5, turn=Z, tip=(7.0, 0.0, 9.0)), -8.0),
        read(run(6, turn=X), 2.0),
    ]  # fmt: skip


def test_readings_by_hand_give_the_errors_of_the_carriage_whatever_the_zeros() -> None:
    found = estimated(EXACT, joined(*six()), NAMES)
    assert found.value[:5] == pytest.approx([PPM, BOW, ROLL, PITCH, YAW], rel=1e-5)
    assert np.abs(found.residuals).max() < 1e-9


def test_the_offset_of_the_optics_is_no_scale_error() -> None:
    """Taken as if they were on the ram's end, optics 80 mm below it make a scale of the pitch: −80 mm · ε_y."""
    rows = read(run(1, X, tip=(0.0, 0.0, -80.0), place=(0.0, 0.0)))
    known = estimated(EXACT, joined(rows, read(run(2, turn=Y)), read(run(3, turn=Z))), ["scale_x", *NAMES[3:]])
    assert known.value[0] == pytest.approx(PPM, rel=1e-5)
    bare = {**rows, "tip_z_mm": np.zeros(len(rows["xyz"]))}
    taken = estimated(EXACT, joined(bare, read(run(2, turn=Y)), read(run(3, turn=Z))), ["scale_x", *NAMES[3:]])
    assert taken.value[0] - PPM == pytest.approx(-80.0 * PITCH * SECOND / 1000 * 1e6, rel=1e-4)


def test_optics_may_be_stated_once_for_all_runs() -> None:
    rows = read(run(1, X, tip=(0.0, 30.0, -80.0)))
    stated = artefact_facts(kind="axis_runs", u_scale_um_per_m=0.0, optics_mm=[0.0, 30.0, -80.0])
    points = joined(rows)
    without = {name: values for name, values in points.columns.items() if not name.startswith("tip_")}
    by_column, by_key = AxisRuns(EXACT, points), AxisRuns(stated, replace(points, columns=without))
    for axis in "xyz":
        np.testing.assert_array_equal(
            by_column.points.columns[f"tip_{axis}_mm"], by_key.points.columns[f"tip_{axis}_mm"]
        )


def test_a_reading_is_true_less_indicated() -> None:
    """A machine that goes farther than it says has a positive deviation, as ISO 230-2 has it, and a positive scale error."""
    rows = run(1, X)
    rows["reading_um"] = 0.01 * rows["xyz"][:, 0]
    assert estimated(EXACT, joined(rows), ["scale_x"]).value[0] == pytest.approx(10.0, rel=1e-4)
    back = run(1, X)
    back["reading_um"] = np.where(back["approach_x"] > 0, 2.0, -2.0)
    assert estimated(EXACT, joined(back), ["hysteresis_x"]).value[0] == pytest.approx(4.0, rel=1e-9)


def test_a_rotation_is_by_the_right_hand() -> None:
    rows = run(1, turn=Z)
    rows["reading_arcsec"] = 0.002 * rows["xyz"][:, 0]
    assert estimated(EXACT, joined(rows), ["rotation_x_z"]).value[0] == pytest.approx(2.0, rel=1e-6)


def test_a_simulated_machine_stands_at_its_targets_and_the_instrument_reads_its_errors() -> None:
    points = joined(*(run(i, **how) for i, how in enumerate(({"read": X}, {"read": Y}, {"turn": Z}), 1)))
    truth = model(EXACT, points, NAMES)
    drawn = truth.predicted(np.array([PPM, BOW, ROLL, PITCH, YAW, *(s.nominal for s in truth.artefact.sizes)]))
    found = truth.artefact.recorded(points, drawn)
    np.testing.assert_array_equal(found.xyz, points.xyz)
    expected = [read(run(1, X)), read(run(2, Y)), read(run(3, turn=Z))]
    for name in ("reading_um", "reading_arcsec"):
        by_hand = np.concatenate([one[name] for one in expected])
        for number in (1, 2, 3):
            own = points.measurement == number
            free = np.column_stack([np.ones(own.sum()), points.xyz[own, 0]])[:, : 2 if number == 2 else 1]
            off = found.columns[name][own] - by_hand[own]
            assert np.abs(off - free @ np.linalg.lstsq(free, off, rcond=None)[0]).max() < 2e-6


def test_its_own_points_displaced_are_such_a_recording() -> None:
    points = joined(*six())
    first = AxisRuns(EXACT, points)
    again = AxisRuns(EXACT, first.points)
    assert first.about_zero(first.readings) == pytest.approx(again.about_zero(again.readings), abs=1e-12)
    moved = first.points.xyz + 1e-3 * np.random.default_rng(0).normal(size=first.points.xyz.shape)
    shifted = AxisRuns(EXACT, first.points.at(moved))
    change = first.project(first.points.xyz, (moved - first.points.xyz)[:, :, None])[:, 0]
    left = first.about_zero(shifted.readings - first.readings + change)
    assert np.abs(left).max() < 1e-8  # the travel turns by a micrometre over its length, and an arm with it


def test_some_of_its_readings_are_such_a_recording() -> None:
    whole = AxisRuns(EXACT, joined(*six()))
    ends = np.flatnonzero(whole.points.columns["_arm_end"] > 0)
    kept = whole.points.repeat[whole.rows[:, 0]] == 1
    some = AxisRuns(EXACT, whole.points.select(np.sort(np.concatenate([whole.rows[kept, 0], ends]))))
    assert some.about_zero(some.readings) == pytest.approx(some.about_zero(whole.readings[kept]), abs=1e-12)


def test_only_across_the_travel_a_slope_is_free() -> None:
    tilt = [
        estimated(EXACT, joined(read(run(1, Y), slope=slope)), ["straightness_x_y"]).value[0] for slope in (0.0, 0.5)
    ]
    assert tilt[0] == pytest.approx(tilt[1], rel=1e-3)
    assert AxisRuns(EXACT, joined(run(1, Y))).placing(np.zeros((0, 3))).shape[1] == 2
    assert AxisRuns(EXACT, joined(run(1, X))).placing(np.zeros((0, 3))).shape[1] == 1
    each = artefact_facts(kind="axis_runs", u_scale_um_per_m=0.0, zero_each_repeat=True)
    assert AxisRuns(each, joined(run(1, X, repeats=3))).placing(np.zeros((0, 3))).shape[1] == 3


def test_an_instrument_without_a_certificate_leaves_the_scale_free() -> None:
    points = joined(read(run(1, X)))
    found = estimated(artefact_facts(kind="axis_runs"), points, ["scale_x"])
    assert not found.determined[0]
    known = estimated(artefact_facts(kind="axis_runs", u_scale_um_per_m=0.7), points, ["scale_x"], sigma=1e-9)
    assert np.sqrt(known.covariance[0, 0]) == pytest.approx(0.7, rel=1e-3)


def test_a_scale_that_expands_and_air_that_was_not_corrected_for() -> None:
    n, air = 40, {"temp_air_c": 23.0, "pressure_hpa": 990.0, "humidity_pct": 30.0}
    columns = {name: np.full(n, value) for name, value in air.items()}
    raw = artefact_facts(kind="axis_runs", u_scale_um_per_m=0.0, air_corrected=False, dead_path_mm=100.0)
    found = estimated(raw, joined({**run(1, X), **columns}), ["scale_x"]).value[0]
    index = harris_2004(23.0, 99000.0, 30.0, 450.0, 632.991) - harris_2004(20.0, 101325.0, 50.0, 450.0, 632.991)
    assert found == pytest.approx(-1e6 * float(index), rel=1e-4)
    warm = artefact_facts(kind="axis_runs", u_scale_um_per_m=0.0, cte_per_k=1e-5)
    points = joined({**run(1, X), "temp_artefact_c": np.full(n, 22.0)})
    assert estimated(warm, points, ["scale_x"]).value[0] == pytest.approx(20.0, rel=1e-4)


def test_kinds_of_reading_weigh_as_their_repeats_scatter() -> None:
    random, rows = np.random.default_rng(4), [run(1, X, repeats=30), run(2, Y, repeats=30), run(3, turn=Z, repeats=30)]
    for one, name, sd in zip(rows, ("reading_um", "reading_um", "reading_arcsec"), (0.1, 0.5, 0.4), strict=True):
        one[name] = sd * random.normal(size=len(one["xyz"]))
    scale = [float(AxisRuns(EXACT, joined(*rows)).noise_scale[600 * i]) for i in range(3)]
    assert scale[0] == 1.0
    assert scale[1] == pytest.approx(5.0, rel=0.1)  # 551 degrees of freedom each
    assert scale[2] == pytest.approx(0.4 * SECOND * 100.0 / 1e-4, rel=0.1)
    few = AxisRuns(EXACT, joined(run(1, X, repeats=1), run(2, turn=Z, repeats=1))).noise_scale
    assert (few[0], few[-1]) == (1.0, pytest.approx(np.sqrt(2.0)))


def test_kinds_that_were_not_repeated_weigh_as_they_are_off_their_neighbours() -> None:
    """Displacements of 1 µm and rotations of 0.1″, which on an arm of 100 mm are 0.0485 µm: 20.6 to 1."""
    at, random = np.linspace(0.0, 900.0, 61), np.random.default_rng(5)
    rows = [read(run(1, X, repeats=1, at=at)), read(run(2, turn=Z, repeats=1, at=at))]
    rows[0]["reading_um"] = rows[0]["reading_um"] + random.normal(0, 1.0, 122)
    rows[1]["reading_arcsec"] = rows[1]["reading_arcsec"] + random.normal(0, 0.1, 122)
    scale = AxisRuns(EXACT, joined(*rows)).noise_scale
    assert scale[0] / scale[-1] == pytest.approx(1.0 / (1000 * SECOND * 0.1 * 100), rel=0.2)


def test_a_cubic_is_no_roughness_and_white_noise_is_all_of_it() -> None:
    at = np.array([0.0, 70.0, 200.0, 310.0, 333.0, 500.0, 610.0, 790.0, 900.0])
    points = joined(run(1, X, repeats=2, at=at))
    (one,) = AxisRuns(EXACT, points).runs
    x = points.xyz[:, 0] / 100
    squares, count = roughness(one, 3.0 - x + 0.5 * x**2 - 0.1 * x**3, points.repeat)
    assert count == 4 * (9 - 4)
    assert squares < 1e-18 * count
    every = np.random.default_rng(1).normal(0, 2.0, (400, len(x)))
    found = [roughness(one, noise, points.repeat)[0] / count for noise in every]
    assert np.mean(found) == pytest.approx(4.0, rel=0.05)


def test_figures_are_those_of_the_readings() -> None:
    random, rows = np.random.default_rng(5), run(1, X, repeats=5)
    rows["reading_um"] = random.normal(size=len(rows["xyz"]))
    (found,) = AxisRuns(EXACT, joined(rows)).positionings().values()
    up = rows["approach_x"] > 0
    mean = [
        [rows["reading_um"][(rows["xyz"][:, 0] == t) & (up == side)].mean() for t in TARGETS] for side in (True, False)
    ]
    assert found.figures()["B"] == pytest.approx(np.abs(np.subtract(*mean)).max(), rel=1e-9)
    assert found.figures()["E"] == pytest.approx(np.ptp(mean), rel=1e-9)
    assert found.targets == pytest.approx(TARGETS)


def test_names_of_quantities() -> None:
    names = [str(one.quantity) for one in AxisRuns(EXACT, joined(*six())).runs]
    assert names == ["xtx", "xtx", "xty", "xry", "xrz", "xrx"]


def changed(rows: dict[str, Floats], **columns: Any) -> Points:
    return joined({**rows, **{name: np.full(len(rows["xyz"]), value) for name, value in columns.items()}})


@pytest.mark.parametrize(
    ("points", "said", "fix"),
    [
        (lambda: changed(run(1, X), reading_um=5e4), "reading_um beyond", "µm of a displacement"),
        (lambda: changed(run(1, turn=Z), reading_arcsec=4e3), "reading_arcsec beyond", "0.2063″"),
        (lambda: changed(run(1, X), reading_arcsec=1.0), "reading_arcsec is not 0", "reading_um"),
        (lambda: changed(run(1, turn=Z), reading_um=1.0), "reading_um is not 0", "reading_arcsec"),
        (lambda: changed(run(1, X), turn_y=1.0), "has both read_x", "Put 0"),
        (lambda: changed(run(1), read_x=0.7), "no unit length", "unit vector"),
        (lambda: changed(run(1), read_x=0.8, read_y=0.6), "neither along its travel nor across", "read_x"),
        (lambda: joined(run(1, Y, at=TARGETS[:2])), "has 2 positions", "Record more"),
        (lambda: joined(run(1, X, at=TARGETS[:1])), "stands still", "x_mm"),
        (lambda: joined(run(1, X), run(1, Y)), "reads along several directions", "measurement of its own"),
    ],
)  # fmt: skip
def test_what_is_no_run_is_refused_with_its_line(points: Any, said: str, fix: str) -> None:
    with pytest.raises(CmmUqError) as told:
        AxisRuns(EXACT, points())
    assert said in told.value.problem
    assert fix in str(told.value.fix)
    assert "line" in str(told.value.where)


@pytest.mark.parametrize(("rows", "column"), [(run(1, X), "reading_um"), (run(1, turn=Z), "reading_arcsec")])
def test_a_missing_column_is_named(rows: dict[str, Floats], column: str) -> None:
    points = joined(rows)
    less = {name: values for name, values in points.columns.items() if name != column}
    with pytest.raises(CmmUqError, match=f"no column '{column}'"):
        AxisRuns(EXACT, replace(points, columns=less))


def test_a_run_that_is_another_to_the_last_digit_is_told_and_repeats_at_the_same_targets_are_none() -> None:
    """Positions are targets, the same in every repeat: what was found there are the readings."""
    one, two = read(run(1, X)), read(run(2, Y))
    noise = np.random.default_rng(6).normal(0.0, 0.3, (2, len(one["reading_um"])))
    for rows, more in zip((one, two), noise, strict=True):
        rows["reading_um"] = rows["reading_um"] + more
    assert not joined(one, two).copies
    again = {**one, "measurement": np.full(len(one["measurement"]), 3)}
    (found,) = repeated_figures(joined(one, two, again))
    assert (found.kind, len(found.rows)) == ("repeated block", len(again["measurement"]))
    assert sorted(joined(one, two, again).copies.items()) == [(4, 0), (5, 1)]


def test_references_of_which_no_uncertainty_is_stated_are_named() -> None:
    """A warning of the certificate names them; of positions the scale stays free, and nothing is taken as exact."""
    runs = AxisRuns(EXACT, joined(*six()))
    named = [str(text) for text, _ in runs.exact]
    assert not (runs.exact[0][1] & runs.exact[1][1]).any()
    assert named == [
        f"The reference of {what} is given without an uncertainty" for what in ("straightnesses", "rotations")
    ]
    stated = artefact_facts(kind="axis_runs", u_scale_um_per_m=0.0, u_straightness_um=0.0, u_rotation_arcsec=0.1)
    assert not AxisRuns(stated, joined(*six())).exact
    assert not AxisRuns(EXACT, joined(run(1, X))).exact
