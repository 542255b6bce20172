"""The adjustment that the machine needs, and the distance equations as a second way to it (US 4,437,151)."""

from __future__ import annotations

from cmm_uq.documents.document import Block, Column, Paragraph, Section, Table
from cmm_uq.documents.result import Result
from cmm_uq.documents.wording import expanded
from cmm_uq.kinds.distances.adjustment import ANGLES, Setting
from cmm_uq.kinds.distances.equations import FACTORS, DistanceSolution
from cmm_uq.uncertainty.rounding import rounded
from cmm_uq.units import MICROMETRE


def section(
    result: Result, settings: tuple[Setting, ...], second_way: DistanceSolution | str, *remarks: str
) -> Section:
    """What to turn or enter, by the fitted model; beside it the six factors by the distance equations.

    Parameters
    ----------
    settings : by the fitted model.
    second_way : solution of equation 100, or why there is none.
    remarks : on the second way.
    """
    blocks = [*_adjustments(settings), *_second_way(result, second_way, remarks)]
    return Section("The adjustment that the machine needs", tuple(blocks))


def _adjustments(settings: tuple[Setting, ...]) -> list[Block]:
    rows = []
    for setting in settings:
        value, U, _ = expanded(setting.figure)
        over = setting.over_travel
        moved = "" if over is None else rounded(over.value, max(over.u, 1e-3))[0]
        needed = "yes" if setting.beyond_doubt else ""
        rows.append((setting.adjustment.what, value, U, setting.figure.unit, moved, needed))
    if not rows:
        return []
    columns = (
        Column("Adjustment", numeric=False), Column("Figure"), Column("U"), Column("Unit", numeric=False),
        Column("Over the travel", "µm"), Column("Beyond doubt", numeric=False),
    )  # fmt: skip
    notes = (
        "X stays; Y is turned square to X, then Z to both. Turns are right-handed about the named axis.",
        "Beyond doubt: the 95 % interval does not contain zero. Over the travel: what the adjustment moves at its far end.",
    )
    return [Table("What to turn and what to enter", columns, tuple(rows), notes)]


def _second_way(result: Result, solution: DistanceSolution | str, remarks: tuple[str, ...]) -> list[Block]:
    if isinstance(solution, str):
        return [Paragraph(f"The distance equations (US 4,437,151) have no solution here. {solution}", tone="note")]
    values = [*solution.scales_ppm, *solution.squareness_arcsec]
    rows = []
    for i, (effect, _) in enumerate(FACTORS):
        unit = "ppm" if i < 3 else "″"
        value, u = (
            rounded(float(values[i]), float(2 * solution.u[i])) if solution.u[i] > 0 else (f"{values[i]:.4g}", "")
        )
        name = f"Scale error of {effect[-1].upper()}" if i < 3 else f"Angle {ANGLES[effect]} − 90°"
        model = result.parameters.get(effect)
        beside = "" if model is None else expanded(next(iter(model.values())))[0]
        beside = "not determined" if effect in result.free else beside
        rows.append((name, value, u, beside, unit))
    columns = (
        Column("Factor", numeric=False), Column("Distance equations"), Column("U"), Column("Fitted model"),
        Column("Unit", numeric=False),
    )  # fmt: skip
    e = ", ".join(f"e{i} = {v:.3e}".replace("-", "−") for i, v in enumerate(solution.e, 1))
    sd = f"{solution.residual_sd / MICROMETRE:.3g} µm"
    notes = (
        f"US 4,437,151, equations 100 and 102 to 107, solved by QR: {e}; residual standard deviation {sd}.",
        "U (k = 2) from the residuals alone; the artefact's length is taken as known.",
        *remarks,
    )
    return [Table("The six factors by the distance equations, a second way", columns, tuple(rows), notes)]
