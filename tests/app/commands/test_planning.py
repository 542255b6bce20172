"""A job is planned: what it asks for is what it gets, a better plan is better, and how both are said and decided."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.analysis.planning.candidates import ready_plan
from cmm_uq.app.commands.jobs.check import check_job
from cmm_uq.app.commands.jobs.simulate import simulate
from cmm_uq.app.commands.plan import plan_results
from cmm_uq.app.commands.plan_page import combination, plan_document
from cmm_uq.app.commands.planning import RECORDED, SPREAD, MeasurementPlan, make_plan
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import evaluate_job as analyse_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Message
from cmm_uq.base.points import Points
from cmm_uq.certificate.origin import as_json
from cmm_uq.certificate.plots.volume import gain_plot, placing_pictures
from cmm_uq.certificate.render import render_html
from cmm_uq.jobs.derived_job import Truth
from cmm_uq.machine.model.measurement import ARTEFACT
from tests.analysis.conformity.recorded import SEVEN, gauge
from tests.analysis.planning.plans import EVERY_KIND, setting
from tests.conftest import ROOT

JOB = """
[job]
id = "to-be-measured"
date = 2026-01-01
[machine]
name = "Bridge machine"
travel_mm = {{ x = [0, 900], y = [0, 800], z = [-600, 0] }}
[artefact]
kind = "ballbar"
length_mm = {length}
u_um = 0.5
[recording]
file = "recording.csv"
u_coordinate_um = 1.0
[model]
effects = [{effects}]
[plan]
{plan}
"""
SIX = '"scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx"'


def planned(
    folder: Path, plan: str = "", effects: str = SIX, length: float = 400.0, **options: bool
) -> MeasurementPlan:
    (folder / "job.toml").write_text(JOB.format(plan=plan, effects=effects, length=length), encoding="utf-8")
    return make_plan(read_job(folder, recorded=False), power=options.get("power", False))


def test_without_wishes_the_plan_is_the_standard_one(tmp_path: Path) -> None:
    plan = planned(tmp_path)
    assert plan.name == "ASME B89.4.1"
    assert len(plan.to_measure) == 20
    assert plan.better is None
    assert all(condition.met for condition in plan.conditions)


@pytest.mark.long
def test_as_many_placings_by_a_criterion_are_at_least_as_good(tmp_path: Path) -> None:
    for criterion in ("D", "A", "worst", "separation"):
        plan = planned(tmp_path, f'criterion = "{criterion}"\ncandidates = 120')
        assert plan.scores is not None
        assert plan.scores[1] < plan.scores[0], criterion
        assert len(plan.to_measure) == 20
        assert plan.kept == 0


@pytest.mark.long
def test_placings_more_keep_the_standard_ones_and_part_what_these_leave_alike(tmp_path: Path) -> None:
    plan = planned(tmp_path, 'criterion = "separation"\nmore = 3')
    assert plan.kept == 20
    assert len(plan.to_measure) == 23
    before, after = plan.start.identifiability, plan.outlook.identifiability
    assert before is not None
    assert after is not None
    assert len(after.unseen) < len(before.unseen)
    assert len(after.alike) <= len(before.alike)


def test_a_recording_is_judged_and_only_what_is_missing_is_planned() -> None:
    plan = make_plan(read_job(ROOT / "examples" / "iota-1102-20C", recorded=False), power=False)
    assert plan.name == RECORDED
    assert plan.measured == 20
    (placing,) = plan.to_measure  # one position is a copy of another, so the twentieth is still to be measured
    assert placing.title == "along +X +Y"
    assert all(condition.met for condition in plan.conditions)
    # the noise that the residuals of the recording show, in Harris 2004 12.7 µm of a length, √2 of a coordinate
    assert plan.setting.sigma == pytest.approx(12.7e-3 / np.sqrt(2), rel=0.02)


def test_what_a_recording_determined_is_what_its_report_says() -> None:
    job = read_job(ROOT / "examples" / "iota-1102-20C")
    plan = make_plan(read_job(ROOT / "examples" / "iota-1102-20C", recorded=False), power=False)
    estimate = plan.setting.model(job.points).estimate().least_squares
    assert plan.start.identifiability is not None
    expected = [p.u for p in plan.start.identifiability.parameters]
    # the design is taken at zero errors and not at the estimated ones, half a milliradian off
    np.testing.assert_allclose(expected, np.sqrt(np.diag(estimate.covariance))[: len(expected)], rtol=2e-3)


def test_measurements_set_aside_determine_nothing(job: Path) -> None:
    text = (job / "job.toml").read_text("utf-8").replace("[recording]\n", "[recording]\nset_aside = [20]\n")
    (job / "job.toml").write_text(text, encoding="utf-8")
    plan = make_plan(read_job(job, recorded=False), power=False)
    assert plan.measured == 19
    assert 20 not in plan.start.points.measurement
    assert plan.first == 21


def test_further_placings_of_a_recording_are_of_the_artefact_that_was_recorded(tmp_path: Path) -> None:
    folder = Path(shutil.copytree(ROOT / "examples" / "step-gauge-simulated", tmp_path / "job"))
    with (folder / "job.toml").open("a", encoding="utf-8") as file:
        file.write('\n[plan]\ncriterion = "D"\nmore = 1\ncandidates = 60\n')
    plan = make_plan(read_job(folder, recorded=False), power=False)
    (placing,) = plan.to_measure
    first = plan.start.placings[0].points
    np.testing.assert_array_equal(
        np.unique(placing.points.columns["reference_mm"]), np.unique(first.columns["reference_mm"])
    )
    assert set(first.columns) <= set(plan.outlook.points.columns)
    assert plan.measured == 7


@pytest.mark.long
def test_a_budget_of_time_bounds_the_placings_that_are_searched_for(tmp_path: Path) -> None:
    plan = planned(tmp_path, 'criterion = "D"\nbudget_min = 62\nminutes_per_placing = 5\nrepeats = 3')
    assert len(plan.to_measure) == 10  # six minutes each
    assert sum(plan.minutes) <= 62


def test_a_standard_plan_beyond_the_budget_says_so(tmp_path: Path) -> None:
    plan = planned(tmp_path, "budget_min = 60")
    assert [c.what for c in plan.conditions if not c.met] == ["at most 60 min: 120 min"]


def test_shift_series_say_what_they_cannot_show() -> None:
    plan = make_plan(read_job(ROOT / "examples" / "shift-simulated", recorded=False))
    # the greatest common measure of shifts of 20 and 50 mm
    assert "every 10 mm" in plan.free[0]


@pytest.mark.long
def test_power_comes_for_every_effect_that_the_job_does_not_name(tmp_path: Path) -> None:
    plan = planned(tmp_path, 'rivals = ["rotation_x_z", "artefact_sag"]\nrepeats = 1', power=True)
    found = {power.effect: power for power in plan.start.powers}
    assert found["rotation_x_z"].detectable is not None
    assert found["artefact_sag"].detectable is None  # one with the scales of X and Y


def test_the_noise_of_a_plan_is_stated_or_that_of_an_earlier_recording_or_averaged(tmp_path: Path) -> None:
    noise = planned(tmp_path).setting.noise
    assert noise is not None
    assert (noise.placing, noise.growth) == (None, None)
    noise = planned(tmp_path, "placing_um = 0.5\ngrowth_um = 0.0").setting.noise
    assert noise is not None
    assert (noise.placing, noise.growth) == (pytest.approx(0.5e-3), 0.0)
    (tmp_path / "earlier").mkdir()
    earlier = {"coordinate_um": {"value": 2.0, "u": 0.1}, "placing_um": {"value": 0.3, "u": 0.4}}
    content = json.dumps({"schema": "cmm-uq/results/1", "noise": earlier})
    (tmp_path / "earlier" / "results.json").write_text(content, encoding="utf-8")
    plan = planned(tmp_path, 'noise_from = "earlier"')
    assert plan.setting.noise is not None
    assert plan.setting.sigma == pytest.approx(2e-3)  # not the 1 µm that the job states
    assert plan.setting.noise.placing == pytest.approx(0.5e-3)


def test_set_up_offsets_make_what_is_expected_worse_by_what_the_repeats_share(tmp_path: Path) -> None:
    """Three repeats: √(1/3 + 1) of a reading instead of √(1/3)."""
    plan = planned(tmp_path, "placing_um = 1.0\ngrowth_um = 0.0", effects='"squareness_xy", "squareness_zx"')
    assert plan.start.identifiability is not None
    for one in plan.start.identifiability.parameters:
        assert one.u is not None
        assert one.u_white is not None
        assert one.u / one.u_white == pytest.approx(2.0, rel=1e-6)
    assert plan.worth is not None
    assert plan.worth.enough == 4


@pytest.mark.long
def test_what_the_diagnosis_would_find_is_larger_under_set_up_offsets(tmp_path: Path) -> None:
    found = []
    for offset in ("0.0", "2.0"):
        plan = planned(tmp_path, f'rivals = ["rotation_x_z"]\nplacing_um = {offset}\ngrowth_um = 0.0', power=True)
        (power,) = plan.start.powers
        assert power.detectable is not None
        found.append(power.detectable)
    # √(1/3 + 4) over √(1/3) is 3.6 where it is known that there are none; a diagnosis reckons with some in either case
    assert 1.5 < found[1] / found[0] < 3.6


@pytest.mark.long(but="separation")
@pytest.mark.parametrize(("plan", "effects", "length", "said"), [
    ("", "", 400.0, "no effect is named"),
    ("", SIX, 1000.0, "long along"),
    ("volume_mm = { z = [-200.0, 0.0] }", SIX, 400.0, "long along"),
    ('criterion = "D"', SIX, 2000.0, "long along"),
    ('criterion = "D"\nnumber = 9', SIX, 2000.0, "no placing is possible"),
    ("[plan.fixtures]\ndirections = [[0.0, 0.0, 1.0]]", SIX, 400.0, "no fixture holds the artefact"),
    ('criterion = "D"\nbudget_min = 2', SIX, 400.0, "too short for a single placing"),
    ('criterion = "D"\nmore = 1\nbudget_min = 123', SIX, 400.0, "beside the 20 that are kept"),
    ('criterion = "separation"\nrivals = ["rotation_x_z"]', SIX, 400.0, "at least 2 effects"),
    ('criterion = "D"', '"rotation_z_z"', 400.0, "no candidate placing shows any of these effects"),
    ('rivals = ["hysteresis_x"]', SIX, 400.0, "needs the column approach_x"),
    ('rivals = ["rotation_w_z"]', SIX, 400.0, "unknown effect"),
    ('ready = "ISO 10360-2"', SIX, 400.0, "no plan for a job of kind 'ballbar'"),
])  # fmt: skip
def test_what_cannot_be_planned_is_refused_with_its_reason(
    tmp_path: Path, plan: str, effects: str, length: float, said: str
) -> None:
    with pytest.raises(CmmUqError, match=said):
        planned(tmp_path, plan, effects, length)


@pytest.mark.long
def test_where_the_standard_plan_is_not_possible_a_criterion_finds_another(tmp_path: Path) -> None:
    """A stand that holds the bar level only: no diagonal of the standard in height."""
    fixtures = "\n[plan.fixtures]\ndirections = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0]]"
    level = '"scale_x", "scale_y", "squareness_xy"'
    with pytest.raises(CmmUqError, match="no fixture"):
        planned(tmp_path, 'criterion = "D"' + fixtures, level)
    plan = planned(tmp_path, 'criterion = "D"\nnumber = 12' + fixtures, level)
    assert plan.name == SPREAD
    assert len(plan.to_measure) == 12
    assert plan.scores is not None
    assert plan.scores[1] < plan.scores[0]
    assert {round(float(abs(p.points.xyz[1, 2] - p.points.xyz[0, 2])), 6) for p in plan.to_measure} == {0.0}


def test_a_plate_shifted_in_a_plane_is_left_to_its_report() -> None:
    with pytest.raises(CmmUqError, match="are not planned"):
        make_plan(read_job(ROOT / "examples" / "shift-plate-simulated", recorded=False))


@pytest.mark.parametrize(("effects", "sizes", "words"), [
    (["scale_x"], 0, "Scale error of X: nothing shows of it"),
    (["scale_x", "scale_y", "scale_z"], 1, "Scale error of X, Y and Z together, with the artefact's own length"),
    (["squareness_xy", "hysteresis_x", "squareness_zx"], 0, "Squareness X–Y and Z–X and Hysteresis of X together"),
    (["artefact_sag", "scale_x"], 0, "Sag of the artefact and Scale error of X together"),
    ([], 1, "The artefact's own length"), ([], 2, "The artefact's own dimensions"),
])  # fmt: skip
def test_a_free_combination_in_words(effects: list[str], sizes: int, words: str) -> None:
    parts = {(effect, "p"): 1.0 for effect in effects} | {(ARTEFACT, f"size_{i}_mm"): 1.0 for i in range(sizes)}
    found = combination(parts)
    assert found == words
    assert isinstance(found, Message)


def plan_of(folder: Path, plan: str, length: str = "400.0") -> MeasurementPlan:
    text = JOB.format(plan=plan, effects=SIX, length=length)
    if not length:
        text = text.replace("length_mm = \nu_um = 0.5\n", "")
    (folder / "job.toml").write_text(text, encoding="utf-8")
    return make_plan(read_job(folder, recorded=False), power=False)


@pytest.mark.long
def test_a_free_scale_is_said_in_words(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, "length_mm = 400.0", length="")
    page = render_html(plan_document(plan))
    assert "Scale error of X, Y and Z together, with the artefact&#39;s own length" in page
    assert "Not determined by these set-ups" in page


@pytest.mark.parametrize(("parts", "said"), [
    ({("scale_x", "ppm"): 1.0, ("artefact_sag", "um"): -2.5}, "Scale error of X and Sag of the artefact together"),
    ({("squareness_yz", "angle_arcsec"): 1.0}, "Squareness Y–Z: nothing shows of it"),
    ({("artefact", "length_mm"): 1.0}, "The artefact's own length"),
    ({("artefact", "block_12_mm"): 1.0, ("scale_x", "ppm"): 1.0, ("artefact", "block_23_mm"): 1.0},
     "Scale error of X, with the artefact's own dimensions"),
])  # fmt: skip
def test_combinations_in_words(parts: dict[tuple[str, str], float], said: str) -> None:
    assert combination(parts) == said


@pytest.mark.long
@pytest.mark.parametrize("kind", EVERY_KIND)
def test_every_artefact_has_a_picture_of_each_placing(kind: str) -> None:
    facts, wishes = EVERY_KIND[kind]
    chosen = setting(facts, named=(), **wishes)
    _, placings = ready_plan(chosen)
    plots = placing_pictures(placings, chosen.volume.box, 1)
    assert len(plots) == -(-len(placings) // 3)
    svg = "".join(plot.svg for plot in plots)
    for number, placing in enumerate(placings, 1):
        assert re.search(rf">\s*{number}\s*<", svg)
        assert placing.ends in svg


def test_what_has_no_end_stands_at_the_edge() -> None:
    plot = gain_plot(["A", "B"], [2.0, None], [1.0, np.inf], names=("before", "after"), quantity="Uncertainty")
    assert "A: 2 before, 1 after" in plot.alternative
    assert "B: not at all before, not at all after" in plot.alternative
    assert "nan" not in plot.svg


def test_a_shift_job_says_what_no_reading_shows() -> None:
    from tests.conftest import ROOT

    plan = make_plan(read_job(ROOT / "examples" / "shift-simulated", recorded=False), power=False)
    assert "No reading shows: errors that repeat every 10 mm" in render_html(plan_document(plan))


@pytest.mark.long
def test_conditions_that_are_not_met_are_a_warning(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, "budget_min = 60")
    assert "Not met: at most 60 min: 120 min." in plan_document(plan).warnings


def test_results_hold_finite_numbers_only(tmp_path: Path) -> None:
    data = plan_results(plan_of(tmp_path, "length_mm = 400.0", length=""))
    assert b"NaN" not in as_json(data)
    assert {p["u"] for p in data["start"]["determined"] if p["status"] == "free"} == {None}


@pytest.mark.long
def test_what_is_not_known_of_the_noise_is_said(tmp_path: Path) -> None:
    page = render_html(plan_document(plan_of(tmp_path, "")))
    assert "averaged over the prior" in page
    assert "u is the geometric mean" in page
    stated = plan_of(tmp_path, "placing_um = 1.0\ngrowth_um = 0.0")
    page = render_html(plan_document(stated))
    assert "averaged over" not in page
    # 20 placings of 20 s a bar: from four repeats on, see test_repeats.py; certificates set scales apart
    data = plan_results(stated)
    assert data["noise"]["placing_um"] == pytest.approx(1.0)
    assert data["repeats"]["rows"][2]["readings"] == 120
    assert "a minute of one more set-up lowers every expected uncertainty more" in page


@pytest.mark.long
def test_repeats_beyond_what_they_are_worth_are_named(tmp_path: Path) -> None:
    page = render_html(plan_document(plan_of(tmp_path, "placing_um = 5.0\ngrowth_um = 0.0\nrepeats = 5")))
    assert "With 1 or more repeats" in page
    assert "Fewer repeats and more set-ups would tell more in the same time" in page


def test_a_table_has_one_figure_in_brackets_for_one_more_placing(tmp_path: Path) -> None:
    data = plan_results(plan_of(tmp_path, "placing_um = 1.0\ngrowth_um = 0.0"))
    row = data["repeats"]["rows"][2]
    now, more = (one["u"]["squareness_xy.angle_arcsec"] for one in (row, row["one_placing_more"]))
    assert more / now == pytest.approx(np.sqrt(20 / 21), rel=1e-9)
    (determined,) = [p for p in data["start"]["determined"] if p["effect"] == "squareness_xy"]
    assert determined["u"] == pytest.approx(now, rel=1e-9)


DECIDED_JOB = """
[job]
id = "partly-measured"
date = 2026-01-01
[machine]
name = "Bridge machine"
travel_mm = { x = [0, 900], y = [0, 550], z = [-500, 0] }
[artefact]
kind = "step_gauge"
u_um = 0.4
[recording]
file = "recording.csv"
u_coordinate_um = 1.0
[model]
effects = ["scale_x", "scale_y", "scale_z"]
[[conformity]]
standard = "ISO 10360-2:2009"
limit_um = 5.0
"""

DIRECTED = ("approach_x", "approach_y", "approach_z")


def after(folder: Path, points: Points, further: Sequence[str] = DIRECTED) -> MeasurementPlan:
    """The plan of a recording of nominal points, with these columns."""
    columns = np.column_stack([
        points.measurement, points.point, points.repeat, points.xyz, points.columns["reference_mm"],
        *(np.sign(points.columns[name]) for name in further),
    ])  # fmt: skip
    rows = [",".join(["measurement,point,repeat,x_mm,y_mm,z_mm,reference_mm", *further])]
    rows += [
        ",".join([f"{m:.0f},{p:.0f},{r:.0f},{x:.7f},{y:.7f},{z:.7f}", *map(str, others)])
        for m, p, r, x, y, z, *others in columns.tolist()
    ]
    (folder / "recording.csv").write_text("\n".join(rows), encoding="utf-8")
    (folder / "job.toml").write_text(DECIDED_JOB, encoding="utf-8")
    return make_plan(read_job(folder, recorded=False), power=False)


def test_two_lines_that_were_not_measured_are_placed_and_no_others(tmp_path: Path) -> None:
    points = gauge(SEVEN).points
    plan = after(tmp_path, points.select(~np.isin(points.measurement, [2, 5])))
    assert plan.name == RECORDED
    assert [placing.title for placing in plan.to_measure] == ["along +X −Y +Z, inclined 25°", "along X"]
    assert all(condition.met for condition in plan.conditions)
    assert plan.first == 8


def test_where_nothing_is_missing_nothing_is_placed(tmp_path: Path) -> None:
    plan = after(tmp_path, gauge(SEVEN).points)
    assert plan.to_measure == ()
    assert all(condition.met for condition in plan.conditions)


def test_without_directions_the_lengths_are_not_shown_to_be_bidirectional(tmp_path: Path) -> None:
    plan = after(tmp_path, gauge(SEVEN).points, ())
    assert [condition.missing for condition in plan.conditions if not condition.met] == [
        ("bidirectional lengths: from which side each end was reached is not recorded",)
    ]


def test_nominal_points_serve_for_a_plan_and_a_simulation_and_for_no_certificate(tmp_path: Path) -> None:
    after(tmp_path, gauge(SEVEN).points)
    job = read_job(tmp_path)
    drawn = simulate(job, Truth.model_validate({"seed": 1, "noise": {"coordinate_um": 1.0}}))
    assert np.std(drawn.xyz - job.points.xyz) == pytest.approx(1e-3, rel=0.1)
    (problem,) = check_job(tmp_path).problems
    assert "the readings have no scatter at all" in problem.problem
    with pytest.raises(CmmUqError, match="the readings have no scatter at all"):
        analyse_job(job)


def test_copies_of_a_line_are_placed_again(tmp_path: Path) -> None:
    points = gauge(SEVEN).points
    xyz = points.xyz.copy()
    for repeat in (2, 3):
        xyz[(points.measurement == 6) & (points.repeat == repeat)] = xyz[
            (points.measurement == 6) & (points.repeat == 1)
        ]
    plan = after(tmp_path, points.at(xyz))
    assert [placing.title for placing in plan.to_measure] == ["along Y"]


@pytest.mark.long
def test_a_plan_without_the_placings_of_b89_is_not_called_one(tmp_path: Path) -> None:
    """Six placings by the criterion D replace the twenty of the ready plan."""
    plan = planned(tmp_path, 'criterion = "D"\nnumber = 6')
    assert plan.name == "ASME B89.4.1"
    assert len(plan.to_measure) == 6
    lacking = [text for condition in plan.conditions for text in condition.missing]
    assert lacking[0] == "14 of 20 positions: 6 distinct"


def test_what_the_job_states_of_the_artefact_s_temperature_is_in_the_plan(tmp_path: Path) -> None:
    """0.5 K of steel of the example's plan: 5.75 ppm of each scale, in quadrature.

    Of Z, which lines across say as much of, a little more if the gauge is warm by itself in each of its positions.
    """
    toml = (ROOT / "examples" / "plan-step-gauge" / "job.toml").read_text(encoding="utf-8")
    found = []
    for name, more in (("as it is", ""), ("warm", "\n[test_uncertainty]\nu_temperature_k = 0.5\n")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "job.toml").write_text(toml + more, encoding="utf-8")
        outlook = make_plan(read_job(tmp_path / name, recorded=False), power=False).start
        assert outlook.identifiability is not None
        u = {one.unknown.key[0]: one.u for one in outlook.identifiability.parameters}
        found.append(np.array([u[f"scale_{axis}"] for axis in "xyz"], dtype=np.float64))
    ratio = found[1] / np.hypot(found[0], 5.75)
    np.testing.assert_allclose(ratio[:2], 1.0, rtol=1e-3)
    assert 1.0 <= ratio[2] < 1.1
