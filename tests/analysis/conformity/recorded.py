"""Recordings whose every error is put in by hand: lines of a step gauge, bars, spheres."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from cmm_uq.artefacts import artefact_facts
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.artefacts.gauge_lines import StepGauge
from cmm_uq.artefacts.spheres.sphere import SphereArtefact
from cmm_uq.base.points import Floats, Ints, Machine, Points
from cmm_uq.jobs.tables.conformity import Circumstances, Declared, NegligibleLines, RatedConditions, TestUncertainty
from tests.recordings import TRAVEL, bar_facts

MACHINE = Machine("m", "XYZ", TRAVEL)
MIDDLE = TRAVEL.mean(axis=1)
DIAGONALS = [np.array([900.0 * a, 550 * b, 500]) for a, b in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
SEVEN = [*DIAGONALS, *np.eye(3)]

BAR_U = 0.5 / np.sqrt(2.0)
"""Of a bar's certificate, µm: 0.5 µm of the difference of two of its lengths."""

_BY = Declared(by="A. Muster", reason="put in by hand")
NEGLIGIBLE = NegligibleLines(expansion=_BY, temperature=_BY, alignment=_BY, fixturing=_BY, form=_BY)
RATED = RatedConditions(declared=_BY)
STATED = Circumstances(TestUncertainty(negligible=NEGLIGIBLE, u_repeat_um=0.5), RATED, cte_per_k=11.5e-6)
"""A test whose uncertainty is the calibration's alone, of ranges half a micrometre, and somebody answers for the rest."""

Errors = Mapping[tuple[int, int, float], float]
"""Error, µm, of the length, mm, of a measurement and repeat."""


def gauge(
    directions: Sequence[Floats] = SEVEN, lengths: Sequence[Sequence[float]] | None = None, *, errors: Errors | None = None,
    repeats: int = 3, u_um: float | str | None = "L/2000", length_mm: float = 800.0, machine: Machine = MACHINE,
) -> StepGauge:  # fmt: skip
    """Each line through the middle of the volume, faces at 0 and at its lengths; repeats differ by 1 nm across the line.

    The first face is met along the line, the others against it.
    """
    xyz, columns = [], []
    for number, direction in enumerate(directions, 1):
        u = np.asarray(direction) / np.linalg.norm(direction)
        aside = np.cross(u, [0.3, 0.5, 0.8])
        faces = np.array([0.0, *(lengths[number - 1] if lengths else five(direction))])
        for repeat in range(1, repeats + 1):
            added = np.array([(errors or {}).get((number, repeat, face), 0.0) for face in faces]) * 1e-3
            start = MIDDLE - 0.5 * faces[-1] * u + 1e-6 * repeat * aside
            xyz.append(start + np.outer(faces + added, u))
            columns += [(number, i + 1, repeat, face, *(u if i == 0 else -u)) for i, face in enumerate(faces)]
    measurement, point, repeated, reference, *approach = np.array(columns).T
    named = {f"approach_{a}": along for a, along in zip("xyz", approach, strict=True)}
    points = Points(
        np.vstack(xyz), whole(measurement), whole(point), whole(repeated), machine,
        {"reference_mm": reference, "temp_artefact_c": np.full(len(reference), 20.0), **named},
    )  # fmt: skip
    return StepGauge(artefact_facts(kind="step_gauge", length_mm=length_mm, u_um=u_um), points)


def five(direction: Floats) -> list[float]:
    """20 mm, and four more up to 70 % of the travel along a line through the middle."""
    u = np.abs(direction) / np.linalg.norm(direction)
    travel = min(size / part for size, part in zip(np.ptp(TRAVEL, axis=1), u, strict=True) if part > 1e-9)
    return [20.0, *(round(0.7 * travel * part) * 1.0 for part in (0.25, 0.5, 0.75, 1.0))]


def whole(values: Floats) -> Ints:
    return values.astype(np.int64)


def copied_runs(artefact: StepGauge, runs: Mapping[tuple[int, int], tuple[int, int]]) -> StepGauge:
    """With the coordinates of some (measurement, repeat) put in the place of others."""
    points = artefact.points
    xyz = points.xyz.copy()
    for to, of in runs.items():
        at, source = (
            (points.measurement == measurement) & (points.repeat == repeat) for measurement, repeat in (to, of)
        )
        xyz[at] = xyz[source]
    facts = artefact_facts(kind="step_gauge", length_mm=artefact.sizes[0].nominal, u_um=artefact.certificate.facts.u_um)
    return StepGauge(facts, points.at(xyz))


TWENTY = [
    *((1, 1, 0), (1, -1, 0), (0, 1, -1), (0, 1, 1), (1, 0, -1), (1, 0, 1)), *((1, 1, 1), (1, 1, -1), (1, -1, -1), (1, -1, 1)),
    *[(1, 0, 0)] * 4, *[(0, 1, 0)] * 4, *[(0, 0, 1)] * 2,
]  # fmt: skip
"""Six face and four space diagonals, four bars along X, four along Y, two along Z: figures C 1 and C 2 of Harris 2004."""


def bars(
    directions: Sequence[tuple[int, int, int]] = TWENTY, *, step_mm: float = 15.0, machine: Machine = MACHINE,
    lengths: Sequence[float] | None = None,
) -> Ballbar:  # fmt: skip
    """A bar of 300 mm along each direction, each placed ``step_mm`` further up than the one before."""
    ends = []
    for i, direction in enumerate(directions):
        u = np.array(direction) / np.linalg.norm(direction)
        half = 0.5 * (lengths[i] if lengths else 300.0 + 1e-4 * (i % 7)) * u
        middle = MIDDLE + np.array([0.0, 0.0, step_mm * (i - 10)])
        ends += [middle - half, middle + half]
    number = np.repeat(np.arange(1, len(directions) + 1), 2)
    points = Points(np.array(ends), number, np.tile([1, 2], len(directions)), np.ones_like(number), machine)
    return Ballbar(bar_facts(300.0, BAR_U), points)


def again(bar: Ballbar, numbers: Mapping[int, int], moved_mm: float = 0.0, *, turned: bool = False) -> Ballbar:
    """With some measurements in the place of others, moved along X, or with their ends exchanged."""
    points = bar.points
    xyz = points.xyz.copy()
    for to, of in numbers.items():
        xyz[points.measurement == to] = points.xyz[points.measurement == of][:: -1 if turned else 1] + np.array(
            [moved_mm, 0, 0]
        )
    return Ballbar(bar_facts(300.0, BAR_U), replace(points, xyz=xyz))


def sphere(
    *, points: int = 25, copied: int = 0, cap_deg: float = 90.0, form_um: float | None = 0.2, height_um: float = 3.0,
    spheres: int = 1,
) -> SphereArtefact:  # fmt: skip
    """Points on a spiral over a cap of a sphere, every other one too high; the last ``copied`` of them are the first again."""
    count = points - copied
    height = 1 - (np.arange(count) + 0.5) / count * (1 - np.cos(np.radians(cap_deg)))
    turn = np.pi * (1 + np.sqrt(5)) * np.arange(count)
    normals = np.column_stack([np.sqrt(1 - height**2) * np.cos(turn), np.sqrt(1 - height**2) * np.sin(turn), height])
    xyz = (12.5 + np.where(np.arange(count) % 2, height_um * 1e-3, 0.0))[:, None] * normals
    xyz = np.vstack([xyz, xyz[:copied]])
    every = np.vstack([xyz + np.array([30.0 * k, 0, 0]) for k in range(spheres)])
    number = np.repeat(np.arange(1, spheres + 1), points)
    facts = artefact_facts(kind="sphere", length_mm=25.0, u_um=0.1, form_um=form_um)
    columns = {"temp_artefact_c": np.full(len(number), 20.0)}
    return SphereArtefact(
        facts, Points(every, number, np.tile(np.arange(1, points + 1), spheres), np.ones_like(number), MACHINE, columns)
    )
