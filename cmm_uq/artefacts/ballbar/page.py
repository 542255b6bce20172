"""What the certificate of a ballbar states and shows beside the estimates."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import hypot
from typing import Any, cast

from cmm_uq.artefacts.ballbar.observe import Ballbar
from cmm_uq.artefacts.distances import page as adjustment_section
from cmm_uq.artefacts.distances.equations import DistanceSolution, second_way_data, solve_distances
from cmm_uq.artefacts.distances.lengths import AdjustmentSetting, Lengths, lengths_of, settings
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, Verbatim, number, say
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import Column, Section, Table
from cmm_uq.certificate.outcome import Page
from cmm_uq.certificate.pages.budget import budget_blocks
from cmm_uq.certificate.plots.residuals import length_plot, residual_volume
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.wording import deviating, numbered, refusal
from cmm_uq.maths.uncertainty.budget import Budget, BudgetLine
from cmm_uq.maths.uncertainty.budget_results import budget_data
from cmm_uq.maths.uncertainty.quantity import rounded


@dataclass(frozen=True, eq=False)
class BallbarFigures:
    """Lengths against the certified one, or their mean; the budget of one; what to adjust, and the second way to it."""

    lengths: Lengths
    budget: Budget
    settings: tuple[AdjustmentSetting, ...]
    second_way: DistanceSolution | Text


def figures(result: Result) -> BallbarFigures:
    bar = cast("Ballbar", result.artefact)
    lengths = bar.lengths()
    reference = bar.sizes[0].nominal if bar.sizes[0].certified else float(lengths.mean())
    return BallbarFigures(
        lengths_of(result, lengths, reference), _budget(result, bar), settings(result), _second_way(result, bar)
    )


def results(result: Result) -> dict[str, Any]:
    found = figures(result)
    return {
        "lengths": found.lengths.as_data(),
        "length_budget": budget_data(found.budget),
        "adjustments": [setting.as_data() for setting in found.settings],
        **second_way_data(found.second_way, result.at_least),
    }


def _budget(result: Result, bar: Ballbar) -> Budget:
    """What one length's deviation from the reference is uncertain by: the readings, and the certified length."""
    coordinate = result.noise.coordinate
    origin = say("residuals of this recording") if coordinate.u > 0 else say("stated in the job")
    lines = [
        BudgetLine(
            say("Coordinate of a ball, along the bar, twice"),
            coordinate.value,
            origin,
            unit=unit("µm"),
            dof=coordinate.degrees_of_freedom,
            sensitivity=float(bar.noise_scale[0]),
        )
    ]
    size = bar.sizes[0]
    if size.certified and size.sd > 0:
        chain = result.job.facts.artefact.certificate
        number = chain.number if chain else ""
        source = say("certificate {number}", number=Verbatim(number)) if number else say("certificate")
        lines.append(
            BudgetLine(say("Certified length"), size.sd / MICROMETRE, source, unit=unit("µm"), sensitivity=-1.0)
        )
    return Budget(say("deviation of one length"), lines, unit=unit("µm"))


def _second_way(result: Result, bar: Ballbar) -> DistanceSolution | Text:
    size, ends, used = bar.sizes[0], bar.ends(), result.model.used
    if not size.certified:
        return say("The length of the bar is not certified.")
    try:
        found = solve_distances((ends[:, 1] - ends[:, 0])[used], (size.nominal * bar.expansion)[used])
        return replace(found, relative_length_u=hypot(size.sd / size.nominal, result.relative_doubt))
    except CmmUqError as error:
        return refusal(error)


_ROWS_SHOWN = 60


def sections(result: Result) -> list[Section]:
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
