"""What is drawn: a function of seed and number, as strong as it says, as physics allows; faults turn with the artefact."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from cmm_uq.app.commands.prove import model_on
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import artefact_of
from cmm_uq.base.points import Floats
from cmm_uq.laboratory.proving.cases import (
    CYCLE,
    KINDS,
    NOTHING,
    OUTSIDE,
    OWN,
    STRONGEST,
    WEAKEST,
    Case,
    artefact_fault,
    nodes,
    sha256_of,
    truth_file,
)
from cmm_uq.laboratory.proving.design import Design
from cmm_uq.machine.model import Noise
from cmm_uq.machine.physics.catalogue import every
from tests.conftest import ROOT

SIGMA = 1e-3
NOISE = Noise((SIGMA, SIGMA, SIGMA))
NUMBERS = range(30)


@cache
def design(name: str) -> Design:
    """The set-ups of an example with one micrometre of noise, no error of its own, and sizes as certified."""
    job = read_job(ROOT / "examples" / name)
    model = model_on(job, job.points)
    values = np.array([unknown.prior_mean for unknown in model.unknowns])
    return Design(model, values, NOISE, job.facts.artefact.cte_per_k)


@cache
def cases(name: str, seed: int = 3) -> tuple[Case, ...]:
    return tuple(design(name).case(seed, number) for number in NUMBERS)


def strength(name: str, case: Case) -> float:
    """√λ by other means: residuals of least squares on the exact recording of a case, over white noise."""
    one, named = design(name), design(name).model
    certified = tuple(float(size.nominal) for size in named.artefact.sizes)
    points = one.recording(replace(case, noise=Noise(), sizes=certified), 0, every())
    model = replace(named, artefact=artefact_of(read_job(ROOT / "examples" / name).facts.artefact, points))
    linear, prior = model.linearised(one.values), np.array([unknown.prior_mean for unknown in model.unknowns])
    open_ = ~np.array([unknown.known for unknown in model.unknowns])
    taken = np.hstack([linear.design[:, open_], linear.freedoms.dense()]) / linear.noise_scale[:, None]
    seen = (linear.observed - linear.design @ prior) / linear.noise_scale
    residual = seen - taken @ np.linalg.lstsq(taken, seen, rcond=None)[0]
    return float(np.linalg.norm(residual)) / SIGMA


@pytest.mark.parametrize("name", ["step-gauge-simulated", "plate-simulated"])
def test_a_hidden_effect_is_as_strong_as_it_says(name: str) -> None:
    """Its exact recording, a thousandth as large so that nothing bends, fitted by least squares with what the job names."""
    single = [case for case in cases(name) if len(case.hidden) == 1 and case.noise_kind in (OWN, "white")]
    assert len(single) >= 4
    for case in single:
        (hidden,) = case.hidden
        effect = every()[hidden.effect]
        coefficients, shape = effect.from_reported(hidden.parameters)
        told = effect.to_reported(1e-3 * coefficients, np.array(shape))
        small = replace(hidden, parameters={parameter: float(value) for parameter, value in told.items()})
        assert 1e3 * strength(name, replace(case, hidden=(small,))) == pytest.approx(hidden.strength, rel=1e-3)


def test_a_stranger_is_as_strong_as_it_says() -> None:
    strange = [
        case
        for case in cases("step-gauge-simulated")
        if case.stranger is not None and case.noise_kind in (OWN, "white")
    ]
    assert {case.kind for case in strange} == {"outside", "artefact"}
    for case in strange:
        assert case.stranger is not None
        small = replace(case.stranger, size_um=1e-3 * case.stranger.size_um)
        got = 1e3 * strength("step-gauge-simulated", replace(case, stranger=small))
        assert got == pytest.approx(case.stranger.strength, rel=1e-3)
        assert WEAKEST <= case.stranger.left <= case.stranger.strength


def test_a_case_depends_on_seed_and_number_alone() -> None:
    fresh = replace(design("plate-simulated"), sights={})
    backwards = [fresh.case(3, number) for number in reversed(NUMBERS)]
    assert tuple(reversed(backwards)) == cases("plate-simulated")
    assert cases("plate-simulated", 4) != cases("plate-simulated")


def test_kinds_come_in_their_cycle_and_every_other_noise_is_the_jobs_own() -> None:
    drawn = cases("step-gauge-simulated")
    assert [case.kind for case in drawn] == list(CYCLE) * 3
    nothing = [case.noise_kind for case in drawn if case.kind == NOTHING]
    assert nothing[::2] == [OWN] * 5
    assert len(set(nothing[1::2])) == 4
    assert Counter(CYCLE) == {NOTHING: 3, "one effect": 3, "two effects": 2, "outside": 1, "artefact": 1}
    assert set(CYCLE) == set(KINDS)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**31), st.integers(0, 10_000))
def test_strengths_and_sizes_stay_within_their_limits(seed: int, number: int) -> None:
    case = design("plate-simulated").case(seed, number)
    for hidden in case.hidden:
        effect = every()[hidden.effect]
        assert WEAKEST <= hidden.strength <= STRONGEST
        coefficients, shape = effect.from_reported(hidden.parameters)
        prior = np.array([c.prior_sd for c in effect.coefficients])
        assert np.linalg.norm(coefficients / prior) <= 3 * (1 + 1e-9)
        assert all(s.low <= value <= s.high for s, value in zip(effect.shape, shape, strict=True))
    if case.kind == OUTSIDE:
        assert case.stranger is not None
        assert abs(case.stranger.size_um) <= 200


def test_the_hash_changes_with_any_truth() -> None:
    drawn = cases("plate-simulated")
    sealed = truth_file(drawn, {"seed": 3})
    assert json.loads(sealed)["cases"][1]["hidden"][0]["effect"] == drawn[1].hidden[0].effect
    (hidden, *_), others = drawn[1].hidden, drawn[2:]
    name, value = next(iter(hidden.parameters.items()))
    nudged = replace(hidden, parameters={**hidden.parameters, name: np.nextafter(value, np.inf)})
    changed = [
        truth_file((drawn[0], replace(drawn[1], hidden=(nudged,)), *others), {"seed": 3}),
        truth_file((replace(drawn[0], noise=replace(drawn[0].noise, tails=5.0)), *drawn[1:]), {"seed": 3}),
        truth_file(drawn[:-1], {"seed": 3}),
        truth_file(drawn, {"seed": 4}),
    ]
    assert len({sha256_of(content) for content in (sealed, *changed)}) == 5
    assert truth_file(drawn, {"seed": 3}) == sealed


def displaced(name: str, what: str, errors: tuple[tuple[float, ...], ...]) -> Floats:
    one = design(name)
    return -artefact_fault(one.model, one.values, what, one.cte_per_k, errors).basis(one.model.artefact.points)[:, :, 0]


def test_an_error_of_a_node_turns_with_the_artefact() -> None:
    """Of a plate in two set-ups: what moves its points changes their distances alike in both."""
    one = design("plate-simulated")
    points, xyz = one.model.artefact.points, one.model.placed(one.values)
    number, frames = nodes(xyz, points)
    assert frames.shape == (len(points), 3, 3)
    random = np.random.default_rng(1)
    errors = tuple(tuple(row) for row in random.standard_normal((number.max() + 1, 3)).tolist())
    moved = xyz + displaced("plate-simulated", "nodes", errors)
    lengths = []
    for m in np.unique(points.measurement):
        rows = np.flatnonzero(points.measurement == m)
        rows = rows[np.argsort(number[rows], kind="stable")]
        _, first = np.unique(number[rows], return_index=True)
        own = moved[rows[first]]
        lengths.append(np.linalg.norm(own[:, None] - own[None, :], axis=2))
    assert len(lengths) >= 2
    for other in lengths[1:]:
        np.testing.assert_allclose(other, lengths[0], atol=1e-6)


def test_faces_of_a_gauge_err_along_its_line() -> None:
    one = design("step-gauge-simulated")
    points, xyz = one.model.artefact.points, one.model.placed(one.values)
    number, frames = nodes(xyz, points)
    assert frames.shape == (len(points), 3, 1)
    errors = tuple((float(n),) for n in range(number.max() + 1))
    moved = displaced("step-gauge-simulated", "nodes", errors)
    np.testing.assert_allclose(np.linalg.norm(moved, axis=1), 1e-3 * number, atol=1e-12)
    for m in np.unique(points.measurement):
        rows = points.measurement == m
        assert np.linalg.matrix_rank(moved[rows], tol=1e-9) <= 1


def test_a_warm_artefact_is_longer_in_proportion() -> None:
    """Distances from the middle of a placing grow by one and the same factor; a warming one grows from nothing to that."""
    one = design("plate-simulated")
    points, xyz = one.model.artefact.points, one.model.placed(one.values)
    for what in ("warm", "warming"):
        moved, factors = displaced("plate-simulated", what, ()), []
        for m in np.unique(points.measurement):
            rows = points.measurement == m
            away = xyz[rows] - xyz[rows].mean(axis=0)
            factors.append(np.sum(moved[rows] * away) / np.sum(away**2))
            np.testing.assert_allclose(moved[rows], factors[-1] * away, atol=1e-12)
        assert factors[0] == pytest.approx(factors[-1]) if what == "warm" else factors[0] == 0 < factors[-1]
        assert np.linalg.norm(moved, axis=1).max() == pytest.approx(1e-3)


def test_the_noise_of_two_dates_is_drawn_into_one() -> None:
    """A difference of two recordings scatters by √2 as much as each; steps of the display and tails stay."""
    one = design("plate-simulated")
    case = replace(cases("plate-simulated")[0], noise=replace(NOISE, placing=2e-3, tails=5.0))
    exact = one.recording(replace(case, noise=Noise()), 3, every()).xyz
    single, both = (replace(one, dates=dates, sights={}).recording(case, 3, every()).xyz - exact for dates in (1, 2))
    np.testing.assert_allclose(both, np.sqrt(2) * single, atol=1e-12)


def test_a_coordinate_that_nobody_read_stays_as_it_stood() -> None:
    """A plate lying flat whose z is 0 throughout: noise is drawn into x and y alone."""
    job = read_job(ROOT / "examples" / "plate-simulated")
    points = job.points.select(job.points.measurement == job.points.measurement[0])
    flat = points.at(points.xyz * [1.0, 1.0, 0.0])
    model = replace(model_on(job, flat), effects=())
    assert model.artefact.unread().any()
    sizes = np.array([size.nominal for size in model.artefact.sizes])
    one = Design(model, sizes, NOISE)
    drawn = one.recording(replace(cases("plate-simulated")[0], sizes=tuple(sizes)), 3, every())
    assert not drawn.xyz[:, 2].any()
    assert np.all(np.std(drawn.xyz[:, :2] - one.model.placed(one.values)[:, :2], axis=0) > 0.5 * SIGMA)
