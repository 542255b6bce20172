"""Arrangements of points as reports have them: pages, results below, rows of axes, rings, packed lines, fixed columns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.importing.format import ImportKeys
from cmm_uq.jobs.importing.recording import ImportedTable, imported

TRIANGLE = np.array([[0.0, 0.0, 0.0], [240.0, 0.0, 0.0], [120.0, 207.8461, 0.0]])
PLACED = [(TRIANGLE + start).tolist() for start in ((-520, -410, -420), (-150, -410, -420), (-520, -160, -250))]


def read(lines: Sequence[str], **keys: object) -> ImportedTable:
    return imported("\n".join([*lines, ""]).encode(), "a.csv", ImportKeys.model_validate(keys))


def problem(lines: Sequence[str], **keys: object) -> str:
    with pytest.raises(CmmUqError) as refused:
        read(lines, **keys)
    return f"{refused.value} {refused.value.fix}"


def groups(found: ImportedTable) -> list[int]:
    return found.columns["measurement"].astype(int).tolist()


@settings(deadline=None, max_examples=30)
@given(st.integers(1, 23), st.booleans())
def test_a_page_may_break_anywhere(at: int, numbered: bool) -> None:
    """The head comes again without its row of units, under the number of the page."""
    rows = [
        f"P{m};K{b};{100 * m + 37.5 * b + 0.0012:.4f};{50 * m:.4f};-{20 * m:.4f}" for m in (1, 2, 3) for b in range(8)
    ]
    pages = [*rows[:at], *(["Brogu 2 / Page 2"] if numbered else []), "Pos;Ball;X;Y;Z", *rows[at:]]
    found = read(["Pos;Ball;X;Y;Z", ";;[mm];[mm];[mm]", *pages])
    assert found.lines.size == 24
    assert groups(found) == [m for m in (1, 2, 3) for _ in range(8)]


def test_numbers_of_pages_are_of_no_measurement() -> None:
    lines = ["UNITS: mm"]
    for position, page in ((1, 1), (2, 3)):
        lines += [f"Quim 7   Page {page}", f"POSITION {position}   turned about Z   {90 * position} deg   FRAME: A"]
        lines += [" Element      X            Y            Z", " ------------------------------------------"]
        for k in range(6):
            if k == 3:
                lines += [f"Quim 7   Page {page + 1}", " Element      X            Y            Z"]
            x, y = (83.0 * (k % 3), 83.0 * (k // 3))
            lines.append(f" E{position}({k + 1}) {200 + x + position:12.4f} {300 + y:12.4f} {-10.0 * position:12.4f}")
    assert groups(read(lines)) == [1] * 6 + [2] * 6


def test_what_goes_on_on_the_next_page_is_the_same_measurement() -> None:
    lines = ["UNITS: mm"]
    for page in (1, 2):
        lines += [f"Quim 7   Page {page}", " Element      X            Y            Z"]
        own = range(3 * page - 3, 3 * page)
        lines += [f" E({k})    {200 + 83 * (k % 3):12.4f} {300 + 83 * (k // 3):12.4f} {-10.0:12.4f}" for k in own]
    assert groups(read(lines)) == [1] * 6


def test_results_below_points_are_told_and_points_are_not_results() -> None:
    points = [f"R{k}\tKRE\t{3000 + k / 7:.4f}\t{k * 90.5:.4f}\t{k * k * 11.3:.4f}" for k in range(8)]
    head = ["Unit: mm", "", "Name\tType\tX\tY\tZ"]
    assert len(read([*head, *points, "ITS\tKRE\t12.1000\t900.2000\t44.1000"]).lines) == 9
    found = read([*head, *points, "Zentrum\tMP\t3000.5000\t300.2000\t200.1000"])
    told = next(str.__str__(fact.value) for fact in found.recognised.facts if fact.key == "left_out")
    assert len(found.lines) == 8
    assert "Zentrum" in told


def test_what_two_columns_differ_by_is_no_place() -> None:
    """Deviations in mm below words that nobody knows."""
    lines = ["Kilba;Orbit;Fosta [mm];Trumi [mm];Zapoli [mm]"]
    random = np.random.default_rng(3)
    for k, place in enumerate(np.array(PLACED).reshape(-1, 3)):
        for axis, nominal in zip("XYZ", place, strict=True):
            measured = round(nominal + random.normal(0, 0.003), 4)
            lines.append(f"B{k + 1};{axis};{nominal:.4f};{measured:.4f};{measured - nominal:.4f}")
    assert "may both be measured" not in problem(lines)


def packed(*, attribute: str = "0", value: str = "100.00091") -> bytes:
    lines = ["K0100 6", "K1001 KP300"]
    for n, (name, nominal) in enumerate(
        ((f"Kugel{b}.{a}", v) for b, v in ((1, "0.0"), (2, "100.0")) for a in "XYZ"), 1
    ):
        lines += [f"K2001/{n} {n}", f"K2002/{n} {name}", f"K2101/{n} {nominal}", f"K2142/{n} mm"]
    for run in range(2):
        figures = (f"0.0005{run}", "0.00135", "-0.00078", value, f"0.0002{run}", "0.00002")
        lines.append("\x0f".join(f"{one}\x14{attribute}\x1405.03.2024/07:1{run}:00\x14\x14KMG\x14" for one in figures))
    return ("\n".join(lines) + "\n").encode()


def test_packed_lines_of_q_das() -> None:
    found = imported(packed(), "a.dfq", ImportKeys())
    assert found.columns["point"].tolist() == [1, 2, 1, 2]
    assert found.columns["repeat"].tolist() == [1, 1, 2, 2]
    assert found.columns["x_mm"].tolist() == [0.0005, 100.00091, 0.00051, 100.00091]


@pytest.mark.parametrize("spoiled", [{"attribute": "255"}, {"value": " "}])
def test_packed_lines_with_a_value_that_is_none(spoiled: dict[str, str]) -> None:
    with pytest.raises(CmmUqError, match=r"K0002|not a value for each of 6"):
        imported(packed(**spoiled), "a.dfq", ImportKeys())


@pytest.mark.parametrize("length", ["Längd 1 (mm)", "Length 1"])
def test_whole_places_beside_lengths_were_not_measured(length: str) -> None:
    rows = [f"{k},{150 + 10 * k},{300 + k},200,{850 + 10 * k},{300 + k},200,700.01{k}8,700.01{k}3" for k in range(1, 8)]
    head = f"Pos,Ball A X,Ball A Y,Ball A Z,Ball B X,Ball B Y,Ball B Z,{length},{length.replace('1', '2')}"
    try:
        lengths = len(read([head, *rows], unit="mm").places) == 7
    except CmmUqError as error:  # refused, or asked where the lines lie
        lengths = "points_per" not in str(error.fix)
    assert lengths


def ring(turn: float = 0.0, count: int = 9) -> list[str]:
    angles = 2 * np.pi * np.arange(count) / count + turn
    return [f"{300 + 150 * np.cos(a):.4f};{200 + 150 * np.sin(a):.4f};{-100 + 40 * turn:.4f}" for a in angles]


def test_a_ring_is_one_measurement() -> None:
    named = [f"B{k + 1};{row}" for k, row in enumerate(ring())]
    assert groups(read(["Name;X;Y;Z", *named], unit="mm")) == [1] * 9


def test_points_probed_around_a_setting_ring_need_no_names() -> None:
    """Sixteen points of a ring of 50 mm, nothing beside their coordinates; 10 µm out of round."""
    angles = 2 * np.pi * (np.arange(16) + 0.5) / 16
    radii = 25.0 + 5e-3 * np.cos(2 * angles)
    rows = [
        f"{300 + r * np.cos(a):.4f};{200 + r * np.sin(a):.4f};-100.0000" for r, a in zip(radii, angles, strict=True)
    ]
    assert groups(read(["X;Y;Z", *rows], unit="mm")) == [1] * 16


def test_a_beam_measured_twice_in_turn() -> None:
    ways = ((1, 0), (0.6, 0.8))
    rows = [f"{100 + k * 100 * c:.4f};{200 + k * 100 * s:.4f};{-100 - 20 * s:.4f}" for c, s in ways for k in range(5)]
    assert groups(read(["X;Y;Z", *rows], unit="mm")) == [1] * 5 + [2] * 5


def test_names_of_points_that_may_be_one_artefact_in_several_places_are_asked_about() -> None:
    rows = [f"S{k + 1};{x:.4f};{y:.4f};{z:.4f}" for k, (x, y, z) in enumerate(np.array(PLACED).reshape(-1, 3).tolist())]
    assert "points_per_measurement" in problem(["Name;X;Y;Z", *rows], unit="mm")
    assert groups(read(["Name;X;Y;Z", *rows], unit="mm", points_per_measurement=3)) == [1] * 3 + [2] * 3 + [3] * 3


def test_four_places_that_may_be_two_bars_are_asked_about() -> None:
    rows = ["376.7774;503.8057;-211.6478", "363.7980;315.8941;-278.9090"]
    rows += ["470.8086;236.8827;-518.1434", "457.8292;48.9711;-585.4046"]
    assert "points_per_measurement" in problem(["X;Y;Z", *rows], unit="mm")


def test_heads_are_counted_where_names_of_two_words_stand_below_them() -> None:
    """Columns that no figures align with their heads, as long as rows and head have as many phrases."""
    lines = ["Unit: mm", "Pos     Ball     x nom     x act      y nom     y act      z nom     z act"]
    for k, place in enumerate(np.array(PLACED[:2]).reshape(-1, 3)):
        cells = "   ".join(f"{v:.1f}   {v + 0.0013 * (k + 1):.4f}" for v in place)
        lines.append(f"Pos {k // 3 + 1}   Ball {k % 3 + 1}   {cells}")
    found = read(lines)
    assert groups(found) == [1] * 3 + [2] * 3
    assert found.columns["x_mm"][0] == pytest.approx(PLACED[0][0][0] + 0.0013)


def test_a_head_between_commas_above_columns_between_blanks() -> None:
    """As survey forms have it; the unit stands below its word."""
    lines = ["> Units:", "m", "> Column Names:", "Point Name,XLOCAL,YLOCAL,ZLOCAL,Type,Precision(mm)", "> Data:"]
    lines += [
        f"R0{k} {3.0161 + 1e-4 * (k % 3):.4f} {0.7 * k - 2:.4f} {(k * k) % 7 - 2.1:.4f} M 0.2" for k in range(1, 9)
    ]
    found = read(lines)
    assert found.columns["x_mm"][:2].tolist() == [3016.2, 3016.3]
    assert found.lines.size == 8


def test_figures_that_begin_with_nought_are_no_thousands() -> None:
    turned = [PLACED[0], [(x, z, -y) for x, y, z in PLACED[1]]]
    rows = [f"T_P{m}_S{k};Centre {a};{v:.3f}".replace(".", ",") for m, t in enumerate(turned, 1) for k, own in enumerate(t, 1)
            for a, v in zip("XYZ", (own[0] + 520, own[1], own[2]), strict=True)]  # fmt: skip
    found = read(["Nom;Contrôle;Mesuré [mm]", *rows])
    assert found.columns["x_mm"][0] == 0.0
    assert groups(found) == [1] * 3 + [2] * 3


def test_nominal_values_in_rows_of_axes_are_no_names() -> None:
    """Whole ones, of which only the first stands beside the name."""
    lines = ["Feature;Axis;Nominal;Actual;Error"]
    for k in range(9):
        for axis, nominal in zip("XYZ", (80 + 110 * (k % 3), 140 + 110 * (k // 3), 95), strict=True):
            lines.append(
                f"{f'Sphere {k + 1}' if axis == 'X' else ''};{axis};{nominal};{nominal + 0.0003 * k:.4f};{0.0003 * k:.4f}"
            )
    assert groups(read(lines, unit="mm")) == [1] * 9


def test_the_place_of_a_plane_is_no_point() -> None:
    lines = ["Units: mm"]
    for k, sort in enumerate(("Sphere", "Sphere", "Plane   Best Fit", "Circle", "Sphere")):
        lines += [f"Step: {k + 1}", f"ball{'abcde'[k]}", sort, "                      Actual     Nominal"]
        lines += [
            f"       {a} Location   {v + k * k:9.4f}   {v + k * k:9.4f}"
            for a, v in zip("XYZ", (100.5, 200.25, -50.125), strict=True)
        ]
    assert sorted(read(lines).columns["x_mm"].tolist()) == [100.5, 101.5, 109.5, 116.5]


def test_the_same_places_in_two_units_are_read_once() -> None:
    rows = [f"T{k},{k * 3.25:.4f},{7 - k * 1.5:.4f},{k % 3 + 0.125:.4f}" for k in range(6)]
    rows = [",".join([row, *(f"{float(v) * 25.4:.4f}" for v in row.split(",")[1:])]) for row in rows]
    found = read(["Name,X (in),Y (in),Z (in),X (mm),Y (mm),Z (mm)", *rows])
    assert found.columns["x_mm"][1] == pytest.approx(3.25 * 25.4)
    with pytest.raises(CmmUqError, match="may both be measured"):
        read(["Name,X (in),Y (in),Z (in),X (mm),Y (mm),Z (mm)", *rows[:-1], rows[-1].replace(",", ",1", 1)])


def test_a_place_under_two_names_of_many_is_two_points() -> None:
    lines = ["X;Y;Z"]
    for k in range(12):
        n = k % 11  # the last where the first was
        rows = [f"{n * 37 % 101 + 0.01 * m:.3f};{n * n * 53 % 97:.3f};{n * 29 % 83:.3f}" for m in range(3)]
        lines += [f"Pos {k + 1}", *rows]
    found = read(lines, unit="mm")
    assert groups(found) == [1] * 36
    assert found.columns["point"].tolist() == [k + 1 for k in range(12) for _ in range(3)]


def test_figures_ahead_of_a_table_are_no_points_of_it() -> None:
    lines = ["title,Plate", "location,250.0,316.0,50.0", "id,mmt_x,mmt_y,mmt_z"]
    assert (
        len(
            read(
                [*lines, *(f"{k},{133.0 * (k % 3) + 0.001:.4f},{133.0 * (k // 3):.4f},0.0012" for k in range(9))],
                unit="mm",
            ).lines
        )
        == 9
    )


def test_places_round_a_centre_with_their_radii_are_a_circular_test() -> None:
    rows = [f"{100.003 * np.cos(a):.4f};{100.003 * np.sin(a):.4f};100.0030" for a in np.arange(60) / 9.5]
    assert "circular test" in problem(["Centre: X=400.0 Y=300.0 Z=-150.0", "X [mm];Y [mm];Rayon [mm]", *rows])


@pytest.mark.parametrize("head", ["Hoek (graden)", "Angolo [gradi]", "Winkel [°]", "角度"])
def test_deviations_by_angle_are_a_circular_test(head: str) -> None:
    rows = [f"{5 * k}\t{np.sin(k / 9):.1f}\t{np.cos(k / 7):.1f}" for k in range(72)]
    table = ["Radial dR (um)", "", f"{head}\tCCW\tCW", *rows]
    assert "nothing says the radius" in problem(table)
    assert "nothing says the plane" in problem(["Radius: 100.0 mm", *table])


def test_coarse_places_between_which_lengths_were_measured_are_no_points() -> None:
    """As set up, to 0.01 inch, below words that nobody knows; the lengths to 0.00001."""
    ways = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.6, 0.8, 0), (0, 0.6, 0.8), (0.8, 0, 0.6)]
    rows = []
    for k, way in enumerate(ways, 1):
        ends = [[6.0 + k, 18.0 - k, 10.0], [6.0 + k + 19.69 * way[0], 18.0 - k + 19.69 * way[1], 10.0 + 19.69 * way[2]]]
        rows.append(";".join([str(k), *(f"{v:.2f}" for end in ends for v in end), f"{19.6852 + k * 1e-5:.5f}"]))
    with pytest.raises(CmmUqError) as asked:
        read(["Brogu;Kilba A X;Kilba A Y;Kilba A Z;Kilba B X;Kilba B Y;Kilba B Z;Trumi", *rows], unit="inch")
    assert "points_per_measurement" not in str(asked.value.fix)


def test_an_alignment_named_above_the_one_table_leaves_nothing_out() -> None:
    rows = [f"Ball {k};{130.0 * k + 0.0013:.4f};{k * k * 11.5:.4f};{k * 7.25:.4f}" for k in range(1, 9)]
    for between in ([], ["Exported,2024-02-06"]):
        assert len(read(["Alignment;Machine", *between, "Name;X;Y;Z", *rows], unit="mm").lines) == 8
        coordinates = [
            f"Ball {k};Centre {a};{v:.4f}"
            for k in range(1, 9)
            for a, v in zip("XYZ", (130.0 * k, k * k, 7 - k), strict=True)
        ]
        assert len(read(["Alignment;Machine", *between, "Name;Control;Meas", *coordinates], unit="mm").lines) == 8


def test_an_angle_that_rises_clockwise_may_be_counted_either_way() -> None:
    rows = [f"{5 * k};{np.sin(k / 9):.1f}" for k in range(72)]
    lines = ["Radius (mm);100", "Plane;XY", "Run 1 CW", "Angle (deg);Deviation (um)", *rows]
    assert "may be counted the way that it goes" in problem(lines)
    keys = ImportKeys(lines={"XY": "along X from 0,0,0"})
    found = imported("\n".join(lines).replace("CW", "CCW").encode(), "a.csv", keys)
    np.testing.assert_allclose(found.columns["y_mm"][18], 100.0)
    assert found.columns["approach_x"][18] == -1.0


def test_both_senses_of_a_circle_are_told_by_heads_or_a_column() -> None:
    head, keys = ["Kreisformtest", "Nennradius (mm);100,0", "Ebene;ZX"], ImportKeys(lines={"ZX": "along Z from 1,2,3"})
    wide = [f"{5 * k};{100 + k / 1e4:.4f};{100 - k / 1e4:.4f}".replace(".", ",") for k in range(72)]
    across = [*head, "Winkel [°];Radius im Uhrzeigersinn [mm];Radius gegen Uhrzeigersinn [mm]", *wide]
    long = [f"ZX;{way};{5 * k};{sign * k / 10:.1f}".replace(".", ",")
            for way, sign in (("Uhrzeigersinn", 1), ("gegen Uhrzeigersinn", -1)) for k in range(72)[::-sign]]  # fmt: skip
    down = [*head, "Ebene;Sinn;Winkel (°);Radiale Abweichung (µm)", *long]
    for lines in (across, down):
        found = imported("\n".join(lines).encode(), "a.csv", keys).columns
        np.testing.assert_allclose(np.hypot(found["z_mm"] - 3, found["x_mm"] - 1), 100.0)
        at_right = (found["read_x"] == 1.0) & (found["reading_um"] > 0)  # 90°: towards X, clockwise by its sign
        assert found["reading_um"][at_right].round(6).tolist() == [1.8]
        assert found["approach_z"][at_right].tolist() == [1.0]


def test_angles_beyond_the_arc_that_is_said_are_left_out() -> None:
    rows = [f"{angle};{angle / 100:.2f}" for angle in range(-90, 315, 5)]
    lines = ["Ballbar", "Radius (mm);100", "Plane;XY", "Overshoot", "CCW", "Angle (deg);Deviation (um)", *rows]
    assert "which arc" in problem(lines)
    lines[3] = "Start/end angle (deg);-60 / 300"
    found = imported("\n".join(lines).encode(), "a.csv", ImportKeys(lines={"XY": "along X from 0,0,0"}))
    assert len(found.lines) == 73
    assert found.columns["reading_um"].tolist()[0] == -0.6
    assert any("8 of angles" in fact.value for fact in found.recognised.facts)


def test_how_round_a_ring_is_is_no_circular_test() -> None:
    rows = [f"{5 * k};{np.sin(k / 9):.2f}" for k in range(73)]
    lines = ["Roundness of a ring, XY", "Radius (mm);25", "Angle [deg];Radial deviation [um]", *rows]
    assert "no " in problem(lines)
    assert "the plane of the circle" in problem(["Ballbar", *lines[1:2], "Plane;XZ CCW", *lines[2:]])
