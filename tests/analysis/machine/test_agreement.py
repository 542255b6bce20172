"""Figures of one machine, held against each other: by machines without noise that share no code, and by hand."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import scipy

from benchmarks.parts import agreement as study, machines, truth
from cmm_uq.analysis.machine import agreement as room
from cmm_uq.analysis.machine.agreement import Agreement, Figures, RecordedDraws, held_together
from cmm_uq.analysis.machine.conditional import RecordedField, white
from cmm_uq.analysis.machine.correction import FieldMap, field_map
from cmm_uq.analysis.machine.performance import MachinePerformance, rows_of
from cmm_uq.analysis.machine.regions import DrawnErrors, FactorRegions, other_errors
from cmm_uq.analysis.machine.state import StatedNoise
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.base.points import Floats
from cmm_uq.base.units import unit
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.machine.physics.compensation import Compensation
from cmm_uq.machine.physics.map_interpolation import ErrorMaps
from cmm_uq.maths.inference.family_sizes import sample_sizes
from cmm_uq.maths.inference.linear_model import solve
from cmm_uq.maths.inference.noise import Sizes
from cmm_uq.maths.inference.posterior import Cause, Doubt
from tests.analysis.machine.test_performance import three_bars
from tests.analysis.machine.test_regions import observe
from tests.artefacts.simulated import analysed

NO_DOUBT, DRAWS = Doubt(()), 3
TURNS = {"rotation_x_z": (0, 2, 9.0), "rotation_y_x": (1, 0, -14.0), "rotation_z_y": (2, 1, 11.0)}
SCALES, SQUARES = (30.0, -20.0, 45.0), (12.0, -8.0, 17.0)


def agreement(job: str) -> Agreement:
    found = analysed(job).regions
    assert isinstance(found, FactorRegions)
    return found.agreement


def pair(kind: room.Kind, stated: float, together: float, u: float = 1.0) -> Figures:
    one = np.ones(1)
    return Figures(kind, [("scale_x", "ppm")], [unit("ppm")], stated * one, u * one, together * one, u * one)


@pytest.mark.parametrize(("off", "denied"), [(4.9, False), (4.95, True)])
def test_figures_disagree_beyond_their_joint_uncertainty(off: float, denied: bool) -> None:
    """Two figures, 1 ppm each by either way: Φ⁻¹(1 − 0.001/4) = 3.4808, times √2 is 4.923."""
    found = held_together([pair("factor", 0.0, off), pair("line", 0.0, 1.0)])
    assert found.counts == {"factor": 1, "line": 1}
    assert found.pairs[0].ratio == pytest.approx(off / 4.9226, rel=1e-4)
    assert found.factors == ((("scale_x", "ppm"),) if denied else ())


def test_what_nobody_knows_better_agrees_with_everything_and_what_has_no_uncertainty_with_itself() -> None:
    assert held_together([pair("factor", 0.0, 1e3, np.inf)]).largest == 0.0
    assert held_together([pair("factor", 2.0, 2.0, 0.0)]).largest == 0.0
    assert held_together([pair("factor", 2.0, 3.0, 0.0)]).largest == np.inf
    assert held_together([]).largest == 0.0


def noise() -> Sizes:
    none = np.zeros(DRAWS)
    return Sizes(np.full((DRAWS, 3), 1e-3), none, none, none, none + 1)


def known(artefact: str) -> tuple[Artefact, RecordedDraws]:
    """A machine of six errors and three rotations, read without noise, and draws that know it exactly."""
    hidden = truth.Truth.of_six(dict(zip(truth.SIX, (*SCALES, *SQUARES), strict=True)))
    turn = np.zeros((3, 3))
    for a, b, size in TURNS.values():
        turn[a, b] = size
    random = np.random.default_rng(4)
    made = machines.calibrated(machines.Cell(artefact, "stated", 0.0), replace(hidden, turn=turn), 0.0, 0.0, random)
    model = RecordingModel(made, machines.NAMED, 1e-3)
    own, further = (
        np.tile([*SCALES, *SQUARES], (DRAWS, 1)),
        np.tile([size for _, _, size in TURNS.values()], (DRAWS, 1)),
    )
    return made, RecordedDraws(model, np.arange(6), own, effects(list(TURNS)), further, noise(), 1e-3)


def test_slopes_of_lines_are_those_of_the_machine_that_was_read() -> None:
    """Truth, kinematics and readings without the package; slopes of the deviations by a fit of a straight line. Rotations make
    up to 10 µm/m of them, in either sense; the gauge itself is off by 0.5 ppm (standard deviation)."""
    made, drawn = known("step gauge")
    found, without = drawn.slopes(NO_DOUBT), replace(drawn, further=0 * drawn.further).slopes(NO_DOUBT)
    gauge = made.deviations()  # type: ignore[attr-defined]
    fitted = [
        1e6 * np.polyfit(made.reference[own], gauge[own], 1)[0]  # type: ignore[attr-defined]
        for own in (made.measurement == number for number in found.of)
    ]
    np.testing.assert_allclose(found.stated, fitted, atol=0.01)
    np.testing.assert_allclose(found.together, fitted, atol=1.0)
    assert np.abs(without.together - fitted).max() > 8
    assert np.abs(found.stated).min() > 2


def test_factors_over_the_set_ups_are_what_least_squares_find_of_that_machine() -> None:
    _, drawn = known("step gauge")
    fitted = drawn.model.estimate().least_squares.value[:6]
    np.testing.assert_allclose(drawn.factors[0], fitted, atol=0.6)
    assert np.abs(drawn.own[0] - fitted).max() > 3


def test_a_slope_is_as_uncertain_as_noise_and_gauge_are() -> None:
    """Six faces, 1 µm each: σ/√Σ(x − x̄)²; 0.4 µm of the gauge in 800 mm are 0.5 µm/m; 0.2 K of it 2.3 µm/m more."""
    made, drawn = known("step gauge")
    reference = made.reference  # type: ignore[attr-defined]
    for i, number in enumerate(drawn.slopes(NO_DOUBT).of):
        own = made.measurement == number
        about = reference[own] - reference[own].mean()
        u = np.hypot(1e3 / np.sqrt(about @ about), 0.5)
        assert drawn.slopes(NO_DOUBT).u[i] == pytest.approx(u, rel=1e-3)
        warmer = Cause(unit("K"), 2.3e-6 * reference[:, None])
        assert drawn.slopes(Doubt((), (warmer,))).u[i] == pytest.approx(np.hypot(u, 2.3), rel=1e-3)


def test_of_a_bar_that_nobody_certified_lengths_are_held_against_each_other() -> None:
    """Whatever is added to all bars: slopes as read and as drawn are less what a common length would make."""
    made, drawn = known("free bars")
    found = drawn.slopes(NO_DOUBT)
    np.testing.assert_allclose(found.stated, found.together, atol=1.0)
    assert abs(found.stated.mean()) < 1e-6 < 10 < np.ptp(found.stated)
    moved = copy(made)
    ends = made.points.xyz.reshape(-1, 2, 3)
    along = np.diff(ends, axis=1) / np.linalg.norm(np.diff(ends, axis=1), axis=2, keepdims=True)
    longer = np.concatenate([ends[:, :1], ends[:, 1:] + 0.05 * along], axis=1).reshape(-1, 3)
    moved.points = replace(made.points, xyz=longer)
    again = replace(drawn, model=replace(drawn.model, artefact=moved)).slopes(NO_DOUBT)
    np.testing.assert_allclose(again.stated, found.stated, atol=0.5)


def bars(errors_um: Floats, expected_um: Floats) -> tuple[MachinePerformance, RecordingModel]:
    """Three bars of 300 mm, read with these errors, of a machine of which these are expected."""
    made = three_bars().artefact
    ends = made.points.xyz.reshape(-1, 2, 3).copy()
    along = np.diff(ends, axis=1)[:, 0] / 300.0
    ends[:, 1] += 1e-3 * errors_um[:, None] * along
    facts = ArtefactFacts(kind="ballbar", length_mm=300.0, u_um=0.5)
    bar = Ballbar(facts, replace(made.points, xyz=ends.reshape(-1, 3)))
    found = MachinePerformance(bar.points, bar.rows, np.tile(expected_um, (50, 1)), errors_um, of_bar=True)
    return found, RecordingModel(bar, ())


def test_errors_of_lengths_are_held_against_what_figures_without_noise_are_of() -> None:
    """By hand: 1 µm of either end along X, 2 along Y, 3 along Z, 0.5 of the bar, u = √(2·1 + 0.25) = 1.5, √8.25, √18.25 µm; a
    doubt of 5 ppm adds 1.5 µm in 300 mm."""
    performance, model = bars(np.array([1.0, 2.0, 9.0]), np.array([1.0, 0.0, -4.0]))
    stated = StatedNoise(1e-3 * np.array([1.0, 2.0, 3.0]))
    found = room.of_lengths(performance, model, stated, NO_DOUBT)
    np.testing.assert_allclose(found.stated, [1, 2, 9], atol=1e-6)
    np.testing.assert_allclose(found.together, [1, 0, -4], atol=1e-6)
    np.testing.assert_allclose(found.u, np.sqrt([2.25, 8.25, 18.25]), rtol=1e-6)
    assert found.of == [1, 2, 3]
    warmer = Doubt((), (Cause(unit("K"), 5e-6 * np.full((3, 1), 300.0)),))
    np.testing.assert_allclose(
        room.of_lengths(performance, model, stated, warmer).u, np.sqrt([4.5, 10.5, 20.5]), rtol=1e-4
    )


def test_a_reading_that_was_left_out_is_held_against_nothing() -> None:
    performance, model = bars(np.array([1.0, 2.0, 900.0]), np.zeros(3))
    left = replace(model, used=np.array([True, True, False]))
    assert room.of_lengths(performance, left, StatedNoise(np.full(3, 1e-3)), NO_DOUBT).of == [1, 2]


def test_of_lengths_that_nobody_certified_differences_are_held() -> None:
    performance, model = bars(np.array([1.0, 2.0, 9.0]), np.array([-3.0, -2.0, 5.0]))
    found = room.of_lengths(replace(performance, recorded=None), model, StatedNoise(np.full(3, 1e-3)), NO_DOUBT)
    np.testing.assert_allclose(found.stated, [-3, -2, 5], atol=1e-6)
    np.testing.assert_allclose(found.together, [-3, -2, 5], atol=1e-6)


@pytest.mark.parametrize("job", ["iota-1102-20C", "step-gauge-simulated", "optical-ballbar-simulated"])
def test_examples_agree_with_themselves(job: str) -> None:
    found = agreement(job)
    assert not found.disagree
    assert found.counts["length"] >= 19
    assert found.counts["factor"] >= 6
    assert 0 < found.largest < 1


def test_of_balls_that_were_scanned_lengths_are_expected_as_they_are_read() -> None:
    """They lie beside the readings of the carriages: errors of the distances of these are others, by up to 150 µm."""
    result = analysed("optical-ballbar-simulated")
    found, rows = result.regions, rows_of(result.artefact)
    assert isinstance(found, FactorRegions)
    assert found.performance is not None
    assert rows is not None
    lengths = result.artefact.lengths()
    assert lengths is not None
    read = 1e3 * (lengths - 404.235)
    np.testing.assert_allclose(found.performance.errors.mean(axis=0), read, atol=30.0)
    assert np.ptp(read) > 450


def drawn_of(job: str) -> DrawnErrors:
    result = analysed(job)
    return DrawnErrors.of(result.model, result.doubt, partial(observe, result), 0)


@pytest.mark.long(but="iota")
@pytest.mark.parametrize("job", ["iota-1102-20C", "step-gauge-simulated"])
def test_an_error_map_and_a_certificate_are_of_the_same_draws(job: str) -> None:
    """Lengths corrected by the map differ from those read by what the draws expect of them: signs, places, and means."""
    result, drawn = analysed(job), drawn_of(job)
    found: FieldMap = field_map(result.model, result.posterior, result.doubt, partial(observe, result), 0)
    artefact, rows = result.artefact, rows_of(result.artefact)
    assert rows is not None
    machine = artefact.points.machine
    compensation = Compensation(ErrorMaps([found.error_map]), machine.chain, machine.origin_mm)
    corrected, _ = compensation.compensate(artefact.points.xyz)
    shown, true = (np.linalg.norm(np.diff(xyz[rows], axis=1)[:, 0], axis=1) for xyz in (artefact.points.xyz, corrected))
    expected = drawn.of_lengths(result.model, rows, drawn.own, drawn.further).mean(axis=0)
    off = (shown - true) - expected
    assert np.sqrt(np.mean(off**2)) < 0.1 * np.sqrt(np.mean(expected**2))


def test_a_machine_of_the_stated_priors_is_drawn_as_the_page_has_them() -> None:
    """Root mean square over the travel of a function whose family has the size one: 20, 50 µm and 30″, of 4000 each."""
    random, at = np.random.default_rng(2), np.linspace(0.0, 900.0, 400)
    for most, forms in ((20.0, 1), (50.0, 1), (30.0, 2)):
        each = [study.function(0, most, (1.0, 1.0), forms, random)(at) for _ in range(4000)]
        assert np.sqrt(np.mean(np.square(each))) == pytest.approx(most, rel=0.03)


@pytest.mark.parametrize("wrong", ["nothing", "sign of the lengths to be expected"])
@pytest.mark.parametrize("artefact", ["bars", "step gauge"])
def test_a_machine_of_the_priors_agrees_and_a_wrong_sign_does_not(artefact: str, wrong: str) -> None:
    record = study.measured((study.Cell(0, artefact, "white", wrong), 1, 0))
    assert (max(record["ratios"].values()) > 1) == (wrong != "nothing")


@pytest.mark.long(but="bars")
@pytest.mark.parametrize("artefact", ["bars", "step gauge"])
def test_slopes_by_the_draws_are_those_of_whole_matrices(artefact: str) -> None:
    """A recording drawn from the linear model, its noise known: sizes drawn from their priors and weighed, and whole
    covariances, beside the draws of the package. Means agree to a fifth of u; a sign would move them by twenty."""
    of, random = study.dense(artefact, 1), np.random.default_rng(8)
    n = of.root[11] @ random.standard_normal(of.root.shape[1])
    seen = of.inverse @ n
    logs = -0.5 * seen @ n - np.log(np.diagonal(of.root, axis1=1, axis2=2)).sum(axis=1)
    weight = np.exp(logs - logs.max()) / np.exp(logs - logs.max()).sum()
    lines = [i for i, kind in enumerate(of.kinds) if kind == "line"]
    figures = of.figures[lines]
    expected = 1e6 * (figures @ n - figures @ of.own @ (weight @ seen))

    none = truth.Truth.of_six(dict.fromkeys(truth.SIX, 0.0))
    cell = machines.Cell(artefact, "stated", 0.0)
    made = machines.calibrated(cell, none, 0.0, 0.0, np.random.default_rng([1, 17]))
    model = RecordingModel(made, machines.NAMED, study.NOISE_MM)
    estimate = model.estimate()
    placing = estimate.linear.freedoms.dense()
    N = scipy.linalg.null_space(placing.T) if placing.size else np.eye(len(placing))
    known, prior = estimate.linear.design[:, 6:], estimate.linear.prior_mean[6:]
    linear = replace(estimate.linear, observed=N @ n + known @ prior)
    found, sigma = solve(linear), white(study.NOISE_MM)
    model.__dict__["_estimate"] = replace(estimate, least_squares=found, linear=linear)
    whole = RecordedField.of(model, other_errors(model))
    field = replace(whole, field=replace(whole.field, linear=linear, estimate=found))
    sizes = sample_sizes(field.field, 4000, 1, sigma)
    drawn = field.coefficients(sizes.noise, sizes.families, random)
    own, further = np.split(drawn, [field.modelled], axis=1)
    slopes = RecordedDraws(model, np.arange(6), own, field.effects, further, sizes.noise, study.NOISE_MM).slopes(
        NO_DOUBT
    )
    np.testing.assert_allclose(slopes.stated, 1e6 * figures @ n, atol=1e-6)
    assert np.abs(slopes.together - expected).max() < 0.2 * slopes.u.min()
    assert np.abs(slopes.stated).min() > 10
