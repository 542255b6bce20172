"""What stands around observations is none of them: titles, results and remarks; and what formats call lengths."""

from __future__ import annotations

import io

import numpy as np
import openpyxl
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.importing.format import ImportKeys, NotReadError
from cmm_uq.jobs.importing.lines import MeasuredLengths, UnplacedRunsError
from cmm_uq.jobs.importing.recording import ImportedTable, UnplacedError, imported

TARGETS = (0, 1000, 2000)
RUNS = ((-1.1, 0.4, 6.6), (1.0, 2.5, 8.0), (-2.1, 0.1, 6.0), (1.5, 2.7, 8.1))


def lengths(text: str, name: str = "x.csv") -> MeasuredLengths:
    with pytest.raises(UnplacedError) as error:
        imported(text.encode(), name, ImportKeys())
    return error.value.lengths[0]


def runs(text: str, axis: str, name: str = "x.csv") -> ImportedTable:
    with pytest.raises(UnplacedRunsError) as error:
        imported(text.encode(), name, ImportKeys())
    assert error.value.names == [axis]
    return imported(text.encode(), name, ImportKeys(lines={axis: f"along {axis} from 0,0,0"}))


def told(table: ImportedTable, key: str) -> str:
    return next((str(fact.value) for fact in table.recognised.facts if fact.key == key), "")


@pytest.mark.parametrize("title", ["ISO 230-2 X axis;machine M 12;laser XL-80", "Machine M 12;tested by A. B."])
def test_a_row_of_titles_with_separators_is_no_part_of_the_head(title: str) -> None:
    rows = [f"{k // 2 + 1};{'+-'[k % 2]};{t};{v}" for k, run in enumerate(RUNS)
            for t, v in list(zip(TARGETS, run, strict=True))[:: 1 - 2 * (k % 2)]]  # fmt: skip
    text = "\n".join(["Axis X", title, "Run;Direction;Target mm;Deviation um", *rows, ""])
    found = runs(text, "X")
    np.testing.assert_allclose(found.columns["reading_um"][:6], [-1.1, 0.4, 6.6, 8.0, 2.5, 1.0])


def test_targets_in_a_row_with_thousands_and_means_below_their_runs() -> None:
    named = [("1", "↑"), ("", "↓"), ("2", "↑"), ("", "↓")]
    rows = [
        f"{n};{way};" + ";".join(f"{v:.1f}".replace(".", ",") for v in run)
        for (n, way), run in zip(named, RUNS, strict=True)
    ]
    means = [np.mean(RUNS[k::2], axis=0) for k in (0, 1)]
    below = [
        f"x̄{way};;" + ";".join(f"{v:.2f}".replace(".", ",") for v in own) for way, own in zip("↑↓", means, strict=True)
    ]
    head = "Run;Richting;" + ";".join(("0,000", "1.000,000", "2.000,000"))
    found = runs(
        "\n".join(["Positioneerafwijking Y-as", ";;Doelpositie (mm)", head, ";;afwijking in µm", *rows, *below, ""]),
        "Y",
    )
    assert (len(found.lines), {*found.columns["y_mm"].tolist()}) == (12, {0.0, 1000.0, 2000.0})
    assert sorted(found.columns["reading_um"].tolist()) == sorted(v for run in RUNS for v in run)


def of_styli(result: str) -> str:
    rng = np.random.default_rng(1)
    rows = []
    for stylus in ("A0 B0", "A90 B0"):
        way = rng.normal(size=(6, 3))
        xyz = (300, 200, 100) + 12.5 * way / np.linalg.norm(way, axis=1)[:, None]
        rows += [";".join([stylus if k == 1 else "", str(k), *(f"{c:.4f}" for c in p)]) for k, p in enumerate(xyz, 1)]
        rows += [f"{stylus} merkez;;300.0002;199.9998;{100.0001 if result else ''}", f"{stylus} çap;;24.9998;1.4"]
    return "\n".join(["Uç;Nokta;X (mm);Y (mm);Z (mm)", *rows, ""])


@pytest.mark.parametrize("result", ["place", ""])
def test_a_centre_and_a_diameter_below_numbered_points_are_left_out_and_told(result: str) -> None:
    found = imported(of_styli(result).encode(), "x.csv", ImportKeys())
    assert len(found.lines) == 12
    assert all(f"line {line}" in told(found, "left_out") for line in (8, 9, 16, 17))


def test_a_length_with_a_word_in_place_of_one_reading_loses_that_reading_alone() -> None:
    rows = [f"{line};{n};{n + 0.0004 + k / 10000:.4f};{n - 0.0003 * k:.4f};"
            f"{'n/d' if (line, n) == ('Z', 400.0) else f'{n + 0.0009 - k / 5000:.4f}'}"
            for k, line in enumerate("XYZ") for n in (100.0, 250.0, 400.0)]  # fmt: skip
    found = lengths("\n".join(["Axe;Valeur étalon (mm);Lecture 1 (mm);Lecture 2 (mm);Lecture 3 (mm)", *rows, ""]))
    assert len(found.names) == 26


def test_rows_of_words_between_figures_and_runs_there_and_back_in_heads() -> None:
    each = [(100.0, 0.4, 0.9, 0.1, 0.8), (250.0, -0.2, 0.3, -0.6, 0.5), (400.0, 1.1, 1.9, 0.7, 1.4)]
    text = "Laengen in MM   Abweichungen in UM    H = Hinlauf  R = Ruecklauf\n"
    for p, line in enumerate(("LINIE 1 : XPAR", "LINIE 2 : YPAR")):
        text += f"\n {line}  ( 1.000  0.000  0.000)\n  ST  KALIBRIERWERT      H1      R1      H2      R2\n"
        text += "".join(
            f"{k:4d} {row[0]:14.5f}" + "".join(f"{v + p * (k - 1.5):8.2f}" for v in row[1:]) + "\n"
            for k, row in enumerate(each, 1)
        )
        text += "      GESAMT        MIN  -0.60  MAX    1.90   GRENZE 1.1 + L/800\n"
    found = lengths(text, "x.lis")
    assert ({*found.repeat}, len({*found.names})) == ({1, 2, 3, 4}, 2)
    assert found.measured[:4] == pytest.approx([100.0004, 100.0009, 100.0001, 100.0008], abs=1e-9)
    assert len(found.left_out) >= 2


def test_errors_relative_to_the_length_are_of_it() -> None:
    rows = [
        f"{axis};{n};{a + k / 5:.2f};{b - k * n:.2f}"
        for k, axis in enumerate("XY")
        for n, a, b in ((0.4, 1.07, 2.61), (0.8, 2.03, -2.42), (1.2, 2.35, 1.68))
    ]
    found = lengths("\n".join(["轴;标称长度/m;相对示值误差/ppm 第1次;相对示值误差/ppm 第2次", *rows, ""]))
    assert found.measured[:4] == pytest.approx([400.000428, 400.001044, 800.001624, 799.998064], abs=1e-9)


QIF = """<?xml version="1.0"?><QIFDocument xmlns="http://qifstandards.org/xsd/qif3" versionQIF="3.0.0">
<FileUnits><PrimaryUnits><LinearUnit><SIUnitName>meter</SIUnitName><UnitName>mm</UnitName>
<UnitConversion><Factor>0.001</Factor></UnitConversion></LinearUnit></PrimaryUnits></FileUnits><Characteristics><CharacteristicNominals>{nominals}</CharacteristicNominals>
<CharacteristicItems>{items}</CharacteristicItems></Characteristics><MeasurementsResults>{runs}</MeasurementsResults></QIFDocument>"""


def test_length_characteristics_of_qif_are_lengths() -> None:
    known = {1: 40.0, 2: 100.0, 3: 200.0}
    nominals = "".join(f'<LengthCharacteristicNominal id="{k}"><TargetValue>{v}</TargetValue></LengthCharacteristicNominal>'
                       for k, v in known.items())  # fmt: skip
    items = "".join(f'<LengthCharacteristicItem id="{k}{p}"><Name>GB{v:.0f}_{"AB"[p]}</Name>'
                    f"<CharacteristicNominalId>{k}</CharacteristicNominalId></LengthCharacteristicItem>"
                    for k, v in known.items() for p in (0, 1))  # fmt: skip
    each = "".join(
        f'<MeasurementResults id="9{run}"><Name>Run {run}</Name><MeasuredCharacteristics><CharacteristicMeasurements>'
        + "".join(f'<LengthCharacteristicMeasurement id="8{run}{k}{p}"><CharacteristicItemId>{k}{p}</CharacteristicItemId>'
                  f"<Value>{v + run / 10000 + p / 1000:.4f}</Value></LengthCharacteristicMeasurement>"
                  for k, v in known.items() for p in (0, 1))
        + "</CharacteristicMeasurements></MeasuredCharacteristics></MeasurementResults>" for run in (1, 2)
    )  # fmt: skip
    found = lengths(QIF.format(nominals=nominals, items=items, runs=each), "x.qif")
    assert ({*found.names}, {*found.repeat}) == ({"A", "B"}, {1, 2})
    assert found.reference[:2] == [40.0, 40.0]
    assert found.measured[:2] == pytest.approx([40.0001, 40.0011], abs=1e-9)


def test_a_form_beside_distances_of_pc_dmis_is_no_length() -> None:
    def dimension(name: str, of: str, nominal: float, measured: float) -> str:
        return (f"DIM {name}= {of}  UNITS=MM\nAX     NOMINAL      +TOL      -TOL      MEAS       DEV    OUTTOL\n"
                f"M   {nominal:10.4f}    0.0020    0.0020{measured:10.4f}{measured - nominal:10.4f}    0.0000\n")  # fmt: skip

    body = [dimension(f"P{p}_L{k}_R{r}", "3D DISTANCE FROM POINT A TO POINT B", 100.0 * k, 100.0 * k + r / 10000)
            for p in (1, 2) for k in (1, 2, 3) for r in (1, 2)]  # fmt: skip
    body += [dimension("FORM1", "SPHERICITY OF SPHERE SPH_REF", 0.0, 0.0013)]
    found = lengths("PART NAME  : E0\n\n" + "".join(body), "x.txt")
    assert ({*found.names}, len(found.names)) == ({"P1", "P2"}, 12)


def test_tolerances_of_a_dmis_output_with_names_of_their_own_are_found_by_their_distance() -> None:
    text = "DMISMN/'E0',05.3\nUNITS/MM,ANGDEC\n"
    text += "".join(f"T(T_L{k})=TOL/DISTB,NOMINL,{120.0 * k},-0.002,0.002,PT2PT\n" for k in (1, 2, 3))
    for line in (1, 2):
        text += f"TEXT/OUTFIL,'LINE {line}'\n"
        for run in (1, 2):
            for k in (1, 2, 3):
                at = f"{100 + 120.0 * k + run / 10000:.4f}"
                text += f"FA(L{line}R{run}_P{k})=FEAT/POINT,CART,{at},200.001,-399.9995,1.0,0.0,0.0\n"
                text += f"TA(L{line}R{run}_D{k})=TOL/DISTB,{120 * k + run / 10000:.5f},INTOL\n"
    found = lengths(text, "x.dmo")
    assert ({*found.names}, {*found.repeat}, len(found.names)) == ({"LINE 1", "LINE 2"}, {1, 2}, 12)
    assert found.reference[1] == 240.0
    with pytest.raises(CmmUqError, match="has no nominal distance"):
        imported(text.replace("D3)=TOL/DISTB,360", "D3)=TOL/DISTB,365").encode(), "x.dmo", ImportKeys())


def test_a_laser_run_by_numbers_of_targets() -> None:
    rows = [f"{k + 1:3d} {i + 1:5d}     {'+-'[k % 2]}  {run[i]:8.2f}" for k, run in enumerate(RUNS)
            for i in list(range(3))[:: 1 - 2 * (k % 2)]]  # fmt: skip
    text = ("HEADER:: LASER DATA\nFile-Type: Linear\nAxis: Y\nLocation: X315 Z400\n\nTARGETS::\nTarget-Count: 3\n"
            "    0.0000   1000.0000   2000.0000\n\nDATA::\nRun  Target   Dir      Error\n" + "\n".join(rows)
            + "\n\nSTATISTICS:: ISO 230-2\nE: 9.41  M: 7.27\nEOF\n")  # fmt: skip
    found = imported(text.encode(), "x.rtl", ImportKeys(lines={"Y": "along Y from 315,0,400"}))
    np.testing.assert_allclose(found.columns["reading_um"][3:6], [8.0, 2.5, 1.0])
    assert {*found.columns["approach_y"].tolist()} == {1.0, -1.0}


def lines_of(head: str, row: str, count: int = 3) -> str:
    """A table of three lengths on lines; ``row``: of line p, length n and two readings a, b."""
    rng = np.random.default_rng(7)
    rows = [row.format(p=p, n=n, a=n + rng.normal(0, 0.001), b=n + rng.normal(0, 0.001), d=rng.normal(0, 0.001))
            for p in range(1, count + 1) for n in (100.0021, 250.0043, 400.0036)]  # fmt: skip
    return "\n".join([head, *rows, ""])


def test_runs_there_and_back_are_runs() -> None:
    found = lengths(lines_of("Linie;Kalibriert (mm);Hin 1;Rück 1", "{p};{n:.4f};{a:.4f};{b:.4f}"))
    assert ({*found.repeat}, {*found.names}) == ({1, 2}, {"1", "2", "3"})


def test_what_was_found_and_what_was_left_are_two_recordings() -> None:
    with pytest.raises(NotReadError, match="before and after it was adjusted"):
        imported(
            lines_of("Line;Cal. length mm;As found;As left", "{p};{n:.4f};{a:.4f};{b:.4f}").encode(),
            "x.csv",
            ImportKeys(),
        )


def test_the_finer_column_that_never_changes_is_calibrated() -> None:
    found = lengths(lines_of("Line;Nominal mm;Actual;Run1;Run2", "{p};{n:.0f};{n:.4f};{a:.4f};{b:.4f}"))
    assert found.reference[:3] == [100.0021, 100.0021, 250.0043]
    assert {*found.repeat} == {1, 2}


def test_what_was_measured_less_its_deviation_is_the_reference() -> None:
    rows = [f"L{p};{n + e:.4f};{e:.4f}" for p, own in enumerate(((0.0012, -0.0004, 0.0021), (0.0003, 0.0015, -0.0008)), 1)
            for n, e in zip((100.0021, 250.0043, 400.0036), own, strict=True)]  # fmt: skip
    found = lengths("\n".join(["Line;Measured mm;Deviation mm", *rows, ""]))
    assert found.reference == [100.0021, 250.0043, 400.0036] * 2
    without = "\n".join(row.rsplit(";", 1)[0] for row in ["Line;Measured mm;Deviation mm", *rows])
    with pytest.raises(NotReadError, match="of several sizes"):
        imported(f"{without}\n".encode(), "x.csv", ImportKeys())


def test_lines_may_be_told_by_their_direction_alone() -> None:
    ways = {1: "1;0;0", 2: "0;1;0", 3: "0.577;0.577;0.577"}
    text = lines_of("#;i;j;k;L_cal [mm];E1 [µm];E2 [µm]", "{p};WAY{p};{n:.4f};{d:.5f}00;{a:.2f}")
    rows = [text.splitlines()[0]]
    for k, (p, n) in enumerate([(p, n) for p in ways for n in (100.0021, 250.0043, 400.0036)], 1):
        rows.append(f"{k};{ways[p]};{n};{0.3 * k % 1.1:.2f};{0.7 * k % 1.3:.2f}")
    found = lengths("\n".join([*rows, ""]))
    assert [len({*found.names}), {*found.repeat}] == [3, {1, 2}]
    assert all(name.startswith("direction (") for name in found.names)
    twice = [
        f"{k};1;0;0;{n};{0.3 * k % 1.1:.2f};{0.7 * k % 1.3:.2f}" for k, n in enumerate((100.0021, 250.0043) * 3, 1)
    ]
    with pytest.raises(NotReadError, match="which lengths lie on one line"):  # parallel lines, for all that is known
        imported("\n".join([rows[0], *twice, *rows[4:7], ""]).encode(), "x.csv", ImportKeys())


def test_positions_beside_targets_need_no_word() -> None:
    rng = np.random.default_rng(3)
    rows = [f"X\t{run}\t{way}\t{t:.3f}\t{t + rng.normal(2, 0.5) / 1000:.5f}" for run in (1, 2) for way in "FR"
            for t in sorted((0.0, 100.0, 200.0, 300.0), reverse=way == "R")]  # fmt: skip
    found = runs("\n".join(["Axis\tRun\tDir\tPos (mm)\tLaser (mm)", *rows, ""]), "X", "x.txt")
    assert {*found.columns["x_mm"].tolist()} == {0.0, 100.0, 200.0, 300.0}
    assert np.abs(found.columns["reading_um"] - 2).max() < 2.5


def test_numbers_in_attributes_of_xml_count_what_their_elements_are() -> None:
    body = "".join(
        f"<Position nr='{p}'>" + "".join(f"<Length nominal='{n}'>" + "".join(
            f"<Trial n='{r}'>{n + (p - 2 * r) / 10000:.4f}</Trial>" for r in (1, 2)) + "</Length>"
            for n in (100.0, 250.0, 400.0))
        + "</Position>" for p in (1, 2, 3))  # fmt: skip
    with pytest.raises(UnplacedError) as error:
        imported(f"<?xml version='1.0'?>\n<Report>{body}</Report>".encode(), "x.xml", ImportKeys(unit="mm"))
    found = error.value.lengths[0]
    assert ({*found.names}, {*found.repeat}) == ({"1", "2", "3"}, {1, 2})


def test_results_by_words_that_nobody_knows_below_runs() -> None:
    rows = [
        f"{i + 1};{t};" + ";".join(f"{run[i]:.1f}".replace(".", ",") for run in RUNS) for i, t in enumerate(TARGETS)
    ]
    head = "i;Sollposition;1 auf;1 ab;2 auf;2 ab"
    text = "\n".join(
        ["Achse: Y;;;Einheit: µm", head, ";mm;;;;", *rows, "Blubgenauigkeit A;;5,2", "Zorkspanne;;0,9", ""]
    )
    found = runs(text, "Y")
    assert sorted(found.columns["reading_um"].tolist()) == sorted(v for run in RUNS for v in run)
    assert "Blubgenauigkeit" in told(found, "left_out")


def test_tabs_in_every_line_part_its_cells_and_blanks_do_not() -> None:
    rows = [f"{n:.5f}\t0.15\t{n + e:.5f}\t{e:.5f}\t{line}\t{run}" for line in "XYZ" for n in (20.00013, 60.00021, 100.00008)
            for run, e in ((1, 0.00037 + n / 1e5), (2, 0.00073 - n / 1e6))]  # fmt: skip
    found = lengths("\n".join(["L cal [mm]\tU cal [µm]\tL ind [mm]\tE [mm]\tDirection\tSeries", *rows, ""]), "x.txt")
    assert ({*found.names}, {*found.repeat}) == ({*"XYZ"}, {1, 2})


def test_figures_that_count_parts_of_a_unit_are_refused() -> None:
    rows = [
        f"{t};{int(run_a)};{int(run_b)}" for t, run_a, run_b in zip(TARGETS, (0, 24, 35), (-5, 29, 39), strict=True)
    ]
    with pytest.raises(NotReadError, match="parts or multiples of a unit"):
        imported("\n".join(["Axis X", "Target [mm];+ [0,1 µm];- [0,1 µm]", *rows, ""]).encode(), "x.csv", ImportKeys())


def test_lengths_that_a_laser_measures_anew_on_each_sheet_are_of_lines_by_sheet() -> None:
    book = openpyxl.Workbook()
    book.remove(book.active)
    for p, line in enumerate("XYZ", 1):
        sheet = book.create_sheet(f"Pos {p}")
        sheet.append([f"Position {p} : {line}"])
        sheet.append(["Longueur de référence laser (mm)", "Ecart = MMT - laser (µm)"])
        sheet.append([None, "n°1", "n°2", "n°3"])
        for k, n in enumerate((100, 300, 500)):
            noise = [round(0.37 * (p + 2 * k + 3 * r) % 0.7 - 0.3, 2) for r in range(3)]
            sheet.append([round(n + 0.013 * (2 * p + k) % 0.03, 4), *noise])
    out = io.BytesIO()
    book.save(out)
    with pytest.raises(UnplacedError) as error:
        imported(out.getvalue(), "x.xlsx", ImportKeys())
    found = error.value.lengths[0]
    assert ({*found.names}, {*found.repeat}) == ({"Pos 1", "Pos 2", "Pos 3"}, {1, 2, 3})


def test_a_point_whose_name_is_of_another_form_is_asked_about() -> None:
    rows = [f"BAR_{m:02d}::{end}_F{face},{100.0 * m + face / 1000:.4f},{400.0 * (end == 'B'):.4f},{-50.0 + m:.4f}"
            for m in range(1, 9) for end in "AB" for face in (1, 2)]  # fmt: skip
    head = "Units: mm\nName,X,Y,Z\n"
    found = imported((head + "\n".join(rows) + "\n").encode(), "x.csv", ImportKeys())
    assert len({*found.columns["measurement"].tolist()}) == 8
    text = head + "\n".join([*rows[:16], "Drift::D1,1204.3310,3341.2207,-118.0041", *rows[16:]])
    with pytest.raises(NotReadError, match="which points belong to one measurement"):
        imported(f"{text}\n".encode(), "x.csv", ImportKeys())


def test_the_head_of_a_page_within_a_table_is_no_head_of_it() -> None:
    each = [
        f" KUG({k:2d}) {133.0 * (k % 4) + 0.0002:12.5f} {133.0 * (k // 4):12.5f} {0.0004:10.5f} {22.0003:9.5f}"
        for k in range(16)
    ]
    head = " NAM            X           Y           Z          D"
    page = " QUINDOS 7              PROTOKOLL           Seite   {}"
    lines = [
        page.format(1),
        " Einheit: MM",
        "",
        head,
        *each[:8],
        " -----------------------------",
        page.format(2),
        "",
        *each[8:],
    ]
    found = imported("\n".join([*lines, ""]).encode(), "x.txt", ImportKeys())
    assert len(found.lines) == 16


def test_a_statement_of_dmis_may_go_on_behind_two_signs() -> None:
    text = "DMISMN/'P',05.3\nUNITS/MM,ANGDEC\n" + "".join(
        f"FA(S{k})=FEAT/SPHERE,CART,$$\n   {100.0 * k:.4f},{k / 1000:.4f},0.0002,$$\n 25.4001\n" for k in range(1, 5)
    )
    found = imported(text.encode(), "x.dmo", ImportKeys(points_per_measurement="all"))
    assert found.columns["x_mm"].tolist() == [100.0, 200.0, 300.0, 400.0]


def test_runs_along_the_diagonal_of_a_cube_are_placed() -> None:
    rows = [f"{k // 2 + 1};{'+-'[k % 2]};{t};{v}" for k, run in enumerate(RUNS)
            for t, v in list(zip(TARGETS, run, strict=True))[:: 1 - 2 * (k % 2)]]  # fmt: skip
    text = "\n".join(["Axis X", "Run;Direction;Target mm;Deviation um", *rows, ""])
    found = imported(text.encode(), "x.csv", ImportKeys(lines={"X": "from 0,0,0 to 500,500,500"}))
    np.testing.assert_allclose(found.columns["z_mm"][:3], np.array(TARGETS) / 3**0.5, atol=1e-6)
