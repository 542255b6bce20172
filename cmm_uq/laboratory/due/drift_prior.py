"""What is known of drift before a machine's own certificates: defaults with their reasons, or what its fleet taught.

A prior is a set of nodes, each a full set of the model's parameters with a weight; the model is exact Gaussian algebra at
every node (:mod:`cmm_uq.laboratory.due.drift_filter`), and the nodes are summed over. Defaults are in units of the limit,
which is what makes one machine's figures comparable with another's: docs/records/drift.md gives the reasons.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import special

from cmm_uq.base.points import Floats, Ints

NAMES = ("rate_sd", "model_sd", "place_sd", "walk", "first_sd", "as_left_sd", "steps_per_year", "step_sd")
"""Of the hyper-parameters, all positive; their logarithms are normal before any data."""

MEDIANS = np.array([0.1, 0.05, 0.05, 0.07, 0.35, 0.15, 0.05, 0.4])
"""In units of the limit and of years, but for the steps a year."""

SPREADS = np.array([0.8, 0.8, 0.8, 0.8, 0.5, 0.6, 0.8, 0.6])
"""Standard deviations of the logarithms: a factor of five either way is not surprising, of three for those of a level."""

USUAL_RATE_SD = 0.15
"""Of the rate common to a whole fleet, in limits per year: it may drift either way."""

WALKS_DIFFER = 0.5
"""Standard deviation of the logarithm of one machine's wandering: a sixth of them wander 1.6 times as much, or more."""

WITHOUT_LIMIT = 8.0
"""Standard uncertainties that stand for the limit where none is stated: test uncertainty ratios are from 4 to 10 or so."""

NODES = 128
_WALK_NODES, _WALK_WEIGHTS = np.polynomial.hermite_e.hermegauss(3)

WRONG, WRONG_TIMES = 0.01, 5.0
"""Part of the certificates that are taken to be wrong, and how many times their uncertainty."""


@dataclass(frozen=True, eq=False)
class Prior:
    """Nodes of the model's parameters, in the unit of the values and in years.

    Attributes
    ----------
    rate, rate_sd : (K,) of a machine's rate.
    walk : (K,) standard deviation that a year's wandering adds.
    first_sd, as_left_sd : (K,) of the level at the first certificate, and just after an adjustment; both about zero.
    steps_per_year, step_sd : (K,) how often a step comes, and how large.
    weight : (K,) of the nodes before the machine's data; they sum to one in all groups together.
    group : (K,) nodes of one group are weighed against each other by the machine's data; groups are not, since they come from
        a fleet's posterior, which has these data already.
    """

    rate: Floats
    rate_sd: Floats
    walk: Floats
    first_sd: Floats
    as_left_sd: Floats
    steps_per_year: Floats
    step_sd: Floats
    weight: Floats
    group: Ints

    def __len__(self) -> int:
        return len(self.rate)

    @cached_property
    def members(self) -> NDArray[np.bool_]:
        """(groups, K) whether a node is of a group."""
        return np.asarray(self.group == np.arange(self.group.max() + 1)[:, None])


def limit_for(limit: float | None, u: Floats) -> float:
    """The unit of the defaults: the limit, or where there is none a multiple of the usual uncertainty."""
    return float(limit) if limit else WITHOUT_LIMIT * float(np.median(u))


def default_prior(unit: float, nodes: int = NODES) -> Prior:
    """Of a machine without a fleet.

    Parameters
    ----------
    unit : the limit; see :func:`limit_for`.
    nodes : how many, at the points of Roberts' sequence (2018), the golden ratio's generalisation to more dimensions.
    """
    d = len(NAMES)
    root = 2.0
    for _ in range(60):
        root = (1.0 + root) ** (1.0 / (d + 1))
    points = (0.5 + np.outer(np.arange(1, nodes + 1), root ** -np.arange(1.0, d + 1))) % 1.0
    theta = np.log(MEDIANS) + SPREADS * special.ndtri(points)
    values = _in_unit(np.exp(theta), unit)
    spread = np.sqrt(values["rate_sd"] ** 2 + values["model_sd"] ** 2 + values["place_sd"] ** 2)
    spread = np.hypot(spread, USUAL_RATE_SD * unit)
    return Prior(
        np.zeros(nodes), spread, values["walk"], values["first_sd"], values["as_left_sd"], values["steps_per_year"],
        values["step_sd"], np.full(nodes, 1.0 / nodes), np.zeros(nodes, dtype=np.int64),
    )  # fmt: skip


def learnt_prior(theta: Floats, rate: Floats, rate_sd: Floats, unit: float) -> Prior:
    """Of a machine of a fleet.

    Parameters
    ----------
    theta : (g, 8) logarithms of the hyper-parameters, draws of the fleet's posterior, in units of ``unit``.
    rate, rate_sd : (g,) of the machine's rate at each.
    unit : see :func:`limit_for`.
    """
    g, w = len(theta), len(_WALK_NODES)
    values = {name: np.repeat(value, w) for name, value in _in_unit(np.exp(theta), unit).items()}
    return Prior(
        np.repeat(rate, w), np.repeat(rate_sd, w), values["walk"] * np.tile(np.exp(WALKS_DIFFER * _WALK_NODES), g),
        values["first_sd"], values["as_left_sd"], values["steps_per_year"], values["step_sd"],
        np.tile(_WALK_WEIGHTS / _WALK_WEIGHTS.sum(), g) / g, np.repeat(np.arange(g), w),
    )  # fmt: skip


def _in_unit(values: Floats, unit: float) -> dict[str, Floats]:
    """Columns by name; all but the steps a year are in limits."""
    return {name: values[:, i] * (1.0 if name == "steps_per_year" else unit) for i, name in enumerate(NAMES)}


def log_density(theta: Floats) -> Floats:
    """Of the logarithms of the hyper-parameters before any data, up to a constant, (…, 8) → (…,)."""
    z = (theta - np.log(MEDIANS)) / SPREADS
    return np.asarray(-0.5 * (z * z).sum(axis=-1), dtype=np.float64)
