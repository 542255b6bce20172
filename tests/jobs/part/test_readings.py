"""Measured points are told apart by feature and number, in whatever order they stand.

Recordings of other methods: values or points by cycle or orientation, told with the line of what is wrong.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from tests.jobs.part.parts import plate

RECORDING = {"recording": {"file": "points.csv"}}


def rows(shift: float = 0.01) -> list[str]:
    return [
        f"{one.facts.name},{i + 1},{x + shift!r},{y!r},{z!r}"
        for one in plate().features
        for i, (x, y, z) in enumerate(one.points.tolist())
    ]


def scaled(factor: float) -> list[str]:
    return [
        ",".join([*line.split(",")[:2], *(repr(factor * float(value)) for value in line.split(",")[2:])])
        for line in rows()
    ]


def content(lines: list[str], header: str = "feature,point,x_mm,y_mm,z_mm") -> dict[str, bytes]:
    return {"points.csv": "\n".join([header, *lines]).encode()}


def test_points_come_in_the_order_of_the_plan() -> None:
    job = plate(content(rows()[::-1]), **RECORDING)
    assert job.measured is not None
    planned = np.concatenate([one.points for one in job.features])
    np.testing.assert_allclose(job.measured - planned, np.tile([0.01, 0, 0], (len(planned), 1)), atol=1e-12)


@pytest.mark.parametrize(("files", "words"), [
    (content(rows()[:-1]), "point 24 of 'bore' is missing"),
    (content([*rows(), rows()[0]]), "point 1 of 'A' stands there twice"),
    (content([*rows(), "D,1,0,0,0"]), "there is no feature 'D'"),
    (content([*rows(), "A,13,0,0,0"]), "'A' has no point 13"),
    (content([*rows()[:-1], "bore,24,60,40"]), "has 4 cells where the header has 5"),
    (content([*rows()[:-1], "bore,24,60,40,zero"]), r"points.csv line 61, column z_mm: .* Give a number: every point"),
    (content(rows(), "feature,point,x_mm,y_mm,z"), "has no column 'z_mm'"),
    (content(rows(6.0)), "lies 6 mm from where it is planned"),
    (content(scaled(1 / 25.4)), "0.03937 times those of the plan, as if they were in inches"),
    (content(scaled(25.4)), "25.4 times those of the plan, as if they were taken for inches once too often"),
    (content(scaled(1.5)), "point 2 of 'A' lies"),
    ({}, "points.csv"),
])  # fmt: skip
def test_points_that_are_not_those_of_the_plan_are_refused(files: dict[str, bytes], words: str) -> None:
    with pytest.raises(CmmUqError, match=words):
        plate(files, **RECORDING)


NAMES = [one.name for one in plate().facts.characteristic]
SIZE = next(one.name for one in plate().facts.characteristic if one.what == "size")
CALIBRATED = {"file": "calibrated.csv", "characteristic": [{"name": SIZE, "value_mm": 20.0, "u_um": 0.5}]}
ORIENTED = {"file": "turned.csv"}
BAR = {"length_mm": 500.0, "u_um": 0.5, "file": "bar.csv"}
RING = {"diameter_mm": 30.0, "u_um": 0.2, "inner": True, "file": "ring.csv"}


def values(group: str = "cycle", groups: int = 10, repeats: int = 2, name: str = SIZE) -> list[str]:
    return [f"{group},repeat,characteristic,value_mm"] + [
        f"{i + 1},{j + 1},{name},{20 + 1e-3 * i + 1e-4 * j!r}" for i in range(groups) for j in range(repeats)
    ]


def read(rows: list[str], column: str = "length_mm") -> list[str]:
    return [f"orientation,repeat,{column}", *rows]


def files(**tables: list[str]) -> dict[str, bytes]:
    return {f"{name}.csv": "\n".join(rows).encode() for name, rows in tables.items()}


def test_values_come_by_cycle() -> None:
    rows = values()
    job = plate(files(calibrated=[rows[0], *rows[:0:-1]]), by_calibrated_part=CALIBRATED)
    found = job.others.calibrated
    assert found is not None
    assert found.group.tolist() == np.repeat(np.arange(1, 11), 2).tolist()
    np.testing.assert_allclose(found.values[SIZE][:3], [20.0, 20.0001, 20.001], atol=1e-12)
    assert "calibrated.csv" in job.inputs


def test_points_come_by_orientation_in_the_order_of_the_plan() -> None:
    rows = [
        f"{i},{j},{one.facts.name},{k + 1},{x + 0.001 * i!r},{y + 0.001 * j!r},{z!r}"
        for i in (1, 2) for j in (1, 2) for one in plate().features for k, (x, y, z) in enumerate(one.points.tolist())
    ]  # fmt: skip
    job = plate(
        files(turned=["orientation,repeat,feature,point,x_mm,y_mm,z_mm", *rows[::-1]]), by_orientations=ORIENTED
    )
    found = job.others.orientations
    assert found is not None
    assert found.points is not None
    planned = np.concatenate([one.points for one in job.features])
    np.testing.assert_allclose(found.points[2] - planned, np.tile([0.002, 0.001, 0], (len(planned), 1)), atol=1e-12)
    assert found.group.tolist() == [1, 1, 2, 2]


def test_standards_are_read_beside_them() -> None:
    turned = values("orientation", 4, 5)
    bar = read([f"{i},{j},{500 + 1e-3 * i!r}" for i in range(1, 4) for j in (1, 2)])
    ring = read([f"{i},{j},{30 - 1e-3 * j!r}" for i in (1, 2) for j in (1, 2)], "diameter_mm")
    given = {**ORIENTED, "length_standard": BAR, "probe_standard": [RING]}
    job = plate(files(turned=turned, bar=bar, ring=ring), by_orientations=given)
    assert job.others.length is not None
    assert job.others.length.values.tolist() == [500.001, 500.001, 500.002, 500.002, 500.003, 500.003]
    (tip,) = job.others.tips.values()
    assert tip.values.tolist() == [29.999, 29.998, 29.999, 29.998]
    assert list(job.others.tips) == [job.facts.stylus[0].name]


@pytest.mark.parametrize(("change", "words"), [
    (lambda rows: [*rows, rows[1]], r"line 22.*stands there twice for cycle 1, repeat 1"),
    (lambda rows: [*rows, "1,3,nothing,20"], "line 22.*there is no characteristic 'nothing'"),
    (lambda rows: [*rows[:-1], "10,2,x"], "line 21.*has 3 cells where the header has 4"),
    (lambda rows: [*rows[:-1], f"10,2,{SIZE},wide"], "line 21, column value_mm.*not a number"),
    (lambda rows: [*rows[:-1], f"10.5,2,{SIZE},20"], "line 21, column cycle.*no number of a cycle"),
    (lambda rows: [rows[0].replace("cycle", "round"), *rows[1:]], "has no column 'cycle'"),
    (lambda rows: [rows[0].replace("value_mm", "value"), *rows[1:]], "has no column 'value_mm'"),
    (lambda rows: [rows[0].replace("characteristic", "what"), *rows[1:]], "neither a column 'characteristic' nor 'feature'"),
    (lambda rows: rows[:1], "has no rows"),
])  # fmt: skip
def test_a_recording_that_is_wrong_is_told_with_its_line(change: Any, words: str) -> None:
    rows = change(values())
    with pytest.raises(CmmUqError, match=words):
        plate(files(calibrated=rows), by_calibrated_part=CALIBRATED)


def test_a_characteristic_that_one_measurement_lacks_is_told() -> None:
    other = next(one.name for one in plate().facts.characteristic if one.asks.limits != "angles" and one.name != SIZE)
    rows = [*values(), *values(name=other)[2:]]
    given = {**CALIBRATED, "characteristic": [{"name": name, "value_mm": 20.0, "u_um": 0.5} for name in (SIZE, other)]}
    with pytest.raises(CmmUqError, match=f"'{other}' has no value for cycle 1, repeat 1"):
        plate(files(calibrated=rows), by_calibrated_part=given)


@pytest.mark.parametrize(("groups", "repeats", "extra", "words"), [
    (1, 5, (), "in one orientation alone"), (4, 1, (), "orientation 1 was measured once"),
    (2, 2, (f"2,3,{SIZE},20",), "orientation 1 was measured 2 times, orientation 2 3 times"),
])  # fmt: skip
def test_orientations_must_be_several_and_alike(groups: int, repeats: int, extra: tuple[str, ...], words: str) -> None:
    rows = [*values("orientation", groups, repeats), *extra]
    with pytest.raises(CmmUqError, match=words):
        plate(files(turned=rows), by_orientations=ORIENTED)


@pytest.mark.parametrize(("tables", "words"), [
    ({"by_calibrated_part": {**CALIBRATED, "characteristic": [{"name": "no", "value_mm": 1.0, "u_um": 1.0}]}},
     "there is no characteristic 'no'"),
    ({"by_calibrated_part": {**CALIBRATED, "characteristic": CALIBRATED["characteristic"] * 2}}, "stands there twice"),  # type: ignore[operator]
    ({"by_calibrated_part": {**CALIBRATED, "characteristic": [{"name": SIZE, "value_deg": 1.0, "u_arcsec": 1.0}]}},
     "stated in the wrong unit"),
    ({"by_calibrated_part": {**CALIBRATED, "characteristic": [{"name": SIZE, "value_mm": 1.0}]}}, "value_mm and u_um"),
    ({"by_orientations": {**ORIENTED, "probe_standard": [{**RING, "stylus": "no"}]}}, "there is no stylus 'no'"),
    ({"by_orientations": {**ORIENTED, "probe_standard": [RING, RING]}}, "has two standards"),
    ({"by_orientations": {**ORIENTED, "length_standard": {**BAR, "length_mm": 510.0}}}, "is not the standard of 510 mm"),
])  # fmt: skip
def test_tables_that_lead_nowhere_are_refused(tables: dict[str, Any], words: str) -> None:
    bar = read([f"{i},{j},500" for i in (1, 2) for j in (1, 2)])
    ring = read([f"{i},{j},30" for i in (1, 2) for j in (1, 2)], "diameter_mm")
    with pytest.raises(CmmUqError, match=words):
        plate(files(calibrated=values(), turned=values("orientation", 4, 5), bar=bar, ring=ring), **tables)


def test_a_file_that_is_missing_is_told() -> None:
    with pytest.raises(CmmUqError, match=r"calibrated\.csv"):
        plate(by_calibrated_part=CALIBRATED)
