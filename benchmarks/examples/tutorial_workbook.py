"""Writes the workbook that the tutorial begins with: the recording of the real example as a laboratory would export it.

python -m benchmarks.examples.tutorial_workbook
"""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import pandas as pd
from openpyxl import Workbook

ROOT = Path(__file__).parents[2]
FILE = ROOT / "docs" / "tutorial" / "ballbar-export.xlsx"
DATE = dt.datetime(2004, 9, 1)


def workbook() -> Workbook:
    """One sheet: three lines about the measurement, headings with their unit, a row for each ball."""
    points = pd.read_csv(ROOT / "examples" / "iota-1102-20C" / "ballbar.csv", comment="#")
    book = Workbook()
    book.properties.creator, book.properties.created, book.properties.modified = "", DATE, DATE
    sheet = book.active
    sheet.title = "Export"
    for line in (["Machine", "DEA Iota 1102"], ["Programme", "Ballbar, 20 positions"], []):
        sheet.append(line)
    sheet.append(["Position", "Ball", "X [mm]", "Y [mm]", "Z [mm]"])
    for row in points[["measurement", "point", "x_mm", "y_mm", "z_mm"]].itertuples(index=False):
        sheet.append([int(row[0]), int(row[1]), *(float(value) for value in row[2:])])
    return book


if __name__ == "__main__":
    FILE.parent.mkdir(exist_ok=True)
    workbook().save(FILE)
