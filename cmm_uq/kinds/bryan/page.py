"""What a certificate shows of a Bryan gauge: distances from the fixed ball, residuals, and the adjustment."""

from __future__ import annotations

from typing import cast

import numpy as np

from cmm_uq.documents.document import Section
from cmm_uq.documents.outcome import Page
from cmm_uq.documents.plots import length_plot
from cmm_uq.documents.residual_volume import flagged, residual_volume
from cmm_uq.documents.result import Result
from cmm_uq.errors import CmmUqError
from cmm_uq.kinds.bryan.observe import Bryan
from cmm_uq.kinds.distances import page as adjustment_section
from cmm_uq.kinds.distances.equations import DistanceSolution
from cmm_uq.units import MICROMETRE

IN_TWO_STEPS = (
    "The fixed ball is found first, as if the machine had no errors, and its centre takes up part of them. The fitted model "
    "finds all at once and is the better."
)


def sections(result: Result) -> list[Section]:
    """Distances by position, residuals in the volume, what to adjust."""
    bar = cast("Bryan", result.artefact)
    distances = bar.distances(bar.points.xyz, None) / bar.expansion
    deviations, residuals = (distances - distances.mean()) / MICROMETRE, result.residuals / MICROMETRE
    expanded = 2 * result.noise.coordinate.value
    plot = length_plot(
        bar.measurement.astype(np.float64), deviations, residuals, expanded_before_um=expanded,
        expanded_after_um=expanded, reference="mean distance from the best centre", flagged=flagged(result),
        position_label="Position of the swept ball",
        caption="Distance of the swept ball from the fixed one, as recorded and after the fitted model, with U (k = 2).",
        alternative=(
            f"{len(distances)} positions: about the best centre the distances deviate by {deviations.min():.1f} to "
            f"{deviations.max():.1f} µm; after the fitted model {residuals.min():.1f} to {residuals.max():.1f} µm remain."
        ),
    )  # fmt: skip
    try:
        second_way: DistanceSolution | str = bar.in_two_steps()[0]
    except CmmUqError as refusal:
        second_way = str(refusal)
    return [
        Section("Distances", (plot, residual_volume(result, "swept positions"))),
        adjustment_section.section(result, second_way, IN_TWO_STEPS),
    ]


PAGE = Page(sections)
