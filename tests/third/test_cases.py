"""Cases of the third study: independent of the package, of the size that is written down, and of the forms that are named."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.second import artefacts
from benchmarks.second.cases import baseline
from benchmarks.third.cases import CYCLE, NOISES, OUTSIDE, case
from benchmarks.third.forms import DICTIONARY, FORMS, TWO, Outside
from benchmarks.third.known import further, left_by, rivals, versions
from benchmarks.third.oracle import searched_for
from cmm_uq.machine.physics.catalogue import EVERY
from tests.imports import packages_reached
from tests.second.test_cases import as_read


def test_no_code_of_the_package_makes_a_case_or_searches_it() -> None:
    modules = (f"benchmarks.third.{name}" for name in ("cases", "judging", "oracle"))
    assert not {"cmm_uq", "pandas"} & packages_reached(*modules)
    assert [searched_for(case(1, i), 1).keys() >= {"p"} for i in (4, 7)] == [True, True]


def test_two_of_five_hide_what_is_outside_and_every_kind_of_noise_comes_round() -> None:
    assert sum(kind in OUTSIDE for kind in CYCLE) / len(CYCLE) == 0.4
    nothing = [i for i in range(40) if CYCLE[i % len(CYCLE)] == "nothing"][: len(NOISES)]
    assert [case(4, i).one.noise.kind for i in nothing] == list(NOISES)


@pytest.mark.parametrize(("form", "parameters", "at", "values"), [
    ("step", {"at": 0.5}, [0.4, 0.6], [0, 1]),
    ("dent", {"at": 0.5, "width": 0.1}, [0.5, 0.6, 0.7], [1, np.exp(-0.5), np.exp(-2)]),
    ("ramp", {"at": 0.4}, [0.3, 0.9], [0, 0.5]),
    ("cubic", {}, [0, 0.5, 0.75, 1], [-1, 0, 0.125, 1]),
    ("saturating", {"at": 0.3, "width": 0.1}, [0.3, 0.4, 5], [0, np.tanh(1), 1]),
    ("sawtooth", {"period": 0.25, "start": 0.5}, [0, 0.0625, 0.125, 0.25], [0.5, 0.75, 0, 0.5]),
    ("exponential", {"time": 0.2}, [0, 0.2], [1, np.exp(-1)]),
    ("sine", {"period": 0.4, "phase": 0, "harmonic": 0.5, "second": np.pi / 2}, [0, 0.1, 0.2], [0.5, 0.5, 0.5]),
    ("sign", {}, [0, 1], [-1, 1]),
    ("dead_zone", {"at": 0.5, "width": 0.2}, [0.1, 0.4, 0.6, 0.9], [-0.2, 0, 0, 0.2]),
    ("|sine|", {"period": 0.5, "phase": 0}, [0, 0.25, 0.75], [0, 1, 1]),
    ("chirp", {"slow": 1, "fast": 2, "phase": 0}, [0, 0.5], [0, 0]),
    ("cusp", {"at": 0.5}, [0.25, 0.75], [0.5, 0.5]),
    ("ripple", {"at": 0.5, "width": 0.1, "period": 0.2}, [0.5, 0.6], [1, -np.exp(-0.5)]),
])  # fmt: skip
def test_a_form_has_its_values(form: str, parameters: dict, at: list, values: list) -> None:
    np.testing.assert_allclose(FORMS[form].value(np.array(at), **parameters), values, atol=1e-12)


def test_a_product_and_a_bowl_are_of_both_covariates() -> None:
    u, v = np.array([0.0, 1.0, 0.5]), np.array([1.0, 1.0, 0.25])
    np.testing.assert_allclose(FORMS["product"].value(u, v), [-1, 1, 0])
    np.testing.assert_allclose(FORMS["bowl"].value(u, v), [2, 2, 0.25])


@pytest.mark.parametrize("form", DICTIONARY)
def test_what_may_be_drawn_lies_among_the_members_that_an_oracle_tries(form: str) -> None:
    """Every parameter within its grid; a sine's phases and its harmonic are spanned by its columns."""
    members = [member[0] for member in DICTIONARY[form].members()]
    random = np.random.default_rng(0)
    for _ in range(20):
        for name, value in DICTIONARY[form].drawn(random).items():
            if form != "sine" or name == "period":
                each = [member[name] for member in members]
                step = 1 / 12 if name == "start" else 0.0
                assert min(each) <= value <= max(each) + step


def test_a_sine_is_spanned_by_the_columns_of_its_period() -> None:
    u = np.linspace(0, 1, 50)
    true = FORMS["sine"].value(u, 0.3, 1.0, 0.5, second=2.0)
    columns = np.column_stack(
        [FORMS["sine"].value(u, **{**each, "period": 0.3}) for each in DICTIONARY["sine"].members()[0]]
    )
    assert np.abs(true - columns @ np.linalg.lstsq(columns, true, rcond=None)[0]).max() < 1e-12


@pytest.mark.parametrize("number", [1, 2, 3, 6, 13, 17])
def test_the_length_of_what_is_hidden_is_that_of_generalised_least_squares(number: int) -> None:
    """λ = sᵀ(C⁻¹ − C⁻¹B(BᵀC⁻¹B)⁻¹BᵀC⁻¹)s, of the whole signal s, the model's columns B and the noise's covariance C."""
    found = case(3, number)
    s = sum(found.sizes[name] * found.seen.column(error) for name, error in found.errors.items())
    B, C = baseline(found.seen), found.seen.covariance
    weighted = np.linalg.solve(C, np.column_stack([s, B]))
    lam = s @ weighted[:, 0]
    if B.shape[1]:
        lam -= s @ weighted[:, 1:] @ np.linalg.pinv(B.T @ weighted[:, 1:], rcond=1e-12) @ weighted[:, 1:].T @ s
    assert found.one.truth["root_lambda"] == pytest.approx(np.sqrt(lam), rel=1e-6)


@pytest.mark.parametrize("number", [1, 2, 10])
def test_readings_differ_from_the_truth_by_what_is_hidden_and_noise(number: int) -> None:
    """Whitened, and with all that the model takes taken out, what is left is as long as noise is: χ² within six deviations."""
    found = case(3, number)
    left = found.seen.rest @ found.one.y - found.signal
    count = np.linalg.matrix_rank(found.seen.rest)
    # what an error moves is taken at the true places, to 10⁻³ of it
    tolerance = 6 * np.sqrt(2 * count) + 0.05 * found.one.truth["root_lambda"] ** 2
    assert abs(left @ left - count) < tolerance


def test_more_lines_of_a_gauge_are_the_first_seven_and_others() -> None:
    one, more = (artefacts.gauge(np.random.default_rng(2), count=count) for count in (7, 12))
    np.testing.assert_array_equal(one.true, more.true[: len(one.true)])
    assert len(np.unique(np.abs(np.round(more.axes[:, 0], 6)), axis=0)) >= 7
    assert more.measurement.max() == 12


@pytest.mark.parametrize("what", ["step gauge", "ballbar"])
def test_further_effects_move_observations_as_in_the_package(what: str, tmp_path: Path) -> None:
    """To 10⁻⁹ of their size, up to what the placing takes."""
    random = np.random.default_rng(5)
    placed = artefacts.gauge(random) if what == "step gauge" else artefacts.ballbar(random)
    model = as_read(placed, tmp_path / "exact")
    values = model.estimate().about
    for name, errors in further(placed.recorded).items():
        placed_at = name.startswith(("wear", "scale_joint"))
        shape = (20.0,) if "settling" in name else (0.5,) if placed_at else (5.0,) if "lag" in name else ()
        theirs = model.seen(model.columns(EVERY[name], shape, values), values) * (1e-6 if "lag" in name else 1)
        ours = -placed.D @ errors[46 if placed_at else -1](placed.true, placed.recorded).ravel()[:, None]
        left = theirs - ours
        free = placed.free @ np.linalg.lstsq(placed.free, left, rcond=None)[0] if placed.free.size else 0.0
        most = 1e-3 if "lag" in name else 1e-9  # of a lag theirs are lines, ours are steps
        assert np.abs(left - free).max() < most * np.abs(ours).max(), name


def test_a_sign_of_motion_along_another_axis_is_lateral_play() -> None:
    found = next(found for i in range(len(CYCLE)) if "approach_x" in (found := case(8, i)).one.placed.recorded)
    outside = Outside("sign", ("approach_x",), ((-1.0, 1.0),), 1, False, {})
    found = replace(found, errors={outside.name: outside.error()}, sizes={outside.name: 20.0}, outside=outside)
    name = "play_x_y"
    assert left_by(found, [name], versions(found.seen)) < 1e-6 * float(np.linalg.norm(found.signal))
    assert name in rivals(found)[outside.name]


def test_a_scale_lengthens_its_axis_and_another_error_moves_every_point() -> None:
    p, c = np.array([[100.0, 200.0, -300.0], [500.0, 400.0, -100.0]]), {"time_s": np.array([0.0, 100.0])}
    for scale, moved in ((False, [0, 1e-3]), (True, [0, 0.4e-3])):
        one = Outside("step", ("time_s",), ((0.0, 100.0),), 1, scale, {"at": 0.5})
        np.testing.assert_allclose(one.error()(p, c), np.array([np.zeros(2), moved, np.zeros(2)]).T, atol=1e-15)
    both = Outside("product", ("x_mm", "y_mm"), ((100.0, 500.0), (200.0, 400.0)), 2, False, {})
    np.testing.assert_allclose(both.error()(p, c)[:, 2], [1e-3, 1e-3])
    assert set(TWO) < set(FORMS)
