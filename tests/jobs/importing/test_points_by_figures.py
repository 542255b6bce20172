"""What figures say of points holds whatever columns are called and wherever they stand: words only break ties."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.importing.format import ImportKeys
from cmm_uq.jobs.importing.recording import ImportedTable, imported

WORDS = ("Bade", "Fiku", "Lomi", "Nuvo", "Sare", "Tupo", "Wegi", "Zalu")  # of no language
BAR = np.array([0.0, 120.0, 210.0, 360.0, 500.0])  # places of the balls of a beam, unevenly spaced
PLACED = {"Q1": (60, 400, -300, 1, 0, 0), "Q2": (300, 80, -310, 0, 1, 0), "Q3": (90, 120, -420, 0.48, 0.6, 0.64)}


def observations() -> list[tuple[str, int, int, np.ndarray, np.ndarray]]:
    """Placement, ball, run, nominal and measured place of each ball of a beam in three placements, twice each."""
    random = np.random.default_rng(5)
    found = []
    for placement, (*start, a, b, c) in PLACED.items():
        for run in (1, 2):
            for ball, along in enumerate(BAR, 1):
                nominal = np.round(np.array(start) + along * np.array([a, b, c]), 1)
                found.append((placement, ball, run, nominal, np.round(nominal + random.normal(0, 0.002, 3), 4)))
    return found


SEEN = observations()
EXPECTED = sorted((int(one[0][1:]), one[1], one[2], *one[4]) for one in SEEN)


def columns(words: Sequence[str], *, deviations: bool, more: bool) -> list[list[str]]:
    """Columns of a table, each below its head."""
    text: list[list[str]] = [
        [words[0], *(one[0] for one in SEEN)],
        [words[1], *(f"K{one[1]}" for one in SEEN)],
        [words[2], *(f"{one[2]}" for one in SEEN)],
    ]
    for k, axis in enumerate("XYZ"):
        text.append([f"{axis} {words[3]}", *(f"{one[4][k]:.4f}" for one in SEEN)])
        text.append([f"{axis} {words[4]}", *(f"{one[3][k]:.4f}" for one in SEEN)])
        if deviations:
            text.append([f"{axis} {words[5]}", *(f"{one[4][k] - one[3][k]:.4f}" for one in SEEN)])
    if more:
        text += [[words[6], *(f"{12.5 + 0.0001 * (k % 3):.4f}" for k in range(len(SEEN)))]]
        text += [
            [f"{words[7]} {axis}", *(f"{n:.3f}" for _ in SEEN)] for axis, n in zip("XYZ", (0.6, 0.0, 0.8), strict=True)
        ]
    return text


def read(table: Sequence[Sequence[str]], sign: str = ".") -> ImportedTable:
    text = "\n".join(";".join(row).replace(".", sign) for row in zip(*table, strict=True))
    return imported(f"Wegi: mm\n\n{text}\n".encode(), "a.csv", ImportKeys(unit="mm"))


def rows(found: ImportedTable) -> list[tuple[float, ...]]:
    names = ("measurement", "point", "repeat", "x_mm", "y_mm", "z_mm")
    return sorted(zip(*(found.columns[name].tolist() for name in names), strict=True))


@settings(deadline=None, max_examples=40)
@given(
    st.permutations(WORDS), st.randoms(use_true_random=False), st.sampled_from(".,"), st.booleans(), st.booleans(),
)  # fmt: skip
def test_points_are_the_same_below_any_words_in_any_order(
    words: Sequence[str], order: object, sign: str, deviations: bool, more: bool
) -> None:
    table = columns(words, deviations=deviations, more=more)
    order.shuffle(table)  # type: ignore[attr-defined]
    assert rows(read(table, sign)) == EXPECTED


def test_an_empty_column_among_those_of_one_point_changes_nothing() -> None:
    """Three runs side by side, of which a head stands over each; without the column the same."""
    random = np.random.default_rng(8)
    xyz = np.round(np.linspace([120, 900, 300], [960, 180, 305], 8)[:, None] + random.normal(0, 1e-3, (8, 3, 3)), 4)
    cells = [[f"{ball}", *(f"{one:.4f}" for one in own.ravel())] for ball, own in enumerate(xyz, 1)]
    heads = [["", "Medida 1", "", "", "Medida 2", "", "", "Medida 3", "", ""], ["Esfera", *("XYZ" * 3)]]
    plain = read([list(one) for one in zip(*heads, *cells, strict=True)])
    apart = read([list(one) for one in zip(*([*row[:2], "", *row[2:]] for row in [*heads, *cells]), strict=True)])
    assert len(plain.lines) == 24
    assert rows(plain) == rows(apart)


def test_a_row_for_each_axis_is_the_same() -> None:
    """A feature a block, with its diameter; names of three parts, and no word that is known."""
    lines = ["Wegi: mm"]
    for placement, ball, run, nominal, measured in SEEN:
        lines += [f"Fiku  {placement}_{ball}_{run}", "      Lomi        Nuvo        Sare       +Tupo      -Tupo"]
        lines += [
            f"  {axis}  {n:12.4f}{m:12.4f}{m - n:12.4f}     0.0500    -0.0500"
            for axis, n, m in zip("XYZ", nominal, measured, strict=True)
        ]
        lines += ["  D       25.0000     25.0011      0.0011     0.0500    -0.0500", ""]
    found = imported("\n".join(lines).encode(), "a.txt", ImportKeys(unit="mm"))
    assert rows(found) == EXPECTED


def test_nominal_values_alone_are_not_taken_for_measured_ones() -> None:
    table = [own for own in columns(WORDS, deviations=True, more=False) if WORDS[3] not in own[0]]
    with pytest.raises(CmmUqError, match="may be nominal values"):
        read(table)


def test_two_lists_that_are_measured_alike_are_asked_about() -> None:
    table = [own for own in columns(WORDS, deviations=False, more=False) if WORDS[4] not in own[0]]
    table += [[f"{axis} {WORDS[5]}", *(f"{one[4][k] + 0.001:.4f}" for one in SEEN)] for k, axis in enumerate("XYZ")]
    with pytest.raises(CmmUqError, match="may both be measured places"):
        read(table)


def test_rows_of_a_plate_are_no_measurements_of_a_beam() -> None:
    names = [f"{letter}{k}" for letter in "ABCDE" for k in range(1, 6)]
    places = [(83 * k, 83 * m, 5) for m in range(5) for k in range(5)]
    random = np.random.default_rng(6)
    rows_ = (
        ";".join([name, *(f"{v + random.normal(0, 0.002):.4f}" for v in at)])
        for name, at in zip(names, places, strict=True)
    )
    found = imported(("Name;X;Y;Z\n" + "\n".join(rows_)).encode(), "a.csv", ImportKeys(unit="mm"))
    assert set(found.columns["measurement"]) == {1}
    assert len(set(found.columns["point"])) == 25


def test_a_square_that_was_measured_again_is_not_one_that_was_turned() -> None:
    """Six rows in turn, three times, would be a square and half of it, turned by half a turn about its middle."""
    random = np.random.default_rng(7)
    places = [(61, 118), (290, 118), (290, 271), (61, 271)] * 3
    table = (",".join(f"{v + random.normal(0, 0.002):.4f}" for v in (*at, -37)) for at in places)
    with pytest.raises(CmmUqError, match="nothing says which points belong to one measurement"):
        imported(("X,Y,Z\n" + "\n".join(table)).encode(), "a.csv", ImportKeys(unit="mm"))


@pytest.mark.parametrize(("away", "count"), [(0.02, 2), (0.0, 1)])
def test_a_title_tells_two_artefacts_apart_at_one_place_where_what_was_repeated_lies_closer(
    away: float, count: int
) -> None:
    random, lines = np.random.default_rng(8), ["Wegi: mm"]
    for k in range(6):
        lines += [f"Fiku: Q{k // 3 + 1}", f"Lomi: {20261001 + k}", "Nuvo,X,Y,Z"]
        for name, x, y in (("K1", 50, 14), ("K2", 30, 98), ("K3", 72, 98)):
            xyz = random.normal((x + away * (k // 3), y - away * (k // 3), 25), 0.001)
            lines.append(",".join([name, *(f"{v:.4f}" for v in xyz)]))
    found = imported("\n".join(lines).encode(), "a.csv", ImportKeys(unit="mm")).columns
    assert len(set(found["measurement"])) == count
    assert set(found["repeat"]) == set(range(1, 6 // count + 1))


@pytest.mark.parametrize("names", ["POS{}_BALL{}_M{}", "BAR{}_S{}_R{}", "Lage{}_K{}_W{}"])
@pytest.mark.parametrize(("bars", "parallel"), [(6, True), (6, False), (900, False)])
def test_bars_are_bars_however_many_there_are_and_however_they_lie(names: str, bars: int, *, parallel: bool) -> None:
    """The balls of parallel bars lie as two shifted artefacts would; names say that they do not."""
    random = np.random.default_rng(9)
    along = np.tile([0.6, 0.0, 0.8], (bars, 1)) if parallel else random.standard_normal((bars, 3))
    first = random.uniform(0, 800, (bars, 3))
    ends = np.stack([first, first + 400 * along / np.linalg.norm(along, axis=1)[:, None]], axis=1)
    rows = ["name,x,y,z"]
    for m in (1, 2, 3):
        read = ends + random.normal(0, 0.002, ends.shape)
        every = ((p, b) for p in range(bars) for b in (0, 1))
        rows += [",".join([names.format(p + 1, b + 1, m), *(f"{v:.4f}" for v in read[p, b])]) for p, b in every]
    found = imported("\n".join(rows).encode(), "a.csv", ImportKeys(unit="mm")).columns
    assert [int(found[name].max()) for name in ("measurement", "point", "repeat")] == [bars, 2, 3]


ARTEFACTS = {
    "bar": [(0, 0, 0), (400, 0, 0)], "beam": [(x, 0, 0) for x in (0, 100, 200, 300, 400)],
    "triangle": [(0, 0, 0), (300, 0, 0), (150, 260, 0)],
    "plate": [(x, y, 0) for y in (0, 100, 200) for x in (0, 100, 200)],
}  # fmt: skip
NAMES = ("POS{}_BALL{}_M{}", "Lage {} Kugel {} Wdh {}", "P{}_S{}_R{}", "BB{}_{}_{}", "M{2}_P{0}_B{1}", "Q{}W{}Z{}")


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("repeats_outside", [False, True])
@pytest.mark.parametrize("artefact", ARTEFACTS)
def test_what_names_and_figures_leave_open_is_asked_and_never_read_otherwise(
    artefact: str, *, repeats_outside: bool, turned: bool
) -> None:
    """Four places of an artefact, three times, by names of several kinds: shifted, a letter P may be a point or a position."""
    random, read = np.random.default_rng(11), dict[str, bool]()
    own = np.array(ARTEFACTS[artefact], dtype=float)
    places = []
    for k in range(4):
        basis = np.linalg.qr(random.standard_normal((3, 3)))[0] if turned else np.eye(3)
        places.append(own @ basis + np.array([80 * k + 50, 300 + 90 * k * (-1) ** k, 40 * k - 400]))
    order = (
        [(k, m) for m in range(3) for k in range(4)]
        if repeats_outside
        else [(k, m) for k in range(4) for m in range(3)]
    )
    rows = [(k, b, m, places[k][b] + random.normal(0, 0.002, 3)) for k, m in order for b in range(len(own))]
    for pattern in NAMES:
        text = ["name;x;y;z", *(
            ";".join([pattern.format(k + 1, b + 1, m + 1), *(f"{v:.4f}" for v in xyz)]) for k, b, m, xyz in rows
        )]  # fmt: skip
        try:
            found = imported("\n".join(text).encode(), "a.csv", ImportKeys(unit="mm")).columns
        except CmmUqError:
            continue
        told = zip(*(found[name].tolist() for name in ("measurement", "point", "repeat")), strict=True)
        one_to_one = {(one, (k, b, m)) for one, (k, b, m, _) in zip(told, rows, strict=True)}
        placed = {(one[0], k) for one, (k, _, _) in one_to_one}
        read[pattern] = len(one_to_one) == len(rows) and len(placed) == 4
    assert all(read.values()), read
    assert {NAMES[0], NAMES[1]} <= read.keys()
    assert not turned or len(read) >= 5


def test_whole_nominal_coordinates_name_no_measurement() -> None:
    """A row for each axis, the feature in the first of them, and its diameter below."""
    text = ["Feature;Axis;Nominal;Upper tol;Lower tol;Actual;Error"]
    for ball, (x, y) in enumerate(((x, y) for y in (140, 250) for x in (80, 190, 300)), 1):
        for n, (axis, nominal) in enumerate((("X", x), ("Y", y), ("Z", 95), ("Dia", 20))):
            error = ((7 * ball + 3 * n) % 11 - 5) / 1e4
            name = f"Sphere {ball}" * (n == 0)
            text += [f"{name};{axis};{nominal};0.02;-0.02;{nominal + error:.4f};{error:.4f}"]
    found = imported("\n".join([*text, ""]).encode(), "a.csv", ImportKeys(unit="mm"))
    assert found.columns["point"].tolist() == [1, 2, 3, 4, 5, 6]
    assert {*found.columns["measurement"].tolist()} == {1}


def test_coarse_places_of_balls_beside_a_fine_length_say_where_it_lay() -> None:
    """Set-up values in hundredths of an inch: what was measured is the length of the bar."""
    text = ["POS;X;Y;Z;X;Y;Z;MEASURED LENGTH (IN);DEV. (IN)"]
    for k in range(20):
        length = 19.68520 + (7 * k % 13) / 1e5
        text += [f"{k + 1};{6 + k:.2f};18.00;10.00;{25.69 + k:.2f};18.00;10.00;{length:.5f};{(7 * k % 13) / 1e5:.5f}"]
    found = imported("\n".join([*text, ""]).encode(), "a.csv", ImportKeys(unit="inch"))
    ends = np.column_stack([found.columns[f"{axis}_mm"] for axis in "xyz"]).reshape(-1, 2, 3)
    lengths = [25.4 * (19.68520 + (7 * k % 13) / 1e5) for k in range(20)]
    np.testing.assert_allclose(np.linalg.norm(np.diff(ends, axis=1)[:, 0], axis=1), lengths, rtol=1e-9)
    assert ends[0, 0].tolist() == pytest.approx([152.4, 457.2, 254.0])


def in_own_coordinates(head: str) -> list[list[str]]:
    """A plate in two placements, twice each, all in its own coordinates: below a head of placement, run and ball."""
    random = np.random.default_rng(7)
    balls = [(133.0 * (k % 3), 133.0 * (k // 3), 0.0) for k in range(9)]
    return [[*head.split(";"), "X [mm]", "Y [mm]", "Z [mm]"]] + [
        [name, f"{run}", f"K{k + 1}", *(f"{value + random.normal(0, 0.001):.4f}" for value in ball)]
        for name in ("A0B0", "A90B180")
        for run in (1, 2)
        for k, ball in enumerate(balls)
    ]


@pytest.mark.parametrize(
    "head",
    ["Setup;Run;Ball", "Station;Measurement;Ball", "Head;Pass;Sphere", "Aufspannung;Messung;Kugel", "装夹;次;球"],
)
def test_placements_of_what_has_coordinates_of_its_own_are_no_repeats(head: str) -> None:
    found = read(in_own_coordinates(head)).columns
    numbers = sorted({*zip(*(found[name].tolist() for name in ("measurement", "point", "repeat")), strict=True)})
    assert numbers == [(m, p, r) for m in (1, 2) for p in range(1, 10) for r in (1, 2)]


def test_what_may_be_placements_or_repeats_at_the_same_places_is_asked() -> None:
    table = in_own_coordinates("Bade;Fiku;Kugel")
    with pytest.raises(CmmUqError, match="which points belong to one measurement"):
        read([[row[0], *row[2:]] for row in table if row[1] != "2"])
    with pytest.raises(CmmUqError, match="which points belong to one measurement"):
        read(table)
