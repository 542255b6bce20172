"""What was not measured says so wherever it goes, and cannot take the place of what was."""

from __future__ import annotations

import json
import re
import shutil
import tomllib
from hashlib import sha256
from pathlib import Path

import pikepdf
import pypdf
import pytest

from cmm_uq.app.commands.diagnose import write_diagnosis
from cmm_uq.app.commands.jobs.compensate import write_compensated
from cmm_uq.app.commands.jobs.simulate import write_simulation
from cmm_uq.app.commands.plan import write_plan
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import write_report
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.derived_job import derived_toml
from tests.app.commands.test_compensate import named, straight
from tests.conftest import MACHINE_JOBS, ROOT, without_diagnosis

TRUTH = "seed = 3\n[effects.squareness_xy]\nangle_arcsec = -40.0\n[noise]\ncoordinate_um = 1.0\n"
BANNER = "SIMULATED RECORDING, not a calibration certificate"


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("simulated")
    (folder / "my-truth.toml").write_text(TRUTH)
    write_simulation(ROOT / "examples" / "iota-1102-20C", folder / "my-truth.toml", folder / "job")
    return folder / "job"


def test_a_simulated_job_has_an_id_and_a_mark_of_its_own(simulated: Path, iota: Path) -> None:
    source, found = read_job(iota), read_job(simulated)
    assert re.fullmatch(r"iota-1102-20C-simulated-[0-9a-f]{8}", found.facts.job.id)
    assert found.origin == "simulated"
    derived = found.facts.job.derived_from
    assert derived is not None
    assert (derived.job, derived.by) == ("iota-1102-20C", "simulate")
    assert derived.inputs["ballbar.csv"] == sha256(source.inputs["ballbar.csv"]).hexdigest()
    assert derived.files["truth.toml"] == sha256(TRUTH.encode()).hexdigest()
    assert found.altered == ()
    assert "truth.toml" in found.inputs
    assert (simulated / "job.toml").read_text().startswith("# Twenty-position ballbar recording")  # comments are kept


def test_another_truth_gives_another_id(simulated: Path, iota: Path, tmp_path: Path) -> None:
    (tmp_path / "truth.toml").write_text(TRUTH)
    write_simulation(iota, tmp_path / "truth.toml", tmp_path / "again")
    write_simulation(iota, tmp_path / "truth.toml", tmp_path / "other", seed=4)
    ids = [read_job(folder).facts.job.id for folder in (simulated, tmp_path / "again", tmp_path / "other")]
    assert ids[0] == ids[1] != ids[2]


@pytest.fixture(scope="module")
def report(simulated: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    job = simulated / "job.toml"
    text = job.read_text()
    laboratory = '[laboratory]\nname = "Lab"\naccreditation = "K-1"\nsignatory = "A. Name"\n\n'
    job.write_text(text.replace("[machine]", f"{laboratory}[machine]", 1))
    out = tmp_path_factory.mktemp("report")
    with without_diagnosis():
        write_report(simulated, out)
    job.write_text(text)
    return out


@pytest.mark.long
def test_its_documents_say_so_in_their_names_titles_and_on_every_page(report: Path) -> None:
    names = sorted(path.name for path in report.iterdir())
    documents = [
        "certificate-simulated.html",
        "certificate-simulated.pdf",
        "certificate-simulated.xml",
        "manifest.json",
    ]
    assert names == [*documents, "posterior-simulated.npz", "provenance.json", "results.json"]
    with pikepdf.open(report / "certificate-simulated.pdf") as pdf:
        assert "simulated recording" in str(pdf.docinfo["/Title"])
        assert {"truth.toml", "job.toml", "ballbar.csv"} <= set(pdf.attachments)
    pages = [page.extract_text() for page in pypdf.PdfReader(report / "certificate-simulated.pdf").pages]
    assert len(pages) > 2
    assert all(BANNER in " ".join(page.split()) for page in pages)
    html = (report / "certificate-simulated.html").read_text(encoding="utf-8")
    assert html.count(BANNER) == 1
    assert "@top-center" in html
    assert json.loads((report / "manifest.json").read_bytes())["job"]["origin"] == "simulated"


def test_nobody_signs_for_it_and_no_accreditation_covers_it(report: Path) -> None:
    html = (report / "certificate-simulated.html").read_text(encoding="utf-8")
    for absent in ("A. Name", "K-1", "Calibration certificate", "Certificate number", "ISO/IEC 17025"):
        assert absent not in html
    assert "no machine was measured" in html


def test_its_results_say_so(report: Path, simulated: Path) -> None:
    job = json.loads((report / "results.json").read_bytes())["job"]
    assert job["origin"] == "simulated"
    assert job["derived_from"]["job"] == "iota-1102-20C"
    assert job["id"] == read_job(simulated).facts.job.id


@pytest.mark.long
def test_its_diagnosis_and_its_plan_say_so_too(simulated: Path, tmp_path: Path) -> None:
    write_diagnosis(simulated, tmp_path / "d")
    write_plan(simulated, tmp_path / "p", power=False)
    for page in (tmp_path / "d" / "diagnosis-simulated.html", tmp_path / "p" / "plan-simulated.html"):
        assert BANNER in page.read_text(encoding="utf-8")


@pytest.mark.long
def test_without_out_commands_write_beside_each_other(
    simulated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    job = read_job(simulated).facts.job.id
    write_diagnosis(simulated)
    write_plan(simulated, power=False)
    assert (tmp_path / "reports" / job / "diagnosis" / "results.json").is_file()
    assert (tmp_path / "reports" / job / "plan" / "results.json").is_file()


@pytest.mark.parametrize("remove", ["origin", "all"])
def test_a_mark_that_was_taken_away_is_found(job: Path, tmp_path: Path, remove: str) -> None:
    (tmp_path / "truth.toml").write_text(TRUTH)
    out = tmp_path / "out"
    write_simulation(job, tmp_path / "truth.toml", out)
    text = (out / "job.toml").read_text()
    text = re.sub(r"(?m)^origin = .*\n", "", text)
    if remove == "all":
        text = re.sub(r"(?m)^derived_from = .*\n", "", text)
        (out / "job.toml").write_text(text)
        with pytest.raises(CmmUqError, match=r"ballbar\.csv line 1: was simulated, and job\.toml says measured"):
            read_job(out)
        lines = (out / "ballbar.csv").read_text().splitlines(keepends=True)[1:]
        (out / "ballbar.csv").write_text("".join(lines))
        with pytest.raises(CmmUqError, match=r"manifest\.json: the recording was simulated"):
            read_job(out)
    else:
        (out / "job.toml").write_text(text)
        with pytest.raises(CmmUqError, match="derived_from says that the recording was made from another"):
            read_job(out)


def test_a_plan_is_no_recording(job: Path, tmp_path: Path) -> None:
    path = job / "ballbar.csv"
    path.write_text("# planned, nothing is measured yet: nominal coordinates\n" + path.read_text())
    for write in (write_report, write_diagnosis):
        with pytest.raises(CmmUqError, match=r"line 1: holds planned coordinates: nothing is measured"):
            write(job, tmp_path / "out")
    (tmp_path / "truth.toml").write_text(TRUTH)
    write_simulation(job, tmp_path / "truth.toml", tmp_path / "drawn")  # it has placings to simulate
    assert not read_job(tmp_path / "drawn").planned


@pytest.mark.long
def test_a_recording_that_was_changed_after_it_was_simulated_stays_simulated_and_says_so(
    simulated: Path, tmp_path: Path
) -> None:
    changed = Path(shutil.copytree(simulated, tmp_path / "changed"))
    with (changed / "ballbar.csv").open("a") as file:
        file.write("# a remark\n")
    assert read_job(changed).altered == ("ballbar.csv",)
    report = write_report(changed, tmp_path / "out")
    assert json.loads(report.results)["job"]["altered"] == ["ballbar.csv"]
    page = (tmp_path / "out" / "certificate-simulated.html").read_text(encoding="utf-8")
    assert "Changed after it was derived: ballbar.csv" in page


MAPS = {
    "inline": 'error_map = [ { file = "map.csv", temperature_c = 20.0 } ]\nsquareness_arcsec = { xy = 1.0 }\n',
    "lines": 'error_map = [\n  { file = "map.csv", temperature_c = 20.0 },  # a remark\n]\nsquareness_arcsec.xy = 1.0\n',
    "tables": '[[machine.error_map]]\nfile = "map.csv"\ntemperature_c = 20.0\n[machine.squareness_arcsec]\nxy = 1.0\n',
    "quoted": '"error_map" = [{"file"="map.csv","temperature_c"=20.0}]\n[machine.squareness_arcsec]\nxy = 1.0\n',
}


@pytest.mark.parametrize("layout", MAPS)
def test_a_compensated_job_names_no_error_map_however_it_was_written(job: Path, tmp_path: Path, layout: str) -> None:
    (job / "map.csv").write_text(straight())
    path = job / "job.toml"
    text = path.read_text()
    if layout in ("tables", "quoted"):
        text = re.sub(r"(?m)^\[artefact\]", f"{MAPS[layout] if layout == 'tables' else ''}[artefact]", text)
    if layout != "tables":
        text = re.sub(r"(?m)^(chain = .*\n)", lambda found: found[1] + MAPS[layout].split("[machine.")[0], text)
    path.write_text(text)
    assert read_job(job).facts.machine.error_map
    write_compensated(job, tmp_path / "out")
    data = tomllib.loads((tmp_path / "out" / "job.toml").read_text())
    assert not {"error_map", "squareness_arcsec"} & data["machine"].keys()
    assert data["job"]["origin"] == "compensated"
    compensated = read_job(tmp_path / "out")
    assert {"map.csv", "compensation.json"} <= compensated.inputs.keys()
    wanted = tomllib.loads(path.read_text())
    for table in ("recording", "artefact", "model", "conformity"):
        assert data[table] == wanted[table]


def test_what_is_compensated_is_not_compensated_again(job: Path, tmp_path: Path) -> None:
    write_compensated(named(job, straight()), tmp_path / "once")
    path = tmp_path / "once" / "job.toml"
    path.write_text(re.sub(r"(?m)^(chain = .*\n)", lambda found: found[1] + MAPS["inline"], path.read_text()))
    with pytest.raises(CmmUqError, match="is compensated already"):
        write_compensated(tmp_path / "once", tmp_path / "twice")


def test_a_simulated_recording_that_is_compensated_stays_simulated(job: Path, tmp_path: Path) -> None:
    (tmp_path / "truth.toml").write_text(TRUTH)
    write_simulation(named(job, straight()), tmp_path / "truth.toml", tmp_path / "drawn")
    write_compensated(tmp_path / "drawn", tmp_path / "out")
    found = read_job(tmp_path / "out")
    assert found.origin == "simulated"
    assert {"truth.toml", "map.csv", "compensation.json"} <= found.inputs.keys()
    with pytest.raises(CmmUqError, match="is compensated already"):
        write_compensated(tmp_path / "out", tmp_path / "twice")


def test_the_number_of_the_certificate_stays_with_what_was_measured(job: Path) -> None:
    path = job / "job.toml"
    path.write_text(path.read_text().replace("[job]\n", '[job]\nnumber = "C-17"\nissued = 2004-10-01\n', 1))
    data = tomllib.loads(derived_toml(read_job(job), "simulate", {"ballbar.csv": b"", "truth.toml": b""}).decode())
    assert not {"number", "issued"} & data["job"].keys()


def test_a_layout_that_cannot_be_kept_loses_its_comments_and_no_value(job: Path) -> None:
    """Tables of one name in several places, and dotted keys."""
    path = job / "job.toml"
    text = path.read_text().replace('[machine]\nname = "DEA Iota 1102"', '[machine]\nname = "M"', 1)
    path.write_text(
        text + '\n[plan]\nready = "ASME B89.4.1"\n[machine.travel_mm]\n' if "travel_mm" not in text else text
    )
    read = read_job(job)
    data = tomllib.loads(derived_toml(read, "simulate", {"ballbar.csv": b""}).decode())
    before = tomllib.loads(read.inputs["job.toml"].decode())
    for table in before.keys() - {"job"}:
        assert data[table] == before[table]


@pytest.mark.parametrize("folder", MACHINE_JOBS, ids=lambda p: p.name)
def test_every_example_that_was_not_measured_says_so(folder: Path) -> None:
    job = read_job(folder, recorded=False)
    expected = (
        "simulated"
        if folder.name.endswith("-simulated")
        else "compensated"
        if "compensated" in folder.name
        else "measured"
    )
    assert job.origin == expected
