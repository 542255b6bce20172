"""Parameters against the tolerances that the job sets for them, and the picture of which is out."""

from __future__ import annotations

from cmm_uq.documents.document import Column, Section, Table
from cmm_uq.documents.result import Result
from cmm_uq.documents.tolerance_plot import tolerance_plot
from cmm_uq.documents.wording import expanded, listed


def sections(result: Result) -> list[Section]:
    """Every parameter with a tolerance; none when the job sets none."""
    judged = result.judged
    if not judged:
        return []
    rows = []
    for one in judged:
        value, U, _ = expanded(one.quantity)
        rows.append((one.title, value, U, f"{one.tolerance:g}", one.quantity.unit, one.verdict))
    columns = (
        Column("Parameter", numeric=False), Column("Estimate"), Column("U"), Column("Tolerance"),
        Column("Unit", numeric=False), Column("Verdict", numeric=False),
    )  # fmt: skip
    left_out = sorted(set(result.job.facts.model.tolerances) - {one.effect for one in judged})
    notes = ["In or out: the whole 95 % interval is; otherwise open."]
    if left_out:
        notes.append(f"Not determined by this recording, so not judged: {listed(left_out)}.")
    out = [one.title for one in judged if one.verdict == "out"]
    ratios = [(part.value, *part.interval95) for part in (one.quantity.times(1 / one.tolerance, "1") for one in judged)]
    plot = tolerance_plot(
        [one.title for one in judged], *map(list, zip(*ratios, strict=True)),
        caption="Each parameter over its tolerance, with its 95 % interval.",
        alternative=f"Out of tolerance: {listed(out)}." if out else "No parameter is out of tolerance.",
    )  # fmt: skip
    return [
        Section(
            "Tolerances by parameter", (plot, Table("Parameters and tolerances", columns, tuple(rows), tuple(notes)))
        )
    ]
