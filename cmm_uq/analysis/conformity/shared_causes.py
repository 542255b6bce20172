"""Uncertainty of test values, cause by cause, and the probability that all of them conform together.

Calibration, expansion and temperature of the artefact are shared by all values of a test, alignment and fixturing by those of
one set-up (ISO/TS 23165): the probability that all conform is not the product of their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import MICROMETRE, REFERENCE_TEMPERATURE
from cmm_uq.jobs.tables.circumstances import Circumstances
from cmm_uq.machine.model.artefact import Artefact, Indications
from cmm_uq.maths.uncertainty.budget import Budget

_SETTINGS = 4096  # Of the shared causes, over which is averaged: the joint probability of 105 lengths is good to 0.001
_AT_ONCE = 2_000_000  # Numbers that are held at once


@dataclass(frozen=True, eq=False)
class Causes:
    """What makes m test values uncertain."""

    # (m, s) by how much one standard uncertainty of each cause that all values share changes each value, µm, with sign
    shared: Floats
    own: Floats  # (m,) standard uncertainty that values of one set-up share, µm
    set_up: Ints  # (m,) number of the set-up

    @property
    def u(self) -> Floats:
        """(m,) standard uncertainty of each value, µm."""
        return np.asarray(np.sqrt((self.shared**2).sum(axis=1) + self.own**2), dtype=np.float64)

    def at_least(self, least_um: Floats) -> Causes:
        """The same with u not below some (m,), µm: what these have more is shared by all; where u is 0 it stays so."""
        u = self.u
        more = np.where((u > 0) & (u < least_um), np.sqrt(np.maximum(least_um**2 - u**2, 0.0)), 0.0)
        return Causes(np.column_stack([self.shared, more]), self.own, self.set_up) if more.any() else self

    def of(self, chosen: Ints) -> Causes:
        return Causes(self.shared[chosen], self.own[chosen], self.set_up[chosen])


def temperatures(found: Indications, artefact: Artefact) -> Floats | None:
    """Temperature of the artefact at each length, (m,) °C; ``None`` where it was not recorded."""
    recorded = artefact.points.columns.get("temp_artefact_c")
    return None if recorded is None else np.asarray(recorded[found.rows].mean(axis=1), dtype=np.float64)


def length_budget(
    length_mm: float, u_mm: float, temperature_c: float, circumstances: Circumstances, u_beside_mm: float = 0.0
) -> Budget:
    """Test uncertainty of one length (ISO/TS 23165:2006); ``u_mm`` includes ``u_beside_mm`` of a short gauge beside it."""
    from cmm_uq.maths.uncertainty.budgets.machine import length_test_uncertainty

    stated = circumstances.uncertainty
    return length_test_uncertainty(
        length_mm,
        float(_own(np.array(u_mm), u_beside_mm)),
        temperature_c=temperature_c,
        cte_per_k=circumstances.cte_per_k or 0.0,
        u_cte_per_k=stated.u_cte_per_k,
        u_temperature_k=stated.u_temperature_k,
        u_alignment_mm=stated.u_alignment_um * MICROMETRE,
        u_fixturing_mm=stated.u_fixturing_um * MICROMETRE,
        u_beside_mm=u_beside_mm,
        calibration_dof=circumstances.calibration_dof,
    )


def causes_of_lengths(found: Indications, artefact: Artefact, circumstances: Circumstances) -> Causes:
    """Of every length of a recording, by the same budget."""
    recorded = temperatures(found, artefact)
    degrees = np.full(len(found.lengths), REFERENCE_TEMPERATURE) if recorded is None else recorded
    beside = np.zeros(len(found.u)) if found.u_beside is None else found.u_beside
    own = _own(found.u, beside)
    wanted, which = np.unique(np.column_stack([found.lengths, own, degrees]), axis=0, return_inverse=True)
    lines = np.array([
        [line.contribution for line in length_budget(float(length), float(u), float(t), circumstances).lines]
        for length, u, t in wanted
    ])[which.ravel()] / MICROMETRE  # fmt: skip
    calibration, expansion, temperature, alignment, fixturing = lines.T
    signed = np.sign(degrees - REFERENCE_TEMPERATURE) * expansion
    further = [] if found.u_beside is None else [beside / MICROMETRE]
    shared = np.column_stack([calibration, signed, temperature, *further])
    return Causes(shared, np.hypot(alignment, fixturing), artefact.points.measurement[found.rows[:, 0]])


def _own(u: Floats, beside: Floats | float) -> Floats:
    return np.asarray(np.where(np.asarray(beside) > 0, np.sqrt(np.maximum(u**2 - np.asarray(beside) ** 2, 0.0)), u))


def probability_of_all(values: Sequence[float] | Floats, limits: Sequence[float] | Floats, causes: Causes, *,
                       signed: bool) -> float | None:  # fmt: skip
    """Probability that all quantities lie within their limits, given what was measured; ``None`` without an uncertainty.

    Of what is shared the largest cause, or of each set-up its own, is integrated exactly; over the others an even sequence
    of settings is averaged, the same on every run.

    ``values, limits``: (m,) of what was measured, µm.
    """
    if not len(causes.own) or not np.all(causes.u > 0):
        return None
    value, limit = np.asarray(values, dtype=np.float64), np.asarray(limits, dtype=np.float64)
    shared = causes.shared[:, np.any(causes.shared, axis=0)]
    if np.any(causes.own > 0):
        return _averaged(value, limit, shared, causes.own, causes.set_up, signed)
    largest = int(np.argmax((shared**2).sum(axis=0)))
    others, all_alike = np.delete(shared, largest, axis=1), np.zeros(len(value), dtype=np.int64)
    return _averaged(value, limit, others, shared[:, largest], all_alike, signed)


def _averaged(value: Floats, limit: Floats, shared: Floats, slope: Floats, group: Ints, signed: bool) -> float:
    order = np.argsort(group, kind="stable")
    starts = np.flatnonzero(np.diff(group[order], prepend=group[order][0] - 1))
    settings = _normal(_SETTINGS if shared.shape[1] else 1, shared.shape[1])
    total = 0.0
    for block in np.array_split(settings, max(1, len(settings) * len(value) // _AT_ONCE)):
        moved = (value[:, None] + shared @ block.T)[order]
        s, top = slope[order][:, None], limit[order][:, None]
        low = -top - moved if signed else np.full_like(moved, -np.inf)
        ends = np.stack([low, top - moved])
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.where(s != 0, ends / s, np.where(ends >= 0, np.inf, -np.inf))
        lower, upper = ends.min(axis=0), ends.max(axis=0)
        outside = (s == 0) & ((moved > top) | (signed & (moved < -top)))
        lower, upper = np.where(s == 0, -np.inf, lower), np.where(s == 0, np.inf, upper)
        narrow = np.minimum.reduceat(upper, starts, axis=0), np.maximum.reduceat(lower, starts, axis=0)
        chance = np.maximum(0.0, special.ndtr(narrow[0]) - special.ndtr(narrow[1]))
        chance = np.where(np.logical_or.reduceat(outside, starts, axis=0), 0.0, chance)
        total += float(chance.prod(axis=0).sum())
    return total / len(settings)


def _normal(count: int, dimensions: int) -> Floats:
    """Normal deviates (count, dimensions) spread evenly: Kronecker's sequence of the generalised golden ratio."""
    ratio = 2.0
    for _ in range(40):
        ratio = (1 + ratio) ** (1 / (dimensions + 1))
    steps = ratio ** -np.arange(1, dimensions + 1)
    return np.asarray(special.ndtri((0.5 + np.outer(np.arange(1, count + 1), steps)) % 1), dtype=np.float64)
