"""Twelve exports of one measurement, two bars of two balls, as programs and spreadsheets write it."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Mapping
from xml.sax.saxutils import escape

import numpy as np

XYZ = np.array([
    [100.0213, 250.0044, -120.0018], [500.0225, 250.0101, -120.0007],
    [300.0102, 50.0037, -120.0021], [1300.0188, 450.0059, -120.0012],
])  # fmt: skip
"""mm; the coordinates of balls 1, 2 of bar 1 and of bar 2."""

NUMBERS = ((1, 1), (1, 2), (2, 1), (2, 2))
HEADINGS: Mapping[str, tuple[str, ...]] = {
    "en": ("Measurement", "Ball", "X", "Y", "Z", "Operator"),
    "de": ("Messung", "Kugel", "X-Istwert", "Y-Istwert", "Z-Istwert", "Prüfer"),
    "fr": ("N° mesure", "Bille", "X mesuré", "Y mesuré", "Z mesuré", "Opérateur"),
    "it": ("Misura", "Sfera", "X misurato", "Y misurato", "Z misurato", "Qualità"),
    "es": ("Medición", "Esfera", "X medido", "Y medido", "Z medido", "Año"),
}
FACTOR = {"mm": 1.0, "in": 25.4, "µm": 1e-3}


def text(value: float, unit: str = "mm", decimal: str = ".", digits: int = 9) -> str:
    return f"{value / FACTOR[unit]:.{digits}f}".replace(".", decimal)


def table(language: str, unit: str, separator: str, decimal: str) -> str:
    heads = HEADINGS[language]
    lines = [separator.join([*heads[:2], *(f"{head} [{unit}]" for head in heads[2:5]), heads[5]])]
    for (measurement, point), xyz in zip(NUMBERS, XYZ, strict=True):
        lines.append(separator.join([str(measurement), str(point), *(text(v, unit, decimal) for v in xyz), "é"]))
    return "\r\n".join(lines) + "\r\n"


def comma(language: str, unit: str) -> bytes:
    return table(language, unit, ",", ".").encode()


def semicolon(language: str, unit: str) -> bytes:
    return ("Protokoll;;;;;\r\n\r\n" + table(language, unit, ";", ",")).encode("cp1252")


def tabs(language: str, unit: str) -> bytes:
    return table(language, unit, "\t", ",").encode("utf-8-sig")


def unicode_text(language: str, unit: str) -> bytes:
    return table(language, unit, "\t", ".").encode("utf-16")


def wide(language: str, unit: str) -> bytes:
    heads = HEADINGS[language]
    names = [f"{axis}{i} ({unit})" for i in (1, 2) for axis in "XYZ"]
    rows = [";".join([heads[0], *names])]
    rows += [";".join([str(i + 1), *(text(v, unit, ",") for v in XYZ[2 * i : 2 * i + 2].ravel())]) for i in (0, 1)]
    return "\n".join(rows).encode()


def excel(language: str, unit: str) -> bytes:
    from openpyxl import Workbook

    book = Workbook()
    book.active.title = "Info"
    book.active.append(["exported", "today"])
    sheet = book.create_sheet("Points")
    sheet.append([])
    heads = HEADINGS[language]
    sheet.append([*heads[:2], *(f"{head} [{unit}]" for head in heads[2:5])])
    for (measurement, point), xyz in zip(NUMBERS, XYZ, strict=True):
        sheet.append([measurement, point, *(float(text(v, unit)) for v in xyz)])
    out = io.BytesIO()
    book.save(out)
    return out.getvalue()


def opendocument(language: str, unit: str) -> bytes:
    """Written by odfpy, which the project does not use."""
    from odf.opendocument import OpenDocumentSpreadsheet
    from odf.table import Table, TableCell, TableRow
    from odf.text import P

    document = OpenDocumentSpreadsheet()
    sheet = Table(name="Points")
    heads = HEADINGS[language]
    rows: list[list[object]] = [[*heads[:2], *(f"{head} [{unit}]" for head in heads[2:5])]]
    rows += [[*numbers, *(float(text(v, unit)) for v in xyz)] for numbers, xyz in zip(NUMBERS, XYZ, strict=True)]
    for row in rows:
        line = TableRow()
        for value in row:
            is_text = isinstance(value, str)
            cell = TableCell(valuetype="string") if is_text else TableCell(valuetype="float", value=repr(value))
            cell.addElement(P(text=value if is_text else f"{value:.2f}"))
            line.addElement(cell)
        sheet.addElement(line)
    document.spreadsheet.addElement(sheet)
    out = io.BytesIO()
    document.save(out)
    return out.getvalue()


def pcdmis(language: str, unit: str) -> bytes:
    word = {"en": "BALL", "de": "KÜGEL"}[language]
    lines = ["PART NAME  : BAR", ""]
    for (measurement, point), xyz in zip(NUMBERS, XYZ, strict=True):
        named = f"M{measurement}_{word}{point}"
        lines += [f"DIM LOC{point}= LOCATION OF SPHERE {named}  UNITS={'MM' if unit == 'mm' else 'IN'}",
                  "AX       NOMINAL       +TOL       -TOL           MEAS            DEV     OUTTOL"]  # fmt: skip
        for axis, value in zip("XYZ", xyz, strict=True):
            nominal, deviation = text(round(value), unit), text(value - round(value), unit)
            lines.append(
                f"{axis}  {nominal:>14} {0.05:10.3f} {0.05:10.3f} {text(value, unit):>14} {deviation:>14}      0.000 ---#"
            )
    return "\r\n".join(lines).encode("cp1252")


def calypso(language: str, unit: str) -> bytes:
    word = {"en": "Ball", "de": "Kügel"}[language]
    heads = ["planid", "partnb", "id", "type", "idsymbol", "actual", "nominal", "featureid", "unit"]
    rows = ["\t".join(heads)]
    for (measurement, point), xyz in zip(NUMBERS, XYZ, strict=True):
        feature = f"Bar {measurement} {word} {point}"
        for axis, value in zip("xyz", xyz, strict=True):
            rows.append(
                "\t".join(["Bar", "1", f"{feature}_{axis}", "", f"{axis}Value", text(value, unit), "0", feature, unit])
            )
    return "\r\n".join([*rows, "END", ""]).encode("cp1252")


def dmis(language: str, unit: str) -> bytes:
    word = {"en": "BALL", "de": "KÜGEL"}[language]
    lines = ["FILNAM/'BAR',05.2", f"UNITS/{'MM' if unit == 'mm' else 'INCH'},ANGDEC"]
    for (measurement, point), xyz in zip(NUMBERS, XYZ, strict=True):
        place = ",".join(text(value, unit) for value in xyz)
        lines += [f"FA(M{measurement}_{word}{point})=FEAT/SPHERE,OUTER,CART,$", f"{place},25.0"]
    return "\r\n".join([*lines, "ENDFIL"]).encode("cp1252")


def qif(language: str, unit: str) -> bytes:
    word = {"en": "BALL", "de": "KÜGEL"}[language]
    items, measured = "", ""
    for i, ((measurement, point), xyz) in enumerate(zip(NUMBERS, XYZ, strict=True), 1):
        place = " ".join(text(value, unit) for value in xyz)
        items += (
            f'<SphereFeatureItem id="{i}"><FeatureName>M{measurement} {word}{point}</FeatureName></SphereFeatureItem>\n'
        )
        measured += (f'<SphereFeatureMeasurement id="{i + 10}"><FeatureItemId>{i}</FeatureItemId>'
                     f"<Location>{place}</Location></SphereFeatureMeasurement>\n")  # fmt: skip
    name, factor = ("mm", "0.001") if unit == "mm" else ("inch", "0.0254")
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<QIFDocument xmlns="http://qifstandards.org/xsd/qif3" versionQIF="3.0.0">'
        f"<FileUnits><PrimaryUnits><LinearUnit><SIUnitName>meter</SIUnitName><UnitName>{escape(name)}</UnitName>"
        f"<UnitConversion><Factor>{factor}</Factor></UnitConversion></LinearUnit></PrimaryUnits></FileUnits>\n"
        f"{items}{measured}</QIFDocument>\n"
    ).encode()


def ipp(language: str, unit: str) -> bytes:
    comment = {"en": "bar", "de": "Kügelstab"}[language]
    lines = [f"; {comment}", "00001 StartSession()", "00001 &", "00001 %"]
    for tag, xyz in enumerate(XYZ, 2):
        terms = ", ".join(f"{axis}({text(value)})" for axis, value in zip("XYZ", xyz, strict=True))
        lines += [
            f"{tag:05d} PtMeas(X(1), Y(2), Z(3), IJK(0, 0, 1))",
            f"{tag:05d} &",
            f"{tag:05d} # {terms}",
            f"{tag:05d} %",
        ]
    return "\r\n".join(lines).encode("cp1252")


EXPORTS: Mapping[str, Callable[[str, str], bytes]] = {
    "comma.csv": comma, "semicolon.csv": semicolon, "tabs.txt": tabs, "unicode.txt": unicode_text, "wide.csv": wide,
    "book.xlsx": excel, "book.ods": opendocument, "report.txt": pcdmis, "bar_chr.txt": calypso, "bar.dmo": dmis,
    "bar.qif": qif, "trace.txt": ipp,
}  # fmt: skip
"""Each by language and unit."""


def archive(members: Mapping[str, bytes]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content in members.items():
            packed.writestr(name, content)
    return out.getvalue()
