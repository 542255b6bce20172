"""What a fleet taught, read from the ``fleet.json`` that ``cmm-uq fleet --out`` wrote."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.content import content_of
from cmm_uq.base.files.limits import TABLE_BYTES
from cmm_uq.laboratory.records import Machine

if TYPE_CHECKING:
    from cmm_uq.laboratory.due.drift_prior import Prior
    from cmm_uq.laboratory.due.fleet_prior import FleetPrior


@dataclass(frozen=True, eq=False)
class FleetFile:
    """Priors of the machines of a fleet; of none where nothing was read.

    Parameters
    ----------
    fleets : by the name of the value.
    """

    fleets: Mapping[str, FleetPrior] = field(default_factory=dict)

    def of(self, machine: Machine) -> dict[str, Prior]:
        """Of a machine, by value; its model and place may be new to the fleet."""
        return {name: _prior(fleet, machine.model, machine.place) for name, fleet in self.fleets.items()}


@lru_cache(maxsize=1000)
def _prior(fleet: FleetPrior, model: str, place: str) -> Prior:
    return fleet.prior(model, place)


def read_fleet(file: Path | None) -> FleetFile:
    """Read a fleet's file.

    Parameters
    ----------
    file : ``None`` for no fleet.

    Raises
    ------
    CmmUqError : there is no such file, or it is not what this version writes.
    """
    if file is None:
        return FleetFile()
    from cmm_uq.laboratory.due.fleet_prior import FleetPrior

    fix = "Make it: cmm-uq fleet --out DIR, and name DIR/fleet.json"
    try:
        data = json.loads(content_of(file, TABLE_BYTES, fix))
        values = [(str(value["name"]), value["prior"]) for value in data["values"]]
    except (ValueError, KeyError, TypeError, RecursionError):
        raise CmmUqError("is no fleet.json", where=str(file), fix=fix) from None
    return FleetFile({name: FleetPrior.from_data(prior, str(file)) for name, prior in values})
