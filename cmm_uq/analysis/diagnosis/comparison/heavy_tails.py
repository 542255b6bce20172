"""Log odds under noise that may have heavy tails, of many data, each with tails of its own.

Under Student's t an outlier counts little, and no explanation gains by bending towards one. Where tails are probable, draws of
"nothing is missing" have outliers; odds under a normal distribution rise with these, and a test by them loses power. With one
part of the probability the noise of each data is therefore the kind that is most probable for them, its independent part of
Student's t in place of normal.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cmm_uq.analysis.diagnosis.comparison.evidence import Comparison
from cmm_uq.analysis.diagnosis.noise import tail_precision, with_tails
from cmm_uq.base.points import Floats

_STEPS = 50
"""Of reweighting: whatever weights it ends with, the evidence is not overstated."""

_TINY = 1e-300

_LEAST = 0.05
"""Part of the evidence of nothing below which tails are left out: log odds would change by no more."""


def tailed(normal: Comparison, data: Floats) -> Iterator[tuple[int, Comparison]]:
    """Columns of data for which heavy tails matter, each with its own comparison under them.

    Parameters
    ----------
    normal : the candidates under kinds of noise that are normal.
    data : (m, b) mm, of which the baseline has been taken.
    """
    often = normal.often_heavy
    evidence = normal.of_nothing(data)
    likeliest, total = evidence.argmax(axis=0), np.logaddexp.reduce(evidence, axis=0)
    for g in np.unique(likeliest):
        columns, kind = np.flatnonzero(likeliest == g), normal.kinds[g]
        residuals = _residuals(normal, int(g), data[:, columns])
        for j, residual in zip(columns.tolist(), residuals.T, strict=True):
            # as probable as tails on all kinds: those on the others stand to the others as these do to this one
            share = kind.probability * float(np.exp(total[j] - evidence[g, j]))
            own = normal.under([with_tails(kind, residual, often * share)], data[:, j])
            if own.log_evidence_of(())[0] > total[j] + np.log(_LEAST * (1 - often)):
                yield j, own


def _residuals(normal: Comparison, g: int, data: Floats) -> Floats:
    """Residuals (m, b) of Student's t over its standard deviation, under one kind of noise, its size as fits best.

    Each step is least squares of pseudo-values, which never overshoots (Huber 1981, Robust Statistics, section 7.8).
    """
    noise, count = normal.precision(g), max(normal.degrees_of_freedom, 1)
    white = noise.whitening @ data
    fit, most = noise.explained(white), float(tail_precision(np.zeros(1))[0])
    size = np.sqrt(np.sum((white - fit) ** 2, axis=0) / count)
    for _ in range(_STEPS):
        rest = white - fit
        precision = tail_precision(rest / np.maximum(size, _TINY))
        size = np.sqrt(np.sum(precision * rest**2, axis=0) / count)
        fit = noise.explained(fit + precision / most * rest)
    return np.asarray((white - fit) / np.maximum(size, _TINY), dtype=np.float64)
