"""Effects of other packages on the command line, and packages that fail."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import traceback
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cmm_uq
from cmm_uq.artefacts import kind_named
from cmm_uq.base.overflow import refusing_overflow
from cmm_uq.base.plugins import BrokenPluginError, naming_package, told_with_package
from tests.app.cli.process import COMMAND, run as run_here
from tests.app.commands.test_planning import JOB, SIX
from tests.conftest import ROOT, without_diagnosis
from tests.plugin.packages import OUTSIDE_EFFECTS, OUTSIDE_KINDS, OUTSIDE_STANDARDS, describe, install

EXAMPLE = ROOT / "examples" / "gauge-blocks-simulated"
STATED = '\n[[conformity]]\nstandard = "QP 7.2:2026"\nlimit_um = 100.0\n'
KIND = """
from cmm_uq.artefacts.kinds import GAUGE_BLOCKS as OURS
from cmm_uq.machine.model.kind import Kind
{code}
KIND = Kind("odd", OURS.table, observe=observe, screen=OURS.screen, plan=OURS.plan, page=OURS.page)
"""
AT_ONCE = "def observe(facts, points, *, where=None):\n    raise KeyError('tower')"
DIVIDES = "def observe(facts, points, *, where=None):\n    return 1 / 0"


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that packages are looked for in; what is imported from it is forgotten afterwards."""
    place = tmp_path / "site"
    place.mkdir()
    monkeypatch.syspath_prepend(place)
    for name in ("odd", "interim_check"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    kind_named.cache_clear()
    return place


def odd_kind(site: Path, code: str) -> None:
    (site / "odd.py").write_text(KIND.format(code=code), encoding="utf-8")
    describe(site, "odd-kinds", "1.2", {"cmm_uq.kinds": {"odd": "odd:KIND"}})


def job_of(folder: Path, *, kind: str = "gauge_blocks", more: str = "") -> Path:
    shutil.copytree(EXAMPLE, folder)
    text = (folder / "job.toml").read_text(encoding="utf-8").replace('kind = "gauge_blocks"', f'kind = "{kind}"')
    (folder / "job.toml").write_text(text + more, encoding="utf-8")
    return folder


def run(site: Path, *arguments: object) -> subprocess.CompletedProcess[str]:
    """The command where a folder of packages is installed."""
    paths = os.pathsep.join([str(site), str(ROOT)])
    return subprocess.run([*COMMAND, *map(str, arguments)], capture_output=True, text=True, check=False, encoding="utf-8",
                          env={**os.environ, "PYTHONPATH": paths})  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("command", ["report", "diagnose", "plan"])
def test_a_kind_that_fails_is_named_in_one_line(site: Path, tmp_path: Path, command: str) -> None:
    odd_kind(site, AT_ONCE)
    found = run(site, command, job_of(tmp_path / "job", kind="odd"), "--quiet", "--out", tmp_path / "out")
    said = "cmm-uq: package odd-kinds 1.2: the kind 'odd' fails with KeyError: 'tower'. Mend the package, or uninstall it\n"
    assert (found.returncode, found.stderr) == (2, said)
    assert not (tmp_path / "out").exists()


def test_its_arithmetic_is_no_fault_of_the_input(site: Path, tmp_path: Path) -> None:
    odd_kind(site, DIVIDES)
    with pytest.raises(BrokenPluginError, match=r"package odd-kinds 1\.2: the kind 'odd' fails with ZeroDivisionError"):
        cmm_uq.report(job_of(tmp_path / "job", kind="odd"))


@pytest.mark.long
def test_a_standard_that_fails_is_named(site: Path, tmp_path: Path) -> None:
    install(OUTSIDE_STANDARDS, site)
    path = site / "interim_check.py"
    path.write_text(path.read_text(encoding="utf-8").replace("    items = []", "    items = [][1]"), encoding="utf-8")
    with pytest.raises(
        BrokenPluginError, match=r"package outside-standards 0\.1\.0: the standard 'QP 7\.2:2026' fails with Index"
    ):
        cmm_uq.report(job_of(tmp_path / "job", more=STATED))


def test_from_python_the_error_of_the_package_is_its_cause_with_its_traceback(site: Path, tmp_path: Path) -> None:
    odd_kind(site, AT_ONCE)
    with pytest.raises(BrokenPluginError) as told:
        cmm_uq.report(job_of(tmp_path / "job", kind="odd"))
    cause = told.value.__cause__
    assert isinstance(cause, KeyError)
    assert traceback.extract_tb(cause.__traceback__)[-1].filename == str(site / "odd.py")


def test_what_a_package_tells_the_user_is_passed_on(site: Path, tmp_path: Path) -> None:
    odd_kind(
        site,
        "from cmm_uq import CmmUqError\ndef observe(facts, points, *, where=None):\n    raise CmmUqError('no tower')",
    )
    with pytest.raises(cmm_uq.CmmUqError, match="no tower") as told:
        cmm_uq.report(job_of(tmp_path / "job", kind="odd"))
    assert not isinstance(told.value, BrokenPluginError)


def test_an_error_that_came_through_no_other_package_stays_as_it_is(site: Path) -> None:
    install(OUTSIDE_KINDS, site)
    with pytest.raises(KeyError), naming_package():
        raise KeyError("ours")
    with pytest.raises(cmm_uq.CmmUqError, match="leave the range of numbers"), refusing_overflow("here", "there"):
        np.linalg.inv(np.zeros((2, 2)))
    assert told_with_package(KeyError("never raised")) is None


TWIST = 10.0
TRUTH = f"""
seed = 5
[effects.squareness_xy]
angle_arcsec = 10.0
[effects.beam_twist]
twist_arcsec = {TWIST}
[noise]
coordinate_um = 1.0
"""
PLUGINS = {"outside-effects": "0.1.0"}


def done(found: subprocess.CompletedProcess[str]) -> None:
    assert found.returncode == 0, found.stderr


def results(folder: Path) -> Any:
    return json.loads((folder / "results.json").read_bytes())


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twenty placings that tell the twist of the beam, a recording of them, its certificate, and a diagnosis without it."""
    work = tmp_path_factory.mktemp("outside")
    site, job = work / "site", work / "job"
    for folder in (site, job):
        folder.mkdir()
    install(OUTSIDE_EFFECTS, site)
    named = f'{SIX}, "beam_twist"'
    text = JOB.format(plan='criterion = "A"\nnumber = 20', effects=named, length=400.0)
    (job / "job.toml").write_text(text, encoding="utf-8")
    (work / "truth.toml").write_text(TRUTH, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patched:
        patched.syspath_prepend(site)
        done(run_here("plan", job, "--out", work / "plan", "--no-power", "--quiet"))
        shutil.copy(work / "plan" / "plan.csv", job / "recording.csv")
        done(run_here("simulate", job, "--truth", work / "truth.toml", "--out", work / "simulated"))
        with without_diagnosis():
            done(run_here("report", work / "simulated", "--out", work / "report", "--quiet"))
    shutil.copytree(work / "simulated", work / "left-out")
    drawn = (work / "simulated" / "job.toml").read_text(encoding="utf-8")
    (work / "left-out" / "job.toml").write_text(drawn.replace(named, SIX), encoding="utf-8")
    done(run(site, "diagnose", work / "left-out", "--out", work / "diagnosis", "--quiet"))
    return work


@pytest.mark.long
def test_a_plan_determines_it(work: Path) -> None:
    data = results(work / "plan")
    (better,) = (p for p in data["better"]["determined"] if p["effect"] == "beam_twist")
    assert better["status"] == "determined"
    assert better["u"] < 1.0 < TWIST / 3
    assert "Twist of the beam" in (work / "plan" / "plan.html").read_text(encoding="utf-8")


@pytest.mark.long
def test_the_simulated_recording_says_whose_effect_acted(work: Path) -> None:
    first, *_ = (work / "simulated" / "recording.csv").read_text(encoding="utf-8").splitlines()
    assert "with outside-effects 0.1.0, seed 5" in first


def test_its_estimate_holds_the_truth(work: Path) -> None:
    found = results(work / "report")["estimates"]["beam_twist"]["twist_arcsec"]
    assert abs(found["value"] - TWIST) < 4 * found["u"]
    assert found["u"] < 1.0


def test_a_diagnosis_finds_it_where_it_is_left_out(work: Path) -> None:
    diagnosis = results(work / "diagnosis")["diagnosis"]
    assert diagnosis["verdict"] == "explained"
    (found,) = diagnosis["effects"]
    assert found["effect"] == "beam_twist"
    twist = found["parameters"]["twist_arcsec"]
    assert abs(twist["value"] - TWIST) < 4 * twist["u"]
    assert twist["u"] < 1.0
    page = (work / "diagnosis" / "diagnosis-simulated.html").read_text(encoding="utf-8")
    assert "The beam twists under the weight of the ram" in page.replace("&#39;", "'")


@pytest.mark.parametrize("folder", ["plan", "report", "diagnosis"])
def test_results_name_the_package_and_its_version(work: Path, folder: str) -> None:
    assert results(work / folder)["software"]["plugins"] == PLUGINS


@pytest.mark.parametrize(
    "page", ["plan/plan.html", "report/certificate-simulated.html", "diagnosis/diagnosis-simulated.html"]
)
def test_so_does_every_page(work: Path, page: str) -> None:
    assert "with outside-effects 0.1.0" in (work / page).read_text(encoding="utf-8")


def test_without_the_package_its_effect_is_unknown(work: Path, tmp_path: Path) -> None:
    found = run(tmp_path, "report", work / "simulated", "--out", tmp_path / "out")
    assert found.returncode == 2
    assert "unknown effect 'beam_twist'" in found.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.long
@pytest.mark.parametrize("command", ["report", "diagnose"])
def test_a_package_that_cannot_be_used_is_named_and_nothing_is_written(
    work: Path, tmp_path: Path, command: str
) -> None:
    site, out = tmp_path / "site", tmp_path / "out"
    site.mkdir()
    (site / "torn.py").write_text("import nowhere", encoding="utf-8")
    describe(site, "torn-effects", "3.0", {"cmm_uq.effects": {"torn": "torn:Torn"}})
    found = run(site, command, work / "left-out", "--out", out)
    assert found.returncode == 2
    assert "Traceback" not in found.stderr
    said = " ".join(found.stderr.split())
    assert "package torn-effects 3.0: the effect 'torn' fails with ModuleNotFoundError" in said
    assert not out.exists()
