"""Physics that a job states itself, from its formula to certificate, diagnosis, plan and verification."""

from __future__ import annotations

import json
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import cmm_uq
from cmm_uq.app.commands.certificates.verify import verify
from cmm_uq.app.commands.files import called
from cmm_uq.app.commands.forms import listed_effects
from cmm_uq.app.commands.jobs.check import check_job
from cmm_uq.app.commands.model import recorded_model
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import evaluate_job, write_report
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.job import Job
from cmm_uq.machine.physics import catalogue
from cmm_uq.machine.physics.catalogue import EVERY, every
from cmm_uq.machine.physics.stated import physics_of
from tests.conftest import ROOT
from tests.machine.physics.test_plugins import Bulge
from tests.site.pages import snippets

IOTA = ROOT / "examples" / "iota-1102-20C"
WAVE = {
    "name": "guide_wave", "title": "Wave of a guideway", "formula": "e_x = k*sin(2*pi*y/250)", "unit": "um", "prior": 20.0,
    "points_to": "the screws of the guideway",
}  # fmt: skip
SIX = ["scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx"]
MACHINE = {"name": "DEA Iota 1102", "serial": "7", "travel_mm": {"x": [0, 900], "y": [0, 550], "z": [-500, 0]},
           "origin_mm": [805.0, 303.0, -294.0]}  # fmt: skip


def job(*names: str, timed: bool = True, **more: object) -> Job:
    """The set-ups of a real recording, with one effect of the job's own and those named."""
    frame = pd.read_csv(IOTA / "ballbar.csv").assign(**({"time_s": np.arange(40.0) * 60} if timed else {}))
    return cmm_uq.job(
        frame, machine=MACHINE, artefact={"kind": "ballbar", "length_mm": 404.2357, "u_um": 0.5},
        effects=[*SIX, *names], effect=[{**WAVE, **more}], date="2026-01-31",
    )  # fmt: skip


def drawn(of: Job, size: float, seed: int = 1) -> Job:
    truth = {"seed": seed, "effects": {"guide_wave": {"k_um": size}}, "noise": {"coordinate_um": 0.5}}
    return cmm_uq.simulate(of, truth)


def test_what_a_job_states_is_in_the_catalogue_while_a_command_is_at_it() -> None:
    with physics_of(job()):
        assert list(every()) == [*EVERY, "guide_wave"]
        assert called("guide_wave.k_um") == "Wave of a guideway"
        with physics_of(read_job(IOTA)):
            assert list(every()) == [*EVERY]
    assert list(every()) == [*EVERY]
    assert called("guide_wave.k_um") != "Wave of a guideway"


def test_a_concealed_amplitude_comes_back() -> None:
    """Least squares with the prior: off by what noise and prior leave, five standard uncertainties at most."""
    for seed, truth in enumerate((-30.0, 12.0, 45.0)):
        found = drawn(job("guide_wave"), truth, seed)
        with physics_of(found):
            model, _ = recorded_model(found)
            estimate = model.estimate().least_squares
        column = [unknown.key for unknown in estimate.unknowns].index(("guide_wave", "k_um"))
        u = float(np.sqrt(estimate.covariance[column, column]))
        assert u < 2.0  # a tenth of the prior
        assert abs(estimate.value[column] - truth) < 5 * u


@pytest.mark.long
def test_a_diagnosis_finds_what_the_job_states_and_does_not_name() -> None:
    found = cmm_uq.diagnose(drawn(job(), 25.0))
    assert found.verdict == "explained"
    (row,) = found.effects.to_dict("records")
    assert list(found.effects.index) == ["guide_wave.k_um"]
    assert row["unit"] == "µm"
    assert abs(row["value"] - 25.0) < 5 * row["u"]
    (effect,) = found.diagnosis["effects"]
    assert "What it points to: the screws of the guideway." in effect["words"]
    assert "e_x = k*sin(2*pi*y/250), in mm; k about 0 ± 20 µm beforehand" in str(found.outcome.document)


@pytest.mark.long
def test_a_certificate_says_what_is_the_laboratory_s_own_and_is_verified(tmp_path: Path) -> None:
    drawn(job("guide_wave"), 40.0).write(tmp_path / "job")
    write_report(tmp_path / "job", tmp_path / "report")
    page = (tmp_path / "report" / "certificate-simulated.html").read_text(encoding="utf-8")
    own = 'Physics stated by the job</dt><dd dir="auto">Wave of a guideway: e_x = k*sin(2*pi*y/250), in mm; k about 0 ± 20'
    assert own in page
    data = json.loads((tmp_path / "report" / "results.json").read_bytes())
    assert abs(data["estimates"]["guide_wave"]["k_um"]["value"] - 40.0) < 4
    done = verify([tmp_path / "report"])
    assert (done.inquiry.findings, "again" in done.inquiry.done) == ([], True)
    assert ">Wave of a guideway<" in (tmp_path / "report" / "certificate-simulated.xml").read_text("utf-8")


@pytest.mark.long
def test_a_plan_says_what_placings_tell_of_it() -> None:
    plan = cmm_uq.plan(job("guide_wave"), power=False)
    assert [row[0] for row in plan.outcome.summary.figures].count("Wave of a guideway") == 1
    assert "Physics stated by the job" in str(plan.outcome.document)


def test_what_the_page_shows_is_taken() -> None:
    (text,) = (one.text for one in snippets(ROOT / "docs" / "machine" / "effects.md", "toml", excerpt=True))
    page = tomllib.loads(text)
    frame = pd.read_csv(IOTA / "ballbar.csv").assign(time_s=np.arange(40.0) * 60, temp_x_c=21.0)
    shown = cmm_uq.job(
        frame, machine=MACHINE, artefact="ballbar", effects=page["model"]["effects"], effect=page["effect"]
    )
    with physics_of(shown):
        assert list(every()) == [*EVERY, "table_tilt", "warming_ram"]


@pytest.mark.usefixtures("no_regions", "no_diagnosis")
def test_a_document_that_is_composed_later_knows_what_the_job_states() -> None:
    """The page is made when it is first asked for, after the command's end."""
    found = cmm_uq.report(drawn(job("guide_wave"), 40.0))
    found.outcome.__dict__.pop("document", None)
    assert "Wave of a guideway" in str(found.outcome.document)


def test_a_shape_is_searched_and_a_column_counted() -> None:
    table = {"a": {"unit": "um", "prior": 20.0}, "tau": {"unit": "h", "low": 0.05, "high": 2.0}}
    settling = job(formula="e_z = a*exp(-time_s/tau)*x/100", unit=None, prior=None, parameters=table)
    truth = {"effects": {"guide_wave": {"a_um": 5.0, "tau_h": 0.3}}}
    moved = cmm_uq.simulate(settling, truth).points.xyz - cmm_uq.simulate(settling, {}).points.xyz
    assert np.abs(moved).max() > 1e-3


REFUSED = [
    ({"formula": "e_z = k*w"}, "[[effect]] 1 formula: there is no input 'w'"),
    ({"formula": "e_z = k*temp_x_c"}, "[[effect]] 1 formula: guide_wave needs the column temp_x_c"),
    ({"formula": "e_z = k**2"}, "[[effect]] 1 formula: e_z is not proportional to k"),
    (
        {"formula": "e_z = k/time_s"},
        "[[effect]] 1 formula: guide_wave with k of its prior gives no number at x = 308.3177",
    ),
    ({"formula": "e_z = k*x.__class__"}, "[[effect]] 1 formula: 'x.__class__' is not arithmetic"),
    ({"formula": "e_z = k*x**1e308"}, "[[effect]] 1 formula: guide_wave with k of its prior gives no number"),
    ({"name": "drift_x"}, "[[effect]] 1: there is a 'drift_x' already"),
    ({"unit": "inch"}, "[[effect]] 1 unit: 'inch' is no unit of a parameter"),
]


@pytest.mark.parametrize(("change", "said"), REFUSED, ids=lambda each: str(each)[:40])
def test_what_a_job_states_wrongly_is_refused_by_every_command(
    change: dict[str, str], said: str, tmp_path: Path
) -> None:
    """With file, line and key; ``check`` says it beside all else."""
    wrong = job(**change)
    for command in (cmm_uq.plan, evaluate_job, cmm_uq.diagnose, lambda each: cmm_uq.simulate(each, {})):
        with pytest.raises(CmmUqError) as refused:
            command(wrong)
        assert str(refused.value).startswith(f"job.toml {said}")
    wrong.write(tmp_path / "job")
    (problem,) = check_job(tmp_path / "job").problems
    assert problem.line
    assert (problem.file, said.rpartition(": ")[2]) == (str(tmp_path / "job" / "job.toml"), said.rpartition(": ")[2])


def test_cases_are_not_drawn_of_what_other_processes_do_not_know(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(catalogue, "_REGISTERED", {})
    cmm_uq.register(Bulge)
    with pytest.raises(CmmUqError, match=r"^cmm_uq.register: bulge: registered in this process"):
        cmm_uq.prove(IOTA, cases=1)


@pytest.mark.long
def test_a_part_is_measured_on_a_machine_with_what_its_job_states(tmp_path: Path) -> None:
    """The machine's errors are drawn given its recording, which takes the effect's own formula."""
    shutil.copytree(ROOT / "examples" / "part-plate-simulated", tmp_path / "part")
    drawn(job("guide_wave", timed=False), 40.0).write(tmp_path / "part" / "calibration")
    toml = tmp_path / "part" / "job.toml"
    text = toml.read_text("utf-8").replace(
        'certificate = "machine"', 'job = "calibration"\norigin_mm = [805, 303, -294]'
    )
    toml.write_text(text.replace("-simulated", "-drawn"), encoding="utf-8")
    found = cmm_uq.part(tmp_path / "part", trials=2000).found
    assert "drawn together, given the recording" in found.standing.path


def test_two_of_one_name_are_refused(tmp_path: Path) -> None:
    shutil.copytree(IOTA, tmp_path / "job")
    toml = tmp_path / "job" / "job.toml"
    table = '\n[[effect]]\nname = "own"\nformula = "e_x = k*y*z"\nunit = "um/m"\nprior = 1.0\n'
    toml.write_text(toml.read_text("utf-8") + 2 * table, encoding="utf-8")
    (problem,) = check_job(tmp_path / "job").problems
    assert (problem.problem, problem.key) == ("the effect 'own' is stated twice", "[[effect]] 2 name")


def test_a_name_that_the_job_states_is_known_though_another_key_is_wrong(tmp_path: Path) -> None:
    job("guide_wave").write(tmp_path / "job")
    toml = tmp_path / "job" / "job.toml"
    toml.write_text(toml.read_text("utf-8").replace("u_um = 0.5", "u_um = -0.5"), encoding="utf-8")
    (problem,) = check_job(tmp_path / "job").problems
    assert "u_um" in str(problem)


def test_a_temperature_of_the_truth_or_the_plan_is_a_column_of_the_formula() -> None:
    warm = job(formula="e_z = k*(temp_air_c - 20)", unit="um/K")
    assert np.ptp(cmm_uq.simulate(warm, {"columns": {"temp_air_c": 23.0}}).points.columns["temp_air_c"]) == 0
    with pytest.raises(CmmUqError, match="needs the column temp_air_c"):
        cmm_uq.simulate(warm, {})


def test_effects_are_listed_by_any_word_of_them(tmp_path: Path) -> None:
    assert [each["name"] for each in listed_effects()] == list(EVERY)
    job().write(tmp_path / "job")
    (own,) = listed_effects("SCREWS of", tmp_path / "job")
    assert own == {
        "name": "guide_wave", "title": "Wave of a guideway", "formula": "e_x = k*sin(2*pi*y/250)",
        "parameters": "k_um ±20 µm", "columns": "", "mechanism": "stated by the job",
        "points_to": "the screws of the guideway",
    }  # fmt: skip
    assert {each["mechanism"] for each in listed_effects("backlash")} <= {"drive", "guideway"}
    named = [each["name"] for each in listed_effects("settling_h")]
    assert named == [f"{of}settling_{axis}" for of in ("", "scale_") for axis in "xyz"]
    with pytest.raises(CmmUqError, match=r"no effect has 'sqareness' in it\. Did you mean 'squareness'"):
        listed_effects("sqareness")
