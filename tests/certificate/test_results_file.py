"""results.json, the file of posterior draws, and results as QIF."""

from __future__ import annotations

import hashlib
import io
import json
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import lxml.etree
import numpy as np
import pytest
import xmlschema
from defusedxml.ElementTree import fromstring

from cmm_uq.app.commands.jobs.exchange import write_qif
from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.certificate.origin import MOST_NUMBERS, as_json, posterior_file
from cmm_uq.certificate.results.contents import results
from cmm_uq.certificate.results.qif_file import SPACE, qif
from cmm_uq.jobs.reports import ReportResults as Reported
from cmm_uq.maths.inference.draws import Draws
from tests.artefacts.simulated import analysed
from tests.conftest import ROOT


@pytest.fixture(scope="module", params=["iota-1102-20C", "iota-1102-20C-compensated"])
def data(request: pytest.FixtureRequest) -> dict[str, Any]:
    return dict(json.loads(as_json(results(analysed(request.param)))))


def test_every_estimate_has_value_uncertainty_and_interval(data: dict[str, Any]) -> None:
    assert data["schema"] == "cmm-uq/results/1"
    assert len(data["estimates"]) == 6
    for parameters in (*data["estimates"].values(), data["artefact"]):
        for quantity in parameters.values():
            low, high = quantity["interval95"]
            assert low < quantity["value"] < high
            assert quantity["u"] > 0


def test_sampling_is_documented(data: dict[str, Any]) -> None:
    sampling = data["sampling"]
    assert sampling["sampler"].startswith("emcee ")
    assert sampling["converged"] is True
    assert sampling["ess_min"] >= 1000
    assert sampling["rhat_max"] < 1.01


def test_inputs_are_identified(data: dict[str, Any]) -> None:
    assert data["job"]["inputs_sha256"].keys() == {"job.toml", "ballbar.csv"}


def test_the_screening_names_measurements_and_file(data: dict[str, Any]) -> None:
    (finding,) = data["screening"]
    assert (finding["kind"], finding["rows"], finding["file"]) == ("duplicate", ["14", "18"], "ballbar.csv")


def test_the_diagnosis_is_part_of_the_working_file(data: dict[str, Any]) -> None:
    diagnosis = data["diagnosis"]
    assert diagnosis["verdict"] == "consistent"
    assert diagnosis["effects"] == []
    assert diagnosis["screening"] == data["screening"]


def test_an_undetermined_parameter_has_no_least_squares_value(data: dict[str, Any]) -> None:
    free = data["identifiability"]["undetermined"]
    scale = data["least_squares"]["estimates"]["scale_x"]["ppm"]
    if data["job"]["id"].endswith("-compensated"):
        assert free[0].keys() == {"scale_x.ppm", "scale_y.ppm", "scale_z.ppm", "artefact.length_mm"}
        assert scale == {"value": None, "u": None}
    else:
        assert free == []
        assert scale["u"] > 0


def test_it_keeps_the_published_contract(data: dict[str, Any], tmp_path: Path) -> None:
    checker = ROOT.parent / "shared" / "check_results.py"
    if not checker.is_file():
        pytest.skip("the contract's own checker is not beside the project")
    file = tmp_path / "results.json"
    file.write_bytes(as_json(data))
    done = subprocess.run([sys.executable, checker, file], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_numbers_that_json_cannot_carry_are_refused() -> None:
    with pytest.raises(CmmUqError, match="a figure is not finite"):
        as_json({"value": float("nan")})


def test_a_statement_has_all_that_was_decided_and_all_that_is_missing(data: dict[str, Any]) -> None:
    (found,) = data["conformity"]
    compensated = data["job"]["id"].endswith("-compensated")
    assert (found["characteristic"], found["scope"]) == ("volumetric performance", "partial")
    assert found["decision"] == ("undecided" if compensated else "fail")
    assert found["missing"][0] == "1 of 20 positions: 19 distinct, measurement 18 is a copy of 14"
    assert found["missing"][1].startswith("uncertainty: what of the artefact changes between the readings")
    assert "u_repeat_um in [test_uncertainty]" in found["missing"][1]
    (entry,) = found["errors"]
    assert (entry["error_um"], entry["u_um"], entry["limit_um"]) == (
        found["value_um"],
        found["u_um"],
        found["limit_um"],
    )
    assert (entry["outcome"], entry["measurement"], entry["repeat"]) == (found["decision"], None, None)


def test_every_length_is_in_the_table_of_errors_with_its_own_limit() -> None:
    """Limits 4 + L/100; u of 0.4 µm for every length."""
    (found,) = json.loads(as_json(results(analysed("step-gauge-simulated"))))["conformity"]
    assert found["characteristic"] == "E0"
    rows = np.genfromtxt(ROOT / "examples" / "step-gauge-simulated" / "recording.csv", delimiter=",", names=True)
    assert len(found["errors"]) == np.sum(rows["reference_mm"] > 0)
    for entry in found["errors"]:
        assert entry.keys() == {
            "measurement", "repeat", "length_mm", "position", "error_um", "u_um", "U_um", "limit_um", "guard_band_um",
            "probability_conforming", "outcome", "standing", "set_aside",
        }  # fmt: skip
        assert entry["limit_um"] == pytest.approx(4 + entry["length_mm"] / 100)
        assert entry["u_um"] == pytest.approx(0.4)
    assert (
        abs(next(e["error_um"] for e in found["errors"] if abs(e["error_um"]) == found["value_um"]))
        == found["value_um"]
    )


def test_the_contract_accepts_an_incomplete_statement(tmp_path: Path) -> None:
    checker = ROOT.parent / "shared" / "check_results.py"
    if not checker.exists():
        pytest.skip("the contract is not here")
    file = tmp_path / "results.json"
    file.write_bytes(as_json(results(analysed("gauge-blocks-simulated"))))
    (found,) = json.loads(file.read_bytes())["conformity"]
    assert (found["decision"], found["scope"]) == ("incomplete", "partial")
    assert subprocess.run([sys.executable, checker, file], check=False).returncode == 0


def drawn(chains: int, draws: int, quantities: int) -> Draws:
    values = np.random.default_rng(2).standard_normal((chains, draws, quantities))
    return Draws({f"q{i}": "µm" for i in range(quantities)}, values)


@pytest.mark.parametrize("shape", [(128, 300, 8), (336, 300, 22), (128, 30, 3)])
def test_it_stays_below_what_a_certificate_can_carry_and_says_what_it_holds(shape: tuple[int, int, int]) -> None:
    draws = drawn(*shape)
    file = posterior_file(draws, "measured")
    assert len(file.content) < 4 * MOST_NUMBERS + 5_000  # what the archive adds
    assert file.entry["sha256"] == hashlib.sha256(file.content).hexdigest()
    with np.load(io.BytesIO(file.content)) as read:
        assert read["draws"].shape == (file.entry["chains"], file.entry["draws"], len(file.entry["parameters"]))
        assert np.allclose(read["centre"] + read["draws"], draws.array[:, :: file.entry["every"]], rtol=0, atol=1e-6)
        assert read["names"].tolist() == file.entry["parameters"] == list(file.entry["units"])


def test_draws_of_a_recording_that_was_not_measured_say_so_in_their_name() -> None:
    assert posterior_file(drawn(4, 20, 1), "measured").name == "posterior.npz"
    assert posterior_file(drawn(4, 20, 1), "simulated").name == "posterior-simulated.npz"


def test_a_quantity_that_never_varies_leaves_no_figure_that_is_not_finite() -> None:
    entry = posterior_file(Draws({"q": "mm"}, np.ones((4, 20, 1))), "measured").entry
    assert entry["rhat_max"] is None
    assert entry["ess_bulk_min"] == 80


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
