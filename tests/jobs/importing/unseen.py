"""Fifteen exports written after the reading was built, as vendors' documents show them; hashed before they were tried."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from tests.jobs.importing.laboratory import (
    ALL,
    LINES,
    NOMINAL,
    POINTS,
    RUNS,
    TWO,
    Export,
    book,
    deviation_um,
    deviations_of,
    down,
    lengths,
    measured,
    runs_of,
    text,
)  # fmt: skip


def calypso_printout() -> Export:
    head = ["Characteristic", "Actual", "Nominal", "Upper Tol.", "Lower Tol.", "Deviation"]
    rows = [
        [f"Line {i + 1} Step {k + 1}", measured(i, k, 0), NOMINAL[k], 0.005, -0.005, deviation_um(i, k, 0) / 1000]
        for i, k in ALL
    ]
    return Export(
        text([["CALYPSO", "Measurement Plan: KOBA-step"], ["Units: mm"], [], head, *rows], "\t"),
        lengths(["Line 1", "Line 2"], 1),
    )


def step_gauge_table() -> Export:
    head = ["Test line", "Face no.", "Cal. value [mm]", "1st run [mm]", "2nd run [mm]", "3rd run [mm]"]
    rows = [[down(i + 1, k), k + 1, NOMINAL[k], *runs_of(i, k)] for i, k in ALL]
    return Export(text([["Step gauge KOBA 420"], head, *rows], ";"), lengths(TWO))


def mitutoyo() -> Export:
    head = [
        "測定位置",
        "呼び寸法 (mm)",
        "測定値1 (mm)",
        "測定値2 (mm)",
        "測定値3 (mm)",
        "誤差1 (μm)",
        "誤差2 (μm)",
        "誤差3 (μm)",
    ]
    rows = [[i + 1, NOMINAL[k], *runs_of(i, k), *deviations_of(i, k)] for i, k in ALL]
    return Export(text([["三次元測定機 精度検査成績書"], head, *rows], ",", ".", "utf-8-sig"), lengths(TWO))


def test_lengths_in_german() -> Export:
    head = ["Messlinie", "Prüflänge L in mm", "E1 in µm", "E2 in µm", "E3 in µm"]
    rows = [[down(f"Linie {i + 1}", k), NOMINAL[k], *deviations_of(i, k)] for i, k in ALL]
    return Export(text([head, *rows], ";", ",", "cp1252"), lengths(["Linie 1", "Linie 2"]))


def trials_in_inches() -> Export:
    rows = [
        ["All dimensions in inches"],
        ["Position", "Artifact length", "Trial 1", "Trial 2", "Trial 3", "Mean error", "Limit"],
    ]
    content = "\n".join([",".join(row) for row in rows] + [
        ",".join([str(i + 1), f"{NOMINAL[k] / 25.4:.9f}", *(f"{v / 25.4:.9f}" for v in runs_of(i, k)), "0.00005", "0.0002"])
        for i, k in ALL])  # fmt: skip
    return Export(content.encode(), lengths(TWO))


def ball_bar_in_one_row() -> Export:
    head = ["Pos. no.", *(f"Ball {ball} {axis}" for ball in (1, 2) for axis in "XYZ")]
    rows = [[m, *POINTS[2 * m - 2][2], *POINTS[2 * m - 1][2]] for m in (1, 2, 3)]
    return Export(text([["Units: mm"], head, *rows]), points=POINTS)


def metrolog() -> Export:
    head = ["Name", *(f"{axis} {what}" for axis in "XYZ" for what in ("Nom", "Act", "Dev"))]
    rows = [
        [f"Bar{m}_S{ball}", *(v for c in xyz for v in (float(round(c)), c, c - round(c)))] for m, ball, xyz in POINTS
    ]
    return Export(text([["Unit: mm"], head, *rows], "\t"), points=POINTS)


def polyworks_rows() -> Export:
    rows = [
        [f"Bar{m}_S{ball}", axis, float(round(c)), c, c - round(c)]
        for m, ball, xyz in POINTS
        for axis, c in zip("XYZ", xyz, strict=True)
    ]
    return Export(
        text([["Units: mm"], ["Object", "Control", "Nominal", "Measured", "Deviation"], *rows]), points=POINTS
    )


def pcdmis_in_italian() -> Export:
    lines = ["NOME PEZZO : BARRA", ""]
    for m, ball, xyz in POINTS:
        lines += [f"DIM POS{ball}= POSIZIONE DI SFERA M{m}_S{ball}  UNITÀ=MM",
                  "ASSE      NOMINALE       +TOL       -TOL       MISURATO           SCOST    FUORI TOL"]  # fmt: skip
        lines += [f"{axis}   {round(v):>14.4f} {0.05:10.3f} {0.05:10.3f} {v:>14.4f} {v - round(v):>15.4f}        0.000"
                  for axis, v in zip("XYZ", xyz, strict=True)]  # fmt: skip
    return Export("\r\n".join(lines).encode("cp1252"), points=POINTS)


def errors_in_french() -> Export:
    rows: list[list[object]] = [
        ["Position", "Longueur étalonnée", "Erreur d'indication", "", ""],
        ["", "(mm)", "1 (µm)", "2 (µm)", "3 (µm)"],
    ]
    rows += [[down(f"Position {i + 1}", k), NOMINAL[k], *deviations_of(i, k)] for i, k in ALL]
    return Export(
        book({"Résultats": [["Essai de longueur"], [], *rows]}, ["C3:E3"]), lengths(["Position 1", "Position 2"])
    )


def lines_side_by_side() -> Export:
    rows: list[list[object]] = [
        ["", "Position 1", "", "", "Position 2", "", ""],
        ["Nominal [mm]", *[f"Run {r + 1} [µm]" for _ in range(LINES) for r in range(RUNS)]],
    ]
    rows += [[NOMINAL[k], *(v for i in range(LINES) for v in deviations_of(i, k))] for k in range(3)]
    return Export(book({"E0": rows}, ["B1:D1", "E1:G1"]), lengths(["Position 1", "Position 2"]))


def quindos_lengths() -> Export:
    rows = [
        f"{i + 1:5d} {run + 1:5d} {NOMINAL[k]:12.4f} {measured(i, k, run):12.4f} {deviation_um(i, k, run) / 1000:10.4f}"
        for i, k in ALL
        for run in range(RUNS)
    ]
    return Export(
        "\n".join(
            [
                "  POS   RUN   NOM_LENGTH   ACT_LENGTH        DEV",
                "                    [mm]         [mm]       [mm]",
                *rows,
            ]
        ).encode(),
        lengths(TWO),
    )


def units_in_cells() -> Export:
    rows = [[i + 1, f"{NOMINAL[k]:.4f} mm", *(f"{v:.4f} mm" for v in runs_of(i, k))] for i, k in ALL]
    return Export(text([["Line", "Nominal", "Measured 1", "Measured 2", "Measured 3"], *rows], ";"), lengths(TWO))


def results_with_verdicts() -> Export:
    rows: list[list[object]] = []
    for i in range(LINES):
        rows += [[f"Pos. {i + 1}", "", "", "", ""], ["Lref (mm)", "Lmeas (mm)", "E (µm)", "MPE (µm)", "Result"]]
        rows += [[NOMINAL[k], measured(i, k, 0), deviation_um(i, k, 0), 3.5, "PASS"] for k in range(3)]
    return Export(
        text([["Acceptance test ISO 10360-2:2009"], *rows, ["Overall", "", "", "", "PASS"]], ";"),
        lengths(["Pos. 1", "Pos. 2"], 1),
    )


def spanish_points() -> Export:
    rows = [[f"Posición {m}" if ball == 1 else "", f"Esfera {ball}", *xyz] for m, ball, xyz in POINTS]
    return Export(
        text(
            [["Barra de bolas"], ["Unidades: mm"], ["Posición", "Esfera", "X medido", "Y medido", "Z medido"], *rows],
            ";",
            ",",
        ),
        points=POINTS,
    )


EXPORTS: Mapping[str, tuple[str, Callable[[], Export]]] = {
    made.__name__: (f"a.{ending}", made)
    for ending, several in {
        "txt": (
            calypso_printout, metrolog, pcdmis_in_italian, quindos_lengths,
        ),
        "csv": (
            step_gauge_table, mitutoyo, test_lengths_in_german, trials_in_inches, ball_bar_in_one_row,
            polyworks_rows, units_in_cells, results_with_verdicts, spanish_points,
        ),
        "xlsx": (
            errors_in_french, lines_side_by_side,
        ),
    }.items()
    for made in several
}  # fmt: skip
