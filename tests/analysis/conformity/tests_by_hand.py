"""A complete test of each characteristic, with one value that is known; also incomplete, copied, or without u."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from cmm_uq.analysis.conformity import own_rule
from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.axis_runs.artefact import AxisRuns
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.artefacts.gauge_lines import StepGauge
from cmm_uq.artefacts.kinds import TableSpheresFacts
from cmm_uq.artefacts.spheres.sphere import SphereArtefact
from cmm_uq.artefacts.spheres.table_spheres import TableSpheres
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.rotary import RotaryMachine
from cmm_uq.jobs.tables.conformity import Circumstances, TestUncertainty
from cmm_uq.jobs.tables.machine import ProbeFacts
from cmm_uq.jobs.tables.plan import CompleteTest
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.maths.uncertainty.quantity import Quantity
from tests.analysis.conformity.arms_by_hand import ARMS
from tests.analysis.conformity.own_by_hand import OWN
from tests.analysis.conformity.recorded import BAR_U, DIAGONALS, MACHINE, NEGLIGIBLE, SEVEN, STATED, bars, gauge, sphere
from tests.artefacts.test_axis_runs import joined, run
from tests.artefacts.test_axis_runs_references import circle
from tests.maths.geometry.test_positioning import by_loops
from tests.recordings import bar_facts, with_columns

X, Y, Z = np.eye(3)


def changing(u_um: float) -> Circumstances:
    """With so much that changes between repeated readings."""
    return replace(STATED, uncertainty=TestUncertainty(negligible=NEGLIGIBLE, u_repeat_um=u_um))


FACES = [np.array(d, dtype=float) for d in ((900, 550, 0), (900, -550, 0), (0, 550, 500), (0, 550, -500), (900, 0, 500),
                                            (900, 0, -500))]  # fmt: skip
ERROR = 5.0
"""µm, of the one length that is off."""


@dataclass(frozen=True, eq=False)
class Hand:
    """A test and the one value that decides it.

    Parameters
    ----------
    artefact, circumstances, accuracy : of the test.
    value, u : of that value, µm.
    signed : whether its limit has two sides.
    complete : what the laboratory says of a complete test, for its own rule.
    """

    artefact: Artefact
    circumstances: Circumstances
    accuracy: Mapping[str, Quantity]
    value: float
    u: float
    signed: bool
    complete: CompleteTest | None = None


def lengths(
    directions: list[Floats], count: int = 5, offset: Floats | None = None, longest: float = 0.7
) -> Callable[..., Hand]:
    """Errors of lengths: 5 µm of the second, where the gauge of 0.4 µm in 800 mm has u = 0.1 µm in 200 mm."""

    def made(how: str) -> Hand:
        chosen = directions[:-1] if how == "incomplete" else directions
        every = [list(equally_spaced(direction, count, longest)) for direction in chosen]
        off = (1, 2) if how != "one repeat out" else (2,)
        artefact = gauge(chosen, every, errors={(1, repeat, every[0][1]): -ERROR for repeat in off},
                         u_um=None if how == "no u" else "L/2000")  # fmt: skip
        points = artefact.points
        if how == "copied":
            xyz = points.xyz.copy()
            last = points.measurement == len(chosen)
            xyz[last & (points.repeat == 3)] = xyz[last & (points.repeat == 1)]
            points = points.at(xyz)
        if offset is not None:
            points = with_columns(
                points, **{f"tip_{a}_mm": np.full(len(points), offset[i]) for i, a in enumerate("xyz")}
            )
        facts = artefact_facts(kind="step_gauge", length_mm=800.0, u_um=None if how == "no u" else "L/2000")
        return Hand(StepGauge(facts, points), STATED, {}, ERROR, 0.1 * every[0][1] / 200.0, True)

    return made


def equally_spaced(direction: Floats, count: int, longest: float) -> Floats:
    """20 mm, and others equally spaced up to so much of the travel along a line; for one length 20 mm alone."""
    u = np.abs(direction) / np.linalg.norm(direction)
    travel = min(size / part for size, part in zip((900.0, 550.0, 500.0), u, strict=True) if part > 1e-9)
    if count == 1:
        return np.array([20.0, 40.0])
    return np.round(np.linspace(20.0, longest * travel, count))


def ranges(how: str) -> Hand:
    """The range of three repeats, one of which is 5 µm off; u = 0.2 µm is stated."""
    lines = SEVEN[:-1] if how == "incomplete" else SEVEN
    every = [list(equally_spaced(direction, 5, 0.7)) for direction in lines]
    artefact = gauge(lines, every, errors={(1, 2, every[0][1]): ERROR})
    points = artefact.points
    if how == "copied":
        xyz = points.xyz.copy()
        xyz[(points.measurement == 7) & (points.repeat == 3)] = xyz[(points.measurement == 7) & (points.repeat == 1)]
        points = points.at(xyz)
    facts = artefact_facts(kind="step_gauge", length_mm=800.0, u_um="L/2000")
    stated = changing(0.0 if how == "no u" else 0.2)
    return Hand(StepGauge(facts, points), stated, {}, ERROR, 0.2, False)


def volumetric(how: str) -> Hand:
    """A range of 15 µm; u = 0.5 µm is stated."""
    made = bars(lengths=[300.0] * 20)
    if how == "incomplete":
        made = bars([(1, 0, 0), (0, 1, 0), (0, 0, 1)])
    if how == "copied":
        xyz = made.points.xyz.copy()
        xyz[made.points.measurement == 18] = xyz[made.points.measurement == 14]
        made = Ballbar(bar_facts(300.0, BAR_U), made.points.at(xyz))
    under = changing(0.0 if how == "no u" else 0.5)
    return Hand(made, under, {"b89_range_um": Quantity(15.0, 3.0, (9.0, 21.0), "µm")}, 15.0, 0.5, False)


def opposite_tips(how: str) -> Hand:
    """Four diagonals, tips to both sides; on one the bar is 10 µm longer one way."""
    directions = [(0, 1, 1), (0, -1, 1), (1, 0, 1), (-1, 0, 1)][: 3 if how == "incomplete" else 4]
    made = bars([d for d in directions for _ in (0, 1)], lengths=[300.01, 300.0, *[300.0] * (2 * len(directions) - 2)])
    points = made.points
    tips = np.zeros((len(points), 3))
    for i, direction in enumerate(directions):
        axis = int(np.flatnonzero(np.array(direction) == 0)[0])
        for side in (0, 1):
            tips[points.measurement == 2 * i + side + 1, axis] = 200.0 * (1 - 2 * side)
    points = with_columns(points, **{f"tip_{a}_mm": tips[:, i] for i, a in enumerate("xyz")})
    if how == "copied":
        xyz = points.xyz.copy()
        xyz[points.measurement == 8] = xyz[points.measurement == 7]
        points = points.at(xyz)
    stated = changing(0.0 if how == "no u" else 0.2)
    return Hand(Ballbar(bar_facts(300.0, BAR_U), points), stated, {}, 10.0, 0.2, True)


def fixed_ball(how: str) -> Hand:
    """One sphere ten times in its place, once 5 µm to the side."""
    one = sphere(height_um=0.0).points
    count = 9 if how == "incomplete" else 10
    moved = np.array([[1e-6 * i, 0.0, ERROR * 1e-3 * (i == 3)] for i in range(count)])
    if how == "copied":
        moved[5] = moved[4]
    xyz = np.vstack([one.xyz + shift for shift in moved])
    repeat = np.repeat(np.arange(1, count + 1), len(one))
    points = Points(xyz, np.ones_like(repeat), np.tile(one.point, count), repeat, MACHINE)
    facts = artefact_facts(kind="sphere", length_mm=25.0, u_um=0.1, form_um=0.2)
    stated = changing(0.0 if how == "no u" else 0.2)
    return Hand(SphereArtefact(facts, points), stated, {}, ERROR, 0.2, False)


def probed(*, size: bool, sensing: str | None = None) -> Callable[..., Hand]:
    """A sphere of 25 points. Form: 0.1 µm for half of 0.2 µm; size: 0.1 µm of its diameter, which is 4 µm too large."""

    def made(how: str) -> Hand:
        artefact = sphere(points=24 if how == "incomplete" else 25, copied=1 if how == "copied" else 0, height_um=6.0,
                          form_um=None if how == "no u" and not size else 0.2)  # fmt: skip
        facts = artefact_facts(kind="sphere", length_mm=24.99, u_um=None if how == "no u" else 0.1,
                               form_um=None if how == "no u" else 0.2)  # fmt: skip
        artefact = SphereArtefact(facts, artefact.points)
        found = artefact.forms()
        value = float((found.size if size else found.form)[0]) * 1e3
        under = replace(STATED, probe=ProbeFacts(sensing=sensing))
        if not size:
            under = replace(under, uncertainty=TestUncertainty(u_form_um=0.0 if how == "no u" else 1e-6))
        return Hand(artefact, under, {}, value, 0.1, size)

    return made


POSITIONED = {"E": 6.0, "M": 3.0, "B": 6.0, "R": 10.0, "A": 10.0}
"""µm: one mean of eighteen is 6 µm, all others 0, each of five readings with s = 1 µm (−1, −1, 0, 1, 1 in turn)."""


def positioned(figure: str) -> Callable[..., Hand]:
    """A run of X there and back; u is what 0.05 µm of each reading and 0.1 µm/m of the scale make of the figure."""

    def made(how: str) -> Hand:
        targets = np.linspace(0.0, 800.0, 4 if how == "incomplete" else 9)
        turned = 0 if how == "copied" else 1  # in one order everywhere, two repeats and two more are the same
        x = np.array([[np.roll([-1.0, -1.0, 0.0, 1.0, 1.0], turned * i) for i in range(len(targets))]] * 2)
        x[0, -1] += 6.0
        rows = run(1, X, at=targets, repeats=5, place=(100.0, -100.0))
        rows["reading_um"] = np.concatenate([[*x[0, :, k], *x[1, ::-1, k]] for k in range(5)])
        facts = artefact_facts(kind="axis_runs", u_scale_um_per_m=0.0 if how == "no u" else 0.1)
        u = 0.1 if how == "no u" else spread_by_loops(tuple(x.ravel()), len(targets))[figure]
        stated = changing(0.0 if how == "no u" else 0.05)
        return Hand(AxisRuns(facts, joined(rows)), stated, {}, POSITIONED[figure], u, False)

    return made


ABOUT = np.array([-7.0, -2.0, 2.0, 7.0])
"""mm of the readings in motion about each target, the outer two of which lie 0.5 µm higher."""


def in_motion(figure: str) -> Callable[..., Hand]:
    """The run of ``positioned`` without a stop: at targets it is the mean of two readings, and the cubic is lower."""

    def made(how: str) -> Hand:
        targets = np.linspace(0.0, 800.0, 4 if how == "incomplete" else 9) + 50.0
        turned = 0 if how == "copied" else 1
        x = np.array([[np.roll([-1.0, -1.0, 0.0, 1.0, 1.0], turned * i) for i in range(len(targets))]] * 2)
        x[0, -1] += 6.0
        read = (x[:, :, None] + np.array([0.5, 0.0, 0.0, 0.5])[None, None, :, None]).reshape(2, -1, 5)
        at = (targets[:, None] + ABOUT).ravel()
        rows = run(1, X, at=at, repeats=5, place=(100.0, -100.0))
        rows["reading_um"] = np.concatenate([[*read[0, :, k], *read[1, ::-1, k]] for k in range(5)])
        known = how != "no u"
        facts = artefact_facts(
            kind="axis_runs", u_scale_um_per_m=0.1 if known else 0.0,
            on_the_fly={"x": targets.tolist(), "u_delay_um": 0.02 if known else 0.0},
        )  # fmt: skip
        u = spread_by_loops(tuple(x.ravel()), len(targets), motion=True)[figure] if known else 0.1
        asked = CompleteTest(measurements=1, repeats=5, points=72)
        stated = changing(0.05 if known else 0.0)
        return Hand(AxisRuns(facts, joined(rows)), stated, {}, POSITIONED[figure], u, False, asked)

    return made


@cache
def spread_by_loops(x: tuple[float, ...], targets: int, *, motion: bool = False) -> dict[str, float]:
    """Standard uncertainty of every figure, µm, under the draws of the program, figure by figure in loops."""
    random = np.random.default_rng(np.random.SeedSequence(230, spawn_key=(2,)))
    whole = np.array(x).reshape(2, targets, 5)
    along = 0.08 * random.standard_normal((2000, 1, 1, 1)) * np.linspace(0, 1, targets)[None, None, :, None]
    each = 0.05 * random.standard_normal((2000, *whole.shape))
    if motion:
        each = each * 0.5**0.5
        left_out = 0.0 - np.polyval(np.polyfit(ABOUT, [0.5, 0.0, 0.0, 0.5], 3), 0.0)
        along = along + left_out * random.standard_normal((2000, 1, targets, 1))
        delay = 0.02 * random.standard_normal(2000)
        along = along + np.stack([delay, -delay], axis=1)[:, :, None, None]
    at = by_loops(whole)
    once, more = ([by_loops(whole + change) for change in along + times * each] for times in (1.0, 3**0.5))
    return {
        figure: float(np.hypot(np.std([one[figure] for one in once]), np.mean([one[figure] for one in more]) - value))
        for figure, value in at.items()
    }


def own(figure: str) -> Callable[[str], Hand]:
    """A figure that the laboratory decides by its own rule."""

    def made(how: str) -> Hand:
        artefact, under, value, u, signed, complete = OWN[figure]("complete" if how == "one repeat out" else how)
        return Hand(artefact, under, {}, value, u, signed, complete)

    return made


def of_arm(made_by: Callable[[str], tuple[Artefact, Circumstances, float, float, bool]]) -> Callable[[str], Hand]:
    """A characteristic of an arm or a robot."""

    def made(how: str) -> Hand:
        artefact, under, value, u, signed = made_by(how)
        return Hand(artefact, under, {}, value, u, signed)

    return made


def diagonals(figure: str) -> Callable[..., Hand]:
    """The runs of ``positioned`` along four body diagonals; on three of them no mean is off, so that E and B are 0."""

    def made(how: str) -> Hand:
        targets = np.linspace(0.0, 800.0, 9)
        turned, runs = 0 if how == "copied" else 1, []
        for number, (y, z) in enumerate([(1, 1), (1, -1), (-1, 1), (-1, -1)][: 3 if how == "incomplete" else 4], 1):
            x = np.array(
                [[np.roll([-1.0, -1.0, 0.0, 1.0, 1.0], turned * (i + way)) for i in range(9)] for way in (0, 2)]
            )
            x[0, -1] += 6.0 * (number == 1)
            along = np.array([9.0, 5.5 * y, 5.0 * z]) / np.linalg.norm([9.0, 5.5, 5.0])
            rows = run(number, along, at=targets, repeats=5)
            rows["reading_um"] = np.concatenate([[*x[0, :, k], *x[1, ::-1, k]] for k in range(5)])
            start = np.array([50.0, 300.0 - 250.0 * y, -250.0 - 220.0 * z])
            sense = rows["approach_x"].copy()
            rows["xyz"] = start + np.outer(rows["xyz"][:, 0], along)
            rows |= {f"approach_{a}": sense * along[i] for i, a in enumerate("xyz")}
            runs.append(rows)
        facts = artefact_facts(kind="axis_runs", u_scale_um_per_m=0.0 if how == "no u" else 0.1)
        x = np.array([[np.roll([-1.0, -1.0, 0.0, 1.0, 1.0], turned * (i + way)) for i in range(9)] for way in (0, 2)])
        x[0, -1] += 6.0
        u = 0.1 if how == "no u" else spread_by_loops(tuple(x.ravel()), 9)[figure[0]]
        stated = changing(0.0 if how == "no u" else 0.05)
        return Hand(AxisRuns(facts, joined(*runs)), stated, {}, 6.0, u, False)

    return made


ROUND = np.radians(np.arange(0, 360, 5))
LOBES = 6.0 * np.cos(3 * ROUND)  # µm: no shift of the centre makes its zone less than 12


def circular(figure: str, value: float, counter: Floats, clockwise: Floats) -> Callable[..., Hand]:
    """Paths of three lobes about a bar that is known to 0.2 µm; u is what that and 0.05 µm of each reading make of it."""

    def made(how: str) -> Hand:
        chosen = np.arange(0, 72, 2 if how == "incomplete" else 1)
        paths = np.stack([counter, clockwise])[:, chosen]
        rounds = [circle(1, 150.0, paths, ROUND[chosen]) for _ in range(2 if how == "copied" else 1)]
        for number, rows in enumerate(rounds, 1):
            rows["repeat"] = np.full(len(rows["xyz"]), number)
        facts = artefact_facts(kind="axis_runs", u_bar_um=0.0 if how == "no u" else 0.2)
        u = 0.1 if how == "no u" else spread_of_circle(figure, tuple(paths.ravel()), len(chosen), len(rounds))
        stated = changing(0.0 if how == "no u" else 0.05)
        return Hand(AxisRuns(facts, joined(*rounds)), stated, {}, value, u, False)

    return made


def about_least_squares_centre(paths: Floats, angle: Floats) -> Floats:
    """Of paths (N, t, n), each round by itself."""
    design = np.column_stack([np.ones_like(angle), np.cos(angle), np.sin(angle)])
    by_path = np.moveaxis(paths, 1, 0).reshape(len(angle), -1)
    centres = (design[:, 1:] @ np.linalg.lstsq(design, by_path)[0][1:]).reshape(-1, len(paths), paths.shape[2])
    return np.asarray(paths - np.moveaxis(centres, 0, 1))


def of_circle(figure: str, x: Floats) -> Floats:
    """The values (N, one or two) of which a figure is the larger, of (N, 2, t, n) about their least-squares centres."""
    angle = np.linspace(0, 2 * np.pi, x.shape[2], endpoint=False)
    if figure == "G(b)":
        both = about_least_squares_centre(np.concatenate([x[:, 0], x[:, 1]], axis=1), np.tile(angle, 2))
        return np.ptp(both, axis=1).max(axis=1)[:, None]
    if figure == "H":
        return np.abs(x[:, 0] - x[:, 1]).max(axis=(1, 2))[:, None]
    off = np.stack([about_least_squares_centre(x[:, d], angle) for d in (0, 1)], axis=1)
    if figure == "G":
        return np.ptp(off, axis=2).max(axis=2)
    if figure == "F":
        return np.column_stack([off.max(axis=(1, 2, 3)), off.min(axis=(1, 2, 3))])
    return off.mean(axis=(1, 2, 3))[:, None]


@cache
def spread_of_circle(figure: str, paths: tuple[float, ...], targets: int, rounds: int) -> float:
    random = np.random.default_rng(np.random.SeedSequence(230, spawn_key=(2,)))
    x = np.repeat(np.array(paths).reshape(2, targets, 1), rounds, axis=2)
    changes = 0.2 * random.standard_normal((2000, 1, 1, 1)) * np.ones((1, 1, targets, 1))
    each = (
        0.05 * 0.5**0.5 * random.standard_t(4, (2000, *x.shape))
    )  # of the standard deviation 0.05 µm, with long tails
    (at,) = of_circle(figure, x[None])
    once, more = (of_circle(figure, x + changes + times * each) - at for times in (1.0, 3**0.5))
    added = np.abs(np.mean(more, axis=0))
    made = np.abs(at - of_circle(figure, without_scatter(x, float(np.mean(each**2)))[None])[0])
    return float(np.sqrt(np.var(once, axis=0) + np.maximum(added, made) ** 2).max())


def without_scatter(x: Floats, variance: float) -> Floats:
    """Each reading as near to the median of five as leaves, of what it is off, what is more than its scatter."""
    found = x.copy()
    for path in np.ndindex(x.shape[0], x.shape[2]):
        read = x[path[0], :, path[1]]
        near = np.array([np.median([read[(i + k) % len(read)] for k in (-2, -1, 0, 1, 2)]) for i in range(len(read))])
        square = float(np.mean((read - near) ** 2))
        found[path[0], :, path[1]] = near + (max(0.0, 1 - variance / square) ** 0.5 if square else 0.0) * (read - near)
    return found


def four_axis(figure: str) -> Callable[[str], Hand]:
    """Two spheres at 0 and at seven positions out and back over 720°; of A, one coordinate goes through the whole range."""

    def made(how: str) -> Hand:
        angles = np.concatenate([np.linspace(0, 720, 8), [] if how == "incomplete" else np.linspace(720, 0, 8)[1:]])
        radial = np.array([0.6, 0.8, 0.0])
        way = {"FR": radial, "FT": np.cross(Z, radial), "FA": Z}[figure]
        course = 1e-3 * ERROR * np.linspace(0, 1, len(angles))
        course[2] = course[1] if how == "copied" else course[2]
        a = 150.0 * radial + 40.0 * Z + course[:, None] * way
        b = -150.0 * radial + 240.0 * Z + 0.5 * course[:, None] * way
        once = np.ones(2 * len(angles), dtype=np.int64)
        visits = np.tile(np.arange(1, len(angles) + 1), 2)
        machine = RotaryMachine("m", travel_mm=MACHINE.travel_mm, origin_mm=MACHINE.travel_mm.mean(axis=1))
        point = np.repeat([1, 2], len(angles))
        points = Points(np.concatenate([a, b]), once, point, visits, machine, {"c_deg": np.tile(angles, 2)})
        u = 0.0 if how == "no u" else 0.2
        return Hand(
            TableSpheres(TableSpheresFacts(kind="table_spheres"), points), changing(u), {}, ERROR, u or 0.1, False
        )

    return made


E0 = lengths(SEVEN)
TESTS: Mapping[tuple[str, str], Callable[[str], Hand]] = {
    ("ASME B89.4.1-1997", "volumetric performance"): volumetric,
    ("ASME B89.4.1-1997", "repeatability"): fixed_ball,
    ("ASME B89.4.1-1997", "linear displacement accuracy"): lengths([X, Y, Z], 10),
    ("ASME B89.4.1-1997", "offset probe performance"): opposite_tips,
    ("ASME B89.4.1-1997", "bidirectional length"): lengths([X, Y, Z, X + Y + Z], 1),
    ("ASME B89.4.10360.2-2008", "E0"): E0,
    ("ASME B89.4.10360.2-2008", "R0"): ranges,
    ("ASME B89.4.10360.2-2008", "E150"): lengths(FACES[2:4], offset=np.array([150.0, 0.0, -200.0])),
    ("ISO 10360-2:2009", "E0"): E0,
    ("ISO 10360-2:2009", "R0"): ranges,
    ("ISO 10360-2:2009", "E150"): lengths(FACES[4:], offset=np.array([0.0, -150.0, -200.0])),
    **{("ISO 10360-3:2000", figure): four_axis(figure) for figure in ("FR", "FT", "FA")},
    ("ISO 10360-5:2010", "P_FTU"): probed(size=False),
    ("ISO 10360-5:2010", "P_STU"): probed(size=True),
    ("ISO 10360-5:2020", "P_Form.Sph.1x25:SS:Tact"): probed(size=False, sensing="contacting"),
    ("ISO 10360-5:2020", "P_Size.Sph.1x25:SS:Tact"): probed(size=True, sensing="contacting"),
    ("ISO 10360-8:2013", "P_Form.Sph.1x25:Tr:ODS"): probed(size=False, sensing="optical"),
    ("ISO 10360-8:2013", "P_Size.Sph.1x25:Tr:ODS"): probed(size=True, sensing="optical"),
    **{("ISO 230-2:2014", figure): positioned(figure) for figure in POSITIONED},
    **{(own_rule.NAME, figure): own(figure) for figure in OWN},
    **{(own_rule.NAME, figure): in_motion(figure) for figure in POSITIONED},
    ("ISO 230-6:2002", "Ed"): diagonals("E"),
    ("ISO 230-6:2002", "Bd"): diagonals("B"),
    ("ISO 230-4:1996", "G"): circular("G", 12.0, LOBES, 0.5 * LOBES),
    ("ISO 230-4:1996", "H"): circular("H", 3.0, LOBES, LOBES - 3.0 * (np.arange(72) == 6)),
    ("ISO 230-4:1996", "F"): circular("F", -11.0, LOBES - 5.0, 0.5 * LOBES - 5.0),
    ("ISO 230-4:2005", "G(b)"): circular("G(b)", 12.0, LOBES, 0.5 * LOBES),
    ("ISO 230-4:2005", "D"): circular("D", 8.0, LOBES + 8.0, 0.5 * LOBES + 8.0),
    **{name: of_arm(made_by) for name, made_by in ARMS.items()},
    ("VDI/VDE 2617", "E0"): E0,
    ("VDI/VDE 2617-2.1", "U3"): lengths(DIAGONALS),
    ("VDI/VDE 2617-2.1", "U1"): lengths([X, Y, Z]),
    ("VDI/VDE 2617-2.1", "U2"): lengths(FACES),
}
"""By standard and characteristic."""


@cache
def by_hand(standard: str, characteristic: str, how: str) -> Hand:
    """A test that is ``complete``, ``incomplete``, ``copied``, has ``no u`` or ``one repeat out``."""
    made = TESTS[standard, characteristic](how)
    return replace(made, accuracy=dict(made.accuracy))
