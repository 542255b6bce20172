"""How far figures rest on what was taken to be known beforehand.

Sizes of families are half-normal then. With that prior half as wide, or twice, every draw of a machine has another weight,
p′(s)/p(s), so that means and variances of what the machine does follow without drawing anew. Where such weights have no finite
variance, as those of a family that the recording does not show (Pareto tails of k above 0.5: Vehtari, Simpson, Gelman, Yao,
Gabry 2024, J. Mach. Learn. Res. 25(72)), the family's errors are scaled with its prior, which is then what happens, and
elsewhere no less. Errors that are no part of the recording scale with theirs.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from cmm_uq.base.points import Floats

ALL = "all"
TIMES = (0.5, 2.0)  # by which a prior is narrower or wider
MATTERS = 0.1  # part of U by which it or the value then changes, from which on a figure rests on the prior
_WORTH, _HEAVY = 50.0, 0.5
_NOTHING = 1e-9  # of u, below which a change is of rounding


@dataclass(frozen=True, eq=False)
class PriorInfluence:
    """What another prior of one family of errors, or of all, would change."""

    family: str
    times: float  # its width, over the one that was taken
    u: Floats  # (c,) over u as stated
    shift: Floats  # (c,) change of the value over u


def influence_of(
    values: Floats, u: Floats, scales: Mapping[str, Floats], own: Callable[[str], Floats], apart: Mapping[str, Floats]
) -> tuple[PriorInfluence, ...]:
    """Of each family, and of all together, on figures whose draws depend on the families' sizes.

    ``values``: draws (N, c). ``u``: (c,) as stated. ``scales``: (N,) sizes of each family. ``own``: (N, c), what of the values
    errors of a family make. ``apart``: (c,) variances, by family or error, of what is no part of the draws.
    """

    def changed(family: str, names: Collection[str]) -> Iterator[PriorInfluence]:
        for times in TIMES:
            logs = {name: 0.5 * scales[name] ** 2 * (1 - times**-2) for name in names if name in scales}
            shown = [name for name, log in logs.items() if _weights(log) is not None]
            weight = _weights(sum((logs[name] for name in shown), np.zeros(len(values))))
            if weight is None:
                shown, weight = [], np.full(len(values), 1 / len(values))
            before, mean = values.var(axis=0), weight @ values
            ratio = np.divide(weight @ (values - mean) ** 2, before, out=np.ones_like(u), where=before > 0)
            # of no more than the whole variance, which other draws have given
            more, shift = np.minimum(before, u**2) * (ratio - 1), mean - values.mean(axis=0)
            for name in (one for one in logs if one not in shown):
                scaled = own(name)
                more, shift = more + (times**2 - 1) * scaled.var(axis=0), shift + (times - 1) * scaled.mean(axis=0)
            more = more + sum((times**2 - 1) * apart[name] for name in names if name in apart)
            scale = np.where(u > 0, u, 1.0)  # nothing changes what is not uncertain at all
            ratio = np.where(u > 0, np.sqrt(np.maximum(u**2 + more, 0.0)) / scale, 1.0)
            moved = np.where(np.abs(shift) > _NOTHING * scale, shift / scale, 0.0)
            yield PriorInfluence(family, times, np.where(np.abs(ratio - 1) > _NOTHING, ratio, 1.0), moved)

    found = [one for name in (*scales, *apart) for one in changed(name, (name,))]
    return (*found, *(changed(ALL, (*scales, *apart)) if len(found) > len(TIMES) else ()))


def _weights(logs: Floats) -> Floats | None:
    """Of draws whose density has another one's ratio (N,), as its logarithm; ``None`` where they say nothing of it."""
    weight = np.exp(logs - logs.max())
    weight /= weight.sum()
    largest = np.sort(weight)[-int(3 * np.sqrt(len(weight))) :]
    tail = float(np.mean(np.log(largest / largest[0])))  # Hill's estimate of k
    return weight if tail < _HEAVY and 1 / np.sum(weight**2) > _WORTH else None
