"""The simulation's own mistakes: a prediction falsified by plain equations is put right, named, and nothing else is."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from benchmarks.mistaken import BARS, FIELDS, MAP, NAMES, PLATE, Errors, mistakes_of, recorded
from cmm_uq.analysis.diagnosis.comparison.search import comparison_of
from cmm_uq.analysis.diagnosis.mistakes import Hypothesis, PredictedObservations, hypotheses
from cmm_uq.analysis.diagnosis.simulated import SimulationMistakes
from cmm_uq.app.commands.diagnose import write_diagnosis
from cmm_uq.app.commands.model import against_simulation
from cmm_uq.app.commands.reading import compared_with_frame
from cmm_uq.jobs.job import Job
from cmm_uq.machine.model.predicted_errors import SAME, PredictedErrors, tables_otherwise
from cmm_uq.machine.physics.error_map import AxisErrors, ErrorMap

MACHINE = Errors(np.array([30.0, -20.0, 12.0]), np.array([15.0, -9.0, 7.0]), np.array([8.0, 5.0]), 5.0)


@cache
def predicted(case: str, artefact: str = BARS) -> tuple[PredictedObservations, dict[str, Hypothesis]]:
    """What the model of a study's recording sees of the prediction, and every mistake by name."""
    job = recorded(case, artefact, 0)
    assert job.facts.simulation is not None
    against = against_simulation(job, job.facts.simulation)
    seen = PredictedObservations(against.model, against.model.estimate().about, against.predicted, against.of)
    return seen, {each.name: each for each in hypotheses(seen, comparison_of(against.model, None, ()))}


@cache
def found(case: str, artefact: str = BARS, seed: int = 0) -> SimulationMistakes:
    return mistakes_of(recorded(case, artefact, seed))


def named(case: str, artefact: str = BARS) -> set[str]:
    return {one.name for one in found(case, artefact).asserted}


# ---- each mistake put right


@pytest.mark.parametrize("case", [name for name in FIELDS if name not in ("not needed", "0.7 times", "map shifted")])
def test_a_map_falsified_in_one_way_is_put_right_by_the_mistake_of_that_name(case: str) -> None:
    """Indicated errors are −e; what remains beside the right prediction is rounding."""
    base, _ = predicted("nothing")
    falsify, (name,) = FIELDS[case]
    mistaken, readings = falsify(MACHINE), base.of.machine_xyz
    zero = np.zeros(len(readings))
    of_a_map = PredictedErrors(-mistaken(readings), zero, zero, SAME, 0.0, 0, at=lambda places: -mistaken(places))
    seen = PredictedObservations(base.model, base.values, of_a_map, base.of)
    by_name = {each.name: each for each in hypotheses(seen, comparison_of(base.model, None, ()))}
    right = seen.seen(-MACHINE(readings)) - seen.usual
    assert np.abs(right).max() > 1e-3
    assert by_name[name].change[:, 0] == pytest.approx(right, abs=1e-9)


@pytest.mark.parametrize("case", ["sign of X", "sign of Y and Z", "X and Y exchanged", "X from the end", "Y reversed"])
def test_lengths_predicted_by_a_file_are_put_right_by_the_field_that_they_show(case: str) -> None:
    """Beside the complete prediction of the same recording, to a fiftieth of what is wrong."""
    seen, by_name = predicted(case)
    (name,) = NAMES[case]
    random = np.random.default_rng([0, sorted(NAMES).index(case), len(BARS)])
    right = seen.seen(-Errors.drawn(random)(seen.of.machine_xyz)) - seen.usual
    left = by_name[name].change[:, 0] - right
    assert np.sqrt(np.mean(left**2)) < 0.02 * np.sqrt(np.mean(right**2))


def test_a_shift_is_put_right_at_its_value() -> None:
    seen, by_name = predicted("map shifted", MAP)
    again = by_name["shift_x"].again
    assert again is not None
    random = np.random.default_rng([0, sorted(NAMES).index("map shifted"), len(MAP)])
    machine = Errors.drawn(random)
    machine = replace(machine, roll=0.0, wave=float(random.uniform(4, 8)))
    right = seen.seen(-machine(seen.of.machine_xyz)) - seen.usual
    assert np.abs(again(np.array([60.0]))[:, 0] - right).max() < 0.1 * np.abs(right).max()  # the map has steps of 25 mm
    assert np.abs(again(np.array([-60.0]))[:, 0] - right).max() > np.abs(right).max()


def test_the_expansion_that_a_simulation_left_out_is_that_of_the_job() -> None:
    """11.5·10⁻⁶/K, 3 K and 400 mm: 13.8 µm on every length."""
    _, by_name = predicted("not warm")
    assert by_name["expansion_not_applied"].change == pytest.approx(13.8e-3, rel=1e-3)
    assert by_name["expansion_twice"].change == pytest.approx(-13.8e-3, rel=1e-3)
    again = by_name["length"].again
    assert again is not None
    assert again(np.array([-34.5])) == pytest.approx(13.8e-3, rel=1e-3)  # 34.5 ppm too short


def test_two_exchanged_set_ups_and_points_change_places_and_no_others() -> None:
    seen, by_name = predicted("set-ups exchanged")
    change, usual = by_name["set_ups_3_7"].change[:, 0], seen.usual
    assert change[2] == pytest.approx(usual[6] - usual[2])
    assert change[6] == pytest.approx(usual[2] - usual[6])
    assert np.count_nonzero(change) == 2
    seen, by_name = predicted("points exchanged", PLATE)
    change, usual = by_name["points_3_7"].change.reshape(7, 25, 3), seen.usual.reshape(7, 25, 3)
    assert change[:, 2] == pytest.approx(usual[:, 6] - usual[:, 2])
    assert not np.any(np.delete(change, (2, 6), axis=1))
    assert by_name["points_reversed"].change.reshape(7, 25, 3) == pytest.approx(usual[:, ::-1] - usual)
    only = by_name["points_reversed_in_4"].change.reshape(7, 25, 3)
    assert np.any(only[3])
    assert not np.any(np.delete(only, 3, axis=0))


def test_tables_of_a_map_have_other_signs_and_other_rows() -> None:
    seen, by_name = predicted("squareness turned", MAP)
    random = np.random.default_rng([0, sorted(NAMES).index("squareness turned"), len(MAP)])
    machine = Errors.drawn(random)
    lean = Errors(np.zeros(3), 2 * machine.square, np.zeros(2))  # the map has −S, the machine S
    right = seen.seen(-lean(seen.of.machine_xyz))
    assert by_name["squareness_sign"].change[:, 0] == pytest.approx(right, abs=2e-5)
    assert seen.found.tables["rotations_sign"][1] == pytest.approx(seen.found.errors, abs=1e-9)  # it has none


def test_each_table_otherwise_is_another_map() -> None:
    """µrad read as ″ are 4.85 times too large; straightness of X along Y is read for that of Y along X and back."""
    x, y, z = (AxisErrors(np.array([0.0, 100, 200]), np.arange(18.0).reshape(3, 6) + 100 * i) for i in range(3))
    (one,) = [ErrorMap((x, y, z), squareness=np.array([1.0, 2, 3]))]
    otherwise = {name: maps[0] for name, (_, maps) in tables_otherwise([one]).items()}
    assert otherwise["rotations_sign"].axes[1].errors == pytest.approx(y.errors * [1, 1, 1, -1, -1, -1])
    assert otherwise["rotations_unit"].axes[2].errors[:, 3:] * 4.848137 == pytest.approx(z.errors[:, 3:], rel=1e-6)
    assert otherwise["rotations_unit"].axes[2].errors[:, :3] == pytest.approx(z.errors[:, :3])
    assert otherwise["squareness_sign"].squareness == pytest.approx([-1, -2, -3])
    crossed = otherwise["crossed_xy"]
    assert crossed.axes[0].errors[:, 1] == pytest.approx(y.errors[:, 0])
    assert crossed.axes[1].errors[:, 0] == pytest.approx(x.errors[:, 1])
    assert crossed.axes[0].errors[:, [0, 2, 3, 4, 5]] == pytest.approx(x.errors[:, [0, 2, 3, 4, 5]])
    assert otherwise["crossed_xz"].axes[2].errors[:, 0] == pytest.approx(x.errors[:, 2])
    assert otherwise["crossed_yz"].axes[0].errors == pytest.approx(x.errors)


# ---- what is said


def test_of_a_right_simulation_nothing_is_said() -> None:
    said = found("nothing")
    assert said.tried > 800
    assert not said.told
    assert not said.asserted


@cache
def farthest_exchanged() -> tuple[Job, str]:
    """PredictedObservations lengths, the longest and the shortest exchanged, and the name of that."""
    job = recorded("nothing", BARS, 0)
    assert job.prediction is not None
    ends = job.prediction.xyz.reshape(-1, 2, 3)
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    one, other = sorted((int(lengths.argmin()), int(lengths.argmax())))
    lengths[[one, other]] = lengths[[other, one]]
    table = pd.DataFrame({"measurement": np.arange(1, len(lengths) + 1), "length_mm": lengths})
    return compared_with_frame(job, table), f"set_ups_{one + 1}_{other + 1}"


def test_exchanged_set_ups_are_named_though_they_are_left_out_as_outliers() -> None:
    """Lengths out of order leave no pattern: they are called noise, and these two outliers."""
    job, name = farthest_exchanged()
    said = mistakes_of(job)
    (one,) = said.named
    assert one.name == name
    assert one.rms_um < said.rms_before_um
    assert one.heldout_rms_um < said.heldout_rms_before_um
    assert one.odds_over_physics is not None
    assert one.odds_over_physics > 20


def test_a_coarse_display_is_seen_and_leaves_the_rest_of_the_noise() -> None:
    """Steps of 10 µm add 10/√12 = 2.9 µm to each predicted coordinate."""
    (one,) = found("rounded").asserted
    assert (one.name, one.value) == ("rounded", pytest.approx(10.0))
    assert "2.9" in one.remedy
    assert one.rms_um < 0.6 * found("rounded").rms_before_um


@pytest.mark.long
@pytest.mark.parametrize("case", ["sign", "sign of X", "half", "X and Y exchanged", "not warm"])
def test_a_mistake_is_named_and_leaves_the_noise(case: str) -> None:
    said = found(case)
    assert named(case) == NAMES[case]
    assert said.named[0].rms_um < 2.0 < said.rms_before_um  # 1 µm of noise in both ends of a length: 1.4


@pytest.mark.long
@pytest.mark.parametrize("case", ["a squareness more", "a bow more", "two more"])
def test_what_the_machine_has_more_is_no_mistake_of_the_simulation(case: str) -> None:
    assert not named(case)


@pytest.mark.long
def test_a_factor_is_estimated_with_its_uncertainty() -> None:
    one = found("0.7 times").named[0]
    assert one.value is not None
    assert one.u is not None
    assert abs(one.value - 0.7) < 4 * one.u < 0.2


def test_page_and_results_say_what_to_mend_before_the_machine(tmp_path: Path) -> None:
    job, name = farthest_exchanged()
    job.write(tmp_path / "job")
    files = write_diagnosis(tmp_path / "job", tmp_path / "out").files
    diagnosis = json.loads(files["results.json"].read_bytes())["diagnosis"]
    results = diagnosis["simulation_mistakes"]
    assert diagnosis["verdict"] == "explained"  # and never consistent beside a mistake
    assert results["named"] == [name]
    assert results["told"][0]["what_to_do"] == "Number the prediction as the recording."
    page = files["diagnosis.html"].read_text(encoding="utf-8")
    _, _, one, other = name.split("_")
    assert f"The simulation itself is at fault: set-ups {one} and {other} are exchanged." in page
    assert "Then compare again, before anything is done to the machine." in page


def test_an_uncertain_prediction_has_no_factor() -> None:
    """Of errors that are not exact the factor would come out too near to none."""
    seen, by_name = predicted("nothing")
    assert "factor" in by_name
    uncertain = replace(seen, found=replace(seen.found, u=np.full(len(seen.of), 5e-3)))
    assert "factor" not in {each.name for each in hypotheses(uncertain, comparison_of(seen.model, None, ()))}
