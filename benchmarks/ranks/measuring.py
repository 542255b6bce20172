"""One recording drawn, its posterior sampled, and the ranks of all that is true."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.ranks.drawn import CASES, design, drawn
from benchmarks.ranks.ranking import ranks
from cmm_uq.maths.inference.linear_model import solve
from cmm_uq.maths.inference.marginal import Marginal
from cmm_uq.maths.inference.posterior import sample_with_noise


@dataclass(frozen=True)
class Case:
    """An artefact by its name."""

    name: str


Task = tuple[Case, int, int]
"""Case, seed of the study, number of the recording."""


def ranked(task: Task) -> dict[str, Any]:
    """The ranks of one recording, and how far its chains can be trusted; a fault is kept in words."""
    case, seed, number = task
    found: dict[str, Any] = {"cell": case.name, "number": number}
    random = np.random.default_rng([seed, CASES.index(case.name), number])
    start = time.perf_counter()
    try:
        of = design(case.name, seed, number)
        made = drawn(of, random)
        estimate = solve(made.linear)
        posterior = sample_with_noise(made.linear, of.noise, estimate, number)
        found["ranks"] = ranks(made, Marginal(made.linear, of.noise, estimate), posterior, random)
        found |= {"ess": posterior.ess_min, "rhat": posterior.rhat_max, "converged": posterior.converged}
    except Exception as fault:  # a study of many goes on, and counts it
        found["fault"] = f"{type(fault).__name__}: {fault}"
    return found | {"seconds": time.perf_counter() - start}
