"""``cmm-uq part`` as a user meets it: files all or none, a summary, JSON, exit codes."""

from __future__ import annotations

import json
import os
import tomllib
from hashlib import sha256
from pathlib import Path
from subprocess import CompletedProcess
from unittest import mock

import numpy as np
import pytest

from cmm_uq.app.commands.files import results_at
from cmm_uq.app.commands.laboratory.records import import_reports
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.verify.sources import witnesses_of
from cmm_uq.jobs.part.job import TABLES
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.facts import BEGINNING
from tests.app.cli.process import run
from tests.part_machines import THERE, by_results, plate_files

TIGHT = {**TABLES["characteristic"][0], "lower_mm": 30.2, "upper_mm": 30.3}
TRIALS = ("--trials", 1000)


def folder_of(tmp_path: Path, **changes: object) -> Path:
    for name, content in plate_files(by_results(), np.zeros((60, 3)), **{**THERE, **changes}).items():
        path = tmp_path / "plate" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return tmp_path / "plate"


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, CompletedProcess[str]]:
    """A diameter that is not within its limits."""
    place = tmp_path_factory.mktemp("part")
    folder = folder_of(place, characteristic=[TIGHT])
    with mock.patch.dict(os.environ, {"CMM_UQ_RECORDS": ""}):
        return place, run("part", folder, *TRIALS, "--strict", "--seed", 3, cwd=place)


def test_it_writes_its_files_below_reports(done: tuple[Path, CompletedProcess[str]]) -> None:
    place, _ = done
    written = sorted(path.name for path in (place / "reports" / "plate").iterdir())
    assert written == ["manifest.json", "part-simulated.html", "part-simulated.pdf", "provenance.json", "results.json"]


def test_it_is_recorded_and_states_the_head_before_its_entry(done: tuple[Path, CompletedProcess[str]]) -> None:
    """Whoever has the report shows the entry; imported into other records it is the same one."""
    place, process = done
    assert "Recorded in reports/records.db." in process.stdout
    report, empty = place / "reports" / "plate", {"entries": 0, "head": BEGINNING, "at": None}
    results = (report / "results.json").read_bytes()
    assert json.loads(results)["records"] == empty
    page = (report / "part-simulated.html").read_text(encoding="utf-8")
    assert "Records of the laboratory before this document: empty, entry 0." in page
    with open_records(place / "reports" / "records.db", read_only=True) as records:
        (entry,) = records.entries()
        stated, _ = witnesses_of([report])
        assert (entry.kind, records.disagreements(stated), records.verify()) == ("part", [], [])
        again, _ = results_at(json.loads(results), records.heads("part", "plate"))
        assert again == results  # made again at a later head
    said, digest = entry.data, sha256((report / "part-simulated.pdf").read_bytes()).hexdigest()
    assert (said["number"], said["decision"], said["records"], said["files"]["part-simulated.pdf"]) == (
        "plate", "fail", empty, digest
    )  # fmt: skip
    assert (said["plan"], said["points"], said["certificate"]["files"][0]) == (
        "job.toml",
        "points.csv",
        "machine/results.json",
    )
    assert {"job.toml", "points.csv", "machine/results.json"} <= said["inputs"].keys()
    with open_records(place / "others.db", create=True) as others:
        import_reports(others, [report])
        (imported,) = others.entries()
    assert imported.data == said | {"folder": "reports/plate"}
    (report / "results.json").write_bytes(results.replace(b'"entries": 0', b'"entries": 1'))
    try:
        with pytest.raises(CmmUqError, match="is no head of records"):
            witnesses_of([report / "results.json"])
    finally:
        (report / "results.json").write_bytes(results)


def test_a_part_that_does_not_conform_ends_with_4_where_that_is_asked_for(
    done: tuple[Path, CompletedProcess[str]],
) -> None:
    _, process = done
    assert process.returncode == 4, process.stderr
    assert "FAIL  1, diameter of bore: conforms with" in process.stdout
    assert "SIMULATED RECORDING, not a calibration certificate" in process.stdout
    assert "its recording is not at hand" in " ".join(process.stdout.split())


def test_results_are_of_the_seed_and_the_inputs(done: tuple[Path, CompletedProcess[str]]) -> None:
    place, _ = done
    data = json.loads((place / "reports" / "plate" / "results.json").read_bytes())
    assert data["simulation"]["seed"] == 3
    assert data["characteristics"][0]["decision"]["outcome"] == "fail"
    made = json.loads((place / "reports" / "plate" / "provenance.json").read_bytes())
    used = {name.removeprefix("file:"): one["cmm-uq:sha256"] for name, one in made["entity"].items()
            if one.get("prov:type") == "input"}  # fmt: skip
    assert used == data["job"]["inputs_sha256"]


def test_nothing_is_written_where_the_machine_is_refused(tmp_path: Path) -> None:
    folder = folder_of(tmp_path)
    (folder / "machine" / "posterior-simulated.npz").write_bytes(b"no archive")
    process = run("part", folder, "--json", cwd=tmp_path)
    assert process.returncode == 2
    assert "does not verify" in json.loads(process.stdout or process.stderr)["error"]["problem"]
    assert not (tmp_path / "reports").exists()


@pytest.mark.parametrize(("row", "instead", "words"), [
    ("A,3,", None, "point 3 of 'A' is missing"),
    ("A,3,", "A,3,nan,0,0", "column x_mm"),
    ("A,3,", "Q,3,5,5,0", "there is no feature 'Q'"),
    ("bore,1,", "bore,1,60.0,40.0,-15.0", "point 1 of 'bore' lies 15.03 mm from where it is planned"),
])  # fmt: skip
def test_measured_points_that_are_not_those_of_the_plan_are_told_by_line(
    row: str, instead: str | None, words: str, tmp_path: Path
) -> None:
    folder = folder_of(tmp_path)
    lines = (folder / "points.csv").read_text(encoding="utf-8").splitlines()
    kept = [line if not line.startswith(row) else instead for line in lines]
    (folder / "points.csv").write_text("\n".join(line for line in kept if line is not None) + "\n", encoding="utf-8")
    process = run("part", folder, cwd=tmp_path)
    assert process.returncode == 2
    assert words in process.stderr
    assert "Traceback" not in process.stderr


def test_swapped_points_are_refused(tmp_path: Path) -> None:
    folder = folder_of(tmp_path)
    text = (folder / "points.csv").read_text(encoding="utf-8")
    swapped = text.replace("\nB,", "\nX,").replace("\nC,", "\nB,").replace("\nX,", "\nC,")
    (folder / "points.csv").write_text(swapped, encoding="utf-8")
    process = run("part", folder, cwd=tmp_path)
    assert process.returncode == 2
    assert "from where it is planned" in process.stderr


def test_a_tolerance_without_a_feature_names_its_key(tmp_path: Path) -> None:
    folder = folder_of(tmp_path)
    text = (folder / "job.toml").read_text(encoding="utf-8")
    (folder / "job.toml").write_text(text.replace('features = ["A"]', 'features = ["AA"]'), encoding="utf-8")
    assert tomllib.loads((folder / "job.toml").read_text(encoding="utf-8"))
    process = run("part", folder, cwd=tmp_path)
    assert process.returncode == 2
    assert "features: there is no feature 'AA'" in process.stderr
