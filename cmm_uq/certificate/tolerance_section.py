"""Parameters against the tolerances that the job sets for them, and the picture of which is out."""

from __future__ import annotations

from cmm_uq.base.messages import listed, names, number, say
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import Column, Paragraph, Section, Table
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.summary import tolerances_of
from cmm_uq.certificate.tolerance_plot import tolerance_plot
from cmm_uq.certificate.wording import expanded

_WORDS = {"pass": say("in"), "fail": say("out"), "undecided": say("open")}


def sections(result: Result) -> list[Section]:
    """Every parameter with a tolerance; none when the job sets none."""
    toleranced = tolerances_of(result)
    left_out = sorted(one.name.partition(".")[0] for one in toleranced if one.value is None)
    unknown = say("Not determined by this recording, so not judged: {left_out}.", left_out=listed(names(left_out)))
    judged = [one for one in toleranced if one.value is not None]
    title = say("Tolerances by parameter")
    if not judged:
        return [Section(title, (Paragraph(unknown),))] if left_out else []
    rows, ratios = [], []
    for one in judged:
        effect, _, parameter = one.name.partition(".")
        quantity, tolerance = result.parameters[effect][parameter], result.job.facts.model.tolerances[effect]
        value, U, _ = expanded(quantity)
        rows.append((one.title, value, U, number(tolerance, "g"), one.unit, _WORDS[one.outcome]))
        part = quantity.times(1 / tolerance, unit("1"))
        ratios.append((part.value, *part.interval95))
    columns = (
        Column(say("Parameter"), numeric=False), Column(say("Estimate")), Column(say("U")), Column(say("Tolerance")),
        Column(say("Unit"), numeric=False), Column(say("Verdict"), numeric=False),
    )  # fmt: skip
    notes = [say("In or out: the whole 95 % interval is; otherwise open.")]
    if left_out:
        notes.append(unknown)
    out = [one.title for one in judged if one.outcome == "fail"]
    plot = tolerance_plot(
        [one.title for one in judged],
        *map(list, zip(*ratios, strict=True)),
        caption=say("Each parameter over its tolerance, with its 95 % interval."),
        alternative=say("Out of tolerance: {out}.", out=listed(out))
        if out
        else say("No parameter is out of tolerance."),
    )
    return [
        Section(
            title,
            (plot, Table(say("Parameters and tolerances"), columns, tuple(rows), tuple(notes))),
        )
    ]
