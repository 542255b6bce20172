"""What an effect says of its size has the sign of what it does to points, by constructions that know no formula."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.machine.physics.catalogue import EVERY
from cmm_uq.machine.physics.effect import Amount, Effect
from tests.recordings import TRAVEL

MACHINE = Machine("m", "XYZ", TRAVEL)
AXES = "xyz"
_SMALL = 1e-5


def said(name: str, sign: float) -> str:
    """Of an effect whose linear parameter is one, or minus one, of its unit."""
    effect = EVERY[name]
    return str.__str__(effect.meaning({p.name: Amount(say("ONE"), sign < 0) for p in effect.reported}))


def true(name: str, indicated: Floats, sign: float, **columns: Floats) -> Floats:
    """Where points truly are that are indicated somewhere; the effect is small enough not to turn anything round."""
    effect, n = EVERY[name], len(indicated)
    points = Points(indicated, np.ones(n, int), np.arange(1, n + 1), np.ones(n, int), MACHINE, columns, np.arange(n))
    return indicated + sign * _SMALL * effect.basis(points, tuple(s.low for s in effect.shape))[:, :, 0]


def ways(axis: int, *readings: float) -> Floats:
    """Points on a line along an axis, in the middle of the other travels."""
    found = np.tile(TRAVEL.mean(axis=1), (len(readings), 1))
    found[:, axis] = readings
    return found


BOTH = pytest.mark.parametrize("sign", [1.0, -1.0])


@BOTH
@pytest.mark.parametrize(("name", "columns"), [
    *((f"scale_{a}", {}) for a in AXES),
    *((f"thermal_scale_{a}", {f"temp_{a}_c": np.array([24.0, 24.0])}) for a in AXES),
    *((f"scale_drift_{a}", {"time_s": np.array([3600.0, 3600.0])}) for a in AXES),
    *((f"scale_settling_{a}", {"time_s": np.array([3.6e5, 3.6e5])}) for a in AXES),
])  # fmt: skip
def test_a_length_is_indicated_too_short_where_it_truly_is_longer(
    name: str, columns: dict[str, Floats], sign: float
) -> None:
    axis = AXES.index(name[-1])
    ends = true(name, ways(axis, 100.0, 300.0), sign, **columns)
    longer = bool(np.linalg.norm(ends[1] - ends[0]) > 200.0)
    told = said(name, sign)
    assert (" short" in told or "more than is compensated" in told) == longer
    assert (" long" in told or "less than is compensated" in told) != longer
    assert "ONE" in told


@BOTH
@pytest.mark.parametrize("plane", ["xy", "yz", "zx"])
def test_the_angle_between_two_axes_is_90_degrees_plus_or_minus(plane: str, sign: float) -> None:
    """The angle of the true ways of points that each axis by itself indicates."""
    first, second = sorted(plane)
    at = np.zeros((3, 3))
    at[1, AXES.index(first)] = at[2, AXES.index(second)] = 400.0
    start, one, other = true(f"squareness_{plane}", at, sign)
    obtuse = bool((one - start) @ (other - start) < 0)
    told = said(f"squareness_{plane}", sign)
    assert told == f"the angle between {first.upper()} and {second.upper()} is 90° {'plus' if obtuse else 'minus'} ONE"


@BOTH
@pytest.mark.parametrize("name", [n for n in EVERY if n.startswith("straightness_")])
def test_a_bow_runs_towards_the_side_on_which_its_middle_is(name: str, sign: float) -> None:
    axis, direction = (AXES.index(a) for a in name.split("_")[1:])
    low, high = TRAVEL[axis]
    path = true(name, ways(axis, low, (low + high) / 2, high), sign)[:, direction]
    side = "plus" if path[1] > 0.5 * (path[0] + path[2]) else "minus"
    assert f"ONE towards {side} {AXES[direction].upper()}" in said(name, sign)


@BOTH
@pytest.mark.parametrize("name", [n for n in EVERY if n.startswith(("hysteresis_", "play_"))])
def test_what_comes_from_minus_stands_on_the_side_that_is_told(name: str, sign: float) -> None:
    axis, direction = name.split("_")[1], AXES.index(name[-1])
    columns = {f"approach_{axis}": np.array([1.0, -1.0])}  # travelling to plus, it comes from minus
    from_minus, from_plus = true(name, ways(0, 100.0, 100.0), sign, **columns)[:, direction]
    side = "plus" if from_minus > from_plus else "minus"
    assert f"ONE further towards {side}" in said(name, sign)


@BOTH
@pytest.mark.parametrize("name", [n for n in EVERY if n.startswith(("drift_", "settling_"))])
def test_what_drifts_goes_to_the_side_that_is_told(name: str, sign: float) -> None:
    axis = AXES.index(name[-1])
    early, late = true(name, ways(axis, 100.0, 100.0), sign, time_s=np.array([0.0, 7200.0]))[:, axis]
    assert f"moves towards {'plus' if late > early else 'minus'} by ONE" in said(name, sign)


@BOTH
@pytest.mark.parametrize("axis", AXES)
def test_a_curved_scale_stands_beyond_its_reading_in_the_middle(axis: str, sign: float) -> None:
    low, high = TRAVEL[AXES.index(axis)]
    at = ways(AXES.index(axis), low, (low + high) / 2, high)
    off = (true(f"scale_curvature_{axis}", at, sign) - at)[:, AXES.index(axis)]
    side = "plus" if off[1] > 0.5 * (off[0] + off[2]) else "minus"
    assert f"ONE further towards {side} than it reads" in said(f"scale_curvature_{axis}", sign)


@BOTH
@pytest.mark.parametrize(("name", "at", "across"), [
    # what a carriage carries, and the two directions across the axis in the order in which a right hand turns
    ("rotation_x_x", (800.0, 300.0, -100.0), (1, 2)), ("rotation_x_y", (800.0, 300.0, -100.0), (2, 0)),
    ("rotation_x_z", (800.0, 300.0, -100.0), (0, 1)), ("rotation_y_x", (800.0, 300.0, -100.0), (1, 2)),
    ("rotation_y_y", (800.0, 300.0, -100.0), (2, 0)),
])  # fmt: skip
def test_clockwise_is_as_a_right_hand_turns(
    name: str, at: tuple[float, float, float], across: tuple[int, int], sign: float
) -> None:
    """Seen along an axis, the turn from the first to the second of the other two, in cyclic order, is clockwise."""
    carried = {"x": np.array([0.0, at[1], at[2]]), "y": np.array([0.0, 0.0, at[2]])}[name.split("_")[1]]
    moved = (true(name, np.array([at]), sign) - np.array([at]))[0]
    first, second = across
    turn = carried[first] * moved[second] - carried[second] * moved[first]
    assert f"the probe turns {'clockwise' if turn > 0 else 'anticlockwise'} by ONE" in said(name, sign)
    assert said(name, sign).endswith(f"seen along plus {name[-1].upper()}")


@BOTH
def test_a_stylus_too_large_finds_surfaces_inside_the_material(sign: float) -> None:
    normal = {"nx": np.array([0.0]), "ny": np.array([0.0]), "nz": np.array([1.0])}
    at = ways(2, -100.0)
    outside = bool(true("probe_radius", at, sign, **normal)[0, 2] > at[0, 2])
    assert ("too deep, inside the material" in said("probe_radius", sign)) == outside
    assert ("too early, outside the material" in said("probe_radius", sign)) != outside


@BOTH
def test_a_bar_that_sags_is_shorter_lying_level(sign: float) -> None:
    """An artefact's effect draws points to where they would lie without it."""
    level = ways(0, 100.0, 500.0)
    without = np.ptp(true("artefact_sag", level, sign)[:, 0])
    assert f"ONE {'shorter' if without > 400.0 else 'longer'} than upright" in said("artefact_sag", sign)


@BOTH
def test_a_warm_artefact_that_expands_more_is_drawn_together(sign: float) -> None:
    ends = true("thermal_artefact", ways(0, 100.0, 500.0), sign, temp_artefact_c=np.array([25.0, 25.0]))
    assert f"ONE {'more' if np.ptp(ends[:, 0]) < 400.0 else 'less'} than is reckoned with" in said(
        "thermal_artefact", sign
    )


def test_what_swings_is_told_with_its_period() -> None:
    amounts = {"amplitude_um": Amount(say("THREE")), "period_mm": Amount(say("TEN")), "phase_rad": Amount(say("no"))}
    told = EVERY["periodic_scale_y"].meaning(amounts)
    assert told == "the error of Y swings to either side by THREE and repeats every TEN"
    told = EVERY["probe_lobing"].meaning(amounts)
    assert told == "the probing error swings to either side by THREE, three times in a turn about Z"


def test_effects_with_nothing_to_add_say_nothing() -> None:
    class Plain(Effect):
        name = "plain"

        def basis(self, points: Points, shape: object = ()) -> Floats:
            return np.zeros((len(points), 3, 1))

    assert Plain().meaning({}) == ""
