"""The adjustment that the machine needs, and the distance equations as a second way to it (US 4,437,151)."""

from __future__ import annotations

from cmm_uq.artefacts.distances.equations import FACTORS, DistanceSolution
from cmm_uq.artefacts.distances.lengths import ANGLES, AdjustmentSetting
from cmm_uq.base.messages import NOTHING, Text, Verbatim, commas, number, say, signed
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import Block, Column, Paragraph, Section, Table
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.wording import expanded
from cmm_uq.maths.uncertainty.quantity import rounded


def section(
    result: Result, settings: tuple[AdjustmentSetting, ...], second_way: DistanceSolution | Text, *remarks: Text
) -> Section:
    blocks = [*_adjustments(settings), *_second_way(result, second_way, remarks)]
    return Section(say("The adjustment that the machine needs"), tuple(blocks), opinion=True)


def _adjustments(settings: tuple[AdjustmentSetting, ...]) -> list[Block]:
    rows: list[tuple[Text, ...]] = []
    for setting in settings:
        value, U, _ = expanded(setting.figure)
        over = setting.over_travel
        moved = NOTHING if over is None else rounded(over.value, max(over.u, 1e-3))[0]
        needed = say("yes") if setting.beyond_doubt else NOTHING
        rows.append((setting.adjustment.what, value, U, setting.figure.unit, moved, needed))
    if not rows:
        return []
    columns = (
        Column(say("Adjustment"), numeric=False),
        Column(say("Value")),
        Column(say("U")),
        Column(say("Unit"), numeric=False),
        Column(say("Over the travel"), unit("µm")),
        Column(say("Beyond doubt"), numeric=False),
    )
    notes = (
        say(
            "X stays; Y is turned square to X, then Z to both, about X first. Turns are right-handed about the named axis."
        ),
        say(
            "Beyond doubt: the 95 % interval does not contain zero. Over the travel: what the adjustment "
            "moves at its far end."
        ),
    )
    return [Table(say("What to turn and what to enter"), columns, tuple(rows), notes)]


def _second_way(result: Result, solution: DistanceSolution | Text, remarks: tuple[Text, ...]) -> list[Block]:
    if isinstance(solution, str):
        return [
            Paragraph(
                say("The distance equations (US 4,437,151) have no solution here. {solution}", solution=solution),
                tone="note",
            )
        ]
    values, stated = [*solution.scales_ppm, *solution.squareness_arcsec], solution.expanded(result.at_least)
    rows: list[tuple[Text, ...]] = []
    for i, (effect, _) in enumerate(FACTORS):
        value: Text = number(values[i], ".4g")
        U, k = NOTHING, NOTHING
        if stated is not None:
            value, U = rounded(float(values[i]), stated[i][0])
            k = number(stated[i][1], ".2f")
        name = (
            say("Scale error of {axis}", axis=Verbatim(effect[-1].upper()))
            if i < 3
            else say("Angle {plane} − 90°", plane=Verbatim(ANGLES[effect]))
        )
        if solution.open_scales and i < 3:
            value, U, k = say("not determined"), NOTHING, NOTHING
        model = result.parameters.get(effect)
        beside = (NOTHING, NOTHING) if model is None else expanded(next(iter(model.values())))[:2]
        beside = (say("not determined"), NOTHING) if effect in result.free else beside
        rows.append((name, value, U, k, *beside, unit("ppm") if i < 3 else unit("″")))
    columns = (
        Column(say("Factor"), numeric=False),
        Column(say("Distance equations")),
        Column(say("U")),
        Column(say("k")),
        Column(say("Fitted model")),
        Column(say("U")),
        Column(say("Unit"), numeric=False),
    )
    e = commas(say("e{i} = {e}", i=i, e=signed(v, ".3e")) for i, v in enumerate(solution.e, 1))
    sd = say("{residual_sd:.3g} µm", residual_sd=solution.residual_sd / MICROMETRE)
    notes = (
        say(
            "US 4,437,151, equations 100 and 102 to 107, solved by QR: {factors}; residual standard deviation {sd}.",
            factors=e,
            sd=sd,
        ),
        _why_they_differ(solution),
        *remarks,
    )
    return [Table(say("The six factors by the distance equations, a second way"), columns, tuple(rows), notes)]


def _why_they_differ(solution: DistanceSolution) -> Text:
    if solution.relative_length_u:
        return say(
            "Distance equations: U from their residuals and from the certified length, conditional on white noise; k of "
            "Student's t. Fitted model: U averaged over what the noise may be."
        )
    return say(
        "Distance equations: U from their residuals, conditional on white noise and on the artefact's length as known; k of "
        "Student's t. Fitted model: U averaged over what the noise may be, and over the length."
    )
