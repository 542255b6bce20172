"""The certificate of an artefact as a DCC: what it says stands for what job.toml would, and never against it."""

from __future__ import annotations

import datetime as dt
import math
import re
import tomllib
from typing import Any

import numpy as np
import pytest
import tomlkit

from cmm_uq.app.commands.jobs.simulate import simulated_job
from cmm_uq.app.commands.reading import job_of, read_job
from cmm_uq.artefacts import kind_named
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.clauses import claimed
from cmm_uq.jobs.dcc import Certificate, written
from cmm_uq.jobs.dcc.certificate import StatementMetadata
from cmm_uq.jobs.job import Job
from cmm_uq.machine.model.artefact import Artefact
from tests.conftest import ROOT
from tests.jobs.dcc.artefacts import BALL_BAR, PLATE, SPHERE, STEP_GAUGE, TRIANGLE, issued, listed, value
from tests.jobs.dcc.texts import rich
from tests.jobs.recording.test_references import GAUGE, PLATE as PLATE_RECORDING

EXAMPLE = {
    "ballbar": "iota-1102-20C", "bryan": "bryan-simulated", "sphere": "sphere-simulated", "triangle": "triangle-simulated",
    "shift": "shift-simulated", "digitizer": "digitizer-simulated",
}  # fmt: skip
STATED = {
    "ballbar": ("length_mm", "u_um"), "bryan": ("length_mm", "u_um"), "sphere": ("length_mm", "u_um", "form_um"),
    "triangle": ("blocks_mm", "u_blocks_um", "cylinders_mm", "u_cylinders_um"), "digitizer": ("length_mm", "u_um"),
}  # fmt: skip


def files(kind: str, certificate: Certificate, /, **artefact: Any) -> dict[str, bytes]:
    """An example whose artefact is certified by a DCC alone, with these keys beside; ``None`` takes one out."""
    folder = ROOT / "examples" / EXAMPLE[kind]
    data = tomllib.loads((folder / "job.toml").read_text(encoding="utf-8"))
    data.pop("test_uncertainty", None)  # what a simulation declares of its artefact
    left = {key: held for key, held in data["artefact"].items() if key not in (*STATED.get(kind, ()), "name")}
    chain = {"file": "artefact.xml", **artefact.pop("certificate", {})}
    held = {**left, **artefact, "certificate": chain}
    data["artefact"] = {key: value for key, value in held.items() if value is not None}
    found = {name: (folder / name).read_bytes() for name in read_job(folder).inputs if name != "job.toml"}
    return {**found, "job.toml": tomlkit.dumps(data).encode(), "artefact.xml": written(certificate)}


def job(kind: str, certificate: Certificate, /, **artefact: Any) -> Job:
    return job_of(files(kind, certificate, **artefact))


def gauge(
    certificate: Certificate, recording: str = GAUGE, kind: str = "step_gauge", tables: dict[str, Any] | None = None,
    **artefact: Any,
) -> Job:  # fmt: skip
    """Two placings whose certified values stand in a DCC alone."""
    data = {
        "job": {"id": "gauge", "date": dt.date(2026, 11, 20)}, "machine": {"name": "CMM"},
        "artefact": {"kind": kind, **artefact, "certificate": {"file": "artefact.xml"}},
        "recording": {"file": "recording.csv"}, "model": {"effects": ["scale_x"]},
        **(tables or {}),
    }  # fmt: skip
    return job_of({
        "job.toml": tomlkit.dumps(data).encode(), "recording.csv": recording.encode(), "artefact.xml": written(certificate),
    })  # fmt: skip


def artefact_of(found: Job) -> Artefact:
    kind = kind_named(found.facts.artefact.kind)
    assert kind is not None
    return kind.observing("reported")(found.facts.artefact, found.points)


def test_a_ball_bar_has_its_length_and_the_uncertainty_of_the_certificate() -> None:
    artefact = job("ballbar", BALL_BAR).facts.artefact
    assert (artefact.length_mm, artefact.u_um) == (404.2357, 1.5)
    chain = artefact.certificate
    assert chain is not None
    assert (chain.number, chain.laboratory, chain.date, chain.due) == (
        "D-K-4711", "Laboratory", dt.date(2026, 3, 5), dt.date(2028, 3, 2),
    )  # fmt: skip
    assert (artefact.name, artefact.serial) == ("Ball bar", "12")


def test_the_certificate_is_an_input_and_the_job_says_how_it_was_read() -> None:
    found = job("ballbar", BALL_BAR)
    assert found.inputs["artefact.xml"] == written(BALL_BAR)
    (told,) = found.imported
    assert told.data == {
        "file": "artefact.xml", "format": "dcc", "certificate": "D-K-4711",
        "columns": {"length_mm": "Length between the centres [mm]"}, "points": 1,
    }  # fmt: skip


def test_a_sphere_has_its_diameter_and_its_form() -> None:
    for kind in ("sphere", "digitizer"):
        artefact = job(kind, SPHERE).facts.artefact
        assert (artefact.length_mm, artefact.u_um) == (25.0012, 0.1)
    assert job("sphere", SPHERE).facts.artefact.model_dump()["form_um"] == 0.1
    without = issued(value("Diameter", "25.0012", "0.0002"))
    with pytest.raises(CmmUqError, match="states no form_um above 0"):  # which the example's standard asks for
        job("sphere", without)


ROUND = issued(value("Diameter", "25.0012", "0.0002"), value("Form deviation", "0.00010", "0.00006"))
"""U of the form 0.06 µm, k = 2."""


@pytest.mark.parametrize(("test", "u", "refused"), [
    (None, 0.03, ""), ({"u_form_um": 0.05}, 0.05, ""), ({"u_form_um": 0.03}, 0.03, ""),
    ({"u_form_um": 0.001}, None, "u_form_um = 0.001 is smaller than the standard uncertainty 0.03 µm of"),
    ({"negligible": {"form": {"by": "A", "reason": "B"}}}, None, "a standard uncertainty of 0.03 µm of .*Form deviation"),
])  # fmt: skip
def test_what_the_form_of_a_sphere_is_uncertain_by_is_read_too(
    test: dict[str, Any] | None, u: float | None, refused: str
) -> None:
    """It was left out: a form declared exact, or known to a nanometre, passed beside a certificate that says otherwise."""
    found = files("sphere", ROUND)
    data = tomllib.loads(found["job.toml"].decode()) | ({} if test is None else {"test_uncertainty": test})
    found["job.toml"] = tomlkit.dumps(data).encode()
    if u is None:
        with pytest.raises(CmmUqError, match=refused):
            job_of(found)
    else:
        assert job_of(found).facts.test_uncertainty.u_form_um == pytest.approx(u)


def test_a_triangle_has_its_blocks_and_cylinders_with_the_largest_uncertainty_of_each() -> None:
    artefact = job("triangle", TRIANGLE).facts.artefact
    assert artefact.model_dump(include=set(STATED["triangle"])) == {
        "blocks_mm": [480.0001, 280.00005, 380.0002], "u_blocks_um": 0.15,
        "cylinders_mm": [20.0001, 20.0002, 19.9999], "u_cylinders_um": 0.1,
    }  # fmt: skip


def test_a_shifted_artefact_has_its_known_length_between_the_points_that_the_job_names() -> None:
    certificate = issued(value("Length of 22 steps", "440.00021", "0.0006"))
    artefact = job("shift", certificate, known={"from": 1, "to": 23}).facts.artefact
    assert artefact.model_dump()["known"] == {"from_point": 1, "to_point": 23, "length_mm": 440.00021, "u_um": 0.3}
    two = issued(value("Length A", "440.1", "0.0006"), value("Length B", "440.2", "0.0006"))
    columns = {"columns": {"known.length_mm": "Length B"}}
    named = job("shift", two, known={"from": 1, "to": 23}, certificate=columns).facts.artefact
    assert named.model_dump()["known"]["length_mm"] == 440.2
    with pytest.raises(CmmUqError, match="no certified value of a recording of kind 'shift' is read"):
        job("shift", certificate, known=None)


def test_a_step_gauge_has_its_faces_and_the_uncertainty_of_the_longest() -> None:
    found = gauge(STEP_GAUGE)
    assert found.points.columns["reference_mm"].tolist() == [0, 20.00013, 40.00008, 60.00031] * 2
    assert found.facts.artefact.length_mm == 60.00031
    assert artefact_of(found).sizes[0].sd == pytest.approx(0.2e-3, rel=1e-12)
    blocks = gauge(STEP_GAUGE, kind="gauge_blocks")
    assert artefact_of(blocks).sizes[0].sd == pytest.approx(0.2e-3, rel=1e-12)


def test_what_two_faces_have_in_common_drops_out_of_their_distance() -> None:
    """u² = u₁² + u₄² − 2 cov: with 0.3 and 0.2 µm and 0.03 µm² in common 0.265 µm, by hand 0.2645751."""
    rows = [["9e-8", "0", "0", "3e-8"], ["0", "4e-8", "0", "0"], ["0", "0", "4e-8", "0"], ["3e-8", "0", "0", "4e-8"]]
    certified = listed("Certified length", "0 20 40 60", "0.0006 0.0004 0.0004 0.0004", covariance=rows)
    found = artefact_of(gauge(issued(listed("Face", "1 2 3 4", unit=r"\one"), certified, table=True)))
    assert found.sizes[0].sd == pytest.approx(1e-3 * math.sqrt(0.3**2 + 0.2**2 - 2 * 0.03), rel=1e-12)
    lengths = found.indications()
    assert lengths is not None
    u = [math.sqrt(0.3**2 + 0.2**2), math.sqrt(0.3**2 + 0.2**2), math.sqrt(0.3**2 + 0.2**2 - 2 * 0.03)]
    assert lengths.u == pytest.approx(1e-3 * np.array(u * 2), rel=1e-12)


def test_a_plate_has_its_places_and_the_uncertainty_of_the_farthest_along_its_direction() -> None:
    """Ball 4 lies at 45°: u² = ½·(u_x1² + u_x4²) + ½·(u_y1² + u_y4²) = 0.3² + 0.4² µm², but for the last digits of 45°."""
    found = gauge(PLATE, PLATE_RECORDING, "plate")
    assert found.points.columns["reference_y_mm"].tolist() == [0, 0, 83.00034, 83.00051] * 2
    assert found.facts.artefact.length_mm == pytest.approx(math.hypot(83.00043, 83.00051, 0.00007), rel=1e-12)
    assert artefact_of(found).sizes[0].sd == pytest.approx(0.5e-3, rel=1e-6)


def test_lists_without_uncertainty_leave_it_to_the_job() -> None:
    bare = issued(listed("Face", "1 2 3 4", unit=r"\one"), listed("Certified length", "0 20 40 60"), table=True)
    artefact = gauge(bare, u_um=0.7).facts.artefact
    assert (artefact.length_mm, artefact.u_um) == (None, 0.7)


def test_a_list_of_one_place_certifies_no_distance() -> None:
    one = issued(listed("Face", "1 2 3 4", unit=r"\one"), listed("Certified length", "0 0 0 0", "0.0002"), table=True)
    with pytest.raises(CmmUqError, match=r"artefact\.xml: certifies no distance"):
        gauge(one)


def test_units_of_the_certificate_are_converted() -> None:
    micrometres = issued(value("Length", "404235.7", "3.0", r"\micro\metre"))
    metres = issued(value("Length", "0.4042357", "0.000003", r"\metre"))
    for certificate in (micrometres, metres):
        artefact = job("ballbar", certificate).facts.artefact
        assert (artefact.length_mm, artefact.u_um) == (404.2357, 1.5)


def test_what_the_job_says_too_must_say_the_same_and_an_uncertainty_may_only_be_larger() -> None:
    same = job("ballbar", BALL_BAR, length_mm=404.2357, u_um=2.0, certificate={"number": "D-K-4711"})
    assert same.facts.artefact.u_um == 2.0
    assert job("ballbar", BALL_BAR, U_um=3.0, k=2.0).facts.artefact.u_um == 1.5


@pytest.mark.parametrize(
    ("k", "p", "u"), [("3.0", "0.9973", 1.0), ("4.303", "0.95", 3.0 / 1.96), ("2.65", "0.9545", 1.5)]
)
def test_a_factor_larger_than_that_of_a_normal_distribution_for_its_level_gives_no_smaller_u(
    k: str, p: str, u: float
) -> None:
    found = files("ballbar", BALL_BAR)
    xml = re.sub(r"(coverageFactor>)[\d.]+", rf"\g<1>{k}", found["artefact.xml"].decode())
    xml = re.sub(r"(coverageProbability>)[\d.]+", rf"\g<1>{p}", xml)
    artefact = job_of({**found, "artefact.xml": xml.encode()}).facts.artefact
    assert artefact.u_um == pytest.approx(u, rel=1e-4)


TWO = issued(value("Length A", "404.1", "0.003"), value("Length B", "404.2", "0.003"))


@pytest.mark.parametrize(("certificate", "given", "message"), [
    (BALL_BAR, {"length_mm": 404.2}, r"artefact\.xml: \[artefact\] length_mm = 404\.2 in job\.toml, and 404\.2357"),
    (BALL_BAR, {"u_um": 1.4}, r"\[artefact\] u_um = 1\.4 is smaller than the standard uncertainty 1\.5 µm"),
    (BALL_BAR, {"U_um": 2.0, "k": 2.0}, r"\[artefact\] u_um = 1 is smaller"),
    (BALL_BAR, {"certificate": {"number": "4712"}}, r"\[artefact\.certificate\] number = 4712 in job\.toml, and D-K-4711"),
    (BALL_BAR, {"certificate": {"due": dt.date(2027, 1, 1)}}, r"due = 2027-01-01 in job\.toml, and 2028-03-02"),
    (BALL_BAR, {"certificate": {"interval_months": 60}}, r"interval_months = 60 \(until 2031-.*\) in .*, and 2028-03-02"),
    (BALL_BAR, {"serial": "13"}, r"is of an item with the numbers 12, and \[artefact\] serial = '13'"),
    (TWO, {}, r"has 2 quantities for \[artefact\] length_mm \(1 value\): '.*Length A', '.*Length B'\. Say which"),
    (SPHERE, {}, r"has no one quantity for \[artefact\] length_mm .*'Calibration / Certified values / Diameter'"),
    (issued(value("Length", "404.2")), {}, r"states no uncertainty of Calibration / Certified values / Length\. Give"),
    (issued(value("Length", "404.2", "0.1", r"\kelvin")), {}, "no quantity that is a length"),
])  # fmt: skip
def test_a_contradiction_or_what_cannot_be_told_is_refused(
    certificate: Certificate, given: dict[str, Any], message: str
) -> None:
    with pytest.raises(CmmUqError, match=message):
        job("ballbar", certificate, **given)


def test_the_laboratory_s_own_interval_may_end_before_the_day_in_the_certificate_and_not_after() -> None:
    chain = job("ballbar", BALL_BAR, certificate={"interval_months": 12}).facts.artefact.certificate
    assert chain is not None
    assert chain.until is not None
    assert chain.until < dt.date(2028, 3, 2)


def test_the_job_says_which_of_several_quantities_is_meant() -> None:
    for name in ("Length B", "Length B [mm]", "Calibration / Certified values / Length B"):
        artefact = job("ballbar", TWO, certificate={"columns": {"length_mm": name}}).facts.artefact
        assert artefact.length_mm == 404.2


def test_what_is_no_digital_certificate_is_no_certificate_of_a_bar() -> None:
    given = files("ballbar", BALL_BAR)
    with pytest.raises(CmmUqError, match=r"has no certified values of single points.*Name a digital certificate"):
        job_of(given | {"artefact.xml": b"point,reference_mm\n1,0\n"})
    cut = given["artefact.xml"].replace(b"dcc:administrativeData", b"dcc:data")
    with pytest.raises(CmmUqError, match=r"artefact\.xml, line \d+, /dcc:digital"):
        job_of(given | {"artefact.xml": cut})
    with pytest.raises(CmmUqError, match=r"artefact\.xml: no such file|artefact\.xml"):
        job_of({name: content for name, content in given.items() if name != "artefact.xml"})


def test_a_derived_job_has_what_the_certificate_said_and_not_the_file() -> None:
    found = simulated_job(job("ballbar", BALL_BAR), {"seed": 1, "noise": {"coordinate_um": 1.0}})
    artefact = found.facts.artefact
    assert (artefact.length_mm, artefact.u_um, artefact.name) == (404.2357, 1.5, "Ball bar")
    assert artefact.certificate is not None
    assert (artefact.certificate.file, artefact.certificate.number) == (None, "D-K-4711")
    assert "artefact.xml" not in found.inputs


def test_a_standard_that_needs_the_uncertainty_has_it_from_the_certificate() -> None:
    test = [{"standard": "ISO 10360-2:2009", "characteristic": "E0", "limit_um": 3.0, "rule": "ISO 14253-1"}]
    assert gauge(STEP_GAUGE, tables={"conformity": test}).facts.conformity
    bare = issued(listed("Face", "1 2 3 4", unit=r"\one"), listed("Certified length", "0 20 40 60"), table=True)
    with pytest.raises(CmmUqError, match="needs the uncertainty"):
        gauge(bare, tables={"conformity": test})


def test_an_item_of_several_is_not_named_for_the_job() -> None:
    made = BALL_BAR.administrative
    other = made.items.items[0].with_changes(id="other")
    two = made.with_changes(items=made.items.with_changes(items=(*made.items.items, other)))
    artefact = job("ballbar", BALL_BAR.with_changes(administrative=two)).facts.artefact
    assert (artefact.name, artefact.serial) == ("", "")


CODED = BALL_BAR.with_changes(
    administrative=BALL_BAR.administrative.with_changes(
        laboratory=BALL_BAR.administrative.laboratory.with_changes(code="D-K-15000-01-00"),
        statements=(
            *BALL_BAR.administrative.statements,
            StatementMetadata(convention="ILAC MRA", declaration=rich("covered")),
        ),
    )
)
UNTRACED = BALL_BAR.with_changes(
    administrative=BALL_BAR.administrative.with_changes(statements=(
        StatementMetadata(ref_type=("basic_metrologicallyTraceableToSI",), traceable=False, declaration=rich("not traceable")),
    ))
)  # fmt: skip


def test_the_accreditation_of_its_issuer_is_read_and_what_the_issuer_is_the_job_says() -> None:
    bare = job("ballbar", CODED).facts.artefact.certificate
    assert bare is not None
    assert (bare.accreditation, bare.arrangement, bare.issuer) == ("D-K-15000-01-00", None, None)
    called = {"issuer": "accredited", "accredited_by": "DAkkS"}
    found = job("ballbar", CODED, certificate=called)
    assert claimed(found).claim == "not shown"  # the bar was certified in 2026, and the recording is of 2004
    assert found.facts.artefact.certificate is not None
    assert found.facts.artefact.certificate.arrangement == "ILAC MRA"
    assert [key for _, key in claimed(found).lacks] == ["[artefact.certificate] date"]
    with pytest.raises(CmmUqError, match=r"accreditation = D-K-1 in job\.toml, and D-K-15000-01-00 in the certificate"):
        job("ballbar", CODED, certificate={"accreditation": "D-K-1"})


def test_a_certificate_that_says_itself_that_it_is_not_traceable_is_no_claim() -> None:
    assert job("ballbar", UNTRACED).facts.artefact.certificate is not None
    with pytest.raises(CmmUqError, match="says itself that its results are not traceable to the SI"):
        job("ballbar", UNTRACED, certificate={"issuer": "national institute", "arrangement": "CIPM MRA"})
