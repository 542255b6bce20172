"""The calls take jobs, folders, tables and functions, and derive the jobs that the commands write."""

from __future__ import annotations

import doctest
import json
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import cmm_uq
from cmm_uq.app.commands.jobs.compensate import write_compensated
from cmm_uq.app.commands.jobs.simulate import write_simulation
from cmm_uq.jobs.job import Job
from tests.conftest import ROOT

IOTA = ROOT / "examples" / "iota-1102-20C"
TRUTH = {"seed": 4, "effects": {"squareness_xy": {"angle_arcsec": -173.0}}, "noise": {"coordinate_um": 1.2}}
MACHINE = {
    "name": "DEA Iota 1102", "travel_mm": {"x": [0, 900], "y": [0, 550], "z": [-500, 0]}, "origin_mm": [805.0, 303.0, -294.0],
}  # fmt: skip
BAR = {"kind": "ballbar", "length_mm": 404.2357, "u_um": 5.0, "cte_per_k": 12e-6}
HEAVY = (
    "numpy",
    "scipy",
    "pandas",
    "pydantic",
    "matplotlib",
    "emcee",
    "typst",
    "jinja2",
    "tomlkit",
    "typer",
    "cmm_uq.jobs",
)


def from_frame(**more: object) -> Job:
    frame = pd.read_csv(IOTA / "ballbar.csv")
    effects = ["scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx"]
    return cmm_uq.job(frame, **{"machine": MACHINE, "artefact": BAR, "effects": effects, **more})  # type: ignore[arg-type]


def test_importing_the_package_imports_nothing_heavy() -> None:
    code = f"import sys, cmm_uq; print([m for m in {HEAVY} if m in sys.modules])"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert said.stdout.strip() == "[]"


def test_every_name_of_the_api_is_there_and_another_is_none() -> None:
    assert all(callable(getattr(cmm_uq, name)) for name in cmm_uq.__all__ if name != "__version__")
    assert set(cmm_uq.__all__) <= set(dir(cmm_uq))
    with pytest.raises(AttributeError, match="nothing"):
        cmm_uq.nothing  # noqa: B018


@pytest.mark.long
def test_a_job_from_a_frame_gives_the_figures_of_the_folder() -> None:
    ours, theirs = cmm_uq.report(from_frame(date="2004-09-01")), cmm_uq.report(IOTA)
    assert ours.estimates.equals(theirs.estimates)
    assert ours.figures.equals(theirs.figures)


@pytest.mark.long
def test_a_job_from_a_frame_is_written_as_a_folder_that_reads_back_to_it(tmp_path: Path) -> None:
    job = from_frame(id="bar-7", conformity=[{"standard": "ASME B89.4.1-1997", "limit_um": 60.0}])
    job.write(str(tmp_path / "job"))
    again = cmm_uq.read(tmp_path / "job")
    assert dict(again.inputs) == dict(job.inputs)
    assert again.facts == job.facts
    first, second = cmm_uq.report(job), cmm_uq.report(again)
    assert first.covariance.equals(second.covariance)
    assert first.outcome.document == second.outcome.document


def test_a_job_without_a_date_says_that_none_was_given() -> None:
    job = from_frame()
    assert job.facts.job.date.isoformat() == "1970-01-01"
    assert "not given" in job.facts.job.remarks


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"artefact": {**BAR, "lenght_mm": 1.0}}, r"\[artefact\] lenght_mm: unknown key"),
        ({"effects": ["squarenes_xy"]}, "squarenes_xy"),
        ({"machine": {"name": "M", "travel_mm": {"x": [900, 0]}}}, r"\[machine\] travel_mm"),
        ({"recording": {"file": "../r.csv"}}, "not inside the job folder"),
        ({"laboratory": {"name": object()}}, "TOML"),
    ],
)
def test_a_wrong_key_is_named(more: dict[str, object], said: str) -> None:
    with pytest.raises(cmm_uq.CmmUqError, match=said):
        cmm_uq.report(from_frame(**more))


def test_a_wrong_cell_is_named_by_line_and_column() -> None:
    frame = pd.read_csv(IOTA / "ballbar.csv")
    frame.loc[2, "y_mm"] = np.nan
    with pytest.raises(cmm_uq.CmmUqError, match=r"recording.csv line 4.*y_mm"):
        cmm_uq.job(frame, machine=MACHINE, artefact=BAR, effects=["scale_x"])
    with pytest.raises(cmm_uq.CmmUqError, match="z_mm"):
        cmm_uq.job(frame.drop(columns="z_mm"), machine=MACHINE, artefact=BAR, effects=["scale_x"])


def test_a_simulated_job_is_the_one_that_the_command_writes(tmp_path: Path) -> None:
    truth = tmp_path / "truth.toml"
    drawn = cmm_uq.simulate(IOTA, TRUTH)
    truth.write_bytes(drawn.inputs["truth.toml"])
    write_simulation(IOTA, truth, tmp_path / "command")
    assert drawn.origin == "simulated"
    drawn.write(tmp_path / "call")
    for name in drawn.inputs:
        assert (tmp_path / "call" / name).read_bytes() == (tmp_path / "command" / name).read_bytes()
    assert dict(cmm_uq.simulate(str(IOTA), str(truth)).inputs) == dict(drawn.inputs)
    assert cmm_uq.simulate(IOTA, TRUTH, seed=5).facts.job.id != drawn.facts.job.id


def test_the_mark_of_a_simulated_job_cannot_be_taken_from_its_folder_unseen(tmp_path: Path) -> None:
    cmm_uq.simulate(IOTA, TRUTH).write(tmp_path / "job")
    manifest = json.loads((tmp_path / "job" / "manifest.json").read_bytes())
    assert (manifest["command"], manifest["job"]["origin"]) == ("simulate", "simulated")


def test_a_compensated_job_is_the_one_that_the_command_writes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The provenance names the error map as it was found: from inside the job's folder, by its name alone."""
    axes = pd.DataFrame({
        "axis": list("xxyyzz"), "position_mm": [0.0, 900.0, 0.0, 550.0, -500.0, 0.0], "dx_um": [0.0, 90.0, *4 * [0.0]],
        **{name: 6 * [0.0] for name in ("dy_um", "dz_um", "rx_arcsec", "ry_arcsec", "rz_arcsec")},
    })  # fmt: skip
    machine = {**MACHINE, "error_map": [{"file": "map.csv", "temperature_c": 20.0}]}
    job = from_frame(machine=machine, files={"map.csv": axes})
    job.write(tmp_path / "job")
    monkeypatch.chdir(tmp_path / "job")
    write_compensated(Path(), tmp_path / "command")
    corrected = cmm_uq.compensate(job)
    assert corrected.origin == "compensated"
    for name, content in corrected.inputs.items():
        assert content == (tmp_path / "command" / name).read_bytes()
    moved = corrected.points.xyz[:, 0] - job.points.xyz[:, 0]
    assert moved == pytest.approx(1e-4 * (job.points.xyz[:, 0] + 805.0), abs=1e-6)


def test_a_function_has_the_budget_of_the_same_model_in_a_file(tmp_path: Path) -> None:
    file = tmp_path / "model.toml"
    file.write_text(
        '[model]\noutputs = { y = "a * b" }\nmethod = "first"\n'
        '[inputs.a]\ndistribution = "normal"\nvalue = 3.0\nu = 0.1\n'
        '[inputs.b]\ndistribution = "normal"\nvalue = 4.0\nu = 0.2\n'
    )
    ours = cmm_uq.budget(lambda a, b: a * b, {"a": (3.0, 0.1), "b": (4.0, 0.2)}, method="first").stated["y"]
    theirs = cmm_uq.budget(str(file)).stated["y"]
    assert (ours.value, ours.u) == (theirs.value, theirs.u)
    assert ours.u == pytest.approx(np.hypot(4 * 0.1, 3 * 0.2))  # JCGM 100:2008, equation 10
    with pytest.raises(cmm_uq.CmmUqError, match="needs its inputs"):
        cmm_uq.budget(lambda a: a)


@pytest.mark.parametrize(("module", "least"), [("cmm_uq", 3), ("cmm_uq.app.api.calls", 10)])
def test_the_examples_of_the_docstrings_hold(module: str, least: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    ran = doctest.testmod(import_module(module), raise_on_error=False)
    assert ran.attempted >= least
    assert ran.failed == 0
