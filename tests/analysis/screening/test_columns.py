"""What stands beside the coordinates: units, clocks, sensors that stick, columns that slipped; and honest ones left alone."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.analysis.screening.columns import column_findings
from cmm_uq.analysis.screening.screening import screen
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Points
from tests.recordings import bar_facts, screened, with_columns


def warming(points: Points, seed: int = 3) -> Floats:
    """One temperature for both balls of each bar, to 1 mK, that wanders as a room does."""
    steps = np.random.default_rng(seed).normal(0.0, 0.05, len(points) // 2)
    return np.repeat(np.round(20 + np.cumsum(steps), 3), 2)


def kinds(points: Points) -> list[str]:
    return [found.kind for found in column_findings(points, balls=True)]


@pytest.mark.parametrize(
    ("column", "values", "unit"),
    [
        ("temp_x_c", 293.15, "kelvin"),
        ("temp_artefact_c", 68.0, "°F"),
        ("pressure_hpa", 101325.0, "Pa"),
        ("humidity_pct", 0.45, "a fraction of 1"),
    ],
)
def test_a_whole_column_in_another_unit_is_refused_though_the_model_does_not_use_it(
    ballbar_points: Points, column: str, values: float, unit: str
) -> None:
    spoilt = with_columns(ballbar_points, **{column: np.full(len(ballbar_points), values)})
    with pytest.raises(CmmUqError, match=f"looks like {unit}") as error:
        screen(spoilt, needed=set(), set_aside=[], where="bar.csv")
    assert error.value.where == f"bar.csv line 2, column {column}"


def test_one_value_of_a_recording_of_few_placings_is_no_whole_column(ballbar_points: Points) -> None:
    two = ballbar_points.select(np.arange(4))
    spoilt = with_columns(two, temp_x_c=np.array([20.0, 20.1, 293.2, 20.2]))
    (found,) = screen(spoilt, needed=set(), set_aside=[], where="bar.csv")
    assert found.kind == "unit"


def test_one_kelvin_among_degrees_leaves_the_column_out(ballbar_points: Points) -> None:
    values = warming(ballbar_points)
    values[4] += 273.15
    spoilt = with_columns(ballbar_points, temp_y_c=values)
    found = screened(spoilt, bar_facts(), needed=set(), set_aside=[], where="bar.csv")
    (unit,) = found.findings
    assert (unit.kind, unit.lines, unit.set_aside) == ("unit", (6,), True)
    assert "temp_y_c" not in found.points.columns
    assert len(found.points) == len(ballbar_points)


def test_a_column_that_the_model_uses_is_never_left_out_but_refused(ballbar_points: Points) -> None:
    values = warming(ballbar_points)
    values[4] += 273.15
    with pytest.raises(CmmUqError, match="mend it, or leave out the effect"):
        screen(with_columns(ballbar_points, temp_y_c=values), needed={"temp_y_c"}, set_aside=[], where="bar.csv")


@pytest.mark.parametrize(("factor", "says"), [(1e3, "milliseconds"), (1 / 60, "minutes"), (1 / 3600, "hours")])
def test_a_clock_in_other_units_shows_in_the_time_from_ball_to_ball(
    ballbar_points: Points, factor: float, says: str
) -> None:
    """Thirty seconds a ball: nobody waits eight hours between the two of a bar, no machine probes one in half a second."""
    time = 30.0 * np.arange(len(ballbar_points))
    assert kinds(with_columns(ballbar_points, time_s=time)) == []
    (found,) = column_findings(with_columns(ballbar_points, time_s=factor * time), balls=True)
    assert found.kind == "unit"
    assert says in found.why


@pytest.mark.parametrize(("factor", "says"), [(1e3, "milliseconds"), (1 / 60, "minutes"), (1 / 3600, "hours")])
def test_one_moment_in_other_units_breaks_the_order_and_is_named(
    ballbar_points: Points, factor: float, says: str
) -> None:
    time = 30.0 * np.arange(1, len(ballbar_points) + 1)
    time[10] *= factor
    (found,) = column_findings(with_columns(ballbar_points, time_s=time), balls=True)
    assert (found.kind, found.lines) == ("unit", (12,))
    assert says in found.why


def test_a_sensor_that_sticks_is_found_with_its_lines(ballbar_points: Points) -> None:
    values = warming(ballbar_points)
    values[40:70] = values[40]
    (found,) = column_findings(with_columns(ballbar_points, temp_z_c=values), balls=True)
    assert (found.kind, found.column) == ("stuck", "temp_z_c")
    assert found.lines == tuple(range(42, 72))


@pytest.mark.parametrize("resolution", [0.1, 0.5])
def test_a_coarse_thermometer_in_a_steady_room_does_not_stick(ballbar_points: Points, resolution: float) -> None:
    coarse = np.round(warming(ballbar_points) / resolution) * resolution
    assert kinds(with_columns(ballbar_points, temp_z_c=coarse)) == []


@pytest.mark.parametrize("value", [20.0, 19.87])
def test_a_constant_temperature_is_no_fault(ballbar_points: Points, value: float) -> None:
    steady = np.full(len(ballbar_points), value)
    assert kinds(with_columns(ballbar_points, temp_air_c=steady, temp_x_c=warming(ballbar_points))) == []


@pytest.mark.parametrize("by", [1, -1])
def test_a_column_that_changes_inside_every_placing_slipped_by_a_row(ballbar_points: Points, by: int) -> None:
    """Of pairs nobody can tell which way: moved on by another row they are whole again."""
    values = np.roll(warming(ballbar_points), by)
    sound = warming(ballbar_points, seed=4)
    (found,) = column_findings(with_columns(ballbar_points, temp_x_c=values, temp_y_c=sound), balls=True)
    assert (found.kind, found.column) == ("shifted column", "temp_x_c")
    assert "shifted down or up by one row" in found.why


def test_temperatures_read_at_every_ball_have_not_slipped(ballbar_points: Points) -> None:
    own = 20 + 0.1 * np.random.default_rng(8).standard_normal(len(ballbar_points))
    assert kinds(with_columns(ballbar_points, temp_x_c=own)) == []


def sphere(points: Points) -> tuple[Floats, Floats]:
    """Outward normals, and the signs of travel against them."""
    normals = np.random.default_rng(6).standard_normal((len(points), 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return normals, -np.sign(normals)


def with_travel(points: Points, normals: Floats, travel: Floats) -> Points:
    columns = {f"n{a}": normals[:, i] for i, a in enumerate("xyz")}
    return with_columns(points, **columns, **{f"approach_{a}": travel[:, i] for i, a in enumerate("xyz")})


def test_directions_of_travel_that_slipped_by_a_row_meet_surfaces_from_inside(ballbar_points: Points) -> None:
    normals, travel = sphere(ballbar_points)
    assert column_findings(with_travel(ballbar_points, normals, travel), balls=False) == []
    (found,) = column_findings(with_travel(ballbar_points, normals, np.roll(travel, 1, axis=0)), balls=False)
    assert (found.kind, found.column) == ("shifted column", "approach_x")


def test_directions_of_travel_away_from_every_surface_have_the_wrong_sign(ballbar_points: Points) -> None:
    normals, travel = sphere(ballbar_points)
    (found,) = column_findings(with_travel(ballbar_points, normals, -travel), balls=False)
    assert found.kind == "sign"


def test_scanning_along_a_surface_is_no_fault(ballbar_points: Points) -> None:
    """Directions that have nothing to do with the normals point outwards half of the time."""
    normals, _ = sphere(ballbar_points)
    travel = np.random.default_rng(7).choice([-1.0, 1.0], normals.shape)
    assert column_findings(with_travel(ballbar_points, normals, travel), balls=False) == []
