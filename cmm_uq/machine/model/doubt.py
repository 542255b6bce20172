"""What a job states of the artefact's temperature, expansion, alignment and fixturing, as errors of the observations.

The sensitivities are those of the test uncertainty of a length L (ISO/TS 23165): L·(t − 20 °C) for the coefficient of
expansion, L·α for the temperature; what is stated of a length by alignment and fixturing is that of the longest of a set-up,
of others in proportion. The artefact, grown by a part of its size, shows what each observation has of the length.
"""

from __future__ import annotations

import numpy as np

from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE, REFERENCE_TEMPERATURE
from cmm_uq.jobs.tables.circumstances import Circumstances
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.maths.inference.doubt import Cause


def causes_of(artefact: Artefact, circumstances: Circumstances) -> tuple[Cause, ...]:
    """Causes that the observations (m,) of an artefact err by; none where nothing is stated, or it has no dimension.

    The coefficient of expansion is one; whether the others err alike in all set-ups is not known. Of the calibration a size of
    the artefact has what all its lengths have in common; here is what is more where each has an error of its own.
    """
    stated, along = circumstances.uncertainty, growth(artefact)
    if along is None:
        return ()
    set_up, excess = artefact.measurement, np.zeros(len(along))
    if (recorded := artefact.points.columns.get("temp_artefact_c")) is not None:
        excess = recorded[artefact.rows].mean(axis=1) - REFERENCE_TEMPERATURE
    of_length = stated.u_alignment_um or stated.u_fixturing_um
    part = along / longest_lengths(artefact) * MICROMETRE if of_length else np.zeros(len(along))
    changes = (
        (say("temperature of the artefact"), stated.u_temperature_k * (circumstances.cte_per_k or 0.0) * along),
        (say("alignment of the artefact"), stated.u_alignment_um * part),
        (say("fixturing of the artefact"), stated.u_fixturing_um * part),
    )
    expansion = Cause(say("expansion coefficient of the artefact"), (stated.u_cte_per_k * excess * along)[:, None])
    calibration = artefact.calibration()
    every = (expansion, *(Cause.of_blocks(name, change, set_up) for name, change in changes))
    stated_causes = tuple(cause for cause in every if np.any(cause.common))
    return stated_causes if calibration is None else (calibration, *stated_causes)


def growth(artefact: Artefact) -> Floats | None:
    """Change of the observations (m,), mm, if the artefact were twice its size; ``None`` without a dimension."""
    dimensions = [i for i, size in enumerate(artefact.sizes) if size.role == "dimension"]
    if not dimensions:
        return None
    nominal = np.array([artefact.sizes[i].nominal for i in dimensions])
    return np.asarray(artefact.size_change()[:, dimensions] @ nominal, dtype=np.float64)


def longest_lengths(artefact: Artefact) -> Floats:
    """Longest length, (m,) mm, in the set-up of each observation, the artefact's largest dimension at the most."""
    largest = max(size.nominal for size in artefact.sizes if size.role == "dimension")
    found, of_point = np.empty(len(artefact.measurement)), artefact.points.measurement
    for number in np.unique(artefact.measurement):
        xyz = artefact.points.xyz[of_point == number]
        away = np.linalg.norm(xyz - xyz[0], axis=1)
        extent = np.linalg.norm(xyz - xyz[np.argmax(away)], axis=1).max()
        found[artefact.measurement == number] = min(extent, largest) if extent > 0 else largest
    return found
