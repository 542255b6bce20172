"""What runs are read against: a straightedge turned over, a square, a circle; references with an uncertainty."""

from __future__ import annotations

import csv

import numpy as np
import pytest
import scipy.optimize

from cmm_uq.analysis.conformity.positioning import axes, circles, conditions, diagonals, uncertainty_of_figures
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.axis_runs.artefact import AxisRuns
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING
from cmm_uq.base.points import Floats, Points
from cmm_uq.jobs.tables.conformity import Circumstances, TestUncertainty
from cmm_uq.maths.geometry.positioning import CircularTest
from tests.artefacts.constructions import estimated, model
from tests.artefacts.simulated import results
from tests.artefacts.test_axis_runs import EXACT, TARGETS, X, Y, Z, joined, read, run
from tests.conftest import ROOT
from tests.recordings import TRAVEL

SECOND = np.pi / 180 / 3600
PROFILE = np.array([0.0, 0.4, -0.3, 0.8, 1.1, -0.2, 0.6, 0.1, -0.5, 0.0])  # of a straightedge at the targets, µm


def marked(rows: dict[str, Floats], **columns: float) -> dict[str, Floats]:
    return {**rows, **{name: np.full(len(rows["xyz"]), value) for name, value in columns.items()}}


def on_edge(number: int, side: float, zero: float, slope: float) -> dict[str, Floats]:
    rows = read(run(number, Y), zero, slope)
    rows["reading_um"] = rows["reading_um"] + side * np.interp(rows["xyz"][:, 0], TARGETS, PROFILE)
    return marked(rows, straightedge=side)


def test_a_straightedge_turned_over_is_taken_out_of_the_straightness() -> None:
    """Readings with the edge and against it: half their sum is the machine's, half their difference the edge's profile."""
    both = joined(on_edge(1, 1.0, 3.0, 0.01), on_edge(2, -1.0, -2.0, -0.004))
    found = estimated(EXACT, both, ["straightness_x_y"])
    assert found.value[0] == pytest.approx(0.05, rel=1e-4)
    assert np.abs(found.residuals).max() < 1e-9
    seen = AxisRuns(EXACT, both)
    x = seen.positioning(seen.runs[0]).mean[0]
    alone = AxisRuns(EXACT, joined(marked(read(run(1, Y)), straightedge=0.0)))
    assert x == pytest.approx(alone.positioning(alone.runs[0]).mean[0], abs=1e-9)


def test_a_straightedge_that_was_not_turned_over_says_nothing_of_the_straightness() -> None:
    found = model(
        EXACT,
        joined(on_edge(1, 1.0, 3.0, 0.01), read(marked(run(2, X), straightedge=0.0))),
        ["scale_x", "straightness_x_y"],
    )
    linear = found.linearised(np.zeros(len(found.unknowns)))
    k = [unknown.key[0] for unknown in found.unknowns].index("straightness_x_y")
    free = linear.freedoms.dense()
    column = linear.design[:, k]
    assert np.linalg.norm(column - free @ np.linalg.lstsq(free, column, rcond=None)[0]) < 1e-9 * np.linalg.norm(column)


LEGS = artefact_facts(kind="axis_runs", square_arcsec=2.0, u_square_arcsec=0.0)


def on_square(out_of_square: float, angle: float, turn: float) -> Points:
    """Two legs along X and Y of a square of 90° + angle (″), turned by ``turn``; axes at 90° + out_of_square (″).

    The legs' directions from +X: ``turn`` and 90° + angle + turn. Axis X lies along +X, axis Y at 90° + out_of_square. What is
    read is how far the carriage goes off the leg, to the left of it along X (+y), against x along Y.
    """
    first, second = (
        marked(run(1, Y, at=np.linspace(100, 800, 8)), square=1.0),
        marked(run(2, X, axis=1, place=(300.0, -200.0), at=np.linspace(100, 800, 8)), square=1.0),
    )
    first["reading_um"] = -1000 * SECOND * turn * first["xyz"][:, 0]
    leg, axis = angle + turn, out_of_square
    second["reading_um"] = 1000 * SECOND * (leg - axis) * second["xyz"][:, 1]
    return joined(first, second)


@pytest.mark.parametrize(("angle", "turn"), [(2.0, 0.0), (2.0, 7.0), (2.0, -30.0)])
def test_runs_along_both_legs_of_a_square_give_the_squareness(angle: float, turn: float) -> None:
    """However the square lies; its own angle by certificate is taken off. Angle between the axes less 90° is Sxy."""
    found = estimated(LEGS, on_square(1.5, angle, turn), ["squareness_xy"])
    assert found.value[0] == pytest.approx(1.5, abs=1e-4)


def test_the_angle_of_the_square_is_in_the_uncertainty_of_the_squareness() -> None:
    stated = artefact_facts(kind="axis_runs", square_arcsec=2.0, u_square_arcsec=0.4)
    found = estimated(stated, on_square(1.5, 2.0, 3.0), ["squareness_xy"], 1e-7)
    assert np.sqrt(found.covariance[0, 0]) == pytest.approx(0.4, rel=1e-3)


ANGLE = np.radians(np.arange(0, 360, 10))


def circle(number: int, radius: float, deviations: Floats, there: Floats = ANGLE) -> dict[str, Floats]:
    """Round counter-clockwise about +Z and back; ``deviations`` (2, t) µm at angles (t,)."""
    at, way = np.concatenate([there, there[::-1]]), np.repeat([1.0, -1.0], len(there))
    outward = np.column_stack([np.cos(at), np.sin(at), 0 * at])
    n = len(at)
    rows = {
        "xyz": np.array([450.0, 500.0, -200.0]) + radius * outward,
        "measurement": np.full(n, number),
        "point": np.arange(1, n + 1),
        "repeat": np.ones(n, dtype=int),
    }
    rows |= {"reading_um": np.concatenate([deviations[0], deviations[1][::-1]]), "reading_arcsec": np.zeros(n)}
    travel = way[:, None] * np.column_stack([-np.sin(at), np.cos(at), 0 * at])
    for i, a in enumerate("xyz"):
        rows |= {
            f"approach_{a}": travel[:, i],
            f"read_{a}": outward[:, i],
            f"turn_{a}": np.zeros(n),
            f"tip_{a}_mm": np.zeros(n),
        }
    return rows


def test_an_ellipse_across_the_diagonals_is_a_squareness() -> None:
    """Axes at 90° + s: a point at (x, y) truly lies at (x − s·y, y), so that the radius changes by −s·R·sin φ·cos φ."""
    off = -SECOND * 3.0 * 150_000 * np.sin(ANGLE) * np.cos(ANGLE) + 2.0 * np.cos(ANGLE) - 5.0 * np.sin(ANGLE) + 8.0
    found = estimated(EXACT, joined(circle(1, 150.0, np.stack([off, off]))), ["squareness_xy"])
    assert found.value[0] == pytest.approx(3.0, rel=1e-4)
    assert np.abs(found.residuals).max() < 1e-7  # the small of the second order: 0.03 nm


def test_of_a_ballbar_of_known_length_the_radius_is_a_scale() -> None:
    """Both axes 20 ppm long: a circle of 150 mm is 3 µm large; without the bar's length nothing is known of it."""
    off = np.full(36, 3.0)
    known = artefact_facts(kind="axis_runs", u_bar_um=0.0)
    found = estimated(known, joined(circle(1, 150.0, np.stack([off, off]))), ["scale_x", "scale_y"])
    assert found.value[:2] == pytest.approx([20.0, 20.0], rel=1e-4)
    free = estimated(
        EXACT, joined(circle(1, 150.0, np.stack([off + 2.0 * np.cos(2 * ANGLE)] * 2))), ["scale_x", "scale_y"]
    )
    assert free.value[0] - free.value[1] == pytest.approx(4.0 / 150e-3, rel=1e-4)


def test_figures_of_a_circular_test_by_hand() -> None:
    """Three lobes have the same least zone about any centre: 2·amplitude. Hysteresis: what one sense alone has."""
    off = 1.5 * np.cos(3 * ANGLE) + 4.0 * np.cos(ANGLE) - 3.0 * np.sin(ANGLE) + 6.0
    back = off + np.where(np.arange(36) == 9, 2.5, 0.0)
    seen = AxisRuns(artefact_facts(kind="axis_runs", u_bar_um=0.2), joined(circle(1, 150.0, np.stack([off, back]))))
    (test,) = seen.positionings().values()
    assert isinstance(test, CircularTest)
    figures = test.figures()
    assert figures["G↺"] == pytest.approx(3.0, abs=1e-9)
    assert figures["H"] == pytest.approx(2.5)
    assert figures["Fmax"] >= 7.5
    assert figures["Fmin"] == pytest.approx(4.5, abs=0.2)
    assert figures["D"] == pytest.approx(6.0 + 2.5 / 72)
    assert figures["G(b)"] == pytest.approx(zone(np.concatenate([off, back])), abs=1e-6)
    assert figures["G↻"] == pytest.approx(zone(back), abs=1e-6)


def test_a_reading_far_off_says_how_much_scatter_made_of_a_hysteresis() -> None:
    """A smooth path with noise 0.3, and one reading 3 µm off: about the median of five readings the figure is by so much less.

    By loops, other draws; without the one far off the figure's growth by scatter once more is the larger, and stands.
    """
    random, count = np.random.default_rng(4), 72
    targets = np.arange(0, 360, 5.0)
    path = np.stack([np.cos(np.radians(targets)), -np.cos(np.radians(targets))]) + 0.3 * random.normal(size=(2, count))
    for far in (3.0, 0.0):
        x = path.copy()
        x[0, 20] += far * np.sign(x[0, 20] - x[1, 20])
        test = CircularTest(targets, x[:, :, None], "↺↻", u_reference=0.0, length_mm=150.0)
        found = uncertainty_of_figures(test, Circumstances(uncertainty=TestUncertainty(u_repeat_um=0.3)))["H"]
        plain = np.empty_like(x)
        for side in range(2):
            near = [np.median([x[side, (k + j) % count] for j in range(-2, 3)]) for k in range(count)]
            off = x[side] - near
            plain[side] = near + np.sqrt(max(0.0, 1 - 0.09 / np.mean(off**2))) * off
        draws = [0.3 * random.standard_t(4, (2, count)) / np.sqrt(2) for _ in range(4000)]
        H = [np.abs(np.diff(each, axis=0)).max() for each in (x, plain)]
        once, more = ([np.abs(np.diff(x + n * each, axis=0)).max() for each in draws] for n in (1.0, np.sqrt(3)))
        added = max(abs(np.mean(more) - H[0]), abs(H[0] - H[1]))
        assert (abs(H[0] - H[1]) > abs(np.mean(more) - H[0])) == (far > 0)
        assert found == pytest.approx(np.hypot(added, np.std(once)), rel=0.08)


def zone(values: Floats, there: Floats = ANGLE) -> float:
    """Range about the best centre, by a simplex search from many starts (no linear programming)."""
    angle = np.tile(there, len(values) // len(there))
    design = np.column_stack([np.cos(angle), np.sin(angle), np.ones_like(angle)])
    centre = np.linalg.lstsq(design, values, rcond=None)[0][:2]

    def span(c: Floats) -> float:
        return float(np.ptp(values - c[0] * np.cos(angle) - c[1] * np.sin(angle)))

    fine = {"xatol": 1e-10, "fatol": 1e-12, "maxiter": 5000}
    starts = [centre + np.array([a, b]) for a in (-1, 0, 1) for b in (-1, 0, 1)]
    return float(min(scipy.optimize.minimize(span, start, method="Nelder-Mead", options=fine).fun for start in starts))


def test_the_larger_of_two_rounds_is_the_figure() -> None:
    small, large = 1.0 * np.cos(3 * ANGLE), 2.0 * np.cos(3 * ANGLE)
    first, second = circle(1, 150.0, np.stack([small, small])), circle(1, 150.0, np.stack([large, small]))
    second["repeat"] = second["repeat"] + 1
    (test,) = AxisRuns(EXACT, joined(first, second)).positionings().values()
    assert test.figures()["G↺"] == pytest.approx(4.0)
    assert test.figures()["G↻"] == pytest.approx(2.0)
    assert "Fmax" not in test.figures()


def test_references_stated_enter_what_is_read_against_them() -> None:
    """A reference with a bow of u, a rotation that grows by u: so much the factors are uncertain, without noise."""
    stated = artefact_facts(kind="axis_runs", u_straightness_um=0.5, u_rotation_arcsec=0.3)
    found = estimated(stated, joined(read(run(1, Y)), read(run(2, turn=Z))), ["straightness_x_y", "rotation_x_z"], 1e-7)
    assert np.sqrt(np.diag(found.covariance))[:2] == pytest.approx([0.5, 0.3 / 0.9], rel=1e-3)


def test_a_square_without_its_uncertainty_or_with_one_leg_is_refused() -> None:
    with pytest.raises(CmmUqError, match="u_square_arcsec"):
        AxisRuns(EXACT, on_square(1.0, 0.0, 0.0))
    with pytest.raises(CmmUqError, match="two legs"):
        AxisRuns(LEGS, joined(marked(run(1, Y), square=1.0)))


def test_a_repeat_with_the_other_sign_is_refused_and_noise_alone_is_not() -> None:
    rows = read(run(1, X, repeats=3), 5.0)
    assert len(AxisRuns(EXACT, joined(rows)).readings) == 60
    second = rows["repeat"] == 2
    rows["reading_um"] = np.where(second, -rows["reading_um"], rows["reading_um"])
    with pytest.raises(
        CmmUqError, match=r"line 22.*repeat 2 of measurement 1 reads as the others do with the other sign"
    ):
        AxisRuns(EXACT, joined(rows))
    for seed in range(200):
        white = np.random.default_rng(seed).normal(0, 1, (3, 20))
        for noise in (
            white,
            np.cumsum(white, axis=1),
        ):  # what drifts within each repeat looks as turned over more often
            rows["reading_um"] = noise.ravel()
            AxisRuns(EXACT, joined(rows))


def test_one_direction_of_a_repeat_with_the_other_sign_is_refused() -> None:
    rows = read(run(1, X, repeats=3), 5.0)
    back = (rows["repeat"] == 2) & (rows["approach_x"] < 0)
    rows["reading_um"] = np.where(back, -rows["reading_um"], rows["reading_um"])
    with pytest.raises(
        CmmUqError, match=r"line 32.*repeat 2, in one direction, of measurement 1 reads as the others do"
    ):
        AxisRuns(EXACT, joined(rows))


def test_a_point_that_another_repeat_approaches_the_other_way_is_refused_and_runs_of_one_direction_in_turn_are_not() -> (
    None
):
    rows = read(run(1, X, repeats=3))
    rows["approach_x"] = np.where(rows["repeat"] == 3, -rows["approach_x"], rows["approach_x"])
    with pytest.raises(CmmUqError, match=r"line 42.*point 1 of measurement 1 is approached the other way in repeat 3"):
        AxisRuns(EXACT, joined(rows))
    rows["approach_x"] = np.where(rows["repeat"] == 2, -1.0, 1.0)
    assert len(AxisRuns(EXACT, joined(rows)).readings) == 60


def test_positions_in_another_unit_are_refused() -> None:
    rows = read(run(1, X))
    rows["xyz"][:, 0] *= 25.4
    with pytest.raises(CmmUqError, match=r"line 2.*measurement 1 goes 25.4 times the travel of X") as error:
        AxisRuns(EXACT, joined(rows))
    assert "positions in mm" in str(error.value)


@pytest.mark.parametrize(("axis", "factor", "words"), [
    ("read", -1.0, "with the other sign"), ("turn", -1.0, "with the other sign"),
    ("turn", 1 / (1e-6 * 3600 * 180 / np.pi), "4.85 times as large"), ("turn", 1e-6 * 3600 * 180 / np.pi, "0.206 times"),
])  # fmt: skip
def test_a_line_that_was_read_before_shows_a_wrong_sign_and_a_wrong_unit(axis: str, factor: float, words: str) -> None:
    """All repeats of the later measurement are wrong; a line beside it is another one."""

    def line(number: int, times: float, place: tuple[float, float] = (0.0, 0.0)) -> dict[str, Floats]:
        rows = read(run(number, X, place=place) if axis == "read" else run(number, turn=Z, place=place), 3.0)
        noise = np.random.default_rng(number).normal(0, 1e-3, len(rows["xyz"]))
        for name in ("reading_um", "reading_arcsec"):
            if rows[name].any():
                rows[name] = times * rows[name] + noise
        return rows

    AxisRuns(EXACT, joined(line(1, 1.0), line(2, 1.0)))
    AxisRuns(EXACT, joined(line(1, 1.0), line(2, factor, (90.0, 0.0))))
    with pytest.raises(CmmUqError, match=f"line 42.*measurement 2 reads the line of measurement 1 {words}"):
        AxisRuns(EXACT, joined(line(1, 1.0), line(2, factor)))


def test_noise_alone_of_a_line_read_twice_is_no_contradiction() -> None:
    for seed in range(300):
        rows = [run(number, turn=Z) for number in (1, 2)]
        for one in rows:
            one["reading_arcsec"] = np.random.default_rng([seed, int(one["measurement"][0])]).normal(
                0, 1, len(one["xyz"])
            )
        AxisRuns(EXACT, joined(*rows))


def along_lines(signs: list[tuple[float, float, float]], part: float) -> AxisRuns:
    """Runs through the middle of the volume, each over a part of the travel of every axis that moves."""
    middle, size, runs = TRAVEL.mean(axis=1), np.ptp(TRAVEL, axis=1), []
    for number, sign in enumerate(signs, 1):
        line = part * size * np.array(sign)
        rows = run(number, line / np.linalg.norm(line), at=np.linspace(-0.5, 0.5, 10), repeats=5)
        rows |= {f"approach_{a}": rows["approach_x"] * np.sign(sign[i]) for i, a in reversed([*enumerate("xyz")])}
        rows["xyz"] = middle + np.outer(rows["xyz"][:, 0], line)
        rows["reading_um"] = np.random.default_rng(number).normal(size=len(rows["xyz"]))
        runs.append(rows)
    return AxisRuns(EXACT, joined(*runs))


BODY = [(1.0, y, z) for y in (1.0, -1.0) for z in (1.0, -1.0)]
FACES = [(1.0, 1.0, 0.0), (1.0, -1.0, 0.0), (0.0, 1.0, 1.0), (0.0, 1.0, -1.0)]


@pytest.mark.parametrize(("signs", "part", "complete"), [
    (BODY, 0.9, True), (BODY, 0.6, False), (FACES, 0.9, False), (BODY[:3], 0.9, False), ([*BODY[:3], BODY[0]], 0.9, False),
])  # fmt: skip
def test_four_body_diagonals_over_most_of_the_travel_make_a_test(
    signs: list[tuple[float, float, float]], part: float, complete: bool
) -> None:
    """Faces' diagonals, short ones, and one that was measured twice do not stand for a missing one."""
    (condition,) = conditions(along_lines(signs, part), recorded=True, of=diagonals, what=NOTHING)
    assert condition.met == complete


@pytest.mark.parametrize(("angles", "same", "complete"), [
    (np.arange(0, 360, 5), False, True), (np.arange(0, 320, 5), False, False), (np.arange(0, 360, 6), False, False),
    (np.arange(0, 360, 5), True, False),
])  # fmt: skip
def test_a_circle_with_a_hole_or_one_sense_copied_from_the_other_makes_no_test(
    angles: np.ndarray, same: bool, complete: bool
) -> None:
    """Targets 5° apart from 0° to 315° leave 45° out: the gap from the last to the first counts like any."""
    there = np.radians(angles)
    first, second = np.random.default_rng(3).normal(size=(2, len(there)))
    seen = AxisRuns(EXACT, joined(circle(1, 150.0, np.stack([first, first if same else second]), there)))
    (condition,) = conditions(seen, recorded=True, of=circles, what=NOTHING)
    assert condition.met == complete


def test_an_axis_read_once_and_written_down_for_both_directions_makes_no_test() -> None:
    rows = read(run(1, X, repeats=5), 5.0)
    rows["reading_um"] = rows["reading_um"] + np.tile(np.random.default_rng(1).normal(size=10), 10)
    there = rows["approach_x"] > 0
    for repeat in range(1, 6):
        own = rows["repeat"] == repeat
        rows["reading_um"][own & ~there] = rows["reading_um"][own & there][::-1]
    (condition,) = conditions(AxisRuns(EXACT, joined(rows)), recorded=True, of=axes, what=NOTHING)
    assert "both directions are the same" in " ".join(map(str, condition.missing))


# --- the certificate of the simulated circles ------------------------------------------------------------------------

NAME = "circles-simulated"
TRUTH = {
    "scale_x": 9.0, "scale_y": -6.0, "scale_z": 14.0, "squareness_xy": 12.0, "squareness_yz": -7.5, "squareness_zx": 4.0,
    "hysteresis_x": 3.0, "hysteresis_y": -1.5,
}  # fmt: skip
ROWS = list(csv.DictReader((ROOT / "examples" / NAME / "recording.csv").read_text(encoding="utf-8").splitlines()))


def test_the_errors_that_were_put_in_are_found() -> None:
    for effect, true in TRUTH.items():
        (found,) = results(NAME)["estimates"][effect].values()
        assert abs(found["value"] - true) < 3 * found["u"], effect


@pytest.mark.parametrize("measurement", [1, 2, 3])
def test_figures_are_those_of_the_recorded_radii(measurement: int) -> None:
    """By the rows alone, to the 10 nm of their positions: angles by the vectors outward, and zones by another search."""
    (found,) = (run for run in results(NAME)["runs"] if run["measurement"] == measurement)
    own = [row for row in ROWS if row["measurement"] == str(measurement)]
    first, second = ("yz", "zx", "xy")[measurement - 1]
    angle = [np.degrees(np.arctan2(float(row[f"read_{second}"]), float(row[f"read_{first}"]))) % 360 for row in own]
    order = [round(a / 5) % 72 for a in angle]
    paths = np.full((2, 72), np.nan)
    for k, (row, at) in enumerate(zip(own, order, strict=True)):
        paths[k // 72, at] = float(row["reading_um"])
    there = np.radians(np.arange(0, 360, 5))
    assert found["figures"]["H"] == pytest.approx(np.abs(paths[0] - paths[1]).max(), abs=0.02)
    for arrow, path in zip("↺↻", paths, strict=True):
        assert found["figures"][f"G{arrow}"] == pytest.approx(zone(path, there), abs=0.02)
    off = []
    for path in paths:
        design = np.column_stack([np.cos(there), np.sin(there), np.ones(72)])
        off.append(path - design[:, :2] @ np.linalg.lstsq(design, path, rcond=None)[0][:2])
    assert found["figures"]["Fmax"] == pytest.approx(np.max(off), abs=0.02)
    assert found["figures"]["Fmin"] == pytest.approx(np.min(off), abs=0.02)
    assert found["figures"]["D"] == pytest.approx(np.mean(paths), abs=0.02)


def test_circles_and_squares_read_the_errors_of_their_planes() -> None:
    left = results(NAME)["not_read"]
    assert left == [f"{a}r{b}" for a in "xyz" for b in "xyz"]
