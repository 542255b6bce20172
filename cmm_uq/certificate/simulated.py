"""The simulation that a recording was compared with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.reading import sha256
from cmm_uq.jobs.simulation import SimulationFacts
from cmm_uq.machine.model import MeasurementModel
from cmm_uq.machine.model.predicted_errors import PredictedErrors
from cmm_uq.machine.physics.effect import Effect


@dataclass(frozen=True, eq=False)
class Simulated:
    """The simulation that a recording was compared with.

    Parameters
    ----------
    files : with their SHA-256.
    program : that made it, in the user's words.
    maps : whether it is error maps.
    u_um, u_common_um : of a predicted coordinate, root mean square, and of the artefact's size, as stated.
    u_turned_um : what there is besides because the artefact was taken to lie in another direction, root mean square.
    contains : effects that it contains.
    refitted : those that were estimated anew.
    shift_mm, turn_deg : of its frame against the recording's.
    farthest_mm : from a recorded point to the predicted one.
    rms_predicted_um : of the errors that it predicts, as the observations show them.
    """

    files: Mapping[str, str]
    program: str
    maps: bool
    u_um: float
    u_common_um: float
    u_turned_um: float
    contains: tuple[str, ...]
    refitted: tuple[str, ...]
    shift_mm: tuple[float, ...]
    turn_deg: float
    farthest_mm: float
    rms_predicted_um: float

    @classmethod
    def of(
        cls, facts: SimulationFacts, job: Job, found: PredictedErrors, named: Sequence[Effect], model: MeasurementModel
    ) -> Simulated:
        """As a job names it.

        Parameters
        ----------
        facts : ``[simulation]``.
        job : with its files.
        found : of the prediction.
        named : effects that it contains.
        model : of the recording.
        """
        files = [given.file for given in facts.map] if facts.file is None else [facts.file]
        hashes = sha256(job.inputs)
        contains = tuple(effect.name for effect in named)
        shown = model.artefact.project(model.artefact.points.xyz, found.errors[:, :, None])[model.used, 0]
        return cls(
            {name: hashes[name] for name in files}, facts.program, bool(facts.map),
            _rms_um(found.u), facts.u_common_um, _rms_um(found.turned), contains,
            contains if facts.refit else (), tuple(float(v) for v in found.frame.shift),
            float(np.degrees(found.frame.angle)), found.apart, _rms_um(shown),
        )  # fmt: skip

    def data(self, corrections: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
        """For results.json.

        Parameters
        ----------
        corrections : of the effects that were estimated anew, as data.
        """
        return {
            "files_sha256": dict(self.files), "program": self.program, "kind": "map" if self.maps else "prediction",
            "u_um": self.u_um, "u_common_um": self.u_common_um, "u_turned_um": self.u_turned_um,
            "effects": list(self.contains),
            "refitted": dict(corrections), "frame": {"shift_mm": list(self.shift_mm), "turn_deg": self.turn_deg},
            "farthest_mm": self.farthest_mm, "rms_predicted_um": self.rms_predicted_um,
        }  # fmt: skip


def _rms_um(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2))) / MICROMETRE
