"""QIF 3.0 of a report: every value with its limits and its uncertainty, valid by the schema, nothing that QIF cannot say."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import lxml.etree
import pytest
import xmlschema
from defusedxml.ElementTree import fromstring

from cmm_uq.app.commands.jobs.exchange import write_qif
from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.certificate.results.qif_file import SPACE, qif
from cmm_uq.jobs.reports import ReportResults as Reported
from tests.conftest import ROOT

SCHEMAS = ROOT.parent / "shared" / "schemas" / "qif-3.0"
"""The .xsd files of QIF 3.0 in one folder (github.com/QualityInformationFramework/qif-community)."""

RESULTS: dict[str, Any] = {
    "schema": "cmm-uq/results/1",
    "software": {"name": "cmm-uq", "version": "1.0"},
    "job": {"id": "j", "origin": "measured", "date": "2026-03-02", "machine": "CMM <3>", "inputs_sha256": {"job.toml": "00"}},
    "conformity": [{
        "standard": "ISO 10360-2:2009", "characteristic": "E0", "decision": "incomplete",
        "errors": [
            {"measurement": 1, "repeat": 2, "length_mm": 400.0, "error_um": -1.25, "u_um": 0.3, "limit_um": 4.0,
             "outcome": "pass", "position": None},
            {"measurement": 2, "repeat": 1, "length_mm": 400.0, "error_um": 3.9, "u_um": 0.3, "limit_um": 4.0,
             "outcome": "undecided", "position": "along X"},
            {"measurement": 3, "repeat": 1, "length_mm": 800.0, "error_um": 1e-7, "u_um": None, "limit_um": 5.0,
             "outcome": "pass", "position": None},
        ],
    }],
    "estimates": {
        "scale_x": {"ppm": {"value": 12.0, "u": 0.5}}, "scale_y": {"ppm": {"value": 300.0, "u": 290.0}},
        "squareness_xy": {"angle_arcsec": {"value": -3.0, "u": 0.25}},
    },
    "tolerances": {"squareness_xy": {"angle_arcsec": 5.0, "verdict": "in"}},
    "identifiability": {"undetermined": [{"scale_y.ppm": 1.0}]},
}  # fmt: skip


def made(**changes: Any) -> Element:
    root: Element = fromstring(qif(Reported.model_validate(RESULTS | changes)))
    return root


def every(root: Element, tag: str) -> list[Element]:
    return list(root.iter(f"{{{SPACE}}}{tag}"))


def text(element: Element, tag: str) -> str:
    return element.findtext(f".//{{{SPACE}}}{tag}") or ""


def test_every_value_is_a_measurement_of_an_item_with_the_limits_it_was_decided_by() -> None:
    root = made()
    nominals = {one.attrib["id"]: one for one in every(root, "UserDefinedUnitCharacteristicNominal")}
    items = {one.attrib["id"]: one for one in every(root, "UserDefinedUnitCharacteristicItem")}
    found = []
    for one in every(root, "UserDefinedUnitCharacteristicMeasurement"):
        item = items[text(one, "CharacteristicItemId")]
        nominal = nominals[text(item, "CharacteristicNominalId")]
        (value,) = one.iter(f"{{{SPACE}}}Value")
        found.append((text(nominal, "Name"), text(item, "Name"), value.text, value.attrib.get("combinedUncertainty"),
                      text(nominal, "MinValue"), text(nominal, "MaxValue"), value.attrib["unitName"]))  # fmt: skip
    e0 = "ISO 10360-2:2009 E0"
    assert found == [
        (e0, "measurement 1, repeat 2, 400 mm", "-1.25", "0.3", "-4", "4", "micrometer"),
        (e0, "measurement 2, repeat 1, 400 mm, along X", "3.9", "0.3", "-4", "4", "micrometer"),
        (e0, "measurement 3, repeat 1, 800 mm", "0.0000001", None, "-5", "5", "micrometer"),
        ("squareness_xy.angle_arcsec", "squareness_xy", "-3", "0.25", "-5", "5", "arcsecond"),
    ]


def test_a_decision_that_qif_has_no_word_for_stands_in_its_own() -> None:
    statuses = [
        text(one, "CharacteristicStatusEnum") or text(one, "OtherCharacteristicStatus")
        for one in every(made(), "UserDefinedUnitCharacteristicMeasurement")
    ]
    assert statuses == ["PASS", "undecided", "PASS", "PASS"]


@pytest.mark.parametrize(("decision", "verdict", "whole"), [
    ("pass", "in", "PASS"), ("incomplete", "in", "UNKNOWN"), ("pass", "open", "UNKNOWN"), ("fail", "in", "FAIL"),
    ("pass", "out", "FAIL"), ("conditional pass", "in", "UNKNOWN"),
])  # fmt: skip
def test_the_whole_passes_only_where_every_decision_does(decision: str, verdict: str, whole: str) -> None:
    root = made(
        conformity=[RESULTS["conformity"][0] | {"decision": decision}],
        tolerances={"squareness_xy": {"angle_arcsec": 5.0, "verdict": verdict}},
    )
    assert text(root, "InspectionStatusEnum") == whole


def test_factors_without_a_tolerance_are_attributes_and_what_is_not_determined_is_left_out() -> None:
    held = {
        one.attrib["name"]: one.attrib["value"] for tag in ("AttributeD1", "AttributeStr") for one in every(made(), tag)
    }
    assert held == {
        "scale_x.ppm (ppm)": "12", "u of scale_x.ppm (ppm)": "0.5", "origin of the recording": "measured",
        "decision by ISO 10360-2:2009 E0": "incomplete",
        "decision on squareness_xy.angle_arcsec by its tolerance": "pass",
    }  # fmt: skip


def test_the_same_results_give_the_same_bytes_and_others_another_identifier() -> None:
    one, again = (qif(Reported.model_validate(RESULTS)) for _ in range(2))
    assert one == again
    other = made(job=RESULTS["job"] | {"inputs_sha256": {"job.toml": "01"}})
    assert text(other, "QPId") != text(made(), "QPId")


class _Beside(lxml.etree.Resolver):
    """What the schema includes lies beside it; xmldsig-core in the xmlschema package."""

    def resolve(self, url: str, _: object, context: Any) -> Any:
        own = Path(xmlschema.__file__).parent / "schemas" / "DSIG" / "xmldsig-core-schema.xsd"
        return self.resolve_filename(str(own if "xmldsig" in url else SCHEMAS / Path(url).name), context)


@pytest.mark.skipif(not SCHEMAS.exists(), reason="the schemas of QIF 3.0 are not at hand")
def test_the_document_is_valid_by_the_schema_of_qif() -> None:
    parser = lxml.etree.XMLParser()
    parser.resolvers.add(_Beside())
    schema = lxml.etree.XMLSchema(lxml.etree.parse(SCHEMAS / "QIFDocument.xsd", parser))
    for changes in ({}, {"conformity": [], "tolerances": {}}, {"estimates": {}, "tolerances": {}}):
        document = lxml.etree.fromstring(qif(Reported.model_validate(RESULTS | changes)))
        schema.assertValid(document)


def test_it_is_written_over_nothing_and_of_a_report_only(tmp_path: Path) -> None:
    (tmp_path / "results.json").write_text(
        Reported.model_validate(RESULTS).model_dump_json(by_alias=True), encoding="utf-8"
    )
    out = write_qif(tmp_path, tmp_path / "j.qif")
    assert out.read_bytes() == qif(Reported.model_validate(RESULTS))
    with pytest.raises(OutputError, match="is there already"):
        write_qif(tmp_path, out)
    (tmp_path / "results.json").write_text('{"schema": "cmm-uq/budget/1"}', encoding="utf-8")
    with pytest.raises(CmmUqError, match=r"is no results\.json of a report"):
        write_qif(tmp_path, tmp_path / "k.qif")
