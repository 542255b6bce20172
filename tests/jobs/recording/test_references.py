"""Certified values from the artefact's certificate, joined to a recording by the numbers of its points."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import pytest

from cmm_uq.app.commands.jobs.simulate import simulated_job
from cmm_uq.app.commands.reading import job_of
from cmm_uq.artefacts.gauge_lines import StepGauge
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.dcc.figures import ValueUncertainty
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.tables.length_formula import factor_of, with_standard_uncertainty
from tests.conftest import ROOT

SAMPLES = ROOT / "docs" / "import" / "samples"
TOML = """
[job]
id = "gauge"
date = 2026-11-20
[machine]
name = "CMM"
[artefact]
kind = "{kind}"
u_um = 0.2
[artefact.certificate]
number = "7"
file = "{file}"
[recording]
file = "recording.csv"
[model]
effects = ["scale_x"]
"""
GAUGE = "measurement,point,x_mm,y_mm,z_mm\n" + "".join(
    f"{m},{p},{20.001 * (p - 1)},{m},0\n" for m in (1, 2) for p in (1, 2, 3, 4)
)
PLATE = "measurement,point,x_mm,y_mm,z_mm\n" + "".join(
    f"{m},{p},{x + m},{y},0\n" for m in (1, 2) for p, (x, y) in enumerate(((0, 0), (83, 0), (0, 83), (83, 83)), 1)
)


def job(recording: str, name: str, content: bytes | str, kind: str = "step_gauge") -> Job:
    toml = TOML.format(kind=kind, file=name)
    if name.endswith(".xml"):  # which says its number itself
        toml = toml.replace('number = "7"\n', "").replace("u_um = 0.2\n", "")
    files = {"job.toml": toml, "recording.csv": recording, name: content}
    return job_of({name: text.encode() if isinstance(text, str) else text for name, text in files.items()})


CERTIFICATE = (SAMPLES / "step-gauge-certificate.csv").read_text(encoding="utf-8")


def test_distances_of_a_step_gauge_come_from_its_certificate() -> None:
    found = job(GAUGE, "certificate.csv", CERTIFICATE)
    assert found.points.columns["reference_mm"].tolist() == [0, 20.00013, 40.00008, 60.00031] * 2
    assert "certificate.csv" in found.inputs
    assert found.imported[0].data["columns"] == {
        "point": "Face", "reference_mm": "Certified length (mm)", "reference_U_um": "U (um) k=2",
    }  # fmt: skip


def test_the_uncertainty_of_every_face_is_u_over_the_factor_that_the_heading_says() -> None:
    """0.10, 0.12, 0.14 and 0.16 µm, k = 2."""
    found = job(GAUGE, "certificate.csv", CERTIFICATE)
    assert found.points.columns["reference_u_um"].tolist() == [0.05, 0.06, 0.07, 0.08] * 2
    assert "reference_U_um" not in found.points.columns
    other = job(GAUGE, "certificate.csv", CERTIFICATE.replace("U (um) k=2", "Expanded uncertainty [nm]; k = 3"))
    assert other.points.columns["reference_u_um"][3] == pytest.approx(0.16e-3 / 3, rel=1e-12)
    small = job(GAUGE, "certificate.csv", CERTIFICATE.replace("U (um) k=2", "u (µm)"))
    assert small.points.columns["reference_u_um"].tolist() == [0.10, 0.12, 0.14, 0.16] * 2


def test_other_places_of_a_plan_have_the_largest_and_a_derived_recording_each_its_own() -> None:
    toml = TOML.format(kind="step_gauge", file="certificate.csv").replace("u_um = 0.2\n", "")
    files = {"job.toml": toml, "recording.csv": GAUGE, "certificate.csv": CERTIFICATE}
    found = job_of({name: text.encode() for name, text in files.items()})
    derived = simulated_job(found, {"seed": 1, "noise": {"coordinate_um": 1.0}})
    assert derived.points.columns["reference_u_um"].tolist() == [0.05, 0.06, 0.07, 0.08] * 2
    bare = {name: values for name, values in found.points.columns.items() if name != "reference_u_um"}
    gauge = StepGauge(found.facts.artefact, replace(found.points, columns=bare))  # type: ignore[arg-type]
    assert gauge.sizes[0].sd == pytest.approx(0.08e-3)


def test_an_uncertainty_in_an_export_of_measured_points_is_none_of_certified_ones() -> None:
    """An export may say how well a point was measured; without certified values beside it that is left out, and said."""
    export = "Measurement;Point;X [mm];Y [mm];Z [mm];U (µm)\n" + "".join(
        f"{m};{p};{20.001 * (p - 1)};{m}.0;0.0;0.9\n" for m in (1, 2) for p in (1, 2, 3, 4)
    )
    found = job(export, "certificate.csv", CERTIFICATE)
    assert found.points.columns["reference_u_um"].tolist() == [0.05, 0.06, 0.07, 0.08] * 2
    assert found.imported[0].data["uncertainties_not_used"] == "U (µm)"


@pytest.mark.parametrize(
    ("heading", "message"),
    [
        (
            "U (um)",
            r"certificate\.csv: reference_U_um needs a coverage factor of its own\. Give k = 2\.0 in \[artefact\]",
        ),
        ("Expanded uncertainty", "reference_U_um needs a coverage factor"),
        ("U", "the column 'U' looks like an uncertainty, and is none that is read. Name it reference_U_um"),
        ("U (um) k=20", r"certificate\.csv: says k = 20 in a heading"),
    ],
)
def test_an_uncertainty_that_cannot_be_used_is_refused_and_never_left_out(heading: str, message: str) -> None:
    with pytest.raises(CmmUqError, match=message):
        job(GAUGE, "certificate.csv", CERTIFICATE.replace("U (um) k=2", heading))


def test_places_of_a_plate_come_from_a_digital_certificate() -> None:
    found = job(PLATE, "plate.xml", Path(SAMPLES / "plate-certificate.xml").read_bytes(), "plate")
    assert found.points.columns["reference_x_mm"].tolist() == [0, 83.00012, 0.00021, 83.00043] * 2
    assert found.points.columns["reference_y_mm"].tolist() == [0, 0, 83.00034, 83.00051] * 2


def test_a_derived_recording_has_the_certified_values_in_it() -> None:
    found = job(GAUGE, "certificate.csv", CERTIFICATE)
    derived = simulated_job(found, {"seed": 1, "noise": {"coordinate_um": 1.0}})
    assert derived.points.columns["reference_mm"].tolist() == [0, 20.00013, 40.00008, 60.00031] * 2
    assert "certificate.csv" not in derived.inputs
    assert derived.facts.recording.file == "recording.csv"
    assert derived.facts.artefact.certificate is not None
    assert (derived.facts.artefact.certificate.number, derived.facts.artefact.certificate.file) == ("7", None)


@pytest.mark.parametrize("heading", ["distance_mm", "Length [mm]", "Abstand (mm)", "長さ (mm)"])
def test_a_length_on_a_certificate_is_the_certified_one(heading: str) -> None:
    rows = "".join(f"{i},{value}\n" for i, value in enumerate((0, 20.00013, 40.00008, 60.00031), 1))
    found = job(GAUGE, "certificate.csv", f"ball,{heading}\n{rows}")
    assert found.points.columns["reference_mm"].tolist() == [0, 20.00013, 40.00008, 60.00031] * 2
    with pytest.raises(CmmUqError, match="no column is reference_mm among 'ball', 'nominal_mm'"):
        job(GAUGE, "certificate.csv", f"ball,nominal_mm\n{rows}")


@pytest.mark.parametrize(
    ("recording", "certificate", "kind", "message"),
    [
        (GAUGE, CERTIFICATE.replace("4,60", "5,60"), "step_gauge",
         r"recording\.csv line 5: point 4 is not among the certified values"),
        (GAUGE, CERTIFICATE.replace("4,60", "3,60"), "step_gauge", r"certificate\.csv line 5: point 3 is there twice"),
        (GAUGE, CERTIFICATE.replace("Face,", "Wert,"), "step_gauge", "does not number its values"),
        (GAUGE, CERTIFICATE.replace(" (mm)", ""), "step_gauge", 'may be in mm or in inch. Say unit = "mm"'),
        (GAUGE.replace("z_mm\n", "z_mm,reference_mm\n").replace(",0\n", ",0,0\n"), CERTIFICATE, "step_gauge",
         "has reference_mm, and so has certificate.csv. Leave one of them out"),
        (GAUGE, CERTIFICATE, "ballbar", "a recording of kind 'ballbar' has no certified values of single points"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused(recording: str, certificate: str, kind: str, message: str) -> None:
    with pytest.raises(CmmUqError, match=message):
        job(recording, "certificate.csv", certificate, kind)


def test_a_table_divides_by_two_and_a_quarter() -> None:
    assert with_standard_uncertainty({"U_um": 4.5, "k": 1.5})["u_um"] == 3.0
    growing = with_standard_uncertainty({"U_um": "0.45 + L/400", "k": 1.5})["u_um"]
    assert (growing.fixed_um, growing.per_mm) == pytest.approx((0.3, 1 / 600))


@pytest.mark.parametrize(("k", "u"), [(2.0, 0.5), (2.58, 1 / 2.58), (3.0, 1 / 3), (2.65, 1 / 1.96), (4.303, 1 / 1.96)])
def test_a_factor_of_no_normal_distribution_says_that_degrees_of_freedom_are_few(k: float, u: float) -> None:
    """GUM, table G.1: 2.576 of 99 %, 3 of 99.73 %; table G.2: 2.57 to 2.65 of 5, 4.303 of 2 degrees of freedom for 95 %."""
    assert with_standard_uncertainty({"U_um": 1.0, "k": k})["u_um"] == pytest.approx(u, rel=1e-4)
    heading = CERTIFICATE.replace("U (um) k=2", f"U (um) k={k}")
    column = job(GAUGE, "certificate.csv", heading).points.columns["reference_u_um"]
    assert column[0] == pytest.approx(0.1 * u, rel=1e-4)


def test_degrees_of_freedom_stand_for_a_factor_where_none_is_stated() -> None:
    assert factor_of(2.25, 4.0) == 2.25
    assert factor_of(None, 4.0) == pytest.approx(2.78, abs=5e-3)  # t at 95 % (GUM, table G.2)


@pytest.mark.parametrize(
    "stated", [{"U_um": 4.303}, {"u_um": 1.0}, {"U_um": 2.0, "k": 2.0}, {"u_um": "0.4 + 0.6·L/1000"}]
)
def test_few_degrees_of_freedom_keep_the_interval_of_the_certificate(stated: dict[str, float | str]) -> None:
    # t at 95 % of two degrees of freedom is 4.303 (GUM, table G.2), of a normal distribution 1.960
    u = with_standard_uncertainty({**stated, "degrees_of_freedom": 2})["u_um"]
    assert 1.960 * float(u if isinstance(u, float) else u.at(1000.0)) == pytest.approx(4.303, rel=2e-4)


@pytest.mark.parametrize(("heading", "over"), [("u (µm)", 1.0), ("U (um) k=2", 2.0), ("U (um)", 4.303)])
def test_few_degrees_of_freedom_of_a_column_too(heading: str, over: float) -> None:
    toml = TOML.format(kind="step_gauge", file="certificate.csv").replace("u_um = 0.2", "degrees_of_freedom = 2")
    files = {"job.toml": toml, "recording.csv": GAUGE, "certificate.csv": CERTIFICATE.replace("U (um) k=2", heading)}
    found = job_of({name: text.encode() for name, text in files.items()})
    for each in (found, simulated_job(found, {"seed": 1, "noise": {"coordinate_um": 1.0}})):  # and not twice
        u = each.points.columns["reference_u_um"][:4].tolist()
        assert u == pytest.approx([one * 4.303 / 1.960 / over for one in (0.10, 0.12, 0.14, 0.16)], rel=2e-4)


def test_a_heading_of_a_certificate_divides_by_its_factor() -> None:
    found = job(GAUGE, "certificate.csv", CERTIFICATE.replace("U (um) k=2", "U (um) k=1.5"))
    assert found.points.columns["reference_u_um"][:4].tolist() == pytest.approx(
        [u / 1.5 for u in (0.1, 0.12, 0.14, 0.16)]
    )


def test_a_digital_certificate_divides_by_two_and_a_quarter() -> None:
    assert ValueUncertainty(expanded=Decimal("4.5"), factor=Decimal("2.25")).u == 2
