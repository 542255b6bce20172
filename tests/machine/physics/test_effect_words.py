"""What every effect says of itself, and that no other room knows one by its name."""

from __future__ import annotations

import ast
import pickle
import re
import subprocess
import sys
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.machine.physics.catalogue import EVERY
from cmm_uq.machine.physics.effect import CONTRACT, FURTHER, Effect, Nonparametric
from cmm_uq.machine.physics.kinematics import carried_offset
from tests.conftest import ROOT
from tests.recordings import TRAVEL
from tests.sources import calls_of, nodes_of

PACKAGE = ROOT / "cmm_uq"
TOLD = """
import pickle, sys
from pathlib import Path
points, effect = pickle.loads(Path(sys.argv[1]).read_bytes())
print(*effect.basis(points)[:, 0, 0])
"""
DEFINE = {f"machine/physics/effects/{name}.py" for name in (
    "rigid_body", "drives", "thermal", "probing", "own_errors", "own_states", "rotary", "structure",
)}  # fmt: skip
"""Modules of the effects themselves."""
BEGIN = re.compile(
    r"(jobs/beginning|artefacts/(kinds|beginnings|\w+/(kind|beginning))|machine/model/kind)\.py|jobs/beginning"
)
"""Modules of what a new job names for its reader to change, in text that any job.toml may have."""

FAMILIES = {re.sub(r"(_[abc])?(_[xyz]{1,2})*(_[12n])?$", "", name) for name in EVERY}
RECOGNISING = {"startswith", "endswith", "removeprefix", "removesuffix", "partition", "rpartition"}


@pytest.mark.parametrize("name", EVERY)
def test_an_effect_says_where_its_cause_lies_and_what_to_look_at(name: str) -> None:
    effect = EVERY[name]
    assert effect.mechanism.split()
    assert "=" in effect.formula or "longer by" in effect.formula or effect.formula.startswith("as of squareness")
    assert len(effect.points_to.split()) > 3, "a technician can act on more than a word"
    # "What it points to: … ." is the sentence around it
    assert re.match(r"[a-zX-Z]", effect.points_to)
    assert effect.points_to[-1] not in ".:;, "


def kind(effect: Effect) -> tuple[type[Effect], str | None]:
    """Its class, or its row of a table."""
    return type(effect), effect.__doc__


def test_effects_of_different_causes_point_to_different_things() -> None:
    for one, other in combinations(EVERY.values(), 2):
        if kind(one) != kind(other):
            assert one.points_to != other.points_to, (one.name, other.name)


@pytest.mark.parametrize("name", [name for name, effect in EVERY.items() if effect.tier == FURTHER])
def test_a_further_effect_points_to_its_own_axis(name: str) -> None:
    """No other effect of its class is said in the same words: each names its carriage, axes or part."""
    effect = EVERY[name]
    others = [e for e in EVERY.values() if kind(e) == kind(effect) and e is not effect]
    assert effect.points_to not in [e.points_to for e in others]
    axes = re.findall(r"_([xyz]{1,2})(?=_|$)", name)
    for axis in "".join(axes):
        assert re.search(rf"\b{axis.upper()}\b", effect.points_to), axis


@pytest.mark.parametrize(("name", "said"), [
    ("thermal_gradient", "table"), ("thermal_gradient_bridge", "bridge"), ("thermal_gradient_ram", "ram"),
])  # fmt: skip
def test_each_gradient_bends_the_part_whose_thermometers_it_needs(name: str, said: str) -> None:
    effect = EVERY[name]
    assert all(f"temp_{said}_" in column for column in effect.columns)
    assert f"the {said} bends" in effect.points_to
    assert not [part for part in {"table", "bridge", "ram"} - {said} if re.search(rf"\b{part}\b", effect.points_to)]


def test_the_bridge_is_what_carriage_y_runs_on_in_the_usual_chain() -> None:
    """Chain XYZ: X, on the table, carries Y and Z; Y, on the bridge, carries the ram Z; the ram carries its tip alone."""
    readings = np.array([[1.0, 2.0, 3.0]])
    carried = {axis: carried_offset(axis, readings)[0].tolist() for axis in "xyz"}
    assert carried == {"x": [0, 2, 3], "y": [0, 0, 3], "z": [0, 0, 0]}
    assert vars(EVERY["thermal_gradient_bridge"])["axis"] == "y"
    assert vars(EVERY["thermal_gradient_ram"])["axis"] == "z"


def test_rarer_effects_are_thought_of_a_tenth_as_readily() -> None:
    weights = {tier: {e.prior_weight for e in EVERY.values() if e.tier == tier} for tier in (CONTRACT, FURTHER)}
    assert weights == {CONTRACT: {1.0}, FURTHER: {0.1}}


def test_scales_and_squarenesses_are_what_every_machine_has_and_every_artefact_made_on_one() -> None:
    everywhere = {f"scale_{a}" for a in "xyz"} | {f"squareness_{plane}" for plane in ("xy", "yz", "zx")}
    assert {name for name, e in EVERY.items() if e.everywhere and not e.of_artefact} == everywhere
    assert {name for name, e in EVERY.items() if e.everywhere and e.of_artefact} == {
        f"artefact_{n}" for n in everywhere
    }


def test_only_straightness_rotation_hysteresis_and_drift_are_the_simplest_of_many_forms() -> None:
    over = {name: e.idealised_over for name, e in EVERY.items() if e.idealised_over and not e.of_artefact}
    axis_of = {name: "time_s" if name.startswith("drift") else name.split("_")[1] for name in over}
    assert over == axis_of
    assert {name.split("_")[0] for name in over} == {"straightness", "rotation", "hysteresis", "drift"}
    assert len(over) == 6 + 9 + 3 + 3


def test_what_an_artefact_has_like_a_machine_may_have_the_same_other_forms() -> None:
    own = {name: e.idealised_over for name, e in EVERY.items() if e.idealised_over and e.of_artefact}
    assert own == {name: EVERY[name.removeprefix("artefact_")].idealised_over for name in own}
    assert len(own) == 6 + 9


@pytest.mark.parametrize(("term", "names"), [
    (Nonparametric("x_mm", "x"), {"scale_x", "periodic_scale_x", "scale_joint_x"}),
    (Nonparametric("x_mm", "y"), {"straightness_x_y", "wear_x_y"}),
    (Nonparametric("y_mm", "x"), {"straightness_y_x", "squareness_xy", "wear_y_x"}),
    (Nonparametric("z_mm", "y"), {"straightness_z_y", "squareness_yz", "wear_z_y"}),
    (Nonparametric("z_mm", "x"), {"straightness_z_x", "squareness_zx", "wear_z_x"}),
    (Nonparametric("time_s", "z", scale=True), {"scale_z"}),
    (Nonparametric("approach_y"), {"hysteresis_y"}),
    (Nonparametric("time_s", "z"), set()),
])  # fmt: skip
def test_a_nonparametric_term_could_be_the_effects_that_have_its_form(term: Nonparametric, names: set[str]) -> None:
    assert {name for name, effect in EVERY.items() if term in effect.imitated_by} == names


@pytest.mark.parametrize(
    "name", [n for n, e in EVERY.items() if any(term.of.endswith("_mm") for term in e.imitated_by)]
)
def test_an_effect_moves_points_along_the_axis_and_by_the_reading_of_what_imitates_it(name: str) -> None:
    """Two points that differ in every other reading are moved alike, along that axis alone."""
    effect = EVERY[name]
    (term,) = (term for term in effect.imitated_by if term.of.endswith("_mm"))
    axis = "xyz".index(term.of[0])
    readings = np.array([[710.0, 420.0, -30.0], [70.0, 40.0, -450.0]])
    readings[1, axis] = readings[0, axis]
    e = displaced(effect, readings)
    np.testing.assert_array_equal(e[0], e[1])
    assert np.flatnonzero(np.any(e[0] != 0, axis=-1)).tolist() == ["xyz".index(term.along or "")]


def displaced(effect: Effect, readings: Floats) -> Floats:
    ones = np.ones(len(readings), dtype=np.int64)
    return effect.basis(
        Points(readings, ones, ones, ones, Machine("m", "XYZ", TRAVEL)), [s.high / 25 for s in effect.shape]
    )


def literals(path: Path) -> Iterator[tuple[int, str, bool]]:
    """Line and text of every string that is no docstring, parts of f-strings too, and whether it recognises by a part."""
    said = {id(node.value) for node in nodes_of(path) if isinstance(node, ast.Expr)}
    compared = {id(argument) for node in calls_of(path)
                if isinstance(node.func, ast.Attribute) and node.func.attr in RECOGNISING
                for call in node.args for argument in ast.walk(call)}  # fmt: skip
    for node in nodes_of(path):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in said:
            yield node.lineno, node.value, id(node) in compared


def known_by_name(path: Path) -> list[str]:
    """Literals of an effect's name, of the beginning of a family's names, or of a family that is recognised."""
    return [
        f"{path.name}:{line}: {text!r}"
        for line, text, compared in literals(path)
        if text in EVERY or (text.endswith("_") and text.strip("_") in FAMILIES) or (compared and text in FAMILIES)
    ]


def test_no_module_knows_an_effect_by_name_but_its_own() -> None:
    modules = {path.relative_to(PACKAGE).as_posix(): path for path in sorted(PACKAGE.rglob("*.py"))}
    others = {name: path for name, path in modules.items() if name not in DEFINE and not BEGIN.match(name)}
    assert {name: known for name, path in others.items() if (known := known_by_name(path))} == {}


@pytest.mark.parametrize("code", [
    "x = 'scale_x'", "x = {'thermal_artefact': 1}", "x = f'squareness_{plane}'", "if n.startswith('rotation'): pass",
    "x = n.removeprefix('play_')", "x = name in ('straightness_x_y',)",
])  # fmt: skip
def test_a_name_of_an_effect_would_be_found(code: str, tmp_path: Path) -> None:
    module = tmp_path / "module.py"
    module.write_text(code, encoding="utf-8")
    assert len(known_by_name(module)) == 1


def test_an_effect_goes_to_a_process_that_has_not_read_its_law(tmp_path: Path) -> None:
    ones = np.ones(2, dtype=np.int64)
    points = Points(np.array([[0.0, 0.0, 0.0], [1e6, 0.0, 0.0]]), ones, ones, ones, Machine("m", "XYZ", TRAVEL))
    (tmp_path / "asked").write_bytes(pickle.dumps((points, EVERY["scale_x"])))
    told = subprocess.run(
        [sys.executable, "-c", TOLD, tmp_path / "asked"], check=True, capture_output=True, text=True
    ).stdout
    assert told.split() == ["0.0", "1.0"]
