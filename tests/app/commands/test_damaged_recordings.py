"""Damaged recordings, gross errors, recordings without scatter, and lines that contradict an average."""

from __future__ import annotations

import shutil
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import cmm_uq
from cmm_uq.analysis.diagnosis.comparison.lack_of_fit import tail_probability
from cmm_uq.analysis.screening.columns import Finding
from cmm_uq.app.commands.diagnose import diagnose_read, screened_model
from cmm_uq.app.commands.reading import read_job
from cmm_uq.app.commands.report import evaluate_job as analyse_job, outcome_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import OBSERVATIONS
from cmm_uq.certificate.result import Result
from cmm_uq.jobs.job import Job
from cmm_uq.machine.model import RecordingModel
from tests.conftest import ROOT

EXAMPLES = Path(__file__).parents[3] / "examples"
NO_POINTS = {"shift-simulated", "shift-source-simulated", "shift-plate-simulated", "iota-1102-maps"}
KINDS = sorted(
    {path.parent.name for path in EXAMPLES.glob("*/*.csv") if not path.parent.name.startswith("part-")} - NO_POINTS
)
Damage = Callable[[pd.DataFrame], pd.DataFrame]


def cell(column: str, value: object) -> Damage:
    def damaged(table: pd.DataFrame) -> pd.DataFrame:
        table = table.astype(object)
        table.loc[3, column] = value
        return table

    return damaged


def one_place(table: pd.DataFrame) -> pd.DataFrame:
    return table[table.measurement == table.measurement.iloc[0]]


def job_with(example: str, damage: Damage, folder: Path) -> Path:
    job = folder / "job"
    shutil.copytree(EXAMPLES / example, job)
    recording = job / tomllib.loads((job / "job.toml").read_text(encoding="utf-8"))["recording"]["file"]
    damage(pd.read_csv(recording, comment="#")).to_csv(recording, index=False)
    return job


@pytest.mark.parametrize("example", KINDS)
@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (cell("x_mm", np.nan), "line 5, column x_mm: no value"),
        (cell("y_mm", "abc"), "line 5, column y_mm: 'abc' is not a number"),
        (cell("z_mm", "inf"), "line 5, column z_mm: 'inf' is not a finite number"),
        (lambda table: table.drop(columns=["x_mm"]), "no column 'x_mm'"),
        (lambda table: table.drop(columns=["point"]), "no column 'point'"),
        (lambda table: table.head(0), "has no rows"),
        (lambda table: pd.concat([table, table]), "is there twice"),
    ],
    ids=["no value", "text", "infinite", "no coordinate", "no point", "empty", "every row twice"],
)
def test_a_damaged_recording_is_refused_with_its_place(example: str, damage: Damage, says: str, tmp_path: Path) -> None:
    with pytest.raises(CmmUqError) as error:
        read_job(job_with(example, damage, tmp_path))
    assert says in str(error.value)
    assert error.value.fix


@pytest.mark.parametrize("example", KINDS)
def test_three_rows_are_too_few_for_any_artefact(example: str, tmp_path: Path) -> None:
    with pytest.raises(CmmUqError) as error:
        diagnose_read(read_job(job_with(example, lambda table: table.head(3), tmp_path)))
    assert error.value.fix


@pytest.mark.long(but="plane-simulated")
@pytest.mark.parametrize(
    "example", [name for name in KINDS if not name.startswith(("iota", "bryan", "digitizer", "optical", "scanned"))]
)
def test_a_single_placing_is_diagnosed_by_its_points(example: str, tmp_path: Path) -> None:
    """No placing can be held out, so its points are, each with its repeats."""
    improvement = diagnose_read(read_job(job_with(example, one_place, tmp_path))).diagnosis.improvement
    assert np.isfinite([improvement.heldout_rms_before_um, improvement.heldout_rms_after_um]).all()


@pytest.mark.parametrize(
    "example",
    [
        "iota-1102-20C",
        "bryan-simulated",
        "digitizer-simulated",
        "optical-ballbar-simulated",
        "scanned-planes-simulated",
    ],
)
def test_one_distance_or_attitude_determines_nothing(example: str, tmp_path: Path) -> None:
    job = job_with(example, one_place, tmp_path)
    with pytest.raises(CmmUqError):
        diagnose_read(read_job(job))


@pytest.mark.parametrize("row", [0, 4, 41])
def test_a_triangle_without_one_of_its_corners_is_refused(row: int, tmp_path: Path) -> None:
    job = job_with("triangle-simulated", lambda table: table.drop(index=row), tmp_path)
    with pytest.raises(CmmUqError, match="the triangle does not close"):
        diagnose_read(read_job(job))


@pytest.mark.long
def test_more_observations_than_memory_holds_are_refused_before_the_estimate(tmp_path: Path) -> None:
    """Each coordinate of a ball is an observation; a flat grid of them passes everything else."""
    balls = np.arange(OBSERVATIONS.most // 3 + 1)
    grid = {"reference_x_mm": balls % 400 * 2.0, "reference_y_mm": balls // 400 * 2.0, "reference_z_mm": 0.0}
    noise = np.random.default_rng(3).normal(0, 1e-3, (3, len(balls)))
    read = {f"{axis}_mm": grid[f"reference_{axis}_mm"] + noise[i] for i, axis in enumerate("xyz")}
    columns = {"measurement": 1, "point": balls + 1, "repeat": 1, **read, **grid}
    job = job_with("plate-simulated", lambda _: pd.DataFrame(columns), tmp_path)
    with pytest.raises(CmmUqError, match=f"{3 * len(balls)} observations are more than are estimated from at once"):
        diagnose_read(read_job(job))


EFFECTS = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")


def bars_along_x(noise_mm: float, origin: str, digits: int = 9) -> Job:
    """Twenty bars of 400 mm along X, all over the volume."""
    random, rows = np.random.default_rng(2), []
    for number in range(1, 21):
        middle = np.array([350.0, 350.0, -350.0]) + random.uniform(-150, 150, 3)
        for point, side in ((1, -200.0), (2, 200.0)):
            xyz = middle + [side, 0, 0] + noise_mm * random.standard_normal(3)
            rows.append((number, point, *np.round(xyz, digits)))
    return cmm_uq.job(
        pd.DataFrame(rows, columns=["measurement", "point", "x_mm", "y_mm", "z_mm"]),
        machine={"name": "M", "chain": "XYZ", "travel_mm": {"x": [0, 700], "y": [0, 700], "z": [-700, 0]}},
        artefact={"kind": "ballbar", "length_mm": 400.0, "u_um": 0.2}, effects=EFFECTS, job={"origin": origin},
    )  # fmt: skip


@pytest.mark.parametrize("run", [analyse_job, diagnose_read])
def test_measured_coordinates_without_any_scatter_are_refused_with_a_remedy(run: object) -> None:
    assert callable(run)
    with pytest.raises(CmmUqError, match=r"the readings have no scatter at all.*Record what the machine indicated"):
        run(bars_along_x(0.0, "measured"))


@pytest.mark.long
@pytest.mark.parametrize(("noise_mm", "origin", "digits"), [(0.0, "simulated", 9), (0.0, "measured", 4)])
def test_bars_along_one_axis_determine_its_scale_and_nothing_else(noise_mm: float, origin: str, digits: int) -> None:
    """U of the scale is that of the certificate, 0.4 µm in 400 mm; what the digits leave open is less."""
    found = analyse_job(bars_along_x(noise_mm, origin, digits))
    assert isinstance(found, Result)
    assert found.free == {"scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx"}
    scale = found.parameters["scale_x"]["ppm"]
    assert abs(scale.value) < 0.1
    assert scale.u == pytest.approx(0.5, rel=0.05)


def test_draws_that_are_all_alike_have_no_tail_but_markov_s() -> None:
    draws = np.full(1000, 2.0)
    assert tail_probability(draws, 2.0) == 1.0
    assert tail_probability(draws, 6.0, 0.9) == pytest.approx(0.1 * np.exp(-4))


WITH_OUTLIERS = ROOT / "examples"


def moved(folder: Path, example: str, row: int, column: str, by_mm: float) -> tuple[RecordingModel, Finding]:
    """An example with one reading moved: its model, and the outlier that is found."""
    job = folder / example
    shutil.copytree(WITH_OUTLIERS / example, job)
    recording = pd.read_csv(job / "recording.csv")
    recording.loc[row, column] += by_mm
    recording.to_csv(job / "recording.csv", index=False)
    model, findings = screened_model(read_job(job))
    (outlier,) = [finding for finding in findings if finding.kind == "outlier"]
    return model, outlier


@pytest.mark.parametrize(
    ("row", "column", "named"),
    [
        (7, "x_mm", "the coordinate along the plate's x of point 8 of measurement 1, repeat 1"),
        (12, "z_mm", "the coordinate along the plate's z of point 13 of measurement 1, repeat 1"),
        (30, "z_mm", "the coordinate along the plate's y of point 6 of measurement 2, repeat 1"),
    ],
)
def test_of_a_plate_one_coordinate_is_set_aside_and_the_others_count(
    tmp_path: Path, row: int, column: str, named: str
) -> None:
    """The second placing stands upright: the machine's z is the plate's y."""
    model, outlier = moved(tmp_path, "plate-simulated", row, column, 0.02)
    assert outlier.why.startswith(f"{named} is ")
    assert (outlier.lines, outlier.set_aside) == ((row + 2,), True)
    (left_out,) = np.flatnonzero(~model.used).tolist()
    assert left_out // 3 == row


def test_of_a_gauge_a_sphere_and_a_plane_one_point_is_set_aside(tmp_path: Path) -> None:
    for example, column, named in (
        ("step-gauge-simulated", "x_mm", "point 5 of measurement 1, repeat 1"),
        ("sphere-simulated", "z_mm", "point 5 of measurement 1, repeat 1"),
        ("plane-simulated", "z_mm", "point 4 of measurement 1, repeat 1"),
    ):
        model, outlier = moved(tmp_path, example, 4, column, 0.02)
        assert outlier.why.startswith(f"{named} is ")
        assert outlier.lines == (6,)
        assert (~model.used).sum() == 1
        assert model.artefact.rows[~model.used].ravel().tolist() == [4]


def test_of_a_swept_bar_the_position_is_set_aside(tmp_path: Path) -> None:
    _, outlier = moved(tmp_path, "bryan-simulated", 44, "z_mm", 0.05)
    assert outlier.why.startswith("measurement 45, repeat 1 is ")


WAYS = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1), (-1, 1, 1), (1, -1, 1), (-1, -1, 1),
        (1, 1, 0), (-1, 1, 0), (1, 0, 1), (-1, 0, 1))  # fmt: skip
SCALES = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")


def gauge_that_seems_to_sag() -> pd.DataFrame:
    """Axes of 600 mm (Z 500) show no scale; on diagonals of 700 mm level parts of a line are up to 5 ppm too long.

    So would a gauge that sags by 21 µm on a machine whose X and Y are 35 ppm off, which is what the average mostly is made of.
    """
    random, sag, middle, rows = np.random.default_rng(3), 0.021, np.array([350.0, 350.0, -350.0]), []
    for number, way in enumerate(WAYS, 1):
        along = np.array(way) / np.linalg.norm(way)
        faces = np.linspace(0, 500.0 if number == 3 else 600.0 if number < 3 else 700.0, 6)
        shortened = 1 - sag / faces[-1] * (1 - along[2] ** 2)
        true = middle + 20 * random.uniform(-1, 1, 3) + (faces[:, None] - faces[-1] / 2) * along * shortened
        true = true + (true - middle) * np.array([sag / 600, sag / 600, 0])
        for repeat in (1, 2, 3):
            rows += [
                (number, repeat, point, *np.round(xyz, 5), reference)
                for point, (xyz, reference) in enumerate(
                    zip(true + 0.001 * random.standard_normal(true.shape), faces, strict=True), 1
                )
            ]
    names = ["measurement", "repeat", "point", "x_mm", "y_mm", "z_mm", "reference_mm"]
    return pd.DataFrame(rows, columns=names)


@pytest.fixture(scope="module")
def result() -> Result:
    job = cmm_uq.job(
        gauge_that_seems_to_sag(),
        machine={"name": "M", "chain": "XYZ", "travel_mm": {"x": [0, 1000], "y": [0, 1000], "z": [-1000, 0]}},
        artefact={"kind": "step_gauge", "u_um": 0.2, "cte_per_k": 11.5e-6}, effects=SCALES,
        model={"tolerances": {"scale_x": 60.0, "scale_z": 60.0}},
    )  # fmt: skip
    found = analyse_job(job)
    assert isinstance(found, Result)
    return found


@pytest.mark.long
def test_the_average_is_far_from_what_the_line_along_x_says(result: Result) -> None:
    assert result.averaged
    scale = result.parameters["scale_x"]["ppm"]
    line = next(one for one in result.contradictions if one.key == ("scale_x", "ppm"))
    assert line.measurement == 1
    assert abs(line.alone.value) < 3 < abs(scale.value) - scale.expanded + line.alone.expanded
    assert abs(scale.value - line.alone.value) > np.hypot(scale.expanded, line.alone.expanded)


@pytest.mark.long
def test_it_is_not_given_on_any_page_nor_to_programs_while_that_of_z_is(result: Result) -> None:
    outcome = outcome_of(result)
    assert any("the line of measurement 1 alone says" in text for text in outcome.summary.warnings)
    assert {one.key for one in result.contradictions} == {("scale_x", "ppm"), ("scale_y", "ppm")}
    undetermined = outcome.results["identifiability"]["undetermined"]
    assert undetermined == [{"scale_x.ppm": 1.0}, {"scale_y.ppm": 1.0}]
    assert outcome.results["contradicted"][0]["measurement"] == 1
    figures = {str(name): str(value) for name, value, _ in outcome.summary.figures}
    assert figures["Scale error of X"] == figures["Scale error of Y"] == "not determined"
    assert "±" in figures["Scale error of Z"]


@pytest.mark.long
def test_a_tolerance_of_it_is_not_decided(result: Result) -> None:
    outcomes = {verdict.name: verdict.outcome for verdict in result.verdicts}
    assert outcomes["scale_x.ppm"] == "undecided"
    assert outcomes["scale_z.ppm"] == "pass"
