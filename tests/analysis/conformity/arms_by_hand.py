"""A complete test of each characteristic of arms and robots; what must come out is put in, or worked here anew."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.gauge_lines import GaugeBlocks, StepGauge
from cmm_uq.artefacts.optical.tracked import TrackedPoints
from cmm_uq.artefacts.spheres.seat import Seat
from cmm_uq.artefacts.spheres.sphere import SphereArtefact
from cmm_uq.base.arm import Arm
from cmm_uq.base.points import Floats, Points
from cmm_uq.jobs.tables.conformity import Circumstances, TestUncertainty
from cmm_uq.machine.model.artefact import Artefact
from tests.analysis.conformity.recorded import NEGLIGIBLE, STATED

REACH = 1000.0
ARM = Arm("a", reach_mm=REACH)
Row = tuple[int, int, int, Floats]
"""Measurement, point, repeat and place, mm."""
Made = tuple[Artefact, Circumstances, float, float, bool]
UM = 1e-3
X, Y, Z = np.eye(3)


def changing(u_um: float) -> Circumstances:
    return replace(STATED, uncertainty=TestUncertainty(negligible=NEGLIGIBLE, u_repeat_um=u_um))


def recorded(rows: Iterable[Row], **columns: Floats) -> Points:
    measurement, point, repeat, xyz = zip(*rows, strict=True)
    whole = (np.array(each, dtype=np.int64) for each in (measurement, point, repeat))
    at_20 = {"temp_artefact_c": np.full(len(xyz), 20.0)}
    return Points(np.array(xyz), *whole, ARM, {**at_20, **columns})


def copied(points: Points, last: tuple[int, int], of: tuple[int, int]) -> Points:
    """With the places, and references, of one (measurement, repeat) put in those of another."""
    to, source = ((points.measurement == m) & (points.repeat == r) for m, r in (last, of))
    xyz, columns = points.xyz.copy(), {name: values.copy() for name, values in points.columns.items()}
    xyz[to] = xyz[source]
    for name, values in columns.items():
        if name.startswith("reference_"):
            values[to] = values[source]
    return replace(points, xyz=xyz, columns=columns)


LINES = [X, Y, Z, X + Y, X + Z, Y + Z, X + Y + Z]
FACES = np.array([0.0, 20.0, 400.0, 700.0, 1000.0, 1320.0])


def on_lines(both: bool) -> Callable[[str], Made]:
    """Five lengths three times on seven lines; that of 400 mm on the first is 5 µm short, where u = 0.1 µm."""

    def made(how: str) -> Made:
        rows, reference, senses = [], [], []
        for number, along in enumerate(LINES[:-1] if how == "incomplete" else LINES, 1):
            u = along / np.linalg.norm(along)
            for repeat in (1, 2, 3):
                for face, at in enumerate(FACES, 1):
                    off = -5 * UM * (number == 1 and face == 3) * (how != "one repeat out" or repeat == 2)
                    aside = 1e-6 * repeat * np.array([0.3, 0.5, 0.8])
                    rows.append(
                        (number, face, repeat, (at - 660.0 + off) * u + aside + 150.0 * number * Z * (number < 3))
                    )
                    reference.append(at)
                    senses.append(u if face == 1 or not both else -u)
        approach = {f"approach_{a}": np.array(senses)[:, i] for i, a in enumerate("xyz")}
        points = recorded(rows, reference_mm=np.array(reference), **approach)
        if how == "copied":
            points = copied(points, (7, 3), (7, 1))
        facts = artefact_facts(kind="step_gauge", length_mm=1320.0, u_um=None if how == "no u" else "L/4000")
        return StepGauge(facts, points), STATED, 5.0, 0.1, True

    return made


def bars(value: str) -> Callable[[str], Made]:
    """Ten positions of 600 mm, ten of 1300 mm. All are 30 µm long but one, 50 µm short; u = 0.3 or 0.65 µm."""

    def made(how: str) -> Made:
        rows, reference, errors = [], [], []
        for i in range(19 if how == "incomplete" else 20):
            length, turn = (600.0, 1300.0)[i % 2], 2 * np.pi * (i // 2) / 10
            along = (Z, np.array([np.cos(turn), np.sin(turn), 0.0]), np.array([np.cos(turn), np.sin(turn), 1.0]))[i % 3]
            u, middle = along / np.linalg.norm(along), np.array([50.0 * i, 30.0, 20.0 * i])
            errors.append(-50.0 if i == 4 else 30.0)
            for point, end in enumerate((-0.5, 0.5), 1):
                rows.append((i + 1, point, 1, middle + end * (length + errors[-1] * UM) * u))
            reference += [0.0, length]
        points = recorded(rows, reference_mm=np.array(reference))
        if how == "copied":
            points = copied(points, (20, 1), (18, 1))
        if how == "copied":
            errors = errors[:-1]
        facts = artefact_facts(kind="gauge_blocks", u_um=None if how == "no u" else "L/2000")
        artefact = GaugeBlocks(facts, points)
        n, us = len(errors), [0.3 if i % 2 == 0 else 0.65 for i in range(len(errors))]
        if value == "each":
            return artefact, STATED, 50.0, 0.3, True
        rms, u = (2 * (sum(x * x for x in of) / (n - 1)) ** 0.5 for of in (errors, us))
        return artefact, STATED, rms, u, False

    return made


def over(centre: Floats, count: int, radius: float = 12.5) -> list[Floats]:
    """Points over a hemisphere: 1, 4 and 4, or with 25 rings of 1, 4, 8, 4 and 8; with 5 the pole and four at the equator."""
    rings = {5: ((0, 1, 0), (90, 4, 0)), 9: ((0, 1, 0), (45, 4, 0), (90, 4, 45)),
             25: ((0, 1, 0), (22.5, 4, 0), (45, 8, 22.5), (67.5, 4, 0), (90, 8, 22.5))}[count]  # fmt: skip
    found = []
    for polar, of, first in rings:
        for i in range(of):
            p, a = np.radians(polar), np.radians(first + 360 / of * i)
            found.append(centre + radius * np.array([np.sin(p) * np.cos(a), np.sin(p) * np.sin(a), np.cos(p)]))
    return found


def ball(
    count: int, how: str, *, repeats: int, places: int, centres: Floats | None = None, high_um: float = 0.0
) -> Points:
    """The same in some repeats and places; the pole of the first is so high."""
    rows = []
    for place in range(1, places + 1 - (how == "incomplete" and places > 1)):
        middle = np.array([300.0 * place, 100.0, 50.0])
        for repeat in range(1, repeats + 1 - (how == "incomplete" and places == 1)):
            moved = np.zeros(3) if centres is None else centres[repeat - 1] * UM * (1 if place == 1 else 0.5)
            each = over(middle + moved + (1e-6 * repeat * X if centres is None else 0.0), count)
            each[0] = each[0] + high_um * UM * Z * (place == 1)
            rows += [(place, point, repeat, xyz) for point, xyz in enumerate(each, 1)]
    points = recorded(rows)
    if how == "copied":
        return copied(points, (places, repeats), (places if repeats > 1 else 1, 1))
    return points


def probed(*, size: bool) -> Callable[[str], Made]:
    """25 points in two places. Form: u = 0.1 µm, half of 0.2 µm; size: of 0.1 µm, of a ball 4 µm too large."""

    def made(how: str) -> Made:
        points = ball(25, how, repeats=1, places=2, high_um=0.0 if size else 6.0)
        facts = artefact_facts(kind="sphere", length_mm=24.996 if size else 25.0, u_um=None if how == "no u" else 0.1,
                               form_um=None if how == "no u" else 0.2)  # fmt: skip
        artefact = SphereArtefact(facts, points)
        u_form = 0.0 if how == "no u" else 1e-6
        under = replace(STATED, uncertainty=TestUncertainty(u_form_um=u_form))
        return artefact, STATED if size else under, 4.0 if size else float(artefact.forms().form[0]) / UM, 0.1, size

    return made


def effective(how: str) -> Made:
    """Nine points three times, 4 µm too large."""
    facts = artefact_facts(kind="sphere", length_mm=24.996, u_um=None if how == "no u" else 0.1, form_um=0.2)
    return SphereArtefact(facts, ball(9, how, repeats=3, places=1)), STATED, 4.0, 0.1, True


TETRAHEDRON = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1], [0.2, 0.1, 0.0]])
"""Of four centres on a sphere of radius √3, and one within."""


def oriented(how: str) -> Made:
    """Centres at the corners of a tetrahedron: the sphere about them measures 2·√3 times 5 µm."""
    points = ball(5, how, repeats=5, places=2, centres=5.0 * TETRAHEDRON)
    facts = artefact_facts(kind="sphere", length_mm=25.0, u_um=0.1, form_um=0.2)
    return SphereArtefact(facts, points), changing(0.0 if how == "no u" else 0.2), 10.0 * 3**0.5, 0.2, False


AWAY = np.array([4.0, 4.0, 6.0, 6.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0])
"""µm from the mean of a seat, in pairs on opposite sides."""


def seats(value: str) -> Callable[[str], Made]:
    """Seats at 150, 500 and 900 mm; the second has twice the distances of the others."""

    def made(how: str) -> Made:
        rows = []
        for seat, at in enumerate((150.0, 500.0, 900.0)[: 2 if how == "incomplete" else 3], 1):
            for i, away in enumerate(AWAY):
                off = (2.0 if seat == 2 else 1.0) * away * UM * (-1) ** i * (Y, Z)[i // 2 % 2]
                rows.append((seat, 1, i + 1, at * X + off + 0.0))
        points = recorded(rows)
        if how == "copied":
            points = copied(points, (3, 10), (3, 8))
        figure = 12.0 if value == "largest" else 2 * (sum((2 * one) ** 2 for one in AWAY) / 9) ** 0.5
        return Seat(artefact_facts(kind="seat"), points), changing(0.0 if how == "no u" else 0.2), figure, 0.2, False

    return made


CORNERS = 200.0 * np.array([[0, 0, 0], [1, 1, 1], [-1, 1, 1], [-1, -1, -1], [1, -1, -1.0]])
BESIDE = np.array([3.0, 4.0, 12.0])
"""µm from the commanded place to the barycentre of the third pose: 13."""


def commanded(figure: str) -> Callable[[str], Made]:
    """Five poses thirty times. The third strays by 6 µm eleven times to either side and by 2 µm four times; others 1 µm."""

    def made(how: str) -> Made:
        rows, seen = [], []
        for cycle in range(1, 30 + (how != "incomplete")):
            for pose in range(1, 6):
                at = np.array([500.0, 100.0, 700.0]) + CORNERS[pose - 1]
                away = 1.0 if pose != 3 else 6.0 if cycle <= 22 else 2.0
                rows.append((1, pose, cycle, at))
                off = (BESIDE if pose == 3 else 0.0) + away * (-1) ** cycle * (X if pose == 3 else Y)
                seen.append(at + off * UM + 1e-9 * (cycle - 15.5) * Z)
        reference = {f"reference_{a}_mm": np.array(seen)[:, i] for i, a in enumerate("xyz")}
        points = recorded(rows, **reference)
        if how == "copied":
            points = copied(points, (1, 30), (1, 28))
        facts = artefact_facts(kind="tracked_points", frame="base", u_um=None if how == "no u" else 0.5)
        cycles = 30 - (how in ("incomplete", "copied"))
        along = [(6.0 if cycle <= 22 else 2.0) * (-1) ** cycle for cycle in range(1, cycles + 1)]
        middle = sum(along) / cycles
        away = [abs(one - middle) for one in along]
        mean = sum(away) / cycles
        value = mean + 3 * (sum((one - mean) ** 2 for one in away) / (cycles - 1)) ** 0.5
        if figure == "AP":
            beside = BESIDE + middle * X
            return TrackedPoints(facts, points), STATED, float(beside @ beside) ** 0.5, 0.5, False
        return TrackedPoints(facts, points), changing(0.0 if how == "no u" else 0.2), value, 0.2, False

    return made


TURNED = np.array([10.0, 20.0, -30.0])
"""°: a, b, c of all poses, as commanded."""
PER_ARCSECOND = 1e6 / 3600 * np.pi / 180
"""µm of an arc over a metre."""


def oriented_poses(figure: str) -> Callable[[str], Made]:
    """As :func:`commanded`, of angles: the third pose is 9″, −14″ or 20″ off and strays by 4″ 22 times, 1″ eight times."""
    k = "abc".index(figure[-1])

    def made(how: str) -> Made:
        rows, seen, angles = [], [], []
        for cycle in range(1, 30 + (how != "incomplete")):
            for pose in range(1, 6):
                at = np.array([500.0, 100.0, 700.0]) + CORNERS[pose - 1]
                rows.append((1, pose, cycle, at))
                seen.append(at + UM * cycle * X)
                away = 0.2 if pose != 3 else 4.0 if cycle <= 22 else 1.0
                off = OFF_ARCSEC * (pose == 3) + away * (-1) ** cycle + 1e-4 * cycle
                angles.append(TURNED + off / 3600)
        named = {f"reference_{a}_mm": np.array(seen)[:, i] for i, a in enumerate("xyz")}
        for i, a in enumerate("abc"):
            named |= {f"reference_{a}_deg": np.array(angles)[:, i], f"commanded_{a}_deg": np.full(len(rows), TURNED[i])}
        points = recorded(rows, **named)
        if how == "copied":
            points = copied(points, (1, 30), (1, 28))
        facts = artefact_facts(kind="tracked_points", frame="base", u_um=0.5)
        cycles = 30 - (how in ("incomplete", "copied"))
        each = [(4.0 if cycle <= 22 else 1.0) * (-1) ** cycle + 1e-4 * cycle for cycle in range(1, cycles + 1)]
        mean = sum(each) / cycles
        key = "u_orientation_arcsec" if figure.startswith("AP") else "u_repeat_arcsec"
        u = {} if how == "no u" else {key: 0.02}
        under = replace(STATED, uncertainty=TestUncertainty(negligible=NEGLIGIBLE, **u))
        spread = 3 * (sum((one - mean) ** 2 for one in each) / (cycles - 1)) ** 0.5
        value = OFF_ARCSEC[k] + mean if figure.startswith("AP") else spread
        return TrackedPoints(facts, points), under, value * PER_ARCSECOND, 0.02 * PER_ARCSECOND, figure.startswith("AP")

    return made


OFF_ARCSEC = np.array([9.0, -14.0, 20.0])
ARMS: dict[tuple[str, str], Callable[[str], Made]] = {
    ("ISO 10360-12:2016", "P_Form.Sph.1x25::Tact.AArm"): probed(size=False),
    ("ISO 10360-12:2016", "P_Size.Sph.1x25::Tact.AArm"): probed(size=True),
    ("ISO 10360-12:2016", "L_Dia.5x5:Art:Tact.AArm"): oriented,
    ("ISO 10360-12:2016", "E_Uni"): on_lines(both=False),
    ("ISO 10360-12:2016", "E_Bi"): on_lines(both=True),
    ("ASME B89.4.22-2004", "volumetric performance"): bars("each"),
    ("ASME B89.4.22-2004", "volumetric performance 2 RMS"): bars("rms"),
    ("ASME B89.4.22-2004", "effective diameter"): effective,
    ("ASME B89.4.22-2004", "SPAT"): seats("twice"),
    ("ASME B89.4.22-2004", "SPAT maximum"): seats("largest"),
    ("ISO 9283:1998", "AP"): commanded("AP"),
    ("ISO 9283:1998", "RP"): commanded("RP"),
    **{("ISO 9283:1998", f"{of}_{angle}"): oriented_poses(f"{of}_{angle}") for of in ("RP", "AP") for angle in "abc"},
}
