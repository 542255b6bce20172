"""What a certificate shows of a ballbar: its lengths by position, and the residuals in the machine's volume."""

from __future__ import annotations

from cmm_uq.artefacts.ballbar.analysis import figures, results
from cmm_uq.artefacts.distances import page as adjustment_section
from cmm_uq.artefacts.distances.lengths import Lengths
from cmm_uq.base.messages import NOTHING, Text, number, say
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import Column, Section, Table
from cmm_uq.certificate.outcome import Page
from cmm_uq.certificate.pages.budget import budget_blocks
from cmm_uq.certificate.plots.residuals import length_plot, residual_volume
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.wording import deviating, numbered
from cmm_uq.maths.uncertainty.quantity import rounded

_ROWS_SHOWN = 60


def sections(result: Result) -> list[Section]:
    """Lengths by position, and residuals in the volume."""
    found, size = figures(result), result.artefact.sizes[0]
    lengths, name = found.lengths, (say("certified length") if size.certified else say("mean length"))
    deviations, residuals, expanded = lengths.deviation_um, lengths.residual_um, lengths.expanded_um
    plot = length_plot(
        lengths.measurement.astype(float),
        deviations,
        residuals,
        flagged=lengths.flagged,
        expanded_before_um=expanded,
        expanded_after_um=expanded,
        reference=say("{name} {length:.4f}\u00a0mm", name=name, length=lengths.reference),
        reference_expanded_um=2 * size.sd / MICROMETRE if size.certified else 0.0,
        caption=say(
            "Deviation of each length from the {name}, as recorded and after the fitted model, with U (k = {k}).",
            name=name,
            k=number(lengths.coverage_factor, ".2f"),
        ),
        alternative=deviating(
            say("{count} lengths: as recorded they deviate", count=len(deviations)),
            say("from the {name}", name=name), deviations, residuals, ".0f",
        ),
    )  # fmt: skip
    volume = residual_volume(result, say("bars"))
    return [
        Section(say("Lengths"), (plot, volume, _table(lengths, name))),
        Section(say("Budget of one length"), tuple(budget_blocks(say("the deviation of one length"), found.budget))),
        adjustment_section.section(result, found.settings, found.second_way),
    ]


def _table(lengths: Lengths, name: Text) -> Table:
    expanded, repeated = lengths.expanded_um, lengths.repeat.max() > 1
    rows = []
    for i in range(min(len(lengths.length), _ROWS_SHOWN)):
        shown, _ = rounded(float(lengths.length[i]), expanded * MICROMETRE)
        deviation, _ = rounded(float(lengths.deviation_um[i]), expanded)
        residual, _ = rounded(float(lengths.residual_um[i]), expanded)
        place = numbered(lengths.measurement[i], lengths.repeat[i] if repeated else None)
        mark = say("set aside") if not lengths.used[i] else say("see warnings") if lengths.flagged[i] else NOTHING
        rows.append((place, shown, deviation, residual, mark))
    columns = (
        Column(say("Position"), numeric=False),
        Column(say("Length"), unit("mm")),
        Column(say("From the {name}", name=name), unit("µm")),
        Column(say("Residual"), unit("µm")),
        Column(say("Remark"), numeric=False),
    )
    left = len(lengths.length) - len(rows)
    note = say(
        "U = {U} µm (k = {k}) for each length, from the standard uncertainty of a coordinate and how well that is known.",
        U=rounded(0.0, expanded)[1],
        k=number(lengths.coverage_factor, ".2f"),
    )
    notes = (note, say("{left} more lengths are in the attached recording.", left=left)) if left > 0 else (note,)
    return Table(say("Lengths brought to 20 °C"), columns, tuple(rows), notes)


PAGE = Page(sections, results)
