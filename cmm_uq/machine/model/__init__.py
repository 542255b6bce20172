"""One model of a measurement, forward and inverse: the simulator draws from exactly what the estimator fits."""

from __future__ import annotations

from cmm_uq.machine.model.drawn_noise import Noise
from cmm_uq.machine.model.measurement import Estimate, RecordingModel

__all__ = ["Estimate", "Noise", "RecordingModel"]
