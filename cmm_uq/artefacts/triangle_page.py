"""What the certificate of a triangle of gauge blocks and cylinders states, and its source's way to the machine's parameters.

After Manlay, *Fast checking of CMM geometry with a patented tool*, section 3, for the chain YXZ: the triangle's longest side
lies along a machine axis, and what its measured sides lack of the certified ones is split into three defects of each placing:
of the side along the axis (H), of the height over it (K), and the shift of the apex along it (A). Differences between
placings give rotations; what is left of a defect gives scale or squareness.

Two things of the source are mended. It projects the defect of a slanted side on an axis by the cosine of the triangle's
angle, which holds only for a defect along that side; here the apex follows from all three sides. And its perpendicularity
finds a part only of the squareness, half of it at most.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import degrees
from typing import Any, cast

import numpy as np

from cmm_uq.artefacts.triangle import DRAWS, PLANES, SIDES_OF_DIMENSIONS, Triangle, corners
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, Verbatim, number, say, semicolons, signed
from cmm_uq.base.points import AXES, Floats, Ints
from cmm_uq.base.units import ARCSECOND, METRE, MICROMETRE, PPM, unit
from cmm_uq.base.values import dataclass
from cmm_uq.certificate.document import Block, Paragraph, Plot, Section, Table, figure_columns, section, table
from cmm_uq.certificate.plots.residuals import deviations_plot
from cmm_uq.certificate.result import Page, Result
from cmm_uq.certificate.wording import expanded, refusal
from cmm_uq.machine.model.artefact import Placings
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.machine.physics.effects.rigid_body import ROTATION, SCALE, SQUARENESS, tip_offsets
from cmm_uq.maths.uncertainty.quantity import rounded
from cmm_uq.maths.uncertainty.type_a import factor_of_noise

_ALIGNED = np.cos(np.radians(3.0))
_ANOTHER_PLACE = 20.0  # mm between readings, or between tips, from which on two placings differ
_X, _, _Z, _TIP_X, _TIP_Y, _ = range(6)

# what the equations give, by the names of the effects, in their units (ppm, ″, ″/m)
PARAMETERS = tuple(effect.name for family in (SCALE, SQUARENESS, ROTATION) for effect in family.values())


@dataclass(frozen=True, eq=False)
class Defects:
    """What one aligned placing lacks of the certified triangle: H, K, A, mm, see the module's docstring."""

    plane: str  # key of ``PLANES``
    H: float
    K: float
    A: float
    base: float  # base, height: of the certified triangle, mm
    height: float
    start: Floats  # start, apex: (3,) scale readings of corner 1 and of corner 3, mm
    apex: Floats
    tip: Floats  # (3,) stylus tip offset, mm


@dataclass(frozen=True, eq=False)
class TriangleSolution:
    """Parameters by the source's equations, mended."""

    values: Floats  # (15,) in the order of :data:`PARAMETERS`
    per_coordinate: Floats  # (15, 3n) change of each for 1 mm of each recorded coordinate
    per_dimension: Floats  # (15, 6) change of each for 1 mm of each dimension of the standard

    def u(self, coordinate: float, dimensions: Floats) -> Floats:
        """(15,) standard uncertainties from those of a coordinate and of the six dimensions, mm."""
        noise = coordinate**2 * np.sum(self.per_coordinate**2, axis=1)
        return np.asarray(np.sqrt(noise + np.sum((self.per_dimension * dimensions) ** 2, axis=1)), dtype=np.float64)


def solve_equations(triangle: Triangle) -> TriangleSolution:
    machine = triangle.points.machine
    if machine.chain != "YXZ":
        problem = say("the source's equations are those of the chain YXZ, not {chain}", chain=Verbatim(machine.chain))
        fix = say("Use the fitted model, which serves every chain")
        raise CmmUqError(problem, where="job.toml [machine] chain", fix=fix)
    lower = np.array([machine.travel(axis)[0] for axis in AXES])
    xyz, dimensions, step = triangle.points.xyz, triangle.standard.dimensions, 1e-3

    def solved(at: Floats, sized: Floats) -> Floats:
        return _in_turn(defects(triangle, at, sized), lower)

    values, each = solved(xyz, dimensions), step * np.eye(xyz.size).reshape(-1, *xyz.shape)
    changes = [(solved(xyz + change, dimensions) - values) / step for change in each]
    sized = [(solved(xyz, dimensions + step * unit) - values) / step for unit in np.eye(len(dimensions))]
    return TriangleSolution(values, np.column_stack(changes), np.column_stack(sized))


def defects(triangle: Triangle, xyz: Floats, dimensions: Floats) -> list[Defects]:
    """Defects of every placing, the mean of its repeats.

    ``xyz`` (n, 3) recorded coordinates, mm; ``dimensions`` (6,) of the standard, mm.
    """
    points, nominal = triangle.points, corners(SIDES_OF_DIMENSIONS @ dimensions)
    readings = (xyz + points.machine.origin_mm) / triangle.expansion[:, None]
    tips = tip_offsets(points)
    found = []
    for measurement in triangle.placings.numbers.tolist():
        rows = points.measurement == measurement
        runs = Placings.of(points.group[rows])
        corner = readings[rows][np.lexsort((points.point[rows], runs.index))].reshape(-1, 3, 3)
        measured = np.mean([corners(np.linalg.norm(np.roll(run, -1, axis=0) - run, axis=1)) for run in corner], axis=0)
        base, (x, height) = nominal[1, 0], nominal[2, :2]
        H, K = float(base - measured[1, 0]), float(height - measured[2, 1])
        shift = x - measured[2, 0] - H * x / base
        mean = corner.mean(axis=0)
        plane, tip = _plane(mean, measurement), tips[rows].mean(axis=0)
        found.append(Defects(plane, H, K, float(shift), float(base), float(height), mean[0], mean[2], tip))
    return found


def _plane(corner: Floats, number: int) -> str:
    base, apex = corner[1] - corner[0], corner[2] - corner[0]
    along = base / np.linalg.norm(base)
    up = apex - (apex @ along) * along
    up = up / np.linalg.norm(up)
    for plane, (a, b) in PLANES.items():
        if along[a] > _ALIGNED and up[b] > _ALIGNED:
            return plane
    raise CmmUqError(
        say("measurement {number}: side 1–2 and the height over it do not lie along X and Y, Y and Z, or X and Z",
            number=number),
        where="recording", fix=say("Align the triangle, or use the fitted model, which serves every set-up"),
    )  # fmt: skip


def _in_turn(found: list[Defects], lower: Floats) -> Floats:
    """The fifteen parameters (15,), each from what is known before it."""
    low, high = _pair(found, "XY", _Z, say("horizontal again, higher, over the same place"))
    left, right = _pair(found, "YZ", _X, say("vertical in YZ again, at the other end of X, with the same tip"))
    longer_x = say("vertical in YZ again, at the same scale readings, with a longer tip along X")
    short, long = _pair(found, "YZ", _TIP_X, longer_x)
    longer_y = say("vertical in ZX again, at the same scale readings, with a longer tip along Y")
    zx, zx_long = _pair(found, "ZX", _TIP_Y, longer_y)
    c, h = low.base, low.height
    z_low, z_high = (float(d.start[2] + d.tip[2]) for d in (low, high))
    x_left, x_right = (float(d.start[0] + d.tip[0]) for d in (left, right))

    x_pitch = (high.H - low.H) / (c * (z_high - z_low))
    x_scale = low.H / c - x_pitch * z_low
    y_pitch = -(high.K - low.K) / (h * (z_high - z_low))
    y_yaw = (right.H - left.H) / (c * (x_right - x_left))
    y_scale = left.H / c - y_yaw * x_left + y_pitch * float(left.start[2] + left.tip[2])
    z_yaw = -(long.K - short.K) / (h * (long.tip[0] - short.tip[0]))
    z_scale = short.K / h + z_yaw * short.tip[0]
    x_yaw = -(zx_long.H - zx.H) / (c * (zx_long.tip[1] - zx.tip[1]))
    z_pitch = (zx_long.K - zx.K) / (h * (zx_long.tip[1] - zx.tip[1]))

    difference = (high.A - low.A) / (h * (z_high - z_low))  # roll of Y minus roll of X
    total = -(right.A - left.A) / (h * (x_right - x_left))  # roll of X plus roll of Y
    x_roll, y_roll = (total - difference) / 2, (total + difference) / 2
    z_roll = (long.A - short.A) / (h * (long.tip[0] - short.tip[0])) + y_roll

    def turned(rate: float, reading: float, axis: int) -> float:
        return rate * (reading - float(lower[axis]))

    xy = -low.A / h + difference * z_low + turned(y_yaw, low.start[1], 1)
    yz = (
        -left.A / h - turned(y_pitch, left.apex[1], 1) - turned(x_roll, left.start[0], 0)
        + z_roll * left.tip[0] - y_roll * x_left
    )  # fmt: skip
    szx = -zx.A / h + turned(x_pitch, zx.apex[0], 0) + (x_roll - z_roll) * zx.tip[1]
    scales = np.array([x_scale, y_scale, z_scale]) / PPM
    rates = np.array([x_roll, x_pitch, x_yaw, y_pitch, y_roll, y_yaw, z_pitch, z_yaw, z_roll]) * METRE / ARCSECOND
    return np.concatenate([scales, np.array([xy, yz, szx]) / ARCSECOND, rates])


def _pair(found: list[Defects], plane: str, differing: int, missing: Text) -> tuple[Defects, Defects]:
    """The two placings in a plane farthest apart in one of readings and tip (6,), and alike in the rest."""
    own = [d for d in found if d.plane == plane]
    at = np.array([[*d.start, *d.tip] for d in own]).reshape(-1, 6)
    apart = np.abs(at[:, None] - at[None, :])
    alike = np.all(np.delete(apart, differing, axis=2) < _ANOTHER_PLACE, axis=2)
    gain = np.where(alike, apart[:, :, differing], 0.0)
    if not len(own) or gain.max() < _ANOTHER_PLACE:
        problem = say("{count} set-ups in {plane} lack one that the source's equations compare",
                      count=len(own), plane=Verbatim(plane))  # fmt: skip
        raise CmmUqError(problem, where="recording", fix=say("Add a set-up: {missing}", missing=missing))
    i, j = sorted(np.unravel_index(int(np.argmax(gain)), gain.shape), key=lambda k: float(at[k, differing]))
    return own[i], own[j]


SIDES = ("1–2", "2–3", "3–1")
ALIKE = 0.9  # correlation from which on two estimates are hardly told apart
Figure = tuple[float, float]  # with U for 95 % by Monte Carlo


def standard_figures(result: Result) -> tuple[list[Figure], list[Figure], Figure]:
    """Of the standard at 20 °C: sides, mm; angles, rad; height, mm."""
    standard = cast("Triangle", result.artefact).standard
    figures, draws = standard.figures(), standard.draws(result.posterior.seed)

    def stated(values: Floats, drawn: Floats) -> list[Figure]:
        low, high = np.quantile(drawn, [0.025, 0.975], axis=0)
        return list(zip(values.tolist(), (0.5 * (high - low)).tolist(), strict=True))

    (height,) = stated(np.atleast_1d(figures.height), draws.height[:, None])
    return stated(figures.sides, draws.sides), stated(figures.angles, draws.angles), height


Sides = tuple[Ints, Floats, Floats, float, float]
"""Of every (measurement, repeat): number (r,), sides 1–2, 2–3, 3–1 against the certified ones, µm, as recorded (r, 3) and
after the fitted model (r, 3); U of a side for the noise of its ends, and its k."""


def sides_of(result: Result) -> Sides:
    triangle = cast("Triangle", result.artefact)
    points = triangle.points
    order = np.lexsort((points.point, points.group))

    def lengths(xyz: Floats) -> Floats:
        """Sides of every (measurement, repeat) in order, (r, 3) mm at 20 °C."""
        corner = (xyz / triangle.expansion[:, None])[order].reshape(-1, 3, 3)
        return np.asarray(np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2), dtype=np.float64)

    recorded, predicted = lengths(points.xyz), result.model.predicted(result.posterior.draws.mean(axis=0))
    before = (recorded - triangle.standard.sides) / MICROMETRE
    after = (recorded - lengths(predicted)) / MICROMETRE
    noise, longest = result.noise, float(np.max(triangle.standard.sides))
    U = float(np.sqrt(2)) * noise.expanded
    stated = result.at_least("sides.U_um", U, noise.coverage_factor, unit("µm"), longest)
    return points.measurement[order].reshape(-1, 3)[:, 0], before, after, *stated


ByEquations = tuple[Effect, float, float, float, float]
"""An effect, its parameter by the source's equations, in its unit, with u, U and k for 95 % as stated."""


def by_equations(result: Result) -> tuple[ByEquations, ...] | Text:
    triangle = cast("Triangle", result.artefact)
    try:
        solution = solve_equations(triangle)
    except CmmUqError as error:
        return refusal(error)
    noise, dimensions = result.noise.coordinate, triangle.standard.u
    by_noise, known = solution.u(noise.value * MICROMETRE, 0 * dimensions), solution.u(0.0, dimensions)
    known = np.hypot(known, solution.per_dimension @ triangle.standard.dimensions * result.relative_doubt)
    found = []
    for name, value, one, other in zip(PARAMETERS, solution.values, by_noise, known, strict=True):
        effect, u, k = every()[name], float(np.hypot(one, other)), factor_of_noise(noise, one, other)
        stated = result.at_least(f"equations.{name}", k * u, k, effect.reported[0].unit)
        found.append((effect, float(value), u, *stated))
    return tuple(found)


def hardly_told_apart(result: Result) -> tuple[tuple[str, str, float], ...]:
    """Pairs of effects that these placings hardly tell apart, with the correlation of their estimates."""
    names = [u.key[0] for u in result.posterior.unknowns if u.key[0] in result.parameters]
    correlation = np.atleast_2d(np.corrcoef(result.values[:, : len(names)], rowvar=False))
    pairs = [(i, j) for i in range(len(names)) for j in range(i) if abs(correlation[i, j]) > ALIKE]
    return tuple((names[j], names[i], float(correlation[i, j])) for i, j in pairs)


def results(result: Result) -> Mapping[str, Any]:
    equations, (sides, angles, height) = by_equations(result), standard_figures(result)
    refused = isinstance(equations, str)
    return {
        "standard": {
            "sides_mm": {name: {"value": value, "U": U} for name, (value, U) in zip(SIDES, sides, strict=True)},
            "angles": {
                str(corner): {"value_deg": degrees(value), "U_arcsec": U / ARCSECOND}
                for corner, (value, U) in enumerate(angles, 1)
            },
            "height_mm": {"value": height[0], "U": height[1]},
            "draws": DRAWS,
        },
        "sides": [
            dict(zip(("measurement", "before_um", "after_um"), side, strict=True))
            for side in zip(*(each.tolist() for each in sides_of(result)[:3]), strict=True)
        ],
        "equations": {"refused": equations} if isinstance(equations, str) else {
            effect.name: {effect.reported[0].name: dict(zip(("value", "u", "U", "k"), figures, strict=True))}
            for effect, *figures in equations
        },
        **({} if refused else {"conditional": {"equations": "white noise, and a few observations each"}}),
        "hardly_told_apart": [
            {"effects": [one, other], "correlation": correlation}
            for one, other, correlation in hardly_told_apart(result)
        ],
    }  # fmt: skip


def sections(result: Result) -> list[Section]:
    ways = _two_ways(result, by_equations(result)), _alike(result)
    return [
        section(say("The triangle"), _standard(*standard_figures(result)), _sides(result, *sides_of(result))),
        section(say("Parameters by two ways"), *ways),
    ]


def _standard(sides: list[Figure], angles: list[Figure], height: Figure) -> Table | None:
    named = [(say("Side {name}", name=Verbatim(name)), side) for name, side in zip(SIDES, sides, strict=True)]
    rows: list[tuple[Text, ...]] = [(name, *rounded(*side), unit("mm")) for name, side in named]
    for i, (angle, spread) in enumerate(angles, 1):
        U = say("{U}″", U=rounded(0.0, spread / ARCSECOND)[1])
        rows.append((say("Angle at {i}", i=i), rounded(degrees(angle), degrees(spread))[0], U, unit("°")))
    rows.append((say("Height over side 1–2"), *rounded(*height), unit("mm")))
    note = say(
        "U for a coverage probability of 95 % by Monte Carlo, {draws} draws of the dimensions of blocks and cylinders; "
        "angles by the cosine rule.",
        draws=DRAWS,
    )
    figures = figure_columns(say("Value"), say("U"))
    return table(say("Sides and angles of the standard at 20 °C"), [say("Quantity"), *figures, say("Unit")], rows, note)


def _sides(result: Result, measurement: Ints, sides: Floats, left: Floats, expanded_um: float, k: float) -> Plot:
    caption = say(
        "Each side minus its certified length, as recorded and after the fitted model, with U (k = {k}).",
        k=number(k, ".2f"),
    )
    return deviations_plot(
        result, sides.ravel(), say("{count} sides: as recorded they deviate", count=sides.size),
        position=measurement.repeat(3).astype(float), after_um=left.ravel(), expanded_um=expanded_um,
        reference=say("certified side"), position_label=say("Set-up (its three sides side by side)"), caption=caption,
    )  # fmt: skip


def _two_ways(result: Result, equations: tuple[ByEquations, ...] | Text) -> Block | None:
    if isinstance(equations, str):
        text = say("The source's equations have no solution here. {equations}", equations=equations)
        return Paragraph(text, tone="note")
    rows = []
    for effect, value, _, U, _ in equations:
        fitted: tuple[Text, ...] = (NOTHING, NOTHING)
        if (name := effect.name) in result.parameters:
            quantity = next(iter(result.parameters[name].values()))
            fitted = (say("not determined"), NOTHING) if name in result.free else expanded(quantity)[:2]
        rows.append((effect.title, *rounded(value, U), *fitted, effect.reported[0].unit))
    figures = figure_columns(say("Equations"), say("U"), say("Fitted model"), say("U"))
    note = say(
        "Equations: one after the other from the sides of aligned set-ups (Manlay, Fast checking of "
        "CMM geometry with a patented tool), each from a few of the observations, U for a coverage probability of 95 %, "
        "conditional on white noise. Fitted model: all observations at once, U averaged over what the noise may be."
    )
    title = say("Scale, squareness, pitch, yaw and roll")
    return table(title, [say("Parameter"), *figures, say("Unit")], rows, note)


def _alike(result: Result) -> Block | None:
    titles = {effect.name: effect.title for effect in result.model.effects}
    pairs = [
        say("{one} and {other} ({correlation})", one=titles[a], other=titles[b], correlation=signed(c, "+.2f"))
        for a, b, c in hardly_told_apart(result)
    ]
    text = say("Hardly told apart by these set-ups (correlation): {pairs}.", pairs=semicolons(pairs))
    return Paragraph(text, tone="note") if pairs else None


PAGE = Page(sections, results)
