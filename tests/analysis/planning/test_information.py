"""Information of placings adds up to that of the recording that they make together.

What is left of effects once others are fitted: the same by projection of their columns.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from cmm_uq.analysis.planning.candidates import (
    Information,
    certified,
    cosines,
    gram,
    imitators,
    left_of,
    ready_plan,
    recording_information,
    scales,
    set_up_information,
    shared,
    visible,
)
from cmm_uq.analysis.planning.set_up import attitude_along, join
from cmm_uq.artefacts.ballbar import ballbar
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.maths.inference.linear_model import Unknown
from tests.analysis.planning.plans import EVERY_KIND, SIX, setting

RIVALS = effects(("rotation_x_z", "straightness_y_z", "artefact_sag"))


@pytest.mark.parametrize("kind", [kind for kind in EVERY_KIND if kind != "shift"])
def test_the_sum_over_placings_is_the_whole(kind: str) -> None:
    facts, wishes = EVERY_KIND[kind]
    chosen = setting(facts, SIX, **wishes)
    _, placings = ready_plan(chosen)
    chosen = chosen.sized(join(placings))
    known = set_up_information(chosen, placings, RIVALS)
    together = recording_information(chosen, join(placings), RIVALS)
    np.testing.assert_allclose(known.each.sum(axis=0), together, rtol=1e-6, atol=1e-6 * np.abs(together).max())


def test_repeats_add_as_often_as_they_are_made() -> None:
    facts, _ = EVERY_KIND["ballbar"]
    once, thrice = (
        set_up_information(setting(facts, repeats=n), ready_plan(setting(facts, repeats=n))[1]) for n in (1, 3)
    )
    np.testing.assert_allclose(thrice.each, 3 * once.each, rtol=1e-9)


def test_a_short_line_of_a_long_gauge_keeps_the_certificate_of_the_whole() -> None:
    """0.4 µm on 1000 mm is 0.4 ppm on any line, however short."""
    facts, _ = EVERY_KIND["step_gauge"]
    chosen = setting(facts, length_mm=1000.0)
    _, placings = ready_plan(chosen)
    sized = chosen.sized(join(placings))
    longest = max(float(p.points.columns["reference_mm"].max()) for p in placings)
    assert [u.prior_mean for u in set_up_information(sized, placings[4:5]).unknowns if u.known] == [longest]
    assert next(u.prior_mean for u in set_up_information(chosen, placings[4:5]).unknowns if u.known) < longest


SCALE = Unknown(("scale_x", "ppm"), "ppm", 0.0, 50.0, 50.0)
BAR = Unknown((ARTEFACT, "length_mm"), "mm", 400.0, 5e-4, 0.1, known=True)


def test_the_information_of_one_bar_by_hand() -> None:
    """A bar of 400 mm along X, 1 µm: ±0.4 µm for one ppm, and 1 µm for one of length, both over √2 µm."""
    chosen = setting(EVERY_KIND["ballbar"][0], named=("scale_x",), repeats=1)
    placing = chosen.volume.set_up(
        ballbar(chosen.artefact, chosen.plan), attitude_along(np.eye(3)[0]), (0.5, 0.5, 0.5), "X"
    )
    model = chosen.model(join((placing,)))
    scale = model.unknowns[0].prior_sd
    assert scales(model.unknowns).tolist() == [scale, 0.1]
    found = gram(model, np.array([0.0, 400.0]))
    rows = np.array([0.4 * scale, 100.0]) / np.sqrt(2)
    np.testing.assert_allclose(np.abs(found), np.outer(rows, rows), rtol=1e-4)


def test_information_needs_the_noise() -> None:
    chosen = setting(EVERY_KIND["ballbar"][0], named=("scale_x",), repeats=1)
    model = replace(chosen.model(join(ready_plan(chosen)[1])), sigma=None)
    with pytest.raises(ValueError, match="needs the noise"):
        gram(model, np.array([0.0, 400.0]))


def test_freedoms_that_all_placings_share_leave_what_projecting_them_out_leaves() -> None:
    facts, wishes = EVERY_KIND["bryan"]
    chosen = setting(facts, ("squareness_xy", "squareness_zx"), **wishes)
    model = chosen.model(join(ready_plan(chosen)[1]))
    known = shared(model)
    k, rows = len(model.unknowns), len(known.prior)
    assert rows > k
    together = left_of(known.each.sum(axis=0), range(k), range(k, rows))
    expected = gram(model, np.array([unknown.prior_mean for unknown in model.unknowns]))
    np.testing.assert_allclose(together, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())


def test_a_certificate_is_worth_the_square_of_its_unit_over_its_uncertainty() -> None:
    """A tenth of a millimetre over half a micrometre, squared; one without uncertainty, or with hardly any, holds its size."""
    hardly = Unknown((ARTEFACT, "other"), "mm", 1.0, 1e-9, 0.1, known=True)
    assert certified([hardly])[0, 0] == 1e12
    exact = Unknown((ARTEFACT, "other"), "mm", 1.0, 0.0, 0.1, known=True)
    found = certified([SCALE, BAR, exact], 1)
    assert found.shape == (4, 4)
    assert np.diag(found)[[0, 1, 3]] == pytest.approx([0.0, 4e4, 0.0])
    assert found[2, 2] == 1e12
    assert np.count_nonzero(found) == 2


def test_effects_and_what_must_be_fitted_besides_are_told_apart_by_name() -> None:
    squareness = Unknown(("squareness_xy", "arcsec"), "arcsec", 0.0, 10.0, 10.0)
    known = Information((SCALE, squareness, BAR), np.zeros((1, 4, 4)), np.zeros((4, 4)))
    assert known.where(effects(("squareness_xy",))) == [1]
    assert known.where(effects(("scale_x", "squareness_xy"))) == [0, 1]
    assert known.nuisance == [2, 3]


@given(seed=st.integers(0, 10_000), base=st.integers(0, 4))
def test_the_schur_complement_is_the_projection_of_the_columns(seed: int, base: int) -> None:
    random = np.random.default_rng(seed)
    columns = random.normal(size=(20, base + 3)) * random.uniform(1, 100, base + 3)
    Q, _ = np.linalg.qr(columns[:, :base])
    rest = columns[:, base:] - Q @ (Q.T @ columns[:, base:])
    found = left_of(columns.T @ columns, range(base, base + 3), range(base))
    np.testing.assert_allclose(found, rest.T @ rest, rtol=1e-7, atol=1e-7 * np.abs(rest.T @ rest).max())
    unit = rest / np.linalg.norm(rest, axis=0)
    wanted = np.abs(unit.T @ unit)
    np.fill_diagonal(wanted, 1.0)
    np.testing.assert_allclose(cosines(found, np.einsum("ij,ij->j", columns, columns)[base:]), wanted, atol=1e-7)


def test_a_base_without_full_rank_takes_what_it_reaches_and_no_more() -> None:
    """Two equal columns in the base take their direction once."""
    columns = np.array([[1.0, 1.0, 1.0], [0.0, 0.0, 2.0], [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(left_of(columns.T @ columns, [2], [0, 1]), [[4.0]], rtol=1e-9)


def test_an_effect_that_the_base_imitates_is_not_seen_and_apart_from_nothing() -> None:
    columns = 100 * np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 1.0]])
    left = left_of(columns.T @ columns, [1, 2], [0])
    alone = np.einsum("ij,ij->j", columns, columns)[1:]
    assert visible(left, alone).tolist() == [False, True]
    assert cosines(left, alone)[0, 1] == 1.0


@pytest.mark.parametrize(
    ("left", "alone", "seen"),
    [
        (1.001, 2.0, True),  # an effect of its prior standard deviation has to be larger than its noise
        (1.0, 2.0, False),
        (0.999, 2.0, False),
        (1001.0, 1e9, True),  # and a millionth of what it is alone has to be left
        (1000.0, 1e9, False),
        (999.0, 1e9, False),
    ],
)
def test_an_effect_is_seen_above_the_noise_and_above_rounding(left: float, alone: float, seen: bool) -> None:
    assert visible(np.array([[left]]), np.array([alone])).tolist() == [seen]
    other = np.array([[left, left], [left, 4 * left]])
    assert cosines(other, np.array([alone, 1.0]))[0, 1] == pytest.approx(0.5 if seen else 1.0)


def test_cosines_of_several_informations_at_once() -> None:
    """4, 9 and −3: a half; parallel columns of rounding beyond one are parallel."""
    left = np.array([[[4.0, -3.0], [-3.0, 9.0]], [[4.0, 6.0 * (1 + 1e-12)], [6.0 * (1 + 1e-12), 9.0]]])
    found = cosines(left, np.array([[4.0, 9.0], [4.0, 9.0]]))
    np.testing.assert_allclose(found[:, 0, 1], [0.5, 1.0], rtol=1e-15)
    assert found[:, [0, 1], [0, 1]].tolist() == [[1.0, 1.0], [1.0, 1.0]]


def test_what_an_effect_looks_like_are_the_columns_of_more_than_a_tenth_of_it() -> None:
    """Orthogonal columns of different lengths, in parts 0.1003, 0.0997, −0.3 and what is left for a length of one."""
    parts = np.array([0.1003, 0.0997, -0.3, 0.0])
    parts[3] = np.sqrt(1 - parts @ parts)
    lengths = np.array([5.0, 1.0, 100.0, 0.01])
    columns = np.column_stack([np.diag(lengths), 7.0 * parts])
    information = columns.T @ columns
    assert imitators(information, 4, [0, 1, 2, 3]) == [0, 2, 3]
    assert imitators(information, 4, [3, 1]) == [3]
