"""Runs read in motion: a known curve sampled anywhere gives the figures of the run at rest; what is not known is refused."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.analysis.conformity import own_rule
from cmm_uq.analysis.conformity.positioning import uncertainty_of_figures
from cmm_uq.analysis.conformity.standards import statement
from cmm_uq.app.commands.report import write_report
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.axis_runs.artefact import AxisRuns
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.jobs.tables.conformity import Circumstances, ConformityFacts, TestUncertainty
from cmm_uq.jobs.tables.plan import CompleteTest
from cmm_uq.machine.model.kind import POSITIONING
from cmm_uq.maths.geometry.positioning import MissingReadingError, PositioningRuns
from tests.artefacts.test_axis_runs import joined, run
from tests.conftest import ROOT
from tests.maths.geometry.test_positioning import by_loops

TARGETS = np.linspace(50.0, 850.0, 9)
LONG, SHORT = 700.0, 150.0  # mm, of two waves


def deviation(at: Floats, way: float) -> Floats:
    """µm: a bow, two waves, a play of 3 µm."""
    waves = 4 * np.sin(2 * np.pi * at / LONG) + np.cos(2 * np.pi * at / SHORT)
    return np.asarray(8e-6 * (at - 400) ** 2 + waves + 1.5 * way)


def sampled(step: float, repeats: int = 3, seed: int = 4) -> tuple[Floats, ...]:
    """Positions anywhere, about ``step`` mm apart, others in each direction and repeat; directions, repeats, readings."""
    random, rows = np.random.default_rng(seed), []
    for repeat in range(1, repeats + 1):
        for way in (1.0, -1.0):
            at = np.arange(10.0, 890.0, step)
            at = at + random.uniform(0, 0.4 * step, len(at))
            rows += [(x, way, repeat, y + 0.1 * repeat) for x, y in zip(at, deviation(at, way), strict=True)]
    position, way, repeat, read = np.array(rows).T
    return position, way, repeat.astype(np.int64), read


def at_rest() -> PositioningRuns:
    way, repeat, target = (each.ravel() for each in np.meshgrid([1.0, -1.0], [1, 2, 3], TARGETS, indexing="ij"))
    read = np.where(way > 0, deviation(target, 1), deviation(target, -1)) + 0.1 * repeat
    return PositioningRuns.of(target, way, repeat.astype(np.int64), read)


@pytest.mark.parametrize("step", [7.0, 4.0, 2.0])
def test_a_known_curve_gives_the_figures_of_its_targets_as_far_as_a_line_follows_it(step: float) -> None:
    """Between two readings h apart a line is off a curve by h²/8 of its second derivative at most."""
    curved = 2 * 8e-6 + 4 * (2 * np.pi / LONG) ** 2 + (2 * np.pi / SHORT) ** 2
    found, rest = PositioningRuns.interpolated(TARGETS, *sampled(step)), at_rest()
    most = (1.4 * step) ** 2 / 8 * curved
    off = np.abs(found.x - rest.x)
    assert 0.05 * most < off.max() < most
    for name, value in rest.figures().items():
        assert found.figures()[name] == pytest.approx(value, abs=6 * most), name
    assert found.motion is not None
    # what is off is what the cubic says that it is: the rest is of the fourth order
    left = found.x - found.motion.curvature - rest.x
    assert np.abs(left).max() < 0.25 * off.max()
    assert found.motion.widest_gap <= 1.4 * step


def test_of_a_straight_curve_nothing_is_left_out_and_noise_is_that_of_two_readings() -> None:
    position, way, repeat, _ = sampled(7.0)
    found = PositioningRuns.interpolated(TARGETS, position, way, repeat, 0.01 * position + way)
    np.testing.assert_allclose(found.x, 0.01 * TARGETS[:, None] + np.array([[[1.0] * 3], [[-1.0] * 3]]))
    assert found.motion is not None
    np.testing.assert_allclose(found.motion.curvature, 0.0, atol=1e-8)
    noise = np.random.default_rng(3).normal(0, 1, (400, len(position)))
    drawn = np.array([PositioningRuns.interpolated(TARGETS, position, way, repeat, each).x for each in noise])
    np.testing.assert_allclose(drawn.std(axis=0), found.motion.share, rtol=0.15)
    assert 0.7 < found.motion.share.min() < 0.8 < found.motion.share.max() <= 1.0


def test_a_reading_at_a_target_is_taken_as_it_is() -> None:
    rest = at_rest()
    d, t, n = (each.ravel() for each in np.indices(rest.x.shape))
    found = PositioningRuns.interpolated(TARGETS, TARGETS[t], np.array([1.0, -1.0])[d], n + 1, rest.x.ravel())
    np.testing.assert_array_equal(found.x, rest.x)
    assert found.motion is not None
    assert (found.motion.widest_gap, float(np.ptp(found.motion.share))) == (0.0, 0.0)


def test_a_target_in_a_gap_or_outside_the_readings_is_refused() -> None:
    position, way, repeat, read = sampled(7.0)
    own = (way < 0) & (repeat == 2) & (np.abs(position - 450) < 8)
    rest = [each[~own] for each in (position, way, repeat, read)]
    with pytest.raises(
        MissingReadingError, match=r"target 450 mm lies between readings .* apart, more than 10 mm, in .*-1 of"
    ):
        PositioningRuns.interpolated(TARGETS, *rest)
    with pytest.raises(MissingReadingError, match=r"target 5 mm lies outside the readings in direction"):
        PositioningRuns.interpolated(np.array([5.0, 450.0]), position, way, repeat, read)
    some = ~((way < 0) & (repeat == 2))
    with pytest.raises(MissingReadingError, match="target 50 mm has 0 readings"):
        PositioningRuns.interpolated(TARGETS, position[some], way[some], repeat[some], read[some])


def made(u_delay_um: float | None = 0.0, **stated: float) -> tuple[AxisRuns, Circumstances]:
    """A run of X as an artefact, 2 mm apart; the zero of each run is no matter."""
    at = np.arange(10.0, 890.0, 2.0)
    rows = run(1, np.eye(3)[0], at=at, repeats=2)
    way = rows["approach_x"]
    rows["reading_um"] = deviation(rows["xyz"][:, 0], 1) - 1.5 + 1.5 * way
    motion = {"x": TARGETS.tolist()} | ({} if u_delay_um is None else {"u_delay_um": u_delay_um})
    facts = artefact_facts(kind="axis_runs", u_scale_um_per_m=0.1, on_the_fly=motion)
    return AxisRuns(facts, joined(rows)), Circumstances(uncertainty=TestUncertainty(**stated))


def test_a_delay_makes_play_uncertain_by_twice_what_it_makes_of_a_reading() -> None:
    artefact, under = made(0.25)
    (found,) = artefact.positionings().values()
    assert found.figures()["B"] == pytest.approx(3.0, abs=1e-6)
    by_delay, without = (uncertainty_of_figures(each, under) for each in (found, *made(0.0)[0].positionings().values()))
    assert by_delay["B"] == pytest.approx(0.5, rel=0.05)
    assert by_delay["M"] == pytest.approx(without["M"], rel=0.1)
    assert without["B"] < 1e-6  # the scale, and what a line leaves out, are the same in both directions


def decided(artefact: AxisRuns, under: Circumstances, standard: str, characteristic: str) -> str:
    wish = ConformityFacts(
        standard=standard, characteristic=characteristic, limit_um=1e3, rule="ISO 14253-1"
    ).model_copy(update={"complete": CompleteTest(measurements=1, repeats=2, points=1)})
    return statement(wish, artefact, {}, "[[conformity]] 1", (POSITIONING,), None, under).finding


def test_iso_230_2_is_not_decided_of_it_and_the_laboratorys_own_rule_is() -> None:
    artefact, under = made(0.1)
    with pytest.raises(
        CmmUqError, match=r"ISO 230-2:2014 asks for an axis at rest.*measurement 1 was in motion.*own rule"
    ):
        decided(artefact, under, "ISO 230-2:2014", "A")
    assert decided(artefact, under, own_rule.NAME, "A") == "pass"
    with pytest.raises(CmmUqError, match=r"decided with u_delay_um, which the job does not state.*0 where one trigger"):
        decided(made(None)[0], under, own_rule.NAME, "B")


@pytest.mark.parametrize(("motion", "message"), [
    ({"x": [1.0]}, r"on_the_fly.x"),
    ({"x": [2.0, 1.0]}, r"x: targets must grow"),
    ({"u_delay_um": 0.1}, r"x, y or z must have targets"),
    ({"w": [1.0, 2.0]}, r"on_the_fly.w"),
])  # fmt: skip
def test_what_cannot_be_meant_is_refused(motion: dict[str, object], message: str) -> None:
    with pytest.raises(Exception, match=message):
        artefact_facts(kind="axis_runs", on_the_fly=motion)


def test_a_straightedge_turned_over_needs_the_same_positions() -> None:
    random, rows = np.random.default_rng(1), []
    for number, sign in ((1, 1.0), (2, -1.0)):
        rows.append(run(number, np.eye(3)[1], at=np.sort(random.uniform(0.0, 800.0, 50)), repeats=2))
        rows[-1]["straightedge"] = np.full(len(rows[-1]["xyz"]), sign)
    with pytest.raises(CmmUqError, match="measurement 1 and the straightedge turned over share no position"):
        AxisRuns(artefact_facts(kind="axis_runs"), joined(*rows))


def job_in_motion(folder: Path, *, targets: str = "[50.0, 250.0, 450.0, 650.0, 850.0]", own: bool = True) -> Path:
    """The first run of the example, as if read without a stop: every 15 mm along X, from its readings by a line."""
    source = ROOT / "examples" / "axis-runs-simulated"
    rows = [
        r
        for r in csv.DictReader((source / "recording.csv").read_text(encoding="utf-8").splitlines())
        if r["measurement"] == "1"
    ]
    random = np.random.default_rng(8)
    folder.mkdir()
    with (folder / "recording.csv").open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, rows[0])
        table.writeheader()
        for repeat in ("1", "2"):
            point = 0
            for way in (1, -1):
                some = sorted((float(r["x_mm"]), float(r["reading_um"])) for r in rows
                              if r["repeat"] == repeat and float(r["approach_x"]) * way > 0)  # fmt: skip
                for x in np.arange(45.0, 865.0, 15.0)[::way] + random.uniform(0, 1.0):
                    point += 1
                    y = np.interp(x, *zip(*some, strict=True)) + random.normal(0, 0.1)
                    table.writerow({**rows[0], "point": point, "repeat": repeat, "x_mm": f"{x:.4f}", "approach_x": way,
                                    "reading_um": f"{y:.3f}"})  # fmt: skip
    toml = (source / "job.toml").read_text(encoding="utf-8")
    toml = re.sub(r"effects = \[.*?\]", 'effects = ["scale_x", "hysteresis_x"]', toml)
    toml = toml.replace("[recording]", f"[artefact.on_the_fly]\nx = {targets}\nu_delay_um = 0.05\n\n[recording]")
    if own:
        toml = toml.replace("ISO 230-2:2014", own_rule.NAME).replace(
            "limit_um", "complete = { measurements = 1, repeats = 2, points = 100 }\nlimit_um"
        )
    (folder / "job.toml").write_text(toml, encoding="utf-8")
    return folder


@pytest.mark.long
def test_the_certificate_says_that_it_was_read_in_motion(tmp_path: Path) -> None:
    written = write_report(job_in_motion(tmp_path / "job"), tmp_path / "out")
    (found,) = json.loads(written.results)["runs"]
    rows = list(csv.DictReader((tmp_path / "job" / "recording.csv").read_text(encoding="utf-8").splitlines()))
    x = np.full((2, 5, 2), np.nan)
    for side, repeat in np.ndindex(2, 2):
        own = sorted((float(r["x_mm"]), float(r["reading_um"])) for r in rows
                     if r["repeat"] == str(repeat + 1) and (float(r["approach_x"]) < 0) == bool(side))  # fmt: skip
        x[side, :, repeat] = np.interp(found["targets_mm"], *zip(*own, strict=True))
    assert found["figures"] == pytest.approx(by_loops(x), rel=1e-6)
    assert found["in_motion"]["widest_gap_mm"] == pytest.approx(15.0, abs=1e-3)
    page = (tmp_path / "out" / "certificate-simulated.html").read_text("utf-8")
    assert "Readings in motion, interpolated at targets" in page
    assert "this is no test by ISO 230-2" in page
    with pytest.raises(CmmUqError, match=r"on_the_fly\] x: target 900 mm lies outside the readings of measurement 1"):
        write_report(job_in_motion(tmp_path / "wide", targets="[50.0, 450.0, 900.0]"), tmp_path / "out2")
    with pytest.raises(CmmUqError, match="in motion"):
        write_report(job_in_motion(tmp_path / "standard", own=False), tmp_path / "out3")
