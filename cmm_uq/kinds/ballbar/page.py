"""What a certificate shows of a ballbar: its lengths by position, and the residuals in the machine's volume."""

from __future__ import annotations

from cmm_uq.documents.budget_page import budget_blocks
from cmm_uq.documents.document import Column, Section, Table
from cmm_uq.documents.outcome import Page
from cmm_uq.documents.plots import length_plot
from cmm_uq.documents.residual_volume import residual_volume
from cmm_uq.documents.result import Result
from cmm_uq.kinds.ballbar.analysis import figures, results
from cmm_uq.kinds.distances import page as adjustment_section
from cmm_uq.kinds.distances.lengths import Lengths
from cmm_uq.uncertainty.rounding import rounded
from cmm_uq.units import MICROMETRE

_ROWS_SHOWN = 60


def sections(result: Result) -> list[Section]:
    """Lengths by position, and residuals in the volume."""
    found, size = figures(result), result.artefact.sizes[0]
    lengths, name = found.lengths, "certified length" if size.certified else "mean length"
    deviations, residuals, expanded = lengths.deviation_um, lengths.residual_um, lengths.expanded_um
    plot = length_plot(
        lengths.measurement.astype(float), deviations, residuals, flagged=lengths.flagged,
        expanded_before_um=expanded, expanded_after_um=expanded, reference=f"{name} {lengths.reference:.4f}\u00a0mm",
        reference_expanded_um=2 * size.sd / MICROMETRE if size.certified else 0.0,
        caption=f"Deviation of each length from the {name}, as recorded and after the fitted model, with U (k = 2).",
        alternative=(
            f"{len(deviations)} lengths: as recorded they deviate by {deviations.min():.0f} to {deviations.max():.0f} µm from "
            f"the {name}; after the fitted model {residuals.min():.0f} to {residuals.max():.0f} µm remain."
        ),
    )  # fmt: skip
    volume = residual_volume(result, "bars")
    return [
        Section("Lengths", (plot, volume, _table(lengths, name))),
        Section("Budget of one length", tuple(budget_blocks("the deviation of one length", found.budget))),
        adjustment_section.section(result, found.settings, found.second_way),
    ]


def _table(lengths: Lengths, name: str) -> Table:
    expanded, repeated = lengths.expanded_um, lengths.repeat.max() > 1
    rows = []
    for i in range(min(len(lengths.length), _ROWS_SHOWN)):
        shown, _ = rounded(float(lengths.length[i]), expanded * MICROMETRE)
        deviation, _ = rounded(float(lengths.deviation_um[i]), expanded)
        residual, _ = rounded(float(lengths.residual_um[i]), expanded)
        place = f"{lengths.measurement[i]}" + (f" ({lengths.repeat[i]})" if repeated else "")
        mark = "set aside" if not lengths.used[i] else "see warnings" if lengths.flagged[i] else ""
        rows.append((place, shown, deviation, residual, mark))
    columns = (
        Column("Position", numeric=False), Column("Length", "mm"), Column(f"From the {name}", "µm"),
        Column("Residual", "µm"), Column("Remark", numeric=False),
    )  # fmt: skip
    left = len(lengths.length) - len(rows)
    note = f"U = {rounded(0.0, expanded)[1]} µm (k = 2) for each length, from the standard uncertainty of a coordinate."
    notes = (note, f"{left} more lengths are in the attached recording.") if left > 0 else (note,)
    return Table("Lengths brought to 20 °C", columns, tuple(rows), notes)


PAGE = Page(sections, results)
