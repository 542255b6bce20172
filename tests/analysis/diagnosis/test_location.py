"""Where a curve is large, and the curve itself, against the kernel form of the same Gaussian process.

Residuals as vectors: each observation shows what it saw, by exact constructions.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cmm_uq.analysis.diagnosis.comparison.conditional import Version
from cmm_uq.analysis.diagnosis.comparison.explanations import EFFECT, UNKNOWN
from cmm_uq.analysis.diagnosis.location import ResidualField, locate, region_of, residual_field
from cmm_uq.artefacts import artefact_facts, artefact_of
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.base.units import unit
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.physics.effect import Nonparametric
from cmm_uq.maths.uncertainty.quantity import Quantity
from tests.artefacts.constructions import plate, spheres, step_gauge
from tests.recordings import TRAVEL, bar_facts, bars

PLACES = 10.0 * np.arange(7)


@pytest.mark.parametrize(
    ("curve", "region"),
    [
        ([0, 1, 2, 4, 2, 1, 0], (20.0, 40.0)),  # half of the largest belongs to it
        ([0, 1, 1.99, 4, 2.01, 1, 0], (30.0, 40.0)),
        ([0, -1, -3, -4, -3, -1, 0], (20.0, 40.0)),
        ([-4, 3, 1, 0, 3, 3, 3], (0.0, 10.0)),  # what lies apart does not
        ([3, 0, 1, 0, 2, 3, 5], (50.0, 60.0)),
        ([3, 3, 3, 4, 3, 3, 3], (0.0, 60.0)),
        ([0, 0, 0, 0, 0, 0, -1], (60.0, 60.0)),
        ([2, 0, 0, 0, 0, 0, 0], (0.0, 0.0)),
        ([3, 4, -3, 1, 0, 0, 0], (0.0, 20.0)),
    ],
)
def test_the_region_is_where_the_curve_exceeds_half_of_its_largest_value(
    curve: list[float], region: tuple[float, float]
) -> None:
    assert region_of(PLACES, np.array(curve, dtype=np.float64)) == region


X = np.array([5.0, 1.0, 3.0, 1.0, 8.0, 6.0, 2.0, 9.0, 4.0, 7.0, 0.0, 10.0])
"""A covariate of twelve observations, not in order; 1.0 occurs twice."""
NULL = np.linspace(0.0, 1.0, 101)
AMPLITUDE, LEAST = 3.0, 1e-4


def term(
    *members: Floats, columns: Floats | None = None, kind: str = UNKNOWN, name: str | None = "z_mm",
    is_like: Any = None, form: Nonparametric | None = None,
) -> Any:  # fmt: skip
    """An explanation with one version a member, each of functions (n, r) of the covariate; they act on readings ten times."""
    each = [SimpleNamespace(values=m, columns=10.0 * m if columns is None else columns) for m in members]
    return SimpleNamespace(
        kind=kind, covariate_name=name, covariate=X, members=each, name=f"function of {name}", term=form,
        could_be=lambda effect: effect is is_like,
    )  # fmt: skip


def compared(
    data: Floats, *terms: Any, log_odds: tuple[float, ...] = (50.0,), p_value: float = 0.0, without_mean: bool = False,
    evidence: Floats | None = None, beside: dict[int, dict[int, float]] | None = None,
) -> Any:  # fmt: skip
    """What is read of a comparison: twice the noise on every observation, and a baseline of nothing, or of a constant.

    ``beside`` says which log odds the others keep beside the one that was last given.
    """

    def rest(columns: Floats) -> Floats:
        return columns - columns.mean(axis=0) if without_mean else columns

    def of_versions(*_: object) -> tuple[Any, Floats, Floats]:
        count = len(terms[0].members)
        log = np.log(np.ones(count) if evidence is None else 1e3 * evidence)
        return np.arange(count), log, np.zeros(count)

    def weighed(given: Any, among: Any) -> Any:
        kept = (beside or {}).get(given[-1].explanation, {}) if given else {}
        return {
            i: (kept.get(i, log_odds[i]) + (7.0 if given else 0.0), Version(i, 0, AMPLITUDE)) for i in range(len(terms))
        }

    comparison = SimpleNamespace(
        noise_scale=np.full(12, 2.0), rest=rest, left=rest(data), least_noise=LEAST, of_versions=of_versions,
        degrees_of_freedom=12 - without_mean,
        beside=weighed, log_evidence_of=lambda given: np.array([7.0]),
    )  # fmt: skip
    artefact = SimpleNamespace(rows=np.arange(12)[:, None], points=range(12))
    return SimpleNamespace(
        model=SimpleNamespace(artefact=artefact, used=np.ones(12, dtype=bool)),
        p_value=p_value,
        explanations=terms,
        comparison=comparison,
        null_maximum=NULL,
        log_odds=np.array(log_odds),
    )


def bent(x: Floats) -> Floats:
    return np.column_stack([np.sin(x), np.cos(0.7 * x), x**2 / 50])


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("exact", [False, True])
def test_the_curve_is_that_of_kriging(exact: bool, sign: float) -> None:
    """Prior covariance a²v·VVᵀ, noise v: mean a²VLᵀ(a²LLᵀ + 1)⁻¹y (Rasmussen & Williams 2006, 2.25–26), with v of the
    residuals of least squares, or the least noise where these are less.
    """
    V, L = bent(np.unique(X)), 5.0 * bent(X)
    data = sign * L @ [2e-3, -1e-3, 4e-3] + (0.0 if exact else 1e-3) * np.random.default_rng(5).standard_normal(12)
    (place,) = locate(compared(data, term(bent(X))), 0.01)
    rest = data - L @ np.linalg.lstsq(L, data, rcond=None)[0]
    v = LEAST**2 if exact else rest @ rest / 9
    solved = AMPLITUDE**2 * np.linalg.solve(AMPLITUDE**2 * L @ L.T + np.eye(12), np.column_stack([data, L @ V.T]))
    curve = V @ L.T @ solved[:, 0]
    variance = AMPLITUDE**2 * v * np.diag(V @ V.T - V @ L.T @ solved[:, 1:])
    x, found, u = place.curve
    assert x.tolist() == np.unique(X).tolist()
    np.testing.assert_allclose(found, 1e3 * curve, rtol=1e-8)
    np.testing.assert_allclose(u, 1e3 * np.sqrt(variance), rtol=1e-6)
    assert place.k == pytest.approx(
        2.262157, abs=1e-6
    )  # Student's t for nine degrees of freedom, 95 % (GUM table G.2: 2.26)
    assured = np.abs(curve) > place.k * np.sqrt(variance)
    assert place.amplitude_um == pytest.approx(1e3 * np.abs(curve)[assured].max())
    assert place.region == region_of(x, curve, assured)
    low, high, left = place.data
    assert low.tolist() == high.tolist() == X.tolist()
    np.testing.assert_allclose(left, 2e3 * data)  # what an observation leaves, not over its noise
    assert (place.covariate, place.what) == ("z_mm", "function of z_mm")


@pytest.mark.parametrize(("shown", "there"), [(0.0501, True), (0.0499, False)])
def test_a_constant_of_which_hardly_anything_shows_is_no_part_of_the_curve(shown: float, there: bool) -> None:
    """What the observations see of a constant is a twentieth of it, or a little less."""
    wave = np.sin(2 * np.pi * X / 11.0)
    values = np.column_stack([np.ones(12), wave - wave.mean()])
    columns = 2.0 * values * [shown, 1.0]
    data = values @ [1e-3 * shown, 2e-3]
    (place,) = locate(compared(data, term(values, columns=columns)), 0.01)
    mean = place.curve[1].mean()
    assert abs(mean) > 0.1 if there else abs(mean) < 1e-9


def test_a_constant_that_the_baseline_absorbs_is_no_part_of_the_curve() -> None:
    values = np.column_stack([np.ones(12), np.sin(X)])
    data = 10.0 * values @ [5e-3, 2e-3]
    (place,) = locate(compared(data, term(values), without_mean=True), 0.01)
    x, found, _ = place.curve
    assert found.mean() == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(np.diff(found), 4.0 * np.diff(np.sin(x)), rtol=0.05, atol=0.05)


@pytest.mark.parametrize(
    ("evidence", "region"),
    [
        # steps after 2, 4, 7 and 9: of 0.6, 0.3, 0.08 and 0.02 the first three are needed for 95 %
        ([0.6, 0.3, 0.08, 0.02], (2.0, 8.0)),
        ([0.02, 0.96, 0.01, 0.01], (4.0, 5.0)),
        ([0.6, 0.352, 0.03, 0.018], (2.0, 5.0)),
        ([0.07, 0.3, 0.03, 0.6], (2.0, 10.0)),
        ([0.04, 0.92, 0.02, 0.02], (2.0, 5.0)),
    ],
)
def test_a_jump_lies_where_it_is_with_95_percent(evidence: list[float], region: tuple[float, float]) -> None:
    steps = [np.where(after < X, 1.0, 0.0)[:, None] for after in (2.0, 4.0, 7.0, 9.0)]
    data = 1e-3 * steps[0][:, 0]
    (place,) = locate(compared(data, term(*steps), evidence=np.array(evidence)), 0.01)
    assert place.region == region


def test_functions_that_are_significant_are_told_the_most_significant_first() -> None:
    data = 1e-2 * np.sin(X)
    terms = [term(bent(X), name=name) for name in ("a", "b", "c", None)]
    effect = term(bent(X), kind=EFFECT, name="d")
    found = locate(compared(data, *terms, effect, log_odds=(3.0, 9.0, 0.9, 9.0, 9.0)), 0.05)
    assert [place.covariate for place in found] == ["b", "a"]
    assert found[0].p_value < found[1].p_value < 0.05
    assert locate(compared(data, *terms, effect, log_odds=(3.0, 9.0, 0.9, 9.0, 9.0), p_value=0.05), 0.05) == ()
    assert len(locate(compared(data, terms[0], p_value=0.049), 0.05)) == 1


def test_a_region_is_where_the_band_does_not_hold_zero() -> None:
    """The largest value of all is not known to be anything; of what is, only what hangs together belongs to the region."""
    curve = np.array([9.0, 2.0, 3.0, 4.0, 3.0, 2.5, 3.0])
    assured = np.array([False, True, True, True, True, False, True])
    assert region_of(PLACES, curve, assured) == (10.0, 40.0)


def test_a_function_whose_band_holds_zero_everywhere_is_no_place() -> None:
    noise = np.random.default_rng(11).standard_normal(12)
    wild = 1e-2 * (noise - bent(X) @ np.linalg.lstsq(bent(X), noise, rcond=None)[0])
    assert locate(compared(wild + 1e-6 * np.sin(X), term(bent(X))), 0.01) == ()


def test_what_fits_as_well_and_shows_nothing_more_is_named_with_the_first() -> None:
    """Log odds of 9: within ln 20 of them 7, and not 5; neither keeps evidence beside the first."""
    data = 1e-2 * np.sin(X)
    terms = [term(bent(X), name=name) for name in "abc"]
    (place,) = locate(compared(data, *terms, log_odds=(7.0, 9.0, 5.0), beside={1: {0: 0.0, 2: 0.0}}), 0.05)
    assert (place.covariate, place.also) == ("b", ("function of a",))


def test_of_functions_that_fit_equally_well_the_one_with_the_form_of_what_was_found_is_named() -> None:
    data, effect = 1e-2 * np.sin(X), term(bent(X), kind=EFFECT, name="effect")
    form = Nonparametric("a", "y")
    terms = [term(bent(X), name="a", is_like=effect, form=form), term(bent(X), name="b"), effect]
    found = compared(data, *terms, log_odds=(7.0, 9.0, 9.0), beside={0: {1: 0.0}, 1: {0: 0.0}})
    (place,) = locate(found, 0.05, {2})
    assert (place.covariate, place.along, place.scale, place.also) == ("a", "y", False, ("function of b",))
    (place,) = locate(found, 0.05)
    assert (place.covariate, place.also) == ("b", ("function of a",))


def test_a_further_place_is_told_with_what_it_carries_beside_the_first() -> None:
    data = 1e-2 * np.sin(X)
    terms = [term(bent(X), name=name) for name in "ab"]
    first, second = locate(compared(data, *terms, log_odds=(20.0, 19.0), beside={0: {1: 6.0}}), 0.05)
    (alone,) = locate(compared(data, terms[1], log_odds=(6.0,)), 0.05)
    assert (first.covariate, second.covariate) == ("a", "b")
    assert second.p_value == pytest.approx(alone.p_value)
    assert first.p_value < second.p_value
    assert first.also == ()


BARS = bars(np.random.default_rng(4), 12, 400.0, Machine("m", "XYZ", TRAVEL, origin_mm=np.array([100.0, 50.0, -20.0])))


def field(facts: object, points: Points) -> ResidualField:
    """Of a model without effects, exactly certified."""
    model = RecordingModel(artefact_of(facts, points), ())  # type: ignore[arg-type]
    found = residual_field(model, model)
    assert found is not None
    return found


def test_a_bar_found_too_long_points_outwards_by_half_of_it_at_either_end() -> None:
    """The third bar by 4 µm; vectors stand at the scale readings of its ends."""
    xyz = BARS.xyz.copy()
    way = xyz[5] - xyz[4]
    xyz[5] += 4e-3 * way / 400.0
    found = field(bar_facts(u_um=0.0), BARS.at(xyz))
    lengths = np.linalg.norm(found.before, axis=1)
    assert lengths[4:6] == pytest.approx([2.0, 2.0], abs=1e-5)
    assert np.delete(lengths, [4, 5]) == pytest.approx(np.zeros(22), abs=1e-5)
    np.testing.assert_allclose(found.before[5], 2.0 * way / 400.0, atol=1e-4)
    np.testing.assert_allclose(found.before[4], -2.0 * way / 400.0, atol=1e-4)
    np.testing.assert_allclose(found.place, BARS.at(xyz).machine_xyz)
    assert found.lengths
    assert found.scale == pytest.approx(np.full(24, np.sqrt(0.5)))  # half of √2


def test_a_ball_of_a_plate_shows_all_three_coordinates() -> None:
    """One of twenty-five moves by 10 µm: rigid placing takes up 1/25 and the turn that goes with it, all others little."""
    points = plate([(0.0, 0.0, 0.0)])
    xyz, off = points.xyz.copy(), np.array([6e-3, 0.0, 8e-3])
    xyz[12] += off  # in the middle: no turn follows
    found = field(artefact_facts(kind="plate", length_mm=400.0, u_um=0.0), points.at(xyz))
    np.testing.assert_allclose(found.before[12], 1e3 * off * 24 / 25, atol=1e-4)
    np.testing.assert_allclose(np.delete(found.before, 12, axis=0), np.tile(-1e3 * off / 25, (24, 1)), atol=1e-4)
    assert found.dimensions.tolist() == [3] * 25
    assert not found.lengths


def test_a_face_shows_its_line_and_a_probed_point_its_normal_and_no_other_direction() -> None:
    gauge = step_gauge(lines=((1, 0, 0), (0, 1, 1)))
    off = np.random.default_rng(2).normal(0, 1e-3, gauge.xyz.shape)
    found = field(artefact_facts(kind="step_gauge", length_mm=420.0, u_um=0.0), gauge.at(gauge.xyz + off))
    along = np.where(gauge.measurement[:, None] == 1, [1.0, 0.0, 0.0], [0.0, np.sqrt(0.5), np.sqrt(0.5)])
    across = found.before - np.einsum("ni,ni->n", found.before, along)[:, None] * along
    assert np.abs(found.before).max() > 0.5
    assert np.abs(across).max() < 1e-4
    assert set(found.dimensions.tolist()) == {1}
    ball = spheres(places=1)
    normal = np.column_stack([ball.columns[f"n{a}"] for a in "xyz"])
    found = field(artefact_facts(kind="sphere", length_mm=25.0, u_um=0.0), ball.at(ball.xyz + 2e-3 * normal))
    # 2 µm all around, less what least squares takes up by shifting the ball, of which only one half was probed
    left = 2.0 - normal @ np.linalg.lstsq(normal, np.full(25, 2.0), rcond=None)[0]
    np.testing.assert_allclose(found.before, left[:, None] * normal, atol=1e-3)
    assert set(found.dimensions.tolist()) == {1}


def test_a_vector_is_longer_than_its_u_in_one_case_of_twenty() -> None:
    """χ² for 95 %: 3.841, 5.991, 7.815 for one, two, three directions (tables); √F with few degrees of freedom."""
    exact = Quantity(2.0, 0.0, (2.0, 2.0), unit("µm"))
    some = ResidualField(
        np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3)), np.array([1.0, 1.0, 0.5]), np.array([1, 2, 3]), False
    )
    assert some.expanded(exact) == pytest.approx(2.0 * np.sqrt([3.841459, 5.991465, 7.814728]) * [1, 1, 0.5], rel=1e-6)
    # ½(value/u)² = 10 degrees of freedom: t = 2.228139, and F(2, 10) = 4.102821, F(3, 10) = 3.708265
    known = Quantity(2.0, 2.0 / np.sqrt(20.0), (1.0, 3.0), unit("µm"))
    wanted: Floats = 2.0 * np.sqrt([2.228139**2, 2 * 4.102821, 3 * 3.708265]) * [1, 1, 0.5]
    assert some.expanded(known) == pytest.approx(wanted, rel=1e-6)


def test_only_what_is_used_is_drawn_and_the_model_after_is_its_own() -> None:
    used = np.ones(12, dtype=bool)
    used[3] = False
    model = RecordingModel(artefact_of(bar_facts(u_um=0.0), BARS), (), used=used)
    found = residual_field(model, replace(model, sigma=1.0))
    assert found is not None
    assert len(found.place) == 22
    np.testing.assert_array_equal(found.before, found.after)
