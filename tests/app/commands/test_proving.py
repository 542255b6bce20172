"""From a job to the proof of its diagnosis: the same on any number of processes, kept, written as one set, described."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cmm_uq
from cmm_uq.app.api import outcomes as api
from cmm_uq.app.commands.prove import UNFINISHED, ProofOptions, design_of, prove_job, true_values
from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.toml_file import as_toml
from cmm_uq.base.units import MICROMETRE
from cmm_uq.certificate.proof.page import proof_document, proof_outcome, proof_results
from cmm_uq.certificate.proof.sections import DiagnosisProof
from cmm_uq.laboratory.proving.answers import RECORDS, TRUTH
from cmm_uq.machine.physics.catalogue import every
from tests.app.cli.process import run
from tests.certificate.saying import strangers
from tests.conftest import ROOT
from tests.laboratory.proving.test_judgement import whole
from tests.result_keys import PROOF, RATE

JOB = ROOT / "examples" / "plane-simulated"
CASES = 2


@dataclass(frozen=True)
class Ran:
    """A proof on two cases, and the folder in which truth and answers were kept."""

    proof: DiagnosisProof
    kept: Path
    told: tuple[str, ...]


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Ran:
    folder = tmp_path_factory.mktemp("prove") / UNFINISHED
    told: list[str] = []

    def sealed(digest: str) -> None:
        assert sha256((folder / TRUTH).read_bytes()).hexdigest() == digest
        assert not (folder / RECORDS).read_bytes()
        told.append(digest)

    proof, kept = prove_job(read_job(JOB), ProofOptions(CASES, 2), folder=folder, sealed=sealed)
    assert kept is not None
    kept.close()
    return Ran(proof, folder, tuple(told))


@pytest.mark.long
def test_the_truth_is_on_the_disk_and_told_before_anything_is_said_of_it(ran: Ran) -> None:
    """The fixture looks when the hash is told."""
    assert ran.told == (ran.proof.sha256,)
    truth = json.loads(ran.proof.truth)
    assert [case["kind"] for case in truth["cases"]] == ["nothing", "one effect"]
    assert truth["accepted_by"] == {
        "false_alarms_pct": 2.0,
        "coverage_pct": [93.0, 97.0],
        "wrong_names_pct": None,
        "found_pct": None,
    }
    assert set(truth["inputs_sha256"]) == {"job.toml", "recording.csv"}


@pytest.mark.long
def test_one_process_says_what_two_do(ran: Ran) -> None:
    alone, _ = prove_job(read_job(JOB), ProofOptions(CASES, 1))
    assert alone.truth == ran.proof.truth
    assert alone.answers == ran.proof.answers
    assert sorted((ran.kept / RECORDS).read_bytes().splitlines()) == sorted(alone.answers.splitlines())


@pytest.mark.long
def test_the_command_goes_on_with_what_was_kept_and_writes_one_set(ran: Ran, tmp_path: Path) -> None:
    shutil.copytree(ran.kept, tmp_path / UNFINISHED)
    done = run("prove", JOB, "--cases", CASES, "--workers", 2, "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"Truth sealed: sha256 {ran.proof.sha256}\n")
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "cases.jsonl", "manifest.json", "results.json", "truth.json", "validation-simulated.html", "validation-simulated.pdf",
    ]  # fmt: skip
    assert (tmp_path / "truth.json").read_bytes() == ran.proof.truth
    assert (tmp_path / "cases.jsonl").read_bytes() == ran.proof.answers
    page = (tmp_path / "validation-simulated.html").read_text(encoding="utf-8")
    assert ran.proof.sha256 in page
    assert "ISO/IEC 17025:2017, 7.2.2" in page
    assert json.loads((tmp_path / "results.json").read_bytes())["truth_sha256"] == ran.proof.sha256


@pytest.mark.long
def test_another_seed_is_refused_where_a_run_is_unfinished(ran: Ran, tmp_path: Path) -> None:
    shutil.copytree(ran.kept, tmp_path / UNFINISHED)
    done = run("prove", JOB, "--cases", CASES, "--seed", 1, "--out", tmp_path)
    assert done.returncode == 2
    assert "another truth" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == [UNFINISHED]
    assert (tmp_path / UNFINISHED / TRUTH).read_bytes() == ran.proof.truth


def test_an_answer_that_nobody_gave_is_refused(ran: Ran, tmp_path: Path) -> None:
    shutil.copytree(ran.kept, tmp_path / UNFINISHED)
    (tmp_path / UNFINISHED / RECORDS).write_bytes(b'{"number":0,"verdict":"consistent"}\n')
    done = run("prove", JOB, "--cases", CASES, "--out", tmp_path)
    assert done.returncode == 2
    assert "none of these processes gave" in done.stderr


def test_python_gives_the_rates_as_a_table(ran: Ran) -> None:
    found = api.ProofOutcome(proof_outcome(ran.proof))
    assert found.rates.loc["false_alarms", ["count", "of"]].tolist() == [0, 1]
    assert found.rates.loc["coverage", "of"] >= 1
    assert found.sha256 == ran.proof.sha256
    assert repr(found).startswith("<Proof of plane-simulated: 2 cases, false_alarms open, coverage open")


def test_a_call_from_python_refuses_what_the_command_refuses(iota: Path) -> None:
    with pytest.raises(CmmUqError, match="0 cases"):
        cmm_uq.prove(iota, cases=0)


def paths(data: Any, here: str = "") -> Iterator[str]:
    if isinstance(data, dict) and data:
        for key, value in data.items():
            yield from paths(value, f"{here}.{key}".lstrip("."))
    elif isinstance(data, list) and data and isinstance(data[0], dict):
        for value in data:
            yield from paths(value, f"{here}[]")
    else:
        yield here


def described(path: str) -> bool:
    return any(covers(pattern.split("."), told, path.split(".")) for pattern, told in PROOF.items())


def covers(names: list[str], told: str, parts: list[str]) -> bool:
    same = [one.removesuffix("[]").isupper() or one == other for one, other in zip(names, parts, strict=False)]
    rest = parts[len(names) :]
    whole = not rest or names[-1] == "KEY" or (told.startswith("Rate:") and rest[0] in RATE)
    return len(parts) >= len(names) and all(same) and whole


def test_every_key_of_the_results_is_described(ran: Ran) -> None:
    """Of cases with assertions: two that were drawn may have none."""
    found = {*paths(proof_results(replace(ran.proof, judgement=whole())))}
    assert "probabilities[].right.count" in found
    assert [path for path in found if not described(path)] == []


def test_every_text_of_the_page_can_be_translated(ran: Ran) -> None:
    known = "\n".join(
        [(JOB / "job.toml").read_text(encoding="utf-8"), ran.proof.sha256, TRUTH, RECORDS, "results.json cmm-uq"]
    )
    columns = " ".join(column for effect in every().values() for column in effect.columns)
    assert list(strangers(proof_document(ran.proof), known + columns)) == []


@pytest.mark.parametrize(("name", "said"), [
    ("iota-1102-maps", "analysis of its own"), ("shift-simulated", "analysis of its own"),
    ("iota-1102-20C-against-simulation", "against a simulation is not proved"),
])  # fmt: skip
def test_a_job_with_another_analysis_is_refused_in_words(name: str, said: str, tmp_path: Path) -> None:
    done = run("prove", ROOT / "examples" / name, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert said in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("option", "value"), [
    ("--cases", "0"), ("--cases", "-3"), ("--cases", "99999999"), ("--cases", "many"), ("--workers", "0"),
    ("--workers", "100000"), ("--seed", "-1"), ("--alpha", "0"), ("--alpha", "nan"), ("--alpha", "0.9"),
])  # fmt: skip
def test_options_that_make_no_sense_are_refused_before_anything_is_done(
    option: str, value: str, tmp_path: Path
) -> None:
    done = run("prove", JOB, option, value, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert option in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("table", "said"), [
    ({"coverage_pct": [97.0, 93.0]}, "lower one"), ({"false_alarms_pct": 0.0}, "false_alarms_pct"),
    ({"found_pct": 120.0}, "found_pct"), ({"detected_pct": 90.0}, "unknown key"),
])  # fmt: skip
def test_figures_that_cannot_be_asked_for_are_refused(table: dict[str, Any], said: str, tmp_path: Path) -> None:
    job = tmp_path / "job"
    shutil.copytree(JOB, job)
    with (job / "job.toml").open("ab") as file:
        file.write(b"\n" + as_toml({"prove": table}, "job.toml"))
    done = run("prove", job, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert said in done.stderr


def planned(folder: Path, without: str) -> Path:
    """The lines of a gauge still to be measured."""
    shutil.copytree(ROOT / "examples" / "plan-step-gauge", folder)
    told = (folder / "job.toml").read_text(encoding="utf-8")
    for line in ('criterion = "separation"', "more = 1", without):
        told = told.replace(line, "")
    (folder / "job.toml").write_text(told, encoding="utf-8")
    return folder


def test_a_plan_is_proved_in_the_noise_that_it_states(tmp_path: Path) -> None:
    """Seven lines, no recording: six tenths of a micrometre as stated, and nothing of the machine's own."""
    job, design = design_of(read_job(planned(tmp_path / "job", "budget_min = 0"), recorded=False))
    assert np.allclose(np.array(design.noise.coordinate) / MICROMETRE, 0.6)
    assert len(job.points) == len(design.model.artefact.points) > 0
    assert set(true_values(design).values()) == {0.0}


def test_a_plan_without_stated_noise_is_refused(tmp_path: Path) -> None:
    job = planned(tmp_path / "job", "u_coordinate_um = 0.6")
    with pytest.raises(CmmUqError, match="no noise is stated"):
        design_of(read_job(job, recorded=False))
