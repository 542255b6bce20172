"""A new job of a part reads, becomes a plan that the virtual measurement takes, and says what of it is an example."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmm_uq.analysis.machine.state import MachineState, StatedNoise
from cmm_uq.analysis.parts import plan
from cmm_uq.analysis.parts.characteristics import CharacteristicEvaluation
from cmm_uq.analysis.parts.setup import circumstances_of, forms_of, plan_of, poses_of, refuse_unfit, surroundings_of
from cmm_uq.analysis.parts.virtual import AtPose
from cmm_uq.app.commands.forms import shipped
from cmm_uq.app.commands.jobs.check import check_job
from cmm_uq.app.commands.jobs.new import write_new
from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Machine
from cmm_uq.jobs.part import feature
from cmm_uq.jobs.part.job import TABLES, read_part
from cmm_uq.maths.geometry.association import ASSOCIATIONS
from tests.jobs.part.parts import feature as probed_feature, plate
from tests.jobs.part.test_dmis import BORE, EDGE, HEAD, TOP
from tests.jobs.part.test_qif import document

TABLES_WITHIN = ("characteristic", "length_standard", "probe_standard")
LEFT_OUT = {"part": {"not_measured": ["*"]}}
PROGRAM = f"{HEAD}{TOP}{EDGE}{BORE}ENDFIL\n".encode()


def test_a_new_part_reads_and_lacks_its_machine_alone(tmp_path: Path) -> None:
    write_new("part", tmp_path / "plate", {})
    found = check_job(tmp_path / "plate")
    assert [one.problem for one in found.problems] == ["no such file"] * 2
    assert {Path(one.file).name for one in found.problems} == {"results.json", "posterior.npz"}
    assert [one.key for one in found.warnings] == ["[job] origin"]
    job = read_part(tmp_path / "plate", machine=False)
    refuse_unfit(job)
    assert len(plan_of(job).points) == 60


def test_its_examples_are_refused_once_it_says_that_it_was_measured(tmp_path: Path) -> None:
    files = write_new("part", tmp_path / "plate", {})
    text = files["job.toml"].read_text(encoding="utf-8")
    files["job.toml"].write_text(text.replace('origin = "simulated"', 'origin = "measured"'), encoding="utf-8")
    told = [one.problem for one in check_job(tmp_path / "plate").problems]
    assert "tolerance_mm is still an example's" in told
    assert "cte_per_k is still an example's" in told
    assert "name is still an example's" not in told


def test_it_has_the_lines_that_matter_and_says_where_the_rest_is(tmp_path: Path) -> None:
    """Features and characteristics take as many as they are; of all else a line is there only where it says something."""
    text = write_new("part", tmp_path / "plate", {})["job.toml"].read_text(encoding="utf-8")
    assert {"docs/reference/part.md", "cmm-uq schema part"} <= set(
        re.findall(r"docs/reference/part.md|cmm-uq schema part", text)
    )
    assert not re.findall(r"(?m)^# *\[?[a-z_]+\]? *=", text)
    assert len(text.splitlines()) < 120
    assert set(tomllib.loads(text)) < set(json.loads(shipped("part"))["properties"])


def test_it_is_no_job_of_a_machine(tmp_path: Path) -> None:
    write_new("part", tmp_path / "plate", {})
    with pytest.raises(CmmUqError, match=r"job\.toml: \[part\]: is the job of a part, not of a machine"):
        read_job(tmp_path / "plate")


def test_what_is_given_is_no_example(tmp_path: Path) -> None:
    files = write_new("part", tmp_path / "plate", {"part": {"cte_per_k": 23e-6}})
    line = next(
        line for line in files["job.toml"].read_text(encoding="utf-8").splitlines() if line.startswith("cte_per_k")
    )
    assert line.startswith("cte_per_k = 2.3e-05  # Coefficient")


@pytest.mark.parametrize("given", [{"machine": {"name": "CMM"}}, {"feature": {"name": "A"}}, {"part": {"nam": "A"}}])
def test_what_no_option_can_say_is_refused(given: Any, tmp_path: Path) -> None:
    with pytest.raises(CmmUqError):
        write_new("part", tmp_path / "plate", given)
    assert not (tmp_path / "plate").exists()


@pytest.mark.parametrize(
    ("name", "content", "points"), [("p.dmi", PROGRAM, 8), ("p.qif", document(), 12 + 24 + 12 + 24 + 1 + 12)]
)
def test_a_job_begins_from_the_plan_of_another_program(name: str, content: bytes, points: int, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    files = write_new("part", tmp_path / "plate", LEFT_OUT, drawing=tmp_path / name)
    job = read_part(tmp_path / "plate", machine=False)
    assert len(plan_of(job).points) == points
    readme = files["README.md"].read_text(encoding="utf-8")
    for left in job.facts.part.not_measured:
        assert f"`{left}`" in readme


def test_a_plan_that_is_not_understood_whole_begins_nothing(tmp_path: Path) -> None:
    (tmp_path / "p.dmi").write_bytes(PROGRAM)
    with pytest.raises(
        CmmUqError, match=r"'EDGE' is a feature that is not measured.*part\.not_measured='\[\"EDGE\"\]'"
    ):
        write_new("part", tmp_path / "plate", {}, drawing=tmp_path / "p.dmi")
    assert not (tmp_path / "plate").exists()


def test_a_feature_that_is_none_is_refused_in_words(tmp_path: Path) -> None:
    (tmp_path / "p.dmi").write_bytes(PROGRAM.replace(b",31.0,12.0", b",0.0,12.0"))
    with pytest.raises(CmmUqError, match=r"holds no tolerance.*diameter_mm: Input should be greater than 0"):
        write_new("part", tmp_path / "plate", LEFT_OUT, drawing=tmp_path / "p.dmi")


def test_lists_of_kinds_are_those_of_the_virtual_measurement() -> None:
    assert dict(feature.FEWEST) == plan.FEWEST
    assert set(feature.ASKS) == set(plan.WHATS)
    assert set(ASSOCIATIONS) == set(feature.Association.__args__)  # type: ignore[attr-defined]


KEYS: dict[str, Any] = {"point_mm": [0.0, 0.0, 0.0], "direction": [0.0, 0.0, 1.0]}
ROUND = {**KEYS, "diameter_mm": 20.0, "inner": True}
MANY = {"strategy": {"pattern": "points", "points": 12}}
NEEDS: dict[str, dict[str, Any]] = {
    "point": KEYS, "line": {**KEYS, "normal": [1.0, 0.0, 0.0], "length_mm": 20.0, **MANY},
    "plane": {**KEYS, "length_mm": 20.0, "width_mm": 20.0, **MANY}, "circle": {**ROUND, **MANY}, "sphere": {**ROUND, **MANY},
    "cylinder": {**ROUND, "length_mm": 20.0, **MANY}, "cone": {**ROUND, "length_mm": 20.0, "angle_deg": 20.0, **MANY},
}  # fmt: skip


@pytest.mark.parametrize(
    ("what", "kind", "datum"),
    [
        (what, kind, datum)
        for what, asks in feature.ASKS.items()
        for kind in asks.kinds
        for datum in (asks.datum_kinds if asks.datums else ("plane",))
    ],
)
def test_what_a_job_may_ask_the_virtual_measurement_evaluates(what: str, kind: Any, datum: Any) -> None:
    """Of every kind of feature, about every kind of datum, that the job's reader lets through."""
    asks = feature.ASKS[what]  # type: ignore[index]
    names = [f"f{i}" for i in range(asks.features)]
    one = plan_feature(kind)
    features = [plan.PartFeature(name, *one) for name in names] + [plan.PartFeature("datum", *plan_feature(datum))]
    datums = ("datum",) if asks.datums else ()
    asked = plan.PartCharacteristic("1", what, tuple(names), datums)
    CharacteristicEvaluation(asked, plan.Plan(tuple(features), (asked,), alignment=plan.PartAlignment(("datum",))), {})


def plan_feature(kind: str) -> tuple[Any, ...]:
    found = probed_feature(kind, **NEEDS[kind])
    half = 0.2 if kind == "cone" else None
    nominal = plan.Nominal(np.zeros(3), found.direction, found.facts.diameter_mm, half)
    return kind, found.points, found.normals, "stylus", nominal


def test_the_plan_says_what_the_job_says() -> None:
    job = plate(
        probing={"order": ["bore", "A", "C", "B"], "seconds_per_point": 2.0},
        characteristic=[
            {"name": "1", "what": "size", "features": ["bore"], "lower_mm": 29.9, "upper_mm": 30.2},
            {"name": "2", "what": "angle", "features": ["A", "B"], "lower_deg": 89.0, "upper_deg": 91.0},
            {"name": "3", "what": "flatness", "features": ["A"], "tolerance_mm": 0.02, "association": "minimum_zone"},
        ],
    )
    found = plan_of(job)
    np.testing.assert_array_equal(
        found.order[:24], np.arange(36, 60)
    )  # the bore's points stand last and are probed first
    assert found.times_s[36] == 0
    assert found.times_s[0] == 2 * 24
    assert found.feature("bore").internal
    assert found.feature("bore").nominal.diameter_mm == 30.0
    size, angle, flat = found.characteristics
    assert (size.lower, size.upper) == (29.9, 30.2)
    assert (angle.lower, angle.upper) == (pytest.approx(np.radians(89)), pytest.approx(np.radians(91)))
    assert (flat.lower, flat.upper, flat.association) == (None, 0.02, "minimum_zone")
    assert found.alignment.datums == ("A", "B", "C")


def test_circumstances_are_in_the_units_of_the_virtual_measurement() -> None:
    job = plate(
        placing={"origin_mm": [300.0, 450.0, -500.0], "rotation_deg": [0.0, 0.0, 90.0], "u_fixture_um": 0.5},
        negligible=None,
        environment={
            "part_c": 21.0,
            "scales_c": [20.5, 20.6, 20.7],
            "u_part_k": 0.1,
            "u_scales_k": 0.2,
            "compensated": False,
        },
        form={"field_um": 1.0, "harmonics_um": {"3": 0.5}},
    )
    (pose,) = poses_of(job, 20, Machine())
    np.testing.assert_allclose(pose.of(np.array([1.0, 0.0, 0.0])), [300, 451, -500])  # x of the part lies along y
    around = surroundings_of(job)
    assert (around.part.temperature_c, around.part.u_temperature_k, around.part.corrected) == (21.0, 0.1, False)
    assert around.part.cte_per_k == 11.5e-6
    assert [one.temperature_c for one in around.scales] == [20.5, 20.6, 20.7]
    found = {one.feature: one for one in forms_of(job)}
    assert found["bore"].harmonics_um == ((3, 0.5),)
    assert found["A"].harmonics_um == ()  # a plane has no axis to lobe about
    state = MachineState(Machine(), (), np.zeros((1, 0)))
    (clamped,) = circumstances_of(job, state, plan_of(job), 1).further
    assert np.all(clamped.size == 0.5e-3)  # type: ignore[attr-defined]


def test_noise_of_the_readings_goes_through_to_the_diameter() -> None:
    """A least-squares diameter of n points in regular sections has u = 2σ/√n, to first order exactly."""
    sigma, n, count = 1e-3, 24, 20_000
    job = plate(stylus=[{"name": "down", "diameter_mm": 4.0, "offset_mm": [0.0, 0.0, -150.0]}], environment=None, form=None,
                placing={"origin_mm": [0.0, 0.0, 0.0]}, part={"name": "plate"},
                characteristic=[TABLES["characteristic"][0]])  # fmt: skip
    found = plan_of(job)
    state = MachineState(Machine("CMM"), (), np.zeros((1, 0)), StatedNoise(np.full(3, sigma)))
    given = circumstances_of(job, state, found, 1)
    virtual = AtPose(found, given, given.poses[0])
    errors = virtual.errors(virtual.drawn(np.random.default_rng(7), count))[:, 0]
    assert errors.std() == pytest.approx(
        2 * sigma / np.sqrt(n), rel=4 / np.sqrt(2 * count)
    )  # four of its own standard errors


def test_a_whole_surface_is_probed_from_end_to_end() -> None:
    """The bore is probed 4 mm from its ends, and its form is true of all of it."""
    bore = plan_of(plate(form={"field_um": 1.0, "surface_points": 200})).feature("bore")
    assert len(bore.surface) == 200
    assert np.ptp(bore.points[:, 2]) == pytest.approx(12)
    assert np.ptp(bore.surface[:, 2]) == pytest.approx(20, rel=0.01)
    np.testing.assert_allclose(np.hypot(bore.surface[:, 0] - 60, bore.surface[:, 1] - 40), 15)
    assert np.all(np.einsum("ni,ni->n", bore.surface - [60, 40, 0], bore.surface_normals) < 0)
    assert len(plan_of(plate()).feature("bore").surface) == 0


def test_a_part_that_is_put_down_anew_each_time_lies_in_many_places() -> None:
    job = plate(placing={"origin_mm": [300.0, 450.0, -500.0], "u_origin_mm": [20.0, 20.0, 0.0]})
    places = np.array([pose.translation_mm for pose in poses_of(job, 50, Machine())])
    assert len(places) == 50
    assert np.ptp(places[:, 2]) == 0
    assert np.ptp(places[:, 0]) > 20
