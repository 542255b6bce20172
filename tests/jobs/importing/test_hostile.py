"""Hostile and mistaken files are refused in words, before they take memory or time."""

from __future__ import annotations

import contextlib
import time
from pathlib import Path

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.importing.cells.figures import figure
from cmm_uq.jobs.importing.format import ImportKeys
from cmm_uq.jobs.importing.recording import imported
from tests.jobs.importing.exports import EXPORTS, archive, excel, opendocument

HEAD = "Measurement,Point,X [mm],Y [mm],Z [mm]\n"
ODS = (
    '<office:document-content xmlns:office="urn:oasis:names:tc:opendocument:xmlns:office:1.0" '
    'xmlns:table="urn:oasis:names:tc:opendocument:xmlns:table:1.0">'
    '<office:body><office:spreadsheet><table:table table:name="S">{}</table:table></office:spreadsheet></office:body>'
    "</office:document-content>"
)  # fmt: skip
MILLION = 'table:number-columns-repeated="1000000"'
CELL = '<table:table-cell office:value-type="float" office:value="1" {}/>'


def ods(body: str) -> bytes:
    return archive(
        {"mimetype": b"application/vnd.oasis.opendocument.spreadsheet", "content.xml": ODS.format(body).encode()}
    )


def stored_first(content: bytes) -> bytes:
    """The member ``mimetype`` is not compressed, as the format wants it."""
    import io
    import zipfile

    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(out, "w") as new:
        for name in old.namelist():
            new.writestr(name, old.read(name), zipfile.ZIP_STORED if name == "mimetype" else zipfile.ZIP_DEFLATED)
    return out.getvalue()


def claiming(size: int, content: bytes) -> bytes:
    """The archive, whose last member says that it is so large."""
    at = content.rindex(b"PK\x01\x02") + 24
    return content[:at] + size.to_bytes(4, "little") + content[at + 4 :]


REFUSED = {
    "an old workbook": (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(500), r"old kind \(\.xls\).*Save it as \.xlsx"),
    "a PDF": (b"%PDF-1.7\n%...", "is a PDF.*Export the report as text"),
    "rich text": (b"{\\rtf1 DIM LOC1}", "is a report in rich text"),
    "a picture": (b"\x89PNG\r\n\x1a\n" + bytes(50), "is a picture"),
    "a web page": (b"<!DOCTYPE html><html></html>", "holds no table"),
    "half a JSON": (b'{"lines": [{"nominal": 100.0, ', "line 1: is damaged JSON"),
    "a name twice in JSON": (b'{"lines": [{"x": 1.0, "y": 2.0, "x": 3.0}]}', "is damaged JSON: a record has a name twice"),
    "nested JSON": (b'{"a": ' * 500 + b"1" + b"}" * 500, "more than 40 deep"),
    "nested lists": (b'["a", ' + b"[" * 100_000, "is damaged JSON"),
    "nested XML": (b"<?xml version='1.0'?>" + b"<a>" * 60 + b"</a>" * 60, "more than 40 deep"),
    "a cell across a million": (b'<html><table><tr><td colspan="1000000" rowspan="1000000">1<td>2</table>', "no line names"),
    "an empty file": (b"", "is empty"),
    "bytes": (bytes(range(256)) * 4, "is no text, and no format of measurements"),
    "a letter": (b"Dear Sir,\nthe machine is fine.\n", "no line names the columns"),
    "a million columns": ((",".join(f"x{i}" for i in range(10**6)) + "\n").encode(), r"line 1: the line has \d+ characters"),
    "a thousand columns": ((HEAD.strip() + ",a" * 1000 + "\n").encode(), r"line 1: has 1005 cells, 200 are the most"),
    "a huge cell": ((HEAD + "1,1," + "3" * 600 + ",2,3\n").encode(), r"line 2: has a cell of 600 characters"),
    "an unclosed quotation": ((HEAD + '1,1,"1,2,3\n' + "1,2,1,2,3\n" * 100).encode(), "close every quotation mark"),
    "a heading with a control character": (
        b"DIM A= LOCATION OF SPHERE A UNITS=MM\nAX NOM\x0bINAL MEAS DEV\nX 1.0 1.1 0.1\nDIM B= LOCATION OF SPHERE B UNITS=MM\n"
        b"AX NOMINAL MEAS DEV\nX 1.0 1.1 0.1\n", r"line 4: figures stand ahead of any heading line"),
    "a statement without end": (b"FILNAM/'A'\n" + b"x$\n" * 200_000, "the statement goes on for more than 100000 characters"),
    "a report in one line": (b"DIM A= B UNITS=MM\nAX MEAS\n" + b"= OF A " * 20_000, "line 3: the line has 140000 characters"),
    "a report of empty lines": (b"UNITS=MM" + b"\n" * 60_000 + b"AX MEAS", "reports 0 dimensions and no place"),
    "entities in QIF": (
        b'<?xml version="1.0"?><!DOCTYPE q [<!ENTITY a "1"><!ENTITY b "&a;&a;">]><QIFDocument>&b;</QIFDocument>',
        "declares entities or a document type",
    ),
    "an external document": (
        b'<?xml version="1.0"?><!DOCTYPE q SYSTEM "file:///etc/passwd"><QIFDocument></QIFDocument>',
        "declares entities or a document type",
    ),
    "a workbook that unpacks to gigabytes": (
        claiming(500_000_000, archive({"[Content_Types].xml": b"", "xl/workbook.xml": b"x"})), "unpacked: 400000000 are",
    ),
    "a letter of Word": (archive({"[Content_Types].xml": b"<x/>", "word/document.xml": b"<x/>"}), "is an Office document"),
    "a workbook without sheets": (archive({"[Content_Types].xml": b"<x/>", "xl/workbook.xml": b"<x/>"}), "damaged workbook"),
    "a row repeated a million times": (
        stored_first(ods(f'<table:table-row table:number-rows-repeated="1048576">{CELL.format("")}</table:table-row>')),
        r"goes on after \d+ rows: 200000 are the most",
    ),
    "a column repeated a million times": (
        stored_first(ods(f"<table:table-row>{CELL.format(MILLION)}</table:table-row>")),
        r"S row 1: has 1000000 cells, 200 are the most",
    ),
    "entities in a spreadsheet": (
        stored_first(archive({
            "mimetype": b"application/vnd.oasis.opendocument.spreadsheet",
            "content.xml": b'<!DOCTYPE x [<!ENTITY a "aa">]>' + ODS.format("").encode(),
        })),
        "declares entities or a document type",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", REFUSED)
def test_it_is_refused_for_what_it_is(what: str) -> None:
    content, message = REFUSED[what]
    with pytest.raises(CmmUqError, match=message):
        imported(content, "export", ImportKeys())


@pytest.mark.parametrize("text", ["1e999", "0e999", "-1e-999", "1e" + "9" * 40, "9" * 400])
def test_what_no_number_can_be_is_no_figure(text: str) -> None:
    """In a table that is read by words and figures, each cell of which is looked at."""
    assert figure(text, ".") is None
    assert figure("1.25e-3", ".") == (0.00125, 1e-5)


def test_a_wide_table_that_one_byte_makes_unknown_is_looked_at_within_seconds() -> None:
    """Sums are looked for among all threes of its columns: 0.4 s of a processor, 13 s before a row told most of them apart."""
    content = (Path(__file__).parent / "unseen_exports" / "03_KMG_Stufe_chr.txt").read_bytes()
    began = time.process_time()
    with contextlib.suppress(CmmUqError):
        imported(content[:20411] + b"\x1b" + content[20411:], "a.txt", ImportKeys())
    assert time.process_time() - began < 5


def test_entities_in_a_workbook_are_refused() -> None:
    content = archive({
        "[Content_Types].xml": b'<!DOCTYPE x [<!ENTITY a "aa"><!ENTITY b "&a;&a;&a;">]><Types>&b;</Types>',
        "xl/workbook.xml": b"<x/>",
    })  # fmt: skip
    with pytest.raises(CmmUqError, match="declares entities or a document type"):
        imported(content, "export.xlsx", ImportKeys())


def test_an_encrypted_workbook_is_named_as_such() -> None:
    content = bytearray(excel("en", "mm"))
    at = content.rindex(b"PK\x01\x02")
    content[at + 8] |= 1
    with pytest.raises(CmmUqError, match=r"is encrypted\. Save it without a password"):
        imported(bytes(content), "export.xlsx", ImportKeys())


def test_a_sheet_that_claims_a_million_rows_is_read_as_far_as_it_goes() -> None:
    import io
    import zipfile

    old = zipfile.ZipFile(io.BytesIO(excel("en", "mm")))
    members = {name: old.read(name) for name in old.namelist()}
    sheet = "xl/worksheets/sheet2.xml"
    members[sheet] = members[sheet].replace(b'<dimension ref="A2:E6"', b'<dimension ref="A1:XFD1048576"')
    assert b"XFD1048576" in members[sheet]
    assert imported(archive(members), "export.xlsx", ImportKeys()).recognised.points == 4


def test_two_tables_in_a_workbook_are_asked_for_by_their_sheets() -> None:
    import io

    from openpyxl import load_workbook

    book = load_workbook(io.BytesIO(excel("en", "mm")))
    book.copy_worksheet(book["Points"]).title = "Again"
    out = io.BytesIO()
    book.save(out)
    with pytest.raises(CmmUqError, match=r"holds 2 tables of points: 'Points', 'Again'. Say which: sheet = \"Points\""):
        imported(out.getvalue(), "export.xlsx", ImportKeys())
    assert imported(out.getvalue(), "export.xlsx", ImportKeys(sheet="Again")).recognised.data["sheet"] == "Again"
    with pytest.raises(CmmUqError, match=r"has no sheet 'Pionts'\. Did you mean 'Points'"):
        imported(out.getvalue(), "export.xlsx", ImportKeys(sheet="Pionts"))


@pytest.mark.parametrize(("name", "cell"), [("book.xlsx", "Points D5"), ("book.ods", "Points D4")])
def test_damage_in_a_spreadsheet_is_named_by_its_cell(name: str, cell: str) -> None:
    import numpy as np

    from tests.jobs.importing import exports

    old = exports.XYZ.copy()
    try:
        exports.XYZ[2, 1] = np.nan
        content = EXPORTS[name]("en", "mm")
    finally:
        exports.XYZ[:] = old
    with pytest.raises(CmmUqError, match=cell):
        imported(content, name, ImportKeys())


def test_a_spreadsheet_keeps_all_digits_whatever_its_cells_show() -> None:
    """The cells of the spreadsheet written by odfpy show two decimals."""
    assert imported(opendocument("en", "mm"), "b.ods", ImportKeys()).columns["x_mm"][0] == 100.0213
