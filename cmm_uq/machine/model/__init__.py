"""One model of a measurement, forward and inverse: the simulator draws from exactly what the estimator fits."""

from __future__ import annotations

from cmm_uq.machine.model.measurement import Estimate, RecordingModel
from cmm_uq.machine.model.recorded import Noise

__all__ = ["Estimate", "Noise", "RecordingModel"]
