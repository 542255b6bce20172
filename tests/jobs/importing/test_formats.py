"""The sample of every page of docs/import, and what is particular to each format."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.plugins import BrokenPluginError
from cmm_uq.jobs.importing.format import ImportKeys
from cmm_uq.jobs.importing.recording import ImportedTable, imported, imported_references
from tests.conftest import ROOT
from tests.plugin.packages import OUTSIDE_IMPORTS, install

SAMPLES = ROOT / "docs" / "import" / "samples"
BARS = [[100.0213, 250.0044, -120.0018], [500.0225, 250.0101, -120.0007], [300.0102, 50.0037, -120.0021],
        [300.0188, 450.0059, -120.0012]]  # fmt: skip
"""As written into the samples by hand."""


def read(content: bytes | str, name: str = "export.txt", **keys: object) -> ImportedTable:
    data = content.encode() if isinstance(content, str) else content
    return imported(data, name, ImportKeys.model_validate(keys))


def xyz(found: ImportedTable) -> list[list[float]]:
    return np.column_stack([found.columns[f"{axis}_mm"] for axis in "xyz"]).tolist()


@pytest.mark.parametrize(
    ("name", "form", "digits"),
    [
        ("ballbar-pcdmis.txt", "pc-dmis", 3),
        ("ballbar_chr.txt", "calypso", 4),
        ("ballbar.dmo", "dmis", 4),
        ("ballbar.qif", "qif", 4),
    ],
)
def test_a_sample_is_recognised_and_read(name: str, form: str, digits: int) -> None:
    found = read((SAMPLES / name).read_bytes(), name)
    assert found.recognised.format == form
    assert np.abs(np.array(xyz(found)) - BARS).max() <= 0.5 * 10**-digits + 1e-12  # half of the last printed digit
    assert found.columns["measurement"].tolist() == [1, 1, 2, 2]
    assert found.columns["point"].tolist() == [1, 2, 1, 2]


def test_the_sample_of_a_german_table_has_its_text_its_thousands_and_its_encoding() -> None:
    found = read((SAMPLES / "ballbar-de.csv").read_bytes(), "ballbar-de.csv")
    assert xyz(found)[:4] == BARS
    assert xyz(found)[4][0] == 1300.0102
    assert found.recognised.data["encoding"] == "Windows-1252"


def test_only_answers_to_ptmeas_are_points_of_a_trace() -> None:
    found = read((SAMPLES / "sphere-ipp.txt").read_bytes(), points_per_measurement="all")
    assert len(found.lines) == 4
    assert xyz(found)[2] == [0.0002, -0.0001, 12.50031]
    assert [found.columns[f"n{axis}"].tolist() for axis in "xyz"] == [[1, 0, 0, -1], [0, 1, 0, 0], [0, 0, 1, 0]]


def test_answers_without_their_requests_are_read_only_where_they_are_all_alike() -> None:
    answers = "00001 &\n00001 %\n00002 # X(1), Y(2), Z(3)\n00003 # X(4), Y(5), Z(6){}\n"
    assert xyz(read(answers.format(""), points_per_measurement=2)) == [[1, 2, 3], [4, 5, 6]]
    with pytest.raises(CmmUqError, match="line 3: answers report different quantities, and no request tells"):
        read(answers.format(", IJK(0,0,1)"), points_per_measurement=2)


def test_a_report_of_several_sorts_of_features_asks_which() -> None:
    text = (SAMPLES / "ballbar.dmo").read_text() + "FA(C1_1)=FEAT/CIRCLE,INNER,CART,1,2,3,0,0,1,10\n"
    with pytest.raises(
        CmmUqError, match=r"holds 2 tables of points: 'spheres', 'circles'\. Say which: sheet = .spheres."
    ):
        read(text)
    assert xyz(read(text, sheet="spheres")) == BARS


def test_a_place_of_a_part_with_fewer_coordinates_is_named() -> None:
    text = (SAMPLES / "ballbar-pcdmis.txt").read_text().replace("Y       50.000", "#")
    with pytest.raises(CmmUqError, match="line 21: LOC3, the place of M2_B1, has no Y"):
        read(text)


def test_measured_points_of_qif_come_by_their_sets() -> None:
    text = (SAMPLES / "ballbar.qif").read_text()
    sets = '<MeasuredPointSet id="7" count="2"><Points>1 2 3 4 5 6</Points></MeasuredPointSet></QIFDocument>'
    text = text.replace("</QIFDocument>", sets)
    found = read(text, sheet="measured points")
    assert xyz(found) == [[1, 2, 3], [4, 5, 6]]
    assert found.columns["measurement"].tolist() == [1, 1]
    with pytest.raises(CmmUqError, match="MeasuredPointSet id 7: has 5 numbers where 2 points have three each"):
        read(text.replace("4 5 6", "4 5"), sheet="measured points")


def test_a_calypso_head_is_told_from_its_characteristics() -> None:
    with pytest.raises(CmmUqError, match=r"is the head of a Calypso table \(hdr.txt\).*_chr.txt"):
        read("planid\tpartnb\tdate\nBar\t1\t2026-11-20\n")
    table = "planid\tpartnb\ta\tb\tc\n" + "Bar\t1\t0.5\t1.5\t2.5\n" * 4
    with pytest.raises(CmmUqError, match=r"whose columns are not known here \(fet.txt\?\)"):
        read(table)
    found = read(table, columns={"x_mm": "a", "y_mm": "b", "z_mm": "c"}, unit="mm", points_per_measurement=2)
    assert xyz(found) == [[0.5, 1.5, 2.5]] * 4


def test_certified_places_come_from_a_digital_certificate() -> None:
    found = imported_references((SAMPLES / "plate-certificate.xml").read_bytes(), "c.xml", ImportKeys())
    assert found.columns["point"].tolist() == [1, 2, 3, 4]
    assert found.columns["reference_x_mm"].tolist() == [0, 83.00012, 0.00021, 83.00043]
    assert found.columns["reference_z_mm"].tolist() == [0, -0.00102, 0.00044, 0.00007]
    assert found.recognised.data["sheet"] == "Places of the balls"


def test_lists_of_a_digital_certificate_in_micrometres_are_converted() -> None:
    text = (SAMPLES / "plate-certificate.xml").read_text().replace(r"\milli\metre", r"\micro\metre")
    found = imported_references(text.encode(), "c.xml", ImportKeys())
    assert found.columns["reference_x_mm"][1] == 0.08300012


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The outside package, for as long as a test lasts."""
    site = tmp_path / "site"
    site.mkdir()
    monkeypatch.syspath_prepend(install(OUTSIDE_IMPORTS, site))
    monkeypatch.delitem(sys.modules, "pointlog", raising=False)


def test_a_format_of_another_package_is_read_by_its_own_code(installed: None) -> None:
    found = read("P 1.1 = 10.0 20.0 30.0\nP 1.2 = 40.0 50.0 60.5\n")
    assert found.recognised.format == "pointlog"
    assert xyz(found) == [[10.0, 20.0, 30.0], [40.0, 50.0, 60.5]]
    assert found.columns["point"].tolist() == [1, 2]


def test_a_format_of_another_package_that_fails_is_named_with_it(installed: None) -> None:
    from cmm_uq.base.plugins import naming_package

    with (
        pytest.raises(BrokenPluginError, match=r"package outside-imports 0\.1\.0: the format 'pointlog' fails"),
        naming_package(),
    ):
        read(b"P 1 = \xff\n")
