"""``[short_gauge]``: what is read of it, and what is refused."""

from __future__ import annotations

import hashlib
import shutil
import tomllib
from pathlib import Path

import pytest

from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import analyse, outcome_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.result import Result
from cmm_uq.jobs.derived_job import derived_toml
from cmm_uq.jobs.recording.beside import ShortGauge, ShortGaugeFacts, short_gauge_of
from tests.analysis.conformity.recorded import MACHINE
from tests.conftest import ROOT

HEAD = "measurement,point,repeat,x_mm,y_mm,z_mm"


def read(*rows: str, head: str = HEAD, **facts: object) -> ShortGauge:
    given = ShortGaugeFacts(**({"file": "short.csv", "length_mm": 20.0, "u_um": 0.1} | facts))  # type: ignore[arg-type]
    return short_gauge_of(given, "\n".join([head, *rows, ""]).encode(), "short.csv", MACHINE)


def test_its_error_is_measured_minus_certified() -> None:
    """Points in any order; 20.001 and 19.9995 mm."""
    found = read("2,2,1,0,20,0", "2,1,1,0,0.0005,0", "1,1,1,0,0,0", "1,2,1,20.001,0,0")
    assert found.errors_mm == pytest.approx([0.001, -0.0005], abs=1e-9)
    assert found.lines_mm[1].tolist() == [[20.001, 0.0, 0.0], [0.0, 19.9995, 0.0]]


def test_its_expansion_is_taken_off() -> None:
    """20 mm · 11.5e-6 /K · 5 K = 1.15 µm."""
    rows = ("1,1,1,0,0,0,25", "1,2,1,20.00115,0,0,25")
    assert read(*rows, head=f"{HEAD},temp_artefact_c", cte_per_k=11.5e-6).errors_mm == pytest.approx([0.0], abs=1e-9)
    assert read(*rows, head=f"{HEAD},temp_artefact_c").errors_mm == pytest.approx([1.15e-3], abs=1e-9)


def test_an_expanded_uncertainty_is_divided_by_its_factor() -> None:
    given = {"file": "short.csv", "length_mm": 20.0, "U_um": 0.3}
    assert ShortGaugeFacts.model_validate({**given, "k": 2.0}).u_um == 0.15
    with pytest.raises(ValueError, match="U_um together with its coverage factor k"):
        ShortGaugeFacts.model_validate(given)


@pytest.mark.parametrize(("rows", "head", "problem", "where"), [
    (("1,1,1,0,0,0",), HEAD, "does not have points 1 and 2 alone", "line 2"),
    (("1,1,1,0,0,0", "1,2,1,20,0,0", "1,3,1,30,0,0"), HEAD, "does not have points 1 and 2 alone", "line 2"),
    (("1,1,1,0,0,0", "1,2,1,20,0,0", "1,1,2,0,0,0", "1,2,2,25,0,0"), HEAD, "a length of 25 mm", "line 4"),
    (("1,1,1,0,0,0", "1,2,1,20,0,0", "1,1,2,0,0,2", "1,2,2,20,0,2"), HEAD, "two places, 2 mm apart", "line 4"),
    (("1,1,1,0,0,0,1,0,0", "1,2,1,20,0,0,1,0,0"), f"{HEAD},approach_x,approach_y,approach_z", "same side", "line 2"),
])  # fmt: skip
def test_what_cannot_be_such_a_gauge_is_refused_by_its_line(
    rows: tuple[str, ...], head: str, problem: str, where: str
) -> None:  # fmt: skip
    with pytest.raises(CmmUqError, match=problem) as error:
        read(*rows, head=head)
    assert f"short.csv {where}" in str(error.value)


def test_faces_met_from_opposite_sides_are_taken() -> None:
    head = f"{HEAD},approach_x,approach_y,approach_z"
    assert len(read("1,1,1,0,0,0,1,0,0", "1,2,1,20,0,0,-1,0,0", head=head).rows) == 1


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated plate with a short gauge along one row of its balls."""
    made = tmp_path_factory.mktemp("job") / "plate"
    shutil.copytree(ROOT / "examples" / "plate-simulated", made)
    with (made / "job.toml").open("a", encoding="utf-8") as job:
        job.write(
            '\n[short_gauge]\nfile = "short.csv"\nlength_mm = 20.0\nu_um = 0.05\nname = "Gauge block"\n'
            'certificate = { number = "K 118" }\n\n'
            '[[conformity]]\nstandard = "ISO 10360-2:2009"\nlimit_um = 20.0\n'
        )
    (made / "short.csv").write_text(f"{HEAD}\n1,1,1,400,400,-300\n1,2,1,420.002,400,-300\n", encoding="utf-8")
    return made


@pytest.mark.long
def test_a_certificate_names_it_its_file_and_how_often_it_was_taken(folder: Path) -> None:
    """Along row 1 of the plate, and rows within 100 mm of it; its own error there is 2 µm."""
    found = analyse(folder)
    assert isinstance(found, Result)
    outcome = outcome_of(found)
    digest = hashlib.sha256((folder / "short.csv").read_bytes()).hexdigest()
    assert outcome.results["job"]["inputs_sha256"]["short.csv"] == digest
    assert "short.csv" in outcome.document.attachments
    told = repr(outcome.document)
    assert "Gauge block, 20 mm, U = 0.10 µm (k = 2) at 20 °C" in told
    assert "K 118" in told
    assert "bidirectional lengths" not in outcome.results["conformity"][0]["missing"][0]
    assert any("that of the short gauge, 20 mm" in text for text in outcome.results["conformity"][0]["remarks"])


def test_what_is_simulated_from_it_leaves_it_out(folder: Path) -> None:
    job = read_job(folder)
    derived = tomllib.loads(derived_toml(job, "simulate", {}).decode())
    assert "short_gauge" not in derived
    assert "artefact" in derived


def test_without_its_file_the_job_is_refused(folder: Path, tmp_path: Path) -> None:
    bare = tmp_path / "bare"
    shutil.copytree(folder, bare)
    (bare / "short.csv").unlink()
    with pytest.raises(CmmUqError, match=r"short\.csv"):
        read_job(bare)
