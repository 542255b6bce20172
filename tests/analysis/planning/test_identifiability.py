"""What placings determine, against figures worked out by hand and against least squares on drawn recordings."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.analysis.planning.candidates import ready_plan
from cmm_uq.analysis.planning.identifiability import Identifiability, identifiability
from cmm_uq.analysis.planning.set_up import SetUp, attitude_along, join
from cmm_uq.analysis.planning.setting import Setting
from cmm_uq.artefacts import artefact_of
from cmm_uq.artefacts.ballbar import ballbar
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from tests.analysis.planning.plans import BALLBAR, EVERY_KIND, GAUGE, SIX, setting

UNCALIBRATED = BALLBAR.model_copy(update={"length_mm": None, "u_um": None})


def found(chosen: Setting, placings: tuple[SetUp, ...], *rivals: str) -> Identifiability:
    return identifiability(chosen.model(join(placings)), effects(rivals))


def bars(chosen: Setting, *directions: tuple[float, float, float]) -> tuple[SetUp, ...]:
    pattern = ballbar(chosen.artefact, chosen.plan)
    return tuple(
        chosen.volume.set_up(pattern, attitude_along(np.array(d)), (0.5, 0.5, 0.5), f"{i}")
        for i, d in enumerate(directions)
    )


def test_the_scale_of_one_bar_measured_n_times_by_hand() -> None:
    """u(scale) = √(2σ²/n + u_L²)/L: 1 µm, four times, bar of 400 mm ± 0.5 µm."""
    chosen = setting(BALLBAR, named=("scale_x",), repeats=4)
    (parameter,) = found(chosen, bars(chosen, (1, 0, 0))).parameters
    assert parameter.u == pytest.approx(np.sqrt(2 / 4 + 0.5**2) / 0.4, rel=1e-5)
    assert parameter.status == "determined"


EXACT = BALLBAR.model_copy(update={"u_um": 1e-6})  # A bar whose length is as good as known


@pytest.mark.parametrize(
    ("left", "status"), [(0.1002, "weak"), (0.0998, "determined"), (0.9, "weak"), (0.001, "determined")]
)
def test_a_parameter_is_weakly_determined_while_a_tenth_of_its_prior_variance_is_left(left: float, status: str) -> None:
    """One bar of 400 mm: u = √2·σ/0.4 ppm, and with a prior variance of s² of it s²u²/(s² + u²)."""
    (unknown, _) = setting(EXACT, named=("scale_x",)).model(join(bars(setting(EXACT), (1, 0, 0)))).unknowns
    prior = unknown.prior_sd
    u = prior * np.sqrt(left / (1 - left))
    chosen = setting(EXACT, named=("scale_x",), sigma=0.4e-3 * u / np.sqrt(2), repeats=1)
    plan = found(chosen, bars(chosen, (1, 0, 0)))
    (parameter,) = plan.parameters
    assert parameter.u == pytest.approx(u, rel=1e-4)
    assert parameter.u_with_prior == pytest.approx(prior * np.sqrt(left), rel=1e-4)
    assert parameter.status == status
    assert plan.singular_values == pytest.approx([prior / u], rel=1e-4)
    assert plan.complete
    assert plan.free == ()


@pytest.mark.parametrize(("cosine", "alike"), [(0.981, True), (0.979, False)])
@pytest.mark.parametrize("rivals", [(), ("scale_x", "scale_y")])
def test_two_scales_are_alike_where_all_bars_lie_near_the_diagonal(
    cosine: float, alike: bool, rivals: tuple[str, ...]
) -> None:
    """Bars at 45° ± δ show c² and s² of the scales and the other way round: cosine 2c²s²/(c⁴ + s⁴)."""
    product = cosine / (2 * (1 + cosine))
    c, s = np.sqrt(0.5 + np.sqrt(0.25 - product)), np.sqrt(0.5 - np.sqrt(0.25 - product))
    chosen = setting(EXACT, named=("scale_z",) if rivals else ("scale_x", "scale_y"))
    plan = found(chosen, bars(chosen, (c, s, 0), (s, c, 0), *[(0.0, 0.0, 1.0)] * bool(rivals)), *rivals)
    if not alike:
        assert plan.alike == ()
    else:
        assert [pair[:2] for pair in plan.alike] == [("scale_x", "scale_y")]
        assert plan.alike[0][2] == pytest.approx(cosine, abs=1e-4)


def test_of_a_free_length_no_more_is_known_than_the_prior_of_the_scale_leaves() -> None:
    """Along X only scale and length together show: u² of the length is 2σ² + (L·s)², s the prior of the scale."""
    chosen = setting(UNCALIBRATED, named=("scale_x",), length_mm=400.0, repeats=1, sigma=1e-2)
    plan = found(chosen, bars(chosen, (1, 0, 0)))
    scale, length = plan.parameters
    assert (scale.status, length.status, scale.u, length.u) == ("free", "free", None, None)
    assert plan.alike == ()  # an artefact's length is no effect to be told apart
    prior = 0.4e-3 * scale.unknown.prior_sd
    assert length.u_with_prior == pytest.approx(np.sqrt(2e-4 + prior**2), rel=1e-4)
    assert scale.u_with_prior == pytest.approx(scale.unknown.prior_sd, rel=1e-4)


def test_of_a_calibrated_bar_without_effects_there_is_nothing_to_determine() -> None:
    chosen = setting(EXACT, named=())
    plan = found(chosen, bars(chosen, (1, 0, 0)))
    assert (plan.parameters, plan.free, plan.alike, plan.complete) == ((), (), (), True)
    assert plan.singular_values.tolist() == []


def test_a_length_that_is_measured_is_determined_however_roughly() -> None:
    """√2·0.2 mm, beyond the tenth of a millimetre that is its unit: it has no prior to fall back on."""
    chosen = setting(UNCALIBRATED, named=("scale_y",), length_mm=400.0, repeats=1, sigma=0.2)
    scale, length = found(chosen, bars(chosen, (1, 0, 0))).parameters
    assert (scale.status, length.status) == ("free", "determined")
    assert length.u == pytest.approx(np.sqrt(2) * 0.2, rel=1e-4)
    assert length.u_with_prior == pytest.approx(np.sqrt(2) * 0.2, rel=1e-4)


def test_an_uncalibrated_bar_leaves_the_three_scales_free_together_with_its_length() -> None:
    chosen = setting(UNCALIBRATED, length_mm=400.0)
    plan = found(chosen, ready_plan(chosen)[1])
    (combination,) = plan.free
    assert {key: round(part / combination["scale_x", "ppm"], 9) for key, part in combination.items()} == pytest.approx(
        {("scale_x", "ppm"): 1.0, ("scale_y", "ppm"): 1.0, ("scale_z", "ppm"): 1.0, ("artefact", "length_mm"): 400e-6},
        rel=1e-4,
    )
    status = {p.unknown.key[0]: p.status for p in plan.parameters}
    assert status == dict.fromkeys(SIX[:3], "free") | dict.fromkeys(SIX[3:], "determined") | {"artefact": "free"}
    assert not plan.complete


def test_bars_along_one_axis_determine_its_scale_and_nothing_else() -> None:
    chosen = setting(BALLBAR)
    plan = found(chosen, bars(chosen, (1, 0, 0), (1, 0, 0)))
    assert [p.unknown.key[0] for p in plan.parameters if p.status == "determined"] == ["scale_x"]
    assert len(plan.free) == 5
    assert plan.alike == ()  # what does not show looks like nothing


def test_sag_is_one_with_the_scales_of_the_table_axes() -> None:
    """1 µm of sag on 400 mm is −2.5 ppm of X and of Y at once, for level bars with the vertical one free of it."""
    chosen = setting(BALLBAR, named=("scale_x", "scale_y", "scale_z", "artefact_sag"))
    plan = found(chosen, bars(chosen, (1, 0, 0), (0, 1, 0), (0, 0, 1)))
    (combination,) = plan.free
    sag = combination["artefact_sag", "um"]
    assert combination["scale_x", "ppm"] / sag == pytest.approx(-2.5, rel=1e-4)
    assert combination["scale_y", "ppm"] / sag == pytest.approx(-2.5, rel=1e-4)
    assert set(combination) == {("scale_x", "ppm"), ("scale_y", "ppm"), ("artefact_sag", "um")}


def test_one_direction_of_travel_leaves_backlash_free_and_both_determine_it() -> None:
    named = (*SIX, "hysteresis_x", "hysteresis_y", "hysteresis_z")
    one, both = (setting(GAUGE, named, length_mm=820.0, both_ways=way) for way in (False, True))
    assert [p.status for p in found(one, ready_plan(one)[1]).parameters][6:] == ["free"] * 3
    assert [p.status for p in found(both, ready_plan(both)[1]).parameters][6:] == ["determined"] * 3


def test_seven_lines_of_a_gauge_cannot_tell_the_pitch_of_x_from_that_of_y() -> None:
    """On lines through one middle both bend the space diagonals alike: z·x and z·y are the same parabola there."""
    chosen = setting(GAUGE, length_mm=820.0)
    plan = found(chosen, ready_plan(chosen)[1], "rotation_x_y", "rotation_y_x", "straightness_z_x")
    assert ("rotation_x_y", "rotation_y_x") in {pair[:2] for pair in plan.alike}


def test_a_level_plate_shows_nothing_of_the_scale_of_z() -> None:
    facts, wishes = EVERY_KIND["plate"]
    chosen = setting(facts, named=("scale_x", "scale_y"), **wishes)
    plan = found(chosen, ready_plan(chosen)[1][:2], "scale_z", "squareness_xy")
    assert plan.unseen == ("scale_z",)


def test_few_placings_are_a_finding_and_no_error() -> None:
    chosen = setting(BALLBAR)
    plan = found(chosen, bars(chosen, (1, 1, 1)))
    assert all(p.status == "free" for p in plan.parameters)


@pytest.mark.parametrize("kind", ["ballbar", "step_gauge", "plate", "triangle", "bryan"])
def test_expected_uncertainties_are_those_of_drawn_recordings(kind: str) -> None:
    """Forty least-squares estimates: the sum of squares over the expected variance is χ², here within its 99.99 % range."""
    from scipy import stats

    facts, wishes = EVERY_KIND[kind]
    named = ("squareness_xy", "squareness_zx") if kind == "bryan" else ("scale_x", "squareness_xy", "squareness_zx")
    chosen = setting(facts, named, repeats=1, **wishes)
    points = join(ready_plan(chosen)[1])
    expected = np.array([p.u for p in found(chosen, ready_plan(chosen)[1]).parameters if p.unknown.key[0] in named])
    acting = RecordingModel(artefact_of(facts, points), effects(named))
    random = np.random.default_rng(4)
    squares = np.zeros(len(named))
    for _ in range(40):
        sizes = np.array(
            [s.nominal + (s.sd * random.standard_normal() if np.isfinite(s.sd) else 0.0) for s in acting.artefact.sizes]
        )
        xyz = acting.simulate(np.zeros(len(named)), sizes, Noise(chosen.sigma), random)
        value = chosen.model(points.at(xyz)).estimate().least_squares.value
        squares += (value[: len(named)] / expected) ** 2
    low, high = stats.chi2.ppf([0.5e-4, 1 - 0.5e-4], 40)
    assert np.all((low < squares) & (squares < high)), squares


def test_a_level_surface_shows_none_of_the_classical_factors() -> None:
    """They move the surface into itself, shift it or tilt it, and what is left is rounding."""
    facts, _ = EVERY_KIND["plane"]
    chosen = setting(facts)
    assert {p.status for p in found(chosen, ready_plan(chosen)[1]).parameters} == {"free"}


def test_sag_that_the_job_does_not_name_is_taken_for_the_scales_of_the_table_axes() -> None:
    chosen = setting(BALLBAR, named=("scale_x", "scale_y", "scale_z"))
    plan = found(chosen, bars(chosen, (1, 0, 0), (0, 1, 0), (0, 0, 1)), "artefact_sag", "rotation_z_z")
    assert plan.absorbed == (("artefact_sag", ("scale_x", "scale_y")),)
    assert plan.unseen == ("rotation_z_z",)
