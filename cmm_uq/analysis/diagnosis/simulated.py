"""What a simulation predicted of a recording, and its mistakes that remain possible."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cmm_uq.base.messages import NOTHING, Text
from cmm_uq.base.units import Unit, unit as unit_named
from cmm_uq.base.values import dataclass


@dataclass(frozen=True)
class SimulationMistake:
    name: str
    title: Text
    remedy: Text
    probability: float  # among all that was compared, the diagnosis's explanations of the prediction as it is included
    # over the prediction as it is, nothing missing; ``None`` where figures say it themselves
    odds_over_none: float | None
    odds_over_physics: float | None  # over all that the diagnosis compared with it
    rms_um: float  # of the residuals without it
    heldout_rms_um: float  # of predictions of what was left out of the fit
    elpd_gain: float  # in expected log predictive density of that, and its standard error
    elpd_gain_se: float
    value: float | None = None
    u: float | None = None
    unit: Unit = unit_named("1")


@dataclass(frozen=True)
class SimulationMistakes:
    """Mistakes that remain, most probable first, of how many; ``named``: those of the one group that is asserted."""

    tried: int = 0
    told: tuple[SimulationMistake, ...] = ()
    named: tuple[SimulationMistake, ...] = ()
    why: Text = NOTHING  # nothing is named, where something is told
    rms_before_um: float = 0.0
    heldout_rms_before_um: float = 0.0
    rounded: SimulationMistake | None = None

    @property
    def asserted(self) -> tuple[SimulationMistake, ...]:
        return (*self.named, *([self.rounded] if self.rounded else []))


@dataclass(frozen=True, eq=False)
class SimulatedTwin:
    files: Mapping[str, str]  # SHA-256 by name
    program: str
    maps: bool
    u_um: float  # of a predicted coordinate, root mean square
    u_common_um: float  # of the artefact's size
    u_turned_um: float  # besides, because the artefact was taken to lie in another direction
    contains: tuple[str, ...]  # its effects
    refitted: tuple[str, ...]  # those that were estimated anew
    shift_mm: tuple[float, ...]  # of its frame against the recording's
    turn_deg: float
    farthest_mm: float  # from a recorded point to the predicted one
    rms_predicted_um: float  # in the observations

    def data(self, corrections: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
        return {
            "files_sha256": dict(self.files), "program": self.program, "kind": "map" if self.maps else "prediction",
            "u_um": self.u_um, "u_common_um": self.u_common_um, "u_turned_um": self.u_turned_um,
            "effects": list(self.contains), "refitted": dict(corrections), "farthest_mm": self.farthest_mm,
            "frame": {"shift_mm": list(self.shift_mm), "turn_deg": self.turn_deg}, "rms_predicted_um": self.rms_predicted_um,
        }  # fmt: skip
