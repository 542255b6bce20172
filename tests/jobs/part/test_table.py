"""A plan as a table: the same features and characteristics as the same plan by DMIS, and nothing passed over."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import openpyxl
import pytest

from cmm_uq.app.commands.parts.new import part_of_drawing
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.part.dmis import drawing_of_dmis
from cmm_uq.jobs.part.drawing import Drawing, set_aside_unsound
from cmm_uq.jobs.part.table import COLUMNS, drawing_of_table
from tests.jobs.part.test_dmis import BORE, HEAD, TOP

PLAN = """Plan of the plate;;;;
;;;;
feature;kind;x_mm;y_mm;z_mm;i;j;k;diameter_mm;inner;length_mm;width_mm;points;what;nominal_mm;lower_tol_mm;upper_tol_mm;tolerance_mm;datums
top;plane;0;0;30;0;0;1;;;80;40;12;flatness;;;;0,02;
bore;cylinder;10;5;20;0;0;1;31;yes;15;;;size;31;-0,02;0,03;;

bore;;;;;;;;;;;;;perpendicularity;;;;0,1;top
hole 2;circle;-20;5;25;0;0;1;12;x;;;8;;;;;;
bore|hole 2;;;;;;;;;;;;;distance;30;-0,05;0,05;;
"""


def read(text: str) -> Drawing:
    drawing = drawing_of_table(text.encode(), "plan.csv")
    set_aside_unsound(drawing, "plan.csv")
    return drawing


def test_a_table_says_what_the_job_says() -> None:
    drawing = read(PLAN)
    assert drawing.unknown == []
    assert drawing.features == [
        {"name": "top", "kind": "plane", "point_mm": [0, 0, 30], "direction": [0, 0, 1], "length_mm": 80, "width_mm": 40,
         "strategy": {"pattern": "points", "points": 12}},
        {"name": "bore", "kind": "cylinder", "point_mm": [10, 5, 20], "direction": [0, 0, 1], "diameter_mm": 31, "inner": True,
         "length_mm": 15, "strategy": {"pattern": "sections", "sections": 3, "points": 8}},
        {"name": "hole 2", "kind": "circle", "point_mm": [-20, 5, 25], "direction": [0, 0, 1], "diameter_mm": 12,
         "inner": True, "strategy": {"pattern": "points", "points": 8}},
    ]  # fmt: skip
    assert drawing.characteristics == [
        {"name": "1", "what": "flatness", "features": ["top"], "tolerance_mm": 0.02},
        {"name": "2", "what": "size", "features": ["bore"], "lower_mm": 30.98, "upper_mm": 31.03},
        {"name": "3", "what": "perpendicularity", "features": ["bore"], "datums": ["top"],
         "tolerance_mm": 0.1},
        {"name": "4", "what": "distance", "features": ["bore", "hole 2"], "lower_mm": 29.95,
         "upper_mm": 30.05},
    ]  # fmt: skip
    assert drawing.open_keys == {"bore": ["strategy"]}, "only what the table leaves open is an example"


def test_a_workbook_reads_as_its_text_does() -> None:
    book = openpyxl.Workbook()
    sheet = book.active
    assert sheet is not None
    for line in PLAN.replace(",", ".").splitlines():
        cells: list[Any] = []
        for cell in line.split(";"):
            try:
                cells.append(float(cell))
            except ValueError:
                cells.append(cell or None)
        sheet.append(cells)
    content = io.BytesIO()
    book.save(content)
    found, wanted = drawing_of_table(content.getvalue(), "plan.xlsx"), drawing_of_table(PLAN.encode(), "plan.csv")
    assert (found.features, found.characteristics) == (wanted.features, wanted.characteristics)


def test_it_asks_the_same_as_the_same_plan_by_dmis() -> None:
    by_dmis = drawing_of_dmis("".join([HEAD, TOP, BORE, "ENDFIL\n"]).encode(), "plate.dmi")
    rows = [
        "feature,kind,x_mm,y_mm,z_mm,i,j,k,diameter_mm,inner,what,lower_mm,upper_mm,tolerance_mm,datums,characteristic"
    ]
    for one in by_dmis.features:
        place = [*one["point_mm"], *one["direction"], one.get("diameter_mm", ""), "yes" if one.get("inner") else ""]
        rows.append(",".join(map(str, [one["name"], one["kind"], *place, *[""] * 6])))
    for asked in by_dmis.characteristics:
        limits = [asked.get(key, "") for key in ("lower_mm", "upper_mm", "tolerance_mm")]
        about = "|".join(asked.get("datums", ()))
        cells = ["|".join(asked["features"]), *[""] * 9, asked["what"], *limits, about, asked["name"]]
        rows.append(",".join(map(str, cells)))
    by_table = drawing_of_table("\n".join(rows).encode(), "plan.csv")
    assert by_table.characteristics == by_dmis.characteristics
    for key in ("name", "kind", "point_mm", "direction", "diameter_mm", "inner"):
        assert [one.get(key) for one in by_table.features] == [one.get(key) or None for one in by_dmis.features]


def test_vectors_stand_in_one_cell() -> None:
    drawing = read("feature,kind,x_mm,y_mm,z_mm,i,j,k,normal,length_mm,what,tolerance_mm\n"
                   "edge,line,0,0,0,1,0,0,0 0 1,50,straightness,0.01\n")  # fmt: skip
    assert drawing.features[0]["normal"] == [0, 0, 1]
    assert drawing.unknown == []


HEADINGS = PLAN.splitlines()[2]


@pytest.mark.parametrize(("change", "words"), [
    (("width_mm", "witdh_mm"), "'witdh_mm' is no column of a plan"),
    (("width_mm", "length_mm"), "'length_mm' stands twice"),
    (("bore;;;", ";;;"), "names no feature"),
    (("hole 2;circle", "hole 2;"), "neither its kind nor what is asked of it"),
    (("hole 2;circle", "bore;circle"), "describes 'bore' again"),
    (("bore;;;;;", "bore;;7;;;"), "x_mm belongs to a feature"),
    (("8;;;;;;\n", "8;;;;;0,1;\n"), "tolerance_mm belongs to a characteristic"),
    (("31;yes", "31;perhaps"), "inner is yes or no"),
    (("31;-0,02", "31;"), "without both tolerances"),
    (("-0,02", "-0,02a"), "is not a number"),
    (("feature;kind", "name;kind"), "nor a table of features"),
])  # fmt: skip
def test_what_is_not_understood_is_refused_with_its_place(change: tuple[str, str], words: str) -> None:
    assert change[0] in PLAN
    with pytest.raises(CmmUqError, match=words) as refused:
        drawing_of_table(PLAN.replace(*change, 1).encode(), "plan.csv")
    assert "plan.csv" in str(refused.value)
    assert refused.value.fix


def test_every_column_of_a_plan_is_a_key_or_explained() -> None:
    assert len(set(COLUMNS)) == len(COLUMNS)
    assert {"feature", "kind", "what", "x_mm", "diameter_mm", "tolerance_mm", "lower_deg"} <= set(COLUMNS)


def test_a_job_is_begun_from_it(tmp_path: Path) -> None:
    path = tmp_path / "plan.csv"
    path.write_text(PLAN)
    job = part_of_drawing(path, {}, id="plate")["job.toml"].decode()
    assert 'what = "perpendicularity"' in job
    assert 'strategy = { pattern = "sections", sections = 3, points = 8 }  # EXAMPLE' in job
