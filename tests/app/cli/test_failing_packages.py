"""Code of other packages that fails at work: one line with the package, its version and what of it failed, and exit code 2."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import traceback
from pathlib import Path

import numpy as np
import pytest

import cmm_uq
from cmm_uq.artefacts import kind_named
from cmm_uq.base.overflow import refusing_overflow
from cmm_uq.base.plugins import BrokenPluginError, naming_package, told_with_package
from tests.app.cli.process import COMMAND
from tests.conftest import ROOT
from tests.plugin.packages import OUTSIDE_KINDS, OUTSIDE_STANDARDS, describe, install

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


def run(site: Path, command: str, job: Path, out: Path) -> subprocess.CompletedProcess[str]:
    paths = os.pathsep.join([str(site), str(ROOT)])
    return subprocess.run([*COMMAND, command, job, "--quiet", "--out", out], capture_output=True, text=True, check=False,
                          encoding="utf-8", env={**os.environ, "PYTHONPATH": paths})  # fmt: skip


@pytest.mark.parametrize("command", ["report", "diagnose", "plan"])
def test_a_kind_that_fails_is_named_in_one_line(site: Path, tmp_path: Path, command: str) -> None:
    odd_kind(site, AT_ONCE)
    found = run(site, command, job_of(tmp_path / "job", kind="odd"), tmp_path / "out")
    said = "cmm-uq: package odd-kinds 1.2: the kind 'odd' fails with KeyError: 'tower'. Mend the package, or uninstall it\n"
    assert (found.returncode, found.stderr) == (2, said)
    assert not (tmp_path / "out").exists()


def test_its_arithmetic_is_no_fault_of_the_input(site: Path, tmp_path: Path) -> None:
    odd_kind(site, DIVIDES)
    with pytest.raises(BrokenPluginError, match=r"package odd-kinds 1\.2: the kind 'odd' fails with ZeroDivisionError"):
        cmm_uq.report(job_of(tmp_path / "job", kind="odd"))


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
