"""The plain peer: the effect with the largest fall in χ², then the next, while the fall is significant at 1 %.

It is given the true noise, takes it for white, knows the catalogue's common effects and nothing else, and corrects for
having looked at all of them (Bonferroni). It has no intervals, no probabilities, and nothing to say of what it does not know.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy import stats

from cmm_uq.analysis.diagnosis.comparison.explanations import known_effects
from cmm_uq.analysis.diagnosis.comparison.search import comparison_of
from cmm_uq.app.commands.diagnose import screened_model
from cmm_uq.app.commands.reading import read_job

ALPHA, MOST = 0.01, 5


def searched(job: Path, sigma_um: float) -> list[str]:
    """Names of the effects found."""
    model, _ = screened_model(read_job(job))
    values = model.estimate().least_squares.value
    effects = [e for e in known_effects(model, values, tuple(e.name for e in model.effects)) if e.weight == 1]
    sigma = sigma_um * 1e-3
    comparison = comparison_of(model, sigma, ())
    scale = comparison.noise_scale[:, None]
    columns, owners = [], []
    for i, effect in enumerate(effects):
        for member in effect.members:
            if not member.rough:
                columns.append(comparison.rest(member.columns / scale))
                owners.append(i)
    left, named, taken = comparison.left, [], np.zeros((len(scale), 0))
    while len(named) < MOST:
        best = (0.0, "", taken)
        for column, owner in zip(columns, owners, strict=True):
            if effects[owner].name in named:
                continue
            rest = column - taken @ (taken.T @ column)
            if np.linalg.norm(rest) < 1e-5 * np.linalg.norm(column):
                continue
            U, s, _ = np.linalg.svd(rest, full_matrices=False)
            U = U[:, s > 1e-6 * s[0]]
            fall = float(np.sum((U.T @ left) ** 2)) / sigma**2
            surprise = -float(stats.chi2.logsf(fall, U.shape[1])) - np.log(owners.count(owner))
            if surprise > best[0]:
                best = surprise, effects[owner].name, U
        if best[0] < -np.log(ALPHA / len(effects)):
            break
        named.append(best[1])
        taken = np.hstack([taken, best[2]])
        left = left - best[2] @ (best[2].T @ left)
    return named
