"""Error factors over the measuring range and within parts of it, with all errors of the machine together."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from cmm_uq.analysis.machine import regions as room
from cmm_uq.analysis.machine.agreement import RecordedDraws, held_together, of_factors
from cmm_uq.analysis.machine.conditional import RecordedField, doubted_draws
from cmm_uq.analysis.machine.regions import FactorRegions, factor_regions
from cmm_uq.analysis.machine.state import Unmodelled
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Machine, Points
from cmm_uq.certificate.result import Result
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.field import curves
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.maths.inference.linear_model import solve
from cmm_uq.maths.inference.posterior import Doubt
from tests.artefacts.simulated import analysed

TRAVEL = np.array([[0.0, 900.0], [0.0, 600.0], [-500.0, 0.0]])
MACHINE = Machine(travel_mm=TRAVEL)
SECOND = np.pi / 648000
SIX = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")
WHOLE = ((0.0, 1.0),) * 3


def observe(found: Result, points: Points) -> Artefact:
    return kind_of(found.job).observing("reported")(found.job.facts.artefact, points, found.job.recording_path)


def regions(job: str) -> FactorRegions:
    found = analysed(job).regions
    assert isinstance(found, FactorRegions)
    return found


@pytest.mark.parametrize(("ends", "middle"), [((0.0, 1.0), 300.0), ((0.0, 0.5), 150.0), ((0.5, 1.0), 450.0)])
def test_a_yaw_of_x_is_a_scale_error_of_x_in_proportion_to_the_height_of_y(
    ends: tuple[float, float], middle: float
) -> None:
    """By hand: an angle α·x about z moves what stands at y by −α·x·y along x: −α·y a length, −α·ȳ over a region. The rest,
    (x − x̄)·(y − ȳ), has no slope along x. For 1 ″/m."""
    ratio = room._moved(MACHINE, effects(SIX), effects(["rotation_x_z"]), [(WHOLE[0], ends, WHOLE[2])])[0]
    assert ratio[0, 0] == pytest.approx(-SECOND / 1000 * middle * 1e6, rel=1e-9)


@pytest.mark.parametrize(("low", "high"), [(0.0, 1.0), (0.0, 0.5), (0.5, 1.0)])
def test_a_wave_along_x_is_the_scale_that_fits_it_over_the_whole_region(low: float, high: float) -> None:
    """By hand: of √2·cos(κ(u + ⅛)), κ = πk/(5/4), u from a to b, the slope that fits best is 12/(b − a)³·∫(u − m)·√2·cos du,
    of the bow that at m, over the travel of 900 mm. At four places with the ends among them it was a quarter off."""
    waves = [one for one in curves() if one.name == "scale_curvature_x"]
    ratio = room._moved(MACHINE, effects(SIX), waves, [((low, high), *WHOLE[1:])])[0][0]
    turns, middle = np.pi * np.arange(1, 11) / 1.25, (low + high) / 2
    u = np.array([[low], [high]])
    angle = turns * (u + 0.125)
    integral = np.diff((u - middle) * np.sin(angle) / turns + np.cos(angle) / turns**2, axis=0)[0]
    bow = 12 * np.sqrt(1.25) * (2 * middle - 1)
    slopes = np.array([bow, *(12 / (high - low) ** 3 * np.sqrt(2) * integral)]) / 900.0 * 1e3  # ppm of 1 µm
    sizes = np.array([c.prior_sd for one in waves for c in one.coefficients])
    off, exact = sizes * (ratio - slopes), sizes * slopes
    assert np.sqrt(np.mean(off**2)) < 0.1 * np.sqrt(np.mean(exact**2))


def test_an_error_that_is_named_itself_is_not_told_of_another() -> None:
    """A scale error beside the same one: exactly one for one, and nothing of all others."""
    ratio = room._moved(MACHINE, effects(SIX), effects(["scale_y"]), [room.EIGHTHS[5]])[0]
    np.testing.assert_allclose(ratio[:, 0], [0, 1, 0, 0, 0, 0], atol=1e-9)


def test_a_squareness_that_nobody_named_is_no_scale_and_no_rotation() -> None:
    """−S·y along x is not x and not −x·y; least squares of these two alone would take it for a yaw of 1.23·S per metre."""
    named, everywhere = effects(["scale_x", "rotation_x_z"]), effects(["squareness_xy", "squareness_zx", "scale_y"])
    ratio = room._moved(MACHINE, named, everywhere, [WHOLE])[0]
    np.testing.assert_allclose(ratio, 0.0, atol=1e-9)
    bow = room._moved(MACHINE, named, (*everywhere, *effects(["straightness_y_x"])), [WHOLE])[0]
    assert np.all(np.isfinite(bow))


def test_what_cannot_be_told_in_a_region_is_no_number() -> None:
    """The same error named twice."""
    twice = (*effects(["scale_x"]), *effects(["scale_x"]), *effects(["scale_z"]))
    ratio = room._moved(MACHINE, twice, effects(["scale_y"]), [WHOLE])[0]
    assert np.isnan(ratio[:, 0]).tolist() == [True, True, False]


def test_over_the_recorded_set_ups_a_factor_is_what_the_recording_without_noise_would_give() -> None:
    """Observations made of named errors and of curves, no noise: their least squares are θ + G·C·c. By the solver itself."""
    found, random = analysed("iota-1102-20C"), np.random.default_rng(5)
    others = tuple(Unmodelled(one, np.array([c.prior_sd for c in one.coefficients])) for one in curves())
    field, about = RecordedField.of(found.model, others), found.model.estimate()
    theta, c = random.standard_normal(field.modelled), 0.01 * random.standard_normal(len(field.sd)) * field.sd
    seen = np.hstack(
        [found.model.seen(found.model.columns(one.effect, (), about.about), about.about) for one in others]
    )
    exact = about.linear.design[:, : field.modelled] @ theta + seen @ c
    sizes = about.linear.design[:, field.modelled :] @ np.array(
        [u.prior_mean for u in found.model.unknowns[field.modelled :]]
    )
    fitted = solve(replace(about.linear, observed=exact + sizes)).value[: field.modelled]
    noise, sigma = found.posterior.sizes, float(np.median(found.posterior.sigma))
    which = np.arange(field.modelled)
    told = RecordedDraws(found.model, which, theta[None], field.effects, c[None], noise, sigma).factors[0]
    # the estimator has a prior of 300 ppm, where u is 20: it is smaller by (20/300)², 0.4 %
    np.testing.assert_allclose(told, fitted, atol=6e-3 * float(np.abs(fitted).max()))


def test_a_mean_over_the_set_ups_is_known_better_than_a_factor_elsewhere() -> None:
    """Of twenty bars: the named model and all errors together agree on what was recorded; U grows with the region that is
    asked for, as no set-up fills it."""
    found, named = regions("iota-1102-20C"), analysed("iota-1102-20C").parameters
    assert not found.agreement.disagree
    for key, quantity in found.whole.items():
        stated, recorded = named[key[0]][key[1]], found.recorded[key]
        assert abs(stated.value - recorded.value) < 0.2 * stated.u
        assert recorded.u < quantity.u
        low, high = found.eighths[key]
        assert high - low > 2 * quantity.expanded


def test_a_plate_that_lies_flat_says_little_of_the_axis_across_it() -> None:
    """Named alone its squareness Z–X is ± 0.6″; that holds for rotations of zero. With rotations as large as the recording
    shows others to be, it is ten times as open; the squareness X–Y, which lies in the plate, is not."""
    found, named = regions("plate-simulated"), analysed("plate-simulated").parameters

    def wider(effect: str) -> float:
        return found.whole[effect, "angle_arcsec"].u / named[effect]["angle_arcsec"].u

    assert wider("squareness_zx") > 6
    assert wider("squareness_xy") < 4


def test_noise_of_readings_does_not_explain_itself() -> None:
    """A plane whose points scatter by 0.3 µm along z: were errors of the axis z taken where it was read, and not where the
    plane stands, the readings' own noise would be a function of the readings, and no noise would be left."""
    found = regions("plane-simulated")
    bow = ("straightness_x_z", "bow_um")
    assert found.recorded[bow].value == pytest.approx(
        analysed("plane-simulated").parameters[bow[0]][bow[1]].value, abs=0.2
    )
    assert bow not in found.eighths  # one of the whole travel


def test_doubt_of_the_artefact_widens_a_factor_wherever_it_holds() -> None:
    """3 ppm on the first of two unknowns: √(4² + 3²) = 5. 200 000 draws."""
    draws = 4 * np.random.default_rng(1).standard_normal((200_000, 1))
    cause = (np.array([[3.0], [0.0]]), np.zeros((2, 1)))
    assert doubted_draws(Doubt((cause,)), 2, np.array([0]), 0, draws).std() == pytest.approx(5.0, rel=0.01)
    assert doubted_draws(Doubt(()), 2, np.array([0]), 0, draws) is draws


@pytest.mark.parametrize(("times", "denied"), [(3.0, False), (4.5, True)])
def test_a_model_is_denied_beyond_its_joint_uncertainty(times: float, denied: bool) -> None:
    """Six factors, one in a thousand models that fit: 3.76 standard deviations of the difference."""
    found = analysed("iota-1102-20C")
    draws = found.posterior.draws[:, :6].copy()
    draws[:, 2] += times * np.sqrt(2) * draws[:, 2].std()
    key = found.model.unknowns[2].key
    agreement = held_together([of_factors(found.model, found.posterior, draws, Doubt(()))])
    assert agreement.factors == ((key,) if denied else ())


def test_of_several_recordings_what_is_in_doubt_about_one_is_no_contradiction() -> None:
    """By several recordings 4.5 standard deviations away, which the first one's doubt, three times u, allows."""
    found = analysed("iota-1102-20C")
    draws = found.posterior.draws[:, :6].copy()
    sd = draws.std(axis=0)
    draws[:, 2] += 4.5 * np.sqrt(2) * sd[2]
    doubt = Doubt(((np.append(3 * sd, np.zeros(len(found.model.unknowns) - 6))[:, None], np.zeros((7, 0))),))
    assert held_together([of_factors(found.model, found.posterior, draws, Doubt(()))]).factors
    assert not held_together([of_factors(found.model, found.posterior, draws, doubt)]).factors


def test_without_a_travel_nothing_is_told_of_other_places() -> None:
    found = analysed("iota-1102-20C")
    points = replace(
        found.artefact.points, machine=replace(found.artefact.points.machine, travel_mm=np.full((3, 2), np.nan))
    )
    artefact = copy(found.artefact)
    artefact.points = points
    model = replace(found.model, artefact=artefact)
    with pytest.raises(CmmUqError, match="the travel of axis x is needed"):
        factor_regions(model, found.posterior, Doubt(()), partial(observe, found), 0)


def test_of_a_machine_with_further_axes_nothing_is_told_yet() -> None:
    found = analysed("iota-1102-20C")
    artefact = copy(found.artefact)
    machine = replace(found.artefact.points.machine, axes=("x", "y", "z", "c"))
    artefact.points = replace(found.artefact.points, machine=machine)
    with pytest.raises(CmmUqError, match="other axes than three straight ones"):
        factor_regions(replace(found.model, artefact=artefact), found.posterior, Doubt(()), partial(observe, found), 0)


@pytest.mark.long
def test_priors_that_a_recording_outweighs_change_little() -> None:
    """A step gauge on seven lines, some hundred readings, against twenty bars."""

    def most(job: str) -> float:
        return max(float(np.abs(one.u - 1).max()) for one in regions(job).influence if one.family == "all")

    assert most("step-gauge-simulated") < 0.5 * most("iota-1102-20C")
