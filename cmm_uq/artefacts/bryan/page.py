"""What a certificate shows of a Bryan gauge: distances from the fixed ball, residuals, and the adjustment."""

from __future__ import annotations

from cmm_uq.artefacts.bryan.analysis import figures, results
from cmm_uq.artefacts.distances import page as adjustment_section
from cmm_uq.base.messages import NOTHING, number, say
from cmm_uq.certificate.document import Section
from cmm_uq.certificate.outcome import Page
from cmm_uq.certificate.plots.residuals import length_plot, residual_volume
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.wording import deviating

IN_TWO_STEPS = say(
    "The fixed ball is found first, as if the machine had no errors, and its centre takes up part of them: what this makes of "
    "readings without noise is in U. The fitted model finds all at once and is the better."
)


def sections(result: Result) -> list[Section]:
    """Distances by position, residuals in the volume, what to adjust."""
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
