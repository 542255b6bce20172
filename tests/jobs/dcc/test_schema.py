"""The model is the schema of PTB, element for element; and what the schema refuses, ``checked_by_schema`` refuses."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest
import xmlschema
from lxml import etree

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.dcc import checked_by_schema, written
from cmm_uq.jobs.dcc.certificate import CLASSES, Certificate, Complex, Element, Field
from cmm_uq.jobs.dcc.tree import NAMESPACES
from cmm_uq.jobs.dcc.xml_file import _schema
from tests.jobs.dcc.certificates import certificate
from tests.jobs.dcc.schemas import FOLDER, by_lxml

GOOD = written(certificate())
LATER = {"si:measurementUncertaintyUnivariate", "si:measurementUncertaintyUnivariateXMLList"}
"""Of D-SI 2.2, which certificates of DCC 3.3 have."""


@pytest.fixture(scope="module")
def schema() -> Any:
    if not (FOLDER / "dcc-3.2.1.xsd").is_file():
        pytest.skip(f"no schemas in {FOLDER}")
    return _schema(FOLDER, "3.2.1", "c.xml")


def short(name: str) -> str:
    space, _, local = name[1:].rpartition("}")
    return next(f"{prefix}:{local}" for prefix, uri in NAMESPACES.items() if uri == space)


def elements(of: Any) -> list[Any]:
    """Elements of a type, in their order."""
    return list(of.content.iter_elements()) if of.is_complex() and not of.has_simple_content() else []


def around(element: Any) -> list[Any]:
    """It and the groups that it stands in."""
    found = []
    while element is not None and hasattr(element, "min_occurs"):
        found.append(element)
        element = element.parent
    return found


def needed(element: Any) -> bool:
    """Whether it has to be there: nothing around it may be left out, or chosen against it."""
    return all(one.min_occurs > 0 and getattr(one, "model", None) != "choice" for one in around(element))


def repeated(element: Any) -> bool:
    """Whether it may be there several times."""
    return any(one.max_occurs != 1 for one in around(element))


def compared(element: Any, cls: type[Element], seen: set[type[Element]]) -> int:
    """Elements of a type of the schema against the fields of a class, and so on below; how many were compared."""
    if cls in seen:
        return 0
    seen.add(cls)
    found, fields = 0, cls.FIELDS.values()
    given = {short(child.name): child for child in elements(element.type) if child.name}
    given = {tag: child for tag, child in given.items() if not tag.startswith("ds:")}
    mine = [tag for field in fields for tag in field.outer if tag not in LATER]
    # a complex value is by its parts or by magnitude and phase, with a unit at the end of either
    assert mine == list(given) or (cls is Complex and sorted(mine) == sorted(given)), cls
    attributes = {field.tag for field in fields if field.kind == "attribute"}
    assert attributes >= {name for name in getattr(element.type, "attributes", ()) if name}, cls
    for field in fields:
        if field.kind in ("attribute", "foreign"):
            continue
        for outer in field.outer:
            if outer not in LATER:
                found += 1 + below(given[outer], field, outer, seen)
    return found


def below(child: Any, field: Field, outer: str, seen: set[type[Element]]) -> int:
    """One field: whether it may be left out or repeated, and the class of its elements."""
    inner = child
    if outer not in field.tags:
        inner = elements(child.type)[0]
        assert [short(inner.name)] == list(field.tags)
        assert child.max_occurs == 1
    cls = next(iter(field.tags.values())) if outer not in field.tags else field.tags[outer]
    if len(field.tags) == 1:
        assert field.repeated == repeated(inner), (field.name, outer)
        assert field.required == needed(child), (field.name, outer)
    return compared(inner, CLASSES[cls], seen) if cls else 0


def test_every_element_of_the_schema_is_a_field_in_the_same_order_as_often_and_as_needed(schema: Any) -> None:
    root = schema.elements["digitalCalibrationCertificate"]
    assert compared(root, Certificate, set()) > 250


def test_lxml_and_xmlschema_agree_on_a_good_and_on_spoilt_certificates(schema: Any) -> None:
    """Two validators that share no code."""
    good = GOOD.decode()
    spoilt = [good.replace(*change) for change in (
        ("404.23570", "x"), ("<dcc:issuer>manufacturer", "<dcc:issuer>maker"), (">DE<", ">Germany<"),
        ("<dcc:uniqueIdentifier>4711</dcc:uniqueIdentifier>", ""), ("2026-03-01", "2026-13-01"),
        ("<si:coverageFactor>2.00", "<si:coverageFactor>0.5"), ('schemaVersion="3.2.1"', 'schemaVersion="3.2.2"'),
    )]  # fmt: skip
    assert by_lxml("3.2.1").validate(etree.fromstring(GOOD))
    checked_by_schema(GOOD, FOLDER, "c.xml")
    for text in spoilt:
        assert text != good
        assert not by_lxml("3.2.1").validate(etree.fromstring(text.encode()))
        if "3.2.2" not in text:
            with pytest.raises(CmmUqError):
                checked_by_schema(text.encode(), FOLDER, "c.xml")


def test_what_is_missing_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(CmmUqError, match=r"no schema of DCC 3\.2\.1"):
        checked_by_schema(GOOD, tmp_path, "c.xml")
    with pytest.raises(CmmUqError, match=r"no schema of DCC \.\./3"):
        checked_by_schema(GOOD.replace(b'Version="3.2.1"', b'Version="../3"'), tmp_path, "c.xml")
    monkeypatch.setitem(sys.modules, "xmlschema", None)
    with pytest.raises(CmmUqError, match="xmlschema is not installed"):
        checked_by_schema(GOOD, tmp_path / "other", "c.xml")
    assert xmlschema.__version__


def test_a_certificate_of_3_3_is_one_too() -> None:
    made = written(certificate().with_changes(version="3.3.0"))
    assert by_lxml("3.3.0").validate(etree.fromstring(made))
    checked_by_schema(made, FOLDER, "c.xml")


def test_a_schema_that_cannot_be_used_is_said(tmp_path: Path, schema: Any) -> None:
    (tmp_path / "dcc-3.2.1.xsd").write_bytes((FOLDER / "dcc-3.2.1.xsd").read_bytes())
    with pytest.raises(CmmUqError, match="which is not beside it"):
        checked_by_schema(GOOD, tmp_path, "c.xml")
    (tmp_path / "SI_Format-2.1.0.xsd").write_text("<a/>", encoding="utf-8")
    with pytest.raises(CmmUqError, match="cannot be used"):
        checked_by_schema(GOOD, tmp_path, "c.xml")
