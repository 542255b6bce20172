"""Twelve exports of one measurement, in other languages and units, and damaged: read right, or refused for the right cause."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.importing.format import ImportKeys
from cmm_uq.jobs.importing.recording import ImportedTable, imported
from tests.jobs.importing.exports import EXPORTS, NUMBERS, XYZ

PAIRS = {"trace.txt": {"points_per_measurement": 2}}
"""What an export leaves open: a trace has no names."""

LANGUAGES = [(name, language) for name in EXPORTS for language in (
    ("en", "de", "fr", "it", "es") if name.endswith(("csv", "txt", "xlsx", "ods")) and name[:3] not in ("rep", "bar", "tra")
    else ("en", "de"))]  # fmt: skip


def read(name: str, content: bytes, **keys: object) -> ImportedTable:
    return imported(content, name, ImportKeys.model_validate({**PAIRS.get(name, {}), **keys}))


def coordinates(found: ImportedTable) -> np.ndarray:
    return np.column_stack([found.columns[f"{axis}_mm"] for axis in "xyz"])


@pytest.mark.parametrize(("name", "language"), LANGUAGES)
def test_an_export_is_read_to_its_last_digit_in_every_language(name: str, language: str) -> None:
    found = read(name, EXPORTS[name](language, "mm"))
    assert coordinates(found).tolist() == XYZ.tolist()
    assert list(zip(found.columns["measurement"], found.columns["point"], strict=True)) == list(NUMBERS)


@pytest.mark.parametrize("name", [name for name in EXPORTS if name != "trace.txt"])
def test_an_export_in_inches_is_the_same_in_millimetres(name: str) -> None:
    """Nine digits of an inch are a hundredth of a nanometre."""
    found = read(name, EXPORTS[name]("en", "in"))
    assert coordinates(found) == pytest.approx(XYZ, abs=25.4 * 0.51e-9)
    assert found.recognised.data["unit"].startswith("inch")


def test_a_trace_is_in_millimetres_by_its_specification_whatever_a_job_says() -> None:
    with pytest.raises(CmmUqError, match="the unit is mm in the file and inch by the key unit"):
        read("trace.txt", EXPORTS["trace.txt"]("en", "mm"), unit="inch")


def cut(part: float) -> Callable[[bytes], bytes]:
    return lambda content: content[: int(len(content) * part)]


def put(old: str, new: str, encoding: str = "cp1252") -> Callable[[bytes], bytes]:
    def changed(content: bytes) -> bytes:
        assert old.encode(encoding) in content
        return content.replace(old.encode(encoding), new.encode(encoding), 1)

    return changed


DAMAGES = [
    ("comma.csv", cut(0.97), r"comma\.csv line 5: the row ends after 5 of 6 cells: the file was cut off. Export it again"),
    ("comma.csv", put("500.022500000", "NaN"), r"comma\.csv line 3, column X \[mm\]: 'NaN' is not a finite number"),
    ("comma.csv", put("500.022500000", "500,022500000"), r"line 3: has 7 cells where the header has 6"),
    ("comma.csv", put("Z [mm]", "Z [in]"), r"'Z \[in\]' is in inch and 'X \[mm\]' in mm: the coordinates mix units"),
    ("comma.csv", put("Z [mm]", "Z [furlong]"), r"line 1: the unit 'furlong' of 'Z \[furlong\]' is not known"),
    ("comma.csv", put("Y [mm]", "X old [mm]"), r"line 1: no column is y_mm among 'Measurement', 'Ball'"),
    ("comma.csv", put("500.022500000", ""), r"line 3, column X \[mm\]: no value. Measure the point again, or leave"),
    ("comma.csv", put("2,1,300", "9,9,,,\r\n2,1,300"), r"line 4: has no coordinates, and figures follow"),
    ("semicolon.csv", put("500,0225", "500.0225"),
     r"has a decimal comma, and '500\.0225\d*' \(.*line 5, column X \[mm\]\) has a decimal point"),
    ("semicolon.csv", cut(0.55), r"semicolon\.csv line 5"),
    ("tabs.txt", put("250,010100000", "#DIV/0!"), r"line 3, column Y \[mm\]: '#DIV/0!' is not a number"),
    ("unicode.txt", cut(0.501), r"unicode\.txt.*(is no text in UTF-16|line \d)"),
    ("wide.csv", put("Z2 (mm)", "Q2"), r"2 points in a row, and 1 columns z_mm"),
    ("book.xlsx", cut(0.5), r"is a damaged workbook: the end of the file is missing"),
    ("book.ods", cut(0.5), r"is a damaged workbook: the end of the file is missing"),
    ("report.txt", cut(0.93), r"LOC2, the place of M2_BALL2, has no Z.*the file was cut off"),
    ("report.txt", cut(0.97), r"report\.txt line 22: no measured value stands below MEAS"),
    ("report.txt", put("100.021300000", "100.031300000"), r"line 5: MEAS 100\.0313\d* is not NOMINAL and DEV together"),
    ("report.txt", put("UNITS=MM", "UNITS=IN"), r"LOC1 is in IN and LOC2 in MM"),
    ("bar_chr.txt", put("\tzValue\t", "\tzWert\t"), r"line 2: 'Bar 1 Ball 1' has no Z value"),
    ("bar_chr.txt", put("Ball 1\tmm", "Ball 1\tinch"), r"coordinates are in inch and in mm: the file mixes units"),
    ("bar.dmo", put("-120.001800000,25.0", ""), r"FA\(M1_BALL1\): has 2 of the three coordinates"),
    ("bar.dmo", put("CART", "POL"), r"is given in polar coordinates. Put it out with CART"),
    ("bar.qif", cut(0.8), r"bar\.qif line \d+: is damaged XML"),
    ("bar.qif", put("-120.000700000", ""), r"SphereFeatureMeasurement id 12: has 2 coordinates"),
    ("bar.qif", put("0.001", "0.01"), r"the unit 'mm' of 0\.01 m is not known"),
    ("trace.txt", put("00004 #", "00004 !"), r"PtMeas 00004 has no answer"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "damage", "message"), DAMAGES, ids=[f"{i}-{one[0]}" for i, one in enumerate(DAMAGES)])
def test_damage_is_named_with_its_place_and_its_cause(
    name: str, damage: Callable[[bytes], bytes], message: str
) -> None:  # fmt: skip
    with pytest.raises(CmmUqError, match=message):
        read(name, damage(EXPORTS[name]("en", "mm")))


@pytest.mark.parametrize("name", EXPORTS)
def test_every_export_is_damaged_in_some_test_above(name: str) -> None:
    assert any(name == damaged for damaged, _, _ in DAMAGES)
