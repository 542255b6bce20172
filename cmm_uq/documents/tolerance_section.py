"""Parameters against the tolerances that the job sets for them, and the picture of which is out."""

from __future__ import annotations

from cmm_uq.documents.document import Column, Section, Table
from cmm_uq.documents.result import Result
from cmm_uq.documents.tolerance_plot import tolerance_plot
from cmm_uq.documents.wording import expanded, listed
from cmm_uq.uncertainty.quantity import Quantity


def sections(result: Result) -> list[Section]:
    """Every parameter with a tolerance; none when the job sets none."""
    tolerances = result.job.facts.model.tolerances
    free = {effect for combination in result.undetermined for effect, _ in combination}
    judged = {
        effect.name: (effect.title, next(iter(result.parameters[effect.name].values())), tolerances[effect.name])
        for effect in result.model.effects
        if effect.name in tolerances and effect.name not in free
    }
    if not judged:
        return []
    rows, verdicts = [], {}
    for title, quantity, tolerance in judged.values():
        value, U, _ = expanded(quantity)
        verdicts[title] = verdict(quantity, tolerance)
        rows.append((title, value, U, f"{tolerance:g}", quantity.unit, verdicts[title]))
    columns = (
        Column("Parameter", numeric=False), Column("Estimate"), Column("U"), Column("Tolerance"),
        Column("Unit", numeric=False), Column("Verdict", numeric=False),
    )  # fmt: skip
    left_out = sorted(set(tolerances) - set(judged))
    notes = ["In or out: the whole 95 % interval is; otherwise open."]
    if left_out:
        notes.append(f"Not determined by this recording, so not judged: {listed(left_out)}.")
    out = [title for title, said in verdicts.items() if said == "out"]
    ratios = [(q.value / t, q.interval95[0] / t, q.interval95[1] / t) for _, q, t in judged.values()]
    plot = tolerance_plot(
        list(verdicts), *map(list, zip(*ratios, strict=True)),
        caption="Each parameter over its tolerance, with its 95 % interval.",
        alternative=f"Out of tolerance: {listed(out)}." if out else "No parameter is out of tolerance.",
    )  # fmt: skip
    return [
        Section(
            "Tolerances by parameter", (plot, Table("Parameters and tolerances", columns, tuple(rows), tuple(notes)))
        )
    ]


def verdict(quantity: Quantity, tolerance: float) -> str:
    """``in`` or ``out`` when the whole coverage interval is, else ``open``; the tolerance holds for either sign."""
    low, high = quantity.interval95
    if -tolerance <= low and high <= tolerance:
        return "in"
    return "out" if low > tolerance or high < -tolerance else "open"
