"""Every kind of measurement does in every command what it offers, and is refused in words what it does not.

One test carries them all, a kind from another package too: planned, simulated, screened, reported, diagnosed.
"""

from __future__ import annotations

import json
import pickle
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmm_uq.analysis.planning.setting import Planning
from cmm_uq.analysis.screening.screening import ScreenedRecording, screen_recording
from cmm_uq.analysis.screening.shape import Screening
from cmm_uq.app.commands.diagnose import write_diagnosis
from cmm_uq.app.commands.jobs.simulate import write_simulation
from cmm_uq.app.commands.plan import write_plan
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import REPORT, write_report
from cmm_uq.artefacts import BUILT_IN, kind_named, names
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Points
from cmm_uq.certificate.origin import file_name
from cmm_uq.certificate.result import OwnAnalysis, Page
from cmm_uq.jobs.dcc import read as read_dcc
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.kind import Kind
from tests.conftest import ROOT
from tests.plugin.packages import OUTSIDE_KINDS, describe, install
from tests.recordings import screened

EXAMPLE = {
    "ballbar": "iota-1102-20C", "error_map": "iota-1102-maps", "bryan": "bryan-simulated", "shift": "shift-simulated",
    "step_gauge": "step-gauge-simulated", "gauge_blocks": "gauge-blocks-simulated", "plate": "plate-simulated",
    "triangle": "triangle-simulated", "sphere": "sphere-simulated", "plane": "plane-simulated",
    "digitizer": "digitizer-simulated", "axis_runs": "axis-runs-simulated", "multilateration": "multilateration-simulated",
    "scanned_planes": "scanned-planes-simulated", "tracked_points": "robot-simulated",
    "table_spheres": "table-spheres-simulated", "seat": "arm-seat-simulated", "ring": "ring-simulated",
}  # fmt: skip
OUTSIDE = "tracker_length"
PLUGINS = {OUTSIDE: {"outside-kinds": "0.1.0"}}
TRUTH = "seed = 7\n[noise]\ncoordinate_um = 0.5\n"
TRACKER_JOB = """
[job]
id = "tracker"
date = 2026-02-03

[machine]
name = "Bridge machine"
travel_mm = { x = [0, 900], y = [0, 800], z = [-600, 0] }

[artefact]
kind = "tracker_length"
u_um = 0.2
u_um_per_m = 0.3

[recording]
file = "plan.csv"

[model]
effects = ["scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx"]

[plan]
length_mm = 350.0
repeats = 2
"""


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The outside package, for as long as a test lasts."""
    site = tmp_path / "site"
    site.mkdir()
    monkeypatch.syspath_prepend(install(OUTSIDE_KINDS, site))
    kind_named.cache_clear()
    yield
    kind_named.cache_clear()
    sys.modules.pop("tracker_length", None)


@pytest.fixture
def tracker(installed: None, tmp_path: Path) -> Path:
    """A job of the outside kind: planned, with the plan as its recording."""
    folder = tmp_path / "tracker"
    folder.mkdir()
    (folder / "job.toml").write_text(TRACKER_JOB, encoding="utf-8")
    written = write_plan(folder, tmp_path / "first plan", power=False)
    (folder / "plan.csv").write_bytes(written.files["plan.csv"].read_bytes())
    return folder


def refused(kind: Kind, what: str, run: Callable[[], object], out: Path) -> None:
    """In the kind's words, and nothing is written."""
    with pytest.raises(CmmUqError) as told:
        run()
    assert str(told.value).startswith(f"job.toml [artefact] kind: {kind.refused(what).problem}")
    assert not out.exists()


@pytest.mark.long(but="ballbar")
@pytest.mark.parametrize("name", [*BUILT_IN, OUTSIDE])
def test_a_kind_does_what_it_offers_and_is_refused_the_rest_in_words(
    name: str, installed: None, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    kind, truth = kind_named(name), tmp_path / "truth.toml"
    assert kind is not None
    job = request.getfixturevalue("tracker") if name == OUTSIDE else ROOT / "examples" / EXAMPLE[name]
    own, observed = kind.offers("own", OwnAnalysis) or OwnAnalysis(), kind.observe is not None

    truth.write_text(TRUTH, encoding="utf-8")
    drawn = tmp_path / "drawn"
    if observed:
        write_simulation(job, truth, drawn)
        job = drawn
    else:
        refused(kind, "simulated", lambda: write_simulation(job, truth, drawn), drawn)

    out = tmp_path / "plan"
    if kind.offers("plan", Planning):
        plan = write_plan(job, out, power=False)
        assert json.loads(plan.results)["schema"] == "cmm-uq/plan/1"
        assert json.loads(plan.results)["software"].get("plugins", {}) == PLUGINS.get(name, {})
    else:
        refused(kind, "planned", lambda: write_plan(job, out, power=False), out)

    if kind.offers("screen", Screening):
        read = read_job(job)
        xyz = read.points.xyz.copy()
        xyz[-1] += 25.0
        found = screened(read.points.at(xyz), read.facts.artefact, needed=set(), set_aside=[], where="recording.csv")
        assert any(read.points.measurement[-1] in finding.measurements for finding in found.findings)

    out = tmp_path / "report"
    if own.report or (observed and kind.offers("page", Page)):
        report = write_report(job, out)
        results = json.loads(report.results)
        assert results["schema"] == "cmm-uq/results/1"
        page, digital, pdf = (file_name(document, read_job(job).origin) for document in REPORT.documents)
        whole = read_dcc((out / digital).read_bytes(), digital)
        assert whole.document is not None
        assert whole.document.data == (out / page).read_bytes()
        assert {page, digital, pdf, "results.json"} <= set(report.files)
        assert report.summary.rows[0][0] == "Measured"
        assert results["software"].get("plugins", {}) == PLUGINS.get(name, {})
        assert ("with outside-kinds 0.1.0" in report.files[page].read_text(encoding="utf-8")) == (name == OUTSIDE)
        if name == OUTSIDE:
            assert results["tracker"] == {"distances": 26}
            assert "Distances by laser tracker" in report.files[page].read_text(encoding="utf-8")
    else:
        refused(kind, "reported", lambda: write_report(job, out), out)

    out = tmp_path / "diagnosis"
    if own.diagnose or observed:
        diagnosis = json.loads(write_diagnosis(job, out).results)
        verdict = diagnosis["diagnosis"]["verdict"]
        assert diagnosis["software"].get("plugins", {}) == PLUGINS.get(name, {})
        assert verdict in ("consistent", "explained", "partial", "unexplained")
        assert verdict == "consistent" or not observed  # nothing but white noise was drawn
    else:
        refused(kind, "diagnosed as a recording of an artefact", lambda: write_diagnosis(job, out), out)


def spoilt(name: str, how: str, to: Path) -> Path:
    """An example with coordinates in inches, or all in one place, where it has some; a plane without its direction points."""
    shutil.copytree(ROOT / "examples" / EXAMPLE[name], to)
    (file,) = to.glob("*.csv")
    comments = [line for line in file.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    head, *rows = (line.split(",") for line in comments)
    columns = [head.index(f"{axis}_mm") for axis in "xyz"]
    for row in rows:
        for i in columns:
            row[i] = repr(float(row[i]) / 25.4) if how == "in inches" else rows[0][i]
    if how == "without direction points":
        file.write_text("\n".join(line for line in comments if line.split(",")[1] != "0"), encoding="utf-8")
    else:
        file.write_text("\n".join(map(",".join, [head, *rows])), encoding="utf-8")
    return to


SPOILT = [
    *((name, "in one place") for name in EXAMPLE if name not in ("error_map", "tracked_points")),
    *((name, "in inches") for name in ("ballbar", "step_gauge", "gauge_blocks", "plate", "triangle", "sphere", "ring")),
    ("digitizer", "in inches"),
    ("plane", "without direction points"),
]  # fmt: skip


@pytest.fixture
def screened_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """What each command screens is looked at once, as long as it is the very same."""
    looked: dict[bytes, CmmUqError | ScreenedRecording] = {}

    def screen(points: Points, facts: ArtefactFacts, *given: Any, needed: set[str], **how: Any) -> ScreenedRecording:
        columns = {
            "xyz": points.xyz,
            "set-up": points.measurement,
            "point": points.point,
            "repeat": points.repeat,
            **points.columns,
        }
        held = {column: values.tobytes() for column, values in columns.items()}
        key = pickle.dumps((held, facts.model_dump_json(), sorted(needed), how))
        if key not in looked:
            try:
                looked[key] = screen_recording(points, facts, *given, needed=needed, **how)
            except CmmUqError as error:
                looked[key] = error
        found = looked[key]
        if isinstance(found, CmmUqError):
            raise found
        return found

    monkeypatch.setattr("cmm_uq.app.commands.model.screen_recording", screen)


@pytest.mark.usefixtures("screened_once")
@pytest.mark.parametrize(("name", "how"), SPOILT)
def test_what_report_refuses_of_a_recording_every_command_refuses_alike(name: str, how: str, tmp_path: Path) -> None:
    job, truth = spoilt(name, how, tmp_path / "job"), tmp_path / "truth.toml"
    truth.write_text(TRUTH, encoding="utf-8")
    with pytest.raises(CmmUqError) as told:
        write_report(job, tmp_path / "report")
    kind = kind_named(name)
    assert kind is not None
    commands: list[Callable[[], object]] = [lambda: write_plan(job, tmp_path / "plan", power=False)]
    commands = commands if kind.plan is not None else []
    if kind.observe is not None:
        commands += [lambda: write_diagnosis(job, tmp_path / "diagnosis")]
        commands += [lambda: write_simulation(job, truth, tmp_path / "drawn")]
    for command in commands:
        with pytest.raises(CmmUqError) as also:
            command()
        assert str(also.value) == str(told.value)
    assert {path.name for path in tmp_path.iterdir()} == {"job", "truth.toml"}


@pytest.mark.parametrize("name", BUILT_IN)
def test_what_a_built_in_kind_names_is_there_and_of_the_class_that_its_room_asks_for(name: str) -> None:
    kind = kind_named(name)
    assert kind is not None
    assert kind.name == name
    assert issubclass(kind.table, ArtefactFacts)
    for facet, of in (("screen", Screening), ("plan", Planning), ("page", Page), ("own", OwnAnalysis)):
        found = kind.offers(facet, of)
        assert (found is None) == (getattr(kind, facet) is None)
    if kind.observe is not None:
        made = kind.observing("observed")
        job = read_job(ROOT / "examples" / EXAMPLE[name])
        example = made(job.facts.artefact, job.points, where=job.recording_path)
        assert isinstance(example, Artefact)
        assert example.kind == name


def test_an_outside_kind_needs_one_file_of_at_most_150_lines() -> None:
    (file,) = OUTSIDE_KINDS.glob("*.py")
    assert len(file.read_text(encoding="utf-8").splitlines()) <= 150


def test_an_outside_kind_is_listed_after_the_built_in_ones(installed: None) -> None:
    assert names() == (*BUILT_IN, OUTSIDE)


@pytest.mark.long
def test_its_own_keys_are_checked_as_those_of_a_built_in_kind(tracker: Path) -> None:
    (tracker / "job.toml").write_text(TRACKER_JOB.replace("u_um_per_m", "u_um_per_mm"), encoding="utf-8")
    with pytest.raises(CmmUqError, match=r"job\.toml line \d+: \[artefact\] u_um_per_mm: unknown key.*u_um_per_m"):
        read_job(tracker)


def test_its_uncertainty_grows_with_the_distance(tracker: Path) -> None:
    """By hand: √(0.2² + (0.3 µm/m · 0.35 m)²) = 0.2259 µm."""
    read, kind = read_job(tracker), kind_named(OUTSIDE)
    assert kind is not None
    (size,) = kind.observing("observed")(read.facts.artefact, read.points).sizes
    assert size.sd == pytest.approx(0.22589e-3, rel=1e-4)
    assert np.isclose(size.nominal, 350.0)


def test_a_kind_that_nobody_offers_is_refused_with_those_that_there_are(tracker: Path) -> None:
    (tracker / "job.toml").write_text(TRACKER_JOB.replace("tracker_length", "tracker"), encoding="utf-8")
    with pytest.raises(CmmUqError, match=r"line 11: \[artefact\] kind: input should be 'ballbar', .* 'tracker_length'"):
        read_job(tracker)


@pytest.mark.parametrize(
    ("where", "told"), [("nowhere:KIND", "fails with ModuleNotFoundError"), ("math:pi", "is no Kind but float")]
)
def test_a_broken_package_is_named(where: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    describe(tmp_path / "site", "odd-kinds", "1.0", {"cmm_uq.kinds": {"odd": where}})
    monkeypatch.syspath_prepend(tmp_path / "site")
    with pytest.raises(CmmUqError, match=rf"package odd-kinds 1\.0.*{told}"):
        kind_named("odd")


def test_two_packages_cannot_offer_one_kind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("one", "other"):
        describe(tmp_path / "site", name, "1.0", {"cmm_uq.kinds": {"twice": "math:pi"}})
    monkeypatch.syspath_prepend(tmp_path / "site")
    with pytest.raises(CmmUqError, match=r"'twice' comes from (one|other) 1\.0 and (one|other) 1\.0"):
        kind_named("twice")


def test_no_other_package_replaces_a_built_in_kind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = kind_named("ballbar")
    describe(tmp_path / "site", "taker", "1.0", {"cmm_uq.kinds": {"ballbar": "math:pi"}})
    monkeypatch.syspath_prepend(tmp_path / "site")
    kind_named.cache_clear()
    assert kind_named("ballbar") is before
    assert names() == tuple(BUILT_IN)


def test_a_facet_of_another_class_is_the_package_s_mistake() -> None:
    odd = Kind("odd", screen="math:pi", plan="nowhere:PLANNING")
    with pytest.raises(CmmUqError, match="screen of the kind 'odd' is no Screening"):
        odd.offers("screen", Screening)
    with pytest.raises(CmmUqError, match="names 'nowhere:PLANNING', which cannot be loaded"):
        odd.offers("plan", Planning)


def test_a_kind_adds_results_and_replaces_none() -> None:
    page = Page(lambda result: [], lambda result: {"tracker": 1})
    assert page.with_further(None, {"estimates": 2}) == {"estimates": 2, "tracker": 1}
    with pytest.raises(CmmUqError, match="cannot be named 'tracker'"):
        page.with_further(None, {"tracker": 2})
