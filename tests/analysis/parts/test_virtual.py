"""A virtual measurement errs as the physics says: signs, levers, what is common to several points, what cancels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.spatial.transform import Rotation
from scipy.stats import ncx2

from cmm_uq.analysis.parts.causes.cause import PointScatter, Rows
from cmm_uq.analysis.parts.causes.surroundings import Expansion, Surroundings
from cmm_uq.analysis.parts.evaluation import Evaluator, characteristics_of
from cmm_uq.analysis.parts.plan import Nominal, PartAlignment, PartCharacteristic, PartPose, Plan, Stylus, placed
from cmm_uq.analysis.parts.result import conforming, evaluated, stated
from cmm_uq.analysis.parts.virtual import AtPose, MeasurementConditions, Virtual
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Machine
from cmm_uq.base.units import ARCSECOND
from cmm_uq.maths.uncertainty.propagation import simulate, simulate_adaptively
from tests.parts_drawn import MACHINE, POSE, block, bore, circle, machine, plane, spot

APART = (PartCharacteristic("apart", "distance", ("one", "other")),)


def pair(one: object = (0, 0, 0), other: object = (300, 0, 0)) -> Plan:
    return Plan((spot("one", one), spot("other", other)), APART)  # type: ignore[arg-type]


def errors(
    plan: Plan, given: MeasurementConditions, pose: PartPose = POSE, *, exact: bool = True, n: int = 200
) -> np.ndarray:
    at = AtPose(plan, given, pose)
    return at.errors(at.drawn(np.random.default_rng(0), n), exact=exact)


def test_a_scale_that_reads_short_makes_a_distance_short_by_as_much() -> None:
    """True = indicated + s·indicated: a machine of 50 ppm that nobody corrects indicates 300 mm/(1 + 50·10⁻⁶)."""
    given = MeasurementConditions(machine(["scale_x"], [[50.0]], corrected=False))
    np.testing.assert_allclose(errors(pair(), given, n=2), 300 / (1 + 50e-6) - 300, rtol=1e-9)


def test_a_corrected_machine_errs_by_the_difference_of_each_draw_from_the_mean() -> None:
    draws = np.array([[40.0], [60.0]])
    found = errors(pair(), MeasurementConditions(machine(["scale_x"], draws)))[:, 0]
    np.testing.assert_allclose(np.unique(found.round(9)), [-300 * 10e-6, 300 * 10e-6], rtol=1e-6)


@pytest.mark.parametrize("exact", [True, False])
def test_the_height_of_a_circle_errs_by_the_scale_over_its_distance_from_the_datum_face(exact: bool) -> None:
    """Of 10 ppm over 5 mm, not over the 300 mm from where the scale begins; of a bore that leans by 36.9° likewise."""
    lean = np.array([[0.8, 0.0, -0.6], [0.0, 1.0, 0.0], [0.6, 0.0, 0.8]])
    upright, centre = bore("leaning", [0, 0, 0], 10.0, (6.0, 0.0, -6.0)), np.array([100.0, 50.0, -5.0])
    leaning = replace(
        upright,
        points=upright.points @ lean + centre,
        normals=upright.normals @ lean,
        nominal=Nominal(centre, lean[2], 20.0),
    )
    asked = tuple(PartCharacteristic(name, "z", (name,), ("A", "B", "C")) for name in ("ring", "leaning"))
    plan = Plan((*block()[0][:4], circle("ring", centre, 8.0), leaning), asked)
    found = errors(plan, MeasurementConditions(machine(["scale_z"], [[20.0], [40.0]])), exact=exact)
    np.testing.assert_allclose(np.abs(found), 5 * 10e-6, rtol=1e-3)


@pytest.mark.parametrize(("other", "error"), [((100.0, 0, 0), 0.0), ((100.0, 100.0, 0), 0.5 * np.sqrt(2) * 100)])
def test_squareness_changes_a_diagonal_and_no_edge(other: tuple[float, ...], error: float) -> None:
    """e_x = −S·y, so the machine indicates x + S·y: a diagonal of 45° over 100 mm is long by S·y/√2."""
    given = MeasurementConditions(machine(["squareness_xy"], [[10.0]], corrected=False))
    np.testing.assert_allclose(errors(pair(other=other), given, n=2), error * 10 * ARCSECOND, atol=2e-6)


def test_a_turning_carriage_has_its_lever_to_the_tip() -> None:
    """Carriage x turns about y by ε = r·x, e = ε × (0, y, z + tip): however long the tip, the lever ends where it touches."""
    lever, r = np.array([0.0, 0.0, -200.0]), 20.0
    plan = Plan(pair().features, APART, (Stylus("stylus", lever),))
    given = MeasurementConditions(machine(["rotation_x_y"], [[r]], corrected=False))
    epsilon = r * ARCSECOND * 1e-3 * np.array([300.0, 600.0])
    indicated = -np.diff(epsilon * POSE.translation_mm[2])
    np.testing.assert_allclose(errors(plan, given, n=2)[0], indicated, rtol=1e-3)


def test_readings_are_not_coordinates() -> None:
    """With a tip 150 mm towards +x the scale of x stands 150 mm lower, and an error that goes by it is that of there."""
    tip = np.array([150.0, 0.0, 0.0])
    plan = Plan(pair().features, APART, (Stylus("stylus", tip, 6.0),))
    points = placed(plan, POSE, MACHINE)
    np.testing.assert_allclose(points.readings["x"], [150.0, 450.0])
    np.testing.assert_allclose(points.readings["z"], [-297.0, -297.0])  # the centre of a tip of 6 mm on a level face
    bow = MeasurementConditions(machine(["straightness_x_z"], [[30.0]], corrected=False))
    plan = Plan(plan.features, (PartCharacteristic("up", "distance", ("one", "other")),), plan.styli)
    off = AtPose(plan, bow, POSE).measured.base[:, 2]
    expected = -0.03 * (1 - (2 * np.array([150.0, 450.0]) / 900 - 1) ** 2)
    np.testing.assert_allclose(off, expected, rtol=1e-9)


def test_one_tip_errs_alike_on_both_sides() -> None:
    """A tip that is larger by δ makes a hole smaller by δ, a length over outer faces longer by δ, and moves no axis."""
    features, characteristics = block()
    plan = Plan(features, characteristics, (Stylus("stylus", u_diameter_um=2.0),))
    virtual = AtPose(plan, MeasurementConditions(machine()), POSE)
    drawn = virtual.drawn(np.random.default_rng(1), 50)
    delta = 1e-3 * np.asarray(drawn[1])[:, 0]
    found = dict(zip((one.name for one in characteristics), virtual.errors(drawn, exact=True).T, strict=True))
    np.testing.assert_allclose(found["d1"], -delta, atol=1e-9)
    np.testing.assert_allclose(found["length"], delta, atol=1e-9)
    np.testing.assert_allclose(found["apart"], 0, atol=1e-9)


def test_two_tips_move_what_each_of_them_probed() -> None:
    given = MeasurementConditions(machine())
    styli = (Stylus("stylus"), Stylus("side", u_offset_um=np.array([3.0, 0.0, 0.0])))
    plan = Plan((spot("one", [0, 0, 0]), spot("other", [300, 0, 0], stylus="side")), APART, styli)
    assert errors(plan, given, n=4000).std() == pytest.approx(3e-3, rel=0.05)
    same = Plan((spot("one", [0, 0, 0], stylus="side"), spot("other", [300, 0, 0], stylus="side")), APART, styli)
    np.testing.assert_allclose(errors(same, given), 0, atol=1e-9)


def test_a_tip_of_which_everything_is_qualified_away_has_no_play() -> None:
    """Hysteresis along x, y and z alike is a larger tip to a sphere probed on all sides, and is gone from the part."""
    drawn = np.full((1, 3), 4.0)
    names = [f"hysteresis_{axis}" for axis in "xyz"]
    hole = circle("hole", [0, 0, 0], 20.0, 4)
    plan = Plan((hole,), (PartCharacteristic("d", "size", ("hole",)),))
    state = machine(names, drawn, corrected=False)
    raw = errors(plan, MeasurementConditions(state), n=2)[0, 0]
    assert raw == pytest.approx(-4e-3, rel=1e-6)  # half the gap on each side: the hole is small by all of it
    qualified = Plan(
        plan.features, plan.characteristics, (Stylus("stylus", qualified_at_mm=np.array([100.0, 100.0, -300.0])),)
    )
    left = errors(qualified, MeasurementConditions(state), n=2)[0, 0]
    assert abs(left) < 0.4 * abs(raw)


def test_part_and_scale_of_one_material_at_one_temperature_expand_together() -> None:
    """Neither is corrected: the part is longer by α·ΔT and the scale reads shorter by it."""
    warm = Expansion(11.5e-6, 0.0, 25.0, corrected=False)
    for scales, expected in (((Expansion(),) * 3, 300 * 11.5e-6 * 5), ((warm,) * 3, 0.0)):
        given = MeasurementConditions(machine(), surroundings=Surroundings(warm, scales))
        np.testing.assert_allclose(errors(pair(), given, n=2), expected, atol=1e-9)


def test_the_product_of_an_uncertain_coefficient_and_an_uncertain_temperature() -> None:
    """Var(α·ΔT) of independent factors, exactly: α²u² + ΔT²u² + u²u² (JCGM 100, 5.1.2, note, here all of it)."""
    cte, u_cte, excess, u_t = 11.5e-6, 2e-6, 3.0, 2.0
    part = Expansion(cte, u_cte, 20.0 + excess, u_t)
    found = errors(pair(), MeasurementConditions(machine(), surroundings=Surroundings(part)), n=100_000)[:, 0]
    expected = 300 * np.sqrt((cte * u_t) ** 2 + (excess * u_cte) ** 2 + (u_cte * u_t) ** 2)
    assert found.std() == pytest.approx(expected, rel=0.01)


def test_a_free_body_in_a_gradient_of_temperature_bends_to_a_circle() -> None:
    """Of radius 1/(α·g): the middle of a bar of length L stands off its ends by α·g·L²/8."""
    alpha, gradient, length = 11.5e-6, 2.0, 400.0
    ends = [spot("a", [0, 0, 0]), spot("middle", [200, 0, 0]), spot("b", [length, 0, 0])]
    plan = Plan(tuple(ends), (PartCharacteristic("z", "distance", ("a", "b")),))
    warm = Surroundings(Expansion(alpha), u_gradient_k_per_m=np.array([0.0, 0.0, gradient]))
    at = AtPose(
        plan, MeasurementConditions(machine(), surroundings=warm), PartPose(np.eye(3), np.array([100.0, 100.0, -100.0]))
    )
    bent = at.causes[-1].moved(np.array([[0.0, 0.0, gradient]]), slice(None))[0, :, 2]
    sagitta = bent[1] - 0.5 * (bent[0] + bent[2])
    assert sagitta == pytest.approx(alpha * gradient * 1e-3 * length**2 / 8, rel=1e-9)


@pytest.mark.long
@settings(max_examples=15)
@given(st.lists(st.floats(-1, 1), min_size=6, max_size=6))
def test_where_the_part_lies_is_no_error_of_it(numbers: list[float]) -> None:
    """A part moved and turned a little, as a whole, has the characteristics that it had; within 0.1 nm."""
    features, characteristics = block()
    plan = Plan(features, characteristics, alignment=PartAlignment(("A", "B", "C")))
    turn = Rotation.from_rotvec(1e-3 * np.array(numbers[:3])).as_matrix()
    moved = Evaluator(plan, plan.points @ turn.T + np.array(numbers[3:]) - plan.points, [])
    off = moved([], exact=True) - characteristics_of(plan, plan.points)
    np.testing.assert_allclose(off, 0, atol=1e-7)


@pytest.mark.parametrize("best_fit", [False, True])
def test_first_order_is_the_exact_measurement_to_a_hundredth_of_u(best_fit: bool) -> None:
    names = ["scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx", "rotation_x_z"]
    draws = np.random.default_rng(3).standard_normal((2000, 7)) * 5
    features, characteristics = block()
    if best_fit:
        characteristics = tuple(replace(c, datums=()) if len(c.datums) == 3 else c for c in characteristics)
    styli = (Stylus("stylus", np.array([0, 0, -100.0]), 4.0, 0.5, np.zeros(3), 0.8),)
    plan = Plan(features, characteristics, styli, PartAlignment(best_fit=best_fit))
    virtual = Virtual(plan, MeasurementConditions(machine(names, draws, 1.0), (POSE,)))
    assert virtual.off.max() < 0.003
    assert not virtual.exact
    given = virtual.places[0].drawn(np.random.default_rng(4), 300)
    apart = virtual.places[0].errors(given) - virtual.places[0].errors(given, exact=True)
    assert np.abs(apart).max() < 2e-5  # mm: squares of micrometres over millimetres


def test_large_errors_are_not_taken_to_first_order() -> None:
    draws = np.random.default_rng(5).standard_normal((500, 1)) * 3e3
    plan = Plan((bore("h1", [0, 0, 0], 2.0),), (PartCharacteristic("d", "size", ("h1",)),))
    assert Virtual(plan, MeasurementConditions(machine(["squareness_xy"], draws), (POSE,))).exact


def test_linear_characteristics_have_the_covariance_of_the_law_of_propagation() -> None:
    """JCGM 102, 6.2.1: V = J·Vₓ·Jᵀ, with J written down here for distances along x, y and a diagonal."""
    places = {"o": [0, 0, 0], "x": [400, 0, 0], "y": [0, 250, 0], "xy": [400, 250, 0]}
    plan = Plan(
        tuple(spot(name, place) for name, place in places.items()),
        tuple(PartCharacteristic(name, "distance", ("o", name)) for name in ("x", "y", "xy")),
    )
    u = np.array([4.0, 6.0, 5.0])
    correlated = np.array([[1, 0.6, 0], [0.6, 1, -0.3], [0, -0.3, 1]]) * np.outer(u, u)
    draws = np.random.default_rng(6).multivariate_normal(np.zeros(3), correlated, 100_000)
    noise = 1.5e-3
    state = machine(["scale_x", "scale_y", "squareness_xy"], draws, 1e3 * noise)
    pose = PartPose(np.eye(3), np.array([100.0, 100.0, -300.0]))
    found = simulate(Virtual(plan, MeasurementConditions(state, (pose,))).source, 200_000, seed=7).covariance
    diagonal = np.hypot(400.0, 250.0)
    unit = {"x": np.array([1.0, 0, 0]), "y": np.array([0, 1.0, 0]), "xy": np.array([400, 250, 0]) / diagonal}
    J = np.array([[-400.0 * 1e-6, 0, 0], [0, -250.0 * 1e-6, 0],
                  [-(400**2) / diagonal * 1e-6, -(250**2) / diagonal * 1e-6, 400 * 250 / diagonal * ARCSECOND]])  # fmt: skip
    readings = np.array([[noise**2 * (unit[a] @ unit[b]) * (2 if a == b else 1) for b in unit] for a in unit])
    expected = J @ correlated @ J.T + readings
    scale = np.sqrt(np.outer(np.diagonal(expected), np.diagonal(expected)))
    np.testing.assert_allclose(found / scale, expected / scale, atol=0.01)
    np.testing.assert_allclose(np.sqrt(np.diagonal(found)), np.sqrt(np.diagonal(expected)), rtol=0.01)


def test_a_part_beyond_the_travel_is_refused() -> None:
    with pytest.raises(
        CmmUqError, match=r"X would have to read 950.0 mm at feature 'other', beyond its travel of 0 to 900"
    ):
        errors(pair(), MeasurementConditions(machine()), PartPose(np.eye(3), np.array([650.0, 0, -10])))


@pytest.mark.parametrize(("datums", "words"), [
    (("A",), "free to turn about 'A'"), (("A", "B"), "free to shift"), (("hole",), "do not fix how the part is turned"),
])  # fmt: skip
def test_datums_that_do_not_fix_the_frame_are_refused(datums: tuple[str, ...], words: str) -> None:
    features, _ = block()
    hole = circle("hole", [100, 50, 0], 5.0)
    plan = Plan((*features, hole), (PartCharacteristic("x", "x", ("h1",), datums),))
    with pytest.raises(CmmUqError, match=words):
        Virtual(plan, MeasurementConditions(machine(), (POSE,)))


def test_a_mean_error_of_the_machine_is_that_of_its_place() -> None:
    """Solved to the end: a scale error of 1000 ppm at 800 mm is 0.8 mm less its own square, wherever the origin is."""
    state = machine(["scale_x"], [[1000.0]], corrected=False)
    plan = Plan((spot("one", [0, 0, 0]), spot("other", [100, 0, 0])), APART)
    far = Machine("m", travel_mm=MACHINE.travel_mm, origin_mm=np.array([50.0, 0, 0]))
    at = AtPose(
        plan, MeasurementConditions(replace(state, machine=far)), PartPose(np.eye(3), np.array([650.0, 10, -10]))
    )
    np.testing.assert_allclose(at.measured.base[:, 0], -np.array([700.0, 800.0]) * 1e-3 / 1.001, rtol=1e-9)


def test_as_many_measurements_are_drawn_as_the_digits_need_and_what_is_measured_is_less_its_mean_error() -> None:
    """An uncorrected scale of 40 ± 10 ppm, 300 mm: indicated 299.988 mm for what is 300 mm, u = 3 µm."""
    draws = 40 + 10 * np.random.default_rng(8).standard_normal((20_000, 1))
    virtual = Virtual(pair(), MeasurementConditions(machine(["scale_x"], draws, corrected=False), (POSE,)))
    simulated = simulate_adaptively(virtual.source, digits=1, fewest_trials=100_000)
    indicated = pair().points * [1 - 40e-6, 1, 1]
    one = stated(simulated, evaluated(pair(), indicated))[0]
    assert simulated.stable
    assert one.value == pytest.approx(300.0, abs=1e-4)
    assert one.u == pytest.approx(3e-3, rel=0.02)
    assert one.k == pytest.approx(1.96, rel=0.02)
    # the ends of the shortest of many almost equal intervals are known to a tenth of u
    assert one.interval == pytest.approx((300 - 1.96 * 3e-3, 300 + 1.96 * 3e-3), abs=3e-4)
    assert stated(simulated)[0].value is None
    with pytest.raises(CmmUqError, match="1 points were measured, the plan has 2"):
        evaluated(pair(), indicated[:1])


def test_errors_about_large_ones_are_differences_of_whole_machines() -> None:
    """A draw about a mean of 174″ and 110 ppm is a machine of these errors: to its angle, 0.8 mrad, times the change, 2 µm."""
    names = ["scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx", "rotation_x_z"]
    mean = np.array([80.0, 110, 30, -174, -17, 19, 5])
    change = np.array([3.0, -2, 4, 2, -3, 2, 1])
    plan = Plan(*block(), styli=(Stylus("stylus", np.array([0, 0, -100.0]), 4.0),))

    def at(*draws: np.ndarray) -> AtPose:
        return AtPose(plan, MeasurementConditions(machine(names, draws, corrected=False)), POSE)

    apart = [at(mean + way * change).errors([np.zeros((1, 7))], exact=True)[0] for way in (1, -1)]
    drawn = at(mean + change, mean - change).errors([np.array([change, -change])], exact=True)
    assert np.abs(apart[0] - apart[1]).max() > 200 * 4e-6
    np.testing.assert_allclose(drawn[0] - drawn[1], apart[0] - apart[1], atol=4e-6)


def test_characteristics_that_err_together_conform_together() -> None:
    """Two lengths by one scale of 10 ppm, each one standard deviation below its limit: both conform when one does."""
    draws = 10 * np.random.default_rng(9).standard_normal((50_000, 1))
    spots = (spot("o", [0, 0, 0]), spot("a", [200, 0, 0]), spot("b", [400, 0, 0]))
    lengths = (PartCharacteristic("a", "distance", ("o", "a"), upper=200.002),
               PartCharacteristic("b", "distance", ("o", "b"), upper=400.004),
               PartCharacteristic("ab", "distance", ("a", "b")))  # fmt: skip
    plan = Plan(spots, lengths)
    errors_of = Virtual(plan, MeasurementConditions(machine(["scale_x"], draws), (POSE,))).errors(
        np.random.default_rng(0), 50_000
    )
    each, together = conforming(plan, errors_of, np.array([200.0, 400.0, 200.0]))
    np.testing.assert_allclose(each, [0.8413, 0.8413, np.nan], atol=0.006)
    assert together == pytest.approx(each[0], abs=1e-9)


def test_rows_of_a_table_that_is_followed_once_err_as_they_do_on_their_own() -> None:
    """300 draws out of 500 rows of a posterior, against the coefficients themselves: to first order and on the points."""
    names = ["scale_x", "squareness_xy", "straightness_x_z"]
    state = machine(names, np.random.default_rng(2).standard_normal((500, 3)) * 5, 1.0)
    flat = PartCharacteristic("flat", "flatness", ("A",))
    features, characteristics = block()
    at = AtPose(Plan(features, (*characteristics, flat)), MeasurementConditions(state), POSE)
    for seed in (0, 1):  # the second time it is looked up
        drawn = at.drawn(np.random.default_rng(seed), 300)
        assert isinstance(drawn[0], Rows)
        for exact in (True, False):
            alone = at.errors([np.asarray(one) for one in drawn], exact=exact)
            np.testing.assert_allclose(at.errors(drawn, exact=exact), alone, atol=1e-12)
    assert alone[:, -1].std() > 1e-4


def test_form_alone_needs_no_first_order() -> None:
    """A flatness of noise of 1 µm at 100 points by both associations: the zone is narrower, in every draw."""
    face = plane("A", [0, 0, 1], [0, 0, 0], [[200, 0, 0], [0, 100, 0]], (10, 10))
    both = tuple(
        PartCharacteristic(how, "flatness", ("A",), association=how) for how in ("least_squares", "minimum_zone")
    )
    virtual = Virtual(Plan((face,), both), MeasurementConditions(machine(noise_um=1.0), (POSE,)))
    squares, zone = virtual.errors(np.random.default_rng(0), 300).T
    assert (zone <= squares + 1e-9).all()
    # the range of 100 independent normal numbers is 5.015 σ on average (David and Nagaraja 2003); the plane takes 3 of 100
    assert squares.mean() == pytest.approx(5.015e-3 * np.sqrt(0.97), rel=0.02)


def test_a_position_that_is_off_errs_to_both_sides() -> None:
    """Two independent errors of 1 µm: off by 0.1 mm it has twice the one along, of 2 µm; at zero a Rayleigh distribution."""
    hole = circle("hole", [50, 50, 0], 5.0, 4)
    ends = (spot("o", [0, 0, 0]), spot("along", [100, 0, 0]), spot("up", [0, 100, 0]))
    tip = Stylus("tip", u_offset_um=np.array([1.0, 1.0, 0.0]))
    probed = replace(hole, stylus="tip")
    plan = Plan(
        (probed, *ends),
        (PartCharacteristic("p", "position", ("hole",), ("o", "along", "up")),),
        (Stylus("stylus"), tip),
    )
    off = plan.points + np.where(plan.stylus_of[:, None] == 1, [0.05, 0.0, 0.0], 0.0)
    for measured, u, mean in ((None, 2e-3 * np.sqrt(2 - np.pi / 2), 2e-3 * np.sqrt(np.pi / 2)), (off, 2e-3, 0.0)):
        given = MeasurementConditions(machine(), (POSE,), measured=measured)
        found = Virtual(plan, given).errors(np.random.default_rng(0), 50_000)[:, 0]
        assert found.std() == pytest.approx(u, rel=0.02)
        assert found.mean() == pytest.approx(mean, abs=5e-5)


@pytest.mark.parametrize(("common", "own"), [(1.0, 0.0), (0.0, 1.0), (1.0, 1.0)])
@pytest.mark.parametrize("off_um", [0.0, 1.5, 4.0])
def test_where_a_hole_truly_is_follows_from_where_it_was_measured(common: float, own: float, off_um: float) -> None:
    """Measured r off its place with errors of s along each axis, common or of each point: P(θ ≤ t) = P(|t + s| ≥ r), the
    noncentral χ² of two degrees of freedom (scipy's); twice that is the position."""
    hole, ends = circle("hole", [50, 50, 0], 5.0, 4), (spot("o", [0, 0, 0]), spot("a", [100, 0, 0]))
    tip = Stylus("tip", u_offset_um=np.array([common, common, 0.0]))
    plan = Plan((replace(hole, stylus="tip"), *ends, spot("up", [0, 100, 0])),
                (PartCharacteristic("p", "position", ("hole",), ("o", "a", "up")),), (Stylus("stylus"), tip))  # fmt: skip
    of_hole = np.tile((plan.stylus_of == 1)[:, None], (1, 3))
    # the centre is the mean of two of four points along each axis with weight 1/2: u of each reading over √2
    noise = PointScatter.of("noise", "reading", np.sqrt(2) * 1e-3 * own * of_hole)
    measured = plan.points + 1e-3 * off_um * of_hole * [1, 0, 0]
    given = MeasurementConditions(machine(), (POSE,), further=(noise,), measured=measured)
    true = evaluated(plan, measured) - Virtual(plan, given).errors(np.random.default_rng(0), 25_000)
    s = np.hypot(common, own)
    for limit in (1.0, 2.0, 3.0):
        expected = ncx2.sf((off_um / s) ** 2, 2, (limit / s) ** 2) if off_um else 1.0
        assert np.mean(true <= 2e-3 * limit) == pytest.approx(expected, abs=0.015)
    assert true.std() > 1e-3 * s  # nor where it was measured in its very place


def test_what_is_linear_errs_alike_about_measured_and_nominal_points() -> None:
    """The same draws of scale, tip and noise: with both signs, to squares of micrometres over millimetres."""
    features, characteristics = block()
    sizes = tuple(one for one in characteristics if one.what in ("size", "distance", "angle", "x", "y"))
    plan = Plan(features, sizes, (Stylus("stylus", u_diameter_um=2.0),))
    given = MeasurementConditions(machine(["scale_x", "squareness_xy"], [[10.0, 5.0], [-10.0, -5.0]], 1.0), (POSE,))
    nominal, measured = AtPose(plan, given, POSE), AtPose(plan, replace(given, measured=plan.points), POSE)
    drawn = nominal.drawn(np.random.default_rng(0), 100)
    for exact in (True, False):
        expected = nominal.errors(drawn, exact=exact)
        np.testing.assert_allclose(measured.errors(drawn, exact=exact), expected, atol=3e-5)
        assert (expected.std(axis=0)[[one.what != "angle" for one in sizes]] > 3e-4).all()


@pytest.mark.parametrize("bow", [10.0, -10.0])
def test_a_form_that_was_measured_errs_only_to_be_larger(bow: float) -> None:
    """A face that was measured flat, by a straightness that may be off by ±10 µm: larger by as much, never smaller."""
    face = plane("A", [0, 0, 1], [0, 0, 0], [[200, 0, 0], [0, 100, 0]], (5, 3))
    plan = Plan((face,), (PartCharacteristic("f", "flatness", ("A",)),))
    state = machine(["straightness_x_z"], [[bow], [-bow]])
    off = AtPose(plan, MeasurementConditions(state, (POSE,), measured=plan.points), POSE)
    along = 0.01 * (1 - (2 * (300.0 + np.linspace(0, 200, 5)) / 900 - 1) ** 2)
    line = np.polynomial.Polynomial.fit(np.arange(5), along, 1)(np.arange(5))
    np.testing.assert_allclose(off.errors([np.array([[bow], [-bow]])], exact=True), np.ptp(along - line), rtol=1e-3)


@pytest.mark.parametrize("what", ["position", "flatness"])
def test_a_mean_error_is_taken_off_what_was_measured_once(what: str) -> None:
    """Of a machine whose errors are known, uncorrected: measured less error is the characteristic of the part as it is."""
    hole, ends = circle("hole", [50, 50, 0], 5.0, 4), (spot("o", [0, 0, 0]), spot("a", [100, 0, 0]))
    face = plane("A", [0, 0, 1], [0, 0, 0], [[200, 0, 0], [0, 100, 0]], (5, 3))
    of, datums = (("hole",), ("o", "a", "up")) if what == "position" else (("A",), ())
    plan = Plan((hole, *ends, spot("up", [0, 100, 0]), face), (PartCharacteristic("c", what, of, datums),))
    state = machine(["scale_x", "straightness_x_z"], [[100.0, 20.0]], corrected=False)
    at = AtPose(plan, MeasurementConditions(state, (POSE,)), POSE)
    true = plan.points + np.random.default_rng(1).normal(0, 0.01, plan.points.shape)
    measured = true + at.measured.base
    found = AtPose(plan, MeasurementConditions(state, (POSE,), measured=measured), POSE)
    left = evaluated(plan, measured) - found.errors([np.zeros((1, 2))], exact=True)[0]
    np.testing.assert_allclose(left, characteristics_of(plan, true), atol=1e-9)
    assert np.abs(evaluated(plan, measured) - left).max() > 1e-4


@pytest.mark.long
@pytest.mark.parametrize(("digits", "least"), [(1, 100_000), (3, 200_000)])
def test_as_many_are_drawn_as_the_digits_need(digits: int, least: int) -> None:
    """u of a distance by two readings, √2 · 1 µm, to better than 1 %, by a hundred thousand at least (JCGM 101:2008, 7.9)."""
    source = Virtual(pair(), MeasurementConditions(machine(noise_um=1.0), (POSE,))).source
    found = simulate_adaptively(source, digits=digits, fewest_trials=100_000)
    assert found.trials >= least
    assert found.u[0] == pytest.approx(np.sqrt(2) * 1e-3, rel=0.01)
    low, high = found.interval[0]
    assert 0.5 * (high - low) == pytest.approx(1.96 * np.sqrt(2) * 1e-3, rel=0.02)


def test_a_seed_gives_the_same_bytes() -> None:
    """In blocks that are drawn by two threads too."""
    plan, given = Plan(*block()), MeasurementConditions(machine(noise_um=1.0), (POSE,))
    one, other = (Virtual(plan, given).errors(np.random.default_rng(7), 5000) for _ in range(2))
    assert one.tobytes() == other.tobytes()
    assert len(np.unique(one[:, 0])) == 5000
