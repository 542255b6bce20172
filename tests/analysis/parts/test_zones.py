"""A measurement of a zone that is turned round says what its distribution says, and its intervals hold.

Tails of the unified interval, beside the construction that they come from.

What a part may be that was measured: less errors of place, not less form that only errors have.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from scipy import stats
from scipy.special import ndtr, ndtri

from cmm_uq.analysis.parts.evaluation import Movement
from cmm_uq.analysis.parts.plan import PartCharacteristic, Plan
from cmm_uq.analysis.parts.result import (
    Inverse,
    alike,
    inverse,
    middle,
    nodes_of,
    possible_interval,
    tails,
    trial_parts,
)
from cmm_uq.base.points import Floats
from tests.analysis.parts.causes.test_condensing import bore, face

Width = Callable[[Floats], Floats]

WIDTHS: dict[str, tuple[int, Width]] = {
    "modulus of a normal quantity": (1, lambda z: np.abs(z[..., 0])),
    "place in a plane": (2, lambda z: np.linalg.norm(z, axis=-1)),
    "range of twelve points": (12, lambda z: np.ptp(z, axis=-1)),
}
"""Number of coordinates, each with an error of one, and the zone of them."""


def turned_round(width: Width, measured: Floats, errors: Floats) -> Inverse:
    """As :class:`cmm_uq.analysis.parts.virtual.AtPose` does it."""
    found, alone = float(width(measured)), width(errors)
    parts = measured - errors
    truly = width(parts)
    nodes = nodes_of(found, alone)
    trials = [parts[like] * (node / truly[like])[:, None] for node in nodes for like in [alike(truly, node)]]
    return inverse(found, width(measured + errors), alone, nodes, np.array([width(part + errors) for part in trials]))


@pytest.mark.parametrize("found", [0.5, 1.5, 3.0, 10.0])
def test_draws_of_a_place_are_those_of_the_noncentral_distribution(found: float) -> None:
    """Off by θ in a plane, errors of one along each axis: P(measured ≥ f) is that of χ² of two degrees of freedom about θ²."""
    random = np.random.default_rng(3)
    width = WIDTHS["place in a plane"][1]
    measured = np.array([found, 0.0])
    again = width(measured + random.standard_normal((200_000, 2)))
    true = turned_round(width, measured, random.standard_normal((100_000, 2)))(again)
    assert np.mean(true < 0) == pytest.approx(np.exp(-0.5 * found**2), abs=0.006)
    for p in (0.025, 0.5, 0.9, 0.975):
        theta = np.quantile(true, p)
        if theta > 0:
            assert stats.ncx2.sf(found**2, 2, theta**2) == pytest.approx(p, abs=0.01)


@pytest.mark.long(but="0.5-place")
@pytest.mark.parametrize("name", WIDTHS)
@pytest.mark.parametrize("true", [0.0, 0.5, 1.0, 2.0, 5.0])
def test_intervals_hold_however_small_the_zone(name: str, true: float) -> None:
    """95 % hold, of a normal quantity up to 96.5 % near one; to three standard deviations of 400 measurements. The form is
    a tilt, whose largest points are no others for their errors."""
    random = np.random.default_rng(17)
    count, width = WIDTHS[name]
    shape = np.arange(count) - 0.5 * count
    size = float(width(random.standard_normal((5000, count))).std()) if count > 2 else 1.0
    part, held, above, widths = true * size * shape / width(shape), 0, 0, []
    for _ in range(400):
        measured = part + random.standard_normal(count)
        inverted = turned_round(width, measured, random.standard_normal((1000, count)))
        draws = inverted(width(measured + random.standard_normal((1000, count))))
        low, high = possible_interval(draws, 0.95)
        held += low <= true * size <= high
        above += middle(draws) > true * size
        widths.append(high - low)
    assert 0.95 - 3 * np.sqrt(0.05 * 0.95 / 400) < held / 400 < 0.965 + 3 * np.sqrt(0.035 * 0.965 / 400)
    if true:  # as often too large as too small
        assert above / 400 == pytest.approx(0.5, abs=3 * np.sqrt(0.25 / 400))
    assert min(widths) > 1.5 * size  # however well the part happened to be measured


def test_what_is_far_from_zero_is_turned_round_as_what_is_linear() -> None:
    """θ = 2f − g: a modulus of 100 errs as the quantity does, beyond the quantiles too."""
    errors = np.random.default_rng(1).standard_normal((20_000, 1))
    inverted = turned_round(WIDTHS["modulus of a normal quantity"][1], np.array([100.0]), errors)
    read = np.linspace(95.0, 105.0, 41)
    np.testing.assert_allclose(inverted(read), 200.0 - read, atol=0.02)


def interval(at: float, coverage: float = 0.95) -> tuple[float, float]:
    """Of the mean, not negative, of a normal quantity that was measured so many standard deviations from zero."""
    below, above = tails(float(ndtr(-at)), coverage)
    return max(0.0, at + float(ndtri(below))), at - float(ndtri(above))


MEANS = np.linspace(0.0, 9.0, 901)


def accepted(mean: float, coverage: float) -> tuple[float, float]:
    """Measurements x on a grid, in the order of their ratios of likelihoods, until they have the coverage (Neyman's belt)."""
    x = np.linspace(-8.0, 14.0, 11_001)
    ratio = -0.5 * (x - mean) ** 2 + 0.5 * (x - np.maximum(x, 0)) ** 2
    weights = np.exp(-0.5 * (x - mean) ** 2)
    order = np.argsort(-ratio)
    inside = np.cumsum(weights[order]) <= coverage * weights.sum()
    belt = x[order[inside]]
    return float(belt.min()), float(belt.max())


@cache
def belts(coverage: float) -> Floats:
    return np.array([accepted(mean, coverage) for mean in MEANS])


@pytest.mark.long(but="0.95")
@pytest.mark.parametrize("coverage", [0.9, 0.95, 0.99])
@pytest.mark.parametrize("at", [0.3, 1.2, 1.9, 2.4, 3.1, 4.0, 6.0])
def test_limits_are_those_of_the_belt(at: float, coverage: float) -> None:
    """Means whose accepted measurements reach this one: by brute force, means on a grid of a hundredth."""
    low, high = belts(coverage).T
    holding = MEANS[(low <= at) & (at <= high)]
    assert interval(at, coverage) == pytest.approx((holding.min(), holding.max()), abs=0.015)


def test_an_interval_of_a_measurement_below_zero_ends_where_a_twentieth_of_what_is_possible_lies_beyond() -> None:
    for at in (-0.1, -1.0, -2.0):
        low, high = interval(at)
        assert low == 0
        assert ndtr(at - high) / ndtr(at) == pytest.approx(0.05, rel=1e-9)


@pytest.mark.parametrize("mean", [0.0, 0.3, 1.0, 1.9, 2.3, 3.0, 3.7, 5.0])
def test_whatever_the_mean_95_percent_hold_and_not_many_more(mean: float) -> None:
    x = mean + np.linspace(-6, 6, 6001)
    weights = np.exp(-0.5 * (x - mean) ** 2)
    ends = np.array([interval(at) for at in x])
    held = (ends[:, 0] <= mean) & (mean <= ends[:, 1])
    assert 0.949 < weights[held].sum() / weights.sum() < 0.97


def test_far_from_zero_both_tails_are_half_of_what_is_missed() -> None:
    assert tails(0.0, 0.95) == pytest.approx((0.025, 0.025))


PLAN = Plan((face(5, 6), bore(3, 8)), (PartCharacteristic("squareness", "perpendicularity", ("bore",), ("A",)),))
BORE = PLAN.feature("bore")


def moved(*displacements: Floats) -> Movement:
    return Movement(np.zeros((len(displacements), 0)), {"bore": np.array(displacements)})


def tilted() -> Floats:
    """A bore that leans, lies aside and is larger."""
    return np.asarray(np.cross([1e-3, 2e-3, 0.0], BORE.points) + [0.01, 0.02, 0.0] + 0.005 * BORE.normals)


def waved(size: float) -> Floats:
    """Three lobes, which no motion has and no size."""
    angle = np.arctan2(BORE.normals[:, 1], BORE.normals[:, 0])
    return np.asarray(size * np.cos(3 * angle)[:, None] * BORE.normals)


def along(movement: Movement) -> Floats:
    return np.asarray(np.einsum("kmi,mi->km", movement.points["bore"], BORE.normals))


@pytest.mark.parametrize("form", [True, False])
def test_errors_of_place_and_size_are_taken_off(form: bool) -> None:
    trial = trial_parts(moved(tilted()), moved(np.zeros_like(BORE.points)), PLAN, form=form)
    np.testing.assert_allclose(along(trial), along(moved(-tilted())), atol=1e-15)


def test_form_of_errors_is_taken_off_where_form_is_asked_alone() -> None:
    """Else what was measured of it loses what errors explain: a form of 5 µm, of which errors make 3 µm, is 1 − 9/25 of it."""
    errors, perfect = moved(waved(0.003), waved(-0.003)), moved(-waved(0.005))
    asked, not_asked = (trial_parts(errors, perfect, PLAN, form=form) for form in (True, False))
    np.testing.assert_allclose(along(asked), along(moved(-waved(0.003), waved(0.003))), atol=1e-15)
    np.testing.assert_allclose(along(not_asked), along(moved(*[-waved(0.005 * 9 / 25)] * 2)), atol=1e-15)


def test_no_more_form_is_taken_off_than_was_measured() -> None:
    trial = trial_parts(moved(waved(0.02)), moved(-waved(0.005)), PLAN, form=False)
    np.testing.assert_allclose(along(trial), along(moved(-waved(0.005))), atol=1e-15)


def test_displacements_along_normals_are_as_those_in_space() -> None:
    errors, perfect = moved(tilted() + waved(0.003)), moved(-waved(0.005) - tilted())
    flat, still = (Movement(one.change, {"bore": along(one)}) for one in (errors, perfect))
    trial = trial_parts(flat, still, PLAN, form=False)
    np.testing.assert_allclose(trial.points["bore"], along(trial_parts(errors, perfect, PLAN, form=False)), atol=1e-15)
