"""What the certificate of a gauge states beside the estimates: each line by itself, and positions of the standard."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from cmm_uq.analysis.conformity.plans import ISO_10360_2, position_on, share_of_travel
from cmm_uq.artefacts.gauge_lines.lines import GaugeLine, lines_of
from cmm_uq.artefacts.gauge_lines.observe import StepGauge
from cmm_uq.base.messages import Text
from cmm_uq.base.units import MICROMETRE, PPM, unit
from cmm_uq.certificate.result import AtLeast, Result
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.maths.inference.doubt import Doubt
from cmm_uq.maths.inference.draws import evenly, uncertainty_of_sum

_DRAWS = 2000
"""Of the sizes of the noise, over which a line's uncertainties are taken."""


@dataclass(frozen=True, eq=False)
class LineFigures:
    """One line with what the noise and the certificate leave uncertain of it.

    Parameters
    ----------
    line : as recorded.
    position : in words.
    share : of the travel along it; ``None`` where no travel is stated.
    scale_u_ppm, scale_factor : standard uncertainty of the slope, and k for 95 %.
    gap_u_um, gap_factor : of the bidirectional error; ``None`` without one.
    at_least : raises a U that a certificate does not state.
    """

    line: GaugeLine
    position: Text
    share: float | None
    scale_u_ppm: float
    scale_factor: float
    gap_u_um: float | None
    gap_factor: float
    at_least: AtLeast

    @property
    def expanded_scale_ppm(self) -> tuple[float, float]:
        """U and k of the slope."""
        return self.at_least("lines.slope_ppm", self.scale_factor * self.scale_u_ppm, self.scale_factor, unit("µm/m"))

    @property
    def expanded_gap_um(self) -> tuple[float, float] | None:
        """U and k of the bidirectional error; ``None`` without one."""
        if self.gap_u_um is None:
            return None
        return self.at_least("lines.bidirectional_um", self.gap_factor * self.gap_u_um, self.gap_factor, unit("µm"))

    @property
    def short(self) -> bool:
        """Whether it is shorter than the standard asks for (ISO 10360-2:2009)."""
        return self.share is not None and self.share < ISO_10360_2.least_share

    def as_data(self) -> dict[str, Any]:
        """For results.json."""
        line, periodic = self.line, self.line.periodic
        return {
            "measurement": line.measurement,
            "position": self.position,
            "length_mm": line.length,
            "faces": line.faces,
            "slope_ppm": {
                "value": line.scale_ppm,
                "u": self.scale_u_ppm,
                "U": self.expanded_scale_ppm[0],
                "k": self.expanded_scale_ppm[1],
            },
            "off_slope_um": line.linearity / MICROMETRE,
            "bidirectional_um": None
            if line.gap is None
            else {
                "value": line.gap / MICROMETRE,
                "u": self.gap_u_um,
                "U": None if self.expanded_gap_um is None else self.expanded_gap_um[0],
                "k": self.gap_factor if self.expanded_gap_um is None else self.expanded_gap_um[1],
            },
            "periodic": None
            if periodic is None
            else {
                "amplitude_um": periodic.amplitude / MICROMETRE,
                "period_mm": periodic.period,
                "p_value": periodic.p_value,
            },
            "share_of_travel": self.share,
        }


@dataclass(frozen=True, eq=False)
class GaugeFigures:
    """Every line, and which of the seven positions of ISO 10360-2:2009 were not measured."""

    lines: tuple[LineFigures, ...]
    missing: tuple[Text, ...]


def figures(result: Result) -> GaugeFigures:
    """Of a result."""
    gauge, sizes = cast("StepGauge", result.artefact), result.posterior.sizes
    every = replace(result.model, used=np.ones_like(result.model.used))
    components, sizes = noise_of(every), sizes.at(evenly(len(sizes.placing), _DRAWS))
    size, machine = gauge.sizes[0], gauge.points.machine
    relative = size.sd / size.nominal if size.certified else 0.0
    lines = []
    for line in lines_of(gauge):
        weights = np.stack([line.scale_weights, line.gap_weights / MICROMETRE])
        doubt = Doubt.of(result.causes, weights)
        if not gauge.certificate.plain:
            relative = abs(float(line.scale_weights @ gauge.size_change()[:, 0])) * size.sd * PPM
        beside = float(np.hypot(relative / PPM, np.sqrt(doubt.variance(np.array([1.0, 0.0])))))
        scale_u, scale_expanded = uncertainty_of_sum(components, sizes, line.scale_weights, beside)
        gap_u, gap_expanded = uncertainty_of_sum(
            components, sizes, weights[1], float(np.sqrt(doubt.variance(np.array([0.0, 1.0]))))
        )
        lines.append(LineFigures(
            line, position_on(machine, line.middle, line.direction),
            share_of_travel(machine, line.middle, line.direction, line.length),
            scale_u, scale_expanded / scale_u, None if line.gap is None else gap_u,
            gap_expanded / gap_u if gap_u else 2.0, result.at_least,
        ))  # fmt: skip
    found = {one.position for one in lines}
    return GaugeFigures(tuple(lines), tuple(position for position in ISO_10360_2.positions if position not in found))


def results(result: Result) -> dict[str, Any]:
    """The same for results.json."""
    found = figures(result)
    return {"lines": [line.as_data() for line in found.lines], "positions_not_measured": list(found.missing)}
