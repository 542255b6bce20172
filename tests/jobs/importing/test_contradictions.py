"""Readings that the whole table contradicts are asked about, and what tables in other words and orders say is read."""

from __future__ import annotations

import re

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.importing.format import ImportKeys, NotReadError
from cmm_uq.jobs.importing.lines import MeasuredLengths
from cmm_uq.jobs.importing.recording import ImportedTable, UnplacedError, imported

NOMINAL = (60.0003, 180.0008, 300.0011, 420.0009)
AT = {axis: f"along {axis} from 0,0,0" for axis in "XYZ"}


def error_um(line: int, length: int, run: int) -> float:
    return round(0.3 * length + 0.2 * line + (0.1, -0.2, 0.4)[run], 1)


def lengths(text: str, name: str = "x.csv") -> MeasuredLengths:
    with pytest.raises(UnplacedError) as error:
        imported(text.encode(), name, ImportKeys())
    return error.value.lengths[0]


def runs(text: str, name: str = "x.csv") -> ImportedTable:
    return imported(text.encode(), name, ImportKeys.model_validate({"lines": {"X": AT["X"]}}))


def rows_of(form: str, lines: str = "XYZ") -> list[str]:
    """A row for each length of each line, with its three runs."""
    return [
        form.format(line, n, *(f"{n + error_um(i, k, run) / 1000:.4f}" for run in range(3)))
        for i, line in enumerate(lines)
        for k, n in enumerate(NOMINAL)
    ]


def whole(found: MeasuredLengths, lines: str = "XYZ") -> None:
    every = zip(found.names, found.reference, found.repeat, found.measured, strict=True)
    expected = [
        (line, n, run + 1, pytest.approx(n + error_um(i, k, run) / 1000, abs=1e-7))
        for i, line in enumerate(lines)
        for k, n in enumerate(NOMINAL)
        for run in range(3)
    ]
    assert sorted(every) == sorted(expected, key=lambda one: one[:3])


def test_a_serial_number_counts_no_runs() -> None:
    rows = [
        f"{line};{n};{n + error_um(i, k, run) / 1000:.4f}"
        for i, line in enumerate("XYZ")
        for run in range(3)
        for k, n in enumerate(NOMINAL)
    ]
    text = "Messung;Linie;Kalibrierwert (mm);Messwert (mm)\n" + "\n".join(f"{k};{row}" for k, row in enumerate(rows, 1))
    whole(lengths(text + "\n"))


@pytest.mark.parametrize("head", ["U [µm]", "Messunsicherheit (µm)", "Unsicherheit k = 2 (µm)"])
def test_the_certificate_of_a_gauge_was_measured_by_no_machine(head: str) -> None:
    rows = [f"{k};{20 * k};{20 * k + 0.0003 * (k % 4):.4f};{0.1 + 0.01 * k:.2f}" for k in range(1, 13)]
    text = f"Messfläche;Nennmaß [mm];Istmaß [mm];{head}\n" + "\n".join(rows) + "\n"
    with pytest.raises(NotReadError, match="as the certificate of a gauge does"):
        imported(text.encode(), "x.csv", ImportKeys())
    named = ImportKeys(columns={"nominal_mm": "Nennmaß [mm]", "length_mm": "Istmaß [mm]"}, lines={"1": AT["X"]})
    assert len(imported(text.encode(), "x.csv", named).lines) == 24


def test_styli_at_one_ball_are_no_repeats() -> None:
    styli = {"T1": (0, 0), "T2": (90, 0), "T3": (90, 90), "T4": (90, 180), "T5": (90, -90)}
    rows = [
        f"{name},{a},{b},{250 + k / 1000 + run / 5000:.4f},{300 - k / 2000:.4f},{-150 + run / 1000:.4f}"
        for run in (1, 2)
        for k, (name, (a, b)) in enumerate(styli.items())
    ]
    with pytest.raises(NotReadError, match="2 to 8 times, as styli"):
        imported(("Stylus,A,B,Xc,Yc,Zc\n" + "\n".join(rows) + "\n").encode(), "x.csv", ImportKeys(unit="mm"))


def test_places_that_nothing_heads_and_no_shape_holds_together_are_asked_about() -> None:
    rng = np.random.default_rng(4)
    rows = [
        f"A::Jig::P{k:02d}, {x:.4f}, {y:.4f}, {z:.4f}" for k, (x, y, z) in enumerate(rng.uniform(-900, 900, (20, 3)), 1)
    ]
    with pytest.raises(NotReadError, match="nothing says that they are one measurement"):
        imported(("\n".join(rows) + "\n").encode(), "x.txt", ImportKeys(unit="mm"))
    keys = ImportKeys(unit="mm", points_per_measurement="all")
    assert len(imported(("\n".join(rows) + "\n").encode(), "x.txt", keys).lines) == 20


def test_passes_in_turn_of_time_may_leave_a_target_out() -> None:
    """Runs are told by where the targets turn: the fourth visit of 300 is of the third pass there, not of the second."""
    targets = [100.0 * k for k in range(8)]
    rows, at = list[tuple[float, float, int, int]](), 0
    for run in (1, 2, 3):
        for way in (1, -1):
            for target in targets[::way]:
                if (run, way, target) != (2, 1, 300.0):
                    rows.append((target, round(target / 200 + 0.4 * run + 0.9 * (way < 0), 2), run, way))
    lines = [
        f"10:{k // 60:02d}:{k % 60:02d};{t:.3f};{t + error / 1000:.5f}" for k, (t, error, *_) in enumerate(rows, at)
    ]
    table = runs("Laser, machine X axis\nTime;Target(mm);Laser reading(mm)\n" + "\n".join(lines) + "\n")
    np.testing.assert_allclose(table.columns["reading_um"], [error for _, error, *_ in rows], atol=1e-6)
    assert table.columns["repeat"].tolist() == [run for *_, run, _ in rows]
    assert table.columns["approach_x"].tolist() == [way for *_, way in rows]


def test_a_target_that_a_run_leaves_out_keeps_the_numbers_of_the_others() -> None:
    targets, missing = (0.0, 100.0, 200.0, 300.0), (2, "zurück", 200.0)
    heads = [(run, way) for run in (1, 2, 3) for way in ("vor", "zurück")]
    body = [
        ";".join([f"{t:.3f}", *("n.a." if (*one, t) == missing else f"{t + one[0] / 1000:.4f}" for one in heads)])
        for t in targets
    ]
    head = ";".join(["Zielposition", *(f"{run}. {way}" for run, way in heads)])
    columns = runs("Achse X;Verfahrweg 300 mm;3 Läufe\n" + "\n".join([head, *body]) + "\n").columns
    assert len(columns["point"]) == 23
    places = {
        (point, round(x, 6)) for point, x in zip(columns["point"].tolist(), columns["x_mm"].tolist(), strict=True)
    }
    assert len(places) == 8  # a number is of one place and of one sense


RTL = """HEADER::
File Type:Linear
USER-TEXT::
Axis:X
{unit}TARGET DATA::
Target-count:3
Targets :
 0.0 100.0 200.0
RUN DATA::
Run-count:2
Deviations:
Run Target Data:
 1 1 {0}
 1 2 {1}
 1 3 {2}
 2 3 {3}
 2 2 {4}
 2 1 {5}
EOF::
"""


def test_deviations_too_small_for_micrometres_are_in_the_unit_of_the_file() -> None:
    um = [-0.29, 0.87, 1.9, 2.6, 1.7, 0.4]
    assert runs(RTL.format(*um, unit=""), "x.rtl").columns["reading_um"].tolist() == um
    mm = [one / 1000 for one in um]
    found = runs(RTL.format(*mm, unit="Units:mm\n"), "x.rtl").columns
    np.testing.assert_allclose(found["reading_um"], um, atol=1e-9)
    assert found["repeat"].tolist() == [1] * 6
    with pytest.raises(CmmUqError, match="too small for µm, and nothing says their unit"):
        runs(RTL.format(*mm, unit=""), "x.rtl")


@pytest.mark.parametrize("keyed", [True, False])
def test_values_that_q_das_marks_as_invalid_are_left_out_and_told(keyed: bool) -> None:
    body = [f"K2002/{k} Länge X {n:.0f}\nK2101/{k} {n}\nK2142/{k} mm" for k, n in enumerate(NOMINAL, 1)]
    for run in range(3):
        each = [
            (f"{n + error_um(0, k, run) / 1000:.4f}", "256" if (run, k) == (1, 2) else "0")
            for k, n in enumerate(NOMINAL)
        ]
        if keyed:
            body += [f"K0001/{k} {value}\nK0002/{k} {attribute}" for k, (value, attribute) in enumerate(each, 1)]
        else:
            body.append("\x0f".join(f"{value}\x14{attribute}\x14" for value, attribute in each))
    found = lengths("K0100 4\n" + "\n".join(body) + "\n", "x.dfq")
    assert len(found.measured) == 11
    assert [run for n, run in zip(found.reference, found.repeat, strict=True) if n == NOMINAL[2]] == [1, 3]
    assert len(found.left_out) == 1
    assert "300.0011" in found.left_out[0]


def test_distances_along_axes_lie_on_these() -> None:
    body = [
        f"T(D{axis}{n:.0f}_{r})=TOL/DISTB,NOMINL,{n},-0.002,0.002,{axis}AXIS\n"
        f"TA(D{axis}{n:.0f}_{r})=TOL/DISTB,{n + error_um(i, k, r - 1) / 1000:.5f},INTOL,{axis}AXIS\n"
        for i, axis in enumerate("XY")
        for r in (1, 2, 3)
        for k, n in enumerate(NOMINAL)
    ]
    whole(lengths("DMISMN/'E0',05.3\nUNITS/MM,ANGDEC\n" + "".join(body), "x.dmo"), "XY")
    lines = "".join(body).replace("XAXIS", "PT2PT").replace("YAXIS", "PT2PT")
    with pytest.raises(CmmUqError, match=r"line 4: 'DX60' may name a length"):
        lengths("DMISMN/'E0',05.3\nUNITS/MM,ANGDEC\n" + lines, "x.dmo")


ARABIC = str.maketrans("0123456789.", "٠١٢٣٤٥٦٧٨٩٫")


@pytest.mark.parametrize(
    ("head", "form", "figures"),
    [
        ("المحور;الطول المعاير (مم);القراءة 1;القراءة 2;القراءة 3", "{};{};{};{};{}", ARABIC),
        ('ציר;אורך מכויל (מ"מ);מדידה 1;מדידה 2;מדידה 3', "{};{};{};{};{}", {}),
        ("Hat;Kalibre uzunluk (mm);Ölçüm 1 (mm);Ölçüm 2 (mm);Ölçüm 3 (mm)", "{};{};{};{};{}", {}),
        ("Os;Umjerena duljina (mm);Mjerenje 1;Mjerenje 2;Mjerenje 3", "{};{};{};{};{}", {}),
        ("Zork;Eindmaat (mm);Meting 1;Meting 2;Meting 3", "{};{};{};{};{}", {}),
    ],
)
def test_lengths_in_further_languages(head: str, form: str, figures: dict[int, str]) -> None:
    text = "\n".join([head, *rows_of(form)]).replace('"', '""')
    quoted = re.sub(r"(?m)[^;\n]*\"\"[^;\n]*", lambda match: f'"{match[0]}"', text)
    whole(lengths(quoted.translate(figures) + "\n"))


def test_one_head_over_several_columns_is_of_each_of_them() -> None:
    rows = [
        f"{line};{n:.0f};" + ";".join(f"{error_um(i, k, run):+}" for run in range(3))
        for i, line in enumerate("XY")
        for k, n in enumerate(NOMINAL)
    ]
    found = lengths("Axis;Nominal length (mm);Error (µm);;\n" + "\n".join(rows) + "\n")
    assert len(found.measured) == 24
    assert {*found.repeat} == {1, 2, 3}


def test_the_column_less_which_the_mean_error_is_printed_is_calibrated() -> None:
    rows = []
    for i, line in enumerate("XYZ"):
        for k, n in enumerate((1.0, 4.0, 8.0, 12.0)):
            actual, own = n + (i - 1) * 1e-5, [n + (2 * i + k + run) * 1e-5 for run in (0, 2, 1)]
            mean = (sum(own) / 3 - actual) * 1e4
            rows.append(",".join([line, f"{n:.4f}", f"{actual:.5f}", *(f"{one:.5f}" for one in own), f"{mean:.2f}"]))
    head = 'All dimensions in inches\nAxis,Nominal,Actual,Run 1,Run 2,Run 3,Avg Error (.0001")\n'
    found = lengths(head + "\n".join(rows) + "\n")
    assert found.reference[0] == pytest.approx((1 - 1e-5) * 25.4, abs=1e-9)
    assert found.measured[1] == pytest.approx((1 + 2e-5) * 25.4, abs=1e-9)


def test_deviations_in_parts_of_a_length_that_only_a_word_calls_so() -> None:
    rows = [
        f"{axis};{n};" + ";".join(f"{error_um(i, k, run):.2f}" for run in range(3))
        for i, axis in enumerate("XYZ")
        for k, n in enumerate((200, 400, 600, 800))
    ]
    found = lengths(
        "Eje;Longitud (mm);Error (ppm) rep. 1;Error (ppm) rep. 2;Error (ppm) rep. 3\n" + "\n".join(rows) + "\n"
    )
    assert found.measured[3:6] == pytest.approx([400 + 400e-6 * error_um(0, 1, run) for run in range(3)], abs=1e-9)


def test_of_raw_and_corrected_lengths_those_are_read_whose_deviations_stand_beside_them() -> None:
    rows = [
        f"{line};{n:.1f};{run + 1};{n + 0.004 + run / 1000 + i / 700:.4f};{n + (e := error_um(i, k, run)) / 1000:.4f};{-e:.1f}"
        for i, line in enumerate("XYZ")
        for k, n in enumerate((100.0, 300.0, 500.0))
        for run in range(3)
    ]
    head = "Tengely;Névleges [mm];Ismétlés;Nyers érték [mm];Korrigált érték [mm];Hiba [µm] (névleges - korrigált)"
    found = lengths("\n".join([head, *rows, ""]))
    assert found.measured[:3] == pytest.approx([100 + error_um(0, 0, run) / 1000 for run in range(3)], abs=1e-9)
