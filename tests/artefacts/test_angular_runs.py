"""A rotary table read against a polygon by an autocollimator: figures by ISO 230-2, and closure against its own faces."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

import cmm_uq
from cmm_uq.app.commands.jobs.controller import write_tables
from cmm_uq.app.commands.jobs.new import write_new
from cmm_uq.app.commands.planning import make_plan
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import artefact_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from tests.analysis.conformity.by_hand.deciding import statement_of_job
from tests.jobs.test_reading import edit
from tests.maths.geometry.test_positioning import by_loops

FACES = 12
TOML = """[job]
id = "polygon"
date = 2026-01-01
origin = "simulated"
[machine]
name = "m"
chain = "XYZ|C"
travel_mm = {{ x = [0, 500], y = [0, 500], z = [-400, 0] }}
table = {{ axis_mm = [250, 250, -300]{turns} }}
[artefact]
kind = "axis_runs"
name = "Polygon of 12 faces"
{polygon}
[recording]
file = "recording.csv"
[model]
effects = ["rotary_positioning_c_1", "rotary_positioning_c_2", "rotary_play_c"]
"""
TRUE = {"rotary_positioning_c_1": (3.0, -2.0), "rotary_positioning_c_2": (-0.8, 1.1), "rotary_play_c": (1.5,)}


def table(degrees: Floats, approach: Floats) -> Floats:
    """By how much the table is turned further than it reads, ″, by the right hand."""
    c = np.radians(degrees)
    found = 0.5 * TRUE["rotary_play_c"][0] * approach
    for order, name in ((1, "rotary_positioning_c_1"), (2, "rotary_positioning_c_2")):
        a, b = TRUE[name]
        found = found + a * np.cos(order * c) - b * np.sin(order * c)
    return found


def job(
    folder: Path, settings: list[int], polygon: str, *, certified: Floats | None = None, repeats: int = 3,
    noise: float = 0.05, turns: str = "", seed: int = 1,
) -> tuple[Path, Floats, Floats]:  # fmt: skip
    """A recording, the faces' deviations from the first, and deviations of the table as read (2, faces, repeats) at first."""
    folder.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng(seed)
    faces = random.normal(0, 1.0, FACES)
    faces -= faces[0]
    sense = -1.0 if turns else 1.0
    head = "measurement,point,repeat,x_mm,y_mm,z_mm,turn_x,turn_y,turn_z,reading_arcsec,c_deg,c_approach,face"
    rows, first = [head + (",face_arcsec" if certified is not None else "")], np.zeros((2, FACES, repeats))
    for number, shift in enumerate(settings, 1):
        zero = random.normal(0, 20)
        for repeat in range(repeats):
            for side, approach in enumerate((1.0, -1.0)):
                for i in range(FACES)[:: int(approach)]:
                    degrees, face = 30.0 * i, (i + shift) % FACES
                    # readings that grow clockwise: the same table by the right hand, whatever it is called
                    err = float(table(np.array(sense * degrees), np.array(sense * approach))) + random.normal(0, noise)
                    if number == 1:
                        first[side, i, repeat] = sense * err
                    point = i + 1 + FACES * side
                    row = f"{number},{point},{repeat + 1},250,250,-250,0,0,1,{zero + err + faces[face]:.6f}"
                    row += f",{degrees:g},{approach:g},{face + 1}"
                    rows.append(row + (f",{certified[face]:.4f}" if certified is not None else ""))
    (folder / "recording.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    turned = ", turns = 'clockwise'" if turns else ""
    (folder / "job.toml").write_text(TOML.format(polygon=polygon, turns=turned), encoding="utf-8")
    return folder, faces, first


def estimated(report: cmm_uq.Report) -> None:
    for name, true in TRUE.items():
        found = report.estimates[report.estimates.index.str.startswith(f"{name}.")]
        want = [np.hypot(*true), np.arctan2(true[1], true[0])] if len(true) == 2 else [true[0]]
        assert np.all(np.abs(found["value"].to_numpy() - want) < 3.5 * found["u"].to_numpy()), name


@pytest.mark.usefixtures("no_regions", "no_diagnosis")
@pytest.mark.parametrize("turns", ["", "clockwise"])
def test_figures_and_errors_against_certified_faces(tmp_path: Path, turns: str) -> None:
    """A polygon as its certificate says, or nearly: figures are those of the table's deviations as it reads."""
    certified = np.random.default_rng(1).normal(0, 1.0, FACES)
    folder, faces, first = job(tmp_path / "job", [0], "u_polygon_arcsec = 0.1", certified=certified, turns=turns)
    np.testing.assert_allclose(faces, certified - certified[0])  # as the seed has it
    report = cmm_uq.report(folder, seed=1)
    estimated(report)
    (run,) = report.results["runs"]
    assert (run["quantity"], run["unit"], run["angles_deg"]) == ("ECC", "″", (30.0 * np.arange(FACES)).tolist())
    less = first - first.mean()
    assert run["figures"] == pytest.approx(by_loops(less), rel=1e-3)
    assert 0.1 < run["U"]["E"] < 0.8
    assert run["U"]["B"] == pytest.approx(0.0, abs=1e-9)  # a face is the same from either side


@pytest.mark.usefixtures("no_regions", "no_diagnosis")
def test_faces_are_found_by_closure_with_the_table(tmp_path: Path) -> None:
    """Four settings of a polygon that nobody calibrated: its faces and the table's errors are both found."""
    folder, faces, first = job(tmp_path / "job", [0, 1, 4, 9], "", repeats=2)
    report = cmm_uq.report(folder, seed=1)
    estimated(report)
    read = read_job(folder)
    artefact = artefact_of(read.facts.artefact, read.points)
    found = {s.name for s in artefact.sizes}
    assert found == {f"face_{k}_arcsec" for k in range(2, FACES + 1)}
    profile = artefact._profile / artefact._factor(turns=True)  # type: ignore[attr-defined]
    face = read.points.columns["face"].astype(int) - 1
    np.testing.assert_allclose(profile, faces[face], atol=0.12)
    run = report.results["runs"][0]
    assert run["figures"]["E"] == pytest.approx(by_loops(first - first.mean())["E"], abs=0.15)
    assert 0.03 < run["U"]["E"] < 0.15


@pytest.mark.parametrize("settings", [[0], [0, 6], [0, 3], [0, 4, 8]])
def test_settings_that_leave_faces_and_table_open_are_refused(tmp_path: Path, settings: list[int]) -> None:
    """Of one setting half of the table's errors passed for the polygon's: E was 4.15 ± 0.04″ where it is 9.23."""
    folder, *_ = job(tmp_path / "job", settings, "")
    read = read_job(folder)
    with pytest.raises(CmmUqError, match="do not part its faces from the table's errors"):
        artefact_of(read.facts.artefact, read.points)


@pytest.mark.usefixtures("no_regions", "no_diagnosis")
def test_two_settings_one_face_apart_are_enough(tmp_path: Path) -> None:
    folder, _, first = job(tmp_path / "job", [0, 1], "")
    run = cmm_uq.report(folder, seed=1).results["runs"][0]
    assert abs(run["figures"]["E"] - by_loops(first - first.mean())["E"]) < 1.5 * run["U"]["E"]


def test_runs_of_carriages_and_of_a_table_are_two_jobs(tmp_path: Path) -> None:
    folder, *_ = job(tmp_path / "job", [0, 1], "")
    text = (folder / "recording.csv").read_text(encoding="utf-8").split("\n")
    moved = [
        line.replace(",250,250,", f",{250 + i % 9},250,", 1) if line.startswith("2,") else line
        for i, line in enumerate(text)
    ]
    (folder / "recording.csv").write_text("\n".join(moved), encoding="utf-8")
    read = read_job(folder)
    with pytest.raises(CmmUqError, match="runs of carriages beside runs of a rotary table"):
        artefact_of(read.facts.artefact, read.points)


def test_a_fault_that_the_model_leaves_out_is_found(tmp_path: Path) -> None:
    folder, *_ = job(
        tmp_path / "job", [0], "u_polygon_arcsec = 0.1", certified=np.random.default_rng(1).normal(0, 1.0, FACES)
    )
    edit(folder, r"^effects = .*", 'effects = ["rotary_positioning_c_1", "rotary_positioning_c_2"]')
    told = cmm_uq.diagnose(folder, seed=1).diagnosis
    assert "rotary_play_c" in {each["effect"] for each in told["effects"]}


CONFORMITY = """
[test_uncertainty]
u_repeat_arcsec = 0.05
[test_uncertainty.negligible]
alignment = {{ by = "the laboratory", reason = "the polygon is centred to 10 µm" }}
[rated_conditions]
declared = {{ by = "the laboratory", reason = "20 °C" }}
[[conformity]]
standard = "{standard}"
characteristic = "{figure}"
{limit}
"""


def decided(
    folder: Path, figure: str = "A", limit: str = "limit_arcsec = 14.0", *, repeats: int = 5, standard: str = "ISO 230-2:2014",
    polygon: str = "u_polygon_arcsec = 0.1", travel: str = "travel_deg = [0, 360]", extra: str = "",
) -> tuple[Path, Floats]:  # fmt: skip
    """A job of a table whose figure is decided, and deviations of the table as read."""
    certified = np.round(np.linspace(-0.5, 0.5, FACES), 4)
    made, faces, first = job(folder, [0], polygon, certified=certified, repeats=repeats)
    # the readings have the true faces, the certificate those of this polygon
    lines = (made / "recording.csv").read_text(encoding="utf-8").splitlines()
    rows = [line.split(",") for line in lines[1:]]
    for row in rows:
        face = int(row[12]) - 1
        row[9] = f"{float(row[9]) - faces[face] + certified[face] - certified[0]:.6f}"
    (made / "recording.csv").write_text(
        "\n".join([lines[0], *(",".join(row) for row in rows)]) + "\n", encoding="utf-8"
    )
    toml = (
        (made / "job.toml")
        .read_text(encoding="utf-8")
        .replace(
            "axis_mm = [250, 250, -300]",
            f"axis_mm = [250, 250, -300], {travel}" if travel else "axis_mm = [250, 250, -300]",
        )
    )
    toml += CONFORMITY.format(standard=standard, figure=figure, limit=limit) + extra
    (made / "job.toml").write_text(toml, encoding="utf-8")
    return made, first


def by_hand(x: Floats) -> dict[str, float]:
    """Figures of deviations (2, targets, repeats), ″, by the printed formulas, term by term."""
    n, up, down = x.shape[2], x[0], x[1]
    mean_up, mean_down = (sum(each[:, j] for j in range(n)) / n for each in (up, down))
    s_up, s_down = (
        np.sqrt(sum((each[:, j] - mean) ** 2 for j in range(n)) / (n - 1))
        for each, mean in ((up, mean_up), (down, mean_down))
    )
    b, middle = mean_up - mean_down, 0.5 * (mean_up + mean_down)
    r = [max(2 * a + 2 * c + abs(e), 4 * a, 4 * c) for a, c, e in zip(s_up, s_down, b, strict=True)]
    top = max((mean_up + 2 * s_up).max(), (mean_down + 2 * s_down).max())
    bottom = min((mean_up - 2 * s_up).min(), (mean_down - 2 * s_down).min())
    return {
        "A": top - bottom, "R": max(r), "B": np.abs(b).max(), "M": np.ptp(middle),
        "E": max(mean_up.max(), mean_down.max()) - min(mean_up.min(), mean_down.min()),
    }  # fmt: skip


@pytest.mark.parametrize("figure", ["A", "E", "R", "B", "M"])
def test_a_figure_of_a_table_is_decided_against_its_limit_in_arcseconds(tmp_path: Path, figure: str) -> None:
    folder, first = decided(tmp_path / "job", figure)
    told = statement_of_job(folder)
    value = by_hand(first)[figure]
    assert told.value_um == pytest.approx(value, abs=2e-6)  # as an arc where 1 µm is 1″
    assert told.limit_um == pytest.approx(14.0)
    assert told.outcome == "pass", told.missing
    u = told.u_um
    strict, _ = decided(tmp_path / "strict", figure, f"limit_arcsec = {value - 3 * u:.6f}")
    assert statement_of_job(strict).outcome == "fail"


@pytest.mark.parametrize(
    ("repeats", "travel", "extra", "missing"),
    [
        (4, "travel_deg = [0, 360]", "", "4 runs, 12 targets"),
        (5, "travel_deg = [0, 720]", "", None),  # of a table that turns on and on one turn is what is decided
        (5, "", "", "the travel of C"),
    ],
)
def test_a_test_of_a_table_that_lacks_something_is_incomplete(
    tmp_path: Path, repeats: int, travel: str, extra: str, missing: str | None
) -> None:
    folder, _ = decided(tmp_path / "job", repeats=repeats, travel=travel, extra=extra)
    told = statement_of_job(folder)
    assert told.outcome == ("incomplete" if missing else "pass")
    assert missing is None or any(missing in str(one) for one in told.missing)


def cut(folder: Path, most: float) -> None:
    """Of a job the targets up to an angle."""
    head, *rows = (folder / "recording.csv").read_text(encoding="utf-8").splitlines()
    kept = [row for row in rows if float(row.split(",")[10]) <= most]
    (folder / "recording.csv").write_text("\n".join([head, *kept]) + "\n", encoding="utf-8")


@pytest.mark.parametrize(
    ("most", "travel", "missing"),
    [(60.0, "[0, 90]", ""), (30.0, "[0, 45]", "2 targets"), (120.0, "[0, 180]", ""), (90.0, "[0, 130]", ""),
     (180.0, "[0, 360]", "two thirds of the travel of C"), (180.0, "[0, 200]", "")],
)  # fmt: skip
def test_how_many_targets_a_run_needs_goes_by_how_far_it_turns(
    tmp_path: Path, most: float, travel: str, missing: str
) -> None:
    """Three up to 90°, five up to 180°, eight beyond; over two thirds of the travel."""
    folder, _ = decided(tmp_path / "job", travel=f"travel_deg = {travel}")
    cut(folder, most)
    told = statement_of_job(folder)
    assert told.outcome == ("incomplete" if missing else "pass"), told.missing
    assert not missing or any(missing in str(one) for one in told.missing)


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"limit": "limit_um = 9.0"}, "is of a rotary axis, and its limit is not"),
        ({"limit": 'mpe = "3 + L/300"'}, "is of a rotary axis, and its limit is not"),
        ({"standard": "ISO 230-6:2002", "figure": "Ed"}, "Ed of ISO 230-6:2002 is no angle"),
    ],
)
def test_a_limit_that_does_not_go_with_a_table_is_refused(tmp_path: Path, change: dict[str, str], problem: str) -> None:
    folder, _ = decided(tmp_path / "job", **change)
    with pytest.raises(CmmUqError, match=problem):
        statement_of_job(folder)


def test_a_figure_of_a_straight_axis_has_no_limit_in_arcseconds(tmp_path: Path) -> None:
    from tests.conftest import ROOT

    shutil.copytree(ROOT / "examples" / "axis-runs-simulated", tmp_path / "job")
    toml = tmp_path / "job" / "job.toml"
    text = toml.read_text(encoding="utf-8")
    assert "limit_um" in text
    toml.write_text(re.sub(r"limit_um = [\d.]+", "limit_arcsec = 5.0", text, count=1), encoding="utf-8")
    with pytest.raises(CmmUqError, match="is of no angle, and its limit is not"):
        statement_of_job(tmp_path / "job")


def test_without_what_is_uncertain_of_repeats_or_alignment_no_table_passes(tmp_path: Path) -> None:
    folder, _ = decided(tmp_path / "job")
    toml = folder / "job.toml"
    text = toml.read_text(encoding="utf-8").replace("u_repeat_arcsec = 0.05", "u_repeat_um = 0.05")
    toml.write_text(text[: text.index("alignment = ")] + text[text.index("[rated_conditions]") :], encoding="utf-8")
    told = statement_of_job(folder)
    assert told.outcome == "incomplete"
    said = " ".join(map(str, told.missing))
    assert "alignment of the artefact is neither stated" in said
    assert "changes between the readings is neither stated" in said
    assert "temperature" not in said


def test_the_laboratorys_own_rule_decides_a_table_too(tmp_path: Path) -> None:
    extra = "complete = { measurements = 1, repeats = 5, points = 24 }\n"
    folder, first = decided(tmp_path / "job", "R", standard="laboratory's own rule", extra=extra)
    told = statement_of_job(folder)
    assert told.value_um == pytest.approx(by_hand(first)["R"], abs=2e-6)
    assert told.outcome == "pass", told.missing


@pytest.mark.parametrize("form", ["linuxcnc", "sinumerik", "twincat", "template"])
def test_a_table_for_a_controller_has_degrees(tmp_path: Path, form: str) -> None:
    """Read back: at each target what the table is turned further than it reads, from both sides, less that at 0."""
    folder, first = decided(tmp_path / "job")
    (tmp_path / "c.csv").write_text(
        "{% for a in axes %}{{ a.name }} {{ a.targets_deg }} {{ a.reverse_correction_arcsec }}{% endfor %}"
    )
    files, said = write_tables(folder, tmp_path / "out", str(tmp_path / "c.csv") if form == "template" else form)
    up, down = first.mean(axis=2) - first.mean(axis=2)[:, 0].mean()
    at = 30.0 * np.arange(FACES)
    if form == "linuxcnc":
        rows = np.loadtxt(files["c.comp"])
        np.testing.assert_allclose(rows, np.column_stack([at, at + up / 3600, at + down / 3600]), atol=1.1e-6)
    elif form == "sinumerik":
        text = files["AX_EEC.INI"].read_text()
        values = [float(v) for v in re.findall(r"\$AA_ENC_COMP\[0,\d+,C1\]=(\S+)", text)]
        np.testing.assert_allclose(values, 0.5 * (up + down) / 3600, atol=1.1e-6)
    elif form == "twincat":
        text = files["achskw_c.lis"].read_text()
        found = [
            [int(v) for v in re.findall(rf"table\[\d+\]\.{name} (\S+)", text)] for name in ("setpoint", "pos", "neg")
        ]
        np.testing.assert_allclose(found, np.array([1e4 * at, 1e4 * up / 3600, 1e4 * down / 3600]), atol=0.6)
    else:
        text = files["axes.csv"].read_text()
        assert text.startswith("c [0.0, 30.0")
        np.testing.assert_allclose([float(v) for v in text.split("[")[2].strip("]\n ").split(",")], -down, atol=1e-5)
    assert "″ rms" in said[0]
    told = json.loads((tmp_path / "out" / "controller.json").read_text(encoding="utf-8"))["held_out_rms_arcsec"]["c"]
    assert told["corrected"] < 0.1 * told["uncorrected"] < told["sign_reversed"]


def begun(folder: Path, name: str, plan: str) -> Path:
    """A new job, with wishes for a plan."""
    write_new(name, folder, {})
    toml = folder / "job.toml"
    toml.write_text(toml.read_text(encoding="utf-8") + f"\n[plan]\n{plan}\n", encoding="utf-8")
    return folder


@pytest.mark.long
def test_a_plan_of_a_polygon_says_u_and_finds_angles_that_tell_more(tmp_path: Path) -> None:
    """A second setting between the angles of the first; u of the first order is that of least squares of both."""
    folder = begun(tmp_path / "job", "polygon", 'ready = "polygon"\nrepeats = 5\ncriterion = "D"\nmore = 1')
    found = make_plan(read_job(folder))
    assert found.better is not None
    (added,) = found.to_measure
    at = np.unique(added.points.columns["c_deg"])
    assert set(np.round(at % 30, 3)) <= {7.5, 15.0, 22.5}
    assert np.ptp(added.points.columns["face"]) == 11
    before, after = (
        np.array([row.u for row in one.identifiability.parameters][:2]) for one in (found.start, found.better)
    )
    assert np.all(after < 0.8 * before)
    assert all(not condition.missing for condition in found.conditions)


def test_ready_settings_of_a_polygon_without_certified_faces_part_them_from_the_table(tmp_path: Path) -> None:
    folder = begun(tmp_path / "job", "polygon", 'ready = "polygon"\nrepeats = 1')
    (folder / "recording.csv").unlink()
    toml = folder / "job.toml"
    text = toml.read_text(encoding="utf-8").replace('origin = "simulated"', "")
    toml.write_text(re.sub(r"(?m)^u_polygon_arcsec.*\n", "", text), encoding="utf-8")
    found = make_plan(read_job(folder, recorded=False), power=False)
    shifts = [one.points.columns["face"][0] for one in found.start.placings]
    assert shifts == [1.0, 2.0]
    assert found.start.identifiability.complete
    assert "face_arcsec" not in found.start.points.columns


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (("XYZ|C", "XYZ"), "a polygon stands on a rotary table, which the chain has not"),
        (("[0.0, 360.0]", "[0.0, 20.0]"), "shows fewer than two faces of a polygon of 12"),
    ],
)
def test_a_polygon_that_no_table_turns_is_not_planned(tmp_path: Path, change: tuple[str, str], problem: str) -> None:
    folder = begun(tmp_path / "job", "polygon", 'ready = "polygon"')
    (folder / "recording.csv").unlink()
    toml = folder / "job.toml"
    text = toml.read_text(encoding="utf-8").replace('origin = "simulated"', "").replace(*change)
    if change[1] == "XYZ":
        text = re.sub(r"(?m)^table = .*\n", "", text)
    toml.write_text(text, encoding="utf-8")
    with pytest.raises(CmmUqError, match=problem):
        make_plan(read_job(folder, recorded=False), power=False)
