"""Where lines lie, as titles, columns and remarks of exports say it: read with the words that say it, or asked."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from cmm_uq.app.commands.jobs.exchange import lines_asked
from cmm_uq.jobs.importing.format import ImportKeys
from cmm_uq.jobs.importing.lengths.places import place_of_line, said_in
from cmm_uq.jobs.importing.lengths.placing import place_of_axis
from cmm_uq.jobs.importing.recording import ImportedTable, UnplacedError, imported

WHOLE = {
    "Position 4: Diagonal from (100, 100, 60) towards (400, 500, 60)": "from 100,100,60 to 400,500,60",
    "Läge 1 längs X; från X Y Z = 40 / 1000 / 400; till X Y Z = 540 / 1000 / 400": "from 40,1000,400 to 540,1000,400",
    "E0 – parallelo asse Y, da (120; 300; 220) a (120; 800; 220)": "from 120,300,220 to 120,800,220",
    "diagonale du plan XY, Z = 180, de (80 ; 60) à (380 ; 460)": "from 80,60,180 to 380,460,180",
    "位置4：空间对角线，(70,110,60)→(370,510,60)": "from 70,110,60 to 370,510,60",
    "od bodu [2 700; 110; 50] do bodu [3 000; 510; 50]": "from 2700,110,50 to 3000,510,50",
    "Position 1: Parallel to X, start (80, 350, 250)": "along X from 80,350,250",
    "axe Z, X=400 Y=400, départ Z=50": "along Z from 400,400,50",
    "Start X 40,0 Y 500,0 Z -300,0 Richtung (1,0000 0,0000 0,0000)": "from 40,500,-300 to 540,500,-300",
    "X = 50 ... 550, Y = 500, Z = 300": "from 50,500,300 to 550,500,300",
    "Linie B: X von 50 bis 550 mm, Y=500 mm, Z=300 mm": "from 50,500,300 to 550,500,300",
    "-X, Startpunkt (900; 350; 250)": "along -X from 900,350,250",
}
OPEN = {
    "X-Achse, Y=600, Z=350": "along X from ?,600,350",
    "längs Y, X = 1 500 Z = 600": "along Y from 1500,?,600",
    "parallel X (Y 800 / Z 400)": "along X from ?,800,400",
    "oś Z": "along Z from ?,?,?",
}
NONE = (
    "Messbereich (1000; 1200; 700)",
    "Zeiss CONTURA 10/12/6",
    "Diagonale XY",
    "from (100, 100, 60) to (300, 100, 60)",  # shorter than its lengths
    "(0; 0; 0) (1000; 1200; 700)",  # far longer, and nothing says that they are ends
    "along X, from (100, 100, 60) to (100, 600, 60)",  # which is along Y
    "Mitte (300; 350; 250), X-Achse",
    "X axis, start (900, 350, 250)",  # whose other way is as good
)


@pytest.mark.parametrize("text", [*WHOLE, *OPEN])
def test_a_text_says_where_a_line_lies(text: str) -> None:
    sign = "," if re.search(r"\d,\d\D", text) and "位" not in text else "."
    assert place_of_line([said_in([text], sign)], 500.0, 1.0) == {**WHOLE, **OPEN}[text]


@pytest.mark.parametrize("text", NONE)
def test_what_is_no_place_or_leaves_one_open_is_none(text: str) -> None:
    place = place_of_line([said_in([text])], 500.0, 1.0)
    assert not re.search(r"\d", place), place


@settings(deadline=None, max_examples=200)
@given(
    st.lists(st.integers(-900, 900), min_size=3, max_size=3),
    st.lists(st.integers(-900, 900), min_size=3, max_size=3),
    st.sampled_from(["({}; {}; {})", "[{} / {} / {}]", "X={} Y={} Z={}", "X {}, Y {}, Z {}"]),
    st.sampled_from([("from", "to"), ("von", "bis"), ("起点", "终点"), ("Anfang", "Ende"), ("da", "a")]),
)
def test_stated_ends_are_those_of_the_line_or_it_is_asked(
    start: list[int], end: list[int], form: str, words: tuple[str, str]
) -> None:
    reach = float(np.linalg.norm(np.subtract(end, start)))
    text = f"Line 1 {words[0]} {form.format(*start)} {words[1]} {form.format(*end)}"
    places = {place_of_line([said_in([text])], length, 1.0) for length in (reach / 2, reach)}
    own = ("from {},{},{} to {},{},{}".format(*start, *end),) if reach > 1 else ("",)
    assert places == {*own} or reach < 4
    assert place_of_line([said_in([text])], reach + 5 + reach / 100, 1.0) == ""


def test_words_of_no_language_make_no_other_place() -> None:
    """Two places without a word are start and end in their order; one alone is asked about."""
    both = "Brogu 4: wul (100; 100; 60) zan (400; 500; 60)"
    assert place_of_line([said_in([both])], 500.0, 1.0) == "from 100,100,60 to 400,500,60"
    assert place_of_line([said_in(["Brogu X, wul (100; 100; 60)"])], 500.0, 1.0) == ""


def lengths(*titles: str, beside: str = "") -> ImportedTable:
    rows = [beside]
    for title in titles:
        rows += [title, "Calibrated [mm];Run 1 [mm];Run 2 [mm];Error 1 [µm];Error 2 [µm]"]
        rows += [
            f"{n}.0004;{n}.0{5 + i}04;{n}.0{6 + i}04;{50 + 10 * i}.0;{60 + 10 * i}.0"
            for i, n in enumerate((100, 300, 500))
        ]
    return imported("\n".join([*filter(None, rows), ""]).encode(), "e0.csv", ImportKeys())


def test_places_stand_with_the_words_that_say_them_and_a_job_may_say_others() -> None:
    found = lengths("Position 1: parallel X; start (50, 400, 200)", "Position 2: parallel Y; start (300, 60, 200)")
    assert {*found.places.values()} == {"along X from 50,400,200", "along Y from 300,60,200"}
    (told,) = (str.__str__(fact.value) for fact in found.recognised.facts if fact.key == "lines")
    assert "as the file says: Position 1: parallel X start (50, 400, 200)" in told


def test_what_a_file_leaves_open_of_a_line_is_proposed_and_asked() -> None:
    with pytest.raises(UnplacedError) as asked:
        lengths("Position 1: X axis Y=400 Z=200", "Position 2: from (50, 60, 70) to (650, 60, 70)")
    proposed = lines_asked(asked.value)
    assert proposed is not None
    assert [own[0] for own in proposed[2].values()] == ["along X from ?,400,200", "from 50,60,70 to 650,60,70"]


def test_a_remark_speaks_of_the_line_that_it_names() -> None:
    remark = "P1 start (20, 400, 200) along X   P2 start (300, 30, 200) along Y"
    found = lengths("Position P1", "Position P2", beside=remark)
    assert [*found.places.values()] == ["along X from 20,400,200", "along Y from 300,30,200"]


def test_the_place_of_runs_is_both_other_coordinates_beside_the_axis() -> None:
    texts = ["Date: X=3", "AXIS : Y  LOCATION  X=20.0 Z=12.0"]
    assert place_of_axis("Y", texts, 25.4, ".") == ("along Y from 508,0,304.8", texts[1])
    assert place_of_axis("Y", [*texts, "axis Y: X=20.0 Z=14.0"], 25.4, ".") is None
    assert place_of_axis("Z", texts, 25.4, ".") is None
