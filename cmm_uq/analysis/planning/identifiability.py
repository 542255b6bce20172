"""What set-ups determine of the effects that a job names, from singular values of the whitened design.

Least squares on a design needs no readings: which unknowns it determines, with what uncertainty, and which combinations it
leaves free follow from the set-ups alone. Beside it stands what is left of the prior standard deviation that physics allows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy import linalg

from cmm_uq.analysis.planning.expected import ExpectedUncertainty, expected_uncertainty
from cmm_uq.analysis.planning.information import FAINT, certified, cosines, gram, imitators, left_of, scales, visible
from cmm_uq.analysis.planning.noise import PlannedNoise, uncorrelated, white_noise
from cmm_uq.base.points import Floats
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.machine.physics.effect import Effect
from cmm_uq.maths.inference.least_squares import LeastSquares, solve
from cmm_uq.maths.inference.linear_model import LinearModel, Unknown

Pair = tuple[str, str, float]  # two effects and the absolute cosine between them
NOT_TOLD_APART = 0.98  # cosine from which on a fifth of one effect is all that the other cannot imitate
_ROUNDING = 1e-9
WEAK = 0.1  # part of the prior variance from which on a parameter counts as weakly determined


@dataclass(frozen=True)
class Determination:
    """What to expect of one parameter."""

    unknown: Unknown
    # standard uncertainty of its least-squares estimate, in its unit; None where the set-ups leave it free
    u: float | None
    u_with_prior: float  # the same when what physics allows is used too
    u_white: float | None  # like u, if the noise were white
    status: str  # determined, weak (the prior says almost as much) or free


@dataclass(frozen=True, eq=False)
class Identifiability:
    """What set-ups determine."""

    # of the effects named, and the sizes of the artefact that no certificate gives
    parameters: tuple[Determination, ...]
    # combinations, each by the keys of its parameters and their parts, that leave every observation as it is
    free: tuple[Mapping[tuple[str, str], float], ...]
    # of the design whitened by the noise and scaled by the prior standard deviations, largest first
    singular_values: Floats
    alike: tuple[Pair, ...]  # pairs of effects, and their cosine, that could not be told apart
    # effects, not named by the job, that would be taken for some that it names; with the names of these
    absorbed: tuple[tuple[str, tuple[str, ...]], ...]
    unseen: tuple[str, ...]  # effects, not named by the job, of which nothing would show at all

    @property
    def complete(self) -> bool:
        return all(parameter.status != "free" for parameter in self.parameters)


def identifiability(
    model: RecordingModel, rivals: Sequence[Effect] = (), noise: PlannedNoise | None = None
) -> Identifiability:
    """What the set-ups determine of effects, and how rivals would show; ``noise`` ``None``: the model's white noise."""
    values = np.array([unknown.prior_mean for unknown in model.unknowns])
    linear = model.linearised(values)
    k, free = len(linear.unknowns), linear.freedoms.dense()
    whole = np.linalg.norm(linear.design / linear.noise_scale[:, None], axis=0)
    there = np.linalg.norm(linear.reduced.design, axis=0) > _ROUNDING * whole
    estimate = solve(
        replace(
            linear,
            observed=np.concatenate([linear.observed, np.zeros(k + 1)]),
            design=np.vstack([linear.design * there, np.zeros((k + 1, k))]),
            placing=np.vstack([free, np.zeros((k + 1, free.shape[1]))]),
            noise_scale=np.concatenate([linear.noise_scale, np.ones(k + 1)]),
        )
    )
    white = white_noise(model) if noise is None else noise.white
    under_white = expected_uncertainty(model, white)
    under_noise = under_white if noise is None else expected_uncertainty(model, noise)
    information = gram(model, values, noise) + certified(model.unknowns)
    names = [unknown.key[0] for unknown in model.unknowns]
    alike: list[Pair] = []
    for i, j in combinations([i for i, name in enumerate(names) if name != ARTEFACT], 2):
        rest = [k for k in range(len(information)) if k not in (i, j)]
        left, alone = left_of(information, [i, j], rest), np.diag(information)[[i, j]]
        cosine = float(cosines(left, alone)[0, 1])
        if names[i] != names[j] and np.all(visible(left, alone)) and cosine > NOT_TOLD_APART:
            alike.append((names[i], names[j], cosine))
    others, absorbed, unseen = _among_rivals(model, rivals, noise) if rivals else ([], (), ())
    combined = tuple(
        {u.key: float(part) for u, part in zip(estimate.unknowns, column, strict=True) if part}
        for column in estimate.null_space.T
    )
    one_by_one = uncorrelated(model, values, noise)
    uncertified = [i for i, unknown in enumerate(one_by_one.unknowns) if not unknown.known]
    design = one_by_one.reduced.design[:, uncertified] * scales(one_by_one.unknowns)[uncertified] / white.coordinate
    return Identifiability(
        _parameters(linear, estimate, under_noise, under_white), combined,
        np.asarray(linalg.svdvals(design)) if design.size else np.zeros(0),
        tuple(sorted([*alike, *others], key=lambda pair: -pair[2])), absorbed, unseen,
    )  # fmt: skip


def _parameters(
    linear: LinearModel, estimate: LeastSquares, noisy: ExpectedUncertainty, white: ExpectedUncertainty
) -> tuple[Determination, ...]:
    scale, found = scales(linear.unknowns), []
    for i, unknown in enumerate(linear.unknowns):
        if unknown.known:
            continue
        u, u_white = (float(each.u[i]) if estimate.determined[i] else None for each in (noisy, white))
        weak = unknown.key[0] != ARTEFACT and noisy.with_prior[i] ** 2 > WEAK * scale[i] ** 2
        status = "free" if u is None else "weak" if weak else "determined"
        found.append(Determination(unknown, u, float(noisy.with_prior[i]), u_white, status))
    return tuple(found)


def _among_rivals(
    model: RecordingModel, rivals: Sequence[Effect], noise: PlannedNoise | None
) -> tuple[list[Pair], tuple[tuple[str, tuple[str, ...]], ...], tuple[str, ...]]:
    """Pairs of rivals not told apart, everything named fitted; rivals taken for named effects; rivals that do not show."""
    wider = replace(model, effects=(*model.effects, *rivals))
    values = np.array([unknown.prior_mean for unknown in wider.unknowns])
    information = gram(wider, values, noise) + certified(wider.unknowns)
    names = [unknown.key[0] for unknown in wider.unknowns]
    own = {effect.name for effect in model.effects} | {ARTEFACT}
    fitted = [i for i, name in enumerate(names) if name in own]
    others = [i for i, name in enumerate(names) if name not in own]
    left, alone = left_of(information, others, fitted), np.diag(information)[others]
    seen, cosine = visible(left, alone), cosines(left, alone)
    alike = (cosine > NOT_TOLD_APART) & seen[:, None] & seen[None, :]
    found = [
        (names[others[a]], names[others[b]], float(cosine[a, b]))
        for a, b in zip(*np.nonzero(np.triu(alike, 1)), strict=True)
        if names[others[a]] != names[others[b]]
    ]
    hidden = [i for i, there in zip(others, seen, strict=True) if not there]
    shown = {names[i] for i, there in zip(others, seen, strict=True) if there}
    absorbed = {
        names[i]: tuple(dict.fromkeys(names[j] for j in imitators(information, i, fitted)))
        for i in hidden
        if information[i, i] > FAINT and names[i] not in shown
    }
    unseen = [names[i] for i in hidden if names[i] not in shown and names[i] not in absorbed]
    return found, tuple(absorbed.items()), tuple(dict.fromkeys(unseen))
