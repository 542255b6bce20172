"""The posterior of shifted artefacts by name: the draws that every figure of their certificates comes from."""

from __future__ import annotations

import hashlib
import io
import re
from typing import Any

import numpy as np
import pytest

from cmm_uq.artefacts.shift.axis import ShiftResult
from cmm_uq.artefacts.shift.result import Curve, correction_table, listed_draws, peak_to_valley
from cmm_uq.artefacts.shift.smooth import DRAWS
from cmm_uq.base.points import Floats, Machine
from cmm_uq.machine.physics.error_map import error_map_csv, parse_error_map
from cmm_uq.maths.inference.ensembles import ENSEMBLES
from tests.artefacts.simulated import reported

AXIS, PLANE = "shift-simulated", "shift-plate-simulated"


@pytest.fixture(scope="module", params=[AXIS, PLANE])
def found(request: pytest.FixtureRequest) -> Any:
    return reported(request.param)


def listed_in(results: Any, place: str) -> float:
    """What stands in results.json at a place such as ``curves.linearity_x.error_um[3]``."""
    for key in re.findall(r"[A-Za-z_]\w*|\d+", place):
        results = results[int(key) if key.isdigit() else key]
    return float(results["value"] if isinstance(results, dict) else results)


@pytest.mark.long
def test_the_covariance_has_the_variances_of_all_estimates_first(found: Any) -> None:
    names = list(found.estimates.index)
    assert list(found.covariance.index)[: len(names)] == list(found.covariance.columns)[: len(names)] == names
    u = np.sqrt(np.diag(found.covariance))[: len(names)]
    assert u == pytest.approx(found.estimates["u"].to_numpy(), rel=1e-9)


@pytest.mark.long(but="shift-simulated")
def test_it_agrees_with_the_covariance_of_results_json(found: Any) -> None:
    said = found.results["covariance"]
    ours = found.covariance.loc[said["parameters"], said["parameters"]].to_numpy()
    np.testing.assert_allclose(ours, said["matrix"], rtol=1e-9)
    assert [found.posterior.units[name] for name in said["parameters"]] == said["units"]


def test_what_is_listed_is_named_by_its_place_in_results_json(found: Any) -> None:
    listed = [name for name in found.posterior if name.endswith("]")]
    assert len(listed) > 60
    for name in listed:
        draws = found.posterior[name]
        assert draws.mean() == pytest.approx(listed_in(found.results, name), rel=1e-6, abs=1e-9)


def test_the_spread_of_a_curve_is_its_uncertainty(found: Any) -> None:
    for name, curve in found.results["curves"].items():
        (unit,) = (key.removeprefix("u_") for key in curve if key.startswith("u_"))
        for i, u in enumerate(curve[f"u_{unit}"]):
            place = f"curves.{name}.error_{unit}[{i}]"
            assert (place in found.posterior) == (u > 1e-9)
            if place in found.posterior:
                assert found.posterior[place].std(ddof=1) == pytest.approx(u, rel=1e-6)


def test_a_chain_is_an_ensemble(found: Any) -> None:
    assert found.posterior.array.shape[:2] == (ENSEMBLES, DRAWS // ENSEMBLES)
    assert found.results["posterior"]["rhat_max"] == pytest.approx(found.posterior.rhat_max, rel=1e-12)
    assert np.isfinite(found.posterior.rhat_max)


def test_the_file_has_the_draws_that_results_json_speaks_of(found: Any) -> None:
    said = found.results["posterior"]
    content = found.outcome.files[said["file"]]
    assert hashlib.sha256(content).hexdigest() == said["sha256"]
    with np.load(io.BytesIO(content)) as file:
        assert list(file["names"]) == said["parameters"] == list(found.posterior)
        kept = file["centre"] + file["draws"]
    assert kept.shape == (said["chains"], said["draws"], len(found.posterior))
    spread = found.posterior.array.std(axis=(0, 1))
    np.testing.assert_allclose((kept - found.posterior.array[:, :: said["every"]]) / spread, 0, atol=1e-5)


@pytest.mark.long
def test_in_every_draw_the_curve_ends_where_the_scale_leads() -> None:
    """Between the ends of the first series the curve rises by the mean sensitivity error times the way."""
    found = reported(AXIS)
    result = found.outcome.found
    assert isinstance(result, ShiftResult)
    series = result.estimate.series
    first, last = series.reading[series.series == 0][[0, -1]]
    place = int(np.argmin(np.abs(series.positions - last)))
    assert series.positions[place] == pytest.approx(last, abs=0.5)
    rise = found.posterior["scale_x.ppm"] * 1e-3 * (last - first)  # ppm of mm, µm
    curve = found.posterior[f"curves.linearity_x.error_um[{place}]"]
    assert np.corrcoef(rise.ravel(), curve.ravel())[0, 1] > 0.999
    np.testing.assert_allclose(curve, rise, atol=0.02)


def test_what_is_zero_by_definition_has_no_draws() -> None:
    draws = np.array([[0.0, 1.0, 1e-17], [0.0, 3.0, -1e-17]])
    found = listed_draws("curve", draws, "µm")
    assert list(found) == ["curve[1]"]
    values, unit = found["curve[1]"]
    assert (values.tolist(), unit) == ([1.0, 3.0], "µm")
    assert listed_draws("curve", np.zeros((2, 3)), "µm") == {}


AT = np.linspace(0, 1, 12)


def smooth(random: np.random.Generator, count: int) -> Floats:
    """Draws (count, 12) of curves with a standard deviation of 1 µm, correlated over a fifth of the way; zero at the start."""
    covariance = 1e-6 * np.exp(-0.5 * ((AT[:, None] - AT) / 0.2) ** 2)
    drawn = random.multivariate_normal(np.zeros(len(AT)), covariance, count, method="eigh")
    return np.asarray(drawn - drawn[:, :1])


@pytest.mark.parametrize("size_um", [0.0, 2.0, 10.0])
def test_the_interval_holds_in_at_least_ninety_five_of_a_hundred(size_um: float) -> None:
    """Estimates scatter about the truth as draws scatter about the estimate: 300 of them, 95 % less 3.5 standard errors."""
    random = np.random.default_rng(11)
    true = 1e-3 * size_um * np.sin(np.pi * AT)
    held, before = 0, 0
    for error in smooth(random, 300):
        draws = true + error + smooth(random, 400)
        low, high = peak_to_valley(draws).interval95
        held += low <= size_um <= high
        ends = np.quantile(1e3 * np.ptp(draws, axis=1), [0.025, 0.975])
        before += bool(ends[0] <= size_um <= ends[1])
    assert held >= 300 * 0.95 - 3.5 * (300 * 0.95 * 0.05) ** 0.5
    assert size_um or before == 0


def test_the_largest_of_all_differences_bounds_it_from_both_sides() -> None:
    """Two positions: c₂ − c₁ of 5 µm ± 1 µm is the only difference, and its interval the ordinary ± 1.96 u."""
    random = np.random.default_rng(12)
    step = 5e-3 + 1e-3 * random.standard_normal(200_000)
    found = peak_to_valley(np.column_stack([0 * step, step]))
    assert found.value == pytest.approx(5.0, abs=0.02)
    assert found.interval95 == pytest.approx((5 - 1.96, 5 + 1.96), abs=0.1)


def test_a_curve_far_from_straight_is_not_said_to_be_straight_and_a_straight_one_may_be() -> None:
    random = np.random.default_rng(13)
    bent = peak_to_valley(20e-3 * np.sin(np.pi * AT) + smooth(random, 1000))
    straight = peak_to_valley(smooth(random, 1000))
    assert bent.interval95[0] > 14
    assert straight.interval95[0] == 0
    assert straight.value < straight.interval95[1]


def test_the_value_lies_in_its_interval_whatever_the_draws() -> None:
    for seed in range(20):
        random = np.random.default_rng(seed)
        found = peak_to_valley(random.standard_normal((50, 300)).cumsum(axis=1))
        assert found.interval95[0] <= found.value <= found.interval95[1]


def test_a_curve_that_is_known_exactly_has_no_uncertainty() -> None:
    found = peak_to_valley(np.tile(1e-3 * AT, (10, 1)))
    assert (found.value, found.u) == pytest.approx((1.0, 0.0), abs=1e-9)
    assert found.interval95 == pytest.approx((1.0, 1.0), abs=1e-9)


POSITION = np.linspace(100.0, 500.0, 41)
ERROR = 0.01 * np.sin(POSITION / 80)
CURVE = Curve(POSITION, np.stack([ERROR - 1e-4, ERROR + 1e-4]))
MACHINE = Machine(travel_mm=np.array([[0.0, 900.0], [0.0, 500.0], [np.nan, np.nan]]))


def test_the_table_is_the_curve_to_a_nanometre_as_displacement_of_its_own_axis() -> None:
    table = parse_error_map(error_map_csv(correction_table("x", CURVE, MACHINE)).encode(), "table.csv")
    x, y, z = table.axes
    inside = (x.positions >= 100) & (x.positions <= 500)
    np.testing.assert_allclose(x.positions[inside], POSITION)
    np.testing.assert_allclose(x.errors[inside, 0], ERROR, atol=0.51e-6)
    assert not x.errors[:, 1:].any()
    assert not y.errors.any()
    assert not z.errors.any()


def test_it_reaches_over_the_travel_and_holds_the_last_value_there() -> None:
    x = correction_table("x", CURVE, MACHINE).axes[0]
    assert (x.positions[0], x.positions[-1]) == (0.0, 900.0)
    assert x.errors[0, 0] == x.errors[1, 0]
    assert x.errors[-1, 0] == x.errors[-2, 0]
