"""What the certificate of a Bryan gauge states and shows beside the estimates."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from cmm_uq.artefacts.bryan.observe import Bryan
from cmm_uq.artefacts.distances import page as adjustment_section
from cmm_uq.artefacts.distances.equations import FACTORS, DistanceSolution, second_way_data
from cmm_uq.artefacts.distances.lengths import AdjustmentSetting, Lengths, lengths_of, settings
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, number, say
from cmm_uq.certificate.document import Section
from cmm_uq.certificate.outcome import Page
from cmm_uq.certificate.plots.residuals import length_plot, residual_volume
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.wording import deviating, refusal


@dataclass(frozen=True, eq=False)
class BryanFigures:
    """Distances of the swept ball from the best centre against their mean, what to adjust, and the second way to it."""

    lengths: Lengths
    settings: tuple[AdjustmentSetting, ...]
    second_way: DistanceSolution | Text


def figures(result: Result) -> BryanFigures:
    bar = cast("Bryan", result.artefact)
    distances = bar.distances(bar.points.xyz, None) / bar.expansion
    lengths = lengths_of(result, distances, float(distances.mean()))
    return BryanFigures(lengths, settings(result), _second_way(result, bar))


def _second_way(result: Result, bar: Bryan) -> DistanceSolution | Text:
    """The patent's way; its bias is what it makes of readings without noise on the machine that the model finds."""
    found = result.values.mean(axis=0)
    try:
        solution, exact = (bar.in_two_steps(xyz=xyz)[0] for xyz in (None, result.model.predicted(found)))
    except CmmUqError as error:
        return refusal(error)
    model = result.model.reported(found[None])
    true = np.array([model[key][0][0] if key in model else 0.0 for key in FACTORS])
    size = bar.sizes[0]
    return replace(
        solution, bias=np.array([*exact.scales_ppm, *exact.squareness_arcsec]) - true, open_scales=not size.certified,
        relative_length_u=float(np.hypot(size.sd / size.nominal, result.relative_doubt)) if size.certified else 0.0,
    )  # fmt: skip


def results(result: Result) -> dict[str, Any]:
    found = figures(result)
    return {
        "lengths": found.lengths.as_data(),
        "adjustments": [setting.as_data() for setting in found.settings],
        **second_way_data(found.second_way, result.at_least),
    }


IN_TWO_STEPS = say(
    "The fixed ball is found first, as if the machine had no errors, and its centre takes up part of them: what this makes of "
    "readings without noise is in U. The fitted model finds all at once and is the better."
)


def sections(result: Result) -> list[Section]:
    found = figures(result)
    lengths = found.lengths
    deviations, residuals = lengths.deviation_um, lengths.residual_um
    plot = length_plot(
        lengths.measurement.astype(float),
        deviations,
        residuals,
        expanded_before_um=lengths.expanded_um,
        expanded_after_um=lengths.expanded_um,
        reference=say("mean distance from the best centre"),
        flagged=lengths.flagged,
        position_label=say("Position of the swept ball"),
        caption=say(
            "Distance of the swept ball from the fixed one, as recorded and after the fitted model, with U (k = {k}).",
            k=number(lengths.coverage_factor, ".2f"),
        ),
        alternative=deviating(
            say("{count} positions: about the best centre the distances deviate", count=len(deviations)), NOTHING,
            deviations, residuals,
        ),
    )  # fmt: skip
    return [
        Section(say("Distances"), (plot, residual_volume(result, say("swept positions")))),
        adjustment_section.section(result, found.settings, found.second_way, IN_TWO_STEPS),
    ]


PAGE = Page(sections, results)
