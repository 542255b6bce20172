"""Standards of other packages: stated of every kind that offers what they ask, named with their package, refused in words."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import cmm_uq
from cmm_uq.analysis.conformity.standards import BUILT_IN, names, standard_named, statement
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.tables.conformity import ConformityFacts
from cmm_uq.machine.model.kind import FORMS, LENGTHS
from tests.analysis.conformity.recorded import STATED, gauge, sphere
from tests.conftest import ROOT
from tests.plugin.packages import OUTSIDE_STANDARDS, describe, install

NAME = "QP 7.2:2026"
JOB = f"""
[[conformity]]
standard = "{NAME}"
limit_um = 100.0
"""


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The outside package, for as long as a test lasts."""
    site = tmp_path / "site"
    site.mkdir()
    monkeypatch.syspath_prepend(install(OUTSIDE_STANDARDS, site))
    monkeypatch.delitem(sys.modules, "interim_check", raising=False)


@pytest.fixture
def bar(tmp_path: Path) -> Path:
    """A real recording of a ballbar, to be stated by the outside standard; its lengths are measured once each."""
    job = tmp_path / "job"
    job.mkdir()
    for file in (ROOT / "examples" / "iota-1102-20C").iterdir():
        text = file.read_text(encoding="utf-8")
        (job / file.name).write_text(text + JOB if file.name == "job.toml" else text, encoding="utf-8")
    return job


def test_it_is_listed_behind_the_others_and_imported_when_it_is_named(installed: None) -> None:
    assert names() == (*BUILT_IN, NAME)
    assert "interim_check" not in sys.modules
    found = standard_named(NAME)
    assert found is not None
    assert found.name == NAME


def test_it_decides_by_its_own_code_and_is_held_to_its_own_plan(installed: None) -> None:
    """Errors of 3, 0 and 0 µm of 100 mm: 1 µm on average, with u = 0.4 · 100/800 = 0.05 µm against 1.1 and 0.9 µm."""
    artefact = gauge([np.eye(3)[0]], [[100.0, 800.0]], errors={(1, 1, 100.0): 3.0})
    for limit, outcome in ((1.1, "pass"), (0.9, "fail")):
        wish = ConformityFacts(standard=NAME, mpe={"a_um": limit, "k": 1e9})
        found = statement(wish, artefact, {}, "[[conformity]] 1", [LENGTHS], None, STATED)
        assert (found.outcome, found.characteristic, found.missing) == (outcome, "mean error", ())
        assert found.named.error_um == pytest.approx(1.0, abs=1e-6)
        assert found.named.u_um == pytest.approx(0.05)
        assert len(found.errors) == 2


def test_it_is_not_stated_of_what_offers_no_lengths(installed: None) -> None:
    with pytest.raises(CmmUqError, match=r"QP 7\.2:2026 is not decided on a sphere"):
        statement(ConformityFacts(standard=NAME, limit_um=3.0), sphere(), {}, "[[conformity]] 1", [FORMS])


@pytest.mark.long
def test_a_report_states_it_and_names_the_package(installed: None, bar: Path) -> None:
    found = cmm_uq.report(bar)
    assert list(found.conformity["standard"]) == ["ASME B89.4.1-1997", NAME]
    stated = found.results["conformity"][1]
    assert (stated["characteristic"], stated["scope"]) == ("mean error", "partial")
    assert stated["missing"][0] == "40 repeats of 20 lengths"
    assert found.results["software"]["plugins"] == {"outside-standards": "0.1.0"}
    assert "outside-standards 0.1.0" in found.outcome.document.produced_by


def test_a_job_that_names_it_is_checked_by_it(installed: None, bar: Path) -> None:
    text = (bar / "job.toml").read_text(encoding="utf-8")
    (bar / "job.toml").write_text(
        text.replace("limit_um = 100.0", 'limit_um = 100.0\ncharacteristic = "E9"'), encoding="utf-8"
    )
    with pytest.raises(CmmUqError, match=r"characteristic = 'E9' of QP 7\.2:2026 is not decided here: only mean error"):
        cmm_uq.read(bar)
    (bar / "job.toml").write_text(text.replace("u_um = 5.0", ""), encoding="utf-8")
    with pytest.raises(CmmUqError, match=r"needs the uncertainty of what QP 7\.2:2026 compares with.*no u_um above 0"):
        cmm_uq.read(bar)


def test_without_the_package_it_is_unknown(bar: Path) -> None:
    with pytest.raises(
        CmmUqError, match=r"\[\[conformity\]\] 2 standard: no such standard is decided\. Known: ASME B89"
    ):
        cmm_uq.read(bar)
    with pytest.raises(CmmUqError, match=r"no standard 'QP 7\.2:2026' is decided"):
        statement(ConformityFacts(standard=NAME, limit_um=3.0), sphere(), {}, "[[conformity]] 1", [FORMS])


@pytest.mark.parametrize(
    ("where", "told"), [("nowhere:STANDARD", "fails with ModuleNotFoundError"), ("math:pi", "is no Standard but float")]
)
def test_a_broken_package_is_named(where: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    describe(tmp_path / "site", "odd-standards", "1.0", {"cmm_uq.standards": {"odd": where}})
    monkeypatch.syspath_prepend(tmp_path / "site")
    with pytest.raises(CmmUqError, match=rf"package odd-standards 1\.0: the standard 'odd' {told}"):
        standard_named("odd")


def test_no_other_package_replaces_a_built_in_standard(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    describe(tmp_path / "site", "taker", "1.0", {"cmm_uq.standards": {"VDI/VDE 2617": "math:pi"}})
    monkeypatch.syspath_prepend(tmp_path / "site")
    assert standard_named("VDI/VDE 2617") is BUILT_IN["VDI/VDE 2617"]
    assert names() == tuple(BUILT_IN)
