"""Other methods from a part's job: figures by hand from its recordings, and what its tests lack."""

from __future__ import annotations

import datetime as dt
import io
import re
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.examples.part_methods_job import (
    BESIDE_MM,
    FOLDER as EXAMPLE,
    LARGER_MM,
    TABLES,
    files as example_files,
    made,
)
from cmm_uq.analysis.parts.methods.method import MethodResult
from cmm_uq.analysis.parts.methods.of_job import lacking, methods_of
from cmm_uq.analysis.parts.result import evaluated
from cmm_uq.analysis.parts.setup import plan_of
from cmm_uq.app.commands.jobs.check import check_job
from cmm_uq.app.commands.parts.part import PartOptions, evaluate_part
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.toml_file import as_toml
from cmm_uq.certificate.part.measurement import part_results
from cmm_uq.jobs.part.job import part_of, read_part
from tests.jobs.part.other_methods import (
    ACROSS,
    BIAS,
    CALIBRATED,
    OFF,
    ORIENTED,
    SCALE,
    SIZE,
    SPREAD,
    TIP,
    files,
    with_methods,
)
from tests.jobs.part.parts import plate
from tests.part_machines import by_results, plate_files, results_keys
from tests.result_keys import PART_RESULTS

STATE = {"certificate": "machine", "travel_mm": {"x": [0.0, 900.0], "y": [0.0, 1200.0], "z": [-600.0, 0.0]}}


def methods(**changes: Any) -> dict[str, MethodResult]:
    job = with_methods(**changes)
    plan = plan_of(job)
    return {one.method: one for one in methods_of(job, plan, evaluated(plan, plan.points))}


def test_the_calibrated_part_by_hand() -> None:
    """The part measures 30 mm; b = 3 µm; u² = u_cal² + u_p² + u_w², with the scatter of ±1 µm, n = 20."""
    found = methods()["calibrated_part"].of(SIZE)
    assert found is not None
    assert found.systematic == pytest.approx(BIAS)
    assert found.value == pytest.approx(30 - BIAS)
    assert found.u == pytest.approx(sqrt(0.4e-3**2 + SPREAD**2 * 20 / 19 + 0.3e-3**2))
    assert pytest.approx(2 * found.u) == found.U


def test_expansion_of_a_calibrated_part_is_of_its_length() -> None:
    """At 22 °C: 30 mm · 2 K · u_α, its own 1 and the part's 3 · 10⁻⁶/K."""
    part = {**plate().facts.part.model_dump(), "u_cte_per_k": 3e-6}
    table = {**CALIBRATED, "temperature_c": 22.0, "u_cte_per_k": 1e-6}
    cold, warm = methods()["calibrated_part"], methods(by_calibrated_part=table, part=part)["calibrated_part"]
    apart = warm.figures[0].u ** 2 - cold.figures[0].u ** 2
    assert apart == pytest.approx((30 * 2 * 1e-6) ** 2 + (30 * 2 * 3e-6) ** 2)


def test_several_orientations_by_hand() -> None:
    """Scale and tip are taken out by bar and ring: the bore has 30 mm, and its axis stands 40 mm from the face."""
    found = methods()["orientations"]
    bore, across = found.of(SIZE), found.of(ACROSS)
    assert bore is not None
    assert across is not None
    assert bore.value == pytest.approx(30.0, abs=1e-9)
    assert bore.systematic == pytest.approx(30 * SCALE - TIP)
    assert across.value == pytest.approx(40.0, abs=1e-9)
    assert across.systematic == pytest.approx(40 * SCALE + 0.5 * TIP)
    read = 0.5e-3 * sqrt(4 * 10 / 16) / sqrt(20)
    bar = sqrt(0.6e-3**2 + read**2) / 500
    own, ring = float(np.var(OFF, ddof=1)) / 4, 0.2e-3**2 + read**2
    # environment of the plate: u of its temperature is 0.1 K
    warmth = 0.1 * plate().facts.part.cte_per_k
    assert bore.u == pytest.approx(sqrt(own + ring + ((30 - 25) * bar) ** 2 + (30 * warmth) ** 2), rel=1e-6)
    assert across.u == pytest.approx(sqrt(own + ring / 4 + ((40 + 0.5 * 25) * bar) ** 2 + (40 * warmth) ** 2), rel=1e-6)


def test_points_give_the_same_as_their_values() -> None:
    rows = ["orientation,repeat,feature,point,x_mm,y_mm,z_mm"]
    job = plate()
    rows += [
        f"{i},{j},{one.facts.name},{k + 1},{x * (1 + 1e-5 * i)!r},{y!r},{z + 1e-4 * j!r}"
        for i in (1, 2) for j in (1, 2) for one in job.features for k, (x, y, z) in enumerate(one.points.tolist())
    ]  # fmt: skip
    by_points = plate({"turned.csv": "\n".join(rows).encode()}, by_orientations={"file": "turned.csv"})
    assert by_points.others.orientations is not None
    assert by_points.others.orientations.points is not None
    plan = plan_of(by_points)
    (found,) = methods_of(by_points, plan, None)
    table = np.array([evaluated(plan, points) for points in by_points.others.orientations.points])
    assert [one.name for one in found.figures] == [one.name for one in plan.characteristics]
    assert [one.value for one in found.figures] == pytest.approx(table.mean(axis=0))


def test_tests_that_lack_nothing_are_told_nothing_of() -> None:
    assert lacking(with_methods()) == ()
    assert lacking(plate()) == ()


@pytest.mark.parametrize(("table", "change", "words"), [
    ("by_calibrated_part", {"similar": None}, "like the part.*: not stated"),
    ("by_calibrated_part", {"same_procedure": False}, "measured as the part is.*: not met"),
    ("by_calibrated_part", {"substitution": False}, "in place of the calibrated part.*: not met"),
    ("by_calibrated_part", {"substitution": None}, "in place of the calibrated part.*: not stated"),
    ("by_calibrated_part", {"certificate": ""}, "certificate that the job names: not met"),
    ("by_orientations", {"length_standard": None}, "length standard.*: not met"),
    ("by_orientations", {"probe_standard": []}, "for the tips of down: not met"),
    ("by_orientations", {"points_varied": False}, "Other points in each orientation.*: not met"),
    ("by_orientations", {"probe_standard": [{**ORIENTED["probe_standard"][0], "certificate": ""}]},
     "Each standard has a certificate.*: not met"),
])  # fmt: skip
def test_what_a_test_lacks_is_named(table: str, change: dict[str, Any], words: str) -> None:
    given = {"by_calibrated_part": CALIBRATED, "by_orientations": ORIENTED}[table]
    changed = {key: value for key, value in {**given, **change}.items() if value is not None}
    ((named, said, fix),) = lacking(with_methods(**{table: changed}))
    assert named == table
    assert re.search(words, said)
    assert fix


def test_a_calibrated_part_in_many_places_need_not_lie_where_the_part_does() -> None:
    assert lacking(with_methods(by_calibrated_part={**CALIBRATED, "substitution": False, "place_varied": True})) == ()


def test_three_orientations_are_too_few_for_the_method_but_have_a_figure() -> None:
    rows = [row for row in files()["turned.csv"].decode().split("\n") if not row.startswith("4,")]
    job = plate({**files(), "turned.csv": "\n".join(rows).encode()}, by_orientations=ORIENTED)
    assert [said for _, said, _ in lacking(job)] == [
        "4 orientations or more, with 5 measurements or more in each: not met"
    ]
    (found,) = methods_of(job, plan_of(job), None)
    assert found.figures[0].budget.k > 3.18


def test_too_few_measurements_of_the_calibrated_part_are_refused() -> None:
    rows = files()["calibrated.csv"].decode().split("\n")[:-1]
    job = plate({"calibrated.csv": "\n".join(rows).encode()}, by_calibrated_part=CALIBRATED)
    with pytest.raises(CmmUqError, match=r"by_calibrated_part.*'1' has 19 measurements in 10 set-ups"):
        methods_of(job, plan_of(job), None)


def test_what_a_method_sees_follows_from_how_it_was_done() -> None:
    found = methods()
    assert found["calibrated_part"].seen["machine"] == "systematic"
    assert found["calibrated_part"].seen["place on the table"] == "unseen"
    assert found["orientations"].seen["stylus"] == "corrected"
    assert found["orientations"].seen["form"] == "varied"
    moved = methods(by_calibrated_part={**CALIBRATED, "place_varied": True, "qualified_anew": True})["calibrated_part"]
    assert moved.seen["place on the table"] == moved.seen["stylus"] == "varied"


@pytest.mark.long
def test_the_part_s_command_finds_them_and_check_says_what_they_lack(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By figures and draws of the machine, with few draws; what would make u smaller is not asked for."""
    monkeypatch.setattr("cmm_uq.app.commands.parts.part.ways", lambda *_, **__: [])
    job = plate_files({**by_results(), **files()}, by_calibrated_part=CALIBRATED,
                      by_orientations={**ORIENTED, "points_varied": False}, machine_state=STATE)  # fmt: skip
    found = evaluate_part(part_of(job), PartOptions(trials=1000))
    assert found.methods is not None
    assert [one.name for one in found.methods.characteristics] == [SIZE, ACROSS]
    virtual, calibrated, turned = found.methods.characteristics[0].stated
    assert virtual.u == found.stated[0].u
    assert calibrated.value is None
    assert turned.value == pytest.approx(30.0, abs=1e-9)
    results = part_results(found)["other_methods"]
    assert [one["method"] for one in results["methods"]] == ["calibrated_part", "orientations"]
    for name, content in job.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(content)
    warned = [one for one in check_job(tmp_path).warnings if one.key == "[by_orientations]"]
    assert [one.problem for one in warned] == [
        "Other points in each orientation, so that the part's form is seen: not met"
    ]


def test_a_simulated_recording_in_a_measured_job_is_refused() -> None:
    marked = {"calibrated.csv": b"# simulated by cmm-uq 1\n" + files()["calibrated.csv"]}
    with pytest.raises(CmmUqError, match=r"calibrated\.csv"):
        plate(marked, by_calibrated_part=CALIBRATED)


def example_truth() -> dict[str, float]:
    """True values of the example's part, mm."""
    bare = part_of({"job.toml": as_toml({"job": {"id": "true", "date": dt.date(2026, 3, 2), "origin": "simulated"}, **TABLES},
                                        "job.toml")}, machine=False)  # fmt: skip
    plan = plan_of(bare)
    values = evaluated(plan, made(plan, LARGER_MM, BESIDE_MM)).tolist()
    return dict(zip([one.name for one in plan.characteristics], values, strict=True))


@pytest.mark.long
def test_the_example_is_what_its_script_draws() -> None:
    """Its true values follow from how its bores are made, and stand in its remarks.

    To the last digit where no form is drawn, whose signs another library of linear algebra may choose otherwise.
    """
    drawn = example_files()
    assert {path.name for path in EXAMPLE.iterdir()} == set(drawn)
    for name, content in drawn.items():
        stored = (EXAMPLE / name).read_bytes()
        if name in ("job.toml", "bar.csv", "ring.csv"):
            assert stored == content, name
        else:
            rows, again = (np.genfromtxt(io.BytesIO(text), delimiter=",", skip_header=2) for text in (stored, content))
            np.testing.assert_allclose(rows, again, atol=0.005, err_msg=name)
    truth = example_truth()
    assert truth == pytest.approx({"1": 29.991, "2": np.hypot(70 - 0.027, 0.012), "3": 40.02, "4": 25.012}, abs=1e-9)
    told = ", ".join(f"{name}: {value:.4f} mm" for name, value in truth.items())
    assert told in read_part(EXAMPLE).facts.job.remarks


@pytest.mark.long
def test_the_example_has_all_methods_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    """With few draws; eleven of its twelve intervals hold the true value, and E_n beyond 1 tells of the twelfth."""
    monkeypatch.setattr("cmm_uq.app.commands.parts.part.ways", lambda *_, **__: [])
    assert not [one for one in check_job(EXAMPLE).warnings if one.key.startswith("[by_")]
    found, truth = evaluate_part(read_part(EXAMPLE), PartOptions(trials=1000)), example_truth()
    assert found.methods is not None
    beyond = {
        (one.name, by.method)
        for one in found.methods.characteristics for by in one.stated
        if by.value is not None and abs(by.value - truth[one.name]) > by.U
    }  # fmt: skip
    assert beyond == {("3", "calibrated_part")}
    apart = {(one.name, pair.one, pair.other) for one in found.methods.characteristics for pair in one.pairs
             if abs(pair.normalised) > 1}  # fmt: skip
    assert apart == {("3", "calibrated_part", "orientations")}
    told = {key for key in PART_RESULTS if key.startswith("other_methods.")}
    assert set(results_keys(part_results(found)["other_methods"], "other_methods")) == told


@pytest.mark.long
def test_a_position_s_systematic_error_has_the_sign_of_the_direction_that_its_part_deviates_in() -> None:
    """A bore is read 5 µm too far along x: where it is off along x its position is 10 µm too large, else as much too small."""
    job = plate()
    plan = plan_of(job)
    along, bore = np.array([1e-2, 0.0, 0.0]), plan.rows["bore"]
    place = [one.name for one in plan.characteristics].index("2")

    def position(off: Any) -> float:
        points = plan.points.copy()
        points[bore] += off
        return float(evaluated(plan, points)[place])

    found = []
    for sign in (1, -1):
        rows = ["cycle,characteristic,value_mm"]
        rows += [f"{i},2,{position(sign * along + 0.5 * along) + 1e-4 * (-1) ** i!r}" for i in range(1, 21)]
        known = {"name": "2", "value_mm": position(sign * along), "u_um": 0.1}
        own = plate({"c.csv": "\n".join(rows).encode()},
                    by_calibrated_part={**CALIBRATED, "file": "c.csv", "characteristic": [known]})  # fmt: skip
        (one,) = methods_of(own, plan_of(own), None)
        assert one.figures[0].zone
        found.append(one.figures[0].systematic)
    assert found == pytest.approx([10e-3, -10e-3], abs=1e-9)
