"""Cases of the fourth study: independent of the package, and the same physics as two others wrote it."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.fourth import forms, placings, readings
from benchmarks.fourth.cases import FAMILIES, MANY, case
from benchmarks.fourth.machine import effects
from benchmarks.second import noises
from benchmarks.second.artefacts import Placed
from benchmarks.second.cases import baseline, expanded, visible
from benchmarks.second.noises import Noise
from benchmarks.second.running import lines
from benchmarks.third import running, study
from benchmarks.third.forms import DICTIONARY
from benchmarks.third.known import further
from benchmarks.third.oracle import catalogue, searched_for
from cmm_uq.machine.physics.catalogue import EVERY
from tests.imports import packages_reached
from tests.second.test_cases import as_read

SOME = (0, 2, 5, 8, 13, 16, 19, 22, 30, 33, 45, 58)
"""Of seed 999: every kind but nothing, every design."""


def test_no_code_of_the_package_makes_a_case_or_searches_it() -> None:
    assert not {"cmm_uq", "pandas"} & packages_reached("benchmarks.fourth.cases", "benchmarks.third.oracle")


def placed_as(what: str) -> Placed:
    placed = placings.DESIGNS[what](np.random.default_rng(8))
    placed.extra["about"] = 1e6 * expanded(placed, np.full(len(placed.true), 21.0))
    return placed


@pytest.mark.parametrize("what", placings.DESIGNS)
def test_effects_are_those_of_the_other_generators(what: str) -> None:
    """All that two other writers of the same equations have; names are those of the package."""
    placed = placed_as(what)
    own = effects(placed.recorded | placed.extra)
    assert set(own) <= set(EVERY)
    shape = {"period": 77.0, "phase": 0.0, "at": 0.54, "hours": 1.3}
    context = placed.recorded | placed.extra | shape
    theirs = {name: [error] for name, error in visible(placed).items()} | further(placed.recorded)
    for name, error in own.items():
        moved = error(placed.true, context)
        # theirs are at many places, times and phases: one of these is near, and of most there is one alone
        left = min(float(np.abs(moved - each(placed.true, context)).max()) for each in theirs[name])
        near = name.startswith(("wear", "settling", "scale_settling"))
        if not name.startswith("scale_joint"):
            assert left <= (0.06 if near else 1e-12) * float(np.abs(moved).max()), name


@pytest.mark.parametrize("what", placings.DESIGNS)
def test_effects_move_observations_as_in_the_package(what: str, tmp_path: Path) -> None:
    """To 10⁻⁸ of their size, up to what the placing takes; since a plate is turned, products are compared."""
    placed = placed_as(what)
    model = as_read(placed, tmp_path / "exact")
    values = model.estimate().about
    context = placed.recorded | placed.extra | {"period": 83.0, "phase": 0.0, "at": 0.47, "hours": 20.0}
    shapes = {"periodic": (83.0,), "settling": (20.0,), "wear": (0.47,), "scale_joint": (0.47,)}
    theirs, ours = [], []
    for name, error in effects(placed.recorded | placed.extra).items():
        if not name.startswith("probe_lobing"):  # of sine and cosine
            shape = next((shape for part, shape in shapes.items() if part in name), ())
            unit = 1e-6 if name.startswith(("thermal_scale", "thermal_artefact")) else 1
            theirs.append(unit * model.seen(model.columns(EVERY[name], shape, values), values)[:, 0])
            ours.append(-placed.D @ error(placed.true, context).ravel())
    A, B = np.column_stack(theirs), np.column_stack(ours)
    size = np.where(B.any(axis=0), np.abs(B).max(axis=0), 1.0)
    if what == "plate":
        here, there = ((C / size).reshape(-1, 3, len(size)) for C in (B, A))
        np.testing.assert_allclose(there.swapaxes(1, 2) @ there, here.swapaxes(1, 2) @ here, atol=1e-8)
    else:
        assert np.abs(_without((A - B) / size, placed.free)).max() < 1e-8


def _without(columns: np.ndarray, free: np.ndarray) -> np.ndarray:
    free = free / np.linalg.norm(free, axis=0)
    return columns - free @ np.linalg.lstsq(free, columns, rcond=None)[0] if free.size else columns


@pytest.mark.parametrize("kind", noises.KINDS[:-1])
def test_readings_scatter_as_the_oracle_is_told(kind: str) -> None:
    """Whitened with the covariance that an oracle has, 400 recordings are white: every variance, and neighbours'."""
    placed = placings.axes(np.random.default_rng(5))
    few = slice(0, 40)
    for name in ("true", "measurement", "point", "repeat"):
        setattr(placed, name, getattr(placed, name)[few])
    placed.recorded = {"time_s": placed.recorded["time_s"][few]}
    of = Noise(kind, 1e-3, axis=1, times=3.0, ratio=2.0, forgets=300.0, dof=4.0)
    random = np.random.default_rng(6)
    drawn = np.array([readings.noise(random, of, placed) for _ in range(400)])
    roots = np.linalg.cholesky(noises.of_coordinates(of, placed))
    white = np.linalg.solve(roots[:, None], drawn.transpose(2, 0, 1)[..., None])[..., 0]
    within = 0.5 if kind == "tails" else 0.05
    assert np.mean(white**2, axis=(1, 2)) == pytest.approx(1, abs=within)
    assert np.mean(white[:, :, 1:] * white[:, :, :-1], axis=(1, 2)) == pytest.approx(0, abs=0.04)
    assert np.mean(white, axis=(1, 2)) == pytest.approx(0, abs=0.05)


@pytest.mark.parametrize("form", forms.DICTIONARY)
def test_a_form_of_the_dictionary_is_one_that_an_oracle_tries(form: str) -> None:
    """A grid's member is near it at sixty places; a sine is a sum of its columns."""
    random = np.random.default_rng(1)
    curve, ranges, able = forms.DICTIONARY[form]
    u = np.repeat([0.0, 0.5, 1.0], 20) if form == "sign" else np.linspace(0, 1, 60)
    where = (u, np.tile(np.linspace(0, 1, 6), 10)) if able[0] == "2" else (u,)
    for _ in range(5):
        own = curve(*where, **{name: random.uniform(*ends) for name, ends in ranges.items()})
        left = []
        for member in DICTIONARY[form].members():
            columns = np.column_stack([np.ones_like(u), *(DICTIONARY[form].value(*where, **each) for each in member)])
            left.append(np.linalg.norm(own - columns @ np.linalg.lstsq(columns, own, rcond=None)[0]))
        assert min(left) < 0.5 * np.linalg.norm(own - own.mean())


@pytest.mark.parametrize("number", SOME)
def test_readings_differ_from_the_truth_by_what_is_hidden_and_noise(number: int) -> None:
    """λ is that of generalised least squares, and what is left is as long as noise is: χ² within six deviations."""
    found = case(999, number)
    s = sum(found.sizes[name] * found.seen.column(error) for name, error in found.errors.items())
    B, C = baseline(found.seen), found.seen.covariance
    B = B[:, B.any(axis=0)] / np.linalg.norm(B[:, B.any(axis=0)], axis=0)
    weighted = np.linalg.solve(C, np.column_stack([s, B]))
    lam = s @ weighted[:, 0]
    if B.shape[1]:
        lam -= s @ weighted[:, 1:] @ np.linalg.pinv(B.T @ weighted[:, 1:], rcond=1e-12) @ weighted[:, 1:].T @ s
    assert found.one.truth["root_lambda"] == pytest.approx(np.sqrt(lam), rel=1e-5)
    if found.one.noise.kind == "tails":
        return  # whose squares scatter without bound
    left = found.seen.rest @ found.one.y - found.signal
    count = np.linalg.matrix_rank(found.seen.rest)
    assert abs(left @ left - count) < 6 * np.sqrt(2 * count) + 0.05 * lam


def test_kinds_come_as_often_as_asked_and_families_round() -> None:
    assert sum(MANY.values()) >= 400
    assert set(FAMILIES) == {max((f for f in FAMILIES if name.startswith(f)), key=len) for name in EVERY
                             if name.startswith(FAMILIES)} - {"rotary_location"}  # fmt: skip


@pytest.mark.long
def test_the_whole_catalogue_finds_what_the_second_study_has_not() -> None:
    found = next(f for i in range(400) if (f := case(999, i)).one.truth["kind"] == "catalogue"
                 and set(f.sizes) & set(further(f.one.placed.recorded)) and len(f.sizes) == 1
                 and f.one.truth["root_lambda"] > 9)  # fmt: skip
    names, tried = catalogue(found.one, whole=True)
    assert set(found.sizes) <= set(names)
    assert max(int(each.owner.max()) for each in tried) == len(names) - 1
    said = searched_for(found, 1, whole=True)
    assert {*found.sizes, *said["rivals"][next(iter(found.sizes))]} & set(said["effects"])


@pytest.mark.long
def test_jobs_are_apart_from_their_truth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, truth = tmp_path / "jobs here", tmp_path / "apart"
    said = {
        "verdict": "consistent",
        "effects": [],
        "improvement": {"heldout_rms_before_um": 1, "heldout_rms_after_um": 1},
    }
    monkeypatch.setattr(running, "diagnosed", lambda job: said)
    arguments = [
        "--generator",
        "fourth",
        "--truth",
        str(truth),
        "--seed",
        "999",
        "--count",
        "3",
        "--page",
        str(tmp_path),
    ]
    monkeypatch.setattr(sys, "argv", ["study", str(folder), *arguments, "--make"])
    study.main()
    files = {path.name for path in folder.rglob("*")} - {"predicted.csv"}
    assert files == {"jobs", "0000", "0001", "0002", "job.toml", "recording.csv"}
    assert len(lines(truth / "oracle.jsonl")) == sum(one["kind"] != "nothing" for one in lines(truth / "truths.jsonl"))
    monkeypatch.setattr(sys, "argv", ["study", str(folder), "--run"])
    study.main()
    monkeypatch.setattr(sys, "argv", ["study", str(folder), *arguments, "--tally"])
    study.main()
    assert "3 cases were diagnosed of 3 made with seed 999" in (tmp_path / "diagnosis-studies.md").read_text("utf-8")
    text = (truth / "truths.jsonl").read_text("utf-8").replace('"number": 1', '"number": 2')
    (truth / "truths.jsonl").write_text(text, encoding="utf-8")
    with pytest.raises(SystemExit, match="no longer what was sealed"):
        study.main()
