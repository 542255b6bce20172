"""Measured points are told apart by feature and number, in whatever order they stand."""

from __future__ import annotations

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
    (content([*rows()[:-1], "bore,24,60,40"]), "has 4 cells, and the header 5"),
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
