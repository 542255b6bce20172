"""Arrangements of tables of lengths and runs, each with what its figures say."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.importing.factors import ways_of
from cmm_uq.jobs.importing.format import ImportKeys
from cmm_uq.jobs.importing.lines import MeasuredLengths
from cmm_uq.jobs.importing.recording import ImportedTable, UnplacedError, imported

LENGTHS = (30.0004, 120.0007, 240.0001, 390.0012)


def error(line: int, k: int, run: int) -> float:
    """Deviation in µm."""
    return ((37 * line + 11 * k + 23 * run + 5 * line * k) % 29 - 14) / 10


def measured(line: int, k: int, run: int) -> str:
    return f"{LENGTHS[k] + error(line, k, run) / 1000:.4f}"


def lengths_of(rows: list[str], delimiter: str = ";") -> MeasuredLengths:
    content = "\n".join(row.replace(";", delimiter) for row in rows) + "\n"
    with pytest.raises(UnplacedError) as asked:
        imported(content.encode(), "e0.csv", ImportKeys())
    (found,) = asked.value.lengths
    return found


def read(found: MeasuredLengths) -> list[list[tuple[float, int, float]]]:
    """Reference, run and measured length of each length, by line."""
    lines: dict[str, list[tuple[float, int, float]]] = {}
    for name, of, run, value in zip(found.names, found.reference, found.repeat, found.measured, strict=True):
        lines.setdefault(name, []).append((round(of or 0.0, 4), run, round(value, 4)))
    return [sorted(own) for own in lines.values()]


def expected(lines: int, runs: int = 3) -> list[list[tuple[float, int, float]]]:
    return [
        sorted((LENGTHS[k], r + 1, float(measured(i, k, r))) for k in range(len(LENGTHS)) for r in range(runs))
        for i in range(lines)
    ]


def test_numbers_of_lengths_are_no_lines_though_they_are_called_positions() -> None:
    rows = []
    for i, chosen in enumerate(((0, 1, 2), (0, 1, 3))):
        rows += [f"Messlinie {i + 1}", "Pos.;Kalibrierwert;1. Messung;2. Messung;Abw. 1;Abw. 2", ";mm;mm;mm;µm;µm"]
        for n, k in enumerate(chosen):
            each = (measured(i, k, 0), measured(i, k, 1), f"{error(i, k, 0):.1f}", f"{error(i, k, 1):.1f}")
            rows.append(f"{n + 1};{LENGTHS[k]};{';'.join(each)}")
    assert [len(own) for own in read(lengths_of(rows))] == [6, 6]


@pytest.mark.parametrize(
    "title",
    ["POSITION {i}   RUN {r}", "Run {r} - Position {i}", "*** Line {i} (repeat {r} of 3) ***", "Position {i} ({r}/3)",
     "Messlinie {i}, Wiederholung Nr. {r}", "{r}. Lauf, Position {i}", "【測定位置 {i}】 {r}回目", "测量线{i} 第{r}次",
     "Posizione {i} : prova n° {r}", "POS{i}-RUN{r}", "Line {i}, measurement {r}",
     "Line {i}, run {r}, 12.03.2019 08:1{r}", "Position {i}, run {r}, file 0{i}{r}7"],
)  # fmt: skip
def test_a_run_in_a_title_beside_the_name_of_a_line_is_a_run(title: str) -> None:
    rows = ["Unit: mm"]
    for i in range(2):
        for r in range(3):
            each = (f"{k + 1};{LENGTHS[k]};{measured(i, k, r)};{error(i, k, r) / 1000:.4f}" for k in range(4))
            rows += [title.format(i=i + 1, r=r + 1), "No;Nominal;Actual;Deviation", *each, "Max. dev. (abs);;;0.0014"]
    assert read(lengths_of(rows)) == expected(2)


def test_each_word_of_a_head_is_over_its_part_of_what_stands_below_it() -> None:
    rows = ["Pos/Step/Rep;Nominal (mm);Measured (mm)"]
    rows += [
        f"{i + 1}/{k + 1}/{r + 1};{LENGTHS[k]};{measured(i, k, r)}"
        for i in range(2)
        for k in range(4)
        for r in range(3)
    ]
    assert read(lengths_of(rows)) == expected(2)


def test_columns_called_m_are_runs_beside_a_column_of_lines_and_letters_behind_names_are_asked_about() -> None:
    rows = ["Line,Cal (mm),M1 (mm),M2 (mm),M3 (mm),2s (µm)"]
    rows += [
        f"{i + 1},{LENGTHS[k]},{','.join(measured(i, k, r) for r in range(3))},0.8" for i in range(2) for k in range(4)
    ]
    assert read(lengths_of(rows)) == expected(2)
    each = [(i, k, r) for i in range(2) for k in range(4) for r in range(3)]
    named = [f"{'XY'[i]}_{k + 1}_{'abc'[r]};{LENGTHS[k]};{measured(i, k, r)}" for i, k, r in each]
    with pytest.raises(CmmUqError, match="letters in names may be of runs or lines"):
        imported("\n".join(["Feature;Nominal [mm];Actual [mm]", *named]).encode(), "e0.csv", ImportKeys())


def test_what_is_permitted_and_what_is_not_corrected_are_no_deviations_and_no_lengths() -> None:
    rows = ["Linie;Lauf;Kalibrierlänge;Messwert unkorrigiert;Messwert korrigiert;Abweichung µm;zulässige Abweichung µm"]
    for i in range(2):
        for r in range(3):
            for k, length in enumerate(LENGTHS):
                own = measured(i, k, r)
                each = (f"{float(own) + length * 8e-6:.4f}", own, f"{error(i, k, r):.1f}", f"{2 + length / 300:.1f}")
                rows.append(f"{i + 1};{r + 1};{length};{';'.join(each)}")
    assert read(lengths_of(rows)) == expected(2)


@pytest.mark.parametrize(
    ("words", "known"),
    [
        ("Line;Run;Calibrated;Measured", False),
        ("Linie;Lauf;Kalibriert;Messwert", True),
        ("測定線;回;校正値;測定値", True),
    ],
)
def test_a_language_whose_speakers_measure_in_mm_says_the_unit(words: str, known: bool) -> None:
    rows = [words] + [
        f"{i + 1};{r + 1};{LENGTHS[k]};{measured(i, k, r)}" for i in range(2) for k in range(4) for r in (0, 1)
    ]
    with pytest.raises(CmmUqError, match="nothing says where" if known else "may be in mm or in inch"):
        imported("\n".join(rows).encode(), "e0.csv", ImportKeys())


def test_references_that_are_measured_anew_each_time_are_of_one_length() -> None:
    rows = ["Pos.;Longitud nominal (mm);Repetición;Longitud láser (mm);Lectura MMC (mm);Error (µm)"]
    for i in range(3):
        for k, nominal in enumerate((200, 550, 900)):
            for r in range(3):
                laser = nominal + ((7 * i + 5 * k + 3 * r) % 11 - 5) / 500 + i / 10000
                rows.append(
                    f"{i + 1};{nominal};{r + 1};{laser:.4f};{laser + error(i, k, r) / 1000:.4f};{error(i, k, r):.1f}"
                )
    found = read(lengths_of(rows))
    assert [len(own) for own in found] == [9, 9, 9]
    assert [sorted(run for _, run, _ in own) for own in found] == [[1, 1, 1, 2, 2, 2, 3, 3, 3]] * 3


def test_lines_by_number_and_name_side_by_side_are_read_all_or_none() -> None:
    names = ("X-Achse", "Y-Achse", "Z-Achse", "Raumdiag. 1", "Raumdiag. 2", "Raumdiag. 3")
    numbers = ";".join(str(i + 1) for i in range(len(names)))
    rows = ["Abweichung in µm;;;Prüflage", f"Nr.;Kalibrierte Länge [mm];Wdh.;{numbers}", f";;;{';'.join(names)}"]
    for k, length in enumerate(LENGTHS):
        for r in range(3):
            own = ";".join(f"{error(i, k, r):.1f}" for i in range(len(names)))
            rows.append(f"{k + 1 if r == 0 else ''};{length if r == 0 else ''};{r + 1};{own}")
    assert read(lengths_of(rows)) == expected(len(names))


def test_rows_of_errors_below_those_of_lengths_are_no_lengths() -> None:
    rows = [
        "단위;mm (오차 μm)",
        f"구분;위치;회차;{';'.join(f'{v:.0f}.0' for v in LENGTHS)}",
        f"교정값;;;{';'.join(map(str, LENGTHS))}",
    ]
    for i, name in enumerate(("X축", "Y축", "Z축", "대각선")):
        for r in range(3):
            first = (name, "Y=500 Z=300" if i == 0 else f"X={i} Z=300", f"{r + 1}") if r == 0 else ("", "", f"{r + 1}")
            rows.append(";".join((*first, *(measured(i, k, r) for k in range(4)))))
            rows.append(";".join(("", "", "오차", *(f"{error(i, k, r):.1f}" for k in range(4)))))
    assert read(lengths_of(rows)) == expected(4)


def test_whole_places_of_balls_are_where_the_lengths_beside_them_lie() -> None:
    rows = [
        "Stav: 700 mm, kalibrerad längd 700,0124 mm",
        "Läge;Kula A X;Kula A Y;Kula A Z;Kula B X;Kula B Y;Kula B Z;Längd 1 (mm);Längd 2 (mm)",
    ]
    places = ((150, 300, 200, 850, 300, 200), (300, 200, 400, 300, 900, 400), (500, 600, 50, 500, 600, 750))
    rows += [f"{i + 1};{';'.join(map(str, at))};700,01{30 + i};700,01{40 - i}" for i, at in enumerate(places)]
    found = imported("\n".join([*rows, ""]).encode(), "e0.csv", ImportKeys())
    assert found.places["2"] == "from 300,200,400 to 300,900,400"
    assert {*found.columns["reference_mm"].tolist()} == {0.0, 700.0124}
    assert len(found.lines) == 2 * 6


@pytest.mark.parametrize("off", [0.0, 0.0071])
def test_deviations_from_the_mean_of_all_are_of_no_calibrated_length(off: float) -> None:
    values = [round(450.0123 + ((13 * k) % 17 - 8) / 10000, 4) for k in range(17)]
    base = round(float(np.mean(values)) + off, 4)
    rows = ["Pos;Measured length (mm);Dev. (µm)"] + [
        f"{k + 1};{v:.4f};{(v - base) * 1000:.1f}" for k, v in enumerate(values)
    ]
    assert {*lengths_of(rows).reference} == ({base} if off else {None})


def test_tables_side_by_side_below_rows_of_temperatures() -> None:
    rows = ["Norm;eindmatenset;;;;;Temp. °C;20.4"]
    head = "Eindmaat;Meting 1;Meting 2;Gem.;Afw. µm"
    for i in (0, 2):
        rows += [f"Positie {i + 1};;;;;;Positie {i + 2}", f"{head};;{head}"]
        for k, length in enumerate(LENGTHS):
            halves = []
            for line in (i, i + 1):
                own = [float(measured(line, k, r)) for r in range(2)]
                halves.append(
                    f"{length};{own[0]:.4f};{own[1]:.4f};{np.mean(own):.5f};{(np.mean(own) - length) * 1000:.2f}"
                )
            rows.append(";;".join(halves))
    assert sorted(read(lengths_of(rows))) == sorted(expected(4, 2))


@pytest.mark.parametrize(
    ("heads", "ways"),
    [
        (("1F", "1B", "2F", "2B"), [1, -1, 1, -1]),
        (("vorw.", "rückw."), [1, -1]),
        (("Cykl 1 ->", "Cykl 1 <-"), [1, -1]),
        (("R1", "M1"), None),
        (("A", "B"), None),
        (("1R", "2R"), None),
    ],
)
def test_senses_of_travel_by_letters_arrows_and_words_cut_short(heads: tuple[str, ...], ways: list[int] | None) -> None:
    assert ways_of(heads) == ways


def runs_of(text: str, **lines: str) -> ImportedTable:
    return imported(text.encode(), "runs.csv", ImportKeys.model_validate({"lines": lines}))


def test_each_axis_of_a_file_has_its_title_and_place() -> None:
    rows = ["単位:μm"]
    for axis, place in (("X", "Y=-275 Z=-200"), ("Y", "X=450 Z=-200"), ("Z", "X=450 Y=-275")):
        rows += [f"{axis}軸,測定線 {place}", "目標位置(mm),正1,負1,正2,負2"]
        rows += [f"{100 * k},{k / 10 + 0.3},{k / 10 - 0.4},{k / 10 + 0.2},{k / 10 - 0.1}" for k in range(6)]
    found = runs_of("\n".join([*rows, ""]))
    assert found.places == {
        "X": "along X from 0,-275,-200",
        "Y": "along Y from 450,0,-200",
        "Z": "along Z from 450,-275,0",
    }
    assert [int(sum(found.columns["measurement"] == k)) for k in (1, 2, 3)] == [24, 24, 24]


def test_deviations_in_the_one_unit_of_a_file_that_names_it_beside_others() -> None:
    rows = ["UNIT: INCH;TEMP(F);70.3;PRESS(inHg);29.87", "NO;POSITION;1F;1B;2F;2B"]
    there = [[k * 3e-5 + ((7 * k + 5 * r) % 11) * 1e-6 for k in range(9)] for r in range(2)]
    back = [[k * 3e-5 + 8e-5 + ((5 * k + 3 * r) % 13) * 1e-6 for k in range(9)] for r in range(2)]
    each = (f"{there[0][k]:.6f};{back[0][k]:.6f};{there[1][k]:.6f};{back[1][k]:.6f}" for k in range(9))
    rows += [f"{k + 1};{2 * k:.4f};{own}" for k, own in enumerate(each)]
    with pytest.raises(CmmUqError, match="nothing says where line"):
        runs_of("\n".join([*rows, ""]))
    found = runs_of("\n".join([*rows, ""]), **{"1": "along Y from 0,0,0"})
    assert found.columns["y_mm"].max() == pytest.approx(16 * 25.4)
    assert found.columns["reading_um"].max() == pytest.approx(max(map(max, back)) * 25400)


def test_two_figures_above_a_table_are_no_targets_of_its_columns() -> None:
    rows = ["UNIT: INCH;TEMP(F);70.3;PRESS(inHg);29.87", "NO;POSITION;1F;1B;2F;2B"]
    rows += [
        f"{k + 1};{2 * k:.4f};{k * 3e-5:.6f};{k * 3e-5 + 8e-5:.6f};{k * 3e-5:.6f};{k * 3e-5 + 9e-5:.6f}"
        for k in range(9)
    ]
    with pytest.raises(CmmUqError, match="no column is x_mm"):
        runs_of("\n".join([*rows, ""]), **{"1": "along X from 0,0,0"})


def blocks(titles: tuple[str, ...], lengths: list[tuple[float, ...]], *beside: str) -> list[str]:
    rows = []
    for i, (title, own) in enumerate(zip(titles, lengths, strict=True)):
        rows += [title, ";".join((*beside, "Kelvo [mm];Trumi [mm];Zapoli [µm]"))]
        for k, length in enumerate(own):
            for r in range(2 if "Pliko" in beside else 1):
                named = [str({"Pliko": r + 1, "Qe": k + 1}[one]) for one in beside]
                rows.append(
                    ";".join((*named, f"{length}", f"{length + error(i, k, r) / 1000:.4f}", f"{error(i, k, r):.1f}"))
                )
    return rows


def test_titles_and_cells_with_places_name_lines_in_any_language() -> None:
    """Each line has lengths of its own, so that nothing else tells the lines apart."""
    own = [(30.0004, 120.0007), (240.0001, 390.0012), (150.0003, 330.0009)]
    titles = ("Brogu 1: oki X, wul (30 / 310 / 320)", "Brogu 2: oki Y, wul (300 / 20 / 320)", "Brogu 3")
    assert [len(one) for one in read(lengths_of(blocks(titles, own)))] == [2, 2, 2]


def test_numbered_titles_of_an_unknown_word_are_asked_about_and_pages_are_none() -> None:
    own = [(30.0004, 120.0007), (240.0001, 390.0012)]
    with pytest.raises(CmmUqError, match="titles such as 'Brogu 1' may name lines"):
        imported("\n".join([*blocks(("Brogu 1", "Brogu 2"), own), ""]).encode(), "a.csv", ImportKeys())
    assert len(read(lengths_of(blocks(("Page 1", "Page 2"), own)))) == 1


def test_an_unknown_title_and_an_unknown_column_are_asked_about() -> None:
    """Either may count lines, and the other runs."""
    rows = blocks(("Brogu 1", "Brogu 2"), [LENGTHS, LENGTHS], "Pliko", "Qe")
    with pytest.raises(CmmUqError, match="nothing says which lengths lie on one line"):
        imported("\n".join([*rows, ""]).encode(), "a.csv", ImportKeys())


def test_names_of_an_unknown_word_that_several_lengths_share_are_asked_about() -> None:
    rows = ["Brogu;Kelvo [mm];Trumi [mm];Zapoli [µm]"]
    for i, own in enumerate([(30.0004, 120.0007), (240.0001, 390.0012)]):
        rows += [
            f"{f'Brogu {i + 1}' if k == 0 else ''};{v};{v + error(i, k, 0) / 1000:.4f};{error(i, k, 0):.1f}"
            for k, v in enumerate(own)
        ]
    with pytest.raises(CmmUqError, match="titles such as 'Brogu 1' may name lines"):
        imported("\n".join([*rows, ""]).encode(), "a.csv", ImportKeys())


@pytest.mark.parametrize("lines", [2, 3, 5])
def test_figures_among_heads_are_what_lengths_across_are_called_by(lines: int) -> None:
    """With places beside the names of lines, and whichever run is by chance the largest of all."""
    rows = ["Unità: mm", "Posizione;Prova;" + ";".join(map(str, LENGTHS))]
    for i in range(lines):
        axis, *others = ("XYZ"[i % 3], *(one for one in "XYZ" if one != "XYZ"[i % 3]))
        name = f"Posizione {i + 1}: asse {axis}, {others[0]}={400 + i}, {others[1]}=300"
        rows += [";".join((name, f"{r + 1}", *(measured(i, k, r) for k in range(4)))) for r in range(2)]
    assert read(lengths_of(rows)) == expected(lines, 2)


def test_a_run_that_is_the_largest_in_a_few_rows_is_no_extreme_of_the_others() -> None:
    """The first of the second line is the larger of both of the first, in three lengths."""
    rows = [
        "Units: mm;;X axis;;Y axis;",
        "Nominal;Calibrated;Run 1;Run 2;Run 1;Run 2",
        "100;100.0002;100.0011;100.0004;100.0011;100.0007",
        "300;300.0005;300.0009;300.0013;300.0013;300.0003",
        "500;499.9998;500.0008;500.0002;500.0008;500.0016",
    ]
    assert [len(own) for own in read(lengths_of(rows))] == [6, 6]


def test_a_verdict_is_no_number_of_a_run() -> None:
    rows = ["Position;Calibrated [mm];Measured 1 [mm];Measured 2 [mm];Pass"]
    rows += [
        f"Position {i + 1};{LENGTHS[k]};{measured(i, k, 0)};{measured(i, k, 1)};Pass"
        for i in range(3)
        for k in range(4)
    ]
    assert read(lengths_of(rows)) == expected(3, 2)


def test_a_column_that_the_job_names_stands_beside_lengths_whatever_it_is_called() -> None:
    rows = ["Line;Nominal [mm];Measured [mm];Gauge"]
    rows += [f"{i + 1};{LENGTHS[k]};{measured(i, k, 0)};{20 + i / 10:.1f}" for i in range(2) for k in range(4)]
    keys = {"columns": {"temp_artefact_c": "Gauge"}, "lines": {f"{i}": f"along X from 0,{i},0" for i in (1, 2)}}
    found = imported("\n".join(rows).encode(), "e0.csv", ImportKeys.model_validate(keys))
    assert found.columns["temp_artefact_c"].tolist() == [20.0] * 8 + [20.1] * 8
    assert "Gauge" not in " ".join(str(fact.value) for fact in found.recognised.facts if fact.key == "not_used")
