"""DMIS programs: features with their points in one frame, tolerances by what they are put out with, the rest by name.

Statements as ISO 22093 writes them. That a frame is followed right is seen by saying the same part in two frames.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.part.dmis import drawing_of_dmis
from cmm_uq.jobs.part.drawing import Drawing

HEAD = """DMISMN/'PLATE', 4.0
UNITS/MM,ANGDEC
SNSMNT/XVEC,0,-1,0,ZVEC,0,0,-1,MNTLEN,0,0,-175.1
S(P1)=SNSDEF/PROBE,INDEX,POL,0,0,0,0,-1,50,4.0
SNSLCT/S(P1)
MODE/PROG,MAN
"""
TOP = """F(TOP)=FEAT/PLANE,CART,0,0,30,0,0,1
MEAS/PLANE,F(TOP),3
  GOTO/0,0,100
  PTMEAS/CART,-40,+20,30,0,0,1
  PTMEAS/CART,40,20,30, 0,0,1
  PTMEAS/CART,40,-20,30,0,0,1
ENDMES
DATDEF/FA(TOP),DAT(A)
"""
EDGE = "F(EDGE)=FEAT/LINE,UNBND,CART,0,-50,20,1,0,0, $\n0,-1,0\n"
BORE = """F(BORE)=FEAT/CYLNDR,INNER,CART,10,5,26,0,0,-1,31.0,12.0
T(DIA)=TOL/DIAM,-0.1,0.2
T(FORM)=TOL/CYLCTY,0.02
T(SQ)=TOL/PERP,0.05,RFS,DAT(A)
MEAS/CYLNDR,F(BORE),5
  PTMEAS/CART,10,20.5,23,0,-1,0
  PTMEAS/CART,25.5,5,23,-1,0,0
  PTMEAS/CART,10,-10.5,23,0,1,0
  PTMEAS/CART,-5.5,5,17,1,0,0
  PTMEAS/CART,10,20.5,17,0,-1,0
ENDMES
OUTPUT/FA(BORE),TA(DIA),TA(FORM), TA(SQ)
"""


def read(*parts: str) -> Drawing:
    return drawing_of_dmis("".join([HEAD, *parts, "ENDFIL\n"]).encode(), "plate.dmi")


def test_a_program_without_a_unit_is_refused() -> None:
    """It was read in mm: of a program in inches limits of 0.1 in were 0.1 mm."""
    with pytest.raises(CmmUqError, match="does not say its unit"):
        drawing_of_dmis("".join([HEAD.replace("UNITS/MM,ANGDEC\n", ""), TOP, BORE]).encode(), "plate.dmi")


def named(tables: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    return {one["name"]: one for one in tables}


def test_features_come_with_their_points_and_stylus() -> None:
    found = read(TOP, BORE)
    assert not found.unknown
    top, bore = named(found.features)["TOP"], named(found.features)["BORE"]
    assert top == {
        "name": "TOP", "kind": "plane", "point_mm": [0, 0, 30], "direction": [0, 0, 1], "stylus": "P1",
        "points_mm": [[-40, 20, 30], [40, 20, 30], [40, -20, 30]],
    }  # fmt: skip
    assert (bore["diameter_mm"], bore["inner"], bore["direction"], len(bore["points_mm"])) == (
        31.0,
        True,
        [0, 0, -1],
        5,
    )
    # 50 mm along (0, 0, -1) below where the head is mounted
    assert found.styli == [{"name": "P1", "diameter_mm": 4.0, "offset_mm": [0, 0, pytest.approx(-225.1)]}]
    assert found.datums == ["TOP"]


def test_tolerances_are_of_what_they_are_put_out_with() -> None:
    assert read(TOP, BORE).characteristics == [
        {"name": "DIA", "what": "size", "features": ["BORE"], "lower_mm": 30.9, "upper_mm": 31.2},
        {"name": "FORM", "what": "cylindricity", "features": ["BORE"], "tolerance_mm": 0.02},
        {"name": "SQ", "what": "perpendicularity", "features": ["BORE"], "datums": ["TOP"], "tolerance_mm": 0.05},
    ]


def test_inches_become_millimetres() -> None:
    found = read("UNITS/INCH,ANGDEC\n", TOP, BORE)
    assert named(found.features)["BORE"]["diameter_mm"] == pytest.approx(31 * 25.4)
    assert named(found.features)["TOP"]["points_mm"][0] == pytest.approx([-1016, 508, 762])
    assert named(found.characteristics)["DIA"]["upper_mm"] == pytest.approx(31.2 * 25.4)


FRAMES = {
    "shift": ("D(W)=TRANS/XORIG,10,YORIG,5\n", lambda p: (p[0] - 10, p[1] - 5, p[2])),
    "turn": ("D(W)=ROTATE/ZAXIS,90\n", lambda p: (p[1], -p[0], p[2])),
    "turn, then shift along what is x now": (
        "D(V)=ROTATE/ZAXIS,90\nD(W)=TRANS/XORIG,7\n", lambda p: (p[1] - 7, -p[0], p[2])),
    "to a feature": ("D(W)=TRANS/ZORIG,FA(TOP)\n", lambda p: (p[0], p[1], p[2] - 30)),
    "x along a line": ("D(W)=ROTATE/ZAXIS,FA(EDGE),-XDIR\n", lambda p: (-p[0], -p[1], p[2])),
    "y along a line": ("D(W)=ROTATE/ZAXIS,FA(EDGE),YDIR\n", lambda p: (-p[1], p[0], p[2])),
    "z along a datum it has already": ("D(W)=DATSET/DAT(A),ZDIR\n", lambda p: p),
    "x along a datum": ("D(W)=DATSET/DAT(A),XDIR\n", lambda p: (p[2], p[1], -p[0])),
}  # fmt: skip
"""A change of frame, and the coordinates in the new frame of a point of the old one: written out by hand."""


@pytest.mark.parametrize("name", FRAMES)
def test_what_is_said_in_another_frame_is_the_same_part(name: str) -> None:
    change, into = FRAMES[name]
    moved = []
    for line in BORE.splitlines():
        start, cart, rest = line.partition("CART,")
        if not cart:
            moved.append(line)
            continue
        number = [float(word) for word in rest.split(",")]
        origin = np.array(into((0.0, 0.0, 0.0)))
        vectors = [*into(tuple(number[:3])), *(np.array(into(tuple(number[3:6]))) - origin)]
        moved.append(start + cart + ",".join(f"{value:.12g}" for value in [*vectors, *number[6:]]))
    plain, other = read(TOP, EDGE, BORE), read(TOP, EDGE, change, "\n".join(moved) + "\n")
    one, same = named(plain.features)["BORE"], named(other.features)["BORE"]
    for key in ("point_mm", "direction", "points_mm"):
        np.testing.assert_allclose(same[key], one[key], atol=1e-9)


def test_a_stylus_turned_by_a_wrist_is_not_understood() -> None:
    program = HEAD.replace("POL,0,0,", "POL,90,0,") + TOP + BORE + "ENDFIL\n"
    found = drawing_of_dmis(program.encode(), "plate.dmi")
    assert [one.name for one in found.unknown] == ["P1", "SNSLCT/S(P1)"]
    assert found.styli == [{"name": "P1", "diameter_mm": 0.0}]


def test_a_frame_before_the_first_feature_places_the_part() -> None:
    placed = read("D(P)=TRANS/XORIG,355.0,YORIG,91.0\n", TOP, BORE)
    assert placed.features == read(TOP, BORE).features


ROUND = "F(C)=FEAT/CIRCLE,INNER,CART,0,0,0,0,0,1,30\nP(ARC)=PATH/ARC,CART,0,0,0,0,0,1,15,0,360\n"


@pytest.mark.parametrize(("statements", "name", "why"), [
    ("F(C)=FEAT/CONE,INNER,CART,0,0,0,0,0,1,30\n", "C", "is a feature CONE, which is not read"),
    ("F(C)=FEAT/CIRCLE,INNER,POL,0,0,0,0,0,1,30\n", "C", "is not given in Cartesian coordinates"),
    ("F(C)=FEAT/CIRCLE,CART,0,0,0,0,0,1,30\n", "C", "does not say INNER or OUTER"),
    ("F(C)=FEAT/CIRCLE,INNER,CART,0,0,0,0,0,1,30\n", "C", "is a feature that is not measured"),
    ("T(X)=TOL/FLAT,0.1\n", "X", "is a tolerance without a feature"),
    ("T(X)=TOL/PROFS,0.1\nOUTPUT/FA(TOP),TA(X)\n", "X", "is the profile of a surface, which is not modelled"),
    ("T(X)=TOL/POS,2D,0.1,MMC,DAT(A)\nOUTPUT/FA(BORE),TA(X)\n", "X", "holds at maximum material condition"),
    ("T(X)=TOL/POS,2D,0.1,RFS,DAT(A),LMC\nOUTPUT/FA(BORE),TA(X)\n", "X", "holds at least material condition"),
    ("T(X)=TOL/DIAM,-0.1,0.1,LP\nOUTPUT/FA(BORE),TA(X)\n", "X", "is a two-point size"),
    ("T(X)=TOL/PROFL,0.1\nOUTPUT/FA(TOP),TA(X)\n", "X", "is the profile of a line"),
    (f"{ROUND}MEAS/CIRCLE,F(C),1\nPAMEAS/DISTANCE,0.1,P(ARC),0,0,1\nENDMES\n", "C", "is scanned: what scanning adds"),
    (f"{ROUND}SCNMOD/ON\nMEAS/CIRCLE,F(C),1\nPTMEAS/CART,15,0,0,-1,0,0\nENDMES\n", "C", "is scanned: what scanning adds"),
    ("T(X)=TOL/PERP,0.1,DAT(B)\nOUTPUT/FA(BORE),TA(X)\n", "X", "is about the datum B, which is no feature"),
    ("T(X)=TOL/DIAM,-0.1,0.1\nOUTPUT/FA(TOP),TA(X)\n", "X", "is a size of a plane, which is not read"),
    ("T(X)=TOL/FLAT,0.1,DAT(A)\nOUTPUT/FA(TOP),TA(X)\n", "X", "is a flatness with a datum, which has none"),
    ("T(X)=TOL/FLAT,0\nOUTPUT/FA(TOP),TA(X)\n", "X", "is a tolerance of 0"),
    ("CONST/LINE,F(L),INTOF,FA(TOP),FA(BORE)\n", "L", "is constructed of other features"),
    ("IF/('A',GT,3)\n", "IF/('A',GT,3)", "is a statement IF, which is not read"),
])  # fmt: skip
def test_what_is_not_understood_is_told_by_name(statements: str, name: str, why: str) -> None:
    found = read(TOP, BORE, statements)
    told = [one for one in found.unknown if one.name == name]
    assert len(told) == 1
    with pytest.raises(CmmUqError, match=why):
        found.settled([], "plate.dmi")
    assert name in found.settled([name], "plate.dmi")
    assert {one["name"] for one in found.features} == {"TOP", "BORE"}


@pytest.mark.parametrize("change", [
    "D(W)=ITERAT/FA(TOP)\n", "D(W)=DATSET/DAT(A),ZDIR,DAT(B),XDIR\n", "D(W)=ROTATE/ZAXIS,FA(TOP),XDIR\n", "D(W)=DATSET/MCS\n",
    "D(W)=TRANS/XORIG,FA(NONE)\n", "RECALL/D(W)\n",
])  # fmt: skip
def test_a_frame_that_cannot_be_followed_ends_the_reading(change: str) -> None:
    with pytest.raises(CmmUqError, match=r"plate\.dmi line 15: a frame"):
        read(TOP, change, BORE)


def test_a_tolerance_is_in_the_unit_of_its_line() -> None:
    with pytest.raises(CmmUqError, match="the unit changes after features or tolerances were defined"):
        read("T(X)=TOL/FLAT,0.1\n", "UNITS/INCH,ANGDEC\n", TOP)


BELOW = TOP.replace("TOP", "LOW").replace("DAT(A)", "DAT(L)").replace(",30,", ",0,").replace(",30, ", ",0, ")


@pytest.mark.parametrize(("defined", "datum"), [("", "L-A"), ("DATDEF/FA(LOW),FA(TOP),DAT(E)\n", "E")])
def test_a_datum_on_two_features_is_one_on_both(defined: str, datum: str) -> None:
    """Named by its parts in the tolerance, or defined on both."""
    found = read(TOP, BELOW, defined, BORE, f"T(X)=TOL/PERP,0.1,DAT({datum})\nOUTPUT/FA(BORE),TA(X)\n")
    assert not found.unknown
    assert named(found.characteristics)["X"]["datums"] == ["LOW-TOP"]


def test_what_was_left_out_takes_along_what_is_of_it() -> None:
    found = read(TOP, BORE)
    assert set(found.settled(["TOP"], "plate.dmi")) == {"TOP", "SQ"}
    assert [one["name"] for one in found.characteristics] == ["DIA", "FORM"]
    with pytest.raises(CmmUqError, match=r"has nothing named 'TOPP'\. Did you mean 'TOP'"):
        read(TOP, BORE).settled(["TOPP"], "plate.dmi")


@given(
    at=st.integers(0, 2000),
    cut=st.integers(0, 40),
    put=st.sampled_from(["", ",", "(", ")", "/", "nan", "1e999", "$\n", "F("]),
)
def test_a_damaged_program_is_read_or_refused_in_words(at: int, cut: int, put: str) -> None:
    text = HEAD + TOP + EDGE + "D(W)=ROTATE/ZAXIS,FA(EDGE),XDIR\n" + BORE
    at %= len(text)
    with suppress(CmmUqError):
        found = drawing_of_dmis((text[:at] + put + text[at + cut :]).encode(), "plate.dmi")
        found.settled(["*"], "plate.dmi")
        assert found.features
        assert found.characteristics


def test_a_tolerance_and_a_datum_are_what_they_were_where_they_are_put_out() -> None:
    """Labels that a program uses again: the bore has ±0.1 about the top, whatever they stand for later."""
    later = """T(DIA)=TOL/DIAM,-0.5,0.5
T(SQ)=TOL/PERP,0.5,DAT(A)
DATDEF/FA(BORE),DAT(A)
"""
    found = read(TOP, BORE, later)
    assert not found.unknown
    assert found.characteristics == read(TOP, BORE).characteristics


@pytest.mark.parametrize(
    "tolerance",
    ["DIAM,-0,1,0,2", "DIAM,-0.1,0.2,31", "CYLCTY,0.02,0.005", "PERP,0.05,0.01,25,DAT(A)", "POS,2D,0.1,0.2,DAT(A)"],
)
def test_further_numbers_of_a_tolerance_are_not_dropped(tolerance: str) -> None:
    """Those of a second zone for each length or area are a demand too, and a decimal comma makes two of one."""
    found = read(TOP, BORE, f"T(MORE)=TOL/{tolerance}\nOUTPUT/FA(BORE),TA(MORE)\n")
    assert "MORE" not in named(found.characteristics)
    ((name, why),) = [(one.name, one.why) for one in found.unknown]
    assert name == "MORE"
    assert "further numbers" in why


def test_a_tolerance_of_two_features_together_is_not_that_of_the_first() -> None:
    found = read(TOP, BORE.replace("OUTPUT/FA(BORE),TA(DIA)", "OUTPUT/FA(BORE),FA(TOP),TA(DIA)"))
    assert not found.characteristics
    assert {one.why for one in found.unknown} == {"is a tolerance of BORE and TOP together, which is not read"}
