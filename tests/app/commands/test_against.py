"""A diagnosis against a simulation: recordings and predictions by plain equations (tests/app/commands/predictions.py)."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import cmm_uq
from cmm_uq.app.commands.diagnose import write_diagnosis
from cmm_uq.app.commands.model import Against, against_simulation
from cmm_uq.app.commands.reading import compared_with_frame
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.job import Job
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from tests.app.cli.process import run
from tests.app.commands.predictions import LENGTH, errors, job, placed_bars, predicted, recorded, shown, table
from tests.conftest import ROOT

TRUE = placed_bars()
MACHINE = errors(scale_x=30.0, scale_y=-20.0, square_xy=25.0)
RECORDED = recorded(TRUE, MACHINE)
WITHOUT_SQUARENESS = table(predicted(TRUE, errors(scale_x=30.0, scale_y=-20.0)))
COMPLETE = table(predicted(TRUE, MACHINE))


def compared(of: Job) -> Against:
    simulation = of.facts.simulation
    assert simulation is not None
    return against_simulation(of, simulation)


def squareness(found: Against | RecordingModel) -> tuple[float, float]:
    """Least-squares estimate of the squareness XY that is left, and its standard uncertainty, ″."""
    model = found.model if isinstance(found, Against) else found
    named = RecordingModel(model.artefact, effects(["squareness_xy"], where=""), model.sigma, model.used)
    estimate = named.estimate().least_squares
    return float(estimate.value[0]), float(np.sqrt(estimate.covariance[0, 0]))


def scatter_um(found: Against) -> float:
    return 1e3 * found.model.estimate().least_squares.sigma_of_residuals


def refused(points: pd.DataFrame, prediction: pd.DataFrame, **simulation: object) -> CmmUqError:
    with pytest.raises(CmmUqError) as caught:
        compared(job(points, prediction, **simulation))
    return caught.value


# ---- whole diagnoses


@pytest.mark.long
def test_what_a_prediction_leaves_out_is_found_with_its_size_and_written(tmp_path: Path) -> None:
    """A file that lies outside the job is compared with, hashed, and named on the page."""
    job(RECORDED).write(tmp_path / "job")
    file = tmp_path / "elsewhere.csv"
    WITHOUT_SQUARENESS.to_csv(file, index=False)
    files = write_diagnosis(tmp_path / "job", tmp_path / "out", against=file).files
    results = json.loads(files["results.json"].read_bytes())
    found = results["diagnosis"]
    assert found["verdict"] == "explained"
    assert [each["effect"] for each in found["effects"]] == ["squareness_xy"]
    low, high = found["effects"][0]["parameters"]["angle_arcsec"]["interval95"]
    assert low < 25.0 < high
    assert high - low < 3.0
    assert found["improvement"]["heldout_rms_after_um"] < 0.2 * found["improvement"]["heldout_rms_before_um"]
    hashed = {"elsewhere.csv": hashlib.sha256(file.read_bytes()).hexdigest()}
    assert found["simulation"]["files_sha256"] == hashed
    assert results["job"]["inputs_sha256"].items() > hashed.items()
    page = files["diagnosis.html"].read_text(encoding="utf-8")
    assert "The recording does not agree with the simulation" in page
    assert hashed["elsewhere.csv"] in page
    checker = ROOT.parent / "shared" / "check_results.py"
    if checker.is_file():
        kept = subprocess.run([sys.executable, checker, files["results.json"]], capture_output=True, check=False)
        assert kept.returncode == 0, kept.stdout


@pytest.mark.long
def test_a_complete_prediction_is_consistent_whatever_the_job_names() -> None:
    """The job names a prediction without the squareness, the call another one."""
    assert cmm_uq.diagnose(job(RECORDED, WITHOUT_SQUARENESS), against=COMPLETE).verdict == "consistent"


def test_the_command_says_what_is_wrong_and_writes_nothing(tmp_path: Path) -> None:
    job(RECORDED).write(tmp_path / "job")
    done = run("diagnose", tmp_path / "job", "--against", tmp_path / "none.csv", "--out", tmp_path / "out")
    assert done.returncode == 2
    assert "none.csv: no such file" in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.long
def test_an_effect_of_the_wrong_sign_is_found_twice_as_large_and_said_to_be_contained() -> None:
    wrong = table(predicted(TRUE, errors(scale_x=30.0, scale_y=-20.0, square_xy=-25.0)))
    found = cmm_uq.diagnose(job(RECORDED, wrong, effects=["squareness_xy"]))
    row = found.effects.loc["squareness_xy.angle_arcsec"]
    assert row["lower"] < 50.0 < row["upper"]
    assert any("The simulation contains it" in str(line) for line in found.outcome.summary.remarks)


@pytest.mark.long
def test_nothing_is_asserted_within_the_uncertainty_of_the_prediction() -> None:
    """The squareness left out moves a length by 48 µm at most; predictions are uncertain by 60 µm."""
    found = cmm_uq.diagnose(job(RECORDED, WITHOUT_SQUARENESS, u_um=60.0))
    assert found.verdict == "consistent"
    assert found.diagnosis["noise"]["coordinate_um"]["value"] >= 60.0


@pytest.mark.long
def test_what_it_contains_can_be_estimated_anew_as_corrections() -> None:
    """The simulation has a scale of 20 ppm, the machine one of 30."""
    near = table(predicted(TRUE, errors(scale_x=20.0, scale_y=-20.0, square_xy=25.0)))
    found = cmm_uq.diagnose(job(RECORDED, near, effects=["scale_x", "squareness_xy"], refit=True))
    anew = found.diagnosis["simulation"]["refitted"]
    low, high = anew["scale_x"]["ppm"]["interval95"]
    assert low < 10.0 < high
    assert low > 0
    low, high = anew["squareness_xy"]["angle_arcsec"]["interval95"]
    assert low < 0.0 < high
    assert found.verdict == "consistent"


# ---- what is compared


def test_the_difference_has_the_noise_of_the_recording_alone() -> None:
    """A noise of 1 µm; 23 degrees of freedom leave 0.74 to 1.30 µm with 95 %: here with 99.9 %."""
    assert 0.55 < scatter_um(compared(job(RECORDED, COMPLETE))) < 1.55
    assert scatter_um(compared(job(RECORDED, WITHOUT_SQUARENESS))) > 5


@pytest.mark.parametrize("change", [
    lambda t: t.sample(frac=1.0, random_state=3),
    lambda t: pd.concat([t, t.tail(2).assign(measurement=99)]),
    lambda t: t.assign(further=1.0),
    lambda t: t.assign(repeat=1),
], ids=["other order", "further rows", "further columns", "repeats numbered"])  # fmt: skip
def test_order_and_what_is_beside_change_nothing(change: object) -> None:
    usual = squareness(compared(job(RECORDED, WITHOUT_SQUARENESS)))
    assert callable(change)
    assert squareness(compared(job(RECORDED, change(WITHOUT_SQUARENESS)))) == pytest.approx(usual, rel=1e-9)


def test_rows_that_no_point_has_are_said() -> None:
    more = pd.concat([COMPLETE, COMPLETE.tail(2).assign(measurement=99)])
    told = [finding.why for finding in compared(job(RECORDED, more)).findings]
    assert any("2 rows of the prediction are of no point" in why for why in told)


def test_predicted_lengths_say_the_same_as_predicted_coordinates() -> None:
    xyz = WITHOUT_SQUARENESS[["x_mm", "y_mm", "z_mm"]].to_numpy()
    lengths = pd.DataFrame({
        "measurement": np.arange(1, len(TRUE) // 2 + 1), "length_mm": np.linalg.norm(xyz[1::2] - xyz[::2], axis=1),
    })  # fmt: skip
    one, other = (compared(job(RECORDED, prediction)) for prediction in (WITHOUT_SQUARENESS, lengths))
    assert squareness(other)[0] == pytest.approx(squareness(one)[0], abs=0.01)


def test_a_prediction_without_repeats_holds_for_every_repeat() -> None:
    again = recorded(TRUE, MACHINE, seed=5).assign(repeat=2)
    found = compared(job(pd.concat([RECORDED.assign(repeat=1), again]), COMPLETE))
    assert 0.6 < scatter_um(found) < 1.4
    assert len(found.model.artefact.noise_scale) == len(TRUE)


def test_an_artefact_of_another_length_was_simulated() -> None:
    """The bar was taken 0.3 mm too long: told so, the difference is what it would be with the bar's own length."""
    middle = 0.5 * (TRUE[::2] + TRUE[1::2])
    bars = (TRUE[1::2] - TRUE[::2]) * (1 + 0.3 / LENGTH)
    longer = np.stack([middle - 0.5 * bars, middle + 0.5 * bars], axis=1).reshape(-1, 3)
    prediction = table(shown(longer, MACHINE))
    told = compared(job(RECORDED, prediction, length_mm=LENGTH + 0.3))
    assert 0.55 < scatter_um(told) < 1.55
    assert np.abs(told.model.artefact.lengths() - LENGTH).max() < 0.005
    assert np.abs(compared(job(RECORDED, prediction)).model.artefact.lengths() - (LENGTH - 0.3)).max() < 0.005


# ---- uncertainty of the prediction


def test_the_noise_is_no_less_than_the_prediction_is_known() -> None:
    assert compared(job(RECORDED, COMPLETE, u_um=3.0)).model.least_noise == pytest.approx(3e-3)
    assert compared(job(RECORDED, COMPLETE)).model.least_noise < 1e-6


def test_repeats_do_not_average_the_prediction() -> None:
    twice = pd.concat([RECORDED.assign(repeat=1), recorded(TRUE, MACHINE, seed=5).assign(repeat=2)])
    assert compared(job(twice, COMPLETE, u_um=3.0)).model.least_noise == pytest.approx(3e-3 * np.sqrt(2))


def test_points_predicted_badly_count_little() -> None:
    """Half of the bars are predicted with 1 mm/m of a scale that is not there, and said to be uncertain by 100 µm."""
    bad = np.arange(len(TRUE)) // 2 % 2 == 1
    xyz = predicted(TRUE, MACHINE)
    xyz[bad] = predicted(TRUE, errors(scale_x=300.0, scale_y=-20.0, square_xy=-100.0))[bad]
    plain = squareness(compared(job(RECORDED, table(xyz))))
    weighed = squareness(compared(job(RECORDED, table(xyz, u_um=np.where(bad, 100.0, 0.1)))))
    assert abs(plain[0]) > 20
    assert abs(weighed[0]) < 3 * weighed[1]
    assert abs(weighed[0]) < 3


def turned_bars(by_mm: float, seed: int = 11) -> pd.DataFrame:
    """The complete prediction of bars whose ends were taken to lie up to so many millimetres elsewhere, each of its own."""
    other = TRUE + by_mm * np.random.default_rng(seed).uniform(-1, 1, TRUE.shape)
    step = other[1::2] - other[::2]
    bars = LENGTH * step / np.linalg.norm(step, axis=1, keepdims=True)
    middle = 0.5 * (other[::2] + other[1::2])
    return table(shown(np.stack([middle - 0.5 * bars, middle + 0.5 * bars], axis=1).reshape(-1, 3), MACHINE))


def test_a_bar_predicted_in_another_direction_is_predicted_worse() -> None:
    """Squareness and scales of 121 µm/m and 50 µm/m, bars turned by up to 10 mm at each end: up to 2 µm or so a length."""
    found, complete = compared(job(RECORDED, turned_bars(10.0))), compared(job(RECORDED, COMPLETE))
    one, other = found.model.artefact.lengths(), complete.model.artefact.lengths()
    assert one is not None
    assert other is not None
    seen = 1e3 * np.abs(one - other)
    assert 0.5 < found.simulated.u_turned_um < 5
    assert np.sqrt(np.mean(seen**2)) < 2 * np.sqrt(2) * found.simulated.u_turned_um
    assert compared(job(RECORDED, COMPLETE)).simulated.u_turned_um < 1e-3
    assert "counts as a standard uncertainty" in found.findings[-1].why


def test_a_common_uncertainty_is_one_of_the_artefacts_size() -> None:
    size = compared(job(RECORDED, COMPLETE, u_common_um=0.4)).model.artefact.sizes[0]
    assert size.sd == pytest.approx(0.5e-3)


def test_a_stated_noise_is_that_of_both() -> None:
    of = cmm_uq.job(
        RECORDED, machine="M", artefact={"kind": "ballbar", "length_mm": LENGTH, "u_um": 0.3}, effects=[],
        recording={"u_coordinate_um": 4.0}, files={"p.csv": COMPLETE}, simulation={"file": "p.csv", "u_um": 3.0},
    )  # fmt: skip
    assert compared(of).stated_um == pytest.approx(5.0)


# ---- frames


def turned(table_: pd.DataFrame, turn: np.ndarray, shift: np.ndarray) -> pd.DataFrame:
    xyz = table_[["x_mm", "y_mm", "z_mm"]].to_numpy() @ turn.T + shift
    return table_.assign(x_mm=xyz[:, 0], y_mm=xyz[:, 1], z_mm=xyz[:, 2])


def test_another_frame_of_all_points_is_taken_out_and_said() -> None:
    a = np.radians(30.0)
    turn = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    found = compared(job(RECORDED, turned(WITHOUT_SQUARENESS, turn, np.array([500.0, 0, -80]))))
    assert squareness(found)[0] == pytest.approx(squareness(compared(job(RECORDED, WITHOUT_SQUARENESS)))[0], abs=0.05)
    assert found.simulated.turn_deg == pytest.approx(30.0, abs=0.2)
    assert "turned by 30" in found.findings[-2].why


def test_another_origin_is_a_shift_alone() -> None:
    found = compared(job(RECORDED, turned(COMPLETE, np.eye(3), np.array([805.0, 303, -294]))))
    assert found.simulated.turn_deg == 0
    assert found.simulated.shift_mm == pytest.approx((-805, -303, 294), abs=1)


def test_a_mirrored_frame_is_refused() -> None:
    assert "mirrored" in refused(RECORDED, COMPLETE.assign(z_mm=-COMPLETE.z_mm)).problem
    exchanged = COMPLETE.assign(x_mm=COMPLETE.y_mm, y_mm=COMPLETE.x_mm)
    assert "or two are exchanged" in refused(RECORDED, exchanged).problem


def test_an_exchanged_measurement_is_refused_with_its_line() -> None:
    exchanged = COMPLETE.assign(measurement=COMPLETE.measurement.replace({3: 4, 4: 3}))
    error = refused(RECORDED, exchanged)
    assert "measurement" in error.problem
    assert "mm from where it was recorded" in error.problem
    assert "line" in (error.where or "")


# ---- what is no prediction


def stretched(prediction: pd.DataFrame, by_mm: float) -> pd.DataFrame:
    """The first ball of the third bar moved away from the other."""
    xyz = prediction[["x_mm", "y_mm", "z_mm"]].to_numpy().copy()
    xyz[4] -= by_mm * (xyz[5] - xyz[4]) / np.linalg.norm(xyz[5] - xyz[4])
    return table(xyz)


@pytest.mark.parametrize(("change", "problem", "where"), [
    (lambda t: t[t.measurement != 5], "measurement 5, point 1", "predicted.csv"),
    (lambda t: t.drop(columns="z_mm"), "no column 'z_mm'", "predicted.csv line 1"),
    (lambda t: t.assign(y_mm=t.y_mm.where(t.index != 4, np.nan)), "no value", "predicted.csv line 6, column y_mm"),
    (lambda t: t.assign(y_mm=t.y_mm.astype(object).where(t.index != 4, "NaN")), "not a finite number", "line 6"),
    (lambda t: pd.concat([t, t.head(1)]), "is predicted twice", "lines 2 and 50"),
    (lambda t: t.assign(x_mm=t.x_mm / 25.4, y_mm=t.y_mm / 25.4, z_mm=t.z_mm / 25.4), "look like inches", "predicted"),
    (lambda t: t.assign(x_mm=t.x_mm / 1e3, y_mm=t.y_mm / 1e3, z_mm=t.z_mm / 1e3), "look like metres", "predicted"),
    (lambda t: t.assign(u_um=-1.0), "no standard uncertainty", "line 2, column u_um"),
    (lambda t: t.assign(point=1.5), "not a whole number", "line 2, column point"),
    (lambda t: stretched(t, 20.0), "off the artefact", "predicted.csv line"),
    (lambda t: t.assign(length_mm=1.0), "coordinates and lengths", "line 1"),
    (lambda t: t.assign(axis="x", position_mm=0.0), "is an error map", "line 1"),
    (lambda t: t.head(0), "has no rows", "predicted.csv"),
], ids=["a measurement lacks", "a column lacks", "an empty cell", "nan", "twice", "inches", "metres", "negative u",
        "half a point", "one point off", "both", "a map", "empty"])  # fmt: skip
def test_what_is_wrong_with_a_prediction_is_said_with_its_place(change: object, problem: str, where: str) -> None:
    assert callable(change)
    error = refused(RECORDED, change(COMPLETE))
    assert problem in error.problem
    assert where in (error.where or "")
    assert error.fix


def test_the_recording_itself_is_no_prediction() -> None:
    assert "copy" in refused(RECORDED, RECORDED).problem


def test_a_simulated_recording_may_be_predicted_exactly() -> None:
    """Computed figures against computed figures: no fault, and it is said."""
    exact = table(shown(TRUE, MACHINE))
    of = job(exact, exact)
    of = replace(of, facts=of.facts.model_copy(update={"job": of.facts.job.model_copy(update={"origin": "simulated"})}))
    found = compared(of)
    assert any("differ by no noise at all" in finding.why for finding in found.findings)
    lengths = found.model.artefact.lengths()
    assert lengths is not None
    assert np.abs(lengths - LENGTH).max() < 1e-6
    assert cmm_uq.diagnose(of).verdict == "consistent"


def warm_recording() -> pd.DataFrame:
    """The bar recorded at 25 °C: 400 mm of steel are 23 µm longer."""
    middle = np.repeat(0.5 * (TRUE[::2] + TRUE[1::2]), 2, axis=0)
    points = recorded(middle + (1 + 11.5e-6 * 5) * (TRUE - middle), MACHINE)
    return points.assign(temp_artefact_c=25.0)


@pytest.mark.parametrize(("simulated", "of_bar", "off_um"), [
    ({}, {"cte_per_k": 11.5e-6}, 23.0), ({"temperature_c": 20.0}, {"cte_per_k": 11.5e-6}, 0.0),
    ({"cte_per_k": 0.0}, {"cte_per_k": 11.5e-6}, 0.0), ({"temperature_c": 22.0}, {"cte_per_k": 11.5e-6}, 9.2),
    ({"temperature_c": 25.0, "cte_per_k": 11.5e-6}, {}, 0.0), ({"cte_per_k": 11.5e-6}, {}, 0.0),
])  # fmt: skip
def test_a_bar_simulated_at_another_temperature_is_as_long_as_it_was_taken(
    simulated: dict[str, float], of_bar: dict[str, float], off_um: float
) -> None:
    """Simulated at 20 °C, or of a bar that the job takes for no steel; the difference is that of its lengths."""
    warm = warm_recording()
    prediction = COMPLETE
    if not of_bar:  # the simulation took it warm, the job knows of no expansion: it is 23 µm longer in both
        middle = np.repeat(0.5 * (TRUE[::2] + TRUE[1::2]), 2, axis=0)
        prediction = table(shown(middle + (1 + 11.5e-6 * 5) * (TRUE - middle), MACHINE))
        warm = recorded(TRUE, MACHINE).assign(temp_artefact_c=25.0)
    of = cmm_uq.job(
        warm, machine={"name": "M", "travel_mm": {"x": [0, 900], "y": [0, 550], "z": [0, 500]}},
        artefact={"kind": "ballbar", "length_mm": LENGTH, "u_um": 0.3, **of_bar}, effects=[],
        files={"p.csv": prediction}, simulation={"file": "p.csv", **simulated},
    )  # fmt: skip
    lengths = compared(of).model.artefact.lengths()
    assert lengths is not None
    assert 1e3 * abs(float(np.mean(lengths)) - LENGTH) == pytest.approx(off_um, abs=1.0)


@pytest.mark.parametrize(("simulation", "problem"), [
    ({"temperature_c": 20.0}, "temperature_c says nothing"), ({"cte_per_k": 1e-5}, "cte_per_k says nothing"),
])  # fmt: skip
def test_a_temperature_that_nothing_follows_from_is_refused(simulation: dict[str, float], problem: str) -> None:
    assert problem in refused(RECORDED, COMPLETE, **simulation).problem


def test_a_recording_moved_as_a_whole_is_none_either() -> None:
    moved = turned(RECORDED, np.eye(3), np.array([0.5, 0.5, 0.5]))
    assert "copy" in refused(RECORDED, moved).problem


def test_a_recording_made_of_the_prediction_has_no_noise() -> None:
    """Equal but for where it stands, which differs from bar to bar."""
    moved = table(RECORDED[["x_mm", "y_mm", "z_mm"]].to_numpy() + np.repeat(np.arange(24.0)[:, None], 2, axis=0) / 10)
    error = refused(RECORDED, moved)
    assert "no noise at all" in error.problem or "copy" in error.problem


@pytest.mark.parametrize(("simulation", "problem"), [
    ({}, "give either file"), ({"file": "a.csv", "map": "b.csv"}, "give either file"), ({"file": "a", "refit": True}, "refit"),
    ({"map": "b.csv", "unit": "inch"}, "belongs to a file"), ({"file": "a.csv", "unit": "feet"}, "unit"),
    ({"file": "a.csv", "u_um": -1.0}, "u_um"), ({"map": "b.csv", "temperature_c": 20.0}, "belongs to a file"),
    ({"file": "a.csv", "cte_per_k": 11.5}, "no expansion coefficient"),
])  # fmt: skip
def test_a_table_that_says_too_little_or_too_much_is_refused(simulation: dict[str, object], problem: str) -> None:
    with pytest.raises(CmmUqError) as caught:
        cmm_uq.job(RECORDED, machine="M", artefact="ballbar", effects=[], simulation={"program": "P", **simulation})
    assert problem in str(caught.value)
    assert "simulation" in str(caught.value)


def test_columns_and_units_of_another_program_can_be_named() -> None:
    inches = COMPLETE.assign(**{a: COMPLETE[f"{a}_mm"] / 25.4 for a in "xyz"}).drop(columns=["x_mm", "y_mm", "z_mm"])
    names = {"x_mm": "x", "y_mm": "y", "z_mm": "z"}
    found = compared(job(RECORDED, inches, columns=names, unit="inch"))
    assert 0.55 < scatter_um(found) < 1.55
    assert "no column 'w'" in refused(RECORDED, inches, columns={**names, "x_mm": "w"}).problem.replace("there is ", "")


def test_what_is_simulated_or_compensated_has_no_simulation_any_more() -> None:
    drawn = cmm_uq.simulate(job(RECORDED, COMPLETE), {"seed": 1})
    assert drawn.facts.simulation is None
    assert drawn.prediction is None


# ---- every kind


@pytest.mark.parametrize("name", [
    "bryan-simulated", "digitizer-simulated", "gauge-blocks-simulated", "plane-simulated", "plate-simulated",
    "sphere-simulated", "step-gauge-simulated", "triangle-simulated",
])  # fmt: skip
def test_every_kind_is_compared_with_a_complete_prediction_down_to_its_noise(name: str) -> None:
    """Errors drawn with 1 µm of noise, and predicted without: 1 µm is left."""
    example, acting = cmm_uq.read(ROOT / "examples" / name), {"squareness_xy": {"angle_arcsec": 60.0}}
    drawn = cmm_uq.simulate(example, {"seed": 3, "effects": acting, "noise": {"coordinate_um": 1.0}})
    exact = cmm_uq.simulate(example, {"seed": 3, "effects": acting, "noise": {"coordinate_um": 0.0}}).points
    prediction = pd.DataFrame({
        "measurement": exact.measurement, "point": exact.point, "repeat": exact.repeat,
        **{f"{a}_mm": exact.xyz[:, i] for i, a in enumerate("xyz")},
    })  # fmt: skip
    assert scatter_um(compared(compared_with_frame(drawn, prediction))) == pytest.approx(1.0, abs=0.25)


# ---- maps


def test_an_error_map_predicts_by_its_displacements_at_the_recorded_places() -> None:
    """A map with the machine's two scales and no squareness: what is left is the squareness."""
    rows = [
        {"axis": axis, "position_mm": p, "dx_um": 0.0, "dy_um": 0.0, "dz_um": 0.0, "rx_arcsec": 0, "ry_arcsec": 0,
         "rz_arcsec": 0, f"d{axis}_um": 1e-3 * ppm * p}
        for axis, ppm, end in (("x", 30.0, 900), ("y", -20.0, 550), ("z", 0.0, 500)) for p in (-1.0, end + 1.0)
    ]  # fmt: skip
    of = cmm_uq.job(
        RECORDED, machine={"name": "M", "travel_mm": {"x": [0, 900], "y": [0, 550], "z": [0, 500]}},
        artefact={"kind": "ballbar", "length_mm": LENGTH, "u_um": 0.3}, effects=[],
        files={"map.csv": pd.DataFrame(rows)}, simulation={"map": "map.csv"},
    )  # fmt: skip
    found = compared(of)
    value, u = squareness(found)
    assert abs(value - 25.0) < 3 * u
    assert u < 1.0
    assert found.simulated.maps
    told = compared(compared_with_frame(job(RECORDED), pd.DataFrame(rows)))
    assert squareness(told) == pytest.approx((value, u), rel=1e-9)
    assert told.simulated.maps


def test_a_point_beyond_the_map_is_refused_with_its_line() -> None:
    short = pd.DataFrame([
        {"axis": axis, "position_mm": p, "dx_um": 0, "dy_um": 0, "dz_um": 0, "rx_arcsec": 0, "ry_arcsec": 0, "rz_arcsec": 0}
        for axis in "xyz" for p in (0.0, 300.0)
    ])  # fmt: skip
    with pytest.raises(CmmUqError) as caught:
        compared(compared_with_frame(job(RECORDED), short))
    assert "300" in str(caught.value)


def test_predictions_and_maps_of_a_self_calibration_are_refused() -> None:
    of = cmm_uq.read(ROOT / "examples" / "shift-simulated")
    with pytest.raises(CmmUqError, match=r"compared with no simulation"):
        cmm_uq.diagnose(of, against=COMPLETE)


# ---- the real recording, and a program that writes numbers its own way


def test_semicolons_decimal_commas_and_exponents_are_read(tmp_path: Path) -> None:
    """Of the example; the figures are the script's, whose equations are its own."""
    found = cmm_uq.read(ROOT / "examples" / "iota-1102-20C-against-simulation").prediction
    assert found is not None
    assert found.xyz[0] == pytest.approx(first_of_the_example(), abs=1e-6)


def first_of_the_example() -> list[float]:
    """Measurement 1, ball 1: balls at (−497, −134, 28) and (−211, 152, 26), the bar between them, less e = scale·reading."""
    one, other = np.array([-497.0, -134, 28]), np.array([-211.0, 152, 26])
    step = other - one
    true = 0.5 * (one + other) - 0.5 * 404.2357 * step / np.linalg.norm(step)
    scale, origin = np.array([0.0794 / 900, 0.0518 / 550, 0.0113 / 500]), np.array([805.0, 303, -294])
    return list((true - scale * origin) / (1 + scale))


def test_an_exponent_may_be_written_with_d() -> None:
    text = COMPLETE.assign(x_mm=[f"{x:.9E}".replace("E", "D") for x in COMPLETE.x_mm])
    assert 0.55 < scatter_um(compared(job(RECORDED, text))) < 1.55


def test_the_example_is_what_its_script_writes(tmp_path: Path) -> None:
    script = ROOT / "benchmarks" / "examples" / "ballbar_prediction.py"
    subprocess.run([sys.executable, script, tmp_path], check=True)
    kept = ROOT / "examples" / "iota-1102-20C-against-simulation" / "predicted.csv"
    assert (tmp_path / "predicted.csv").read_bytes() == kept.read_bytes()
