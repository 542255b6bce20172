"""General rules of how exports are made, each on a file in another language or order than those that it was found by."""

from __future__ import annotations

import io

import numpy as np
import openpyxl
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.importing.format import ImportKeys, NotReadError
from cmm_uq.jobs.importing.lines import MeasuredLengths
from cmm_uq.jobs.importing.recording import ImportedTable, UnplacedError, imported

NOMINAL = (100.0021, 250.0043, 400.0036)
ERRORS = ((0.4, -0.3, 0.9), (1.1, 0.6, 0.8), (2.3, 1.7, 2.9))


def lengths(text: str, name: str = "x.csv") -> MeasuredLengths:
    with pytest.raises(UnplacedError) as error:
        imported(text.encode(), name, ImportKeys())
    return error.value.lengths[0]


def points(text: str) -> ImportedTable:
    return imported(text.encode(), "x.csv", ImportKeys())


def of_errors(formula: str) -> str:
    rows = [
        f"Position {p};{n};{round(a + p / 10, 1)};{round(b * p, 1)};{round(c - p / 5, 1)}"
        for p in (0, 1)
        for n, (a, b, c) in zip(NOMINAL, ERRORS, strict=True)
    ]
    return "\n".join([formula, "Position;Kalibrierwert (mm);Lauf 1 (µm);Lauf 2 (µm);Lauf 3 (µm)", *rows, ""]).replace(
        "Lauf", "Abweichung Lauf"
    )


@pytest.mark.parametrize(
    ("formula", "sign"),
    [("Abweichung = Kalibrierwert − Istwert", -1), ("Abweichung = Istwert - Kalibrierwert", 1),
     ("Fehler = Kalibrierwert - Anzeige der Maschine", -1), ("Abweichung = Zorkwert - Istwert", -1),
     ("Abweichung = Zorkwert - Kalibrierwert", 1), ("Hinweis: alle Werte bei 20 °C", 1)],
)  # fmt: skip
def test_deviations_are_the_way_round_that_the_file_says(formula: str, sign: int) -> None:
    found = lengths(of_errors(formula))
    np.testing.assert_allclose(found.measured[:3], NOMINAL[0] + sign * np.array([0.4, 0.0, 0.9]) / 1000, atol=1e-9)


def test_deviations_said_both_ways_round_are_asked_about() -> None:
    text = of_errors("Abweichung = Istwert - Kalibrierwert\nAbweichung = Kalibrierwert - Istwert")
    with pytest.raises(NotReadError, match="says that deviations are"):
        imported(text.encode(), "x.csv", ImportKeys())


def test_deviations_by_words_that_nobody_knows_are_asked_about() -> None:
    with pytest.raises(NotReadError, match="which of both was measured"):
        imported(of_errors("Abweichung = Zorkwert - Blubwert").encode(), "x.csv", ImportKeys())


def in_names(word: str) -> str:
    rows = [
        f"{line};L{k} ({word}{run});{n};{n + ERRORS[k][run - 1] / 1000:.4f}"
        for line in ("vodorovně", "svisle", "úhlopříčně")
        for k, n in enumerate(NOMINAL)
        for run in (1, 2, 3)
    ]
    return "\n".join(["Poloha;Název;Nominal;Measured", *rows, ""])


@pytest.mark.parametrize("word", ["m", "opak. ", "Wdh. "])
def test_measurements_are_counted_in_names_beside_named_lines(word: str) -> None:
    found = lengths(in_names(word))
    assert {*found.names} == {"vodorovně", "svisle", "úhlopříčně"}
    assert found.repeat[:6] == [1, 2, 3, 1, 2, 3]


def test_numbered_words_in_names_that_nobody_knows_are_asked_about() -> None:
    with pytest.raises(NotReadError, match="may count runs, or lines"):
        imported(in_names("zork ").encode(), "x.csv", ImportKeys())


BAR = "Kugelstab;{};i;j;k;L kal. (mm);Messung 1 (mm);Messung 2 (mm);Messung 3 (mm)"
WAYS = ("1;0;0", "0;1;0", "0.6;0.8;0", "0;0.6;0.8")


def bars(head: str) -> str:
    rows = [f"Lage {k};{200 + k}.0;{150 + 2 * k}.0;300.0;{way};500.0123;500.01{k}1;500.01{k}3;500.01{k}5"
            for k, way in enumerate(WAYS, 1)]  # fmt: skip
    return "\n".join([BAR.format(head), *rows, "Mittelwert;;;;;;;;500.0131;500.0133;500.0135", ""])


def test_planned_places_with_directions_beside_lengths_are_no_points() -> None:
    found = points(bars("XA;YA;ZA"))
    ends = np.column_stack([found.columns[f"{axis}_mm"] for axis in "xyz"])
    np.testing.assert_allclose(ends[0], [201, 152, 300])
    np.testing.assert_allclose(ends[1] - ends[0], [500.0111, 0, 0], atol=1e-9)
    assert "nx" not in found.columns  # directions of lines are no normals


@pytest.mark.parametrize("head", ["kalibriert;gemessen", "Sollwert;Istwert", "certified;measured"])
def test_numbered_bars_at_planned_places_are_lengths_whose_lines_are_asked_for(head: str) -> None:
    """No deviation confirms which were measured; places to 0.1 mm beside lengths to 0.1 µm are no readings."""
    ways = ("1;0;0", "0;1;0", "0;0;1") * 2
    rows = [f"{k};{100 + 31.3 * k:.1f};{200 - 7.2 * k:.1f};{-300 + 11.1 * k:.1f};{way};499.9876;499.98{k}3"
            for k, way in enumerate(ways, 1)]  # fmt: skip
    text = "\n".join([f"Kugelstab;X;Y;Z;i;j;k;{head}", *rows, ""]).replace(".", ",")
    with pytest.raises(NotReadError, match="which lengths lie on one line"):
        points(text)
    with pytest.raises(UnplacedError) as error:
        imported(text.encode(), "x.csv", ImportKeys(columns={"line": "Kugelstab"}))
    found = error.value.lengths[0]
    assert found.names == ["1", "2", "3", "4", "5", "6"]
    np.testing.assert_allclose(found.measured, [499.9813 + k / 1000 for k in range(6)])
    np.testing.assert_allclose(np.array(found.reference, dtype=float), 499.9876)


def test_what_stands_above_each_of_several_tables_is_no_point() -> None:
    tables = [
        f"titre;Plaque {plan} (mm)\nbilles;4;4\nposition;{z};140.0;120.0\nid;nom_x;nom_y;nom_z;dev_x;dev_y;dev_z\n"
        + "".join(f"{k};{100.0 + 83 * (k % 2)};{140.0 + 83 * (k // 2)};{z};0.0003;0.0007;-0.0004\n" for k in range(4))
        for plan, z in (("haute", 320.0), ("basse", 60.0))
    ]
    found = points("Unité : mm\n" + "\n".join(tables)).columns
    assert len(found["x_mm"]) == 8
    np.testing.assert_allclose([found["x_mm"][1], found["z_mm"][7]], [183.0003, 59.9996])


def test_start_and_direction_a_letter_a_cell_place_their_line() -> None:
    head = "Gerade;{}\nStart X;Y;Z;{}\nRichtung i;j;k;{}\nLauf;Nr;Referenz [mm];Messlänge [mm];E [µm]\n"
    rows = (
        "1;1;99.98087;99.98072;-0.15\n;2;200.00375;200.00357;-0.18\n2;1;99.95658;99.95649;-0.09\n;2;200.01818;200.01786;-0.32\n",
        "1;1;99.97087;99.97072;-0.15\n;2;200.01375;200.01357;-0.18\n2;1;99.96658;99.96649;-0.09\n;2;200.02818;200.02786;-0.32\n",
    )
    own = (("D1", "140.0;120.0;-640.0", "0.8;0.6;0.0"), ("X", "120.0;500.0;-350.0", "1.0;0.0;0.0"))
    found = points("\n".join(head.format(*one) + of for one, of in zip(own, rows, strict=True))).columns
    np.testing.assert_allclose(
        [found[f"{a}_mm"][1] for a in "xyz"], np.add([140, 120, -640], np.multiply([0.8, 0.6, 0], 99.98072))
    )
    assert [found["repeat"][k] for k in (0, 4)] == [1, 2]


def test_limits_called_plus_and_minus_are_no_senses_of_travel_and_form_is_no_length() -> None:
    rows = [
        f"Position {p} Block {k} Lauf {r},MM,{n},0.002,0.002,{n + ERRORS[k][r - 1] / 1000:.5f}"
        for p in (1, 2)
        for r in (1, 2, 3)
        for k, n in enumerate(NOMINAL)
    ]
    text = "\n".join(["ID,Unit,Nominal,Plus,Minus,Measured", "Ebenheit 1,MM,0,0.002,0,0.0005", *rows, ""])
    found = lengths(text)
    assert (len(found.names), found.measured[0]) == (18, pytest.approx(100.0025, abs=1e-9))


def test_distances_of_a_dmis_output_are_lengths() -> None:
    body = [
        f"T(P{p}_S{k}_R{r})=TOL/DISTB,NOMINL,{n},-0.002,0.002,PT2PT\n"
        f"TA(P{p}_S{k}_R{r})=TOL/DISTB,{n + ERRORS[k][r - 1] / 1000:.5f},INTOL,PT2PT\n"
        for p in (1, 2)
        for k, n in enumerate(NOMINAL)
        for r in (1, 2, 3)
    ]
    halves = ("TEXT/OUTFIL,'POSITION 1'\n", *body[:9], "TEXT/OUTFIL,'POSITION 2'\n", *body[9:])
    found = lengths("DMISMN/'E0',05.3\nUNITS/MM,ANGDEC\n" + "".join(halves), "x.dmo")
    assert ({*found.names}, found.repeat[:3]) == ({"POSITION 1", "POSITION 2"}, [1, 2, 3])
    assert found.measured[1] == pytest.approx(100.0018, abs=1e-9)


def test_names_of_lengths_are_not_taken_for_lines() -> None:
    """Each of them has one length alone, none says an axis, so that a line would have no other."""
    body = [
        f"T(D{axis}{n:.0f}_{r})=TOL/DISTB,NOMINL,{n},-0.002,0.002,PT2PT\n"
        f"TA(D{axis}{n:.0f}_{r})=TOL/DISTB,{n + ERRORS[k % 3][r - 1] / 1000:.5f},INTOL,PT2PT\n"
        for axis in "XY"
        for r in (1, 2, 3)
        for k, n in enumerate((60.0, 180.0, 300.0, 420.0))
    ]
    with pytest.raises(CmmUqError, match="'DX60' may name a length, and not a line"):
        lengths("DMISMN/'E0',05.3\nUNITS/MM,ANGDEC\n" + "".join(body), "x.dmo")


@pytest.mark.parametrize("unit", ['["]', "[arcsec]"])
def test_seconds_of_arc_beside_degrees_are_no_inches(unit: str) -> None:
    """A rotary table by ISO 230-2 (export as a laboratory has it): 0.11 seconds of arc were read as 2.8 mm along a line."""
    heads = ";".join(f"Jízda {run} {way} {unit}" for run in (1, 2) for way in "+-")
    rows = [f"{angle};0,{angle % 70 + 11};-0,48;-0,20;-0,81" for angle in range(0, 361, 30)]
    with pytest.raises(NotReadError, match=r"angles in ° beside readings in seconds of arc"):
        lengths(f"Otočný stůl\nPoloha [°];{heads}\n" + "\n".join(rows) + "\n")


def test_half_of_the_balls_are_no_remarks() -> None:
    """P1A and P1B of five bars: those called A were left out, and what is left was a measurement of five points."""
    balls = [
        f"FA(P{k}{end})=FEAT/SPHERE,OUTER,CART,{140 + 40 * k + dx}.0003,{150 + dy}.0002,{80 * k}.0001,25.0"
        for k in range(1, 6)
        for end, dx, dy in (("A", 0, 0), ("B", 180, 240))
    ]
    with pytest.raises(NotReadError, match="nothing says which points belong to one measurement"):
        imported(
            ("DMISMN/'E0',05.2\nUNITS/MM,ANGDEC\n" + "\n".join(balls) + "\nENDFIL\n").encode(), "b.dmo", ImportKeys()
        )


def test_places_measured_again_are_read_before_a_sheet_of_their_distances() -> None:
    at = {"A": (120.0, 80.0, 60.0), "B": (420.0, 480.0, 60.0)}
    rows = [",".join(map(str, (k, *(round(c + k / 5000, 4) for own in at.values() for c in own)))) for k in (1, 2, 3)]
    found = points("Bola A/B em mm\nRepetição,Bola A,,,Bola B,,\n,X,Y,Z,X,Y,Z\n" + "\n".join(rows) + "\n")
    xyz = np.column_stack([found.columns[f"{axis}_mm"] for axis in "xyz"])
    assert sorted(map(tuple, xyz[found.columns["repeat"] == 1].tolist())) == [
        (120.0002, 80.0002, 60.0002),
        (420.0002, 480.0002, 60.0002),
    ]


@pytest.mark.parametrize(("head", "lines"), [("Lehrring", 4), ("Endmaß", 2)])
def test_diameters_of_each_ring_are_lines_of_their_own(head: str, lines: int) -> None:
    of = [(name, way, d) for name, d in (("D40", 40.0012), ("D70", 69.9987)) for way in ("X", "Y")]
    errors = ("+0,3;-0,1;+0,4", "-0,2;-0,5;0,0", "+0,8;+1,1;+0,6", "0,0;+0,4;-0,3")
    rows = [
        f"{name};{way}-Achse;{d:.5f};{own}".replace(".", ",") for (name, way, d), own in zip(of, errors, strict=True)
    ]
    text = f"{head};Richtung;Kalibrierwert (mm);Abweichung 1 (µm);Abweichung 2 (µm);Abweichung 3 (µm)\n"
    found = lengths(text + "\n".join(rows) + "\n")
    assert len({*found.names}) == lines


def test_a_number_that_every_row_has_for_itself_counts_no_runs() -> None:
    rows = [f"E{100 + k};{name};{run};{n};{n + 1e-4 * k:.4f}" for k, (name, run, n) in enumerate(
        (name, run, n) for name in "AB" for run in (1, 2, 3) for n in NOMINAL)]  # fmt: skip
    found = lengths("\n".join(["ID_Essai;Ligne;Répétition;Longueur étalonnée [mm];Longueur mesurée [mm]", *rows, ""]))
    assert found.names == ["A"] * 9 + ["B"] * 9
    assert found.repeat == [1, 1, 1, 2, 2, 2, 3, 3, 3] * 2


def test_columns_that_are_left_out_are_named_of_every_sheet() -> None:
    book = openpyxl.Workbook()
    for number, further in ((1, ()), (2, ("Remark",))):
        sheet = book.create_sheet(f"Line {number}")
        sheet.append(["Calibrated mm", "Run 1 mm", "Run 2 mm", *further])
        for n in NOMINAL:
            sheet.append([n, n + 0.0004, n + 0.0007, *("soaked" for _ in further)])
    del book["Sheet"]
    book.save(content := io.BytesIO())
    with pytest.raises(UnplacedError) as error:
        imported(content.getvalue(), "x.xlsx", ImportKeys())
    assert error.value.recognised.data["not_used"] == "Remark"
