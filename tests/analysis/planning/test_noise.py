"""The noise that a plan reckons with: expected uncertainties against generalised least squares by hand, and simulations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from cmm_uq.analysis.planning.candidates import gram, ready_plan, recording_information, set_up_information
from cmm_uq.analysis.planning.identifiability import compare_repeats, expected_uncertainty, identifiability
from cmm_uq.analysis.planning.set_up import attitude_along, join
from cmm_uq.analysis.planning.setting import PlannedNoise, Setting
from cmm_uq.app.commands.estimation import doubt_of
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.ballbar import ballbar
from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats
from cmm_uq.jobs.tables.conformity import Circumstances, TestUncertainty as Stated
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.artefact_doubt import causes_of
from cmm_uq.maths.inference.linear_model import solve
from tests.analysis.planning.plans import BALLBAR, EVERY_KIND, SIX, setting

SIGMA, OFFSET, GROWTH = 1e-3, 1.5e-3, 2e-3
READING = (SIGMA, SIGMA, SIGMA)
OFFSETS = PlannedNoise(READING, placing=OFFSET)
UNCERTIFIED = artefact_facts(kind="ballbar", length_mm=400.0)


def model_of(chosen: Setting) -> RecordingModel:
    return chosen.model(join(ready_plan(chosen)[1]))


def by_hand(model: RecordingModel, covariance: Floats) -> Floats:
    """Standard uncertainties of generalised least squares, certified sizes being further observations of theirs."""
    linear = model.linearised(np.array([unknown.prior_mean for unknown in model.unknowns]))
    exact = np.array([unknown.known and unknown.prior_sd == 0 for unknown in linear.unknowns], dtype=bool)
    columns = np.hstack([linear.design[:, ~exact], linear.freedoms.dense()])
    information = columns.T @ np.linalg.inv(covariance) @ columns
    for i, unknown in enumerate(linear.unknowns):
        if unknown.known and not exact[i]:
            information[i, i] += unknown.prior_sd**-2
    u = np.zeros(len(exact))
    u[~exact] = np.sqrt(np.diag(np.linalg.inv(information)))[: int((~exact).sum())]
    return u


def test_set_up_offsets_of_a_bar_by_hand() -> None:
    """Each length has the noise of two coordinates, and the repeats of a placing share the offsets of both balls."""
    model = model_of(setting(BALLBAR, repeats=3))
    measurement = model.artefact.measurement
    covariance = 2 * SIGMA**2 * np.eye(len(measurement)) + 2 * OFFSET**2 * (measurement[:, None] == measurement)
    np.testing.assert_allclose(expected_uncertainty(model, OFFSETS).u, by_hand(model, covariance), rtol=1e-7)


def test_noise_that_grows_along_a_gauge_by_hand() -> None:
    """Weights matter here: far faces say less, and the place of each line along the gauge is fitted with the same weights."""
    model = model_of(setting(artefact_facts(kind="step_gauge", u_um=0.0), length_mm=820.0, repeats=2))
    points, rows = model.artefact.points, model.artefact.rows[:, 0]
    away = np.empty(len(rows))
    for i, row in enumerate(rows):
        start = (points.measurement == points.measurement[row]) & (points.point == 1)
        away[i] = np.linalg.norm(points.xyz[row] - points.xyz[start][0])
    face = list(zip(points.measurement[rows], points.point[rows], strict=True))
    shared = np.array([[one == other for other in face] for one in face], dtype=np.float64)
    covariance = np.diag(SIGMA**2 + (GROWTH * away / away.max()) ** 2) + OFFSET**2 * shared
    found = expected_uncertainty(model, replace(OFFSETS, growth=GROWTH))
    np.testing.assert_allclose(found.u, by_hand(model, covariance), rtol=1e-7)
    # the longest length of the noise may be another one than that of the plan
    half = replace(OFFSETS, growth=2 * GROWTH, longest=2 * float(away.max()))
    np.testing.assert_allclose(expected_uncertainty(model, half).u, found.u, rtol=1e-9)


@pytest.mark.parametrize("kind", [kind for kind in EVERY_KIND if kind not in ("shift", "plane")])
def test_without_offset_and_growth_it_is_what_white_noise_leaves(kind: str) -> None:
    """By the least squares that a report uses; of a plane, none of these factors shows at all."""
    facts, wishes = EVERY_KIND[kind]
    model = model_of(setting(facts, SIX, **wishes))
    white = [p.u_white for p in identifiability(model).parameters]
    linear = model.estimate().linear
    estimate = solve(linear)
    sought = [i for i, unknown in enumerate(linear.unknowns) if not unknown.known]
    assert [u is None for u in white] == [not estimate.determined[i] for i in sought]
    found = [u for u in white if u is not None]
    there = [i for i in sought if estimate.determined[i]]
    np.testing.assert_allclose(found, np.sqrt(np.diag(estimate.covariance))[there], rtol=1e-6)


@pytest.mark.long
def test_estimates_of_simulated_recordings_scatter_as_expected() -> None:
    """Of 400 recordings the standard deviation lies within the central 99.9 % of χ² for each of six factors."""
    chosen = setting(artefact_facts(kind="ballbar", length_mm=400.0, u_um=0.0), repeats=3)
    model = model_of(chosen)
    random, recordings = np.random.default_rng(20261122), 400
    found = np.empty((recordings, len(SIX)))
    sizes = np.array([size.nominal for size in model.artefact.sizes])
    for i in range(recordings):
        xyz = model.simulate(np.zeros(len(SIX)), sizes, OFFSETS.drawn, random)
        acting = chosen.model(model.artefact.points.at(xyz))
        found[i] = acting.estimate().least_squares.value[: len(SIX)]
    ratio = found.std(axis=0, ddof=1) / expected_uncertainty(model, OFFSETS).u[: len(SIX)]
    low, high = np.sqrt(np.array(stats.chi2.interval(0.999, recordings - 1)) / (recordings - 1))
    assert low < ratio.min()
    assert ratio.max() < high
    # white noise would have promised a third of it: √(1/3 + 2.25) over √(1/3)
    white = expected_uncertainty(model, OFFSETS.white).u[: len(SIX)]
    np.testing.assert_allclose(
        expected_uncertainty(model, OFFSETS).u[: len(SIX)] / white, np.sqrt(1 + 3 * 2.25), rtol=1e-9
    )


@pytest.mark.parametrize("repeats", [1, 3])
def test_an_unknown_offset_is_averaged_over_its_prior_in_closed_form(repeats: int) -> None:
    """∫ ln √(r² + a²) of a half-Cauchy r is ln(1 + a), a² = 1/n of n repeats; with a half of no offset, √(a·(1 + a)).

    The prior ends at three hundred times the reading noise, beyond which 0.1 % of that integral lies.
    """
    model = model_of(setting(UNCERTIFIED, ("squareness_xy", "squareness_yz", "squareness_zx"), repeats=repeats))
    a = repeats**-0.5
    once = expected_uncertainty(model, PlannedNoise(READING)).u / a
    np.testing.assert_allclose(
        expected_uncertainty(model, PlannedNoise(READING, placing=None)).u, once * np.sqrt(a * (1 + a)), rtol=5e-3
    )


def test_information_of_placings_with_offsets_adds_up_to_that_of_the_whole() -> None:
    for kind in ("ballbar", "step_gauge", "plate", "bryan"):
        facts, wishes = EVERY_KIND[kind]
        chosen = setting(facts, **wishes)
        _, placings = ready_plan(chosen)
        points = join(placings)
        chosen = chosen.sized(points)
        model = chosen.model(points)
        values = np.array([unknown.prior_mean for unknown in model.unknowns])
        chosen = replace(chosen, noise=replace(OFFSETS, growth=GROWTH).over(model, values))
        together = recording_information(chosen, points)
        each = set_up_information(chosen, placings).each.sum(axis=0)
        np.testing.assert_allclose(each, together, rtol=1e-6, atol=1e-6 * np.abs(together).max())


def test_repeats_tell_hardly_more_where_offsets_are_large() -> None:
    """n/(1 + n·r²) of one reading's information, r being the offset over the reading noise."""
    once, thrice = (model_of(setting(BALLBAR, repeats=n)) for n in (1, 3))
    values = np.array([unknown.prior_mean for unknown in once.unknowns])
    white = gram(once, values, OFFSETS.white)
    for n, model in ((1, once), (3, thrice)):
        told_now = gram(model, values, OFFSETS)
        np.testing.assert_allclose(told_now, white * n / (1 + n * 2.25), rtol=1e-6, atol=1e-9 * np.abs(white).max())


def test_axes_that_read_worse_leave_what_lies_along_them_worse() -> None:
    """A bar along Z alone shows the noise of Z: three times as much of it, three times the uncertainty."""
    chosen = setting(artefact_facts(kind="ballbar", length_mm=400.0, u_um=0.0), ("scale_x", "scale_z"), repeats=2)
    bar = ballbar(chosen.artefact, chosen.plan)
    placings = [chosen.volume.set_up(bar, attitude_along(np.eye(3)[i]), (0.5, 0.5, 0.5), say("bar")) for i in (0, 2)]
    model = chosen.model(join(placings))
    white = expected_uncertainty(model, PlannedNoise(READING)).u
    found = expected_uncertainty(model, PlannedNoise((SIGMA, SIGMA, 3 * SIGMA))).u
    np.testing.assert_allclose(found[:2] / white[:2], [1.0, 3.0], rtol=1e-6)


def test_what_is_not_known_is_drawn_and_searched_with_an_offset_as_large_as_the_reading_noise() -> None:
    unknown = PlannedNoise(READING, placing=None, growth=None)
    assert unknown.drawn.placing == pytest.approx(SIGMA)
    assert unknown.drawn.growth == 0.0
    assert replace(unknown, placing=0.0).drawn.placing == 0.0


def test_what_will_be_in_doubt_of_the_artefact_is_expected_whatever_the_noise() -> None:
    """Half a kelvin of a steel gauge: 5.75 ppm of each scale in quadrature, of few repeats and of many."""
    chosen = setting(artefact_facts(kind="step_gauge", u_um=0.0), length_mm=820.0)
    warm = Circumstances(cte_per_k=11.5e-6, uncertainty=Stated(u_temperature_k=0.5))
    model, scales = model_of(chosen), [i for i, name in enumerate(SIX) if name.startswith("scale")]
    for noise in (OFFSETS, PlannedNoise(READING, placing=None)):
        alone, doubted = expected_uncertainty(model, noise), expected_uncertainty(model, noise, warm)
        for one, other in ((alone.u, doubted.u), (alone.with_prior, doubted.with_prior)):
            np.testing.assert_allclose(other[scales], np.hypot(one[scales], 5.75), rtol=1e-4)
    found = identifiability(model, noise=OFFSETS, stated=warm).parameters
    assert [one.u for one in found] == pytest.approx(expected_uncertainty(model, OFFSETS, warm).u[: len(SIX)])
    worth = compare_repeats(replace(chosen, noise=OFFSETS, circumstances=warm), ready_plan(chosen)[1])
    assert worth is not None
    assert all(min(row.u[scales]) > 5.75 and min(row.u_more[scales]) > 5.75 for row in worth.rows)


@pytest.mark.parametrize("kind", ["step_gauge", "plate", "gauge_blocks"])
def test_what_is_expected_to_be_in_doubt_is_what_a_certificate_of_these_set_ups_says(kind: str) -> None:
    facts, wishes = EVERY_KIND[kind]
    stated = Stated(u_temperature_k=0.2, u_alignment_um=0.3, u_fixturing_um=0.1)
    model, under = model_of(setting(facts, **wishes)), Circumstances(cte_per_k=11.5e-6, uncertainty=stated)
    alone, doubted = (expected_uncertainty(model, OFFSETS, each).u for each in (None, under))
    doubt = doubt_of(model, model.estimate(), SIGMA, causes_of(model.artefact, under))
    seen = np.isfinite(alone)
    assert seen.any()
    expected = alone**2 + np.diag(doubt.covariance())
    np.testing.assert_allclose(doubted[seen] ** 2, expected[seen], rtol=1e-6)
