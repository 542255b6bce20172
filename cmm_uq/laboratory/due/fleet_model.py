"""What a fleet's certificates say of its hyper-parameters, with all that is linear integrated exactly.

A machine's certificates speak of its rate and of the errors of its artefacts; given the hyper-parameters they do so nearly as
a Gaussian would (exactly, where no tale but the first counts: moments over the tales otherwise). Rates of machines are those
usual for fleet, model and place, and their own; artefacts are shared. All of these are then one Gaussian, integrated in one
solution of linear equations (a hierarchical linear model: Gelman et al. 2013, Bayesian Data Analysis, chapter 15).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass
from cmm_uq.laboratory.due.drift import NAMES, USUAL_RATE_SD, DriftPrior, Histories, learnt_prior, log_density
from cmm_uq.laboratory.due.drift_filter import DriftStart, DriftState, filtered, log_sum, usual_start

_RATE, _MODEL, _PLACE = (NAMES.index(name) for name in ("rate_sd", "model_sd", "place_sd"))
MOST_ARTEFACTS = 100
"""Of those that several machines were measured with: the others, used least, count as each machine's own."""

_KEPT = 4  # tales that hyper-parameters are learnt from


@dataclass(frozen=True, eq=False)
class SharedEffects:
    """What machines have in common: G = 1 + models + places + artefacts that several were measured with."""

    models: tuple[str, ...]
    places: tuple[str, ...]
    artefacts: tuple[str, ...]
    design: Floats  # (N, 1 + q, G) from these to the rate usual for each machine, and to the errors of its artefacts

    def variances(self, theta: Floats, unit: float) -> Floats:
        """Before any data, (W, G)."""
        sizes = np.exp(theta)
        one = np.ones(len(theta))
        columns = [one * USUAL_RATE_SD * unit]
        columns += [sizes[:, _MODEL] * unit] * len(self.models) + [sizes[:, _PLACE] * unit] * len(self.places)
        return np.stack([*columns, *[one] * len(self.artefacts)], axis=1) ** 2

    def some(self, which: Ints) -> SharedEffects:
        return SharedEffects(self.models, self.places, self.artefacts, self.design[which])


def shared_by(machines: Histories, models: Sequence[str], places: Sequence[str]) -> SharedEffects:
    """What machines of these models and places share; an artefact of one machine only is the machine's own."""
    N, q = machines.artefacts.shape
    used = np.bincount(machines.artefacts[machines.artefacts >= 0], minlength=len(machines.names))
    common = np.sort(np.argsort(-used, kind="stable")[: min(MOST_ARTEFACTS, int((used > 1).sum()))])
    all_models, all_places = sorted(set(models)), sorted(set(places))
    first = 1 + len(all_models) + len(all_places)
    design, rows = np.zeros((N, 1 + q, first + len(common))), np.arange(N)
    design[:, 0, 0] = 1.0
    design[rows, 0, [1 + all_models.index(name) for name in models]] = 1.0
    design[rows, 0, [1 + len(all_models) + all_places.index(name) for name in places]] = 1.0
    for column, artefact in enumerate(common):
        machine, slot = np.nonzero(machines.artefacts == artefact)
        design[machine, 1 + slot, first + column] = 1.0
    return SharedEffects(tuple(all_models), tuple(all_places), tuple(machines.names[i] for i in common), design)


@dataclass(frozen=True, eq=False)
class Messages:
    """What each machine says of its rate and its artefacts, up to a factor exp(constant + η·v − v·Λ·v/2)."""

    constant: Floats  # (N, W)
    linear: Floats  # (N, W, 1 + q)
    precision: Floats  # (N, W, 1 + q, 1 + q)

    def without_own_rate(self, rate_sd: Floats) -> Messages:
        own = 1.0 / (self.precision[..., 0, 0] + rate_sd**-2.0)
        row = self.precision[..., 0, :]
        return Messages(
            self.constant + 0.5 * np.log(own * rate_sd**-2.0) + 0.5 * own * self.linear[..., 0] ** 2,
            self.linear - row * (own * self.linear[..., 0])[..., None],
            self.precision - own[..., None, None] * row[..., :, None] * row[..., None, :],
        )


@dataclass(frozen=True, eq=False)
class SharedGaussian:
    """The Gaussian of all that machines share, for W sets of hyper-parameters."""

    precision: Floats  # and linear: (W, G, G) and (W, G)
    linear: Floats
    log_evidence: Floats  # (W,) of all certificates


def messages(machines: Histories, shared: SharedEffects, theta: Floats, unit: float) -> Messages:
    """What machines say, for W sets of hyper-parameters (W, 8), with no components: these are each machine's own."""
    rate_variance = (np.exp(2 * theta[:, _RATE]) + np.exp(2 * theta[:, _MODEL]) + np.exp(2 * theta[:, _PLACE])
                     + USUAL_RATE_SD**2) * unit**2  # fmt: skip
    prior = learnt_prior(theta, np.zeros(len(theta)), np.sqrt(rate_variance), unit)
    log_evidence, mean, covariance = _of_groups(filtered(machines, prior, kept=_KEPT), prior)
    common = np.asarray(shared.design.any(axis=2))
    common[:, 0] = True
    both = common[:, None, :, None] & common[:, None, None, :]
    before = np.ones(mean.shape)
    before[..., 0] = rate_variance
    own = np.eye(mean.shape[2])
    covariance = np.where(both, covariance, own)  # what is a machine's own is left out, integrated
    mean = np.where(common[:, None], mean, 0.0)
    before = np.where(common[:, None], before, 1.0)
    inverse = np.linalg.inv(covariance)
    linear = (inverse @ mean[..., None])[..., 0]
    constant = log_evidence - 0.5 * (mean * linear).sum(axis=-1) - 0.5 * np.linalg.slogdet(covariance)[1]
    return Messages(constant + 0.5 * np.log(before).sum(axis=-1), linear, inverse - own / before[..., None])


def _of_groups(state: DriftState, prior: DriftPrior) -> tuple[Floats, Floats, Floats]:
    """Evidence (N, W), mean (N, W, d) and covariance (N, W, d, d) of rate and artefacts over tales and a group's nodes."""
    N, K, M = state.log_weight.shape
    W = len(prior.members)
    each = (N, W, K // W * M)
    log_weight = (state.log_weight + np.log(prior.weight * W)[:, None]).reshape(each)
    log_evidence = log_sum(log_weight)
    weight = np.exp(log_weight - log_evidence[..., None])
    values = state.mean[1:].reshape(-1, *each)
    d = len(values)
    mean = (weight * values).sum(axis=-1)
    off = values - mean[..., None]
    inner = state.covariance[1:, 1:].reshape(d, d, *each)
    covariance = (weight * (inner + off[:, None] * off)).sum(axis=-1)
    return log_evidence, mean.transpose(1, 2, 0), covariance.transpose(2, 3, 0, 1)


def together(said: Messages, shared: SharedEffects, theta: Floats, unit: float) -> SharedGaussian:
    """All machines' messages and the prior of what they share, for each set of hyper-parameters."""
    variances = shared.variances(theta, unit)
    of_usual = said.without_own_rate(np.exp(theta[:, _RATE]) * unit)
    A = shared.design
    N, r, G = A.shape
    W = len(theta)
    right = np.einsum("nwij,njg->niwg", of_usual.precision, A, optimize=True).reshape(N * r, W * G)
    flat = A.reshape(N * r, G)
    precision = (flat.T @ right).reshape(G, W, G).transpose(1, 0, 2)
    linear = (flat.T @ of_usual.linear.transpose(0, 2, 1).reshape(N * r, W)).T
    precision = precision + (1.0 / variances)[:, :, None] * np.eye(G)
    solved = np.linalg.solve(precision, linear[..., None])[..., 0]
    evidence = of_usual.constant.sum(axis=0) + 0.5 * (linear * solved).sum(axis=1)
    evidence -= 0.5 * (np.linalg.slogdet(precision)[1] + np.log(variances).sum(axis=1))
    return SharedGaussian(precision, linear, evidence)


def log_posterior(machines: Histories, shared: SharedEffects, theta: Floats, unit: float) -> Floats:
    """Of hyper-parameters (W, 8), up to a constant, (W,)."""
    said = messages(machines, shared, theta, unit)
    found = together(said, shared, theta, unit).log_evidence + log_density(theta)
    return np.where(np.isfinite(found), found, -np.inf)


def others(
    said: Messages, all_together: SharedGaussian, shared: SharedEffects, theta: Floats, unit: float
) -> DriftStart:
    """Rate and artefacts' errors of each machine as all the others say: (1 + q, N, W) and (1 + q, 1 + q, N, W)."""
    rate_sd = np.exp(theta[:, _RATE]) * unit
    of_usual = said.without_own_rate(rate_sd)
    N, r, _ = shared.design.shape
    mean, covariance = np.zeros((r, N, len(theta))), np.zeros((r, r, N, len(theta)))
    for i, A in enumerate(shared.design):
        precision = all_together.precision - A.T @ of_usual.precision[i] @ A
        linear = all_together.linear - of_usual.linear[i] @ A
        solved = np.linalg.solve(precision, np.concatenate([linear[..., None], np.broadcast_to(A.T, (len(theta), *A.T.shape))],
                                                           axis=2))  # fmt: skip
        mean[:, i] = A @ solved[:, :, 0].T
        covariance[:, :, i] = (A @ solved[:, :, 1:]).transpose(1, 2, 0)
        for slot in np.flatnonzero(~A.any(axis=1)):  # an artefact of its own, or none
            covariance[slot, slot, i] = 1.0
        covariance[0, 0, i] += rate_sd**2
    return DriftStart(mean, covariance)


@dataclass(frozen=True, eq=False)
class FleetPrior:
    """Draws of the hyper-parameters' posterior, and at each the Gaussian of what the fleet, models and places add to rates."""

    unit: float  # what hyper-parameters are in units of; see :func:`~cmm_uq.laboratory.due.drift.limit_for`
    theta: Floats  # (g, 8) logarithms of hyper-parameters
    models: tuple[str, ...]  # and places: names
    places: tuple[str, ...]
    effects: Floats  # and covariance: (g, E) and (g, E, E) of 1 + models + places effects
    covariance: Floats

    @classmethod
    def from_data(cls, data: Mapping[str, Any], where: str = "fleet.json") -> FleetPrior:
        """From ``prior`` of a value in ``fleet.json``."""
        try:
            theta, effects, covariance = (np.array(data[name], float) for name in ("log", "effects", "covariance"))
            models, places = tuple(data["models"]), tuple(data["places"])
            found = FleetPrior(float(data["unit"]), theta, models, places, effects, covariance)
            size = 1 + len(models) + len(places)
            fits = theta.shape == (len(theta), len(NAMES)) and covariance.shape == (len(theta), size, size)
            sound = fits and effects.shape == (len(theta), size) and list(data["hyper_parameters"]) == list(NAMES)
        except (KeyError, TypeError, ValueError):
            sound = False
        if not sound:
            fix = "Make it again: cmm-uq fleet"
            raise CmmUqError("is no prior of a fleet that this version reads", where=where, fix=fix)
        return found

    def data(self) -> dict[str, Any]:
        """For ``fleet.json``."""
        return {
            "unit": self.unit, "hyper_parameters": list(NAMES), "log": self.theta.tolist(), "models": list(self.models),
            "places": list(self.places), "effects": self.effects.tolist(), "covariance": self.covariance.tolist(),
        }  # fmt: skip

    def prior(self, model: str = "", place: str = "") -> DriftPrior:
        """Of a machine of a model at a place; either may be new to the fleet."""
        return learnt_prior(self.theta, *self._usual_rate(model, place), self.unit)

    def start(self, machines: Histories, models: Sequence[str], places: Sequence[str]) -> tuple[DriftPrior, DriftStart]:
        """The same of many machines, side by side: nodes common to all, and the rate of each."""
        known = {of: self._usual_rate(*of) for of in set(zip(models, places, strict=True))}
        rates = np.array([known[of] for of in zip(models, places, strict=True)])
        prior = self.prior()
        start = usual_start(machines, prior)
        start.mean[0] = rates[:, 0][:, prior.group]
        start.covariance[0, 0] = rates[:, 1][:, prior.group] ** 2
        return prior, start

    def _usual_rate(self, model: str, place: str) -> tuple[Floats, Floats]:
        """Mean and standard deviation (g,) of the rate of a machine at each draw."""
        row = np.zeros(self.effects.shape[1])
        row[0] = 1.0
        sizes = np.exp(self.theta) * self.unit
        variance = sizes[:, NAMES.index("rate_sd")] ** 2
        for name, known, first, of in (
            (model, self.models, 1, "model_sd"),
            (place, self.places, 1 + len(self.models), "place_sd"),
        ):
            if name in known:
                row[first + known.index(name)] = 1.0
            else:
                variance = variance + sizes[:, NAMES.index(of)] ** 2
        variance = variance + np.einsum("i,wij,j->w", row, self.covariance, row)
        return self.effects @ row, np.sqrt(variance)
