"""A complete test of each figure that a laboratory decides by its own rule; what must come out is computed here anew."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.bryan import Bryan
from cmm_uq.artefacts.digitizer import THREE, DigitizerArtefact
from cmm_uq.artefacts.plane import PlaneSurface
from cmm_uq.artefacts.shift.result import ShiftedReadings
from cmm_uq.artefacts.spheres.ring import RingGauge
from cmm_uq.artefacts.triangle import Triangle, corners
from cmm_uq.base.points import Floats, Points
from cmm_uq.jobs.tables.conformity import Circumstances, TestUncertainty
from cmm_uq.jobs.tables.plan import CompleteTest
from cmm_uq.machine.model.artefact import ArtefactFigure
from cmm_uq.machine.physics.kinematics import euler_313
from tests.analysis.conformity.recorded import MACHINE, NEGLIGIBLE, STATED

Made = tuple[object, Circumstances, float, float, bool, CompleteTest]
BAR = 250.0
CENTRE = np.array([440.0, 270.0, -240.0])
SIX = np.array([[0.0, 0.05, -0.04], [0.05, 0.06, 0.03], [-0.04, 0.03, -0.05]]) * 1e-3
"""Errors of a machine: of the square of a distance over that square, symmetric."""


def changing(u_um: float) -> Circumstances:
    return replace(STATED, uncertainty=TestUncertainty(negligible=NEGLIGIBLE, u_repeat_um=u_um))


def numbered(xyz: Floats, how: str, repeats: int, points: int = 1, **columns: Floats) -> Points:
    """Measurements in order, each with its repeats; the last one missing, or its last repeat a copy of the one before."""
    n = len(xyz)
    measurement, repeat = np.arange(n) // (repeats * points) + 1, np.arange(n) // points % repeats + 1
    kept = (measurement < measurement.max()) if how == "incomplete" else np.ones(n, dtype=bool)
    xyz = xyz.copy()
    if how == "copied":
        xyz[-points:] = xyz[-2 * points : -points] if repeats > 1 else xyz[:points]
    columns = {"temp_artefact_c": np.full(n, 20.0), **columns}
    some = {name: values[kept] for name, values in columns.items()}
    return Points(xyz[kept], measurement[kept], (np.arange(n) % points + 1)[kept], repeat[kept], MACHINE, some)


def swept(how: str, *, certified: bool) -> tuple[Bryan, Points]:
    """Thirty positions over two thirds of the sphere, twice, on a machine with the six errors and noise of a micrometre."""
    i = np.arange(30) + 0.5
    z, turn = 1 - 1.3 * i / 30, np.pi * (1 + 5**0.5) * i
    directions = np.column_stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z])
    lengths = BAR / np.sqrt(1 + np.einsum("ni,ij,nj->n", directions, SIX, directions))
    xyz = np.repeat(CENTRE + lengths[:, None] * directions, 2, axis=0)
    xyz += np.random.default_rng(5).normal(0.0, 1e-3, xyz.shape)
    points = numbered(xyz, how, 2)
    u = None if how == "no u" else 0.2
    facts = artefact_facts(kind="bryan", length_mm=BAR, u_um=u) if certified else artefact_facts(kind="bryan")
    return Bryan(facts, points), points


def radii_by_hand(points: Points, length: float | None, *, six: bool) -> tuple[Floats, Floats, int]:
    """Centre, radii, and how many unknowns were fitted beside their mean, by SciPy's own minimiser."""
    own = ~np.isin(points.group, list(points.copies))
    xyz = points.xyz[own]

    def metric(p: Floats) -> Floats:
        a, b, c, d, e, f = p[3:9] * 1e-6
        return np.eye(3) + np.array([[a, b, c], [b, d, e], [c, e, f]])

    def radii(p: Floats) -> Floats:
        away = xyz - p[:3]
        return np.sqrt(np.einsum("ni,ij,nj->n", away, metric(p), away))

    def left(free: Floats) -> Floats:
        p = np.concatenate([free, np.zeros(9 - len(free))]) if len(free) == 3 else free
        found = radii(p)
        if length is None:  # the scales have no common part
            common = [] if len(free) == 3 else [1e-3 * (p[3] + p[6] + p[8])]
            return np.concatenate([found - found.mean(), common])
        return found - length

    start = np.concatenate([CENTRE + 0.01, np.zeros(6 if six else 0)])
    free = least_squares(left, start, xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale="jac", jac="3-point").x
    p = np.concatenate([free, np.zeros(9 - len(free))])
    return free[:3], radii(p), len(free) - (1 if six and length is None else 0)


def of_bar(figure: str, *, certified: bool = False) -> Callable[[str], Made]:
    def made(how: str) -> Made:
        bar, points = swept(how, certified=certified)
        length = BAR if certified else None
        centre, radii, fitted = radii_by_hand(points, length, six=False)
        after, corrected, more = radii_by_hand(points, length, six=True)
        which = points.measurement[~np.isin(points.group, list(points.copies))]
        value = {
            "error": max(radii - BAR, key=abs),
            "repeatability": max(np.ptp(radii[which == number]) for number in np.unique(which)),
            "span": np.ptp(radii),
            "standard deviation": np.sqrt(np.sum((radii - radii.mean()) ** 2) / (len(radii) - 1 - fitted)),
            "span corrected": np.ptp(corrected),
            "standard deviation corrected": np.sqrt(
                np.sum((corrected - corrected.mean()) ** 2) / (len(radii) - 1 - more)
            ),
            "pivot offset": np.linalg.norm(after - centre),
        }[figure]
        u = 0.2 if figure == "error" else 0.02
        under = STATED if figure == "error" else changing(0.0 if how == "no u" else u)
        return bar, under, float(value) * 1e3, u, figure == "error", CompleteTest(measurements=30, repeats=2, points=1)

    return made


BLOCKS, CYLINDER = [380.0, 230.0, 280.0], 20.0
SIDES = np.array(BLOCKS) + CYLINDER


def triangle(figure: str) -> Callable[[str], Made]:
    """Three placings twice, all sides 40 ppm too long; in the second point 2 is 30 µm off, 2 µm more when repeated."""

    def made(how: str) -> Made:
        body = corners(SIDES) * (1 + 40e-6)
        placed = [body, body[:, [1, 2, 0]], body[:, [2, 0, 1]]]
        xyz = np.vstack([one + [100.0, 50.0, -450.0] + 1e-6 * again for one in placed for again in (0, 1)])
        xyz[7] += [9e-3, 0.0, 30e-3]
        xyz[10] += [9e-3, 0.0, 32e-3]
        points = numbered(xyz, how, 2, 3)
        u = 0.0 if how == "no u" else 0.1
        facts = artefact_facts(kind="triangle", blocks_mm=BLOCKS, u_blocks_um=u, cylinders_mm=[CYLINDER] * 3,
                               u_cylinders_um=u)  # fmt: skip
        errors, arcs, ranges = by_loops(points)
        u = 0.1
        of_side, each = u * np.sqrt(1.5), [error for run in errors.values() for error in run]
        value, uncertain = {
            "mean error": (np.mean(each), u * np.sqrt(2 / 3)),
            "standard deviation of errors": (np.std(each, ddof=1), of_side * np.sqrt(len(each) / (len(each) - 1))),
            "angle error": (
                max(arcs, key=lambda one: abs(one[0]))[0],
                u_of_arc(u, max(arcs, key=lambda x: abs(x[0]))[1]),
            ),
            "repeatability": (ranges, 0.02),
        }[figure]
        under = changing(0.0 if how == "no u" else 0.02) if figure == "repeatability" else STATED
        signed = figure in ("mean error", "angle error")
        asked = CompleteTest(measurements=3, repeats=2, points=3)
        return Triangle(facts, points), under, float(value) * 1e3, float(uncertain), signed, asked

    return made


def by_loops(points: Points) -> tuple[dict[tuple[int, int], list[float]], list[tuple[float, int]], float]:
    """Errors of the sides of each run, arcs of its angles with their corners, and the largest range of repeats."""
    errors: dict[tuple[int, int], list[float]] = {}
    arcs = []
    for group in set(points.group.tolist()) - set(points.copies):
        p = points.xyz[points.group == group]
        errors[points.run_of(group)] = [float(np.linalg.norm(p[(i + 1) % 3] - p[i]) - SIDES[i]) for i in range(3)]
        for i in range(3):
            found, certified = (
                np.arccos((q[(i + 1) % 3] - q[i]) @ (q[i - 1] - q[i]) / np.linalg.norm(q[(i + 1) % 3] - q[i])
                          / np.linalg.norm(q[i - 1] - q[i]))
                for q in (p, corners(SIDES))
            )  # fmt: skip
            arcs.append((float(found - certified) * min(SIDES[i], SIDES[i - 1]), i))
    ranges = [
        abs(errors[number, 1][i] - errors[number, 2][i])
        for number in (1, 2, 3)
        if {(number, 1), (number, 2)} <= errors.keys()
        for i in range(3)
    ]
    return errors, arcs, max(ranges, default=0.0)


def u_of_arc(u: float, corner: int) -> float:
    """From the cosine rule: bc·sin A·dA = a·da − (b − c·cos A)·db − (c − b·cos A)·dc; blocks and half cylinders alike."""
    b, c, a = SIDES[corner], SIDES[corner - 1], SIDES[(corner + 1) % 3]
    cos = (b**2 + c**2 - a**2) / (2 * b * c)
    slopes = np.array([a, -(b - c * cos), -(c - b * cos)]) / (b * c * np.sqrt(1 - cos**2))  # of sides a, b, c
    of_cylinders = 0.5 * np.array([slopes[1] + slopes[2], slopes[0] + slopes[1], slopes[0] + slopes[2]])
    return float(u * min(b, c) * np.linalg.norm([*slopes, *of_cylinders]))


def surface(how: str) -> Made:
    """A grid of twenty-five points, tilted, with a bump."""
    x, y = (part.ravel() for part in np.meshgrid(np.linspace(100, 500, 5), np.linspace(100, 400, 5)))
    z = -400.0 + 1e-4 * x - 2e-4 * y
    z[7] += 6e-3
    both = np.tile(np.column_stack([x, y, z]), (2, 1)) + 1e-6 * (np.arange(50) >= 25)[:, None]
    points = numbered(both, how, 1, 25)
    worst = 0.0
    for number in np.unique(points.measurement):
        p = points.xyz[points.measurement == number]
        about = p - p.mean(axis=0)
        worst = max(worst, float(np.ptp(about @ np.linalg.svd(about)[2][2])))
    facts = artefact_facts(kind="plane", form_um=None if how == "no u" else 0.2)
    under = replace(STATED, uncertainty=TestUncertainty(u_form_um=0.0 if how == "no u" else 1e-6))
    return (
        PlaneSurface(facts, points),
        under,
        worst * 1e3,
        0.1,
        False,
        CompleteTest(measurements=2, repeats=1, points=25),
    )


def ring(how: str) -> Made:
    """Twenty-five points around a ring that lies flat, one of them 6 µm too far out."""
    turn = 2 * np.pi * np.arange(25) / 25
    radii = 25.0 + 6e-3 * (np.arange(25) == 7)
    one = np.column_stack([300 + radii * np.cos(turn), 250 + radii * np.sin(turn), np.full(25, -200.0)])
    points = numbered(np.tile(one, (2, 1)) + 1e-6 * (np.arange(50) >= 25)[:, None], how, 1, 25)
    fit = least_squares(lambda p: np.linalg.norm(one[:, :2] - p[:2], axis=1) - p[2], [300.0, 250.0, 25.0], xtol=1e-15)
    facts = artefact_facts(kind="ring", length_mm=50.0, u_um=0.1, form_um=None if how == "no u" else 0.2)
    under = replace(STATED, uncertainty=TestUncertainty(u_form_um=0.0 if how == "no u" else 1e-6))
    complete = CompleteTest(measurements=2, repeats=1, points=25)
    return RingGauge(facts, points), under, 1e3 * float(np.ptp(fit.fun)), 0.1, False, complete


def attitudes(how: str) -> Made:
    """The sphere's centre in five attitudes, of which one is 20 µm off."""
    angles = np.array([*THREE, (180.0, 90.0, 90.0), (0.0, 45.0, 30.0)])
    offset, turns = np.array([1.0, 120.0, 80.0]), [euler_313(*np.radians(one)) for one in angles]
    xyz = np.array([[300.0, 250.0, -200.0] + turn @ offset for turn in turns])
    xyz[1, 2] += 20e-3
    again = np.repeat(xyz, 2, axis=0) + 1e-6 * (np.arange(10) % 2)[:, None]
    columns = {name: np.repeat(angles[:, i], 2) for i, name in enumerate(("alpha_deg", "beta_deg", "gamma_deg"))}
    points = numbered(again, how, 2, **columns)
    numbers = np.unique(points.measurement)
    own = ~np.isin(points.group, list(points.copies))
    means = np.array([points.xyz[own & (points.measurement == number)].mean(axis=0) for number in numbers])
    weights = np.sqrt([np.sum(own & (points.measurement == number)) for number in numbers])
    design = np.array([np.hstack([turns[number - 1], np.eye(3)]) for number in numbers])
    scaled = (weights[:, None, None] * design).reshape(-1, 6), (weights[:, None] * means).ravel()
    found = np.linalg.lstsq(*scaled, rcond=None)[0]
    value = float(np.linalg.norm(means - design @ found, axis=1).max())
    under = changing(0.0 if how == "no u" else 0.2)
    asked = CompleteTest(measurements=5, repeats=2, points=1)
    return DigitizerArtefact(artefact_facts(kind="digitizer"), points), under, value * 1e3, 0.2, False, asked


def curve(how: str) -> Made:
    """The curve of an axis that comes to 27 µm, with u = 0.4 µm, from three series of four points."""
    xyz = np.array([[100.0 * i + 20.0 * j + 1e-4 * i * j, 200.0, -300.0] for j in range(3) for i in range(4)])
    points = numbered(xyz, how, 1, 4)
    figure = ArtefactFigure(np.array([27e-3]), np.arange(len(points))[None], np.array([300.0]), np.array([0.4e-3]))
    asked = CompleteTest(measurements=3, repeats=1, points=4)
    return ShiftedReadings(points, {"linearity": figure}), STATED, 27.0, 0.4, False, asked


def of_plane(figure: str, value_um: float, u_um: float) -> Callable[[str], Made]:
    """A figure of each of two axes, or of the angle between them, beside one of half the size; four placings of nine balls."""

    def made(how: str) -> Made:
        balls = np.array([[100.0 * (i % 3), 100.0 * (i // 3), -300.0] for i in range(9)])
        xyz = np.vstack([balls + np.array([20.0 * j, 15.0 * j, 1e-4 * j]) for j in range(4)])
        points = numbered(xyz, how, 1, 9)
        size = np.array([0.5, 1.0])[1 if figure == "squareness" else 0 :]
        rows = np.tile(np.arange(len(points)), (len(size), 1))
        found = ArtefactFigure(value_um * 1e-3 * size, rows, np.array([420.0, 380.0])[-len(size) :], u_um * 1e-3 * size)
        asked = CompleteTest(measurements=4, repeats=1, points=9)
        return ShiftedReadings(points, {figure: found}), STATED, value_um, u_um, figure == "squareness", asked

    return made


OWN: Mapping[str, Callable[[str], Made]] = {
    "error": of_bar("error", certified=True),
    **{name: of_bar(name) for name in ("span", "standard deviation", "span corrected", "standard deviation corrected",
                                       "pivot offset")},
    **{name: triangle(name) for name in ("mean error", "standard deviation of errors", "angle error", "repeatability")},
    "flatness": surface,
    "roundness": ring,
    "closure": attitudes,
    "linearity": curve,
    "straightness": of_plane("straightness", 4.0, 0.1),
    "squareness": of_plane("squareness", -9.0, 0.5),
}  # fmt: skip
