"""What a certificate shows of a ballbar: its lengths by position, and the residuals in the machine's volume."""

from __future__ import annotations

from typing import cast

import numpy as np

from cmm_uq.documents.budget_page import budget_blocks
from cmm_uq.documents.document import Column, Section, Table
from cmm_uq.documents.outcome import Page
from cmm_uq.documents.plots import length_plot
from cmm_uq.documents.residual_volume import flagged, residual_volume
from cmm_uq.documents.result import Result
from cmm_uq.errors import CmmUqError
from cmm_uq.kinds.ballbar.observe import Ballbar
from cmm_uq.kinds.distances import page as adjustment_section
from cmm_uq.kinds.distances.equations import DistanceSolution, solve_distances
from cmm_uq.uncertainty.budget import Budget, Line
from cmm_uq.uncertainty.rounding import rounded
from cmm_uq.units import MICROMETRE

_ROWS_SHOWN = 60


def sections(result: Result) -> list[Section]:
    """Lengths by position, and residuals in the volume."""
    bar = cast("Ballbar", result.artefact)
    lengths, residuals = bar.lengths(), result.residuals / MICROMETRE
    certified = bar.sizes[0].certified
    reference = bar.sizes[0].nominal if certified else float(lengths.mean())
    name = "certified length" if certified else "mean length"
    deviations = (lengths - reference) / MICROMETRE
    expanded = 2 * result.noise.coordinate.value * float(bar.noise_scale[0])
    plot = length_plot(
        bar.measurement.astype(np.float64), deviations, residuals, flagged=flagged(result),
        expanded_before_um=expanded, expanded_after_um=expanded, reference=f"{name} {reference:.4f}\u00a0mm",
        reference_expanded_um=2 * bar.sizes[0].sd / MICROMETRE if certified else 0.0,
        caption=f"Deviation of each length from the {name}, as recorded and after the fitted model, with U (k = 2).",
        alternative=(
            f"{len(lengths)} lengths: as recorded they deviate by {deviations.min():.0f} to {deviations.max():.0f} µm from "
            f"the {name}; after the fitted model {residuals.min():.0f} to {residuals.max():.0f} µm remain."
        ),
    )  # fmt: skip
    volume = residual_volume(result, "bars")
    return [
        Section("Lengths", (plot, volume, _table(result, bar, deviations, residuals, expanded, name))),
        Section("Budget of one length", tuple(budget_blocks("the deviation of one length", _budget(result, bar)))),
        adjustment_section.section(result, _second_way(result, bar)),
    ]


def _budget(result: Result, bar: Ballbar) -> Budget:
    """What one length's deviation from the reference is uncertain by: the readings, and the certified length."""
    coordinate = result.noise.coordinate
    origin = "residuals of this recording" if coordinate.u > 0 else "stated in the job"
    dof = float(result.least_squares.degrees_of_freedom) if coordinate.u > 0 else np.inf
    lines = [
        Line("Coordinate of a ball, along the bar, twice", coordinate.value, origin, unit="µm", dof=max(dof, 1.0),
             sensitivity=float(bar.noise_scale[0]))
    ]  # fmt: skip
    size = bar.sizes[0]
    if size.certified and size.sd > 0:
        chain = result.job.facts.artefact.certificate
        source = " ".join(filter(None, ("certificate", chain.number if chain else "")))
        lines.append(Line("Certified length", size.sd / MICROMETRE, source, unit="µm", sensitivity=-1.0))
    return Budget("deviation of one length", lines, unit="µm")


def _second_way(result: Result, bar: Ballbar) -> DistanceSolution | str:
    """The distance equations of all used lengths, or why they have no solution."""
    size, ends, used = bar.sizes[0], bar.ends(), result.model.used
    if not size.certified:
        return "The length of the bar is not certified."
    try:
        return solve_distances((ends[:, 1] - ends[:, 0])[used], (size.nominal * bar.expansion)[used])
    except CmmUqError as refusal:
        return str(refusal)


def _table(
    result: Result,
    bar: Ballbar,
    deviations: np.ndarray[tuple[int], np.dtype[np.float64]],
    residuals: np.ndarray[tuple[int], np.dtype[np.float64]],
    expanded: float,
    name: str,
) -> Table:
    rows = []
    marks = np.where(~result.model.used, "set aside", np.where(flagged(result), "see warnings", ""))
    for i, length in enumerate(bar.lengths()[:_ROWS_SHOWN]):
        shown, _ = rounded(float(length), expanded * MICROMETRE)
        deviation, _ = rounded(float(deviations[i]), expanded)
        residual, _ = rounded(float(residuals[i]), expanded)
        place = f"{bar.measurement[i]}" + (f" ({bar.repeat[i]})" if bar.repeat.max() > 1 else "")
        rows.append((place, shown, deviation, residual, str(marks[i])))
    columns = (
        Column("Position", numeric=False), Column("Length", "mm"), Column(f"From the {name}", "µm"),
        Column("Residual", "µm"), Column("Remark", numeric=False),
    )  # fmt: skip
    left = len(bar.lengths()) - len(rows)
    note = f"U = {rounded(0.0, expanded)[1]} µm (k = 2) for each length, from the standard uncertainty of a coordinate."
    notes = (note, f"{left} more lengths are in the attached recording.") if left > 0 else (note,)
    return Table("Lengths brought to 20 °C", columns, tuple(rows), notes)


PAGE = Page(sections)
