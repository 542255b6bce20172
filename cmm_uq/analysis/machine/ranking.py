"""Which error makes how much of what was recorded: the errors of a machine ranked by what each did to the observations.

What an artefact deviates by, freed of how it lay, is the sum of what each named error makes of it, of what its sizes differ
from nominal, and of what is left: y = Σ aⱼ + r. The share of a cause is aⱼ·y/(y·y): shares add up to one, and one below zero
takes away from what others make (Pratt, Proc. 2nd Tampere Conf. in Statistics (1987) 245).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE
from cmm_uq.machine.model.measurement import RecordingModel


@dataclass(frozen=True)
class Contribution:
    """What one cause does to the observations."""

    owner: str | None  # effect, or the artefact; ``None``: no named one
    rms_um: float  # root mean square over the observations, each in a reading of one coordinate, µm
    share: float  # of the sum of squares of all


def contributions(model: RecordingModel, values: Floats) -> tuple[Contribution, ...]:
    """Of every named error, the artefact's sizes and what no error explains, the largest share first.

    ``values``: (k,) of the unknowns.
    """
    linear = model.linearised(values)
    apart = values - np.array([unknown.prior_mean for unknown in linear.unknowns])
    parts = linear.reduce(linear.design * apart)
    left = linear.reduce((linear.observed - linear.design @ values)[:, None])[:, 0]
    owners = [unknown.key[0] for unknown in linear.unknowns]
    each: dict[str | None, Floats] = {
        owner: parts[:, [one == owner for one in owners]].sum(axis=1) for owner in dict.fromkeys(owners)
    }
    each[None] = left
    whole = np.sum(list(each.values()), axis=0)
    square = float(whole @ whole) or 1.0
    found = (
        Contribution(owner, float(np.sqrt(np.mean(part**2))) / MICROMETRE, float(part @ whole) / square)
        for owner, part in each.items()
    )
    return tuple(sorted(found, key=lambda one: -one.share))
