"""The field of a signature as PDF/A-3 and PDF/UA-1 ask for it: a picture with its fonts, and a place in the structure."""

from __future__ import annotations

import io

from pyhanko.pdf_utils.generic import (
    ArrayObject,
    DictionaryObject,
    IndirectObject,
    NameObject,
    NumberObject,
    PdfObject,
    pdf_string,
)
from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter
from pyhanko.pdf_utils.reader import PdfFileReader


def show(writer: IncrementalPdfFileWriter, field: DictionaryObject, picture: bytes) -> None:
    """The page of a PDF in the place of a field, with the fonts that it has embedded."""
    seen = writer.import_page_as_xobject(PdfFileReader(io.BytesIO(picture)))
    field["/AP"] = DictionaryObject({NameObject("/N"): seen})


def tag(writer: IncrementalPdfFileWriter, reference: IndirectObject, says: str) -> None:
    """Put a field into the structure of a tagged PDF as a form control (ISO 14289-1, 7.18.1 and 7.18.4).

    Parameters
    ----------
    writer : of the revision that has the field.
    reference : to the field, to be found by screen readers.
    says : what they say of it.
    """
    field = reference.get_object()
    field["/Contents"] = pdf_string(says)
    root = writer.root["/StructTreeRoot"] if "/StructTreeRoot" in writer.root else DictionaryObject()
    if "/ParentTree" not in root or "/Nums" not in root["/ParentTree"]:
        return  # not tagged, or by a program that lays its tree out in another way
    top = root["/K"][0] if isinstance(root["/K"], ArrayObject) else root["/K"]
    key = NumberObject(int(root["/ParentTreeNextKey"]))
    element = writer.add_object(DictionaryObject({
        NameObject("/Type"): NameObject("/StructElem"),
        NameObject("/S"): NameObject("/Form"),
        NameObject("/P"): _to(top),
        NameObject("/Alt"): pdf_string(says),
        NameObject("/Pg"): field.raw_get("/P"),
        NameObject("/K"): DictionaryObject({
            NameObject("/Type"): NameObject("/OBJR"),
            NameObject("/Obj"): reference,
            NameObject("/Pg"): field.raw_get("/P"),
        }),
    }))  # fmt: skip
    field["/StructParent"] = key
    _append(writer, top, "/K", element)
    _append(writer, root["/ParentTree"], "/Nums", key, element)
    root["/ParentTreeNextKey"] = NumberObject(int(key) + 1)
    writer.update_container(root)


def _append(writer: IncrementalPdfFileWriter, owner: DictionaryObject, key: str, *values: PdfObject) -> None:
    """Values at the end of a list, wherever that is kept."""
    held = owner[key]
    if not isinstance(held, ArrayObject):
        owner[NameObject(key)] = held = ArrayObject([owner.raw_get(key)])
    held.extend(values)
    writer.update_container(held)
    writer.update_container(owner)


def _to(held: PdfObject) -> IndirectObject:
    """To an object that has a number of its own."""
    place = held.container_ref
    return IndirectObject(place.idnum, place.generation, place.get_pdf_handler())
