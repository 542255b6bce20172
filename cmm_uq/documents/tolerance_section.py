"""Parameters against the tolerances that the job sets for them, and the picture of which is out."""

from __future__ import annotations

from cmm_uq.documents.document import Column, Section, Table
from cmm_uq.documents.result import Result
from cmm_uq.documents.tolerance_plot import tolerance_plot
from cmm_uq.documents.wording import expanded
from cmm_uq.messages import listed, names, number, say
from cmm_uq.units import unit

_VERDICTS = {"in": say("in"), "out": say("out"), "open": say("open")}


def sections(result: Result) -> list[Section]:
    """Every parameter with a tolerance; none when the job sets none."""
    judged = result.judged
    if not judged:
        return []
    rows = []
    for one in judged:
        value, U, _ = expanded(one.quantity)
        rows.append((one.title, value, U, number(one.tolerance, "g"), one.quantity.unit, _VERDICTS[one.verdict]))
    columns = (
        Column(say("Parameter"), numeric=False), Column(say("Estimate")), Column(say("U")), Column(say("Tolerance")),
        Column(say("Unit"), numeric=False), Column(say("Verdict"), numeric=False),
    )  # fmt: skip
    left_out = sorted(set(result.job.facts.model.tolerances) - {one.effect for one in judged})
    notes = [say("In or out: the whole 95 % interval is; otherwise open.")]
    if left_out:
        notes.append(
            say("Not determined by this recording, so not judged: {left_out}.", left_out=listed(names(left_out)))
        )
    out = [one.title for one in judged if one.verdict == "out"]
    ratios = [
        (part.value, *part.interval95) for part in (one.quantity.times(1 / one.tolerance, unit("1")) for one in judged)
    ]
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
            say("Tolerances by parameter"),
            (plot, Table(say("Parameters and tolerances"), columns, tuple(rows), tuple(notes))),
        )
    ]
