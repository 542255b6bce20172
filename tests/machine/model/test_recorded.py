"""What is recorded, and the steps of its display."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.machine.model.recorded import Display, check_length, display_step, of_last_digit
from cmm_uq.maths.inference.noise import display_shared


def test_references_in_one_place_are_refused() -> None:
    with pytest.raises(CmmUqError, match=r"their references lie all in one place.*own reference"):
        check_length(400.0, 0.0, "the recorded plates", "recording.csv")


@pytest.mark.parametrize(
    ("measured", "says"), [(400_000.0, "not mm"), (405.0, "differ by 12.5 mm/m"), (395.9, "differ")]
)
def test_a_length_that_only_a_unit_or_another_artefact_explains_is_refused(measured: float, says: str) -> None:
    with pytest.raises(CmmUqError, match=says):
        check_length(measured, 400.0, "the recorded bars", "recording.csv")


@pytest.mark.parametrize("measured", [396.1, 400.0, 403.9])
def test_a_length_within_one_per_cent_is_taken(measured: float) -> None:
    check_length(measured, 400.0, "the recorded bars", "recording.csv")


def shown(step: float, count: int = 60) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    return np.asarray(step * np.round(np.random.default_rng(1).uniform(-400, 800, (count, 3)) / step))


@pytest.mark.parametrize("step", [5e-3, 1e-3, 2e-3, 25.4e-4, 25.4 * 5e-5])
def test_the_step_is_the_largest_of_which_all_coordinates_are_multiples(step: float) -> None:
    assert display_step(shown(step), 1e-3) == pytest.approx(step)


def test_a_step_that_is_fine_against_the_scatter_is_none() -> None:
    """1 µm has a standard deviation of 0.29 µm: a hundredth of the variance of 2.9 µm."""
    assert display_step(shown(1e-3), 2.8e-3) == pytest.approx(1e-3)
    assert display_step(shown(1e-3), 3.0e-3) == 0.0


def test_what_is_not_on_a_grid_or_too_little_has_no_step() -> None:
    assert display_step(np.random.default_rng(2).uniform(0, 900, (60, 3)), 1e-3) == 0.0
    assert display_step(shown(5e-3, 3), 1e-3) == 0.0


@pytest.mark.parametrize("ratio", [0.02, 0.1, 0.2, 0.35])
def test_rounding_that_repeats_share_is_as_simulated(ratio: float) -> None:
    """Two repeats of a quantity anywhere on the grid: covariance of their rounding errors, four standard errors."""
    random, count, step = np.random.default_rng(3), 400_000, 5e-3
    true = random.uniform(-1, 1, count)
    repeats = true + ratio * step * random.standard_normal((2, count))
    errors = step * np.round(repeats / step) - repeats
    products = errors[0] * errors[1]
    found = display_shared(np.array([ratio * step]), step)[0]
    assert abs(products.mean() - found) < 4 * products.std() / np.sqrt(count)
    assert np.mean(errors**2) == pytest.approx(step**2 / 12, rel=0.01)


def test_a_tiny_noise_shares_all_of_the_rounding_and_a_large_one_nothing() -> None:
    shared = display_shared(np.array([1e-9, 1.0]), 5e-3)
    assert shared == pytest.approx([5e-3**2 / 12, 0.0], rel=5e-3)
    assert display_shared(np.array([1.0]), 0.0) == 0.0


def display(step: float = 5e-3) -> Display:
    """Three coordinates of one point, then two lengths of pairs that share no point."""
    random = np.random.default_rng(6)
    sensitivity = np.zeros((5, 2, 3))
    sensitivity[:3, 0] = np.eye(3)
    rows = np.array([[0, 0], [0, 0], [0, 0], [1, 2], [3, 4]])
    ways = random.standard_normal((2, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    sensitivity[3:, 1], sensitivity[3:, 0] = ways, -ways
    return Display(step, random.uniform(0, 900, (5, 3)), rows, sensitivity)


def test_points_move_as_little_as_the_observations_ask() -> None:
    """A coordinate moves its point; a length moves both ends by half."""
    some, changed = display(), np.array([1.0, 2.0, 3.0, 4.0, -2.0])
    moved = some.moved(changed[:, None])[:, :, 0]
    assert moved[0] == pytest.approx([1, 2, 3])
    assert moved[2] == pytest.approx(2.0 * some.sensitivity[3, 1])
    assert moved[1] == pytest.approx(-moved[2])
    assert moved[4] == pytest.approx(-1.0 * some.sensitivity[4, 1])


def test_rounding_is_that_of_the_coordinates_themselves() -> None:
    some = display()
    noise = 1e-3 * np.random.default_rng(7).standard_normal((5, 4))
    found = some.rounded(noise)
    for column in range(4):
        shown = some.xyz[0] + noise[:3, column]
        assert found[:3, column] == pytest.approx(np.round(shown / 5e-3) * 5e-3 - shown, abs=1e-9)
    assert np.abs(found[3:]).max() < np.sqrt(6) * 2.5e-3


def test_the_model_s_coordinates_are_the_recorded_ones_less_the_residuals() -> None:
    some = display()
    residual = np.array([1e-3, -2e-3, 0.5e-3, 3e-3, 0.0])
    fitted = Display.of(5e-3, some.xyz + some.moved(residual[:, None])[:, :, 0], some.rows, some.sensitivity, residual)
    assert fitted.xyz == pytest.approx(some.xyz, abs=1e-9)


def test_the_last_digit_leaves_a_step_over_the_root_of_twelve_where_residuals_show_less() -> None:
    """A uniform distribution over a step of 1 µm has 0.2887 µm (JCGM 100, 4.3.7); figures without end have a nanometre."""
    assert of_last_digit(shown(1e-3), 0.0) == pytest.approx(2.887e-4, rel=1e-3)
    assert of_last_digit(shown(1e-3), 3e-4) == 0.0
    endless = np.random.default_rng(2).uniform(0, 900, (60, 3))
    assert of_last_digit(endless, 0.0) == 1e-6
    assert of_last_digit(endless, 1e-3) == 0.0
