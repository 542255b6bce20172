"""A part on the desk, from its plan to pass or fail; and a certificate that somebody received."""

from __future__ import annotations

import json
import time

import pytest
from pypdf import PdfReader

from tests.app.desk.conftest import Answer, Visitor
from tests.app.serve.test_exchange import BOUNDARY, form
from tests.conftest import ROOT
from tests.jobs.part.test_dmis import BORE, HEAD, TOP

MACHINE = ROOT / "examples" / "part-plate-simulated" / "machine" / "certificate-simulated.pdf"
PLAN = "".join([HEAD, TOP, BORE, "ENDFIL\n"]).encode()
POINTS = b"""feature,point,x_mm,y_mm,z_mm
TOP,1,-40,20,30.001\nTOP,2,40,20,30.000\nTOP,3,40,-20,29.999
BORE,1,10,20.502,23\nBORE,2,25.501,5,23\nBORE,3,10,-10.499,23\nBORE,4,-5.501,5,17\nBORE,5,10,20.501,17
"""


def sent(visitor: Visitor, target: str, content: bytes, name: str) -> Answer:
    body = form(content, name)
    media = f"multipart/form-data; boundary={BOUNDARY}"
    return visitor.send("POST", target, body, Content_Type=media, Origin=f"http://{visitor.host}")


@pytest.fixture(scope="module")
def calibrated(seated: Visitor) -> Visitor:
    """A machine with its certificate, as a report leaves them."""
    root, inside = seated.desk.root, PdfReader(MACHINE).attachments
    results = json.loads(inside["results.json"][0])
    folder, report = root / "machine", root / "reports" / results["job"]["id"]
    folder.mkdir()
    report.mkdir(parents=True)
    for name in ("job.toml", "recording.csv"):
        (folder / name).write_bytes(inside[name][0])
    (report / "results.json").write_bytes(inside["results.json"][0])
    (report / MACHINE.name).write_bytes(MACHINE.read_bytes())
    return seated


@pytest.mark.long
def test_a_part_passes_or_fails_from_its_plan_and_its_points(calibrated: Visitor) -> None:
    assert "Drop the plan" in calibrated.get("/desk/part").text
    answer = sent(calibrated, "/desk/plan", PLAN, "plate.dmi")
    draft = answer.headers["location"].partition("draft=")[2]
    page = calibrated.get(f"/desk/part?draft={draft}").text
    certificate = page.partition('<option value="reports/')[2].partition('"')[0]
    assert certificate.endswith(MACHINE.name)
    given = {"draft": draft, "folder": "plate-7", "certificate": f"reports/{certificate}", "date": "2026-03-02"}
    stated = {"part.cte_per_k": "11,5e-6", "part.u_cte_per_k": "0.5e-6", "stylus.u_diameter_um": "0.3"}
    given |= stated | {"environment.u_part_k": "0.1", "environment.u_scales_k": "0.1", "form.field_um": "1"}
    given |= {
        "environment.scales_cte_per_k": "8e-6",
        "environment.u_gradient_k_per_m": "0,1",
        "environment.u_drift_k": "0.05",
    }
    given |= {"placing.u_fixture_um": "0.2", "probing.u_operator_um": "0.1", "stylus.lobing_um": "0.3"}
    for wrong in ("../x.pdf", ""):
        refused = calibrated.post("/desk/part", **{**given, "certificate": wrong})
        assert refused.status == 409
    assert "is not chosen" in refused.text
    # five points determine a cylinder and show nothing of its form: its cylindricity is left out knowingly
    assert "show nothing of its form" in calibrated.post("/desk/part", **given).text
    answer = calibrated.post("/desk/part", **given, not_measured="yes")
    assert answer.headers.get("location") == "/desk/job?name=plate-7", answer.text
    page = calibrated.get("/desk/job?name=plate-7").text
    assert "Make the certificate" in page, page
    answer = sent(calibrated, "/desk/points?name=plate-7", POINTS, "points.csv")
    assert answer.status == 303, answer.text
    assert 'file = "points.csv"' in (calibrated.desk.root / "plate-7" / "job.toml").read_text(encoding="utf-8")
    calibrated.post("/desk/run", name="plate-7")
    end = time.monotonic() + 60
    while (answer := calibrated.get("/desk/run?name=plate-7")).status != 303:
        assert time.monotonic() < end
        assert "notice bad" not in answer.text, answer.text
        time.sleep(0.2)
    page = calibrated.get("/desk/certificate?name=plate-7").text
    assert "pass" in page.partition("</main>")[0].casefold()
    assert "part" in calibrated.get("/desk").text


@pytest.mark.long
def test_a_received_certificate_says_in_one_line_who_says_what_and_whether_it_holds(calibrated: Visitor) -> None:
    before = sorted(calibrated.desk.root.rglob("*"))
    whole = sent(calibrated, "/desk/verify", MACHINE.read_bytes(), "certificate.pdf")
    assert whole.status == 200, whole.text
    said = whole.text.partition('<p class="head">')[2].partition("</p>")[0]
    assert "says of" in said
    assert "It rests on" in said
    assert "notice bad" not in whole.text
    results = PdfReader(MACHINE).attachments["results.json"][0]
    u = json.loads(results)["estimates"]["scale_x"]["ppm"]["u"]
    altered = results.replace(f'"u": {u}'.encode(), f'"u": {u / 2}'.encode(), 1)
    assert altered != results
    wrong = sent(calibrated, "/desk/verify", altered, "results.json")
    assert "Something in it is wrong" in wrong.text
    none = sent(calibrated, "/desk/verify", b"%PDF-1.7 nothing", "other.pdf")
    assert none.status == 409
    assert sorted(calibrated.desk.root.rglob("*")) == before
