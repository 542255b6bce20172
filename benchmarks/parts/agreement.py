"""Do statements of one machine contradict each other, of machines whose model is right, and of which something is wrong?

Machines are drawn from the priors that docs/machine/field.md states: sizes of families half-normal, functions of one axis as
its formula has them, written here a second time and with the kinematics of :mod:`benchmarks.parts.truth`. Their certificates'
figures are held against each other as a report does it. Then the same with something wrong: a line whose gauge was warmer, a
reading that is off, a field that lacks a kind of error, a sign that is changed in one of the ways a figure is found.

Run: ``python -m benchmarks.parts.agreement FOLDER [--machines N] [--only WORDS]``; a run can be stopped and taken up again;
``--page`` writes the table of the page.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from benchmarks.coverage.measuring import counted, kept
from benchmarks.parts import machines, truth
from benchmarks.parts.curved import SORTS, Cell as OfSort, Smooth, drawn, study
from benchmarks.parts.regions import calibrated
from cmm_uq.analysis.machine.agreement import DISAGREES, Agreement, lines_of
from cmm_uq.analysis.machine.conditional import RecordedField
from cmm_uq.analysis.machine.performance import rows_of
from cmm_uq.analysis.machine.regions import DrawnErrors, other_errors
from cmm_uq.machine.model.field import ROTATION, family_of
from cmm_uq.machine.model.measurement import RecordingModel
from cmm_uq.maths.inference.posterior import Doubt, NoisyPosterior, gain

BEGIN, END = "<!-- written by benchmarks.parts.agreement -->", "<!-- end of agreement -->"
NO_DOUBT, EXPANSION = Doubt(()), 11.5e-6
NOISE_MM, SIZES = 0.7e-3, 2000  # sizes of families, of which each machine of known noise has one
ALIKE = 100  # machines of known noise that are measured in the same places
DRAWS = 500  # of all errors together, where a report has 2000: sizes of families are as many
ALONG_UM, ACROSS_UM, TURN_ARCSEC = 20.0, 50.0, 30.0
"""Root mean square over the travel that the page allows; those of other errors are :data:`benchmarks.parts.truth.PHYSICS`."""
KINDS = ("factor", "line", "length")
WRONG: dict[str, tuple[float, ...]] = {
    "nothing": (0.0,),
    "one line's gauge, or bar, warmer by K": (1.0, 3.0, 10.0, 30.0),
    "one reading off by µm": (3.0, 10.0, 30.0, 100.0),
    "no rotations in the field": (1.0,),
    "sign of the field's part of the factors": (1.0,),
    "sign of the field's part of the slopes": (1.0,),
    "sign of the lengths to be expected": (1.0,),
}
"""What is wrong, and by how much; each is tried on a machine of its own."""


@dataclass(frozen=True)
class Cell:
    """Machines of the stated priors (``sort`` ``None``) or of a class, calibrated alike, with something wrong or not."""

    sort: int | None
    artefact: str
    noise: str
    wrong: str = "nothing"

    @property
    def name(self) -> str:
        """Of its file too."""
        of = "as stated beforehand" if self.sort is None else SORTS[self.sort].name
        return ", ".join((of, self.artefact, self.noise, *([] if self.wrong == "nothing" else [self.wrong])))

    @property
    def key(self) -> tuple[int, ...]:
        """Seeds of its own."""
        own = machines.Cell(self.artefact, "stated" if self.noise == KNOWN else self.noise, 0.0).key
        sort = (98 if self.noise == KNOWN else 99) if self.sort is None else self.sort
        return sort, *own, list(WRONG).index(self.wrong)


KNOWN = "known"
"""Noise of the machines that are made by the thousand: everything is linear then, and all but sizes is exact."""
EVERY = (
    *(Cell(None, artefact, KNOWN) for artefact in ("bars", "step gauge")),
    *(Cell(None, artefact, noise) for artefact in ("bars", "step gauge") for noise in ("white", "stated", "set-up")),
    *(Cell(sort, artefact, "white") for artefact in ("bars", "step gauge") for sort in range(8)),
    *(Cell(0, artefact, "white", wrong) for wrong in list(WRONG)[1:] for artefact in ("bars", "step gauge")),
    *(Cell(2, artefact, "white", wrong) for wrong in list(WRONG)[3:] for artefact in ("bars", "step gauge")),
)


ORDERS = np.arange(1, 11)


def function(
    axis: int, most: float, sizes: tuple[float, float], forms: int, random: np.random.Generator
) -> Callable[..., Any]:
    """f(a) of docs/machine/field.md, its long and its short waves as large as ``sizes`` say."""
    low, high = truth.TRAVEL[axis]
    long, short = sizes
    each = np.where(ORDERS <= 2, long, short) * random.standard_normal(len(ORDERS)) / ORDERS
    simple = long * random.standard_normal(2) * [1.0, float(forms == 2)]
    part = most / np.sqrt(forms + mean_square_of_waves(axis))

    def value(a: np.ndarray) -> np.ndarray:
        t = 2 * (a - low) / (high - low) - 1
        bow, slope = np.sqrt(5) * 0.5 * (3 * t**2 - 1), np.sqrt(3) * t
        return part * (simple[0] * bow + simple[1] * slope + waves(axis, a) @ each)

    return value


def waves(axis: int, a: np.ndarray) -> np.ndarray:
    low, high = truth.TRAVEL[axis]
    return np.sqrt(2) * np.cos(np.pi * ORDERS * (a[:, None] - low + (high - low) / 8) / (1.25 * (high - low)))


@cache
def mean_square_of_waves(axis: int) -> float:
    """Over the travel, of all together, each over its order."""
    fine = np.linspace(*truth.TRAVEL[axis], 20_001)
    return float(np.mean((waves(axis, fine) / ORDERS) ** 2, axis=0).sum())


def as_stated(random: np.random.Generator) -> truth.Truth:
    """A machine of the priors: every family of one half-normal size."""
    sizes = {name: np.abs(random.standard_normal(2)) for name in ("along", "across", "turn")}
    play, wave = np.abs(random.standard_normal(2))

    def curves(axis: int) -> Callable[[np.ndarray], np.ndarray]:
        parts = [
            function(axis, ALONG_UM, tuple(sizes["along"]), 1, random) if b == axis
            else function(axis, ACROSS_UM, tuple(sizes["across"]), 1, random) for b in range(3)
        ]  # fmt: skip
        parts += [function(axis, TURN_ARCSEC, tuple(sizes["turn"]), 2, random) for _ in range(3)]
        return lambda at: np.column_stack([one(at) for one in parts])

    none, most = np.zeros((3, 3)), truth.PHYSICS
    return Smooth(
        most["scale"] * random.standard_normal(3), most["squareness"] * random.standard_normal(3), none, none,
        play * most["hysteresis"] * random.standard_normal(3), wave * most["periodic"] * random.standard_normal((3, 2)),
        np.exp(random.uniform(*np.log(truth.PERIODS), 3)), tuple(curves(axis) for axis in range(3)),
    )  # fmt: skip


def measured(task: tuple[Cell, int, int]) -> dict[str, Any]:
    """One machine: of each kind of figure the largest difference, over what is allowed; by what is wrong."""
    cell, seed, number = task
    if cell.noise == KNOWN:
        own = partial(_linear, cell.artefact, seed, number // ALIKE)
        return counted(cell, seed, number, lambda random: {"size": 0.0, **own()[number % ALIKE]}, 13)
    size = WRONG[cell.wrong][number % len(WRONG[cell.wrong])]
    return counted(cell, seed, number, lambda random: {"size": size, **_measured(cell, size, random)}, 13)


def _measured(cell: Cell, size: float, random: np.random.Generator) -> dict[str, Any]:
    hidden = as_stated(random) if cell.sort is None else drawn(SORTS[cell.sort], random)
    of = OfSort(SORTS[cell.sort or 0], cell.artefact, cell.noise)
    model, posterior, seed = calibrated(
        of, hidden, random, lambda artefact: wronged(artefact, cell.wrong, size, random)
    )
    agreement = _held(model, posterior, cell.wrong, seed)
    return _told(agreement)


def _told(agreement: Agreement) -> dict[str, Any]:
    worst = {kind: max((one.ratio for one in agreement.pairs if one.kind == kind), default=0.0) for kind in KINDS}
    return {"ratios": worst, "figures": sum(agreement.counts.values()), "disagree": len(agreement.disagree)}


@dataclass(frozen=True, eq=False)
class Dense:
    """A recording's places, and what of its observations follows from machines of the priors, by whole matrices.

    Parameters
    ----------
    figures : (q, n) combinations of what placings leave of the observations, and their kinds.
    own : (n, n) covariance of noise and artefact.
    root, inverse : of the covariance of all, for sizes that are drawn from their priors (S, n, n).
    """

    figures: np.ndarray
    kinds: tuple[str, ...]
    own: np.ndarray
    root: np.ndarray
    inverse: np.ndarray


@cache
def dense(artefact: str, number: int) -> Dense:
    """Of places of their own, as on a machine without errors, with noise of known size."""
    one, none = machines.Cell(artefact, "stated", 0.0), truth.Truth.of_six(dict.fromkeys(truth.SIX, 0.0))
    random = np.random.default_rng([number, 17])
    model = RecordingModel(machines.calibrated(one, none, 0.0, 0.0, random), machines.NAMED, NOISE_MM)
    linear, whole = model.estimate().linear, RecordedField.of(model, other_errors(model)).field
    k, m, placing = 6, len(linear.observed), linear.freedoms.dense()
    N = scipy.linalg.null_space(placing.T) if placing.size else np.eye(m)
    shown = linear.design * linear.prior_sd
    own = NOISE_MM**2 * np.diag(linear.noise_scale**2) + shown[:, k:] @ shown[:, k:].T
    covariance = {name: np.zeros((m, m)) for name in (None, *whole.families)}
    covariance[None] = own + shown[:, :k] @ shown[:, :k].T
    for each in whole.errors:
        columns = each.columns if each.impulse is None or each.covariance is None else each.impulse
        tied = np.eye(columns.shape[1]) if each.covariance is None else each.covariance
        covariance[each.family] += columns @ tied @ columns.T
    sizes = np.abs(random.standard_normal((SIZES, len(whole.families))))
    parts = np.stack([N.T @ covariance[name] @ N for name in whole.families])
    K = N.T @ covariance[None] @ N + np.einsum("sf,fij->sij", sizes**2, parts)
    rows, lines = rows_of(model.artefact), np.array([weights for _, weights in lines_of(model)])
    lengths = np.eye(m)
    if model.artefact.rows.shape[1] == 1 and rows is not None:  # observed is each face
        lengths = lengths[rows[:, 1]] - lengths[rows[:, 0]]
    every = [gain(linear, NOISE_MM)[:k], lines, lengths]
    kinds = [kind for kind, some in zip(KINDS, every, strict=True) for _ in some]
    return Dense(np.vstack(every) @ N, tuple(kinds), N.T @ own @ N, np.linalg.cholesky(K), np.linalg.inv(K))


@cache
def _linear(artefact: str, seed: int, places: int) -> list[dict[str, Any]]:
    """Machines of the priors, their noise known: sizes that they may have are weighed by what each shows, all else is exact.

    What was read less what is expected of it is Λ·E[ε | y], with ε noise and artefact.
    """
    of, random = dense(artefact, places), np.random.default_rng([seed, places, 23])
    size, count = of.root.shape[1], len(of.kinds)
    n = np.stack([of.root[random.integers(SIZES)] @ random.standard_normal(size) for _ in range(ALIKE)], axis=1)
    seen = of.inverse @ n
    logs = -0.5 * np.sum(seen * n, axis=1) - np.log(np.diagonal(of.root, axis1=1, axis2=2)).sum(axis=1)[:, None]
    weights = np.exp(logs - logs.max(axis=0))
    weights /= weights.sum(axis=0)
    shown, kinds = of.figures @ of.own, np.array(of.kinds)
    u, z = np.einsum("qi,qi->q", shown, of.figures), float(scipy.special.ndtri(1 - 0.5 * DISAGREES / count))
    found = []
    for i, weight in enumerate(weights.T):
        most = np.flatnonzero(weight > 1e-4)
        off = seen[most, :, i] @ shown.T  # (s, q) for each of the sizes
        mean, known = weight[most] @ off, np.tensordot(weight[most], of.inverse[most], axes=1)
        together = u - np.einsum("qi,qi->q", shown @ known, shown) + weight[most] @ (off - mean) ** 2
        ratio = np.abs(mean) / (z * np.sqrt(u + together))
        worst = {kind: float(ratio[kinds == kind].max()) for kind in KINDS}
        told = {"ratios": worst, "figures": count, "disagree": int(np.sum(ratio > 1))}
        found.append({**told, "sizes": float(1 / np.sum(weight**2))})
    return found


def wronged(artefact: Any, wrong: str, size: float, random: np.random.Generator) -> Any:
    """The recording with a line whose gauge was warmer, or with a reading off along its line."""
    if not wrong.startswith("one "):
        return artefact
    points, xyz = artefact.points, artefact.points.xyz.copy()
    numbers = np.unique(points.measurement)
    own = np.flatnonzero(points.measurement == numbers[random.integers(len(numbers))])
    first = xyz[own[np.argmin(points.point[own])]]
    away = xyz[own] - first
    if wrong.startswith("one line"):
        xyz[own] += EXPANSION * size * away
    else:
        last = int(np.argmax(np.linalg.norm(away, axis=1)))
        xyz[own[last]] += 1e-3 * size * away[last] / np.linalg.norm(away[last])
    return type(artefact)(artefact_facts(artefact), replace(points, xyz=xyz))


def artefact_facts(artefact: Any) -> Any:
    """As :func:`benchmarks.parts.machines.calibrated` made it."""
    from cmm_uq.jobs.tables.artefact import ArtefactFacts, ReferencedFacts

    if artefact.rows.shape[1] == 2:
        return ArtefactFacts(kind="ballbar", length_mm=machines.BAR_MM, u_um=machines.U_BAR_UM)
    return ReferencedFacts(kind="step_gauge", u_um=machines.U_GAUGE_UM, length_mm=machines.GAUGE_MM)


def _held(model: RecordingModel, posterior: NoisyPosterior, wrong: str, seed: int) -> Agreement:
    """As a report does it; with a mistake in the field, or in one of the ways in which figures follow from its draws."""
    others = other_errors(model)
    if wrong.startswith("no rotations"):
        others = [one for one in others if not str(family_of(one.effect)).startswith(ROTATION)]
    found = DrawnErrors.of(model, NO_DOUBT, lambda points: model.artefact, seed, DRAWS, others=others)
    of_recording, performance = found.of_recording(model, posterior), found.performance(model)
    if wrong.endswith(("factors", "slopes")):
        of_recording = copy(of_recording)
        of_factors, of_slopes = of_recording._seen
        signs = (-of_factors, of_slopes) if wrong.endswith("factors") else (of_factors, -of_slopes)
        of_recording.__dict__["_seen"] = signs
    if wrong.endswith("expected") and performance is not None:
        performance = replace(performance, errors=-performance.errors)
    return found.agreement(of_recording, posterior, NO_DOUBT, performance)


def tables(folder: Path) -> str:
    """How often anything is found to disagree, and how large what is wrong must be."""
    records = kept(folder)
    heads = ("machines, calibration, noise", "machines", "figures disagree in", "largest difference over what is allowed: "
             "median", "the largest of all")  # fmt: skip
    lines, wrong = ["| " + " | ".join(heads) + " |", "| --- " * len(heads) + "|"], []
    for cell in EVERY:
        mine = [r for r in records if r["cell"] == cell.name and "ratios" in r]
        if not mine:
            continue
        worst, size = np.array([max(r["ratios"].values()) for r in mine]), np.array([r["size"] for r in mine])
        if cell.wrong == "nothing":
            off = np.count_nonzero(worst > 1)
            lines.append(f"| {cell.name} | {len(mine)} | {off} | {np.median(worst):.2f} | {worst.max():.2f} |")
            continue
        each = ", ".join(
            f"{of:g}: {np.count_nonzero(worst[size == of] > 1)} of {np.count_nonzero(size == of)}"
            for of in np.unique(size)
        )
        wrong.append(f"| {cell.wrong} | {SORTS[cell.sort or 0].name}, {cell.artefact} | {each} |")
    well = [r for r in records if "ratios" in r and r["cell"].startswith("as stated")]
    off, faults = sum(max(r["ratios"].values()) > 1 for r in well), sum("fault" in r for r in records)
    heads = ("what is wrong", "machines, calibration", "how large, and how often it is found")
    table = ["", "| " + " | ".join(heads) + " |", "| --- " * len(heads) + "|", *wrong] if wrong else []
    return "\n".join([
        f"Of {len(well)} machines drawn from the stated priors figures of {off} are found to disagree.",
        "", *lines, *table, "", f"{faults} faults",
    ])  # fmt: skip


if __name__ == "__main__":
    study(str(__doc__), EVERY, measured, tables, (BEGIN, END), 2064)
