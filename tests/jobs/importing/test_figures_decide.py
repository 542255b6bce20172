"""What figures say is understood whatever columns are called, in whatever order, with whatever stands beside them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.importing.cells.figures import unit_of
from cmm_uq.jobs.importing.format import ImportKeys, unit_named
from cmm_uq.jobs.importing.recording import ImportedTable, UnplacedError, imported

REFERENCE = (30.0004, 120.0007, 240.0001, 390.0012, 570.0009)
LINES, RUNS = 3, 3
MOTHER = [
    [[((37 * i + 11 * k + 23 * r + 5 * i * k) % 29 - 14) / 10 for r in range(RUNS)] for k in range(5)]
    for i in range(LINES)
]
"""Deviations in µm of each line, length and run."""


def read(rows: list[list[str]], decimal: str) -> set[tuple[str, float, int, float]]:
    """Line, reference, run and measured length of each length of a table."""
    content = "\n".join(";".join(row).replace(".", decimal) for row in rows) + "\n"
    with pytest.raises(UnplacedError) as asked:
        imported(content.encode(), "a.csv", ImportKeys())
    return {
        (line, round(float(of or 0), 4), run, round(value, 4))
        for one in asked.value.lengths
        for line, of, run, value in zip(one.names, one.reference, one.repeat, one.measured, strict=True)
    }


EXPECTED = {
    (f"Ova {i + 1}", REFERENCE[k], r + 1, round(REFERENCE[k] + MOTHER[i][k][r] / 1000, 4))
    for i in range(LINES)
    for k in range(5)
    for r in range(RUNS)
}


def columns_of(words: tuple[str, str, str, str]) -> dict[str, list[str]]:
    """Columns by what they are, each with its head, in a language that nobody speaks."""
    name, of, measured, deviation = words
    every = [(i, k) for i in range(LINES) for k in range(5)]
    columns = {
        "line": [name, *(f"Ova {i + 1}" for i, _ in every)],
        "reference": [f"{of} [mm]", *(f"{REFERENCE[k]:.4f}" for _, k in every)],
    }
    for r in range(RUNS):
        columns[f"measured {r}"] = [
            f"{measured} {r + 1} [mm]",
            *(f"{REFERENCE[k] + MOTHER[i][k][r] / 1000:.4f}" for i, k in every),
        ]
        columns[f"deviation {r}"] = [f"{deviation} {r + 1} [µm]", *(f"{MOTHER[i][k][r]:.1f}" for i, k in every)]
    columns["nominal"] = ["Ukto", *(f"{round(REFERENCE[k], -1):.0f}" for _, k in every)]
    columns["mean"] = ["Zelb [µm]", *(f"{np.mean(MOTHER[i][k]):.2f}" for i, k in every)]
    columns["range"] = ["Zirg [µm]", *(f"{np.ptp(MOTHER[i][k]):.1f}" for i, k in every)]
    columns["limit"] = ["Volk [µm]", *(f"{1.7 + REFERENCE[k] / 300:.1f}" for _, k in every)]
    columns["verdict"] = ["Jur", *("da" for _ in every)]
    return columns


@settings(deadline=None, max_examples=60)
@given(
    st.permutations(["reference", *(f"{of} {r}" for r in range(RUNS) for of in ("measured", "deviation"))]),
    st.sets(st.sampled_from(["nominal", "mean", "range", "limit", "verdict"])),
    st.sampled_from(".,"),
    st.sampled_from(
        [
            ("Hule", "Brane", "Tonk", "Fisp"),
            ("Line", "Calibrated", "Measured", "Error"),
            ("測線", "校正値", "実測値", "誤差"),
        ]
    ),
)
def test_lengths_are_the_same_in_any_order_language_and_company(
    order: list[str], beside: set[str], decimal: str, words: tuple[str, str, str, str]
) -> None:
    columns = columns_of(words)
    chosen = ["line", *order, *(name for name in columns if name in beside)]
    assert read([list(row) for row in zip(*(columns[name] for name in chosen), strict=True)], decimal) == EXPECTED


def test_of_deviations_that_are_nobodys_difference_nothing_is_read() -> None:
    """A mutant: one figure of the measured lengths is changed, and no pair of columns fits their deviation any more."""
    columns = columns_of(("Hule", "Brane", "Tonk", "Fisp"))
    columns["measured 0"][4] = "390.0512"
    rows = [
        ";".join(row)
        for row in zip(*(columns[n] for n in ("line", "reference", "measured 0", "deviation 0")), strict=True)
    ]
    with pytest.raises(CmmUqError) as asked:
        imported("\n".join(rows).encode(), "a.csv", ImportKeys())
    assert not isinstance(asked.value, UnplacedError)


TARGETS = (-200, -120, -40, 40, 120, 200)


def runs(rows: list[list[str]]) -> ImportedTable:
    content = "\n".join(";".join(row) for row in rows) + "\n"
    return imported(content.encode(), "a.csv", ImportKeys.model_validate({"lines": {"X": "along X from 0,0,0"}}))


def test_runs_there_and_back_are_the_same_down_and_across() -> None:
    """Means, reversals and spreads beside or below them are no runs, whatever they are called."""
    there = [[((7 * k + 5 * r) % 11) / 10 for k in range(6)] for r in range(3)]
    back = [[((5 * k + 3 * r) % 13) / 10 - 3 for k in range(6)] for r in range(3)]
    summed = [np.mean(there, 0), np.mean(back, 0), np.mean(there, 0) - np.mean(back, 0)]
    across = [["Unt X-axis", ""], ["Pisk (mm)", *(f"{t}" for t in TARGETS)], ["", *("" for _ in TARGETS)]]
    for r in range(3):
        across += [
            [f"Kle {r + 1} ↑ (µm)", *(f"{v:.1f}" for v in there[r])],
            [f"Kle {r + 1} ↓ (µm)", *(f"{v:.1f}" for v in back[r])],
        ]
    across += [[f"Zum{n} (µm)", *(f"{v:.2f}" for v in own)] for n, own in zip("abc", summed, strict=True)]
    down = [across[0], *(list(row) for row in zip(*(row for row in across[1:] if row[0]), strict=True))]
    found, turned = runs(down), runs(across)
    apart = runs([[*row[:3], "", *row[3:]] for row in across])
    for table in (found, turned, apart):
        assert len(table.lines) == 36
        assert table.columns["reading_um"][table.columns["approach_x"] > 0].tolist() == pytest.approx(
            np.ravel(there).tolist()
        )
    assert {name: values.tolist() for name, values in found.columns.items()} == {
        n: v.tolist() for n, v in turned.columns.items()
    }


def test_tables_across_may_have_an_empty_column() -> None:
    rows = [["Odchylky v µm", ""]]
    for axis, count in zip("XYZ", (8, 7, 6), strict=True):
        rows += [[f"Osa {axis}"], ["Poloha [mm]", *(f"{75 * k}" for k in range(count))]]
        for n, sign in ((n, sign) for n in (1, 2, 3) for sign in "+-"):
            rows += [[f"{n} {sign}", *(f"{(7 * k + 5 * n + ord(sign)) % 11 / 10:.2f}" for k in range(count))]]
    apart = [row if len(row) < 3 else [*row[:2], "", *row[2:]] for row in rows]
    lines = {"lines": {axis: f"along {axis} from 0,0,0" for axis in "XYZ"}}
    found, same = (
        imported("\n".join(map("\t".join, each)).encode(), "a.tsv", ImportKeys.model_validate(lines))
        for each in (apart, rows)
    )
    assert len(found.lines) == 6 * (8 + 7 + 6)
    assert {n: v.tolist() for n, v in found.columns.items()} == {n: v.tolist() for n, v in same.columns.items()}


def test_a_row_whose_text_says_where_it_lies_is_measured_as_those_beside_it() -> None:
    places = {"X": "axe X, Y=400 Z=300, départ X=100", "D1": "diagonale (100 / 100 / 50) vers (700 / 700 / 550)"}
    rows = [
        f"{line};{place};{nominal:.4f};{nominal + 3e-4:.4f};{nominal - 6e-4:.4f};{nominal + 1e-4:.4f}"
        for line, place in places.items()
        for nominal in (49.9998, 124.9999, 250.0002, 375.0003)
    ]  # fmt: skip
    head = ["Ligne;Emplacement;Longueur étalonnée;Mesure 1;Mesure 2;Mesure 3", ";;mm;mm;mm;mm"]
    found = imported("\n".join([*head, *rows, ""]).encode(), "e0.csv", ImportKeys())
    assert len(found.lines) == 2 * 3 * len(rows)
    assert found.places == {"X": "along X from 100,400,300", "D1": "from 100,100,50 to 700,700,550"}


RANDOM = np.random.default_rng(11)
SCATTER = np.round(RANDOM.normal(0.3, 0.5, (7, len(REFERENCE), RUNS)), 1)
"""Deviations in µm of seven lines, printed to a tenth: of five lengths many a column is the mean or the range of others."""


def told(rows: list[list[str]]) -> set[tuple[str, float, int, float]]:
    return read(rows, ",")


def wide(cells: list[list[str]], letters: str = "ABCDEFG") -> list[list[str]]:
    heads = [["", "", *(text for a in letters for text in (f"Lijn {a}", *[""] * (RUNS - 1)))]]
    heads += [["Nominaal (mm)", "Gekalibreerd (mm)", *(f"{r + 1}" for _ in letters for r in range(RUNS))]]
    return [*heads, *cells]


def expected(letters: str = "ABCDEFG") -> set[tuple[str, float, int, float]]:
    lengths = [(i, k, r) for i in range(len(letters)) for k in range(len(REFERENCE)) for r in range(RUNS)]
    return {
        (f"Lijn {letters[i]}", REFERENCE[k], r + 1, round(REFERENCE[k] + SCATTER[i, k, r] / 1000, 4))
        for i, k, r in lengths
    }


def test_letters_of_lines_are_no_units_nor_words_and_few_rows_are_no_sums() -> None:
    """E is no error, C and F no degrees."""
    rows = [
        [
            f"{REFERENCE[k]:.0f}",
            f"{REFERENCE[k]:.4f}",
            *(f"{SCATTER[i, k, r]:.1f}" for i in range(7) for r in range(RUNS)),
        ]
        for k in range(len(REFERENCE))
    ]
    assert told([["Afwijking = gemeten − gekalibreerd, in µm"], *wide(rows)]) == expected()


@pytest.mark.parametrize(
    ("head", "unit"),
    [("Line temperature (°C)", "°C"), ("Line temperature °C", "°C"), ("Line C", None), ("Line error µm", "µm")],
)
def test_a_unit_that_is_written_is_one_beside_any_word(head: str, unit: str | None) -> None:
    found = unit_of([head])
    assert (found and found.name) == (unit and unit_named(unit).name)  # type: ignore[union-attr]


def test_deviations_below_lengths_under_one_head_are_said_once() -> None:
    rows = [
        [
            f"{REFERENCE[k]:.0f}", f"{REFERENCE[k]:.4f}",
            *(f"{REFERENCE[k] + SCATTER[i, k, r] / 1000:.4f}" for i in range(7) for r in range(RUNS)),
        ]
        for k in range(len(REFERENCE))
    ]  # fmt: skip
    rows += [["Afwijking (µm)"]]
    rows += [
        [f"{REFERENCE[k]:.0f}", "", *(f"{SCATTER[i, k, r]:.1f}" for i in range(7) for r in range(RUNS))]
        for k in range(len(REFERENCE))
    ]
    assert told(wide(rows)) == expected()


def test_a_number_of_each_row_is_none_of_runs() -> None:
    """Lengths in turn, each three times, with rows numbered on each line."""
    rows: list[list[str]] = []
    for i in range(LINES):
        rows += [[f"MESSLINIE {i + 1}"], ["NR", "NENNMASS MM", "KALIBRIERT MM", "GEMESSEN MM"]]
        for n, (k, r) in enumerate(((k, r) for k in range(5) for r in range(RUNS)), 1):
            measured = REFERENCE[k] + MOTHER[i][k][r] / 1000
            rows += [[f"{n}", f"{REFERENCE[k]:.0f}", f"{REFERENCE[k]:.4f}", f"{measured:.4f}"]]
    assert told(rows) == {(f"MESSLINIE {one[0][-1]}", *one[1:]) for one in EXPECTED}


def test_of_two_references_the_calibrated_one_is_that_of_lengths() -> None:
    rows = [["測定位置", "基準寸法(mm)", "校正値(mm)", *(f"測定値{r + 1}(mm)" for r in range(RUNS)), "最大誤差(μm)"]]
    for i in range(LINES):
        for k in range(5):
            measured = [REFERENCE[k] + one / 1000 for one in MOTHER[i][k]]
            worst = max(MOTHER[i][k], key=abs)
            rows += [
                [
                    f"Ova {i + 1}",
                    f"{REFERENCE[k]:.0f}",
                    f"{REFERENCE[k]:.4f}",
                    *(f"{m:.4f}" for m in measured),
                    f"{worst:.1f}",
                ]
            ]
    assert told(rows) == EXPECTED


def test_a_reading_that_comes_again_and_is_more_by_the_error_is_asked_about() -> None:
    """A machine driven to the same places, another beside it: which of both is the reference words alone could say."""
    rows = [["Punto", "Lettura MMC", "Lettura 2", "Errore [µm]"]]
    for i in range(LINES):
        rows += [[f"D{i + 1}"]]
        for k, shown in enumerate((227.677, 455.354, 683.03, 910.707, 1138.384), 1):
            error = MOTHER[i][k - 1][0]
            rows += [[f"{k}", f"{shown:.4f}", f"{shown - error / 1000:.4f}", f"{error:.1f}"]]
    with pytest.raises(CmmUqError, match="comes again, as a reference does"):
        imported("\n".join(map(";".join, rows)).encode(), "a.csv", ImportKeys())
    for called in ("2", "MMC"):  # what the job says stands, whatever comes again
        columns = {"reference_mm": f"Lettura {called}"}
        with pytest.raises(UnplacedError) as asked:
            imported(
                "\n".join(map(";".join, rows)).encode(),
                "a.csv",
                ImportKeys.model_validate({"columns": columns, "unit": "mm"}),
            )
        references = [one for each in asked.value.lengths for one in each.reference]
        column = rows[0].index(f"Lettura {called}")
        assert references == [float(row[column]) for row in rows[1:] if len(row) > 1]
