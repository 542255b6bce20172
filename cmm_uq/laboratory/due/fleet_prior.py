"""What a fleet taught, as the prior of a further machine; ``fleet.json`` keeps it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.laboratory.due.drift import SideBySide
from cmm_uq.laboratory.due.drift_filter import Start, usual_start
from cmm_uq.laboratory.due.drift_prior import NAMES, Prior, learnt_prior


@dataclass(frozen=True, eq=False)
class FleetPrior:
    """Draws of the hyper-parameters' posterior, and at each the Gaussian of what the fleet, models and places add to a rate.

    Attributes
    ----------
    unit : what hyper-parameters are in units of; see :func:`~cmm_uq.laboratory.due.drift_prior.limit_for`.
    theta : (g, 8) logarithms of hyper-parameters.
    models, places : names.
    effects, covariance : (g, E) and (g, E, E) of 1 + models + places effects.
    """

    unit: float
    theta: Floats
    models: tuple[str, ...]
    places: tuple[str, ...]
    effects: Floats
    covariance: Floats

    @classmethod
    def from_data(cls, data: Mapping[str, Any], where: str = "fleet.json") -> FleetPrior:
        """From ``prior`` of a value in ``fleet.json``.

        Raises
        ------
        CmmUqError : it is not what this version writes.
        """
        try:
            theta, effects, covariance = (
                np.array(data[key], dtype=np.float64) for key in ("log", "effects", "covariance")
            )
            found = FleetPrior(
                float(data["unit"]), theta, tuple(data["models"]), tuple(data["places"]), effects, covariance
            )
            size = 1 + len(found.models) + len(found.places)
            fits = theta.shape == (len(theta), len(NAMES)) and covariance.shape == (len(theta), size, size)
            sound = fits and effects.shape == (len(theta), size) and list(data["hyper_parameters"]) == list(NAMES)
        except (KeyError, TypeError, ValueError):
            sound = False
        if not sound:
            raise CmmUqError(
                "is no prior of a fleet that this version reads", where=where, fix="Make it again: cmm-uq fleet"
            )
        return found

    def data(self) -> dict[str, Any]:
        """For ``fleet.json``."""
        return {
            "unit": self.unit, "hyper_parameters": list(NAMES), "log": self.theta.tolist(), "models": list(self.models),
            "places": list(self.places), "effects": self.effects.tolist(), "covariance": self.covariance.tolist(),
        }  # fmt: skip

    def prior(self, model: str = "", place: str = "") -> Prior:
        """Of a machine of a model at a place; either may be new to the fleet.

        Parameters
        ----------
        model, place : names.
        """
        rate, rate_sd = self._usual_rate(model, place)
        return learnt_prior(self.theta, rate, rate_sd, self.unit)

    def start(self, machines: SideBySide, models: Sequence[str], places: Sequence[str]) -> tuple[Prior, Start]:
        """The same of many machines, side by side: nodes common to all, and the rate of each.

        Parameters
        ----------
        machines : their histories.
        models, places : of each.
        """
        known = {of: self._usual_rate(*of) for of in set(zip(models, places, strict=True))}
        rates = np.array([known[of] for of in zip(models, places, strict=True)])
        prior = self.prior()
        start = usual_start(machines, prior)
        start.mean[0] = rates[:, 0][:, prior.group]
        start.covariance[0, 0] = rates[:, 1][:, prior.group] ** 2
        return prior, start

    def _usual_rate(self, model: str, place: str) -> tuple[Floats, Floats]:
        """Mean and standard deviation (g,) of the rate of a machine at each draw."""
        row = np.zeros(self.effects.shape[1])
        row[0] = 1.0
        sizes = np.exp(self.theta) * self.unit
        variance = sizes[:, NAMES.index("rate_sd")] ** 2
        for name, known, first, of in (
            (model, self.models, 1, "model_sd"),
            (place, self.places, 1 + len(self.models), "place_sd"),
        ):
            if name in known:
                row[first + known.index(name)] = 1.0
            else:
                variance = variance + sizes[:, NAMES.index(of)] ** 2
        variance = variance + np.einsum("i,wij,j->w", row, self.covariance, row)
        return self.effects @ row, np.sqrt(variance)
