"""Thirty exports as laboratories have them, each with what it must be read as, written from one set of figures."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

NOMINAL = (100.0, 250.0, 400.0)
LINES = 2
RUNS = 3
INCH = 25.4

Value = tuple[str, float, int, float]
"""Line, nominal length in mm, run, and measured length in mm."""


def deviation_um(line: int, length: int, run: int) -> float:
    """Tenths of micrometres, all different within a line."""
    return ((17 * line + 29 * length + 7 * run) % 41 - 20) / 10 + length


def measured(line: int, length: int, run: int) -> float:
    return round(NOMINAL[length] + deviation_um(line, length, run) / 1000, 4)


def lengths(names: Sequence[str], runs: int = RUNS, nominal: Callable[[float], float] = float) -> list[Value]:
    """What a table of lengths holds, by the names of its lines."""
    return [(name, nominal(NOMINAL[k]), run + 1, measured(i, k, run))
            for i, name in enumerate(names) for k in range(3) for run in range(runs)]  # fmt: skip


POINTS = [
    (1, 1, (100.0213, 250.0044, -120.0018)), (1, 2, (500.0225, 250.0101, -120.0007)),
    (2, 1, (300.0102, 50.0037, -120.0021)), (2, 2, (700.0188, 50.0059, -120.0012)),
    (3, 1, (200.0131, 80.0077, -320.0035)), (3, 2, (200.0154, 480.0061, -320.0029)),
]  # fmt: skip
"""Measurement, ball, and its coordinates in mm."""


@dataclass(frozen=True)
class Export:
    """Bytes of an export with what it must be read as: lengths on lines, or points."""

    content: bytes
    lengths: Sequence[Value] = ()
    points: Sequence[Any] = ()
    keys: Mapping[str, Any] = field(default_factory=dict)


def text(rows: Sequence[Sequence[object]], between: str = ",", decimal: str = ".", encoding: str = "utf-8") -> bytes:
    def cell(value: object) -> str:
        return (f"{value:.4f}" if isinstance(value, float) else str(value)).replace(
            ".", decimal if isinstance(value, float) else "."
        )

    return "".join(between.join(map(cell, row)) + "\r\n" for row in rows).encode(encoding)


def book(sheets: Mapping[str, Sequence[Sequence[object]]], merged: Sequence[str] = ()) -> bytes:
    from openpyxl import Workbook

    out, book = io.BytesIO(), Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append([None if cell == "" else cell for cell in row])
        for area in merged:
            sheet.merge_cells(area)
    book.save(out)
    return out.getvalue()


def down(name: object, k: int) -> object:
    """A label in the first row of its block alone."""
    return name if k == 0 else ""


def runs_of(i: int, k: int) -> list[float]:
    return [measured(i, k, run) for run in range(RUNS)]


def deviations_of(i: int, k: int) -> list[float]:
    return [deviation_um(i, k, run) for run in range(RUNS)]


ALL = [(i, k) for i in range(LINES) for k in range(3)]
TWO = ("1", "2")


def runs_in_german() -> Export:
    head = [
        "Position",
        "Nennmaß [mm]",
        "Messung 1 [mm]",
        "Messung 2 [mm]",
        "Messung 3 [mm]",
        "Mittelwert [mm]",
        "Abweichung [µm]",
    ]
    rows = [
        [down(i + 1, k), NOMINAL[k], *(own := runs_of(i, k)), sum(own) / 3, (sum(own) / 3 - NOMINAL[k]) * 1000]
        for i, k in ALL
    ]
    return Export(
        text([["Annahmeprüfung nach ISO 10360-2"], ["Prüfer: Müller"], [], head, *rows], ";", ",", "cp1252"),
        lengths(TWO),
    )


def nominal_measured_deviation() -> Export:
    head = ["Line", "Nominal (mm)", "Measured (mm)", "Deviation (µm)"]
    return Export(
        text([head, *([i + 1, NOMINAL[k], measured(i, k, 0), deviation_um(i, k, 0)] for i, k in ALL)]), lengths(TWO, 1)
    )


def deviations_with_units_row() -> Export:
    rows: list[list[object]] = []
    for i in range(LINES):
        rows += [[f"Position {i + 1}"], ["Length", "Run 1", "Run 2", "Run 3"], ["mm", "µm", "µm", "µm"]]
        rows += [[NOMINAL[k], *deviations_of(i, k)] for k in range(3)]
        rows += [[]]
    return Export(text(rows, ";"), lengths(["Position 1", "Position 2"]))


def long_form() -> Export:
    rows = [[i + 1, NOMINAL[k], run + 1, measured(i, k, run)] for i, k in ALL for run in range(RUNS)]
    return Export(text([["position", "nominal_mm", "repeat", "measured_mm"], *rows]), lengths(TWO))


def stacked_blocks() -> Export:
    rows: list[list[object]] = [["Length measurement error E0", "", "", "", ""], []]
    names = ["Line 1 (along X)", "Line 2 (space diagonal)"]
    for i, name in enumerate(names):
        rows += [
            [name],
            ["No.", "Calibrated length [mm]", "Run 1 [mm]", "Run 2 [mm]", "Run 3 [mm]", "Max. deviation [µm]"],
        ]
        rows += [[k + 1, NOMINAL[k], *runs_of(i, k), max(map(abs, deviations_of(i, k)))] for k in range(3)]
        rows += [["Mean", "", *(sum(measured(i, k, run) for k in range(3)) / 3 for run in range(RUNS))], []]
    return Export(book({"E0": rows}), lengths(names))


def a_sheet_a_line() -> Export:
    head = ["Nominal length (mm)", "Measured 1 (mm)", "Measured 2 (mm)", "Measured 3 (mm)"]
    names = ["X", "Diagonal"]
    sheets = {
        name: [[f"Results for {name}"], head, *([NOMINAL[k], *runs_of(i, k)] for k in range(3))]
        for i, name in enumerate(names)
    }
    return Export(book({"Info": [["Machine", "CMM 7"], ["Operator", "A. B."]], **sheets}), lengths(names))


def merged_heads() -> Export:
    top = ["Position", "Nominal", "Measured length / mm", "", "", "Deviation / µm", "", ""]
    rows = [[down(f"Position {i + 1}", k), NOMINAL[k], *runs_of(i, k), *deviations_of(i, k)] for i, k in ALL]
    content = book(
        {"ISO 10360-2": [["Protocol 7"], [], top, ["", "mm", 1, 2, 3, 1, 2, 3], *rows]},
        ["C3:E3", "F3:H3", "A5:A7", "A8:A10"],
    )
    return Export(content, lengths(["Position 1", "Position 2"]))


def balls_merged() -> Export:
    rows = [["Bar", "Ball A", "", "", "Ball B", "", ""], ["position", *"XYZXYZ"], ["", *["mm"] * 6]]
    rows += [[m, *POINTS[2 * m - 2][2], *POINTS[2 * m - 1][2]] for m in (1, 2, 3)]
    return Export(book({"Bar": rows}, ["B1:D1", "E1:G1"]), points=POINTS)


def balls_in_text() -> Export:
    rows = [["", "Kugel 1", "", "", "Kugel 2", "", ""], ["Stellung", *("X [mm]", "Y [mm]", "Z [mm]") * 2]]
    rows += [[m, *POINTS[2 * m - 2][2], *POINTS[2 * m - 1][2]] for m in (1, 2, 3)]
    return Export(text(rows, ";", ","), points=POINTS)


def in_french() -> Export:
    head = ["Ligne", "Longueur nominale (mm)", "Essai 1 (mm)", "Essai 2 (mm)", "Essai 3 (mm)", "Écart max (µm)"]
    rows = [[down(f"Ligne {i + 1}", k), NOMINAL[k], *runs_of(i, k), max(deviations_of(i, k))] for i, k in ALL]
    return Export(text([head, *rows], ";", ",", "cp1252"), lengths(["Ligne 1", "Ligne 2"]))


def in_japanese() -> Export:
    head = ["測定線", "呼び寸法(mm)", "1回目", "2回目", "3回目", "平均", "最大誤差(µm)"]
    rows = [[i + 1, NOMINAL[k], *(own := runs_of(i, k)), sum(own) / 3, max(deviations_of(i, k))] for i, k in ALL]
    return Export(text([head, *rows], ",", ".", "utf-8-sig"), lengths(TWO))


def in_italian() -> Export:
    head = ["Posizione", "Nominale", "Misurato", "Scostamento"]
    rows = [[i + 1, NOMINAL[k], measured(i, k, 0), measured(i, k, 0) - NOMINAL[k]] for i, k in ALL]
    return Export(text([["Unità: mm"], [], head, *rows], "\t", ",", "utf-8"), lengths(TWO, 1))


def in_spanish() -> Export:
    head = [
        "Posición",
        "Valor nominal (mm)",
        "Medida 1 (mm)",
        "Medida 2 (mm)",
        "Medida 3 (mm)",
        "Desviación media (µm)",
    ]
    rows = [[down(i + 1, k), NOMINAL[k], *runs_of(i, k), sum(deviations_of(i, k)) / 3] for i, k in ALL]
    return Export(book({"Resultados": [head, *rows]}), lengths(TWO))


def pcdmis_in_german() -> Export:
    lines = ["TEILNAME  : KUGELSTAB", ""]
    for m, ball, xyz in POINTS:
        lines += [f"DIM LAGE{ball}= LAGE VON KUGEL M{m}_K{ball}  EINHEIT=MM",
                  "AX       NENNWERT       +TOL       -TOL        MESSWERT            ABW     AUSTOL"]  # fmt: skip
        for axis, value in zip("XYZ", xyz, strict=True):
            lines.append(
                f"{axis}  {round(value):>13.4f} {0.05:10.3f} {0.05:10.3f} {value:>15.4f} {value - round(value):>14.4f} 0.0"
            )
    return Export("\r\n".join(lines).encode("cp1252"), points=POINTS)


def pcdmis_distances() -> Export:
    lines = ["PART NAME  : STEP GAUGE", ""]
    for i, k in ALL:
        for run in range(RUNS):
            lines += [f"DIM P{i + 1}_L{k + 1}_R{run + 1}= 3D DISTANCE FROM PLANE PL0 TO PLANE PL{k + 1}  UNITS=MM",
                      "AX       NOMINAL       +TOL       -TOL            MEAS            DEV     OUTTOL",
                      f"M  {NOMINAL[k]:>13.4f} {0.05:10.3f} {0.05:10.3f} {measured(i, k, run):>15.4f}"
                      f" {deviation_um(i, k, run) / 1000:>14.4f}      0.000 ----#----"]  # fmt: skip
    return Export("\r\n".join(lines).encode(), lengths(["P1", "P2"]))


def characteristics_in_german() -> Export:
    head = ["Merkmal", "Istwert", "Nennwert", "Otol", "Utol", "Abweichung"]
    rows = [[f"Linie {i + 1} Länge {k + 1} Lauf {run + 1}", measured(i, k, run), NOMINAL[k], 0.01, -0.01,
             deviation_um(i, k, run) / 1000]
            for i, k in ALL for run in range(RUNS)]  # fmt: skip
    return Export(text([["Einheit: mm"], head, *rows], "\t", ",", "cp1252"), lengths(["Linie 1", "Linie 2"]))


def labels_once() -> Export:
    rows = [[down(f"Messung {m}", ball - 1), ball, *xyz] for m, ball, xyz in POINTS]
    return Export(text([["Messung", "Kugel", "X [mm]", "Y [mm]", "Z [mm]"], *rows], ";", ","), points=POINTS)


def summaries_among_points() -> Export:
    rows: list[list[object]] = [
        ["Measurement", "Ball", "X [mm]", "Y [mm]", "Z [mm]"],
        *([m, ball, *xyz] for m, ball, xyz in POINTS),
    ]
    for name, figure in (("Mean", lambda v: sum(v) / len(v)), ("Max", max), ("Min", min)):
        rows.append([name, "", *(figure([xyz[a] for _, _, xyz in POINTS]) for a in range(3))])
    return Export(text(rows), points=POINTS)


def remarks_among_points() -> Export:
    rows: list[list[object]] = [["Set-up", "Point", "X", "Y", "Z", "Remark"], ["", "", "mm", "mm", "mm", ""]]
    for m, ball, xyz in POINTS:
        rows += [[], [f"Bar set up anew by A. B., number {m}"]] if ball == 1 else []
        rows.append([m, ball, *xyz, "checked"])
    return Export(text(rows, ";"), points=POINTS)


def axes_over_nominal_and_actual() -> Export:
    rows: list[list[object]] = [["Position", "Ball", "X", "", "", "Y", "", "", "Z", "", ""],
                                ["", "", *("Nominal", "Actual", "Dev.") * 3],
                                ["", "", *["[mm]"] * 9]]  # fmt: skip
    rows += [[m, ball, *(v for c in xyz for v in (float(round(c)), c, c - round(c)))] for m, ball, xyz in POINTS]
    return Export(book({"Report": [["Machine", "CMM 7"], [], *rows]}, ["C3:E3", "F3:H3", "I3:K3"]), points=POINTS)


def units_below_and_a_preamble() -> Export:
    rows = [
        ["Ball bar"],
        ["2026-05-31"],
        ["Nr", "Messung", "Kugel", "X", "Y", "Z"],
        ["", "", "", "[mm]", "[mm]", "[mm]"],
    ]
    rows += [[n + 1, m, ball, *xyz] for n, (m, ball, xyz) in enumerate(POINTS)]
    return Export(text(rows, ";", ","), points=POINTS)


def names_of_balls() -> Export:
    rows = [[f"Bar {m}", f"Ball {'AB'[ball - 1]}", *xyz] for m, ball, xyz in POINTS]
    return Export(text([["Set-up", "Ball", "X (mm)", "Y (mm)", "Z (mm)"], *rows]), points=POINTS)


def in_inches() -> Export:
    head = ["Line", "Nominal (in)", "Reading 1 (in)", "Reading 2 (in)", "Reading 3 (in)"]
    rows = [
        ",".join([str(i + 1), f"{NOMINAL[k] / INCH:.9f}", *(f"{v / INCH:.9f}" for v in runs_of(i, k))]) for i, k in ALL
    ]
    return Export("\n".join([",".join(head), *rows]).encode(), lengths(TWO))


def certified_and_indicated() -> Export:
    head = ["Line", "Nominal (mm)", "Calibrated (mm)", "Indicated 1 (mm)", "Indicated 2 (mm)", "Indicated 3 (mm)",
            "Error 1 (µm)", "Error 2 (µm)", "Error 3 (µm)", "MPE (µm)"]  # fmt: skip
    rows = [[i + 1, NOMINAL[k], NOMINAL[k] + 0.0008, *(own := runs_of(i, k)), *((v - NOMINAL[k] - 0.0008) * 1000 for v in own),
             3.0 + NOMINAL[k] / 300]
            for i, k in ALL]  # fmt: skip
    return Export(text([head, *rows], ";"), lengths(TWO, nominal=lambda length: length + 0.0008))


def a_column_a_line() -> Export:
    rows = [[NOMINAL[k], *(deviation_um(i, k, 0) for i in range(LINES))] for k in range(3)]
    return Export(
        text([["Length (mm)", "Position 1 (µm)", "Position 2 (µm)"], *rows], ";"),
        lengths(["Position 1", "Position 2"], 1),
    )


def report_in_blanks() -> Export:
    lines = ["ISO 10360-2 length test, units: mm", ""]
    for i in range(LINES):
        lines += [f"Line {i + 1}", "     Nominal    Measured   Deviation"]
        lines += [
            f"  {NOMINAL[k]:10.4f}  {measured(i, k, 0):10.4f}  {deviation_um(i, k, 0) / 1000:10.4f}" for k in range(3)
        ]
        lines += [""]
    return Export("\n".join(lines).encode(), lengths(["Line 1", "Line 2"], 1))


def repeats_in_turn() -> Export:
    rows = [
        [down(f"Linie {i + 1}", 3 * k + run), NOMINAL[k], measured(i, k, run)] for i, k in ALL for run in range(RUNS)
    ]
    return Export(text([["Linie", "Sollwert [mm]", "Istwert [mm]"], *rows], ";", ","), lengths(["Linie 1", "Linie 2"]))


def lengths_of_a_bar() -> Export:
    names = [f"{i + 1}" for i in range(4)]
    rows = [[name, 400 + deviation_um(i, 0, 0) / 1000] for i, name in enumerate(names)]
    values = [(name, 0.0, 1, round(400 + deviation_um(i, 0, 0) / 1000, 4)) for i, name in enumerate(names)]
    return Export(text([["Position", "Length (mm)"], *rows, ["Mean", 400.0], ["Range", 0.0021]]), values)


def with_limits() -> Export:
    rows: list[list[object]] = [["Test position 1"],
                                ["Reference length", *(f"Deviation run {run + 1}" for run in range(RUNS)), "E0,MPE", "OK?"],
                                ["[mm]", "[µm]", "[µm]", "[µm]", "[µm]", ""]]  # fmt: skip
    rows += [[NOMINAL[k], *deviations_of(0, k), 3.0, "yes"] for k in range(3)]
    rows += [
        ["Max", *(max(deviation_um(0, k, run) for k in range(3)) for run in range(RUNS))],
        ["Remark: soaked over night"],
    ]
    return Export(text(rows, ";"), lengths(["Test position 1"]))


def quindos_points() -> Export:
    rows = [
        f"{n + 1:4d}  M{m}_B{ball}   {xyz[0]:12.4f} {xyz[1]:12.4f} {xyz[2]:12.4f}"
        for n, (m, ball, xyz) in enumerate(POINTS)
    ]
    return Export("\n".join(["No    Name    X_act[mm]   Y_act[mm]   Z_act[mm]", *rows, ""]).encode(), points=POINTS)


EXPORTS: Mapping[str, tuple[str, Callable[[], Export]]] = {
    made.__name__: (f"a.{ending}", made)
    for ending, several in {
        "csv": (
            runs_in_german, nominal_measured_deviation, deviations_with_units_row, long_form, balls_in_text,
            in_french, in_japanese, labels_once, summaries_among_points, remarks_among_points,
            units_below_and_a_preamble, names_of_balls, in_inches, certified_and_indicated, a_column_a_line,
            repeats_in_turn, lengths_of_a_bar, with_limits,
        ),
        "xlsx": (
            stacked_blocks, a_sheet_a_line, merged_heads, balls_merged, in_spanish,
            axes_over_nominal_and_actual,
        ),
        "txt": (
            in_italian, pcdmis_in_german, pcdmis_distances, characteristics_in_german, report_in_blanks,
            quindos_points,
        ),
    }.items()
    for made in several
}  # fmt: skip
