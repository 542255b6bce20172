"""The state of a machine from what its certificate carries: the data of ``results.json`` and the draws beside it.

Takes plain data that somebody else has read and verified; nothing here opens a file.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import date
from typing import Any

import numpy as np

from cmm_uq.analysis.parts.machine import MachineState, coefficients_of, noise_of_draws, of_machine, unmodelled_errors
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats, Machine
from cmm_uq.machine.physics.catalogue import effects

_WHERE = "the machine's results.json"


def flat_draws(names: Any, centre: Floats, draws: Floats) -> dict[str, Floats]:
    """Draws (M,) of each quantity by name, from the arrays of ``posterior.npz``: deviations (…, q) from their mean."""
    values = np.asarray(centre) + np.asarray(draws, dtype=np.float64).reshape(-1, len(centre))
    return {str(name): values[:, i] for i, name in enumerate(names)}


def machine_stated(
    results: Mapping[str, Any],
    draws: Mapping[str, Floats],
    machine: Machine,
    *,
    corrected: bool,
    unmodelled: bool = True,
) -> MachineState:
    """The machine as a certificate states it.

    Parameters
    ----------
    results : the data of ``results.json``.
    draws : (M,) of its posterior, by name.
    machine : its chain, travel and origin.
    corrected : whether it corrects what was found.
    unmodelled : whether errors that the calibration did not model are drawn too.

    Raises
    ------
    CmmUqError : results of another kind, or draws that do not belong to them.
    """
    if "estimates" not in results or "identifiability" not in results:
        raise CmmUqError(
            "states no errors of a machine",
            where=_WHERE,
            fix="Give a certificate whose analysis names errors: of a ballbar, step gauge, plate, sphere, …",
        )
    modelled = list(results["estimates"])
    # faults of the artefact, and of the probe that calibrated, are not those of this measurement
    found = tuple(effect for effect in effects(modelled, where=_WHERE) if of_machine(effect))
    shares: dict[str, float] = {}
    for name, share in results["identifiability"].get("prior_share", {}).items():
        effect = name.partition(".")[0]
        if effect in modelled and share is not None:
            shares[effect] = max(shares.get(effect, 0.0), float(share))
    unseen = results.get("diagnosis", {}).get("unseen", [])
    detected = {row["effect"]: row["detected"] for row in unseen}
    day = results.get("job", {}).get("date")
    return MachineState(
        machine,
        found,
        coefficients_of(found, draws),
        noise_of_draws(draws),
        prior_share=shares,
        unmodelled=unmodelled_errors(modelled, detected) if unmodelled else (),
        corrected=corrected,
        calibrated=date.fromisoformat(day) if day else None,
    )
