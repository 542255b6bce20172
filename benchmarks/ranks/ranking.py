"""The rank of a truth among draws of its posterior.

Drawn from what is known beforehand, a truth and independent draws of the posterior of its own recording follow one law: its
rank is uniform, whatever the quantity (Talts, Betancourt, Simpson, Vehtari, Gelman 2018, arXiv:1804.06788, theorem 1), also
one that depends on the recording, such as the likelihood (Modrák et al. 2023, Bayesian Analysis, doi:10.1214/23-BA1404).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from benchmarks.ranks.drawn import Drawn
from cmm_uq.maths.inference.marginal import Marginal
from cmm_uq.maths.inference.noise import AXES, SLOW, Components, Sizes
from cmm_uq.maths.inference.posterior import NoisyPosterior

DRAWS = 99
"""Of a posterior, so that there are a hundred ranks."""
_SAME = 9
"""Decimals to which axes whose noise does not differ are alike."""


def rank(truth: float, draws: np.ndarray, random: np.random.Generator) -> int:
    """How many draws lie below the truth, those equal to it in random order: from 0 to their number."""
    below, equal = int(np.sum(draws < truth)), int(np.sum(draws == truth))
    return below + int(random.integers(equal + 1))


def apart(count: int, random: np.random.Generator, wanted: int = DRAWS) -> np.ndarray:
    """Which of so many draws, in the order of the chains' steps, to keep: as far apart as they can be, beginning anywhere."""
    step = count // wanted
    return int(random.integers(count - step * (wanted - 1))) + step * np.arange(wanted)


def ranks(
    made: Drawn, marginal: Marginal, posterior: NoisyPosterior, random: np.random.Generator
) -> dict[str, int]:  # fmt: skip
    """Of every parameter, every size of the noise, and the likelihood of the sizes."""
    kept = apart(len(posterior.draws), random)
    sizes = posterior.sizes.at(kept)
    found = {
        ".".join(unknown.key): rank(made.values[i], posterior.draws[kept, i], random)
        for i, unknown in enumerate(made.linear.unknowns)
    }
    true, drawn = (of_noise(marginal.noise, each) for each in (made.sizes, sizes))
    found |= {name: rank(values[0], drawn[name], random) for name, values in true.items()}
    likely = [log - 0.5 * squares for log, squares in map(marginal.log_likelihood, (made.sizes, sizes))]
    return found | {"noise.likelihood": rank(likely[0][0], likely[1], random)}


def of_noise(noise: Components, sizes: Sizes) -> Mapping[str, np.ndarray]:
    """Quantities (w,) by name: ln σ, and the size of each component that could show; axes over the mean of all."""
    found = {"noise.ln_sigma": np.log(sizes.coordinate)}
    if AXES in noise.possible:
        ratio = np.round(sizes.reading / sizes.coordinate[:, None], _SAME)
        found |= {f"noise.axis_{a}": ratio[:, i] for i, a in enumerate("xyz")}
    found |= {f"noise.{name}": getattr(sizes, name) for name in noise.possible if name != AXES}
    return found | ({"noise.rate": sizes.rate} if SLOW in noise.possible else {})
